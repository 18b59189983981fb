"""Patches of the sphere of directions in which a soft finger slides, compiled.

Direction (t1, t2, twist) of a soft finger's friction is a point of a sphere. Patches 8 to 15 are its octants; patch
k is halved into 2k and 2k + 1 by the plane through its corner that was made last and the middle of the side across, so
that its shape stays the same. A number says how its patch was made; no motion lies between two halves, whose planes
are the same numbers. `proofs/cases.py` makes them on its own.
"""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import quick, smaller

# in `PATCH` numbers: three planes, three corners, the middle, and how far it reaches
CORNERS, MIDDLE, REACH = 9, 18, 21  # places in it


@quick
def patch(number, out, at):
    """Patch `number` into out[at], `PATCH` numbers from there on.

    Planes: directions x of the patch have n . x >= 0 for its three normals n, each across from the corner of the same
    place. The middle w and the reach h: w . x >= h for all x in it.
    """
    depth = 0
    while number >> depth >= 16:
        depth += 1
    octant = number >> depth
    for k in range(9):
        out[at + k] = 0.0
        out[at + CORNERS + k] = 0.0
    for k in range(3):  # corners in the order of halving: across from the last one, twist, the first side is cut
        axis = (k + 2) % 3
        sign = -1.0 if (octant >> axis) & 1 else 1.0
        out[at + 3 * k + axis] = sign
        out[at + CORNERS + 3 * k + axis] = sign
    for level in range(depth - 1, -1, -1):
        halve(out, at, (number >> level) & 1)
    middle(out, at)
    reach = 1.0
    for k in range(3):
        along = 0.0
        for x in range(3):
            along += out[at + MIDDLE + x] * out[at + CORNERS + 3 * k + x]
        reach = smaller(reach, along)
    out[at + REACH] = reach


@quick
def halve(out, at, second):
    """The first or second half of the patch, in its place."""
    a = at + CORNERS
    m0 = out[a + 3] + out[a + 6]
    m1 = out[a + 4] + out[a + 7]
    m2 = out[a + 5] + out[a + 8]
    size = 1.0 / np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    m0 *= size
    m1 *= size
    m2 *= size
    # the plane through the first corner and that middle, towards the second corner
    n0 = out[a + 1] * m2 - out[a + 2] * m1
    n1 = out[a + 2] * m0 - out[a] * m2
    n2 = out[a] * m1 - out[a + 1] * m0
    size = 1.0 / np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if n0 * out[a + 3] + n1 * out[a + 4] + n2 * out[a + 5] < 0.0:
        size = -size
    if second:
        size = -size
    kept = 6 if second else 3  # the corner that stays, besides the first
    across = 3 if second else 6
    for x in range(3):
        side = out[at + across + x]  # the plane across from the corner that goes
        first = out[at + x]
        corner = out[a + kept + x]
        out[at + x] = side
        out[at + 3 + x] = first
        out[a + 6 + x] = corner
        out[a + 3 + x] = out[a + x]
    out[at + 6] = n0 * size
    out[at + 7] = n1 * size
    out[at + 8] = n2 * size
    out[a] = m0
    out[a + 1] = m1
    out[a + 2] = m2


@quick
def middle(out, at):
    """The unit vector as far from all three corners."""
    a = at + CORNERS
    for x in range(3):
        y = (x + 1) % 3
        z = (x + 2) % 3
        out[at + MIDDLE + x] = (out[a + 3 + y] - out[a + y]) * (out[a + 6 + z] - out[a + z])
        out[at + MIDDLE + x] -= (out[a + 3 + z] - out[a + z]) * (out[a + 6 + y] - out[a + y])
    size = 0.0
    along = 0.0
    for x in range(3):
        size += out[at + MIDDLE + x] * out[at + MIDDLE + x]
        along += out[at + MIDDLE + x] * out[a + x]
    size = 1.0 / np.sqrt(size)
    if along < 0.0:
        size = -size
    for x in range(3):
        out[at + MIDDLE + x] *= size
