"""The rows of a node's program by name: one 64-bit id says what a row is, and `kernel.values` makes it on the fly.

Every row is a . z >= b over the reduced unknowns z (`reduced`), of which the first nu are motions, the others
forces. It combines a few *base values*, affine in z: forces c = C z + off and motions d = D z + before.

    contact i    c[3i], c[3i+1], c[3i+2]: c_n, c_t1, c_t2    d[3i], d[3i+1], d[3i+2]: d_n, d_t1, d_t2
    actuator j   c[3m+2j]: the slack f - f_c (if its command is sought: f), c[3m+2j+1]: effort left    d[3m+j]: t
    plain k      with bounds lo[k], hi[k]: c from 3m + 2a on, the objective and limits of forces, F values in all;
                 then d from 3m + a on, motions; last, unbounded and only where they are used, the energy that the
                 disturbance and fixed commands put in, and that of commands per unit of the objective

    soft finger s  after the other plain forces: torsion over its lever; after capped motions: its turning times it

An id holds kind, index and two angles, or a patch and one of its sides, so that a working set of ids is all a node has
to keep, and a parent's working set is legal in every child. Angles are integers, `TURN_DIRECTIONS` to a turn. The kinds
and what they say are those of `proofs/kinds`; BOX rows bound z itself and give the first working set. The ENERGY row of
node k is the tangent, at the point of k, of the balance of energy: sum c_n^2 <= w . r + f_c . t.
In a step of a load's path d_n, and t of stops and slack tendons, are whole motions, all others those of the step; then
it is sum c_n^2 + before c_n.
"""

from __future__ import annotations

BOX_UP, BOX_DOWN = 22, 23  # kinds of bounds of a search's own, which no certificate may cite
SIDE_SHIFT = 40  # place of the side of a soft finger's patch in an id, whose patch is below it
MIN_SECTOR_WIDTH = 64  # sectors that are no wider than this, in grid steps, stay as they are,
FINEST_PATCH = 1 << 30  # and so do patches of soft fingers from this number on
KIND_SHIFT, INDEX, ANGLE = 58, 50, 25  # places of the fields in an id; the second angle is at 0
NODE = (1 << INDEX) - 1  # of an ENERGY row, which has the number of its node in place of angles
