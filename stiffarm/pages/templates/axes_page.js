// The axes map: a course to drag through zones, the arm in its pose, the path in colours of its error.
const D = JSON.parse(document.getElementById("data").textContent), $ = id => document.getElementById(id);
const N = D.n, M = D.m, A = D.axes.length, RAILS = D.cell.rails.length;
const F32 = text => unpack(text, Float32Array);
const length = F32(D.length), angles = F32(D.gamma), Q = F32(D.q), travel = F32(D.travel), toolAt = unpack(D.tool, Uint8Array), value = F32(D.value), tips = F32(D.tips);
const cause = unpack(D.cause, Uint8Array), zone = unpack(D.zone, Uint8Array), error = D.error && F32(D.error);
const first = { gamma: F32(D.course.gamma), q: F32(D.course.q), value: F32(D.course.value), error: D.course.error && F32(D.course.error) };
const STEP = M > 1 ? angles[1] - angles[0] : 1, LOW = D.closed ? angles[0] : angles[0], HIGH = D.closed ? angles[0] + 360 : angles[M - 1];
const gamma = Float64Array.from(first.gamma, g => D.closed ? wrapped(g) : g), kept = Float64Array.from(gamma);
function wrapped(g) { return LOW + ((g - LOW) % 360 + 360) % 360; }
const text = (x, digits = 3) => {
  if (!Number.isFinite(x)) return "\u2013";
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(x) || 1)));
  return x.toLocaleString("en-US", { minimumFractionDigits: 0, maximumFractionDigits: Math.min(places, 3) }).replace("-", "\u2212");
};
const fixed = (x, digits) => x.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "\u2212");

// --- what stands behind a point at an angle ---
function cells(i, g) { // The two cells about an angle, and how far towards the second.
  const x = ((D.closed ? wrapped(g) : Math.min(Math.max(g, LOW), HIGH)) - LOW) / STEP, k = Math.min(Math.floor(x), D.closed ? M : M - 1), s = x - k;
  return [i * M + k % M, i * M + (D.closed ? (k + 1) % M : Math.min(k + 1, M - 1)), s];
}
const own = i => Math.abs(gamma[i] - kept[i]) < 1e-6;
function between(field, i, g) {
  const [a, b, s] = cells(i, g);
  return Number.isFinite(field[a]) && Number.isFinite(field[b]) ? field[a] * (1 - s) + field[b] * s : field[s < 0.5 ? a : b];
}
const causeAt = (i, g) => { const [a, b, s] = cells(i, g); return cause[s < 0.5 ? a : b]; };
const valueAt = i => own(i) ? first.value[i] : between(value, i, gamma[i]);
const errorAt = i => !error ? NaN : own(i) ? first.error[i] : between(error, i, gamma[i]);
const barred = i => own(i) ? 0 : causeAt(i, gamma[i]);
function joints(i) { // Of the pose at a point; null where there is none.
  if (own(i)) return [...first.q.subarray(A * i, A * i + A)];
  const [a, b, s] = cells(i, gamma[i]), near = s < 0.5 ? a : b, p = [...Q.subarray(A * a, A * a + A)], q = [...Q.subarray(A * b, A * b + A)];
  if ([...p, ...q].every(Number.isFinite) && p.every((x, k) => Math.abs(x - q[k]) < 0.6)) return p.map((x, k) => x * (1 - s) + q[k] * s);
  const one = near === a ? p : q;
  return one.every(Number.isFinite) ? one : null;
}
function badness(i) { // Large is bad: error, or the objective.
  const e = errorAt(i), v = valueAt(i);
  return barred(i) ? Infinity : error ? Math.abs(e) : D.quantity.small ? v : -v;
}
const worstPoint = () => { let worst = 0; for (let i = 1; i < N; i++) if (badness(i) > badness(worst)) worst = i; return worst; };

