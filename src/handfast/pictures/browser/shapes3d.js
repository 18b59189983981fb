// Shapes for the report's 3-D view, as numbers for the graphics card. Vectors are arrays of three.

// --- vectors ---
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.sqrt(dot(a, a));
const times = (s, a) => [s * a[0], s * a[1], s * a[2]];
const row = (M, i) => M.slice(3 * i, 3 * i + 3);
const product = (A, B) => [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) => dot(row(A, i), [B[j], B[3 + j], B[6 + j]])));
const times3 = (v, R) => [0, 1, 2].map((j) => dot(v, [R[j], R[3 + j], R[6 + j]])); // a row times R

// --- poses: the rows of [R t], 12 numbers ---
const STILL = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
/** R (9 numbers, by rows) and t of a pose. */
const parts = (T) => [[0, 1, 2].flatMap((i) => T.slice(4 * i, 4 * i + 3)), [T[3], T[7], T[11]]];
const placed = (T, p) => [0, 1, 2].map((i) => dot(T.slice(4 * i, 4 * i + 3), p) + T[4 * i + 3]); // a point

// --- geometry: six numbers a corner, position and normal ---
const SHARP = Math.cos((35 * Math.PI) / 180); // faces that meet at a larger angle have an edge between them

function bytes(text) {
  const raw = atob(text), out = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) out[k] = raw.charCodeAt(k);
  return out.buffer;
}

/** A solid's triangles with normals that are smooth except across edges, and its edges as pairs of points. */
function solid(packed) {
  const v = new Float32Array(bytes(packed.vertices));
  const f = packed.wide ? new Uint32Array(bytes(packed.faces)) : new Uint16Array(bytes(packed.faces));
  const at = (i) => [v[3 * i], v[3 * i + 1], v[3 * i + 2]];
  const normals = [], areas = [], around = Array.from({ length: v.length / 3 }, () => []), sides = new Map();
  const edges = [];
  for (let k = 0; k < f.length; k += 3) {
    const [a, b, c] = [f[k], f[k + 1], f[k + 2]];
    const n = cross(add(at(b), at(a), -1), add(at(c), at(a), -1)), area = norm(n);
    normals.push(times(1 / Math.max(area, 1e-30), n));
    areas.push(area);
    for (const [i, j] of [[a, b], [b, c], [c, a]]) {
      around[i].push(k / 3);
      const key = Math.min(i, j) * around.length + Math.max(i, j), other = sides.get(key);
      if (other === undefined) sides.set(key, k / 3);
      else {
        if (dot(normals[other], normals[k / 3]) < SHARP) edges.push([at(i), at(j)]);
        sides.set(key, k / 3);
      }
    }
  }
  const corners = new Float32Array(6 * f.length);
  for (let k = 0; k < f.length; k++) {
    const mine = normals[(k / 3) | 0];
    let sum = [0, 0, 0];
    for (const g of around[f[k]]) if (dot(normals[g], mine) > SHARP) sum = add(sum, normals[g], areas[g]);
    corners.set([...at(f[k]), ...(norm(sum) > 0 ? times(1 / norm(sum), sum) : mine)], 6 * k);
  }
  return [corners, edges];
}

/** Two unit vectors at right angles to a third, in the sense of a turn about it. */
function beside(axis) {
  const least = axis.map(Math.abs).indexOf(Math.min(...axis.map(Math.abs)));
  const u = cross(axis, [0, 1, 2].map((i) => +(i === least)));
  return [times(1 / norm(u), u), cross(axis, times(1 / norm(u), u))];
}

/** A surface of revolution about the axis (unit) through `at`: profile of [height, radius]. */
function lathe(out, at, axis, profile, n = 24) {
  const [u, w] = beside(axis);
  for (let s = 0; s + 1 < profile.length; s++) {
    const [h0, r0] = profile[s], [h1, r1] = profile[s + 1], slant = Math.hypot(h1 - h0, r1 - r0) || 1;
    const corner = (k, h, r) => {
      const a = (2 * Math.PI * k) / n, radial = add(times(Math.cos(a), u), w, Math.sin(a));
      const normal = add(times((h1 - h0) / slant, radial), axis, (r0 - r1) / slant);
      out.push(...add(add(at, axis, h), radial, r), ...normal);
    };
    for (let k = 0; k < n; k++)
      for (const [j, i] of [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]) corner(k + j, i ? h1 : h0, i ? r1 : r0);
  }
}

/** An arrow of radius r, less if it is short, with one head or two. */
function arrow(out, at, step, thick, heads = 1) {
  const long = norm(step), r = Math.min(thick, 0.12 * long), head = 6 * r;
  if (!(long > 0)) return;
  const profile = [[0, 0], [0, r], [long - heads * head, r]];
  for (let k = heads; k > 0; k--) profile.push([long - k * head, 2.6 * r], [long - (k - 1) * head, k > 1 ? r : 0]);
  lathe(out, at, times(1 / long, step), profile);
}
function ball(out, at, r) {
  const turn = [...Array(9).keys()].map((k) => (Math.PI * k) / 8);
  lathe(out, at, [0, 0, 1], turn.map((a) => [-r * Math.cos(a), r * Math.sin(a)]));
}
function rod(out, a, b, r) {
  const step = add(b, a, -1), long = norm(step);
  if (long > 0) lathe(out, a, times(1 / long, step), [[0, 0], [0, r], [long, r], [long, 0]], 12);
}
/** A rod for edges, of which there are many: three sides, no ends. */
function wire(out, a, b, r) {
  const step = add(b, a, -1), long = norm(step);
  if (long > 0) lathe(out, a, times(1 / long, step), [[0, r], [long, r]], 3);
}
/** Three quarters of a circle about the axis (unit) through `at`, with a head: a turn by the right hand. */
function circling(out, at, axis, r, thick) {
  const [u, w] = beside(axis), on = (a) => add(add(at, u, r * Math.cos(a)), w, r * Math.sin(a));
  const angles = [...Array(19).keys()].map((k) => (1.5 * Math.PI * k) / 18);
  angles.slice(1).forEach((a, k) => rod(out, on(angles[k]), on(a), thick));
  const ahead = add(times(-Math.sin(angles[18]), u), w, Math.cos(angles[18]));
  lathe(out, on(angles[18]), ahead, [[0, 0], [0, 3.2 * thick], [9 * thick, 0]], 12);
}
