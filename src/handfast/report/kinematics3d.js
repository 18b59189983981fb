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
/** q with every joint that closes a share of the way from the opened hand to the closed one. */
function closed({ joints, opened, shut }, q, share) {
  return q.map((value, j) => {
    if (!joints[j].closing || joints[j].follows) return value;
    return opened[j] + share * (shut[j] - opened[j]);
  });
}