// --- colours ---
const LUT = D.colours.map(rgb), css = c => `rgb(${c.map(x => Math.round(255 * x)).join(",")})`;
const share = (x, low, high) => Math.min(D.colours.length - 1, Math.max(0, Math.round((x - low) / (high - low) * (D.colours.length - 1))));
const stiffTint = v => { const k = share(v, D.range[0], D.range[1]); return D.quantity.small ? D.colours.length - 1 - k : k; };
// Errors over the path as recommended and all that the map allows: one scale, whatever is dragged.
const errorTop = error ? Math.max(1e-9, ...first.error.map(Math.abs)) * 1.25 : 1;
const errorTint = e => D.colours.length - 1 - share(Math.abs(e), 0, errorTop);
const BARRED = D.colours.length;
const pieces = [];
for (let i = 1; i < N; i++) pieces.push([i - 1, i, 0]);
const scene = cellScene($("view"), D, { tips, pieces, width: 2.6, tints: shades => [...LUT, shades.ink] });
$("renderer").textContent = scene.renderer.name === "WebGL" ? "" : scene.renderer.name; $("renderer").title = scene.trouble;
const state = { at: 0, pose: [...first.q.subarray(0, A)] };
state.at = worstPoint();
function tintPath() {
  for (const p of pieces) p[2] = barred(p[1]) ? BARRED : error ? errorTint(errorAt(p[1])) : stiffTint(valueAt(p[1]));
  scene.recolour();
}
const gradient = colours => `linear-gradient(to right, ${colours.join(",")})`;
$("scaleName").textContent = error ? "path: predicted error, \u00b5m (black: barred)" : `path: ${D.quantity.name}${D.quantity.unit ? ", " + D.quantity.unit : ""} (black: barred)`;
$("pathBar").style.background = gradient(error || D.quantity.small ? [...D.colours].reverse() : D.colours);
$("scaleLow").textContent = error ? "0" : text(D.range[0]); $("scaleHigh").textContent = error ? `\u00b1${text(errorTop, 2)}` : text(D.range[1]);

// --- the arm ---
function coordinates(i) {
  state.pose = joints(i) ?? state.pose;
  return [...state.pose, ...travel.subarray(RAILS * i, RAILS * i + RAILS), ...(D.cell.table ? [D.table] : [])];
}
function drawArm() {
  const hot = new Map(), why = D.causes[barred(state.at)];
  why.bodies.forEach((name, k) => hot.set(name, k ? scene.shades().other : scene.shades().bad));
  const F = scene.frames(coordinates(state.at));
  scene.hold(toolAt[state.at]);
  scene.draw(F, hot);
  const p = scene.flatPoint(at(mul(F[scene.TABLE], D.cell.part), tips[3 * state.at], tips[3 * state.at + 1], tips[3 * state.at + 2]));
  $("mark").hidden = !p;
  if (p) { const [x, y] = scene.share(p); $("mark").style.left = x; $("mark").style.top = y; }
}

