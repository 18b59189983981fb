"""What of a hand overlaps at rest: collision shapes are often in each other where the links themselves are not."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import transform
from handfast.geometry.scene import Scene
from handfast.model.hand.anatomy import Anatomy

CUTOFF = 1e-3  # [m] what is further apart does not overlap
FAR = transform(np.full(3, 1e3), np.eye(3))  # a place of the object where no hand reaches


def rest_overlaps(scene: Scene, *, at_zero: bool = False) -> Array:
    """(k,) [m] overlaps of the scene's pairs of links in the hand at rest (`Anatomy.neutral`), 0 if there is none.

    Args:
        at_zero: of pairs that joints at 0 hold so, no others: where limits may have been narrowed since the hand was
            read, a joint that is not at 0 need not be at rest.
    """
    hand = scene.hand
    rest = Anatomy.of(hand).neutral
    overlaps = np.maximum(0.0, -scene.clearances(rest, FAR, CUTOFF)[1])
    if at_zero:
        turned = set(np.flatnonzero(rest).tolist())
        moved = [bool(turned & (set(hand.moved_by(a)) ^ set(hand.moved_by(b)))) for a, b in scene.self_pairs]
        overlaps[moved] = 0.0
    return overlaps


def beyond_rest(between: Array, at_rest: Array) -> Array:
    """Distances of pairs [m], negative in penetration, without what overlaps at rest."""
    return np.where(between < 0, np.minimum(0.0, between + at_rest), between)
