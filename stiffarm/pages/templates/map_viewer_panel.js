// State to page and hands to state: controls, picking, the panel of the picked point.
const canvas = $("view"), labels = $("labels");
let shades = {}, renderer = null, queued = false;
const theme = () => { shades = themeColours(["sky", "grid", "edge", "write"]); };
const make = (name, words = {}, ...children) => { const e = document.createElement(name); Object.assign(e, words); e.append(...children); return e; };
const fontPixels = () => parseFloat(getComputedStyle(canvas).fontSize);
// Camera of one view, where a CSS pixel is so many pixels of the picture.
function cameraAt(ratio) {
  const w = Math.max(1, Math.round(canvas.clientWidth * ratio)), h = Math.max(1, Math.round(canvas.clientHeight * ratio)), one = Math.floor(w / mapsSeen().length);
  room = roomFor(one, 0.86 * fontPixels() * ratio, ($("views").offsetTop + $("views").offsetHeight) * ratio);
  return [camera(one, h), ratio, w, h];
}
const fullRatio = () => window.devicePixelRatio || 1;
function currentCamera(detail = 1) { // With the canvas as large as the picture is fine.
  const found = cameraAt(fullRatio() * detail), [, , w, h] = found;
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  return found;
}
function drawNow() {
  queued = false;
  if (renderer.lost()) return;
  const places = C => mapsSeen().map((_, k) => k * C.width), [C, ratio] = currentCamera(moving ? detail() : 1);
  renderer.draw(C, robotFrames(), shades, ratio, moving ? most() : Infinity, places(C));
  const [L, fine] = cameraAt(fullRatio());
  drawLabels(labels, L, fine, shades, fontPixels(), $("views").offsetTop + $("views").offsetHeight, places(L));
}
// A frame that comes late was too much work for whatever draws: while the view turns, it is drawn with less effort then,
// fewer points and coarser; with more again where there is time.
const LATE = 40, EARLY = 20, FEWEST = 2000;
let moving = 0, effort = 0.2;
const most = () => FEWEST + effort ** 2 * N, detail = () => 0.45 + 0.55 * effort;
const draw = () => {
  if (queued) return;
  queued = true;
  const asked = performance.now();
  requestAnimationFrame(() => {
    if (!queued) return;
    const waited = performance.now() - asked;
    if (moving) effort = waited > LATE ? 0.6 * effort : waited < EARLY ? Math.min(1, effort + 0.03) : effort;
    drawNow();
  });
};
const REST = 180; // ms without a turn until all points are drawn again
let turnedAt = 0;
function turning() {
  turnedAt = performance.now();
  if (!moving) moving = setTimeout(rested, REST);
}
function rested() { // Not while a hand is on the picture, nor while frames take longer than the rest.
  if (held.size || queued || performance.now() - turnedAt < REST) { moving = setTimeout(rested, REST); return; }
  moving = 0; draw();
}
// Flat views are parallel ones, so that their numbers can be read off.
function setProjection(perspective) {
  state.perspective = perspective; $("projection").textContent = perspective ? "Perspective" : "Parallel"; $("projection").setAttribute("aria-pressed", !perspective); draw();
}
function look(name) { setProjection(name === "oblique"); [eye.azimuth, eye.height] = VIEWS[name]; currentCamera(); fit(canvas.width / mapsSeen().length, canvas.height); draw(); }