// --- the map ---
const map = $("map"), pen = map.getContext("2d"), back = document.createElement("canvas"), ROOM = { left: 54, right: 12, top: 10, bottom: 40 };
let box = { x: 0, y: 0, w: 1, h: 1, ratio: 1 };
const across = s => box.x + box.w * (s - length[0]) / ((length[N - 1] - length[0]) || 1), up = g => box.y + box.h * (HIGH - g) / (HIGH - LOW);
const style = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
function sized() {
  const ratio = window.devicePixelRatio || 1, w = Math.max(1, Math.round(map.clientWidth * ratio)), h = Math.max(1, Math.round(map.clientHeight * ratio));
  if (map.width !== w || map.height !== h) { map.width = w; map.height = h; }
  scene.keepShape(map);
  box = { ratio, x: ROOM.left, y: ROOM.top, w: Math.max(10, map.clientWidth - ROOM.left - ROOM.right), h: Math.max(10, map.clientHeight - ROOM.top - ROOM.bottom) };
}
const LIMITS = 2, SINGULAR = 3, COLLISION = 4;
function hatch(pen, kind) { // Zones differ by their lines, not by hue: out of reach none, limits one way, collisions both.
  const tile = document.createElement("canvas"); tile.width = tile.height = 8;
  const t = tile.getContext("2d"); t.fillStyle = style("--zone"); t.fillRect(0, 0, 8, 8); t.strokeStyle = t.fillStyle = style("--hatch"); t.lineWidth = kind === COLLISION ? 1.5 : 1;
  t.beginPath();
  if (kind === LIMITS || kind === COLLISION) { t.moveTo(0, 8); t.lineTo(8, 0); t.moveTo(-2, 2); t.lineTo(2, -2); t.moveTo(6, 10); t.lineTo(10, 6); }
  if (kind === COLLISION) { t.moveTo(0, 0); t.lineTo(8, 8); t.moveTo(-2, 6); t.lineTo(2, 10); t.moveTo(6, -2); t.lineTo(10, 2); }
  t.stroke();
  if (kind === SINGULAR) t.fillRect(3, 3, 2, 2);
  return pen.createPattern(tile, "repeat");
}
function paintBack() { // Everything that no drag changes.
  sized();
  back.width = map.width; back.height = map.height;
  const b = back.getContext("2d"); b.setTransform(box.ratio, 0, 0, box.ratio, 0, 0);
  b.fillStyle = style("--bg"); b.fillRect(0, 0, map.clientWidth, map.clientHeight);
  const fills = [0, 1, LIMITS, SINGULAR, COLLISION].map(k => hatch(b, k)), edge = i => across(i === 0 ? length[0] : i === N ? length[N - 1] : 0.5 * (length[i - 1] + length[i]));
  b.save(); b.beginPath(); b.rect(box.x, box.y, box.w, box.h); b.clip();
  for (let i = 0; i < N; i++) for (let j = 0; j < (D.closed ? M + 1 : M); j++) {
    const k = i * M + j % M, x = edge(i), y = up(LOW + (j + 0.5) * STEP), y1 = up(LOW + (j - 0.5) * STEP);
    b.fillStyle = cause[k] ? fills[zone[k]] : Number.isFinite(value[k]) ? D.colours[stiffTint(value[k])] : style("--zone");
    b.fillRect(x, y, edge(i + 1) - x + 0.6, y1 - y + 0.6);
  }
  b.restore();
  b.font = "12px system-ui,sans-serif"; b.fillStyle = style("--ink"); b.strokeStyle = style("--soft"); b.textAlign = "right"; b.textBaseline = "middle";
  const steps = box.h > 180 ? 45 : 90;
  for (let g = Math.ceil(LOW / steps) * steps; g <= HIGH + 1e-6; g += steps) b.fillText(`${fixed(g, 0)}\u00b0`, box.x - 6, up(g));
  b.textAlign = "center"; b.textBaseline = "top";
  const span = length[N - 1] - length[0], wide = 10 ** Math.floor(Math.log10(span || 1)), tick = [0.1, 0.2, 0.5, 1].map(k => k * wide).find(k => span / k <= Math.max(2, box.w / 90)) ?? wide;
  for (let s = Math.ceil(length[0] / tick) * tick; s <= length[N - 1] + 1e-6; s += tick) b.fillText(text(s, 6), Math.min(across(s), box.x + box.w - 12), box.y + box.h + 5);
  b.fillText("path, mm", box.x + box.w / 2, box.y + box.h + 21);
  b.save(); b.translate(12, box.y + box.h / 2); b.rotate(-Math.PI / 2); b.fillText("gamma", 0, -6); b.restore();
  const taken = [];
  b.textBaseline = "middle";
  for (const l of D.labels) {
    const w = b.measureText(l.words).width + 10, x = Math.min(Math.max(across(l.at), box.x + w / 2), box.x + box.w - w / 2), y = Math.min(Math.max(up(l.gamma), box.y + 10), box.y + box.h - 10);
    if (taken.some(t => Math.abs(t[0] - x) < (t[1] + w) / 2 && Math.abs(t[2] - y) < 20)) continue;
    taken.push([x, w, y]);
    b.fillStyle = style("--bg"); b.fillRect(x - w / 2, y - 9, w, 18); b.fillStyle = style("--ink"); b.fillText(l.words, x, y);
  }
}
function drawMap() {
  pen.setTransform(1, 0, 0, 1, 0, 0); pen.drawImage(back, 0, 0);
  pen.setTransform(box.ratio, 0, 0, box.ratio, 0, 0);
  const line = (g, colour, width, dash) => {
    pen.strokeStyle = colour; pen.lineWidth = width; pen.setLineDash(dash); pen.lineJoin = "round"; pen.beginPath();
    for (let i = 0; i < N; i++) { // A course that leaves at one end of the turn comes back at the other.
      const y = up(g[i]), jump = i && D.closed && Math.abs(g[i] - g[i - 1]) > 180;
      if (i && !jump) pen.lineTo(across(length[i]), y); else pen.moveTo(across(length[i]), y);
    }
    pen.stroke(); pen.setLineDash([]);
  };
  if (gamma.some((g, i) => Math.abs(g - kept[i]) > 1e-6)) { line(kept, "#ffffff", 3, [4, 4]); line(kept, "#000000", 1.2, [4, 4]); }
  line(gamma, "#ffffff", 6, []); line(gamma, "#000000", 2.6, []);
  const worst = worstPoint(), x = across(length[worst]), y = up(gamma[worst]);
  pen.fillStyle = "#ffffff"; pen.strokeStyle = "#000000"; pen.lineWidth = 1.6; pen.beginPath(); pen.moveTo(x - 7, y - 17); pen.lineTo(x + 7, y - 17); pen.lineTo(x, y - 6); pen.closePath(); pen.fill(); pen.stroke();
  const px = across(length[state.at]), py = up(gamma[state.at]);
  pen.strokeStyle = style("--ink"); pen.lineWidth = 1; pen.setLineDash([2, 3]); pen.beginPath(); pen.moveTo(px, box.y); pen.lineTo(px, box.y + box.h); pen.stroke(); pen.setLineDash([]);
  pen.beginPath(); pen.arc(px, py, 7, 0, 7); pen.fillStyle = barred(state.at) ? style("--bad") : "#ffffff"; pen.fill(); pen.strokeStyle = "#000000"; pen.lineWidth = 2.4; pen.stroke();
}

