// A second map beside this one: read from its page, on one scale, under one camera; what they differ by is a quantity.
let other = null; // title, and by number of this map's field the other's values
const noDoubt = new Uint8Array(N), otherTints = new Uint8Array(4 * N);
const seenBeside = () => state.views > 1 && other !== null && other.values[state.field] !== undefined;
const mapsSeen = () => seenBeside() ? [[tints, doubts], [otherTints, noDoubt]] : [[tints, doubts]];
function recolourOther() {
  if (!seenBeside()) return;
  const f = fields[state.field], v = other.values[state.field], grey = rgb(GREY).map(x => Math.round(255 * x));
  const named = f.categories.map(c => rgb(c.colour).map(x => Math.round(255 * x)));
  for (let i = 0; i < N; i++) {
    let c = grey;
    if (Number.isFinite(v[i])) { const k = tableRow(toUnit(v[i])); c = f.categories.length ? named[v[i]] ?? grey : [table[k], table[k + 1], table[k + 2]]; }
    otherTints.set([...c, 127 * shown[i]], 4 * i);
  }
}
const sameAxes = d => d.kind === D.kind && d.n === N && d.axes.length === axes.length
  && d.axes.every((a, k) => a.name === axes[k].name && a.values.length === axes[k].size && a.values.every((x, j) => Math.abs(x - axes[k].values[j]) < 1e-6 * (1 + Math.abs(x))));
// The page's own block of data; says in words why it cannot be used, or nothing.
function takeOther(text, name) {
  const found = /<script type="application\/json" id="data">([^<]*)<\/script>/.exec(text);
  let d = null;
  try { d = found && JSON.parse(found[1]); } catch { d = null; }
  return takeMap(d, name);
}
function takeMap(d, name) {
  if (!d || !d.fields) return `${name} is not a map page. Choose a map.html written by stiffarm.`;
  if (!sameAxes(d)) return `${name} has different points from this map. Make both maps with the same grid.`;
  const known = d.fields.map(f => f.name), there = unpack(d.reached, Uint8Array);
  other = { title: `${name}: ${d.title || "map"}`, values: {}, warning: d.warning };
  while (fields[fields.length - 1].difference) fields.pop();
  const added = [];
  fields.forEach((f, k) => {
    const m = known.indexOf(f.name), same = m >= 0 && f.categories.length === d.fields[m].categories.length;
    if (!same) return;
    const v = Float64Array.from(column(d.fields[m].values), (x, i) => there[i] ? x : NaN);
    other.values[k] = v;
    if (f.categories.length || f.unit === "deg") return;
    // Stiffnesses as a share; what has no unit, or is one already, as it is.
    const ratio = f.stiff !== 0;
    added.push({ name: `difference_${f.name}`, label: `difference of ${f.label}`, unit: ratio ? "percent" : f.unit, sign: ratio ? "%" : f.sign, categories: [], stiff: 0, difference: true,
      values: Float64Array.from(v, (x, i) => reached[i] ? (ratio ? 100 * (x / f.values[i] - 1) : x - f.values[i]) : NaN) });
  });
  fields.push(...added);
  return added.length ? "" : `${name} has none of this map's quantities.`;
}
const showOther = (text, name) => showBeside(takeOther(text, name));
function showBeside(fault) {
  $("otherFault").textContent = fault; $("besidePart").hidden = other === null;
  if (fault) return fault;
  listFields(); $("otherName").textContent = `${other.title}${other.warning ? ` (${other.warning})` : ""}`;
  setViews(2); return "";
}
function setViews(n) {
  state.views = n; $("views2").value = n; currentCamera(); fit(canvas.width / n, canvas.height); setField(Math.min(state.field, fields.length - 1));
}
function besideWords(i) { // What the other map has at a point.
  const v = other && other.values[state.field], f = fields[state.field];
  if (!v || f.categories.length) return "";
  return Number.isFinite(v[i]) ? `Other map: ${digits(v[i])} ${f.sign}${f.stiff ? ` (${minusSign((100 * (v[i] / f.values[i] - 1)).toFixed(1))} %)` : ""}` : "Other map: no value here";
}
$("other").onchange = async e => { const file = e.target.files[0]; if (file) showOther(await file.text(), file.name); };
$("views2").onchange = e => setViews(Number(e.target.value));
