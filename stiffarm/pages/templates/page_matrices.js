// Shared by the pages that draw a robot: packed arrays, 4 x 4 matrices stored column by column, the chain's frames.
function unpack(text, Kind) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Kind(bytes.buffer);
}
const I = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
function mul(a, b) {
  const out = new Array(16);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++)
    out[4 * c + r] = a[r] * b[4 * c] + a[4 + r] * b[4 * c + 1] + a[8 + r] * b[4 * c + 2] + a[12 + r] * b[4 * c + 3];
  return out;
}
const at = (T, x, y, z) => [T[0] * x + T[4] * y + T[8] * z + T[12], T[1] * x + T[5] * y + T[9] * z + T[13], T[2] * x + T[6] * y + T[10] * z + T[14]];
const shifted = d => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, d[0], d[1], d[2], 1];
function turned(axis, angle, point) {
  const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), k = 1 - c;
  const R = [c + k * x * x, k * x * y + s * z, k * x * z - s * y, 0, k * x * y - s * z, c + k * y * y, k * y * z + s * x, 0,
    k * x * z + s * y, k * y * z - s * x, c + k * z * z, 0, 0, 0, 0, 1];
  const p = at(R, ...point);
  for (let i = 0; i < 3; i++) R[12 + i] = point[i] - p[i];
  return R;
}
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = a => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const rgb = hex => [1, 3, 5].map(k => parseInt(hex.slice(k, k + 2), 16) / 255);

// Frames in the base frame at joint coordinates q (rad): base, each body, flange, then crank and bar where there are any.
function chainFrames(C, q) {
  const out = [I()], dof = C.sign.length;
  for (let i = 0; i < dof; i++)
    out.push(mul(mul(mul(out[i], C.pre[i]), turned([0, 0, 1], C.sign[i] * q[i] + C.offset[i], [0, 0, 0])), C.post[i]));
  out.push(mul(out[dof], C.flange));
  if (C.crank) {
    const own = out[C.crank.own], driven = out[C.crank.driven], crank = [...driven.slice(0, 12), ...own.slice(12)];
    out.push(crank, [...own.slice(0, 12), ...at(crank, ...C.crank.pin), 1]);
  }
  return out;
}

// Corners and normals of a body's triangles, one after another, for flat shading.
function flatMesh(v, t) {
  const pos = new Float32Array(3 * t.length), nor = new Float32Array(pos.length);
  for (let f = 0; f < t.length; f += 3) {
    const c = [0, 1, 2].map(j => [...v.subarray(3 * t[f + j], 3 * t[f + j] + 3)]), n = unit(cross(minus(c[1], c[0]), minus(c[2], c[0])));
    for (let j = 0; j < 3; j++) { pos.set(c[j], 3 * (f + j)); nor.set(n, 3 * (f + j)); }
  }
  return { pos, nor };
}

// Colours of the page's theme: custom properties of the root, as numbers from 0 to 1.
function themeColours(names) {
  const css = getComputedStyle(document.documentElement), out = {};
  for (const name of names) out[name] = rgb(css.getPropertyValue("--" + name).trim().replace(/^#(.)(.)(.)$/, "#$1$1$2$2$3$3"));
  return out;
}
function buildProgram(gl, vertex, fragment) {
  const p = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const s = gl.createShader(kind); gl.shaderSource(s, text); gl.compileShader(s);
    if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
    gl.attachShader(p, s);
  }
  gl.linkProgram(p);
  return p;
}
// A line is a thin rectangle: each end is there twice, pushed to either side on the screen.
const LINE_VERTEX = `attribute vec3 a, b; attribute vec3 tint; attribute float side; uniform mat4 M, V, P; uniform vec2 screen; uniform float width; varying vec3 c;
    void main() { vec4 p = P * V * M * vec4(a, 1.0), q = P * V * M * vec4(b, 1.0); vec2 d = (q.xy / q.w - p.xy / p.w) * screen; float l = length(d);
      d = l > 1e-6 ? d / l : vec2(1.0, 0.0); p.xy += side * width * vec2(-d.y, d.x) / screen * p.w; p.z -= 0.0004 * p.w; gl_Position = p; c = tint; }`;
const LINE_FRAGMENT = "precision mediump float; varying vec3 c; void main() { gl_FragColor = vec4(c, 1.0); }";
function lineData(segments, colours) {
  const data = new Float32Array(segments.length * 60);
  segments.forEach(([a, b], k) => [[a, b, 1], [a, b, -1], [b, a, -1], [b, a, -1], [a, b, -1], [b, a, 1]].forEach(([p, q, s], j) =>
    data.set([...p, ...q, ...colours[k], s], 60 * k + 10 * j)));
  return data;
}
