"""Patches of the sphere of directions (t1, t2, twist) in which a soft finger slides, as certificates name them.

Patches 8 to 15 are the octants: bit 0 of the number is set where t1 < 0, bit 1 for t2, bit 2 for twist. Patch k is
halved into 2k, on the side of its second corner, and 2k + 1, on that of the third, by the plane through its first
corner and the middle of its other two; the new middle is the first corner of both. Each is what its parent is on one
side of a plane, so that all directions of a patch, however planes are rounded, are in one of its halves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from handfast.proofs.fields import Array, Integers, Mask

FIRST, LAST = 8, 2**31 - 1  # numbers of patches
OCTANTS = range(8, 16)


@dataclass(frozen=True, eq=False)
class SlidingPatch:
    """A spherical triangle.

    Attributes:
        corners: (3, 3) unit rows.
        planes: (3, 3) unit rows n, n . x >= 0 for all directions x of it; each across from the corner in its place.
    """

    corners: Array
    planes: Array

    @cached_property
    def middle(self) -> Array:
        """(3,) the unit vector that is as far from all corners, but for rounding."""
        first, second, third = self.corners
        normal = np.cross(second - first, third - first)
        return np.asarray(normal * np.sign(normal @ first) / np.linalg.norm(normal))

    @cached_property
    def reach(self) -> float:
        """The least of middle . x over its directions x: at a corner, since caps are convex."""
        return float((self.corners @ self.middle).min())


@lru_cache(maxsize=1 << 16)
def patch(number: int) -> SlidingPatch:
    """The patch with a number from `FIRST` to `LAST`; others raise `ValueError`."""
    if not FIRST <= number <= LAST:
        raise ValueError(f"{number} is no patch")
    if number in OCTANTS:
        signs = [-1.0 if number >> k & 1 else 1.0 for k in range(3)]
        corners = np.diag(signs)[[2, 0, 1]]
        return SlidingPatch(corners, corners)
    whole = patch(number // 2)
    first, *others = whole.corners
    middle = others[0] + others[1]
    middle /= np.linalg.norm(middle)
    plane = np.cross(first, middle)
    plane /= np.linalg.norm(plane)
    if plane @ others[0] < 0:
        plane = -plane
    if number % 2:
        return SlidingPatch(np.array([middle, first, others[1]]), np.array([whole.planes[1], whole.planes[0], -plane]))
    return SlidingPatch(np.array([middle, first, others[0]]), np.array([whole.planes[2], whole.planes[0], plane]))


def contains(outer: Integers, inner: Integers) -> Mask:
    """(n,) is each patch `outer` one of which `inner` was made, or itself? False for what is no patch."""
    some = (outer >= FIRST) & (outer <= LAST) & (inner >= outer) & (inner <= LAST)
    depth = np.floor(np.log2(np.where(some, inner, 1))) - np.floor(np.log2(np.where(some, outer, 1)))
    return np.asarray(some & (inner >> depth.astype(np.int64) == outer))
