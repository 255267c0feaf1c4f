// Evaluates a surrogate that stiffarm wrote; S: its numbers as written by surrogate.portable. Needs nothing else.
function stiffarmSurrogate(S) {
  const TURN = 2 * Math.PI, OK = 0, OUTSIDE = 1, BROKEN = 2, NOT_FINITE = 3;
  const nearest = x => { const r = Math.round(x); return Math.abs(x % 1) === 0.5 && r % 2 !== 0 ? r - 1 : r; }; // ties to even, as C's rint
  function functions(f, q) { // All functions of one angle, rad.
    const g = [1], out = new Float64Array(f.matrix.length);
    let x = q - f.centre;
    if (f.periodic) x -= TURN * nearest(x / TURN);
    for (let j = 1; j <= f.harmonics; j++) g.push(Math.cos(j * x), Math.sin(j * x));
    if (f.degrees.length) {
      const u = x / f.half_range, p = [1, u];
      for (let j = 2; j <= f.degrees[f.degrees.length - 1]; j++) p.push(((2 * j - 1) * u * p[j - 1] - (j - 1) * p[j - 2]) / j);
      for (const d of f.degrees) g.push(p[d]);
    }
    f.matrix.forEach((row, i) => { let sum = 0; for (let j = 0; j < row.length; j++) sum += row[j] * g[j]; out[i] = sum; });
    return out;
  }
  function sum(e, q) {
    const f = e.families.map((family, i) => functions(family, q[i])), out = new Float64Array(e.coefficients[0].length);
    for (let t = 0; t < e.terms.length; t++) {
      let product = 1;
      for (let i = 0; i < f.length; i++) product *= f[i][e.terms[t][i]];
      const c = e.coefficients[t];
      for (let j = 0; j < c.length; j++) out[j] += c[j] * product;
    }
    return out;
  }
  function check(q) { // 0, or why there is no value: 3 not finite, 1 outside of the domain, 2 a coupling broken.
    if (!q.every(Number.isFinite)) return NOT_FINITE;
    if (!q.every((v, i) => v >= S.lower[i] && v <= S.upper[i])) return OUTSIDE;
    const within = S.coupled.every((row, k) => { const v = row.reduce((n, c, i) => n + c * q[i], 0); return v >= (S.coupled_lower[k] ?? -Infinity) && v <= (S.coupled_upper[k] ?? Infinity); });
    return within ? OK : BROKEN;
  }
  const rows = q => sum(S.sums[0], q), weights = q => [1, ...S.sums.slice(1).map(e => Math.exp(sum(e, q)[0]))];
  // Angles in rad; factors, if given, multiply the weights (0: the 1 of rows without a weight).
  function evaluate(q, factors) {
    const status = check(q), n = S.n_values;
    if (status) return { status, values: new Float64Array(n).fill(NaN) };
    const s = rows(q), values = new Float64Array(n);
    if (S.link === "identity" || S.link === "exp") for (let i = 0; i < n; i++) values[i] = S.link === "exp" ? Math.exp(s[i]) : s[i];
    else {
      const w = weights(q).map((v, k) => v * (factors ? factors[k] : 1)), many = S.link === "factor" ? 6 : 1;
      for (let i = 0; i < n; i++) {
        const a = many === 6 ? Math.floor(i / 6) : 0, b = i % many;
        for (let r = 0; r < S.row_weights.length; r++) values[i] += many === 6 ? w[S.row_weights[r]] * (s[6 * r + a] * s[6 * r + b]) : w[S.row_weights[r]] * s[r] * s[r];
      }
    }
    return values.every(Number.isFinite) ? { status: OK, values } : { status: NOT_FINITE, values: values.fill(NaN) };
  }
  return { evaluate, check, rows, weights, inputs: S.inputs };
}
