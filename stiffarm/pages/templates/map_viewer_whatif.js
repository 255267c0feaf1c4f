// What if a spring were another: the compliance anew from its surrogate, at the picked pose and all over the map.
const surrogate = (() => {
  if (!D.surrogate) return null;
  const e = D.surrogate.sums[0], flat = unpack(e.coefficients, Float32Array); // by forces only: three numbers a row
  return stiffarmSurrogate({ ...D.surrogate, sums: [{ ...e, coefficients: e.terms.map((_, t) => flat.subarray(e.m * t, e.m * t + e.m)) }, ...D.surrogate.sums.slice(1)] });
})();
const springs = D.springs.map(s => ({ ...s, times: 1 })), rowSprings = D.surrogate ? D.surrogate.row_weights : [];
// Turn of joint 1 from where the surrogate has it, as a matrix about that joint's axis.
function turnOf(q) {
  if (D.turned === null || D.turned === undefined) return I();
  const pre = D.chain.pre[0];
  return turned(unit([pre[8], pre[9], pre[10]]), D.chain.sign[0] * (q[0] - D.turned), [0, 0, 0]);
}
// A pose of the map as the surrogate takes it: on a limit, single precision may have put it a hair beyond. Couplings hold
// wherever the map has a pose.
const HAIR = 1e-5;
function inDomain(q) {
  const out = D.columns.map((c, k) => Math.min(Math.max(q[c], D.surrogate.lower[k]), D.surrogate.upper[k]));
  return out.every((v, k) => Math.abs(v - q[D.columns[k]]) < HAIR) ? out : null;
}
function learnedCompliance(q) { // 3 x 3, m/N
  const own = surrogate && inDomain(q);
  if (!own) return null;
  const s = surrogate.rows(own), w = surrogate.weights(own), T = turnOf(q), C = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  rowSprings.forEach((g, r) => {
    const x = at(T, s[3 * r], s[3 * r + 1], s[3 * r + 2]), f = w[g] / (g ? springs[g - 1].times : 1);
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++) C[i][j] += f * x[i] * x[j];
  });
  return C;
}
// What each spring, and all else (number 0), adds to the compliance along the load at every point; worked out once.
let partsAlong = null;
function alongLoad() {
  if (partsAlong) return partsAlong;
  const G = springs.length + 1;
  partsAlong = new Float64Array(G * N).fill(NaN);
  for (let i = 0; i < N; i++) if (reached[i]) {
    const q = inDomain(Q.map(c => c[i]));
    if (!q) continue;
    const s = surrogate.rows(q), w = surrogate.weights(q), T = turnOf(Q.map(c => c[i])), d = [0, 1, 2].map(k => T[4 * k] * D.direction[0] + T[4 * k + 1] * D.direction[1] + T[4 * k + 2] * D.direction[2]);
    for (let g = 0; g < G; g++) partsAlong[G * i + g] = 0;
    rowSprings.forEach((g, r) => { const x = s[3 * r] * d[0] + s[3 * r + 1] * d[1] + s[3 * r + 2] * d[2]; partsAlong[G * i + g] += w[g] * x * x; });
  }
  return partsAlong;
}
const stiffnessField = fields.findIndex(f => f.name === "stiffness_N_per_mm");
const ofModel = stiffnessField >= 0 ? fields[stiffnessField].values : null;
function recompute() {
  state.whatIf = springs.some(s => s.times !== 1); state.version++;
  if (!state.whatIf) { fields[stiffnessField].values = ofModel; return; }
  const parts = alongLoad(), G = springs.length + 1, factors = [1, ...springs.map(s => 1 / s.times)], out = new Float64Array(N);
  for (let i = 0; i < N; i++) {
    let c = 0;
    for (let g = 0; g < G; g++) c += parts[G * i + g] * factors[g];
    out[i] = c > 0 ? 1e-3 / c : NaN;
  }
  fields[stiffnessField].values = out;
}
function setSpring(k, times) {
  springs[k].times = times; recompute(); fields[stiffnessField].sorted = undefined; surfaceCache = ["", []];
  showSprings(); changed(); showPicked(); showRanking();
}
let springRows = [];
function buildSprings() {
  if (!surrogate || !springs.length || stiffnessField < 0) return;
  springRows = springs.map(springRow);
  $("whatIfPart").hidden = false; $("whatIfHint").textContent = "Change each spring within its 95 % interval, or ± 15 % where the model states none. The stiffness along the load and the ellipsoid follow; other quantities do not change.";
  $("asModel").onclick = () => { springs.forEach(s => { s.times = 1; }); setSpring(0, 1); };
  showSprings();
}
function springRow(s, k) {
  const id = `spring${k}`, slider = make("input", { type: "range", id, min: 0, max: 200, step: 1 }), value = make("output", { htmlFor: id });
  slider.oninput = () => { const t = Number(slider.value) / 200; setSpring(k, Number(slider.value) === middleOf(s) ? 1 : s.low * (s.high / s.low) ** t); };
  $("springs").append(make("div", { className: "cut" }, make("label", { htmlFor: id, textContent: s.name }), value, make("span", {}), slider));
  return { slider, value };
}
function middleOf(s) { return Math.round(200 * Math.log(1 / s.low) / Math.log(s.high / s.low)); }
function showSprings() {
  springRows.forEach(({ slider, value }, k) => {
    const s = springs[k]; slider.value = Math.round(200 * Math.log(s.times / s.low) / Math.log(s.high / s.low));
    value.textContent = `${s.times === 1 ? "as the model" : `× ${s.times.toPrecision(3)}`}${s.known ? "" : " (interval assumed)"}`; slider.setAttribute("aria-valuetext", value.textContent);
  });
}
