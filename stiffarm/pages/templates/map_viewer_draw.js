// Drawing of robot, points, cells and box: by WebGL, or on a 2-D canvas where there is none.
const LIGHT = unit([-0.45, 0.67, 0.59]);
function makeGL(canvas) {
  if (location.hash.includes("canvas")) return null;
  const gl = canvas.getContext("webgl", { alpha: false, antialias: true, preserveDrawingBuffer: true });
  if (!gl) return null;
  const solid = buildProgram(gl, `attribute vec3 pos, nor; uniform mat4 M, V, P; varying vec3 n;
    void main() { n = mat3(V) * mat3(M) * nor; gl_Position = P * V * M * vec4(pos, 1.0); }`,
  `precision mediump float; varying vec3 n; uniform vec3 colour; uniform float alpha;
    void main() { vec3 u = normalize(n); if (!gl_FrontFacing) u = -u;
      float light = 0.46 + 0.32 * max(u.z, 0.0) + 0.32 * max(dot(u, vec3(-0.45, 0.67, 0.59)), 0.0); gl_FragColor = vec4(colour * light, alpha); }`);
  // Hidden points go behind the eye; those without a value are half as large.
  const dots = buildProgram(gl, `attribute vec3 pos; attribute vec4 tint; uniform mat4 V, P; uniform float scale, parallel, least; varying vec3 c;
    void main() { gl_Position = tint.a < 0.2 ? vec4(2.0, 2.0, 2.0, 1.0) : P * V * vec4(pos, 1.0);
      float size = scale / mix(gl_Position.w, 1.0, parallel); gl_PointSize = max(tint.a > 0.8 ? 0.45 * size : size, least); c = tint.rgb; }`,
  `precision mediump float; varying vec3 c;
    void main() { vec2 d = 2.0 * gl_PointCoord - 1.0; float r = dot(d, d); if (r > 1.0) discard;
      vec3 n = vec3(d.x, -d.y, sqrt(1.0 - r)); float light = 0.80 + 0.22 * max(dot(n, vec3(-0.45, 0.67, 0.59)), 0.0); gl_FragColor = vec4(c * light, 1.0); }`);
  const flat = buildProgram(gl, `attribute vec3 pos; attribute vec4 tint; uniform mat4 V, P; varying vec3 c;
    void main() { gl_Position = P * V * vec4(pos, 1.0); c = tint.rgb; }`, "precision mediump float; varying vec3 c; void main() { gl_FragColor = vec4(c, 1.0); }");
  const line = buildProgram(gl, LINE_VERTEX, LINE_FRAGMENT);
  const where = (p, name) => (p.places ??= {})[name] ??= gl.getUniformLocation(p, name);
  const attributes = new Set();
  const attribute = (p, name, b, n, kind = gl.FLOAT, normal = false, stride = 0, offset = 0) => {
    const k = gl.getAttribLocation(p, name); gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.enableVertexAttribArray(k); attributes.add(k);
    gl.vertexAttribPointer(k, n, kind, normal, stride, offset);
  };
  const done = () => { for (const k of attributes) gl.disableVertexAttribArray(k); attributes.clear(); };
  const fill = (b, data, use) => { gl.bindBuffer(gl.ARRAY_BUFFER, b); gl.bufferData(gl.ARRAY_BUFFER, data, use); return b; };
  const buffer = data => fill(gl.createBuffer(), data, gl.STATIC_DRAW);
  const meshes = bodies.map(b => ({ pos: buffer(b.pos), nor: buffer(b.nor), count: b.pos.length / 3 }));
  const xyz = new Float32Array(3 * N);
  for (let i = 0; i < N; i++) for (let k = 0; k < 3; k++) xyz[3 * i + k] = hasPlace(i) ? X[k][i] : 0;
  const points = buffer(xyz), tintBuffer = gl.createBuffer(), lineBuffer = gl.createBuffer();
  let tiles = null;
  const set = (p, name, value) => gl.uniformMatrix4fv(where(p, name), false, new Float32Array(value));
  const use = (p, C) => { gl.useProgram(p); set(p, "V", C.V); set(p, "P", C.P); };
  function drawRobot(C, F, alpha) {
    use(solid, C); gl.uniform1f(where(solid, "alpha"), alpha);
    bodies.forEach((b, k) => {
      set(solid, "M", F[b.frame]); gl.uniform3fv(where(solid, "colour"), b.colour);
      attribute(solid, "pos", meshes[k].pos, 3); attribute(solid, "nor", meshes[k].nor, 3); gl.drawArrays(gl.TRIANGLES, 0, meshes[k].count);
    });
    done();
  }
  return {
    name: "WebGL",
    lost: () => gl.isContextLost(),
    update() { // Points or colours changed.
      fill(tintBuffer, tints, gl.DYNAMIC_DRAW);
      if (!state.cells || !hasCells()) { tiles = null; return; }
      const { corners, points: own } = cells(), pos = new Float32Array(18 * own.length), colour = new Uint8Array(24 * own.length);
      own.forEach((i, c) => [0, 1, 2, 0, 2, 3].forEach((k, j) => {
        pos.set(corners.subarray(12 * c + 3 * k, 12 * c + 3 * k + 3), 18 * c + 3 * j); colour.set(tints.subarray(4 * i, 4 * i + 4), 24 * c + 4 * j);
      }));
      tiles = { pos: fill(tiles ? tiles.pos : gl.createBuffer(), pos, gl.DYNAMIC_DRAW), tint: fill(tiles ? tiles.tint : gl.createBuffer(), colour, gl.DYNAMIC_DRAW), count: 6 * own.length };
    },
    draw(C, F, shades, ratio) {
      gl.viewport(0, 0, C.width, C.height); gl.clearColor(...shades.sky, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
      if (state.robot === "solid") drawRobot(C, F, 1);
      if (tiles) {
        use(flat, C); attribute(flat, "pos", tiles.pos, 3); attribute(flat, "tint", tiles.tint, 4, gl.UNSIGNED_BYTE, true);
        gl.drawArrays(gl.TRIANGLES, 0, tiles.count); done();
      } else {
        use(dots, C); gl.uniform1f(where(dots, "scale"), 2 * radius() * C.P[5] * C.height / 2); gl.uniform1f(where(dots, "parallel"), state.perspective ? 0 : 1);
        gl.uniform1f(where(dots, "least"), 1.5 * ratio);
        attribute(dots, "pos", points, 3); attribute(dots, "tint", tintBuffer, 4, gl.UNSIGNED_BYTE, true); gl.drawArrays(gl.POINTS, 0, N); done();
      }
      const lines = walls(C);
      use(line, C); set(line, "M", I()); gl.uniform2f(where(line, "screen"), C.width / 2, C.height / 2); gl.uniform1f(where(line, "width"), 0.6 * ratio);
      fill(lineBuffer, lineData(lines, lines.map(l => shades[l[2]])), gl.DYNAMIC_DRAW);
      ["a", "b", "tint"].forEach((name, k) => attribute(line, name, lineBuffer, 3, gl.FLOAT, false, 40, 12 * k)); attribute(line, "side", lineBuffer, 1, gl.FLOAT, false, 40, 36);
      gl.drawArrays(gl.TRIANGLES, 0, 6 * lines.length); done();
      if (state.robot === "faint") { // Depth first, so that only its outer surface shines through.
        gl.colorMask(false, false, false, false); drawRobot(C, F, 1); gl.colorMask(true, true, true, true);
        gl.enable(gl.BLEND); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA); gl.depthFunc(gl.LEQUAL); drawRobot(C, F, 0.4); gl.depthFunc(gl.LESS); gl.disable(gl.BLEND);
      }
    },
  };
}

