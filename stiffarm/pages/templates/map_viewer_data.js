// The map's numbers: columns, which points are shown, their colours, scales and ticks. No drawing here.
const D = JSON.parse(document.getElementById("data").textContent), $ = id => document.getElementById(id);
const ARRAYS = { f4: Float32Array, f8: Float64Array, u1: Uint8Array, u2: Uint16Array };
function column(c) {
  const values = unpack(c.data, ARRAYS[c.kind]);
  if (!c.table) return values;
  const table = unpack(c.table, Float64Array), out = new Float64Array(values.length);
  for (let i = 0; i < out.length; i++) out[i] = table[values[i]];
  return out;
}
const N = D.n, dof = D.chain.sign.length, DEG = 180 / Math.PI;
const X = D.points.map(column), Q = D.q.map(column), reached = unpack(D.reached, Uint8Array), nearSingular = unpack(D.near_singular, Uint8Array);
const shares = unpack(D.shares, Uint16Array), relativeError = D.error && column(D.error), STIFF = unpack(D.colours, Uint8Array);
let table = STIFF;
const SIGNS = { deg: "°", percent: "%", um: "µm" };
const signOf = u => SIGNS[u] ?? u.replace(/^um\b/, "µm");
const fields = D.fields.map(f => ({ ...f, sign: signOf(f.unit), values: column(f.values) }));
// Numbers of points are in C order: the last axis runs fastest.
const axes = D.axes.map((a, k) => ({ ...a, size: a.values.length, stride: D.axes.slice(k + 1).reduce((n, b) => n * b.values.length, 1), short: a.name.replace(/_deg$/, "") }));
const indexOf = (i, a) => Math.floor(i / axes[a].stride) % axes[a].size;
const hasPlace = i => Number.isFinite(X[0][i]) && Number.isFinite(X[1][i]) && Number.isFinite(X[2][i]);
const valued = i => reached[i] && Number.isFinite(fields[state.field].values[i]);

const state = {
  field: 0, fixed: axes.map(() => null), // null: all along that axis
  clip: 2, log: false, low: 0, high: 1, // ends of the colours
  filter: false, above: true, limit: 0, hidden: new Set(), // hidden categories
  under: true, planes: [0, 1, 2].map(() => ({ on: false, at: 0, keep: -1 })), // points under the floor left out; planes that cut, and the side that is kept
  views: 1, version: 0, doubt: "none", surface: "none", ellipsoid: true,
  size: 1, cells: true, unreached: D.kind === "slice", robot: D.kind === "slice" ? "faint" : "solid", perspective: true,
  picked: -1, pose: D.rest,
};

// --- numbers as words ---
const digits = (v, n = D.digits) => {
  if (!Number.isFinite(v)) return "–";
  const text = Number(v.toPrecision(n)), size = Math.abs(text);
  return size !== 0 && (size >= 1e7 || size < 1e-4) ? text.toExponential() : String(text);
};
const spaced = n => String(n).replace(/\B(?=(\d{3})+$)/g, "\u202f");

// --- ranges of the quantity in hand ---
function sortedValues(f) {
  if (!f.sorted) {
    const own = [];
    for (let i = 0; i < N; i++) if (reached[i] && Number.isFinite(f.values[i])) own.push(f.values[i]);
    const beside = state.views > 1 && other ? other.values[fields.indexOf(f)] : null; // One scale for both maps.
    if (beside) for (const v of beside) if (Number.isFinite(v)) own.push(v);
    f.sorted = Float64Array.from(own).sort();
  }
  return f.sorted;
}
const quantile = (sorted, share) => {
  if (!sorted.length) return NaN;
  const k = share * (sorted.length - 1), i = Math.floor(k);
  return sorted[i] + (k - i) * ((sorted[i + 1] ?? sorted[i]) - sorted[i]);
};
function colourRange() {
  const own = sortedValues(fields[state.field]);
  if (!own.length) return [0, 1];
  if (fields[state.field].difference) { const most = Math.max(Math.abs(quantile(own, state.clip / 100)), Math.abs(quantile(own, 1 - state.clip / 100))) || 1; return [-most, most]; }
  let low = quantile(own, state.clip / 100), high = quantile(own, 1 - state.clip / 100);
  if (!(high - low > 1e-9 * Math.max(Math.abs(low), Math.abs(high)))) { const d = 0.05 * Math.abs(low) || 1; low -= d; high += d; }
  return [low, high];
}
// Outward to few digits, as in the project's pictures.
function roundedRange([low, high]) {
  const step = 10 ** Math.floor(Math.log10(high - low)) / (high - low < 3 * 10 ** Math.floor(Math.log10(high - low)) ? 20 : 5);
  const from = Math.floor(low / step + 1e-9) * step;
  return [+(from > 0 || low <= 0 ? from : low).toPrecision(6), +(Math.ceil(high / step - 1e-9) * step).toPrecision(6)];
}
function scaleTicks(low, high, log) {
  if (log) {
    const steps = high / low < 8 ? [1, 1.5, 2, 3, 4, 5, 6, 7, 8] : high / low < 100 ? [1, 2, 3, 5, 7] : high / low < 1e4 ? [1, 2, 5] : [1], inner = [];
    for (let d = Math.floor(Math.log10(low)); d <= Math.log10(high) + 1; d++) for (const s of steps) inner.push(+(s * 10 ** d).toPrecision(3));
    return [low, ...inner.filter(t => t > 1.12 * low && t < high / 1.12), high];
  }
  const step = niceStep((high - low) / 6), inner = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) inner.push(+(k * step).toPrecision(12));
  return [low, ...inner.filter(t => t > low + 0.4 * step && t < high - 0.4 * step), high];
}
function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough)), lead = rough / power;
  return power * (lead <= 1 ? 1 : lead <= 2 ? 2 : lead <= 5 ? 5 : 10);
}
const toUnit = v => state.log ? Math.log(v / state.low) / Math.log(state.high / state.low) : (v - state.low) / (state.high - state.low);
// Warm is stiff: where small is stiff, the colours run backwards.
// What a difference is coloured by: dark blue is less, dark orange more, the middle next to white; told apart by all eyes.
const PLUS_MINUS = Uint8Array.from({ length: 768 }, (_, n) => { const t = Math.floor(n / 3) / 127.5 - 1, end = t < 0 ? [0, 84, 150] : [166, 70, 0]; return Math.round(245 + (end[n % 3] - 245) * Math.abs(t) ** 0.8); });
const tableRow = t => { const k = Math.round(255 * Math.min(1, Math.max(0, t))); return 3 * (fields[state.field].stiff < 0 ? 255 - k : k); };