// --- changes ---
function changed() { // Which points are shown, or their colours.
  refilter(); renderer.update(); showCount(); draw();
}
function showCount() {
  $("count").textContent = `${spaced(counts.shown)} of ${spaced(counts.of)} points shown${counts.grey ? `; ${spaced(counts.grey)} without a value, grey` : ""}${counts.left ? `; ${spaced(counts.left)} left out under the floor or inside the base` : ""}`;
  canvas.setAttribute("aria-label", `Map of ${D.robot.title}, coloured by ${fields[state.field].label}: ${counts.shown} of ${counts.of} points shown. `
    + "Arrow keys turn the view, with Shift they move it, plus and minus zoom, N and P go from point to point.");
  const numbers = state.picked >= 0 && !shown[state.picked];
  $("hiddenPick").hidden = !numbers;
}
function setField(k) {
  state.field = k; state.hidden.clear(); $("field").value = k; fields[k].sorted = undefined; table = fields[k].difference ? PLUS_MINUS : STIFF;
  const f = fields[k], own = sortedValues(f), least = own[0], most = own[own.length - 1], category = f.categories.length > 0;
  for (const id of ["thresholdPart", "coloursPart"]) $(id).hidden = category || !own.length;
  $("categories").hidden = !category;
  $("above").options[0].textContent = f.stiff ? "stiffer than" : "above"; $("above").options[1].textContent = f.stiff ? "softer than" : "below";
  state.filter = $("filter").checked = false; $("limitUnit").textContent = f.sign;
  if (!category && own.length) {
    const half = +quantile(own, 0.5).toPrecision(2);
    state.limit = f.unit === "N/mm" && least < 500 && 500 < most ? 500 : half;
    const [low, high] = colourRange();
    state.log = low > 0 && high / low > 4;
  }
  listCategories(); rescale(); showLimit(); changed(); showPicked(); showRanking(); showShapes();
}
function showShapes() { // Hands that only some quantities and cuts have.
  $("surface").disabled = !canSurface(); $("surface").title = canSurface() ? "" : "Needs a numeric quantity over three free axes: fix the other axes under Cut."; $("doubt").disabled = !hasDoubt();
  $("doubtPart").hidden = !D.error; $("ellipsoidPart").hidden = !entry && !D.surrogate;
}
function rescale() { // Ends of the colours from the values.
  let [low, high] = colourRange();
  if (state.log && !(low > 0)) state.log = false;
  if (state.log) { const a = 10 ** Math.floor(Math.log10(low)), b = 10 ** (Math.floor(Math.log10(high)) - 1); low = Math.floor(2 * low / a + 1e-9) * a / 2; high = Math.ceil(high / b - 1e-9) * b; if (low <= 0) low = a / 2; }
  else [low, high] = roundedRange([low, high]);
  state.low = +low.toPrecision(6); state.high = +high.toPrecision(6); showScale();
}
function showScale() { $("low").value = state.low; $("high").value = state.high; $("log").checked = state.log; $("clip").value = state.clip; }
function setEnds() {
  const low = Number($("low").value), high = Number($("high").value), wrong = !(low < high) || (state.log && !(low > 0));
  $("rangeFault").textContent = !wrong ? "" : low < high ? "A log scale must start above 0." : "The first value must be smaller than the second.";
  if (wrong) return;
  state.low = low; state.high = high; recolourPoints(); renderer.update(); draw();
}
// The slider runs as the colours do: even steps, or even ratios.
const ends = () => { const own = sortedValues(fields[state.field]); return [own[0], own[own.length - 1]]; };
function showLimit() {
  const [a, b] = ends(); $("limit").value = state.limit;
  const share = state.log && a > 0 ? Math.log(state.limit / a) / Math.log(b / a) : (state.limit - a) / (b - a);
  $("limitSlider").value = Math.round(1000 * Math.min(1, Math.max(0, share)) || 0);
  $("limitSlider").setAttribute("aria-valuetext", `${digits(state.limit)} ${fields[state.field].sign}`);
}
function setLimit(v, on = true) {
  if (!Number.isFinite(v)) return;
  state.limit = v; if (on && state.surface !== "threshold") state.filter = $("filter").checked = true;
  showLimit(); changed(); showRanking();
}
function listCategories() {
  const f = fields[state.field], totals = f.categories.length ? categoryCounts() : [];
  $("categoryList").replaceChildren(...f.categories.map((c, k) => {
    const tick = make("input", { type: "checkbox", checked: true }), swatch = make("i", { className: "swatch" });
    swatch.style.background = c.colour;
    tick.onchange = () => { if (tick.checked) state.hidden.delete(k); else state.hidden.add(k); changed(); };
    return make("li", { hidden: !totals[k] }, make("label", {}, tick, swatch, `${c.name} `, make("small", { textContent: spaced(totals[k]) })));
  }));
}
// --- cuts: one slider for each axis ---
const axisWords = (a, k) => `${minusSign(digits(axes[a].values[k], 5))} ${signOf(axes[a].unit)}`;
const axisName = a => D.kind !== "joints" && axes[a].short === "z" ? "height z" : axes[a].short;
const cuts = axes.map((axis, a) => {
  if (axis.size < 2) return null;
  const slider = make("input", { type: "range", min: 0, max: axis.size - 1, step: 1, value: axis.size >> 1, id: `cut${a}` }), value = make("output", { htmlFor: `cut${a}` });
  const all = make("input", { type: "checkbox", checked: true });
  slider.oninput = () => cut(a, Number(slider.value));
  all.onchange = () => cut(a, all.checked ? null : Number(slider.value));
  $("cuts").append(make("div", { className: "cut" }, make("label", { htmlFor: `cut${a}`, textContent: axisName(a) }), value, make("label", { className: "all" }, all, "all"), slider));
  return { slider, value, all };
});
function cut(a, k) {
  state.fixed[a] = k; showCuts(); changed(); showRanking(); showShapes();
}
function showCuts() {
  cuts.forEach((c, a) => {
    if (!c) return;
    const k = state.fixed[a]; c.all.checked = k === null; if (k !== null) c.slider.value = k;
    c.value.textContent = k === null ? `${minusSign(digits(axes[a].values[0], 5))} to ${axisWords(a, axes[a].size - 1)}` : axisWords(a, k);
    c.slider.setAttribute("aria-valuetext", c.value.textContent); c.slider.classList.toggle("idle", k === null);
  });
  $("cells").disabled = !hasCells(); $("cellsLabel").classList.toggle("off", !hasCells());
}