// --- numbers ---
const row = (body, name) => { const r = body.insertRow(); r.insertCell().textContent = name; return r; };
const inUnit = D.quantity.unit ? `, ${D.quantity.unit}` : "";
const summary = () => {
  const points = [...Array(N).keys()], v = points.map(valueAt), e = points.map(errorAt), open = points.filter(i => !barred(i));
  const finite = v.filter(Number.isFinite), errors = e.filter(Number.isFinite);
  return [D.quantity.small ? Math.max(...finite) : Math.min(...finite), finite.reduce((a, b) => a + b, 0) / finite.length,
    errors.length ? Math.sqrt(errors.reduce((a, b) => a + b * b, 0) / errors.length) : NaN, errors.length ? Math.max(...errors.map(Math.abs)) : NaN, N - open.length];
};
const recommended = summary(), now = [];
[`${D.quantity.name}, worst point${inUnit}`, `${D.quantity.name}, mean${inUnit}`, "RMS error, \u00b5m", "worst error, \u00b5m", "points in barred zones"].forEach((name, k) => {
  if (!error && (k === 2 || k === 3)) { now.push(null); return; }
  const r = row($("course"), name); r.insertCell().textContent = text(recommended[k]); now.push(r.insertCell());
});
const here = ["gamma, deg", `${D.quantity.name}${inUnit}`, ...(error ? ["error, \u00b5m"] : []), ...D.axes.map(a => `${a}, deg`), ...D.cell.rails.map((_, k) => `linear axis ${k + 1}, mm`)].map(name => row($("here"), name).insertCell());
for (const c of D.causes.slice(1)) { const li = document.createElement("li"); li.textContent = c.words; $("causes").append(li); }
if (D.causes.length < 2) $("causes").previousElementSibling.hidden = true;
function show(moved = true) {
  const i = state.at, why = barred(i), pose = joints(i), v = valueAt(i), e = errorAt(i);
  if (moved) tintPath();
  const s = summary();
  now.forEach((cell, k) => { if (cell) { cell.textContent = text(s[k]); cell.className = k === 4 && s[k] > 0 ? "out" : ""; } });
  $("said").className = why ? "out" : "";
  $("said").textContent = `${text(length[i], 4)} mm along the path, gamma ${fixed(gamma[i], 1)}\u00b0: ` + (why ? `barred, ${D.causes[why].words}${pose ? "" : "; the arm is shown in its last pose"}` :
    `${D.quantity.name} ${text(v)}${D.quantity.unit ? " " + D.quantity.unit : ""}${error ? `, error ${text(e)} \u00b5m` : ""}`);
  const numbers = [fixed(gamma[i], 1), text(v), ...(error ? [text(e)] : []), ...(pose ?? state.pose).map(x => fixed(x * 180 / Math.PI, 1)), ...travel.subarray(RAILS * i, RAILS * i + RAILS)].map((x, k, all) => k >= all.length - RAILS ? fixed(1000 * x, 1) : x);
  here.forEach((cell, k) => { cell.textContent = numbers[k]; });
  $("place").value = i; $("place").setAttribute("aria-valuetext", `${text(length[i], 5)} mm`);
  $("angle").value = gamma[i]; $("angle").setAttribute("aria-valuetext", `${fixed(gamma[i], 1)} degrees`);
  drawMap(); drawArm();
}
function go(i) { state.at = Math.min(Math.max(i, 0), N - 1); show(false); }
const reach = () => { const x = Number($("width").value) / 100; return (length[N - 1] - length[0]) * (0.002 + 0.6 * x * x); };
function turnTo(g, from = gamma, i = state.at) { // Gamma at a point, and what it carries along about it.
  const delta = g - from[i], width = reach(), start = Float64Array.from(from);
  for (let j = 0; j < N; j++) {
    const w = Math.exp(-0.5 * ((length[j] - length[i]) / width) ** 2);
    if (w < 0.003 && j !== i) { gamma[j] = start[j]; continue; }
    const to = start[j] + w * delta;
    gamma[j] = D.closed ? wrapped(to) : Math.min(Math.max(to, LOW), HIGH);
  }
  show();
}
function reset() { gamma.set(kept); show(); }

