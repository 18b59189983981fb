"""The rows of a node's program by name: one 64-bit id says what a row is, and `kernel.values` makes it on the fly.

Every row is a . z >= b over the reduced unknowns z (`reduced`), of which the first nu are motions, the others
forces. It combines a few *base values*, affine in z: forces c = C z + off and motions d = D z.

    contact i    c[3i], c[3i+1], c[3i+2]: c_n, c_t1, c_t2    d[3i], d[3i+1], d[3i+2]: d_n, d_t1, d_t2
    actuator j   c[3m+2j]: the slack f - f_c (if its command is sought: f), c[3m+2j+1]: effort left    d[3m+j]: t
    plain k      with bounds lo[k], hi[k]: c from 3m + 2a on, the objective and limits of forces, F values in all;
                 then d from 3m + a on, motions; last, unbounded and only where they are used, the energy that the
                 disturbance and fixed commands put in, and that of commands per unit of the objective

    soft finger s  after the other plain forces: torsion over its lever; after capped motions: its turning times it

An id holds kind, index and two angles, or a patch and one of its sides, so that a working set of ids is all a node has
to keep, and a parent's working set is legal in every child. Angles are integers, `TURN` to a turn. The kinds and what
they say are those of `stability/certificate`; BOX rows bound z itself and give the first working set. The ENERGY row of
node k is the tangent, at the point of k, of the balance of energy: sum c_n^2 <= w . r + f_c . t.
"""

from __future__ import annotations

TURN = 1 << 24
WIDER = 2.0**-40  # as in `certificate`

# kinds of rows, see `row`
CN_UP, CN_DOWN, GAP_UP, GAP_DOWN, DN_UP, TANGENT, CHORD = 0, 1, 2, 3, 4, 5, 6
C_LEFT, C_RIGHT, D_LEFT, D_RIGHT = 7, 8, 9, 10
STILL = 11  # to 14: +d_t1, -d_t1, +d_t2, -d_t2
T_UP, T_DOWN, E_UP, E_DOWN, S_UP, PLAIN_UP, PLAIN_DOWN, BOX_UP, BOX_DOWN = 15, 16, 17, 18, 19, 20, 21, 22, 23
ENERGY = 24  # of the node whose number, within the mask NODE, takes the place of the angles

# of soft fingers, c_t and torsion together; two angles, a patch, or a patch and its side; +turning, -turning
SOFT_TANGENT, SOFT_CHORD, C_SIDE, D_SIDE, TURN_UP, TURN_DOWN = 25, 26, 27, 28, 29, 30
SIDE = 40  # place of the side in an id, whose patch is below it

# what a contact is in a node
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = 0, 1, 2, 3, 4
# what an actuator is in a node
FREE, LOCKED, MOVES = 0, 1, 2


KIND, INDEX, ANGLE = 58, 50, 25  # places of the fields in an id; the second angle is at 0
NODE = (1 << INDEX) - 1
