// Shapes in space beside the points: surfaces of equal value through the grid, and the compliance ellipsoid.
const SHARES = [0.25, 0.6, 0.9]; // of the values: where three surfaces are put
const canSurface = () => freeAxes().length === 3 && !fields[state.field].categories.length && sortedValues(fields[state.field]).length > 0;
function surfaceLevels() {
  if (state.surface === "threshold") return [state.limit];
  const own = sortedValues(fields[state.field]);
  return [...new Set(SHARES.map(s => +quantile(own, s).toPrecision(2)))];
}
let surfaceCache = ["", []];
function surfaces() {
  if (state.surface === "none" || !canSurface() || state.views > 1) return [];
  const key = JSON.stringify([state.field, state.surface, state.surface === "threshold" ? state.limit : 0, state.fixed, state.under, state.low, state.high, state.log, state.version]);
  if (surfaceCache[0] !== key) surfaceCache = [key, surfaceLevels().map(level => {
    const k = tableRow(toUnit(level));
    return { ...levelSurface(level), colour: [0, 1, 2].map(j => table[k + j] / 255), level };
  }).filter(s => s.pos.length)];
  return surfaceCache[1];
}
// Cells that jump are left out: where another posture takes over, a wall would stand that is not in the quantity.
const JUMP = 0.15, STANDS_OUT = 3, TETRAHEDRA = [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];
function levelSurface(level) {
  const [a, b, c] = freeAxes(), v = fields[state.field].values, base = state.fixed.reduce((n, k, x) => n + (k === null ? 0 : k * axes[x].stride), 0);
  // A full turn closes on itself: its last cell leads back to the first.
  const closes = x => { const u = axes[x].values, n = u.length, step = n > 2 ? (u[n - 1] - u[0]) / (n - 1) : 0; return axes[x].name === "phi" && n > 2 && Math.abs(360 - (u[n - 1] - u[0]) - step) < 1e-3 * step; };
  const cellsOf = x => axes[x].size - (closes(x) ? 0 : 1), to = (x, k) => (k % axes[x].size) * axes[x].stride;
  const known = i => reached[i] && hasPlace(i) && Number.isFinite(v[i]) && !(state.under && leftOut[i]), cubes = [], spans = [];
  for (let i = 0; i < cellsOf(a); i++) for (let j = 0; j < cellsOf(b); j++) for (let k = 0; k < cellsOf(c); k++) {
    const corner = Array.from({ length: 8 }, (_, m) => base + to(a, i + (m & 1)) + to(b, j + (m >> 1 & 1)) + to(c, k + (m >> 2)));
    if (!corner.every(known)) continue;
    const scaled = corner.map(n => Math.min(1, Math.max(0, toUnit(v[n]))));
    spans.push(Math.max(...scaled) - Math.min(...scaled)); cubes.push(corner);
  }
  const limit = Math.max(JUMP, STANDS_OUT * quantile(Float64Array.from(spans).sort(), 0.5)), pos = [], nor = [];
  const between = (p, q) => { const t = (level - v[p]) / (v[q] - v[p]); return [0, 1, 2].map(k => X[k][p] + t * (X[k][q] - X[k][p])); };
  const face = (p, q, r) => { const n = unit(cross(minus(q, p), minus(r, p))); pos.push(...p, ...q, ...r); nor.push(...n, ...n, ...n); };
  cubes.forEach((corner, m) => {
    if (spans[m] > limit) return;
    for (const tetrahedron of TETRAHEDRA) {
      const own = tetrahedron.map(k => corner[k]), above = own.filter(n => v[n] >= level), below = own.filter(n => v[n] < level);
      if (above.length === 1 || below.length === 1) { const [one, rest] = above.length === 1 ? [above[0], below] : [below[0], above]; face(...rest.map(n => between(one, n))); }
      else if (above.length === 2) {
        const [p, q, r, s] = [between(above[0], below[0]), between(above[0], below[1]), between(above[1], below[1]), between(above[1], below[0])];
        face(p, q, r); face(p, r, s);
      }
    }
  });
  return { pos: Float32Array.from(pos), nor: Float32Array.from(nor) };
}

