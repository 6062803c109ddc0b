// ---- the surface ----
const bytes = Uint8Array.from(atob($('mesh').textContent.trim()), (c) => c.charCodeAt(0)).buffer;
$('mesh').remove();
const canvas = $('view').querySelector('canvas');
const gl = canvas.getContext('webgl2', {antialias: true, alpha: true, premultipliedAlpha: false, preserveDrawingBuffer: true});
let highlight = () => {};
if (!gl) $('view').append(el('div', {style: 'padding:80px 30px'}, 'This browser offers no WebGL 2: the 3-D view is left out.'));
else threeD();

function threeD() {
  const program = (vs, fs) => {
    const p = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vs], [gl.FRAGMENT_SHADER, fs]]) {
      const s = gl.createShader(type);
      gl.shaderSource(s, '#version 300 es\nprecision highp float;\n' + text);
      gl.compileShader(s);
      if (!gl.getShaderParameter(s, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(s));
      gl.attachShader(p, s);
    }
    ['position', 'normal', 'value'].forEach((name, k) => gl.bindAttribLocation(p, k, name));
    gl.linkProgram(p);
    const uniform = {};
    for (let i = 0; i < gl.getProgramParameter(p, gl.ACTIVE_UNIFORMS); ++i) {
      const u = gl.getActiveUniform(p, i);
      uniform[u.name] = gl.getUniformLocation(p, u.name);
    }
    return {p, uniform};
  };
  const vertex = `in vec3 position; in vec2 normal; in float value;
    uniform mat3 turn; uniform vec3 low, extent, centre, scale;
    out vec3 n; out float v; out vec3 at;
    void main() {
      at = turn * (low + position * extent - centre);
      vec3 m = vec3(normal, 1.0 - abs(normal.x) - abs(normal.y));
      if (m.z < 0.0) m.xy = (1.0 - abs(m.yx)) * vec2(m.x >= 0.0 ? 1.0 : -1.0, m.y >= 0.0 ? 1.0 : -1.0);
      n = turn * normalize(m);
      v = value;
      gl_Position = vec4(at * scale, 1.0);
    }`;
  const shade = program(vertex, `in vec3 n; in float v; in vec3 at; out vec4 result;
    uniform vec3 colour; uniform float alpha, glow, ramp; uniform sampler2D lut;
    void main() {
      vec3 m = normalize(n);
      bool inside = !gl_FrontFacing;
      if (m.z < 0.0) m = -m;
      vec3 base = colour;
      if (ramp > 0.5) base = v > 0.99999 ? vec3(0.69) : texture(lut, vec2(v, 0.5)).rgb;
      if (inside) base *= 0.62;
      vec3 key = normalize(vec3(-0.45, 0.65, 0.9));
      float diffuse = 0.46 + 0.34 * max(dot(m, key), 0.0) + 0.19 * m.z;
      float shine = 0.13 * pow(max(dot(m, normalize(key + vec3(0.0, 0.0, 1.0))), 0.0), 42.0);
      float rim = mix(0.66, 1.0, smoothstep(0.0, 0.55, m.z));
      vec3 c = base * diffuse * rim + shine;
      c = mix(c, vec3(1.0, 0.86, 0.35), glow * 0.42);
      result = vec4(c, alpha < 1.0 ? mix(min(1.0, alpha * 2.6), alpha, smoothstep(0.0, 0.7, m.z)) : 1.0);
    }`);
  const pick = program(vertex, `in vec3 n; in float v; in vec3 at; out vec4 result; uniform vec3 id; void main() { result = vec4(id, 1.0); }`);
  const line = program(`in vec3 position; uniform mat3 turn; uniform vec3 centre, scale; void main() { gl_Position = vec4(turn * (position - centre) * scale, 1.0); }`,
    `out vec4 result; uniform vec3 colour; void main() { result = vec4(colour, 1.0); }`);

  const geometry = facts.geometry;
  const buffer = (target, data) => { const b = gl.createBuffer(); gl.bindBuffer(target, b); gl.bufferData(target, data, gl.STATIC_DRAW); return b; };
  const parts = geometry.parts.map((g) => {
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    buffer(gl.ARRAY_BUFFER, new Uint16Array(bytes, g.positions, 4 * g.points));
    gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.UNSIGNED_SHORT, true, 8, 0);
    buffer(gl.ARRAY_BUFFER, new Int16Array(bytes, g.normals, 2 * g.points));
    gl.enableVertexAttribArray(1); gl.vertexAttribPointer(1, 2, gl.SHORT, true, 4, 0);
    const fields = g.fields.map((offset) => buffer(gl.ARRAY_BUFFER, new Uint16Array(bytes, offset, 2 * g.points)));
    const wide = g.points > 65535;
    buffer(gl.ELEMENT_ARRAY_BUFFER, wide ? new Uint32Array(bytes, g.indices, 3 * g.triangles) : new Uint16Array(bytes, g.indices, 3 * g.triangles));
    gl.bindVertexArray(null);
    const face = facts.faces[g.face];
    return {vao, fields, count: 3 * g.triangles, type: wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT, shown: true, face: g.face, name: face.name, kind: face.kind,
      wall: face.kind === 'body' || face.kind === 'junction', colour: [1, 3, 5].map((i) => parseInt(face.colour.slice(i, i + 2), 16) / 255), row: null};
  });
  const lines = facts.branches.filter((b) => b.points_mm.length > 1).map((b) => {
    const vao = gl.createVertexArray();
    gl.bindVertexArray(vao);
    buffer(gl.ARRAY_BUFFER, new Float32Array(b.points_mm.flat()));
    gl.enableVertexAttribArray(0); gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
    return {vao, count: b.points_mm.length};
  });
  const luts = geometry.fields.map((f) => {
    const t = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, t);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB, f.colours.length, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, Uint8Array.from(f.colours.flatMap((c) => [1, 3, 5].map((i) => parseInt(c.slice(i, i + 2), 16)))));
    for (const k of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, k, gl.LINEAR);
    for (const k of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, k, gl.CLAMP_TO_EDGE);
    return t;
  });

  // Rows of a view: to the right, up, towards the eye; in the world's x (left), y (back), z (head).
  const views = {Front: [[1, 0, 0], [0, 0, 1], [0, -1, 0]], Left: [[0, 1, 0], [0, 0, 1], [1, 0, 0]], Top: [[-1, 0, 0], [0, -1, 0], [0, 0, 1]]};
  const times = (a, b) => a.map((r) => [0, 1, 2].map((j) => r[0] * b[0][j] + r[1] * b[1][j] + r[2] * b[2][j]));
  const middle = box[0].map((x, i) => (x + box[1][i]) / 2);
  const radius = Math.hypot(...size) / 2 || 1;
  const about = (axis, angle) => { const c = Math.cos(angle), s = Math.sin(angle); return axis === 'x' ? [[1, 0, 0], [0, c, -s], [0, s, c]] : [[c, 0, s], [0, 1, 0], [-s, 0, c]]; };
  // Half the height in mm that shows all of the box from a direction.
  const fit = (turn, aspect) => {
    let w = 0, h = 0;
    for (let k = 0; k < 8; ++k) {
      const p = [0, 1, 2].map((i) => (k >> i & 1 ? 1 : -1) * size[i] / 2);
      w = Math.max(w, Math.abs(turn[0].reduce((s, x, i) => s + x * p[i], 0)));
      h = Math.max(h, Math.abs(turn[1].reduce((s, x, i) => s + x * p[i], 0)));
    }
    return 1.12 * Math.max(h, w / aspect, 1e-6);
  };
  const camera = {turn: times(about('x', 0.25), times(about('y', -0.5), views.Front)), centre: [...middle], half: 1};
  const state = {field: -1, xray: false, caps: true, lines: false, hot: -1};

  function draw(cam, aspect, how, picking) {
    const columns = [0, 1, 2].flatMap((j) => [0, 1, 2].map((i) => cam.turn[i][j]));
    const far = Math.hypot(...[0, 1, 2].map((i) => cam.centre[i] - middle[i])) + 1.05 * radius;
    const scale = [1 / (cam.half * aspect), 1 / cam.half, -1 / far];
    const use = ({p, uniform}) => {
      gl.useProgram(p);
      gl.uniformMatrix3fv(uniform.turn, false, columns);
      gl.uniform3fv(uniform.centre, cam.centre);
      gl.uniform3fv(uniform.scale, scale);
      if (uniform.low) { gl.uniform3fv(uniform.low, geometry.low_mm); gl.uniform3fv(uniform.extent, geometry.extent_mm); }
      return uniform;
    };
    gl.clearColor(...(picking ? [0, 0, 0, 0] : how.back || [1, 1, 1, 0]));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST); gl.depthMask(true); gl.disable(gl.BLEND);
    const seen = parts.filter((p) => p.shown && (how.caps || p.wall));
    if (picking) {
      const u = use(pick);
      for (const part of seen) {
        const id = parts.indexOf(part) + 1;
        gl.uniform3f(u.id, (id & 255) / 255, (id >> 8 & 255) / 255, (id >> 16) / 255);
        gl.bindVertexArray(part.vao);
        gl.drawElements(gl.TRIANGLES, part.count, part.type, 0);
      }
      return;
    }
    const u = use(shade);
    if (how.xray) { gl.enable(gl.BLEND); gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA); gl.depthMask(false); }
    gl.uniform1f(u.alpha, how.xray ? 0.16 : 1);
    for (const part of seen) {
      gl.bindVertexArray(part.vao);
      const ramp = how.field >= 0 && part.wall;
      gl.uniform1f(u.ramp, ramp ? 1 : 0);
      gl.disableVertexAttribArray(2);
      if (ramp) {
        gl.bindTexture(gl.TEXTURE_2D, luts[how.field]);
        gl.bindBuffer(gl.ARRAY_BUFFER, part.fields[how.field]);
        gl.enableVertexAttribArray(2); gl.vertexAttribPointer(2, 1, gl.UNSIGNED_SHORT, true, 4, 0);
      }
      gl.uniform3fv(u.colour, part.colour);
      gl.uniform1f(u.glow, part.face === how.hot ? 1 : 0);
      gl.drawElements(gl.TRIANGLES, part.count, part.type, 0);
    }
    gl.disable(gl.BLEND); gl.depthMask(true);
    if (how.lines) {
      const l = use(line);
      gl.uniform3f(l.colour, 0.11, 0.15, 0.2);
      if (!how.xray) gl.disable(gl.DEPTH_TEST);
      for (const c of lines) { gl.bindVertexArray(c.vao); gl.drawArrays(gl.LINE_STRIP, 0, c.count); }
    }
    gl.bindVertexArray(null);
  }

  // Projections: drawn once, each into a picture of its own.
  const shots = [['Front', 'from the front'], ['Left', 'from the left'], ['Top', 'from the head']];
  for (const [view, title] of shots) {
    const w = 720, h = 560;
    canvas.width = w; canvas.height = h;
    gl.viewport(0, 0, w, h);
    const cam = {turn: views[view], centre: middle, half: fit(views[view], w / h)};
    draw(cam, w / h, {field: -1, caps: true, xray: false, lines: false, hot: -1, back: [1, 1, 1, 1]});
    const shot = el('canvas', {width: w, height: h});
    const c = shot.getContext('2d');
    c.drawImage(canvas, 0, 0);
    const bar = niceBar(2 * cam.half / h * 150);
    c.fillStyle = '#5d6b7a'; c.font = '20px system-ui, sans-serif';
    c.fillRect(24, h - 28, bar / (2 * cam.half) * h, 4);
    c.fillText(num(bar) + ' mm', 24, h - 38);
    $('shots').append(el('figure', {}, shot, title));
  }
  function niceBar(mm) { const p = 10 ** Math.floor(Math.log10(mm)); return [5, 2, 1].map((m) => m * p).find((m) => m <= mm) || p; }

  // The view itself.
  const size_of = () => { const r = canvas.getBoundingClientRect(); return [Math.max(1, r.width), Math.max(1, r.height)]; };
  let asked = false;
  const redraw = () => { if (!asked) { asked = true; requestAnimationFrame(() => { asked = false; paint(); }); } };
  function paint() {
    const [w, h] = size_of();
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [pw, ph] = [Math.round(w * ratio), Math.round(h * ratio)];
    if (canvas.width !== pw || canvas.height !== ph) { canvas.width = pw; canvas.height = ph; }
    gl.viewport(0, 0, pw, ph);
    draw(camera, w / h, state);
    const bar = niceBar(2 * camera.half / h * 130);
    $('scale').children[0].textContent = num(bar) + ' mm';
    $('scale').children[1].style.width = bar / (2 * camera.half) * h + 'px';
    const g = [];
    for (const [axis, text] of [[0, 'L'], [1, 'P'], [2, 'H']]) {
      const d = [0, 1, 2].map((i) => camera.turn[i][axis]);
      g.push([d[2], d, text]);
    }
    g.sort((a, b) => a[0] - b[0]);
    $('axes').replaceChildren(...g.flatMap(([z, d, text]) => {
      const colour = {L: '#b3353c', P: '#2c8a57', H: '#2f62a8'}[text];
      const t = svg('text', {x: 34 * d[0], y: -34 * d[1] + 4, 'text-anchor': 'middle', 'font-size': 11, 'font-weight': 600, fill: colour, opacity: 0.6 + 0.4 * (z + 1) / 2});
      t.textContent = text;
      return [svg('line', {x1: 0, y1: 0, x2: 26 * d[0], y2: -26 * d[1], stroke: colour, 'stroke-width': 2.4, 'stroke-linecap': 'round', opacity: 0.6 + 0.4 * (z + 1) / 2}), t];
    }));
  }
  const home = () => { const [w, h] = size_of(); camera.centre = [...middle]; camera.half = fit(camera.turn, w / h); redraw(); };
  highlight = (face) => {
    if (state.hot === face) return;
    state.hot = face;
    for (const p of parts) if (p.row) p.row.classList.toggle('hot', p.face === face);
    redraw();
  };
  const part_at = (x, y) => {
    const [w, h] = size_of();
    gl.bindFramebuffer(gl.FRAMEBUFFER, target(Math.round(w), Math.round(h)));
    gl.viewport(0, 0, Math.round(w), Math.round(h));
    draw(camera, w / h, state, true);
    const pixel = new Uint8Array(4);
    gl.readPixels(Math.round(x), Math.round(h - y - 1), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return parts[pixel[0] + 256 * pixel[1] + 65536 * pixel[2] - 1] || null;
  };
  let off = null;
  function target(w, h) {
    if (off && off.w === w && off.h === h) return off.f;
    if (off) { gl.deleteFramebuffer(off.f); gl.deleteTexture(off.t); gl.deleteRenderbuffer(off.d); }
    off = {w, h, f: gl.createFramebuffer(), t: gl.createTexture(), d: gl.createRenderbuffer()};
    gl.bindTexture(gl.TEXTURE_2D, off.t);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, w, h, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
    gl.bindRenderbuffer(gl.RENDERBUFFER, off.d);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH_COMPONENT24, w, h);
    gl.bindFramebuffer(gl.FRAMEBUFFER, off.f);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, off.t, 0);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.RENDERBUFFER, off.d);
    return off.f;
  }

  // Mouse, touch: one finger turns, two move and zoom; shift or the right button moves.
  const fingers = new Map();
  const shift_by = (dx, dy) => {
    const mm = 2 * camera.half / size_of()[1];
    for (let i = 0; i < 3; ++i) camera.centre[i] += mm * (-dx * camera.turn[0][i] + dy * camera.turn[1][i]);
  };
  const zoom = (factor, x, y) => {
    const [w, h] = size_of();
    const mm = 2 * camera.half / h, dx = x - w / 2, dy = y - h / 2;
    for (let i = 0; i < 3; ++i) camera.centre[i] += mm * (1 - factor) * (dx * camera.turn[0][i] - dy * camera.turn[1][i]);
    camera.half *= factor;
  };
  const local = (e) => { const r = canvas.getBoundingClientRect(); return [e.clientX - r.left, e.clientY - r.top]; };
  canvas.onpointerdown = (e) => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, local(e)); $('tip').style.display = 'none'; };
  canvas.onpointerup = canvas.onpointercancel = (e) => fingers.delete(e.pointerId);
  canvas.oncontextmenu = (e) => e.preventDefault();
  let hover = 0;
  canvas.onpointermove = (e) => {
    const now = local(e);
    const before = fingers.get(e.pointerId);
    if (!before) {
      clearTimeout(hover);
      hover = setTimeout(() => {
        const part = part_at(...now);
        highlight(part ? part.face : -1);
        $('tip').style.display = part ? 'block' : 'none';
        if (part) { $('tip').textContent = part.name; $('tip').style.left = Math.min(now[0] + 14, size_of()[0] - 150) + 'px'; $('tip').style.top = now[1] + 14 + 'px'; }
      }, 30);
      return;
    }
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    if (fingers.size === 2) {
      const other = [...fingers].find(([id]) => id !== e.pointerId)[1];
      const was = Math.hypot(before[0] - other[0], before[1] - other[1]), is = Math.hypot(now[0] - other[0], now[1] - other[1]);
      if (is > 0) zoom(was / is, (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      shift_by(dx / 2, dy / 2);
    } else if (e.shiftKey || e.buttons & 6) shift_by(dx, dy);
    else camera.turn = times(about('x', dy * 0.008), times(about('y', dx * 0.008), camera.turn));
    fingers.set(e.pointerId, now);
    redraw();
  };
  canvas.onpointerleave = () => { clearTimeout(hover); highlight(-1); $('tip').style.display = 'none'; };
  canvas.onwheel = (e) => { e.preventDefault(); zoom(Math.exp(Math.max(-80, Math.min(80, e.deltaY)) * 0.0018), ...local(e)); redraw(); };
  canvas.ondblclick = (e) => { const [x, y] = local(e), [w, h] = size_of(); shift_by(w / 2 - x, h / 2 - y); camera.half *= 0.5; redraw(); };

  // Buttons and legend.
  const button = (text, title, act) => { const b = el('button', {title}, text); b.onclick = () => act(b); $('tools').append(b); return b; };
  for (const [view, title] of shots) button(view, 'See it ' + title, () => { camera.turn = views[view].map((r) => [...r]); home(); });
  button('Fit', 'Show all of it', home);
  const toggle = (text, title, key) => { const b = button(text, title, () => { state[key] = !state[key]; b.classList.toggle('on', state[key]); redraw(); }); b.classList.toggle('on', state[key]); return b; };
  toggle('Caps', 'Show inlets and outlets', 'caps');
  const xray = toggle('X-ray', 'See through the walls', 'xray');
  toggle('Centerlines', 'Show the centerlines', 'lines');
  if (geometry.fields.length) {
    const choose = el('select', {title: 'Colours', onchange: () => {
      state.field = Number(choose.value);
      const f = geometry.fields[state.field];
      $('ramp').style.display = f ? 'block' : 'none';
      if (f) $('ramp').replaceChildren(el('div', {style: 'margin-bottom:6px'}, f.name),
        el('div', {style: 'display:flex'}, el('div', {style: 'display:flex;flex-direction:column;justify-content:space-between;height:160px'},
          el('span', {}, num(f.high, 3)), el('span', {}, num((f.low + f.high) / 2, 3)), el('span', {}, num(f.low, 3))),
        el('i', {style: 'background:linear-gradient(to top,' + f.colours.join(',') + ')'})));
      redraw();
    }}, el('option', {value: -1}, 'Colour: parts'), ...geometry.fields.map((f, k) => el('option', {value: k}, 'Colour: ' + f.name)));
    $('tools').append(choose);
  }
  for (const [title, kinds] of [['Branches', ['body']], ['Junctions', ['junction']], ['Inlets and outlets', ['inlet', 'outlet', 'cap']]]) {
    const group = parts.filter((p) => kinds.includes(p.kind));
    if (!group.length) continue;
    const head = el('h3', {title: 'Show or hide all', style: 'cursor:pointer', onclick: () => {
      const any = group.some((p) => p.shown);
      for (const p of group) { p.shown = !any; p.row.classList.toggle('off', any); }
      redraw();
    }}, `${title} (${group.length})`);
    $('parts').append(head, ...group.map((p) => {
      p.row = el('div', {class: 'part', title: 'Show or hide ' + p.name}, el('i', {style: 'background:' + facts.faces[p.face].colour}), el('span', {}, p.name),
        el('em', {}, num(facts.faces[p.face].area_mm2, 3) + ' mm²'));
      p.row.onmouseenter = () => highlight(p.face);
      p.row.onmouseleave = () => highlight(-1);
      p.row.onclick = () => { p.shown = !p.shown; p.row.classList.toggle('off', !p.shown); redraw(); };
      return p.row;
    }));
  }
  $('legend').querySelector('input').oninput = (e) => {
    const text = e.target.value.toLowerCase();
    for (const p of parts) if (p.row) p.row.style.display = p.name.toLowerCase().includes(text) ? '' : 'none';
  };
  new ResizeObserver(redraw).observe(canvas);
  home();
}