// --- planes that cut the picture open, in the base's axes ---
const planes = ["x", "y", "z"].map((name, k) => {
  const low = mapBounds.low[k], high = mapBounds.high[k]; state.planes[k].at = 0.5 * (low + high);
  const on = make("input", { type: "checkbox", id: `plane${name}` }), value = make("output", { htmlFor: `at${name}` });
  const side = make("select", { id: `side${name}` }, make("option", { value: -1, textContent: "keep below" }), make("option", { value: 1, textContent: "keep above" }));
  const slider = make("input", { type: "range", id: `at${name}`, min: 0, max: 200, value: 100, className: "idle" });
  side.setAttribute("aria-label", `Side of the plane across ${name}`); slider.setAttribute("aria-label", `Place of the plane across ${name}`);
  const show = () => {
    const p = state.planes[k]; value.textContent = `${name} = ${minusSign(Math.round(1000 * p.at))} mm`;
    slider.setAttribute("aria-valuetext", value.textContent); slider.classList.toggle("idle", !p.on); on.checked = p.on; slider.value = Math.round(200 * (p.at - low) / Math.max(1e-9, high - low));
  };
  const apply = () => { show(); changed(); showRanking(); };
  on.onchange = () => { state.planes[k].on = on.checked; apply(); };
  slider.oninput = () => { state.planes[k].at = low + (high - low) * slider.value / 200; state.planes[k].on = true; apply(); };
  side.onchange = () => { state.planes[k].keep = Number(side.value); state.planes[k].on = true; apply(); };
  if (high - low > 1e-6) $("planes").append(make("div", { className: "cut plane" }, make("label", { htmlFor: on.id }, on, `across ${name}`), value, side, slider));
  show();
  return apply;
});

