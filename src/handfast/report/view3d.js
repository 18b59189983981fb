// The report's 3-D view: hand, object, contacts and forces, to turn with the mouse. Plain WebGL, nothing is fetched.
// Vectors are arrays; R (9 numbers, by rows) has the viewer's right, up and towards as rows, as in the pictures.
const figure = document.currentScript.closest("figure");
const find = (what) => figure.querySelector(what);
const scene = JSON.parse(find("script[type='application/json']").textContent);
const canvas = find("canvas"), board = find(".labels");
const gl = canvas.getContext("webgl", { antialias: true, stencil: true });
if (!gl) return; // the sentence for browsers without WebGL stays, and so do the pictures

// --- what is drawn: layers are named like their switches ---
const on = (layer) => (find(`[name=${layer}]`) || { checked: true }).checked;
const things = [];
function thing(layer, color, numbers, more = {}) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
  const color3 = [1, 3, 5].map((k) => parseInt(color.slice(k, k + 2), 16) / 255);
  things.push({ layer, color: color3, buffer, numbers, ...more });
}
/** Numbers for a layer, made by `draw(out)`. */
function made(layer, color, draw, more) {
  const out = [];
  draw(out);
  thing(layer, color, out, more);
}

const C = scene.colors, size = scene.size;
const [low, high] = scene.box, middle = times(0.5, add(low, high)), radius = norm(add(high, low, -1)) / 2;
for (const kind of ["hand", "object"]) {
  if (!scene.solids[kind]) continue;
  const [corners, edges] = solid(scene.solids[kind]);
  thing(kind, C[kind], corners, kind === "object" ? { glass: 1 } : {});
  const sketch = (out) => edges.forEach(([a, b]) => wire(out, a, b, 0.0015 * radius));
  made(kind, C.ink, sketch, kind === "object" ? { rim: 1 } : {});
}
/** Arrows from `at` by `step`, pairs in a list. */
function arrows(layer, color, pairs, thick, heads) {
  made(layer, color, (out) => pairs.forEach(([at, step]) => arrow(out, at, step, thick * size, heads)), { ghost: 1 });
}
const unit = (k, s) => [0, 1, 2].map((i) => s * size * (i === k)); // along an axis of the object's frame
const contacts = scene.contacts, fingers = scene.fingers.flatMap((p) => p.slice(1).map((b, i) => [p[i], b]));
made("hand", C.bone, (out) => fingers.forEach(([a, b]) => rod(out, a, b, 0.025 * size)));
made("points", C.ink, (out) => contacts.forEach((c) => ball(out, c.position, 0.035 * size)), { ghost: 1 });
made("cones", C.cone, (out) => {
  const h = 0.38 * size;
  for (const c of contacts) lathe(out, c.position, c.normal, [[0, 0], [h, Math.min(c.friction, 1.5) * h]], 48);
}, { veil: 0.3 });
made("joints", C.cone, (out) => {
  const end = (j, s) => add(j.origin, j.axis, s * size);
  for (const j of scene.joints) rod(out, end(j, -0.3), end(j, 0.3), 0.009 * size);
}, { ghost: 1 });
arrows("normals", C.ink, contacts.map((c) => [c.position, times(0.42 * size, c.normal)]), 0.012);
arrows("axes", C.axes, [0, 1, 2].map((k) => [[0, 0, 0], unit(k, 0.3)]), 0.008);
const fixed = things.length;