// --- what is shown: 0 hidden, 1 coloured, 2 grey (no pose or no value) ---
const shown = new Uint8Array(N), tints = new Uint8Array(4 * N), doubts = new Uint8Array(N);
const leftOut = unpack(D.left_out, Uint8Array); // 1 under the floor, 2 inside the base
let counts = { shown: 0, of: 0, grey: 0, left: 0 };
const besidePlanes = i => state.planes.some((p, k) => p.on && p.keep * (X[k][i] - p.at) < -1e-9);
const stiffer = () => { const s = fields[state.field].stiff; return s < 0 ? !state.above : state.above; };
function refilter() {
  const f = fields[state.field], cut = state.fixed.map((k, a) => [a, k]).filter(([, k]) => k !== null);
  counts = { shown: 0, of: 0, grey: 0, left: 0 };
  const cutting = state.planes.some(p => p.on);
  for (let i = 0; i < N; i++) {
    shown[i] = 0;
    if (!hasPlace(i) || cut.some(([a, k]) => indexOf(i, a) !== k)) continue;
    if (state.under && leftOut[i]) { if (reached[i]) counts.left++; continue; }
    if (cutting && besidePlanes(i)) continue;
    const v = f.values[i];
    if (!reached[i] || !Number.isFinite(v)) { if (state.unreached) { shown[i] = 2; counts.grey++; } continue; }
    counts.of++;
    if (f.categories.length ? state.hidden.has(v) : state.filter && !(stiffer() ? v >= state.limit : v <= state.limit)) continue;
    shown[i] = 1; counts.shown++;
  }
  recolourPoints();
}
function recolourPoints() {
  const f = fields[state.field], categories = f.categories.map(c => rgb(c.colour).map(x => Math.round(255 * x)));
  const grey = rgb(GREY).map(x => Math.round(255 * x));
  for (let i = 0; i < N; i++) {
    let c = grey;
    if (shown[i] === 1) {
      if (categories.length) c = categories[f.values[i]];
      else { const k = tableRow(toUnit(f.values[i])); c = [table[k], table[k + 1], table[k + 2]]; }
    }
    doubts[i] = doubtOf(i);
    tints[4 * i] = c[0]; tints[4 * i + 1] = c[1]; tints[4 * i + 2] = c[2]; tints[4 * i + 3] = 127 * shown[i];
  }
  recolourOther();
}
const GREY = "#a8b0b8";
// How unsure a stiffness is, 0 to 255: half the width of its 95 % interval as a share of it, 255 from MOST_DOUBT on.
const MOST_DOUBT = 0.5;
const hasDoubt = () => relativeError !== null && relativeError !== undefined && state.field === D.error_of;
const doubtOf = i => hasDoubt() && shown[i] === 1 && Number.isFinite(relativeError[i]) ? Math.round(255 * Math.min(1, relativeError[i] / MOST_DOUBT)) : 0;
// Points in an order of which every beginning is spread over the whole map: while the view turns, a part will do.
const spread = Uint32Array.from({ length: N }, (_, i) => i);
for (let i = N - 1, seed = 1; i > 0; i--) { seed = (seed * 1103515245 + 12345) & 0x7fffffff; const j = Math.floor(seed / 0x80000000 * (i + 1)); [spread[i], spread[j]] = [spread[j], spread[i]]; }
// Points shown, in the order of the quantity: the first k from the soft (or small) end, or from the other.
function extremes(k, largest) {
  const v = fields[state.field].values, own = [];
  for (let i = 0; i < N; i++) if (shown[i] === 1) own.push(i);
  // The stiffest poses of all are singular ones, which no robot moves through: they are passed over where others are.
  const stiff = fields[state.field].stiff, regular = stiff && largest === stiff > 0 ? own.filter(i => !nearSingular[i]) : [];
  return (regular.length ? regular : own).sort((a, b) => (largest ? v[b] - v[a] : v[a] - v[b]) || a - b).slice(0, k);
}