// --- the picked point ---
function pick(i) {
  state.picked = i;
  if (i >= 0 && reached[i] && Q.every(c => Number.isFinite(c[i]))) state.pose = Q.map(c => c[i]);
  showPicked(); showCount(); draw();
}
function pickAt(x, y) { // Screen place in CSS pixels: what lies in front there, else what is nearest.
  const [C, ratio] = currentCamera(), px = (x * ratio) % C.width, py = y * ratio, disc = !(state.cells && hasCells());
  let front = -1, depth = Infinity, nearest = -1, distance = 24 * ratio;
  for (let i = 0; i < N; i++) {
    if (!shown[i]) continue;
    const p = project(C, X[0][i], X[1][i], X[2][i]); if (!p) continue;
    const d = Math.hypot(p[0] - px, p[1] - py);
    if (disc && p[2] < depth && d <= Math.max(radius() * pixelsPerMetre(C, p[2]) * (shown[i] === 2 ? 0.45 : 1), 1.5 * ratio)) { front = i; depth = p[2]; }
    if (d < distance - 1e-9) { nearest = i; distance = d; }
  }
  const found = front >= 0 ? front : nearest;
  if (found >= 0) pick(found);
  return found;
}
function step(by) { // To the next point shown, in the map's order.
  let i = state.picked;
  for (let k = 0; k < N; k++) { i = (i + by + N) % N; if (i < 0) i = N - 1; if (shown[i] === 1) { pick(i); return; } }
}
const rowOf = (name, value, more = "") => make("tr", {}, make("th", { scope: "row", textContent: name }), make("td", { textContent: value }), make("td", { className: "unit", textContent: more }));
const wordOf = (f, i) => f.categories.length ? f.categories[f.values[i]]?.name ?? "–" : minusSign(digits(f.values[i]));
function interval(i) { // The 95 % interval of the stiffness, or nothing.
  const e = relativeError ? relativeError[i] : NaN;
  // Where springs are set by hand, the interval of the calibration is not theirs.
  if (D.error_of === null || !Number.isFinite(e) || !reached[i] || state.whatIf) return null;
  const v = fields[D.error_of].values[i];
  // e is of the compliance, which is linear in what was calibrated; beyond 1 it leaves the stiffness no upper end.
  const low = v / (1 + e), high = e < 1 ? v / (1 - e) : Infinity;
  return { value: v, half: 0.5 * (high - low), low, high, share: e };
}
function showPicked() {
  const i = state.picked; $("pickedBody").hidden = i < 0; $("pickHint").hidden = i >= 0;
  if (i < 0) return;
  const f = fields[state.field], flags = [];
  if (!reached[i]) flags.push(["out of reach: the robot has no pose here", "bad"]);
  if (nearSingular[i]) flags.push(["near a singularity", "warn"]);
  $("flags").replaceChildren(...flags.map(([words, kind]) => make("span", { className: `flag ${kind}`, textContent: words })));
  $("headline").replaceChildren(make("small", { textContent: f.label }), make("b", { textContent: wordOf(f, i) }), ` ${f.sign}`);
  const range = interval(i);
  $("interval").textContent = range && state.field === D.error_of ? (range.share < 1
    ? `95 %: ${digits(range.low, 4)} to ${digits(range.high, 4)} ${f.sign} (± ${digits(100 * range.share, 2)} %)`
    : `95 %: above ${digits(range.low, 4)} ${f.sign}; the calibration gives no upper limit`) : "";
  if (state.whatIf && state.field === stiffnessField) $("interval").textContent = `What if; ${digits(ofModel[i])} ${f.sign} with the model's springs`;
  if (other) $("interval").textContent = [$("interval").textContent, besideWords(i)].filter(Boolean).join(". ");
  showEllipsoid(i);
  $("place").replaceChildren(...["X", "Y", "Z"].map((n, k) => rowOf(n, Number.isFinite(X[k][i]) ? minusSign((1000 * X[k][i]).toFixed(1)) : "–", "mm")),
    ...(D.kind === "joints" ? [] : axes.map((a, k) => [a, k]).filter(([a]) => !["x", "y", "z"].includes(a.name)).map(([a, k]) => rowOf(a.short, minusSign(digits(a.values[indexOf(i, k)])), signOf(a.unit)))));
  $("pose").replaceChildren(...D.coordinates.map((n, k) => rowOf(n.replace(/_deg$/, ""), Number.isFinite(Q[k][i]) ? minusSign((Q[k][i] * DEG).toFixed(2)) : "–", "°")));
  $("values").replaceChildren(...fields.map((g, k) => {
    const r = k === D.error_of ? interval(i) : null, row = rowOf(g.label, `${wordOf(g, i)}${r && Number.isFinite(r.half) ? `\u00a0±\u00a0${digits(r.half, 2)}` : ""}`, g.sign);
    if (k === state.field) row.setAttribute("aria-current", "true");
    return row;
  }));
  $("errorHint").hidden = !range;
  showBudget(i);
  $("said").textContent = `Point ${i + 1}: ${f.label} ${wordOf(f, i)} ${f.sign}`;
}
function showEllipsoid(i) { // Principal stiffnesses at the tool and their directions.
  const C = complianceAt(i); $("principalPart").hidden = !C;
  if (!C) return;
  const way = e => e.way.map(x => minusSign(x.toFixed(2))).join(", ");
  $("principal").replaceChildren(...eigen(C).map((e, k) => rowOf(["softest", "middle", "stiffest"][k], e.value > 0 ? digits(1e-3 / e.value, 4) : "rigid", `N/mm along ${way(e)}`)));
}
const TOP_PARTS = 7;
function showBudget(i) {
  const P = D.parts.length, own = D.parts.map((p, k) => [p, shares[P * i + k]]).filter(([, s]) => s !== 0xffff).sort((a, b) => b[1] - a[1]);
  $("budgetPart").hidden = !own.length;
  const first = own.slice(0, TOP_PARTS).filter(([, s]) => s > 0), rest = 1000 - first.reduce((n, [, s]) => n + s, 0);
  // What is left of a rounded sum of all parts is rounding.
  const rows = first.map(([p, s]) => [p.name, p.colour, s, p.kind]); if (own.length > first.length && rest > 0) rows.push(["all others", null, rest, ""]);
  const top = Math.max(1, ...rows.map(r => r[2]));
  $("budget").replaceChildren(...rows.map(([name, colour, s, kind]) => {
    const bar = make("i", {}); bar.style.width = `${100 * s / top}%`; if (colour) bar.style.background = colour;
    return make("li", { title: kind }, make("span", { className: "part", textContent: name }), make("span", { className: "track" }, bar), make("span", { className: "percent", textContent: `${(s / 10).toFixed(1)} %` }));
  }));
}
function showRanking() {
  const f = fields[state.field], category = f.categories.length > 0;
  $("mostButton").textContent = f.stiff ? "Stiffest" : "Largest"; $("leastButton").textContent = f.stiff ? "Softest" : "Smallest";
  $("mostButton").disabled = $("leastButton").disabled = category || !counts.shown;
}
const extreme = most => { const found = extremes(1, most === (fields[state.field].stiff >= 0)); if (found.length) pick(found[0]); };

