// The stage of a 3-D view: what is drawn, the camera, labels. It knows neither hands nor grasps. Plain WebGL.
// Vectors are arrays; R (9 numbers, by rows) has the viewer's right, up and towards as rows, as in the pictures.
// A thing or label may ride on a frame: its numbers are then in that frame, whose pose is in `frames`.
const figure = document.currentScript.closest("figure");
const find = (what) => figure.querySelector(what);
const scene = JSON.parse(find("script[type='application/json']").textContent);
const canvas = find("canvas"), board = find(".labels");
const gl = canvas.getContext("webgl", { antialias: true, stencil: true });
if (!gl) return; // the sentence for browsers without WebGL stays, and so do the pictures

// --- what is drawn: layers are named like their switches ---
const on = (layer) => (find(`[name=${layer}]`) || { checked: true }).checked;
const things = [];
const frames = []; // poses
const stances = [frames]; // all that has to be in view at once
const poseOf = (t, stance = frames) => stance[t.frame] || STILL;
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

const C = scene.colors, size = scene.size, night = matchMedia("(prefers-color-scheme: dark)").matches;
if (night) Object.assign(C, { ink: "#d7dde3", bone: "#8b949e" });
const [low, high] = scene.box, radius = norm(add(high, low, -1)) / 2;
let middle = times(0.5, add(low, high)); // what the eye turns about
/** A solid and its edges. */
function showSolid(layer, color, packed, { glass, ...more } = {}) {
  const [corners, edges] = solid(packed);
  thing(layer, color, corners, { ...more, glass });
  made(layer, C.ink, (out) => edges.forEach(([a, b]) => wire(out, a, b, 0.0015 * radius)), { ...more, rim: glass });
}
/** Arrows from `at` by `step`, pairs in a list. */
function arrows(layer, color, pairs, thick, heads, more) {
  const draw = (out) => pairs.forEach(([at, step]) => arrow(out, at, step, thick * size, heads));
  made(layer, color, draw, { ghost: 1, ...more });
}
const unit = (k, s) => [0, 1, 2].map((i) => s * size * (i === k)); // along an axis of the frame

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
  for (const [t, stance] of things.filter((t) => on(t.layer)).flatMap((t) => stances.map((s) => [t, s]))) {
    const [turned, shift] = parts(poseOf(t, stance)), far = add(shift, middle, -1), numbers = t.numbers;
    const [x, y, z] = [right, up, back].map((v) => [times3(v, turned), dot(v, far)]);
    for (let k = 0; k < numbers.length; k += 6) {
      const along = ([v, start]) => start + v[0] * numbers[k] + v[1] * numbers[k + 1] + v[2] * numbers[k + 2];
      half = Math.max(half, Math.max(Math.abs(along(y)), Math.abs(along(x)) * wider) + along(z) / FAR);
    }
  }
  Object.assign(camera, { R, target: middle, zoom, half: 1.05 * half });
  later();
}
let sides = () => scene.sides; // to look from
function reset() {
  look(sides()[+find("[name=side]").value].matrix);
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
let M = []; // of the projection, as last drawn
function paint(t, alpha) {
  const [turned, shift] = parts(poseOf(t)), columns = (A) => A.flatMap((_, j) => A.map((r) => r[j]));
  const clip = M.map((r) => [...times3(r.slice(0, 3), turned), r[3] + dot(r, shift)]);
  gl.uniformMatrix4fv(uniform.clip, false, columns(clip));
  gl.uniformMatrix3fv(uniform.turn, false, columns([0, 1, 2].map((i) => times3(row(camera.R, i), turned))));
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
  gl.clearColor(...(night ? [0.106, 0.125, 0.149] : [1, 1, 1]), 1); // as the paper of page.css
  gl.depthMask(true);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
  [gl.DEPTH_TEST, gl.BLEND].forEach((x) => gl.enable(x));
  gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE); // the page does not shine through
  gl.depthFunc(gl.LEQUAL);
  M = projection();
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
  write(wide, high);
}
let waiting = false;
function later() {
  if (!waiting) requestAnimationFrame(() => { waiting = false; draw(); });
  waiting = true;
}

// --- labels are text over the canvas ---
const texts = [];
function label(at, kind, text, needs, frame) {
  const span = board.appendChild(document.createElement("span"));
  span.className = kind;
  texts.push({ at, span, text, needs, frame });
}
/** Keep the first so many things and labels. */
function forget(drawn, written) {
  for (const t of things.splice(drawn)) gl.deleteBuffer(t.buffer);
  for (const t of texts.splice(written)) t.span.remove();
}
function write(wide, high) {
  const names = on("names");
  for (const t of texts) {
    const there = placed(poseOf(t), t.at), [x, y, z, w] = M.map((r) => dot(r, there) + r[3]);
    t.span.hidden = !(on(t.needs) && t.text(names)) || Math.abs(z) > w;
    t.span.textContent = t.text(names);
    const left = (0.5 + x / w / 2) * wide, top = (0.5 - y / w / 2) * high;
    t.span.style.transform = `translate(-50%, -50%) translate(${left}px, ${top}px)`;
  }
}
