// What is in space: extent and box with round ticks, cells of a slice, the camera, and where a point is on the screen.
const bounds = { low: [Infinity, Infinity, Infinity], high: [-Infinity, -Infinity, -Infinity] };
for (let i = 0; i < N; i++) if ((reached[i] || D.kind !== "joints") && hasPlace(i)) for (let k = 0; k < 3; k++) {
  bounds.low[k] = Math.min(bounds.low[k], X[k][i]); bounds.high[k] = Math.max(bounds.high[k], X[k][i]);
}
const mapBounds = { low: [...bounds.low], high: [...bounds.high] };
const bodies = D.bodies.map(b => ({ ...b, ...flatMesh(unpack(b.v, Float32Array), unpack(b.t, Uint32Array)), colour: rgb(b.colour) }));
for (const b of bodies) { // The robot at rest and its foot belong to the scene.
  const F = chainFrames(D.chain, D.rest)[b.frame];
  for (let j = 0; j < b.pos.length; j += 3) at(F, b.pos[j], b.pos[j + 1], b.pos[j + 2]).forEach((x, k) => {
    bounds.low[k] = Math.min(bounds.low[k], x); bounds.high[k] = Math.max(bounds.high[k], x);
  });
}
bounds.low[2] = Math.min(bounds.low[2], 0);
// One step for all three axes, m; the outer ticks bound everything.
const STEP = niceStep(Math.max(...bounds.high.map((h, k) => h - bounds.low[k])) / 7);
const ticks = [0, 1, 2].map(k => {
  const first = Math.floor(bounds.low[k] / STEP + 1e-6), last = Math.max(Math.ceil(bounds.high[k] / STEP - 1e-6), first + 1);
  return Array.from({ length: last - first + 1 }, (_, j) => +((first + j) * STEP).toPrecision(9));
});
const box = { low: ticks.map(t => t[0]), high: ticks.map(t => t[t.length - 1]) };

// Radius of a point at size 1, m: a little less than half of what lies between neighbours.
const spacing = (() => {
  // A line or a point has no extent some ways: there a fiftieth of the scene stands for it.
  const whole = Math.max(...box.high.map((h, k) => h - box.low[k])), least = 0.02 * whole;
  const size = mapBounds.high.map((h, k) => Math.max(h - mapBounds.low[k], 1e-9)).sort((a, b) => b - a);
  if (size[1] < 1e-6 * whole) return Math.max(size[0] / Math.max(1, N), least);
  const count = Math.max(1, D.kind === "joints" ? reached.reduce((n, r) => n + r, 0) : N);
  const flat = size[2] < 0.02 * size[0];
  return Math.min(0.06 * size[0], flat ? Math.sqrt(size[0] * size[1] / count) : Math.cbrt(size[0] * size[1] * size[2] / count));
})();
const radius = () => 0.42 * spacing * state.size;

// --- cells: where two axes are left, each point has a quadrilateral that ends half-way to its neighbours ---
const freeAxes = () => axes.map((_, a) => a).filter(a => axes[a].size > 1 && state.fixed[a] === null);
const hasCells = () => freeAxes().length === 2;
function cellCorner(i, a, sa, b, sb) {
  const ka = indexOf(i, a), kb = indexOf(i, b), step = (k, s, ax) => k + s >= 0 && k + s < axes[ax].size ? s * axes[ax].stride : 0;
  const there = j => hasPlace(j), da = step(ka, sa, a), db = step(kb, sb, b), out = [0, 0, 0];
  if (da && db && there(i + da) && there(i + db) && there(i + da + db)) {
    for (let k = 0; k < 3; k++) out[k] = 0.25 * (X[k][i] + X[k][i + da] + X[k][i + db] + X[k][i + da + db]);
    return out;
  }
  for (let k = 0; k < 3; k++) { // At the rim: half the step to the neighbour on this side, else on the other.
    let v = X[k][i];
    for (const [d, s, ax, kx] of [[da, sa, a, ka], [db, sb, b, kb]]) {
      const back = step(kx, -s, ax);
      if (d && there(i + d)) v += 0.5 * (X[k][i + d] - X[k][i]);
      else if (back && there(i + back)) v += 0.5 * (X[k][i] - X[k][i + back]);
    }
    out[k] = v;
  }
  return out;
}
// Corners (12 numbers a cell) and the points they belong to.
function cells() {
  const [a, b] = freeAxes(), own = [];
  for (let i = 0; i < N; i++) if (shown[i]) own.push(i);
  const corners = new Float32Array(12 * own.length);
  own.forEach((i, c) => [[-1, -1], [1, -1], [1, 1], [-1, 1]].forEach(([sa, sb], j) => corners.set(cellCorner(i, a, sa, b, sb), 12 * c + 3 * j)));
  return { corners, points: own };
}