// --- hands on the picture ---
function turn(dx, dy) { turning(); eye.azimuth -= dx; eye.height = Math.min(Math.PI / 2, Math.max(-1.2, eye.height + dy)); draw(); }
const zoom = f => { turning(); const span = Math.hypot(...minus(box.high, box.low)); eye.distance = Math.min(8 * span, Math.max(0.03 * span, eye.distance * f)); draw(); };
function pan(dx, dy) { // CSS pixels
  turning();
  const [C, ratio] = currentCamera(), k = ratio / pixelsPerMetre(C, eye.distance);
  eye.focus = eye.focus.map((f, i) => f - k * dx * C.right[i] + k * dy * C.up[i]); draw();
}
canvas.onkeydown = e => {
  if (e.ctrlKey || e.metaKey || e.altKey) return;
  const k = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[e.key], key = e.key.toLowerCase();
  if (k && e.shiftKey) pan(30 * k[0], 30 * k[1]); else if (k) turn(0.08 * k[0], -0.06 * k[1]);
  else if (key === "+" || key === "=") zoom(0.9); else if (key === "-") zoom(1.1); else if (key === "n") step(1); else if (key === "p") step(-1);
  else if (key === "home") look("oblique"); else return;
  e.preventDefault();
};
const held = new Map();
let travelled = 0;
canvas.onpointerdown = e => { if (e.isTrusted) canvas.setPointerCapture(e.pointerId); if (!held.size) travelled = 0; else travelled = 99; held.set(e.pointerId, [e.clientX, e.clientY]); };
canvas.onpointerup = e => {
  const alone = held.size === 1; held.delete(e.pointerId);
  if (alone && travelled < 5 && e.button === 0) { const r = canvas.getBoundingClientRect(); pickAt(e.clientX - r.left, e.clientY - r.top); }
};
canvas.onpointercancel = e => held.delete(e.pointerId);
canvas.onpointermove = e => {
  const was = held.get(e.pointerId); if (!was) return;
  const dx = e.clientX - was[0], dy = e.clientY - was[1]; travelled += Math.hypot(dx, dy);
  if (travelled < 5) return;
  if (held.size === 2) {
    const other = [...held].find(([id]) => id !== e.pointerId)[1], span = (x, y) => Math.hypot(x - other[0], y - other[1]);
    zoom(span(was[0], was[1]) / Math.max(1, span(e.clientX, e.clientY))); pan(dx / 2, dy / 2);
  } else if (e.shiftKey || e.buttons & 6) pan(dx, dy); else turn(0.008 * dx, 0.008 * dy);
  held.set(e.pointerId, [e.clientX, e.clientY]);
};
canvas.oncontextmenu = e => e.preventDefault();
canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(0.0012 * e.deltaY)); }, { passive: false });
canvas.ondblclick = e => { const found = pickAt(e.offsetX, e.offsetY); if (found >= 0) { eye.focus = X.map(x => x[found]); draw(); } };
canvas.addEventListener("webglcontextlost", e => { e.preventDefault(); $("message").textContent = "The browser lost its graphics context; waiting for it to return."; });
canvas.addEventListener("webglcontextrestored", () => { renderer = makeGL(canvas); renderer.update(); $("message").textContent = ""; draw(); });

