// The hands on the report's 3-D view: mouse, touch, keys, switches, and an address that points at a view.

function turn(x, y) {
  const [c, s, d, t] = [Math.cos(x), Math.sin(x), Math.cos(y), Math.sin(y)];
  camera.R = product([1, 0, 0, 0, d, -t, 0, t, d], product([c, 0, s, 0, 1, 0, -s, 0, c], camera.R));
  later();
}
function pan(x, y) {
  const step = (2 * half()) / canvas.clientHeight;
  camera.target = add(add(camera.target, row(camera.R, 0), -x * step), row(camera.R, 1), y * step);
  later();
}
function zoom(factor) {
  camera.zoom = Math.min(Math.max(camera.zoom * factor, 0.2), 50);
  later();
}
const touches = new Map();
canvas.addEventListener("pointerdown", (e) => {
  canvas.setPointerCapture(e.pointerId);
  canvas.focus({ preventScroll: true });
  touches.set(e.pointerId, [e.clientX, e.clientY]);
});
canvas.addEventListener("pointermove", (e) => {
  const old = touches.get(e.pointerId), now = [e.clientX, e.clientY];
  if (!old) return;
  touches.set(e.pointerId, now);
  const [x, y] = [now[0] - old[0], now[1] - old[1]];
  if (touches.size > 1) {
    const [, other] = [...touches].find(([id]) => id !== e.pointerId);
    const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    zoom(apart(now) / apart(old));
    pan(x / 2, y / 2);
  } else if (e.shiftKey || e.buttons & 6) pan(x, y);
  else turn(0.008 * x, 0.008 * y);
});
for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => touches.delete(e.pointerId));
canvas.addEventListener("wheel", (e) => {
  if (!e.ctrlKey && document.activeElement !== canvas) return; // else the page could not be scrolled past the view
  e.preventDefault();
  zoom(Math.exp(-0.0015 * e.deltaY));
}, { passive: false });
canvas.addEventListener("contextmenu", (e) => e.preventDefault());
canvas.addEventListener("dblclick", reset);
canvas.addEventListener("keydown", (e) => {
  const step = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[e.key];
  const factor = { "+": 1.2, "=": 1.2, "-": 1 / 1.2 }[e.key];
  if (step) turn(...step);
  else if (factor) zoom(factor);
  else if (e.key === "0") reset();
  else return;
  e.preventDefault();
});
find(".controls").addEventListener("input", later);
find("[name=side]").addEventListener("input", reset);
find("[name=reset]").addEventListener("click", reset);
new ResizeObserver(later).observe(canvas);
canvas.addEventListener("webglcontextlost", () => figure.classList.remove("live"));

/** The numbers behind #view= in the page's address: AZIMUTH,ELEVATION[,LOAD[,ZOOM[,GRASP]]] [degrees], to point at a view. */
function addressed(still = false) {
  const m = /^#view=(.+)$/.exec(location.hash), v = m && m[1].split(",").map(Number);
  if (!v || v.length < 2 || !v.every(Number.isFinite)) return [];
  if (still) return v;
  const [a, e] = [v[0], v[1]].map((x) => (x * Math.PI) / 180);
  const right = [-Math.sin(a), Math.cos(a), 0], flat = Math.cos(e);
  const back = [flat * Math.cos(a), flat * Math.sin(a), Math.sin(e)];
  look([...right, ...cross(back, right), ...back], v[3] > 0 ? v[3] : 1);
  return v;
}
