// The report's 3-D view of a grasp: hand, object, contacts and forces, to turn with the mouse.
for (const kind of ["hand", "object"])
  if (scene.solids[kind]) showSolid(kind, C[kind], scene.solids[kind], { glass: kind === "object" });
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

// --- labels ---
contacts.forEach((c, i) => {
  label(add(c.position, c.normal, -0.1 * size), "contact", (names) => (names ? `${i} ${c.link}` : `${i}`), "numbers");
});
for (const j of scene.joints)
  label(add(j.origin, j.axis, 0.34 * size), "joint", (names) => (names ? j.name : ""), "joints");
["x", "y", "z"].forEach((name, k) => label(unit(k, 0.35), "axis", () => name, "axes"));

// --- the chosen load ---
const chosen = find("[name=load]");
chosen.addEventListener("input", () => show(scene.loads[+chosen.value]));
figure.classList.add("live");
show(scene.loads[+chosen.value]);
reset();
function pointed() {
  const load = addressed()[2];
  if (scene.loads[load]) show(scene.loads[(chosen.value = load)]);
}
window.addEventListener("hashchange", pointed);
pointed();