// --- hands on the controls ---
function listFields() {
  $("field").replaceChildren(...fields.map((f, k) => make("option", { value: k, textContent: fields.some(g => g !== f && g.label === f.label) ? barTitle(f) : f.label })));
  $("field").value = state.field;
}
listFields();
$("under").checked = state.under; $("under").onchange = e => { state.under = e.target.checked; changed(); showRanking(); };
$("doubt").onchange = e => { state.doubt = e.target.value; draw(); };
$("surface").onchange = e => { state.surface = e.target.value; renderer.update(); draw(); };
$("ellipsoid").onchange = e => { state.ellipsoid = e.target.checked; draw(); };
$("field").onchange = e => setField(Number(e.target.value));
$("filter").onchange = e => { state.filter = e.target.checked; changed(); showRanking(); };
$("above").onchange = e => { state.above = e.target.value === "1"; if (!state.filter) state.filter = $("filter").checked = true; changed(); showRanking(); };
$("limit").oninput = e => { if (e.target.value.trim() !== "" && Number.isFinite(Number(e.target.value))) { state.limit = Number(e.target.value); state.filter = $("filter").checked = true; const typed = e.target.value; showLimit(); e.target.value = typed; changed(); showRanking(); } };
$("limitSlider").oninput = e => {
  const [a, b] = ends(), t = e.target.value / 1000;
  setLimit(+(state.log && a > 0 ? a * (b / a) ** t : a + t * (b - a)).toPrecision(3));
};
$("clip").onchange = e => { state.clip = Number(e.target.value); rescale(); recolourPoints(); renderer.update(); draw(); };
$("log").onchange = e => { state.log = e.target.checked; rescale(); $("rangeFault").textContent = e.target.checked && !state.log ? "A log scale needs values above 0." : ""; showLimit(); recolourPoints(); renderer.update(); draw(); };
$("low").onchange = $("high").onchange = setEnds;
$("size").oninput = e => { state.size = 10 ** Number(e.target.value); draw(); };
$("cells").onchange = e => { state.cells = e.target.checked; renderer.update(); draw(); };
$("unreached").checked = state.unreached; $("robot").value = state.robot;
$("unreached").onchange = e => { state.unreached = e.target.checked; changed(); };
$("robot").onchange = e => { state.robot = e.target.value; draw(); };
$("projection").onclick = () => setProjection(!state.perspective);
const picture = () => pictureOf(canvas, labels, 0.86 * fontPixels() * fullRatio());
$("save").onclick = () => {
  if (moving) { clearTimeout(moving); moving = 0; }
  drawNow();
  const sheet = picture();
  const link = make("a", { download: `${D.robot.name}-${fields[state.field].name}.png` }); link.setAttribute("href", sheet.toDataURL("image/png")); link.click();
};
$("mostButton").onclick = () => extreme(true); $("leastButton").onclick = () => extreme(false);
$("nextButton").onclick = () => step(1); $("backButton").onclick = () => step(-1);
document.querySelectorAll("[data-view]").forEach(b => b.onclick = () => look(b.dataset.view));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { theme(); draw(); });

