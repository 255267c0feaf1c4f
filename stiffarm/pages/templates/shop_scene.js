// A robot in its cell, drawn by WebGL, or on a 2-D canvas where there is none; the replay and the axes map share it.
// D: chain, cell, frames, bodies. path: points in the part frame (tips), pieces [from, to, tint], tints(shades), width.
function cellScene(canvas, D, path) {
const dof = D.chain.sign.length, rails = D.cell.rails.length, TABLE = D.frames + 1, { tips, pieces } = path;
function frames(v) {
  const out = chainFrames(D.chain, v), carried = [];
  let shift = [0, 0, 0];
  for (let i = 0; i < rails; i++) { shift = shift.map((s, k) => s + v[dof + i] * D.cell.rails[i][k]); carried.push(shifted(shift)); }
  const base = mul(shifted(shift), D.cell.base), T = D.cell.table;
  return [...out.map(F => mul(base, F)), I(), T ? turned(T.axis, v[dof + rails], T.point) : I(), ...carried];
}
const HEX = { arm: "#c3c8ce", holder: "#5d6670", cutter: "#e69f00", carriage: "#8c979f", fixture: "#b09a7c", part: "#7fb2d6" };
let shades = {};
const theme = () => { shades = themeColours(["sky", "grid", "cut", "rapid", "bad", "other", "ink"]); };
const bodies = D.bodies.map((b, k) => {
  const { pos, nor } = flatMesh(unpack(b.v, Float32Array), unpack(b.t, Uint32Array));
  let colour = rgb(HEX[b.kind]);
  if (b.kind === "arm" && k % 2) colour = colour.map(c => 0.88 * c);
  return { ...b, pos, nor, colour, hatched: b.name.endsWith("(assumed shape)") };
});
const gridLines = [];
{
  const c = at(mul(D.cell.part, I()), 0, 0, 0), b = at(D.cell.base, 0, 0, 0), z = D.cell.floor === null ? b[2] : D.cell.floor;
  const x0 = Math.floor(Math.min(c[0], b[0]) / 0.5) * 0.5 - 1, x1 = Math.ceil(Math.max(c[0], b[0]) / 0.5) * 0.5 + 1;
  const y0 = Math.floor(Math.min(c[1], b[1]) / 0.5) * 0.5 - 1, y1 = Math.ceil(Math.max(c[1], b[1]) / 0.5) * 0.5 + 1;
  for (let x = x0; x <= x1 + 1e-9; x += 0.5) gridLines.push([[x, y0, z], [x, y1, z]]);
  for (let y = y0; y <= y1 + 1e-9; y += 0.5) gridLines.push([[x0, y, z], [x1, y, z]]);
}

const eye = { azimuth: -1.05, height: 0.42, distance: 4, focus: [0, 0, 0.7] };
let tool = 0; // Place of the tool that is on the flange.
const shown = b => b.tool === null || b.tool === tool;
const tipAt = F => at(mul(F[dof + 1], D.cell.tools[tool]), 0, 0, 0);
function look(name, F) { // A view by name of the arm in a pose.
  const b = at(F[0], 0, 0, 0), t = tipAt(F);
  eye.focus = name === "tool" ? t : [0.5 * (b[0] + t[0]), 0.5 * (b[1] + t[1]), 0.5 * (b[2] + t[2]) + 0.35];
  eye.distance = name === "tool" ? 1.3 : 2.0 + 1.5 * Math.hypot(...minus(t, b));
  const along = Math.atan2(t[1] - b[1], t[0] - b[0]);
  eye.azimuth = along - (name === "side" ? Math.PI / 2 : name === "tool" ? 0.6 : 1.05);
  eye.height = name === "top" ? 1.5 : name === "side" ? 0.05 : 0.42;
}
function camera(width, height) {
  const ch = Math.cos(eye.height), back = [ch * Math.cos(eye.azimuth), ch * Math.sin(eye.azimuth), Math.sin(eye.height)];
  const right = unit(cross([0, 0, 1], back)), up = cross(back, right), from = eye.focus.map((f, k) => f + eye.distance * back[k]);
  const V = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, from), -dot(up, from), -dot(back, from), 1];
  const near = 0.02 * eye.distance, far = eye.distance + 20, f = 2.4, d = near - far;
  const P = [f * Math.min(1, height / width), 0, 0, 0, 0, f * Math.min(1, width / height), 0, 0, 0, 0, (far + near) / d, -1, 0, 0, 2 * far * near / d, 0];
  return { V, P, right, up };
}
function size() {
  const ratio = window.devicePixelRatio || 1, w = Math.max(1, Math.round(canvas.clientWidth * ratio)), h = Math.max(1, Math.round(canvas.clientHeight * ratio));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  keepShape(canvas);
  return [w, h, ratio];
}
function keepShape(one) { // Paper has another width: a picture drawn for the screen keeps its shape there.
  if (!matchMedia("print").matches) one.parentElement.style.setProperty("--shape", `${Math.max(1, one.clientWidth)} / ${Math.max(1, one.clientHeight)}`);
}
function share(p) { // A place on the canvas in shares of it, which hold at any size.
  return [`${100 * p[0] / Math.max(1, canvas.clientWidth)}%`, `${100 * p[1] / Math.max(1, canvas.clientHeight)}%`];
}

