// The 3-D view of grasps: hand, object, contacts and forces, to turn with the mouse; steps through grasps and loads.
for (const { kind, frame, solid: packed } of scene.solids)
  showSolid(kind, C[kind], packed, { glass: kind === "object", frame: frame === null ? undefined : frame });
arrows("axes", C.axes, [0, 1, 2].map((k) => [[0, 0, 0], unit(k, 0.3)]), 0.008);
["x", "y", "z"].forEach((name, k) => label(unit(k, 0.35), "axis", () => name, "axes"));
const still = [things.length, texts.length]; // what all grasps share
const KINDS = { forces: ["force", 0.022], motions: ["motion", 0.012], disturbance: ["load", 0.024] };
let grasp, perGrasp; // the one that is seen; what is drawn of it whatever the load

/** A grasp: the hand's pose, its contacts, joints and fingers. */
function stand(number) {
  grasp = scene.grasps[number];
  frames.splice(0, frames.length, ...grasp.poses);
  middle = times(0.5, add(...grasp.box));
  forget(...still);
  const { contacts, joints } = grasp, fingers = grasp.fingers.flatMap((p) => p.slice(1).map((b, i) => [p[i], b]));
  made("hand", C.bone, (out) => fingers.forEach(([a, b]) => rod(out, a, b, 0.025 * size)));
  made("points", C.ink, (out) => contacts.forEach((c) => ball(out, c.position, 0.035 * size)), { ghost: 1 });
  made("cones", C.cone, (out) => {
    const h = 0.38 * size;
    for (const c of contacts) lathe(out, c.position, c.normal, [[0, 0], [h, Math.min(c.friction, 1.5) * h]], 48);
  }, { veil: 0.3 });
  made("joints", C.cone, (out) => {
    const end = (j, s) => add(j.origin, j.axis, s * size);
    for (const j of joints) rod(out, end(j, -0.3), end(j, 0.3), 0.009 * size);
  }, { ghost: 1 });
  arrows("normals", C.ink, contacts.map((c) => [c.position, times(0.42 * size, c.normal)]), 0.012);
  contacts.forEach((c, i) => {
    const at = add(c.position, c.normal, -0.1 * size);
    label(at, "contact", (names) => (names ? `${i} ${c.link}` : `${i}`), "numbers");
  });
  for (const j of joints) label(add(j.origin, j.axis, 0.34 * size), "joint", (names) => (names ? j.name : ""), "joints");
  perGrasp = [things.length, texts.length];
  show(+chosen.load.value);
}
/** The arrows of a load on the grasp. */
function show(number) {
  const load = grasp.loads[number];
  forget(...perGrasp);
  for (const { kind, at, step, heads } of load ? load.arrows : [])
    arrows(kind, C[KINDS[kind][0]], [[at, step]], KINDS[kind][1], heads);
  find(".said").textContent = [scene.grasps.length > 1 ? grasp.said : "", load ? load.said : ""].filter(Boolean).join(" ");
  later();
}
sides = () => grasp.sides;

// --- which grasp, which load ---
const chosen = { grasp: find("[name=grasp]"), load: find("[name=load]") };
const choose = {
  grasp: (k) => { stand(k); reset(); },
  load: show,
};
for (const [name, select] of Object.entries(chosen)) {
  const count = () => (name === "grasp" ? scene.grasps : grasp.loads).length;
  select.addEventListener("input", () => choose[name](+select.value));
  for (const [way, step] of [["previous", -1], ["next", 1]])
    find(`[name=${name}-${way}]`).addEventListener("click", () => {
      select.value = (+select.value + step + count()) % count();
      choose[name](+select.value);
    });
}
figure.classList.add("live");
stand(+chosen.grasp.value);
reset();
function pointed() {
  const [, , load, , number] = addressed(true);
  if (scene.grasps[number]) stand((chosen.grasp.value = number));
  if (grasp.loads[load]) show((chosen.load.value = load));
  addressed();
}
window.addEventListener("hashchange", pointed);
pointed();
