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

from handfast.proofs.kinds import CONE_WIDENING as CONE_WIDENING
from handfast.proofs.kinds import TURN_DIRECTIONS as TURN_DIRECTIONS
from handfast.proofs.kinds import ActuatorState, ContactState, Row

# kinds of rows, as plain numbers for compiled code
CN_UP, CN_DOWN, GAP_UP, GAP_DOWN = int(Row.CN_UP), int(Row.CN_DOWN), int(Row.GAP_UP), int(Row.GAP_DOWN)
DN_UP, TANGENT, CHORD = int(Row.DN_UP), int(Row.TANGENT), int(Row.CHORD)
C_LEFT, C_RIGHT, D_LEFT, D_RIGHT = int(Row.C_LEFT), int(Row.C_RIGHT), int(Row.D_LEFT), int(Row.D_RIGHT)
STILL_ROW = int(Row.STILL_1_UP)  # to 3 more: +d_t1, -d_t1, +d_t2, -d_t2
T_UP, T_DOWN, E_UP, E_DOWN = int(Row.T_UP), int(Row.T_DOWN), int(Row.E_UP), int(Row.E_DOWN)
S_UP, S_DOWN = int(Row.S_UP), int(Row.S_DOWN)
PLAIN_UP, PLAIN_DOWN = int(Row.BOUND_UP), int(Row.BOUND_DOWN)
BOX_UP, BOX_DOWN = 22, 23  # bounds of a search's own, which no certificate may cite
ENERGY = int(Row.ENERGY)  # of the node whose number, within the mask NODE, takes the place of the angles

# of soft fingers, c_t and torsion together; two angles, a patch, or a patch and its side; +turning, -turning
SOFT_TANGENT, SOFT_CHORD, C_SIDE = int(Row.SOFT_TANGENT), int(Row.SOFT_CHORD), int(Row.C_SIDE)
D_SIDE, TURN_UP, TURN_DOWN = int(Row.D_SIDE), int(Row.TURN_UP), int(Row.TURN_DOWN)
SIDE_SHIFT = 40  # place of the side in an id, whose patch is below it

# what a contact is in a node, and an actuator
UNDECIDED, OPEN, CLOSED, STICK, SLIDE = (int(x) for x in ContactState)
FREE, LOCKED, MOVES, HIGH, LOW, BELOW, ABOVE = (int(x) for x in ActuatorState)

MIN_SECTOR_WIDTH = 64  # sectors that are no wider than this, in grid steps, stay as they are,
FINEST_PATCH = 1 << 30  # and so do patches of soft fingers from this number on
KIND_SHIFT, INDEX, ANGLE = 58, 50, 25  # places of the fields in an id; the second angle is at 0
NODE = (1 << INDEX) - 1