// Without WebGL: far things first. Of very many points every k-th is drawn.
const MOST_FLAT = 12000;
// Long triangles spoil the order of depth: they are cut in two until no side is longer than this, m.
const LONGEST_SIDE = 0.15;
function shortSided({ pos, nor }) {
  const out = [], normals = [];
  const cut = (a, b, c, n, depth) => {
    const sides = [[a, b, c], [b, c, a], [c, a, b]].map(t => [Math.hypot(...minus(t[0], t[1])), t]).sort((x, y) => y[0] - x[0]);
    if (sides[0][0] <= LONGEST_SIDE || depth > 10) { out.push(...a, ...b, ...c); normals.push(...n, ...n, ...n); return; }
    const [p, q, r] = sides[0][1], middle = p.map((x, k) => 0.5 * (x + q[k]));
    cut(p, middle, r, n, depth + 1); cut(middle, q, r, n, depth + 1);
  };
  const three = (v, f) => [v[f], v[f + 1], v[f + 2]];
  for (let f = 0; f < pos.length; f += 9) cut(three(pos, f), three(pos, f + 3), three(pos, f + 6), three(nor, f), 0);
  return { pos: out, nor: normals };
}
function make2D(canvas) {
  // Where WebGL is missing, so is a GPU worth using: drawn by the processor from the start.
  const pen = canvas.getContext("2d", { willReadFrequently: true }), css = c => `rgb(${c.map(x => Math.round(255 * Math.min(1, x))).join(",")})`;
  const faces = bodies.map(b => ({ ...b, ...shortSided(b) }));
  let tiles = null;
  return {
    name: "2-D canvas", lost: () => false,
    update() { tiles = state.cells && hasCells() ? cells() : null; },
    draw(C, F, shades, ratio) {
      pen.globalAlpha = 1; pen.fillStyle = css(shades.sky); pen.fillRect(0, 0, C.width, C.height);
      for (const [a, b, name] of walls(C)) {
        const p = project(C, ...a), q = project(C, ...b); if (!p || !q) continue;
        pen.strokeStyle = css(shades[name]); pen.lineWidth = ratio; pen.beginPath(); pen.moveTo(p[0], p[1]); pen.lineTo(q[0], q[1]); pen.stroke();
      }
      const things = [];
      if (state.robot !== "none") for (const b of faces) {
        const T = F[b.frame], R = mul([...C.V.slice(0, 12), 0, 0, 0, 1], [...T.slice(0, 12), 0, 0, 0, 1]);
        for (let f = 0; f < b.pos.length; f += 9) {
          const p = [0, 3, 6].map(j => project(C, ...at(T, b.pos[f + j], b.pos[f + j + 1], b.pos[f + j + 2])));
          if (p.includes(null) || (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) > (p[2][0] - p[0][0]) * (p[1][1] - p[0][1])) continue;
          // Hubs stand out of their casings by less than the order of depth can tell: they count as nearer.
          const n = at(R, b.nor[f], b.nor[f + 1], b.nor[f + 2]), light = 0.46 + 0.32 * Math.max(n[2], 0) + 0.32 * Math.max(dot(n, LIGHT), 0);
          things.push([(p[0][2] + p[1][2] + p[2][2]) / 3 - (b.role === "joint" ? 0.08 : 0), p, css(b.colour.map(c => c * light)), state.robot === "faint" ? 0.4 : 1]);
        }
      }
      const colour = i => `rgb(${tints[4 * i]},${tints[4 * i + 1]},${tints[4 * i + 2]})`;
      if (tiles) tiles.points.forEach((i, c) => {
        const p = [0, 1, 2, 3].map(j => project(C, tiles.corners[12 * c + 3 * j], tiles.corners[12 * c + 3 * j + 1], tiles.corners[12 * c + 3 * j + 2]));
        if (!p.includes(null)) things.push([(p[0][2] + p[2][2]) / 2, p, colour(i), 1]);
      });
      else {
        const step = Math.max(1, Math.ceil((counts.shown + counts.grey) / MOST_FLAT)), larger = Math.cbrt(step); // for those left out
        for (let i = 0, k = 0; i < N; i++) if (shown[i] && k++ % step === 0) {
          const p = project(C, X[0][i], X[1][i], X[2][i]);
          if (p) things.push([p[2], p, colour(i), 1, Math.max(larger * radius() * pixelsPerMetre(C, p[2]) * (shown[i] === 2 ? 0.45 : 1), 0.75 * ratio)]);
        }
      }
      things.sort((a, b) => b[0] - a[0]);
      for (const [, p, fill, alpha, r] of things) {
        pen.globalAlpha = alpha; pen.fillStyle = pen.strokeStyle = fill; pen.lineWidth = 0.7; pen.beginPath();
        if (r !== undefined) { pen.arc(p[0], p[1], r, 0, 7); pen.fill(); continue; }
        pen.moveTo(p[0][0], p[0][1]); for (let k = 1; k < p.length; k++) pen.lineTo(p[k][0], p[k][1]);
        pen.closePath(); pen.fill(); if (alpha === 1) pen.stroke();
      }
      pen.globalAlpha = 1;
    },
  };
}