// --- camera: turned about a focus, perspective or parallel ---
const eye = { azimuth: -1.05, height: 0.42, distance: 5, focus: [0, 0, 1] };
const VIEWS = { oblique: [-1.05, 0.42], front: [0, 0], side: [-Math.PI / 2, 0], top: [-Math.PI / 2, Math.PI / 2] };
const FOCAL = 2.4;
// Room for numbers, buttons and colour bar at the edges of the view, pixels; the middle of what is left is the focus.
let room = { left: 0, right: 0, top: 0, bottom: 0 };
function camera(width, height) {
  const ch = Math.cos(eye.height), back = [ch * Math.cos(eye.azimuth), ch * Math.sin(eye.azimuth), Math.sin(eye.height)];
  const right = [-Math.sin(eye.azimuth), Math.cos(eye.azimuth), 0], up = cross(back, right), from = eye.focus.map((f, k) => f + eye.distance * back[k]);
  const V = [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right, from), -dot(up, from), -dot(back, from), 1];
  const span = 2 * Math.hypot(...minus(box.high, box.low)), near = Math.max(0.005 * span, state.perspective ? eye.distance - span : -1e9), far = eye.distance + span;
  const fx = FOCAL * Math.min(1, height / width), fy = FOCAL * Math.min(1, width / height);
  const sx = (room.left - room.right) / width, sy = (room.bottom - room.top) / height;
  let P;
  if (state.perspective) { const d = near - far; P = [fx, 0, 0, 0, 0, fy, 0, 0, -sx, -sy, (far + near) / d, -1, 0, 0, 2 * far * near / d, 0]; }
  else { const n = eye.distance - span, d = n - far; P = [fx / eye.distance, 0, 0, 0, 0, fy / eye.distance, 0, 0, 0, 0, 2 / d, 0, sx, sy, (far + n) / d, 1]; }
  return { V, P, PV: mul(P, V), back, right, up, width, height, near };
}
// Screen place in pixels, and depth along the view (m, larger is farther); null behind the eye.
function project(C, x, y, z) {
  const T = C.PV, w = T[3] * x + T[7] * y + T[11] * z + T[15];
  if (w < 1e-6) return null;
  return [C.width / 2 * (1 + (T[0] * x + T[4] * y + T[8] * z + T[12]) / w), C.height / 2 * (1 - (T[1] * x + T[5] * y + T[9] * z + T[13]) / w),
    state.perspective ? w : -(C.V[2] * x + C.V[6] * y + C.V[10] * z + C.V[14])];
}
const pixelsPerMetre = (C, depth) => C.P[5] * C.height / 2 / (state.perspective ? depth : 1);
function fit(width, height) { // The box fills the room that is left.
  const w = Math.max(0.3 * width, width - room.left - room.right), h = Math.max(0.3 * height, height - room.top - room.bottom);
  eye.focus = [0, 1, 2].map(k => 0.5 * (box.low[k] + box.high[k]));
  eye.distance = 2 * Math.hypot(...minus(box.high, box.low));
  for (let k = 0; k < 12; k++) {
    const C = camera(width, height), corners = [];
    for (let c = 0; c < 8; c++) corners.push(project(C, ...[0, 1, 2].map(j => (c >> j & 1 ? box.high : box.low)[j])));
    if (corners.includes(null)) { eye.distance *= 2; continue; }
    const x = corners.map(p => p[0]), y = corners.map(p => p[1]), low = [Math.min(...x), Math.min(...y)], high = [Math.max(...x), Math.max(...y)];
    const perMetre = pixelsPerMetre(C, eye.distance);
    const dx = (0.5 * (low[0] + high[0]) - room.left - 0.5 * w) / perMetre, dy = (0.5 * (low[1] + high[1]) - room.top - 0.5 * h) / perMetre;
    eye.focus = eye.focus.map((f, j) => f + dx * C.right[j] - dy * C.up[j]);
    eye.distance *= Math.max((high[0] - low[0]) / w, (high[1] - low[1]) / h) ** 0.9;
  }
}

// --- floor and the two far walls, for the side that the eye is on ---
function walls(C) {
  const far = k => C.back[k] > 0 ? box.low[k] : box.high[k], lines = [], faint = "grid", strong = "edge";
  const [x0, y0, z0] = box.low, [x1, y1, z1] = box.high, fx = far(0), fy = far(1);
  for (const x of ticks[0]) lines.push([[x, y0, z0], [x, y1, z0], faint], [[x, fy, z0], [x, fy, z1], faint]);
  for (const y of ticks[1]) lines.push([[x0, y, z0], [x1, y, z0], faint], [[fx, y, z0], [fx, y, z1], faint]);
  for (const z of ticks[2]) lines.push([[x0, fy, z], [x1, fy, z], faint], [[fx, y0, z], [fx, y1, z], faint]);
  if (z0 < -1e-9) { // The ground that the robot stands on lies above the box's floor.
    const g = 2 * STEP, around = (v, k) => Math.min(Math.max(v, box.low[k]), box.high[k]);
    for (let d = -g; d <= g + 1e-9; d += STEP / 2)
      lines.push([[around(-g, 0), around(d, 1), 0], [around(g, 0), around(d, 1), 0], faint], [[around(d, 0), around(-g, 1), 0], [around(d, 0), around(g, 1), 0], faint]);
  }
  const edges = axisEdges(C);
  for (const e of edges) if (e) lines.push([e.from, e.to, strong]);
  return lines;
}
// The edge of the box that carries each axis's numbers; null where the axis points at the eye.
function axisEdges(C) {
  const [x0, y0, z0] = box.low, [x1, y1, z1] = box.high, near = k => C.back[k] > 1e-3 ? box.high[k] : box.low[k];
  const corners = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(c => [c, project(C, c[0], c[1], z0)]).filter(c => c[1]);
  const left = corners.length ? corners.reduce((a, b) => b[1][0] < a[1][0] - 1e-6 ? b : a)[0] : [x0, y0];
  const edges = [
    { axis: 0, name: "X", from: [x0, near(1), z0], to: [x1, near(1), z0] },
    { axis: 1, name: "Y", from: [near(0), y0, z0], to: [near(0), y1, z0] },
    { axis: 2, name: "Z", from: [...left, z0], to: [...left, z1] },
  ];
  return edges.map(e => Math.abs(C.back[e.axis]) > 0.985 ? null : e);
}
const robotFrames = () => chainFrames(D.chain, state.pose);
const toolTip = F => at(mul(F[dof + 1], D.tool), 0, 0, 0);