// --- compliance at a point: m/N, 3 x 3, base axes ---
const entry = (() => { // The map's own fields, where it has them all.
  const axis = "xyz", at = (i, j) => fields.findIndex(f => f.name === `compliance_${axis[Math.min(i, j)]}_${axis[Math.max(i, j)]}_m_per_N`);
  const all = [0, 1, 2].map(i => [0, 1, 2].map(j => at(i, j)));
  return all.flat().every(k => k >= 0) ? all : null;
})();
function complianceAt(i) {
  if (i < 0 || !reached[i]) return null;
  const learned = learnedCompliance(Q.map(c => c[i])); // with what the what-if sliders say
  if (learned) return learned;
  return entry && entry.map(row => row.map(k => fields[k].values[i]));
}
function eigen(C) { // Jacobi's rotations of a symmetric 3 x 3: values, largest first, and their directions.
  const A = C.map(r => [...r]), V = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 40; sweep++) for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
    if (Math.abs(A[p][q]) < 1e-300) continue;
    const t = 0.5 * Math.atan2(2 * A[p][q], A[q][q] - A[p][p]), c = Math.cos(t), s = Math.sin(t);
    for (let k = 0; k < 3; k++) { const x = A[k][p], y = A[k][q]; A[k][p] = c * x - s * y; A[k][q] = s * x + c * y; }
    for (let k = 0; k < 3; k++) { const x = A[p][k], y = A[q][k]; A[p][k] = c * x - s * y; A[q][k] = s * x + c * y; }
    for (let k = 0; k < 3; k++) { const x = V[k][p], y = V[k][q]; V[k][p] = c * x - s * y; V[k][q] = s * x + c * y; }
  }
  return [0, 1, 2].map(k => ({ value: A[k][k], way: V.map(r => r[k]) })).sort((x, y) => y.value - x.value);
}
const SPHERE = (() => {
  const v = [], t = [], across = 28, up = 14;
  for (let j = 0; j <= up; j++) for (let i = 0; i < across; i++) { const a = 2 * Math.PI * i / across, b = Math.PI * j / up; v.push(Math.sin(b) * Math.cos(a), Math.sin(b) * Math.sin(a), Math.cos(b)); }
  for (let j = 0; j < up; j++) for (let i = 0; i < across; i++) { const p = j * across + i, q = j * across + (i + 1) % across; t.push(p, p + across, q, q, p + across, q + across); }
  return [v, t];
})();
const ELLIPSOID = rgb("#009e73");
// Where a force of one size in any direction moves the tool: the same scale at every point, so that they compare.
let ellipsoidScale = 0;
function ellipsoid() {
  const C = state.ellipsoid ? complianceAt(state.picked) : null;
  if (!C) return null;
  const span = Math.max(...box.high.map((h, k) => h - box.low[k])), own = eigen(C);
  if (!ellipsoidScale) { // The softest tenth of the map fills a sixth of the scene.
    const worst = fields.find(f => f.name === "worst_stiffness_N_per_mm"), soft = worst ? 1e-3 / quantile(sortedValues(worst), 0.1) : own[0].value;
    ellipsoidScale = 0.16 * span / soft;
  }
  const [v, t] = SPHERE, at3 = X.map(x => x[state.picked]), s = Math.min(ellipsoidScale, 0.3 * span / own[0].value), thin = 0.004 * span, pos = new Float32Array(v.length);
  for (let k = 0; k < v.length; k += 3) {
    const p = [v[k], v[k + 1], v[k + 2]], q = [0, 1, 2].map(r => at3[r]);
    for (const e of own) { const along = dot(p, e.way) * Math.max(s * e.value, thin); for (let r = 0; r < 3; r++) q[r] += along * e.way[r]; }
    pos.set(q, k);
  }
  return { ...flatMesh(pos, Uint32Array.from(t)), colour: ELLIPSOID, own };
}