function makeGL() {
  if (location.hash.includes("canvas")) return null;
  const gl = canvas.getContext("webgl", { antialias: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const build = (vertex, fragment) => buildProgram(gl, vertex, fragment);
  const solid = build(`attribute vec3 pos, nor; uniform mat4 M, V, P; varying vec3 n;
    void main() { n = mat3(V) * mat3(M) * nor; gl_Position = P * V * M * vec4(pos, 1.0); }`,
    `precision mediump float; varying vec3 n; uniform vec3 colour; uniform float hatch;
    void main() { if (hatch > 0.0 && mod(gl_FragCoord.x + gl_FragCoord.y, 12.0 * hatch) < 5.0 * hatch) discard; vec3 u = normalize(n); if (!gl_FrontFacing) u = -u;
      float light = 0.42 + 0.36 * max(u.z, 0.0) + 0.34 * max(dot(u, vec3(-0.45, 0.67, 0.59)), 0.0); gl_FragColor = vec4(colour * light, 1.0); }`);
  const line = build(LINE_VERTEX, LINE_FRAGMENT);
  const buffer = data => { const b = gl.createBuffer(); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW); return b; };
  const meshes = bodies.map(b => ({ pos: buffer(b.pos), nor: buffer(b.nor), count: b.pos.length / 3 }));
  const lineSet = (segments, colours) => ({ buffer: buffer(lineData(segments, colours)), count: segments.length * 6 });
  let sets = null;
  const tip = i => [tips[3 * i], tips[3 * i + 1], tips[3 * i + 2]];
  const recolour = () => {
    const tints = path.tints(shades);
    for (const old of Object.values(sets ?? {})) gl.deleteBuffer(old.buffer);
    sets = { path: lineSet(pieces.map(([a, b]) => [tip(a), tip(b)]), pieces.map(p => tints[p[2]])), grid: lineSet(gridLines, gridLines.map(() => shades.grid)) };
  };
  const set = (p, name, value) => gl.uniformMatrix4fv(gl.getUniformLocation(p, name), false, new Float32Array(value));
  const enabled = new Set(); // What one program has on must not be on for the next: its buffers may be gone by then.
  const done = () => { for (const k of enabled) gl.disableVertexAttribArray(k); enabled.clear(); };
  const attribute = (p, name, b, n, stride = 0, offset = 0) => {
    const k = gl.getAttribLocation(p, name); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.enableVertexAttribArray(k); enabled.add(k); gl.vertexAttribPointer(k, n, gl.FLOAT, false, stride, offset);
  };
  return { name: "WebGL", recolour, draw(F, hot) {
    const [w, h, ratio] = size(), { V, P } = camera(w, h);
    gl.viewport(0, 0, w, h); gl.clearColor(...shades.sky, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
    gl.useProgram(solid); set(solid, "V", V); set(solid, "P", P);
    bodies.forEach((b, k) => {
      if (!shown(b)) return;
      set(solid, "M", F[b.frame]); gl.uniform3fv(gl.getUniformLocation(solid, "colour"), hot.get(b.name) ?? b.colour);
      gl.uniform1f(gl.getUniformLocation(solid, "hatch"), b.hatched ? ratio : 0); // An assumed shape is hatched, and seen through.
      attribute(solid, "pos", meshes[k].pos, 3); attribute(solid, "nor", meshes[k].nor, 3); gl.drawArrays(gl.TRIANGLES, 0, meshes[k].count);
    });
    done();
    gl.useProgram(line); set(line, "V", V); set(line, "P", P); gl.uniform2f(gl.getUniformLocation(line, "screen"), w / 2, h / 2);
    for (const [what, M, width] of [[sets.grid, I(), 0.5], [sets.path, mul(F[TABLE], D.cell.part), path.width ?? 1.1]]) {
      set(line, "M", M); gl.uniform1f(gl.getUniformLocation(line, "width"), width * ratio);
      attribute(line, "a", what.buffer, 3, 40, 0); attribute(line, "b", what.buffer, 3, 40, 12); attribute(line, "tint", what.buffer, 3, 40, 24); attribute(line, "side", what.buffer, 1, 40, 36);
      gl.drawArrays(gl.TRIANGLES, 0, what.count);
    }
    done();
  } };
}

// --- 2-D canvas, far triangles first ---
function make2D() {
  const pen = canvas.getContext("2d"), css = c => `rgb(${c.map(x => Math.round(255 * Math.min(1, x))).join(",")})`;
  return { name: "2-D canvas (no WebGL here)", recolour() {}, draw(F, hot) {
    const [w, h, ratio] = size(), { V, P } = camera(w, h), light = unit([-0.45, 0.67, 0.59]);
    pen.fillStyle = css(shades.sky); pen.fillRect(0, 0, w, h);
    const flat = (T, x, y, z) => { const p = at(T, x, y, z), k = -p[2]; return k < 0.02 ? null : [w / 2 * (1 + P[0] * p[0] / k), h / 2 * (1 - P[5] * p[1] / k), k]; };
    const stroke = (T, a, b, colour, width) => { const p = flat(T, ...a), q = flat(T, ...b); if (!p || !q) return; pen.strokeStyle = colour; pen.lineWidth = width * ratio; pen.beginPath(); pen.moveTo(p[0], p[1]); pen.lineTo(q[0], q[1]); pen.stroke(); };
    for (const [a, b] of gridLines) stroke(V, a, b, css(shades.grid), 1);
    const faces = [];
    for (const b of bodies.filter(shown)) {
      const T = mul(V, F[b.frame]), R = [...T.slice(0, 12), 0, 0, 0, 1], base = hot.get(b.name) ?? b.colour;
      for (let f = 0; f < b.pos.length; f += 9) {
        const n = at(R, b.nor[f], b.nor[f + 1], b.nor[f + 2]), p = [0, 3, 6].map(j => flat(T, b.pos[f + j], b.pos[f + j + 1], b.pos[f + j + 2]));
        if (p.includes(null) || (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) > (p[2][0] - p[0][0]) * (p[1][1] - p[0][1])) continue;
        const l = 0.42 + 0.36 * Math.max(n[2], 0) + 0.34 * Math.max(dot(n, light), 0);
        faces.push([p[0][2] + p[1][2] + p[2][2], p, css(base.map(c => c * l)), b.hatched ? 0.35 : 1]);
      }
    }
    faces.sort((a, b) => b[0] - a[0]);
    for (const [, p, colour, alpha] of faces) { pen.globalAlpha = alpha; pen.fillStyle = pen.strokeStyle = colour; pen.lineWidth = 0.7; pen.beginPath(); pen.moveTo(p[0][0], p[0][1]); pen.lineTo(p[1][0], p[1][1]); pen.lineTo(p[2][0], p[2][1]); pen.closePath(); pen.fill(); pen.stroke(); }
    pen.globalAlpha = 1;
    const T = mul(V, mul(F[TABLE], D.cell.part)), tints = path.tints(shades).map(css), step = Math.max(1, Math.floor(pieces.length / 4000));
    for (let k = 0; k < pieces.length; k += step) { const [a, , tint] = pieces[k], b = pieces[Math.min(k + step, pieces.length) - 1][1]; stroke(T, [...tips.subarray(3 * a, 3 * a + 3)], [...tips.subarray(3 * b, 3 * b + 3)], tints[tint], 1.3 * (path.width ?? 1.1)); }
  } };
}
let renderer, trouble = "";
theme();
try { renderer = makeGL(); } catch (error) { renderer = null; trouble = String(error); }
if (!renderer) renderer = make2D();
renderer.recolour();
// Mouse, touch and keys on the picture.
function hands(redraw) {
function turn(dx, dy) { eye.azimuth -= dx; eye.height = Math.min(1.55, Math.max(-1.2, eye.height + dy)); redraw(); }
const zoom = f => { eye.distance = Math.min(30, Math.max(0.1, eye.distance * f)); redraw(); };
canvas.onkeydown = e => {
  const k = { ArrowLeft: [-0.08, 0], ArrowRight: [0.08, 0], ArrowUp: [0, 0.06], ArrowDown: [0, -0.06] }[e.key];
  if (k) turn(...k); else if (e.key === "+" || e.key === "=") zoom(0.9); else if (e.key === "-") zoom(1.1); else return;
  e.preventDefault();
};
const held = new Map();
canvas.onpointerdown = e => { canvas.setPointerCapture(e.pointerId); held.set(e.pointerId, [e.clientX, e.clientY]); };
canvas.onpointerup = canvas.onpointercancel = e => held.delete(e.pointerId);
canvas.onpointermove = e => {
  const was = held.get(e.pointerId); if (!was) return;
  const dx = e.clientX - was[0], dy = e.clientY - was[1];
  if (held.size === 2) {
    const other = [...held].find(([id]) => id !== e.pointerId)[1], span = (x, y) => Math.hypot(x - other[0], y - other[1]);
    zoom(span(was[0], was[1]) / Math.max(1, span(e.clientX, e.clientY)));
  } else if (e.shiftKey || e.buttons & 6) {
    const { right, up } = camera(canvas.clientWidth, canvas.clientHeight), k = eye.distance / (1.2 * Math.max(canvas.clientHeight, canvas.clientWidth));
    eye.focus = eye.focus.map((f, i) => f - k * dx * right[i] + k * dy * up[i]); redraw();
  } else turn(0.008 * dx, 0.008 * dy);
  held.set(e.pointerId, [e.clientX, e.clientY]);
};
canvas.addEventListener("wheel", e => { e.preventDefault(); zoom(Math.exp(0.0012 * e.deltaY)); }, { passive: false });
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { theme(); renderer.recolour(); redraw(); });
new ResizeObserver(redraw).observe(canvas);
}
function flatPoint(x) { // Where a point of the world is on the page, in pixels of the canvas; null behind the eye.
  const { V, P } = camera(canvas.clientWidth, canvas.clientHeight), p = at(V, ...x), k = -p[2];
  return k < 0.02 ? null : [0.5 * canvas.clientWidth * (1 + P[0] * p[0] / k), 0.5 * canvas.clientHeight * (1 - P[5] * p[1] / k)];
}
return {
  hold(k) { tool = k; }, frames, tipAt, look, eye, hands, flatPoint, share, keepShape, TABLE, shades: () => shades, renderer, trouble, recolour: () => renderer.recolour(),
  draw: (F, hot) => renderer.draw(F, hot),
};
}
