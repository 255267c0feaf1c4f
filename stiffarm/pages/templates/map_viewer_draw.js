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
  // What is unsure is hatched, with wider stripes the less sure it is, or fades into the sky.
  const unsure = `uniform float hatch, fade, pitch; uniform vec3 sky;
    vec3 doubted(vec3 c, float d) { c = mix(c, sky, 0.9 * fade * d); float t = fract((gl_FragCoord.x + gl_FragCoord.y) / pitch);
      return hatch > 0.5 && t < 0.8 * d ? sky : c; }`;
  // Points without a value are half as large.
  const dots = buildProgram(gl, `attribute vec3 pos; attribute vec4 tint; attribute float doubt; uniform mat4 V, P; uniform float scale, parallel, least; varying vec3 c; varying float d;
    void main() { gl_Position = P * V * vec4(pos, 1.0); d = doubt;
      float size = scale / mix(gl_Position.w, 1.0, parallel); gl_PointSize = max(tint.a > 0.8 ? 0.45 * size : size, least); c = tint.rgb; }`,
  `precision mediump float; varying vec3 c; varying float d; ${unsure}
    void main() { vec2 p = 2.0 * gl_PointCoord - 1.0; float r = dot(p, p); if (r > 1.0) discard;
      vec3 n = vec3(p.x, -p.y, sqrt(1.0 - r)); float light = 0.80 + 0.22 * max(dot(n, vec3(-0.45, 0.67, 0.59)), 0.0); gl_FragColor = vec4(doubted(c * light, d), 1.0); }`);
  const flat = buildProgram(gl, `attribute vec3 pos; attribute vec4 tint; attribute float doubt; uniform mat4 V, P; varying vec3 c; varying float d;
    void main() { gl_Position = P * V * vec4(pos, 1.0); c = tint.rgb; d = doubt; }`, `precision mediump float; varying vec3 c; varying float d; ${unsure} void main() { gl_FragColor = vec4(doubted(c, d), 1.0); }`);
  // Surfaces of equal value and the ellipsoid: lit from both sides, cut off by the planes.
  const sheet = buildProgram(gl, `attribute vec3 pos, nor; uniform mat4 V, P; varying vec3 n, w;
    void main() { n = mat3(V) * nor; w = pos; gl_Position = P * V * vec4(pos, 1.0); }`,
  `precision mediump float; varying vec3 n, w; uniform vec3 colour, at, keep; uniform float alpha;
    void main() { vec3 s = keep * (w - at); if (min(s.x, min(s.y, s.z)) < -1e-6) discard; vec3 u = normalize(n); if (!gl_FrontFacing) u = -u;
      gl_FragColor = vec4(colour * (0.55 + 0.3 * max(u.z, 0.0) + 0.3 * max(dot(u, vec3(-0.45, 0.67, 0.59)), 0.0)), alpha); }`);
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
  const lineBuffer = gl.createBuffer(), ball = { pos: gl.createBuffer(), nor: gl.createBuffer() };
  // One set of points (or cells) for each map that is seen; and surfaces.
  const maps = [0, 1].map(() => ({ pos: gl.createBuffer(), tint: gl.createBuffer(), doubt: gl.createBuffer(), count: 0, cells: false }));
  let sheets = [];
  function fillPoints(m, colours, sure) { // Only what is shown, well mixed.
    const pos = new Float32Array(3 * (counts.shown + counts.grey)), tint = new Uint8Array(4 * (counts.shown + counts.grey)), doubt = new Uint8Array(counts.shown + counts.grey);
    let n = 0;
    for (const i of spread) if (shown[i]) {
      for (let k = 0; k < 3; k++) pos[3 * n + k] = X[k][i];
      for (let k = 0; k < 4; k++) tint[4 * n + k] = colours[4 * i + k];
      doubt[n++] = sure[i];
    }
    fill(m.pos, pos, gl.DYNAMIC_DRAW); fill(m.tint, tint, gl.DYNAMIC_DRAW); fill(m.doubt, doubt, gl.DYNAMIC_DRAW); m.count = n; m.cells = false;
  }
  function fillCells(m, { corners, points: own }, colours, sure) {
    const pos = new Float32Array(18 * own.length), tint = new Uint8Array(24 * own.length), doubt = new Uint8Array(6 * own.length);
    own.forEach((i, c) => [0, 1, 2, 0, 2, 3].forEach((k, j) => {
      pos.set(corners.subarray(12 * c + 3 * k, 12 * c + 3 * k + 3), 18 * c + 3 * j); tint.set(colours.subarray(4 * i, 4 * i + 4), 24 * c + 4 * j); doubt[6 * c + j] = sure[i];
    }));
    fill(m.pos, pos, gl.DYNAMIC_DRAW); fill(m.tint, tint, gl.DYNAMIC_DRAW); fill(m.doubt, doubt, gl.DYNAMIC_DRAW); m.count = 6 * own.length; m.cells = true;
  }
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
      const tiles = state.cells && hasCells() ? cells() : null;
      mapsSeen().forEach(([colours, sure], k) => tiles ? fillCells(maps[k], tiles, colours, sure) : fillPoints(maps[k], colours, sure));
      sheets = surfaces().map((s, k) => ({ pos: fill((sheets[k] ?? { pos: gl.createBuffer() }).pos, s.pos, gl.DYNAMIC_DRAW), nor: fill((sheets[k] ?? { nor: gl.createBuffer() }).nor, s.nor, gl.DYNAMIC_DRAW), count: s.pos.length / 3, colour: s.colour }));
    },
    // ``most``: points drawn at most, of which those that are drawn are the larger for it; ``places``: left edge of each view.
    draw(C, F, shades, ratio, most, places) {
      gl.disable(gl.SCISSOR_TEST); gl.viewport(0, 0, canvas.width, canvas.height); gl.clearColor(...shades.sky, 1); gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT); gl.enable(gl.DEPTH_TEST);
      gl.enable(gl.SCISSOR_TEST);
      places.forEach((left, k) => { gl.viewport(left, 0, C.width, C.height); gl.scissor(left, 0, C.width, C.height); drawView(C, F, shades, ratio, most, maps[k], k > 0); });
      gl.disable(gl.SCISSOR_TEST);
    },
  };
  function drawView(C, F, shades, ratio, most, m, isOther) {
    const surfaced = sheets.length > 0, clip = p => {
      gl.uniform3fv(where(p, "at"), state.planes.map(q => q.at)); gl.uniform3fv(where(p, "keep"), state.planes.map(q => q.on ? q.keep : 0));
    };
    if (state.robot === "solid") drawRobot(C, F, 1);
    if (surfaced) {
      use(sheet, C); clip(sheet); gl.uniform1f(where(sheet, "alpha"), 1);
      for (const s of sheets) { gl.uniform3fv(where(sheet, "colour"), s.colour); attribute(sheet, "pos", s.pos, 3); attribute(sheet, "nor", s.nor, 3); gl.drawArrays(gl.TRIANGLES, 0, s.count); }
      done();
    } else {
      const p = m.cells ? flat : dots, n = m.cells ? m.count : Math.min(m.count, most);
      use(p, C); gl.uniform3fv(where(p, "sky"), shades.sky); gl.uniform1f(where(p, "pitch"), 7 * ratio);
      gl.uniform1f(where(p, "hatch"), state.doubt === "hatch" ? 1 : 0); gl.uniform1f(where(p, "fade"), state.doubt === "fade" ? 1 : 0);
      if (!m.cells) {
        gl.uniform1f(where(p, "scale"), 2 * radius() * Math.min(1.6, Math.cbrt(m.count / Math.max(1, n))) * C.P[5] * C.height / 2); gl.uniform1f(where(p, "parallel"), state.perspective ? 0 : 1);
        gl.uniform1f(where(p, "least"), 1.5 * ratio);
      }
      attribute(p, "pos", m.pos, 3); attribute(p, "tint", m.tint, 4, gl.UNSIGNED_BYTE, true); attribute(p, "doubt", m.doubt, 1, gl.UNSIGNED_BYTE, true);
      gl.drawArrays(m.cells ? gl.TRIANGLES : gl.POINTS, 0, n); done();
    }
    const round = isOther ? null : ellipsoid(); // Of this map's arm.
    if (round) {
      use(sheet, C); gl.uniform3f(where(sheet, "at"), 0, 0, 0); gl.uniform3f(where(sheet, "keep"), 0, 0, 0); gl.uniform1f(where(sheet, "alpha"), 1); gl.uniform3fv(where(sheet, "colour"), round.colour);
      attribute(sheet, "pos", fill(ball.pos, round.pos, gl.DYNAMIC_DRAW), 3); attribute(sheet, "nor", fill(ball.nor, round.nor, gl.DYNAMIC_DRAW), 3); gl.drawArrays(gl.TRIANGLES, 0, round.pos.length / 3); done();
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
  }
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
    draw(C, F, shades, ratio, most, places) {
      pen.globalAlpha = 1; pen.fillStyle = css(shades.sky); pen.fillRect(0, 0, canvas.width, canvas.height);
      places.forEach((left, k) => { pen.save(); pen.beginPath(); pen.rect(left, 0, C.width, C.height); pen.clip(); pen.translate(left, 0); drawView(C, F, shades, ratio, most, mapsSeen()[k], k > 0); pen.restore(); });
    },
  };
  function drawView(C, F, shades, ratio, most, [tints, doubts], isOther) {
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
      // No stripes here: what is unsure fades either way.
      const pale = i => state.doubt === "none" ? 0 : 0.9 * doubts[i] / 255;
      const colour = i => `rgb(${[0, 1, 2].map(k => Math.round(tints[4 * i + k] * (1 - pale(i)) + 255 * shades.sky[k] * pale(i))).join(",")})`;
      const faces3 = (s, left = () => true) => {
        for (let f = 0; f < s.pos.length; f += 9) {
          if (!left(s.pos.subarray(f, f + 3))) continue;
          const p = [0, 3, 6].map(j => project(C, s.pos[f + j], s.pos[f + j + 1], s.pos[f + j + 2])); if (p.includes(null)) continue;
          const n = unit(at([...C.V.slice(0, 12), 0, 0, 0, 1], s.nor[f], s.nor[f + 1], s.nor[f + 2])), light = 0.6 + 0.45 * Math.abs(n[2]);
          things.push([(p[0][2] + p[1][2] + p[2][2]) / 3, p, css(s.colour.map(c => c * light)), 1]);
        }
      };
      const sheets = surfaces();
      for (const s of sheets) faces3(s, w => !state.planes.some((p, k) => p.on && p.keep * (w[k] - p.at) < 0));
      const round = isOther ? null : ellipsoid(); if (round) faces3(round);
      if (sheets.length) ;
      else if (tiles) tiles.points.forEach((i, c) => {
        const p = [0, 1, 2, 3].map(j => project(C, tiles.corners[12 * c + 3 * j], tiles.corners[12 * c + 3 * j + 1], tiles.corners[12 * c + 3 * j + 2]));
        if (!p.includes(null)) things.push([(p[0][2] + p[2][2]) / 2, p, colour(i), 1]);
      });
      else {
        const step = Math.max(1, Math.ceil((counts.shown + counts.grey) / Math.min(most, MOST_FLAT))), larger = Math.cbrt(step); // for those left out
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
  }
}
