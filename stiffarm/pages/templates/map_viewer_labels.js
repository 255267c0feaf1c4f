// What is written over the picture: numbers at the box's edges, colour bar or legend, mark of the picked point.
function write(pen, text, x, y, align, baseline, colour) {
  pen.textAlign = align; pen.textBaseline = baseline; pen.lineJoin = "round"; pen.lineWidth = pen.halo; pen.strokeStyle = pen.back; pen.strokeText(text, x, y);
  pen.fillStyle = colour; pen.fillText(text, x, y);
}
const minusSign = text => String(text).replace(/^-(?=[0.]*$)/, "").replace(/^-/, "\u2212");
function drawTicks(pen, C, em, ink) {
  const taken = []; // No number is written over another one.
  const free = (x, y, wide, align, baseline) => {
    const l = align === "left" ? x : align === "right" ? x - wide : x - wide / 2, t = baseline === "top" ? y : baseline === "bottom" ? y - em : y - em / 2;
    if (taken.some(([a, b, c]) => l < a + c + 0.25 * em && a < l + wide + 0.25 * em && t < b + em && b < t + em)) return false;
    taken.push([l, t, wide]); return true;
  };
  const middle = project(C, ...[0, 1, 2].map(k => 0.5 * (box.low[k] + box.high[k]))) || [C.width / 2, C.height / 2];
  for (const edge of axisEdges(C)) {
    if (!edge) continue;
    const a = project(C, ...edge.from), b = project(C, ...edge.to); if (!a || !b) continue;
    const dx = b[0] - a[0], dy = b[1] - a[1], length = Math.hypot(dx, dy); if (length < 3 * em) continue;
    let out = [-dy / length, dx / length]; // Across the edge, away from the box.
    if ((0.5 * (a[0] + b[0]) - middle[0]) * out[0] + (0.5 * (a[1] + b[1]) - middle[1]) * out[1] < 0) out = [-out[0], -out[1]];
    const align = out[0] > 0.35 ? "left" : out[0] < -0.35 ? "right" : "center", baseline = Math.abs(out[1]) < 0.5 ? "middle" : out[1] > 0 ? "top" : "bottom";
    const numbers = ticks[edge.axis].map(t => minusSign(+(1000 * t).toPrecision(9))), wide = Math.max(...numbers.map(n => pen.measureText(n).width));
    // As many numbers as have room: measured along the edge as it lies on the screen.
    const need = Math.abs(dx) / length * (wide + 0.8 * em) + Math.abs(dy) / length * 1.5 * em, each = Math.max(1, Math.ceil(need * (numbers.length - 1) / length));
    const zero = Math.max(0, ticks[edge.axis].findIndex(t => Math.abs(t) < 1e-9));
    ticks[edge.axis].forEach((t, k) => {
      if ((k - zero) % each) return;
      const at3 = [...edge.from]; at3[edge.axis] = t;
      const p = project(C, ...at3); if (!p) return;
      const x = p[0] + 0.5 * em * out[0], y = p[1] + 0.5 * em * out[1];
      if (free(x, y, pen.measureText(numbers[k]).width, align, baseline)) write(pen, numbers[k], x, y, align, baseline, ink);
    });
    const name = `${edge.name}, mm`, half = 0.5 * pen.measureText(name).width + 0.4 * em;
    pen.font = pen.bold;
    if (edge.axis === 2) { const p = project(C, ...edge.to); if (p) write(pen, name, Math.max(p[0] + 0.5 * em * out[0], 2 * half), p[1] - 1.3 * em, "right", "middle", ink); }
    else {
      let far = 1.7 * em + Math.abs(out[0]) * (wide + half);
      const spot = () => [Math.min(Math.max(0.5 * (a[0] + b[0]) + far * out[0], half), C.width - half), 0.5 * (a[1] + b[1]) + (far + em) * out[1]];
      for (let k = 0; k < 4 && !free(...spot(), 2 * half, "center", "middle"); k++) far += 1.2 * em;
      write(pen, name, ...spot(), "center", "middle", ink);
    }
    pen.font = pen.plain;
  }
}
const wrapped = (pen, text, width) => text.split(/\s+/).reduce((lines, word) => {
  const last = lines.length - 1, longer = `${lines[last]} ${word}`;
  if (last >= 0 && pen.measureText(longer).width <= width) lines[last] = longer; else lines.push(word);
  return lines;
}, []);
function barNumbers() {
  const own = sortedValues(fields[state.field]), list = scaleTicks(state.low, state.high, state.log), names = list.map(t => minusSign(digits(t, 4)));
  if (own.length && own[0] < state.low) names[0] = `\u2264 ${names[0]}`;
  if (own.length && own[own.length - 1] > state.high) names[names.length - 1] = `\u2265 ${names[names.length - 1]}`;
  return [list, names];
}
const barTitle = f => `${f.label}${f.sign ? ` (${f.sign})` : ""}`;
// Room at the edges, in pixels; told to the camera before the picture is drawn.
const narrow = (width, em) => width < 46 * em;
const roomFor = (width, em, top) => narrow(width, em) ? { left: 4.5 * em, right: 4.5 * em, top: top + 2.4 * em, bottom: 9 * em } : { left: 4.5 * em, right: 10.5 * em, top: top + 2.4 * em, bottom: 4.5 * em };
function strip(pen, x, y, w, h, across) {
  const steps = Math.round(across ? w : h);
  for (let k = 0; k < steps; k++) {
    const r = tableRow(across ? k / (steps - 1) : 1 - k / (steps - 1));
    pen.fillStyle = `rgb(${table[r]},${table[r + 1]},${table[r + 2]})`;
    if (across) pen.fillRect(x + k, y, 1.5, h); else pen.fillRect(x, y + k, w, 1.5);
  }
  pen.strokeStyle = pen.inkColour; pen.lineWidth = Math.max(1, pen.ratio * 0.7); pen.strokeRect(x, y, w, h);
}
function drawBar(pen, C, em, ink) {
  const f = fields[state.field];
  if (f.categories.length) { drawLegend(pen, C, em, ink, f); return; }
  if (!sortedValues(f).length) { write(pen, `${f.label}: no values`, C.width - 0.8 * em, pen.barTop + 1.5 * em, "right", "middle", ink); return; }
  const [list, names] = barNumbers(), where = list.map(toUnit), ends = f.stiff ? (f.stiff > 0 ? ["soft", "stiff"] : ["stiff", "soft"]) : ["", ""];
  if (narrow(C.width, em)) {
    const x = 2.2 * em, w = C.width - 2 * x, y = C.height - 2.9 * em;
    strip(pen, x, y, w, 0.9 * em, true);
    let free = -Infinity;
    const fits = names.map((n, k) => { const half = 0.5 * pen.measureText(n).width, at1 = x + where[k] * w, last = x + w - 0.5 * pen.measureText(names[names.length - 1]).width - 0.6 * em; if (at1 - half < free || (k < names.length - 1 && at1 + half > last)) return false; free = at1 + half + 0.6 * em; return true; });
    names.forEach((n, k) => {
      const half = 0.5 * pen.measureText(n).width + 0.3 * em;
      if (fits[k]) write(pen, n, Math.min(Math.max(x + where[k] * w, half), C.width - half), y + 1.15 * em, "center", "top", ink);
    });
    pen.font = pen.bold; write(pen, wrapped(pen, barTitle(f) + (state.log ? ", log scale" : ""), w)[0], x, y - 0.3 * em, "left", "bottom", ink); pen.font = pen.plain;
    return;
  }
  const wide = Math.max(...names.map(n => pen.measureText(n).width)), x = C.width - wide - 2.6 * em, lines = [...wrapped(pen, barTitle(f), 9 * em), ...(state.log ? ["log scale"] : [])];
  const top = Math.max(0.16 * C.height, (lines.length + 2.4) * 1.25 * em + pen.barTop), h = Math.min(0.6 * C.height, 32 * em, C.height - top - 4 * em);
  strip(pen, x, top, 1.1 * em, h, false);
  let free = Infinity; // From below; the ends always have their numbers.
  const highest = top + 1.3 * em;
  names.forEach((n, k) => {
    const y = top + (1 - where[k]) * h, end = k === 0 || k === names.length - 1;
    if (!end && (y > free - 1.2 * em || y < highest)) return;
    free = y;
    pen.fillStyle = ink; pen.fillRect(x + 1.1 * em, y - 0.5 * pen.ratio, 0.35 * em, pen.ratio);
    write(pen, n, x + 1.7 * em, y, "left", "middle", ink);
  });
  write(pen, ends[1], x + 0.55 * em, top - 0.3 * em, "center", "bottom", pen.soft); write(pen, ends[0], x + 0.55 * em, top + h + 0.35 * em, "center", "top", pen.soft);
  pen.font = pen.bold;
  lines.forEach((l, k) => write(pen, l, C.width - 0.8 * em, top - (ends[1] ? 1.9 : 0.7) * em - (lines.length - 1 - k) * 1.25 * em, "right", "bottom", ink));
  pen.font = pen.plain;
}
function drawLegend(pen, C, em, ink, f) {
  const own = f.categories.map((c, k) => [c, k]).filter(([, k]) => !state.hidden.has(k) && categoryCounts()[k] > 0);
  const low = narrow(C.width, em), most = Math.max(1, Math.floor((C.height - pen.barTop - 6 * em) / (1.5 * em))), list = own.slice(0, low ? 4 : most);
  const wide = Math.max(0, ...list.map(([c]) => pen.measureText(c.name).width)), x = C.width - wide - 2.8 * em;
  let y = low ? C.height - (list.length + 1) * 1.5 * em : Math.max(0.16 * C.height, pen.barTop + 2 * em);
  pen.font = pen.bold; write(pen, f.label, C.width - 0.8 * em, y - 0.9 * em, "right", "middle", ink); pen.font = pen.plain;
  for (const [c] of list) {
    y += 0.75 * em; pen.fillStyle = c.colour; pen.fillRect(x, y - 0.5 * em, em, em); pen.strokeStyle = pen.inkColour; pen.lineWidth = 0.7 * pen.ratio; pen.strokeRect(x, y - 0.5 * em, em, em);
    write(pen, c.name, x + 1.5 * em, y, "left", "middle", ink); y += 0.75 * em;
  }
  if (list.length < own.length) write(pen, `and ${own.length - list.length} more`, x, y + 0.75 * em, "left", "middle", pen.soft);
}
function categoryCounts() {
  const f = fields[state.field];
  if (!f.counted) { f.counted = f.categories.map(() => 0); for (let i = 0; i < N; i++) if (reached[i] && Number.isFinite(f.values[i])) f.counted[f.values[i]]++; }
  return f.counted;
}
function drawMark(pen, C, em, ink) {
  const i = state.picked; if (i < 0) return;
  const p = project(C, X[0][i], X[1][i], X[2][i]); if (!p) return;
  const r = Math.max(0.6 * em, radius() * pixelsPerMetre(C, p[2]) + 2 * pen.ratio);
  for (const [colour, width] of [[pen.back, 5], [ink, 2]]) {
    pen.strokeStyle = colour; pen.lineWidth = width * pen.ratio; pen.beginPath(); pen.arc(p[0], p[1], r, 0, 7);
    for (const [x, y] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) { pen.moveTo(p[0] + r * x, p[1] + r * y); pen.lineTo(p[0] + 1.7 * r * x, p[1] + 1.7 * r * y); }
    pen.stroke();
  }
}
// A picture taken out of the page: view and labels, and below them what must not be lost on the way.
function pictureOf(view, over, em) {
  const sheet = document.createElement("canvas"), font = `600 ${em}px ${FAMILY}`;
  let pen = sheet.getContext("2d"); pen.font = font;
  const lines = D.warning ? wrapped(pen, D.warning, view.width - 2.4 * em) : [], tall = lines.length ? Math.ceil((lines.length * 1.3 + 0.8) * em) : 0;
  sheet.width = view.width; sheet.height = view.height + tall; pen = sheet.getContext("2d"); // Resizing forgets the font.
  pen.drawImage(view, 0, 0); pen.drawImage(over, 0, 0);
  pen.fillStyle = "#ffe9c2"; pen.fillRect(0, view.height, view.width, tall); pen.fillStyle = "#b8400a"; pen.fillRect(0, view.height, 0.6 * em, tall);
  pen.fillStyle = "#3d2500"; pen.font = font; pen.textBaseline = "top";
  lines.forEach((l, k) => pen.fillText(l, 1.3 * em, view.height + (0.45 + 1.3 * k) * em));
  return sheet;
}
const FAMILY = 'system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif';
// What stripes, fading and the ellipsoid mean, at the foot of the picture.
function drawHints(pen, C, em, ink, places) {
  const words = [];
  if (hasDoubt() && state.doubt !== "none") words.push(`${state.doubt === "hatch" ? "striped" : "faded"}: uncertain, strongest from ± ${100 * MOST_DOUBT} % (95 %)`);
  for (const s of surfaces()) words.push(`surface at ${minusSign(digits(s.level, 4))} ${fields[state.field].sign}`);
  const round = ellipsoid();
  if (round) words.push(`ellipsoid: 1000 N moves the tool ${digits(1e6 * round.own[2].value, 2)} to ${digits(1e6 * round.own[0].value, 2)} mm`);
  if (state.whatIf) words.push("what if: springs differ from the model's");
  if (!words.length || narrow(C.width, em)) return;
  write(pen, words.join("; "), 0.9 * em, C.height - 0.9 * em, "left", "middle", ink);
}
function drawLabels(canvas, C, ratio, shades, fontPixels, barTop, places) {
  const width = places[places.length - 1] + C.width;
  if (canvas.width !== width || canvas.height !== C.height) { canvas.width = width; canvas.height = C.height; }
  const pen = canvas.getContext("2d"), css = c => `rgb(${c.map(x => Math.round(255 * x)).join(",")})`, em = 0.86 * fontPixels * ratio;
  pen.clearRect(0, 0, width, C.height);
  Object.assign(pen, { plain: `${em}px ${FAMILY}`, bold: `600 ${em}px ${FAMILY}`, ratio, halo: 3 * ratio, back: css(shades.sky), inkColour: css(shades.write), soft: css(shades.write), barTop: barTop * ratio });
  pen.font = pen.plain;
  places.forEach((left, k) => {
    pen.save(); pen.translate(left, 0); pen.beginPath(); pen.rect(0, 0, C.width, C.height); pen.clip();
    drawTicks(pen, C, em, css(shades.write)); drawMark(pen, C, em, css(shades.write));
    if (k === places.length - 1) drawBar(pen, C, em, css(shades.write));
    if (places.length > 1) { pen.font = pen.bold; write(pen, k ? other.title : "This map", 0.9 * em, pen.barTop + 1.2 * em, "left", "middle", css(shades.write)); pen.font = pen.plain; }
    pen.restore();
    if (k) { pen.fillStyle = css(shades.edge); pen.fillRect(left - ratio, 0, 2 * ratio, C.height); }
  });
  drawHints(pen, C, em, css(shades.write), places);
}