// --- hands ---
const words = () => { $("widthWords").textContent = `${text(reach(), 2)} mm`; };
$("place").max = N - 1; $("angle").min = LOW; $("angle").max = HIGH;
$("place").oninput = () => go(Number($("place").value));
$("angle").oninput = () => turnTo(Number($("angle").value));
$("width").oninput = words;
$("worst").onclick = () => { go(worstPoint()); lookAtWorst(); drawArm(); };
$("reset").onclick = reset;
document.querySelectorAll("[data-view]").forEach(b => b.onclick = () => { scene.look(b.dataset.view, scene.frames(coordinates(state.at))); drawArm(); });
const nearest = x => { let best = 0; for (let i = 1; i < N; i++) if (Math.abs(across(length[i]) - x) < Math.abs(across(length[best]) - x)) best = i; return best; };
const angleOf = y => HIGH - (y - box.y) / box.h * (HIGH - LOW);
let held = null;
map.onpointerdown = e => {
  const r = map.getBoundingClientRect(), x = e.clientX - r.left, y = e.clientY - r.top, i = nearest(x);
  map.setPointerCapture(e.pointerId); go(i);
  held = { y, i, start: Float64Array.from(gamma), grip: Math.abs(up(gamma[i]) - y) < 24 ? gamma[i] - angleOf(y) : 0, on: Math.abs(up(gamma[i]) - y) < 24 };
};
map.onpointermove = e => {
  if (!held) return;
  const y = e.clientY - map.getBoundingClientRect().top;
  if (!held.on && Math.abs(y - held.y) < 4) return;
  held.on = true;
  turnTo(Math.min(Math.max(angleOf(y) + held.grip, LOW), D.closed ? HIGH - 1e-3 : HIGH), held.start, held.i);
};
map.onpointerup = map.onpointercancel = () => { held = null; };
map.onkeydown = e => {
  const far = e.shiftKey ? 10 : 1, turn = e.shiftKey ? 5 : 1;
  const does = { ArrowLeft: () => go(state.at - far), ArrowRight: () => go(state.at + far), ArrowUp: () => turnTo(gamma[state.at] + turn), ArrowDown: () => turnTo(gamma[state.at] - turn),
    Home: () => go(0), End: () => go(N - 1), w: () => go(worstPoint()), r: reset }[e.key];
  if (!does || e.ctrlKey || e.metaKey || e.altKey) return;
  e.preventDefault(); does();
};
const repaint = () => { paintBack(); drawMap(); };
new ResizeObserver(repaint).observe(map);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
words(); paintBack();
function lookAtWorst() { // From where nothing stands before the worst point.
  const F = scene.frames(coordinates(state.at)), t = scene.tipAt(F), b = at(F[0], 0, 0, 0);
  scene.eye.focus = t; scene.eye.distance = 1.9 + 0.9 * Math.hypot(...minus(t, b)); scene.eye.azimuth = Math.atan2(D.eye[1], D.eye[0]); scene.eye.height = Math.asin(D.eye[2] / Math.hypot(...D.eye));
}
lookAtWorst();
scene.hands(drawArm);
show();
// For tests.
window.axesMap = { state, gamma, length, go, turnTo, reset, cells, summary, frames: i => scene.frames(coordinates(i)), renderer: scene.renderer.name, barred: i => D.causes[barred(i)].words, box: () => box, up, across, worstPoint };