/** The arrows of a load: forces share one scale, motions another, as in the pictures. */
function show(load) {
  for (const t of things.splice(fixed)) gl.deleteBuffer(t.buffer);
  find(".said").textContent = load ? load.said : "";
  const { drawn, forces, motions } = load || {}, longest = (list) => Math.max(0, ...list.map(norm));
  const { at, wrench } = drawn || { at: [0, 0, 0], wrench: [0, 0, 0, 0, 0, 0] };
  const force = wrench.slice(0, 3), moment = wrench.slice(3);
  const most = Math.max(longest(forces || []), norm(force)), f = norm(force), m = norm(moment);
  const from = (steps, long, largest) =>
    (steps || []).map((x, i) => [contacts[i].position, times((long * size) / (largest || 1), x)]);
  const there = (step, heads) => arrows("disturbance", C.load, [[at, step]], 0.024, heads);
  arrows("forces", C.force, from(forces, 0.85, most), 0.022);
  arrows("motions", C.motion, from(motions, 0.4, longest(motions || [])), 0.012);
  if (f > 1e-9 * most) there(times(Math.max((0.85 * size) / most, (0.3 * size) / f), force));
  if (m > 1e-9 * most * size) there(times((0.6 * size) / m, moment), 2);
  later();
}

// --- the two shaders ---
const program = gl.createProgram();
for (const [type, text] of [
  [gl.VERTEX_SHADER, `attribute vec3 at, normal; uniform mat4 clip; uniform mat3 turn; varying vec3 n;
    void main() { n = turn * normal; gl_Position = clip * vec4(at, 1.0); }`],
  [gl.FRAGMENT_SHADER, `precision mediump float; uniform vec4 color; varying vec3 n;
    void main() {
      vec3 m = normalize(n);
      if (m.z < 0.0) m = -m; // both sides of a face are seen
      float light = 0.42 + 0.5 * max(dot(m, vec3(-0.35, 0.55, 0.76)), 0.0) + 0.18 * m.z;
      gl_FragColor = vec4(min(color.rgb * light, 1.0), color.a); }`],
]) {
  const shader = gl.createShader(type);
  gl.shaderSource(shader, text);
  gl.compileShader(shader);
  gl.attachShader(program, shader);
}
gl.linkProgram(program);
gl.useProgram(program);
const uniform = Object.fromEntries(["clip", "turn", "color"].map((n) => [n, gl.getUniformLocation(program, n)]));
const slots = ["at", "normal"].map((n) => gl.getAttribLocation(program, n));
slots.forEach((s) => gl.enableVertexAttribArray(s));

// --- the camera ---
const camera = {}, FAR = 4.5; // of the eye, in half heights of what is shown
/** Along R, with all that is drawn in view: |y| <= half - z / FAR, and x likewise, for every point (x, y, z). */
function look(R, zoom = 1) {
  const wider = canvas.clientHeight / canvas.clientWidth || 1, [right, up, back] = [0, 1, 2].map((i) => row(R, i));
  let half = 0;
  for (const { numbers } of things.filter((t) => on(t.layer)))
    for (let k = 0; k < numbers.length; k += 6) {
      const p = [numbers[k] - middle[0], numbers[k + 1] - middle[1], numbers[k + 2] - middle[2]];
      half = Math.max(half, Math.max(Math.abs(dot(up, p)), Math.abs(dot(right, p)) * wider) + dot(back, p) / FAR);
    }
  Object.assign(camera, { R, target: middle, zoom, half: 1.05 * half });
  later();
}
function reset() {
  look(scene.sides[+find("[name=side]").value].matrix);
}
/** Half of the height that is shown, where the target is [m]. */
const half = () => camera.half / camera.zoom;
/** clip = M (at, 1) by rows, and the rows' parts that depend on the position. */
function projection() {
  const h = half(), aspect = canvas.width / canvas.height, deep = 6 * radius;
  let rows = [[1 / (h * aspect), 0, 0, 0], [0, 1 / h, 0, 0], [0, 0, -1 / deep, 0], [0, 0, 0, 1]];
  if (find("[name=perspective]").checked) {
    const D = FAR * h, far = D + deep, near = Math.max(D - deep, 0.03 * D), a = (far + near) / (far - near);
    const z = [0, 0, -a, a * D - (2 * far * near) / (far - near)];
    rows = [[D / (h * aspect), 0, 0, 0], [0, D / h, 0, 0], z, [0, 0, -1, D]];
  }
  return rows.map(([x, y, z, k]) => {
    const p = [0, 1, 2].map((j) => dot([x, y, z], [camera.R[j], camera.R[3 + j], camera.R[6 + j]]));
    return [...p, k - dot(p, camera.target)];
  });
}

