// The 3-D view of a hand's page: every link rides on its frame, and a slider for each joint moves the frames.
const { links, joints } = scene;
const AXES = links.length, OBJECT = AXES + joints.length; // frames: of the links, of the joints' axes, of the object
const TRIAD = ["#c0392b", "#2c7d4f", "#2f6db3"]; // x, y, z

links.forEach((link, frame) => {
  if (link.solid) showSolid("hand", link.color, link.solid, { frame });
  TRIAD.forEach((color, k) => arrows(`frame-${frame}`, color, [[[0, 0, 0], unit(k, 0.45)]], 0.016, 1, { frame }));
  label([0, 0, 0], "frame", () => link.name, `frame-${frame}`, frame);
});
for (const { name, link: frame, color, solid: packed, middle: at } of scene.regions) {
  thing("regions", color, solid(packed)[0], { frame });
  label(at, "region", () => name, "tags", frame);
}
joints.forEach((j, k) => {
  const frame = AXES + k, end = (s) => add(j.anchor, j.axis, s * size);
  made("joints", j.closing ? C.cone : C.axes, (out) => {
    rod(out, end(-0.3), end(0.3), 0.011 * size);
    if (!j.closing) return;
    const sense = times(j.closing, j.axis);
    if (j.type === "revolute") circling(out, j.anchor, sense, 0.2 * size, 0.011 * size);
    else arrow(out, j.anchor, times(0.6 * size, sense), 0.022 * size);
  }, { ghost: 1, frame });
  label(end(0.36), "joint", (names) => (names ? j.name : ""), "joints", frame);
});
if (scene.palm) {
  const { center, axis } = scene.palm;
  arrows("palm", C.load, [[add(center, axis, -0.9 * size), times(0.9 * size, axis)]], 0.024);
  label(add(center, axis, 0.12 * size), "region", (names) => (names ? "the palm approaches" : ""), "palm");
}
if (scene.object) showSolid("object", C.object, scene.object.solid, { glass: 1, frame: OBJECT });

// --- the joints ---
const sliders = joints.map((_, k) => find(`[name=joint-${k}]`)), together = find("[name=together]");
let q = [];
/** A joint's value in the units that people read, with those of files behind it. */
function said({ type }, value) {
  const turns = type === "revolute", shown = turns ? (value * 180) / Math.PI : 1000 * value;
  const text = `${shown.toFixed(1)}${turns ? "°" : " mm"} · ${value.toFixed(turns ? 3 : 4)} ${turns ? "rad" : "m"}`;
  return text.replaceAll("-", "−");
}
/** Where everything stands at q. */
function stance(at) {
  const [poses, axes] = standing(scene, at);
  return [...poses, ...axes, scene.object ? scene.object.pose : STILL];
}
/** Put the hand at q. */
function stand(now) {
  q = now;
  frames.splice(0, frames.length, ...stance(q));
  sliders.forEach((slider, k) => {
    const { lower, upper } = joints[k], output = slider.parentElement.querySelector("output");
    slider.value = q[k];
    output.textContent = said(joints[k], q[k]);
    output.classList.toggle("bad", q[k] < lower - 1e-6 || q[k] > upper + 1e-6);
  });
  const named = Object.fromEntries(joints.map((j, k) => [j.name, +q[k].toFixed(6)]));
  find(".configuration").textContent = JSON.stringify({ ...scene.configuration, joints: named }, null, 1);
  later();
}
/** A configuration, a joint moved, with all that follows from it: coupled joints, then loops. */
const reached = (now, moved) => assembled(scene, followed(scene, now, moved), q);
sliders.forEach((slider, k) => slider.addEventListener("input", () => {
  stand(reached(q.map((value, j) => (j === k ? +slider.value : value)), k));
}));
together.addEventListener("input", () => stand(reached(closed(scene, q, +together.value))));
find("[name=given]").addEventListener("click", () => stand(scene.q));

// --- the frames of links ---
const boxes = links.map((_, k) => find(`[name=frame-${k}]`)), every = find("[name=frames]");
every.addEventListener("input", () => {
  for (const box of boxes) box.checked = every.checked;
  later();
});
for (const box of boxes) box.addEventListener("input", later);

figure.classList.add("live");
stand(scene.q);
for (const share of [0, 1]) stances.push(stance(reached(closed(scene, q, share)))); // opened, closed: in view
reset();
window.addEventListener("hashchange", addressed);
addressed();