theme();
let fault = "";
try { renderer = makeGL(canvas); } catch (error) { fault = ` (${error.message.trim()})`; }
if (!renderer) {
  if (fault) canvas.replaceWith(canvas.cloneNode()); // A canvas that had a WebGL context gives no other.
  renderer = make2D($("view"));
  $("message").textContent = `No WebGL in this browser${fault}: a slower, simpler drawing is used`
    + (N > MOST_FLAT ? `; of more than ${spaced(MOST_FLAT)} points it draws an even selection.` : ".");
}
buildSprings(); showCuts(); setField(0); look("oblique");
let known = 0; // The view is fitted anew where the shape of the stage changes much.
new ResizeObserver(() => { const shape = canvas.clientWidth / Math.max(1, canvas.clientHeight); if (Math.abs(shape - known) > 0.1) { known = shape; currentCamera(); fit(canvas.width / mapsSeen().length, canvas.height); } draw(); }).observe(canvas);
if (D.beside) showBeside(takeMap(D.beside, D.beside.name)); // A page of two maps, as `stiffarm compare` writes it.
const view = /view=(\w+)/.exec(location.hash); if (view && VIEWS[view[1]]) look(view[1]);
const point = /point=(\d+)/.exec(location.hash); if (point && Number(point[1]) >= 1 && Number(point[1]) <= N) pick(Number(point[1]) - 1);
// For links into the page and for tests.
window.mapViewer = {
  state, counts: () => counts, renderer: renderer.name, pick, pickAt, setField, setLimit, cut, drawNow: () => { if (moving) clearTimeout(moving); moving = 0; drawNow(); },
  fields, surfaces, ellipsoid, complianceAt, eigen, showOther, learnedCompliance, springs, setSpring, shown, mapsSeen, picture, frame: () => drawNow(), drawnWhileTurning: () => moving ? most() : Infinity,
  frames: q => chainFrames(D.chain, q), tool: q => toolTip(chainFrames(D.chain, q)), extremes,
  // Where a point is, in CSS pixels of the picture.
  placeOf: i => { const [C, ratio] = currentCamera(), p = project(C, X[0][i], X[1][i], X[2][i]); return p && [p[0] / ratio, p[1] / ratio]; },
};