// --- drawing ---
function paint(t, alpha) {
  gl.bindBuffer(gl.ARRAY_BUFFER, t.buffer);
  slots.forEach((s, k) => gl.vertexAttribPointer(s, 3, gl.FLOAT, false, 24, 12 * k));
  gl.uniform4f(uniform.color, ...t.color, alpha);
  gl.drawArrays(gl.TRIANGLES, 0, t.numbers.length / 6);
}
function draw() {
  const scale = Math.min(devicePixelRatio || 1, 2), wide = canvas.clientWidth, high = canvas.clientHeight;
  if (!wide || !high) return;
  const fit = [wide, high].map((x) => Math.round(x * scale));
  if (fit[0] !== canvas.width || fit[1] !== canvas.height) [canvas.width, canvas.height] = fit;
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(1, 1, 1, 1);
  gl.depthMask(true);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  [gl.DEPTH_TEST, gl.BLEND].forEach((x) => gl.enable(x));
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE); // the page does not shine through
  gl.depthFunc(gl.LEQUAL);
  const M = projection(), columns = (A) => A.flatMap((_, j) => A.map((r) => r[j]));
  gl.uniformMatrix4fv(uniform.clip, false, columns(M));
  gl.uniformMatrix3fv(uniform.turn, false, columns([0, 1, 2].map((i) => row(camera.R, i))));
  const seen = things.filter((t) => on(t.layer)), glass = +find("[name=opacity]").value;
  for (const t of seen) if (!t.glass && !t.rim && !t.veil) paint(t, 1);
  gl.depthMask(false);
  for (const t of seen) if (t.veil) paint(t, t.veil);
  if (glass > 0) {
    const faces = seen.filter((t) => t.glass);
    gl.depthMask(true); // depth first: only the nearest faces tint what is behind them
    gl.colorMask(false, false, false, false);
    for (const t of faces) paint(t, 1);
    gl.colorMask(true, true, true, true);
    gl.enable(gl.STENCIL_TEST); // and a point only once, where two pieces share a face
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    for (const t of faces) paint(t, glass);
    gl.disable(gl.STENCIL_TEST);
    for (const t of seen) if (t.rim) paint(t, 0.6 * glass);
    gl.depthMask(false);
  }
  gl.depthFunc(gl.GREATER); // contacts and arrows behind a solid stay faintly visible
  for (const t of seen) if (t.ghost) paint(t, 0.35);
  write(M, wide, high);
}
let waiting = false;
function later() {
  if (!waiting) requestAnimationFrame(() => { waiting = false; draw(); });
  waiting = true;
}

// --- labels are text over the canvas ---
const texts = [];
function label(at, kind, text, needs) {
  const span = board.appendChild(document.createElement("span"));
  span.className = kind;
  texts.push({ at, span, text, needs });
}
contacts.forEach((c, i) => {
  label(add(c.position, c.normal, -0.1 * size), "contact", (names) => (names ? `${i} ${c.link}` : `${i}`), "numbers");
});
for (const j of scene.joints)
  label(add(j.origin, j.axis, 0.34 * size), "joint", (names) => (names ? j.name : ""), "joints");
["x", "y", "z"].forEach((name, k) => label(unit(k, 0.35), "axis", () => name, "axes"));
function write(M, wide, high) {
  const names = on("names");
  for (const { at, span, text, needs } of texts) {
    const [x, y, z, w] = M.map((r) => dot(r, at) + r[3]);
    span.hidden = !(on(needs) && text(names)) || Math.abs(z) > w;
    span.textContent = text(names);
    const left = (0.5 + x / w / 2) * wide, top = (0.5 - y / w / 2) * high;
    span.style.transform = `translate(-50%, -50%) translate(${left}px, ${top}px)`;
  }
}
