// Forward kinematics of a hand for its page: what `Hand.link_poses` computes in Python, and the couplings.
// A joint has type, axis, anchor and ref; a link has parent, pose and joints, as the Python classes of these names.

/** A pose after another: A B. */
function composed(A, B) {
  const [R] = parts(B), t = placed(A, [B[3], B[7], B[11]]);
  return [0, 1, 2].flatMap((i) => [...times3(A.slice(4 * i, 4 * i + 3), R), t[i]]);
}
/** How far a joint's value moves its link from where it stands at `ref`. */
function motion({ type, axis, anchor, ref }, value) {
  const x = value - ref, [c, s] = [Math.cos(x), Math.sin(x)];
  if (type === "prismatic") return STILL.map((n, k) => (k % 4 === 3 ? x * axis[(k - 3) / 4] : n));
  const R = [0, 1, 2].flatMap((i) => { // Rodrigues
    const e = [0, 1, 2].map((k) => +(k === i)), across = cross(e, axis);
    return [0, 1, 2].map((j) => c * e[j] + s * across[j] + (1 - c) * axis[i] * axis[j]);
  });
  return [0, 1, 2].flatMap((i) => [...row(R, i), anchor[i] - dot(row(R, i), anchor)]);
}
/** Poses of the links, and of the frames in which each joint's axis is given, in the base frame. */
function standing({ links, joints }, q) {
  const poses = [], axes = [];
  for (const link of links) {
    let T = link.parent < 0 ? STILL : composed(poses[link.parent], link.pose);
    for (const j of link.joints) {
      axes[j] = T;
      T = composed(T, motion(joints[j], q[j]));
    }
    poses.push(T);
  }
  return [poses, axes];
}
/** q with the joints that follow the joint `moved`, or with all that follow any, where their drivers put them. */
function followed({ joints }, q, moved) {
  return q.map((value, j) => {
    const f = joints[j].follows;
    if (!f || (moved !== undefined && f.driver !== moved)) return value;
    return f.offset + (f.driver < 0 ? 0 : f.ratio * q[f.driver]);
  });
}
/** Gaps [m] of the pins that close loops, three numbers each. */
function gaps(hand, q) {
  const [poses] = standing(hand, q);
  return hand.loops.flatMap((p) => add(placed(poses[p.first], p.on_first), placed(poses[p.second], p.on_second), -1));
}
/** The x that makes |J x + g| small; J by columns. The normal equations suffice: loops have a few joints. */
function solved(J, g) {
  const inner = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0), size = Math.max(...J.map((c) => inner(c, c)));
  const A = J.map((a, i) => [...J.map((b, j) => inner(a, b) + (i === j ? 1e-9 * size : 0)), -inner(a, g)]);
  A.forEach((pivot, i) => A.forEach((other, k) => {
    const share = other[i] / pivot[i];
    if (k !== i) for (let j = i; j <= A.length; j++) other[j] -= share * pivot[j];
  }));
  return A.map((line, i) => line[A.length] / line[i]);
}
/** Newton's method on the joints that follow from loops; null where it finds nothing. */
function pinned(hand, q) {
  const follow = (at) => followed(hand, at), step = 1e-6;
  for (let k = 0, before = Infinity; k < 20; k++) {
    const g = gaps(hand, q), gap = Math.max(...g.map(Math.abs));
    if (gap < 1e-11 || (gap < 1e-6 && gap > 0.5 * before)) return q; // what a file rounds stays open
    before = gap;
    const J = hand.dependent.map((j) => {
      const beside = gaps(hand, follow(q.map((x, i) => (i === j ? x + step : x))));
      return beside.map((x, i) => (x - g[i]) / step);
    });
    const d = solved(J, g);
    q = follow(q.map((x, j) => (hand.dependent.includes(j) ? x + d[hand.dependent.indexOf(j)] : x)));
  }
  return null;
}
/** By how much a value is beyond a joint's limits. */
const limits = ({ lower, upper }, value) => Math.max(lower - value, value - upper);
/** q with the joints of loops where these close, in small steps from a q where they do; as far as they let it come. */
function assembled(hand, q, from) {
  if (!hand.loops.length) return q;
  const way = q.map((x, j) => (hand.dependent.includes(j) ? 0 : x - from[j]));
  const excess = (p) => Math.max(0, ...hand.dependent.map((j) => limits(hand.joints[j], p[j])));
  let [at, done, step] = [from, 0, 1 / Math.max(1, ...way.map((x) => Math.abs(x) / 0.05))];
  while (done < 1 && step > 1e-4) {
    const share = Math.min(step, 1 - done), next = pinned(hand, followed(hand, at.map((x, j) => x + share * way[j])));
    if (next && excess(next) <= Math.max(excess(at), 1e-6)) [at, done] = [next, done + share];
    else step /= 2;
  }
  return at;
}
/** q with every joint that closes a share of the way from the opened hand to the closed one. */
function closed({ joints, opened, shut }, q, share) {
  return q.map((value, j) => {
    if (!joints[j].closing || joints[j].follows) return value;
    return opened[j] + share * (shut[j] - opened[j]);
  });
}
