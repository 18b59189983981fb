"""How far a hand is from an object and from itself, at a glance: for choosing, not for judging."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.geometry.collision import always_meeting
from handfast.geometry.scene import FAR_POSE, OVERLAP_CUTOFF, Scene, beyond_rest, rest_overlaps


@dataclass(frozen=True)
class Overlaps:
    """How deep solids are in each other, 0 if they are not.

    Attributes:
        inside: [m] of hand and object.
        itself: [m] of two links, beyond what overlaps in the hand at rest.
        pair: the two links, by name; ("", "") if none overlap.
        link: that is deepest in the object; "" if none is.
    """

    inside: float
    itself: float
    pair: tuple[str, str]
    link: str

    @property
    def worst(self) -> float:
        """[m]"""
        return max(self.inside, self.itself)


class QuickLook:
    """Least signed distances of one hand and one object; `handfast.geometry.collision` looks closely.

    Collision shapes overlap where the links themselves do not, above all next to joints. Pairs that overlap at every
    configuration are left out; of any other pair, what it overlaps in the hand at rest is not counted.

    Attributes:
        scene: as given.
        at_rest: (k,) [m] overlaps of the scene's pairs of links in the hand at rest, 0 if there is none.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        overlapping = set(always_meeting(scene))
        self._counted = np.array([pair not in overlapping for pair in scene.self_pairs], dtype=bool)
        self.at_rest = rest_overlaps(scene)

    def overlaps(self, q: Array, pose: Array | None = None) -> Overlaps:
        """Largest overlaps; arguments as of `clearance`, without a pose those of the hand with itself."""
        links, between = self.scene.clearances(q, FAR_POSE if pose is None else pose, OVERLAP_CUTOFF)
        names, between = self.scene.hand.link_names, self._beyond(between)
        i, k = int(links.argmin()), int(between.argmin()) if len(between) else -1
        meet = k >= 0 and between[k] < 0
        pair = self.scene.self_pairs[k] if meet else ()
        return Overlaps(
            max(0.0, -float(links[i])),
            -float(between[k]) if meet else 0.0,
            (names[pair[0]], names[pair[1]]) if pair else ("", ""),
            names[i] if links[i] < 0 else "",
        )

    def clearance(self, q: Array, pose: Array, *, but: Sequence[str] = ()) -> float:
        """[m] the least distance of any link, `but` for some by name, to the object, and of links to each other.

        Args:
            q: (l,) configuration; `pose`: (4, 4) of the object in the hand's base frame.
        """
        links, between = self.scene.clearances(q, pose)
        counted = np.array([name not in but for name in self.scene.hand.link_names])
        return float(min([np.inf, *links[counted], *self._beyond(between)[self._counted]]))

    def _beyond(self, between: Array) -> Array:
        """(k,) [m] distances of pairs of links, without what overlaps at rest; infinite where it does not count."""
        return np.where(self._counted, beyond_rest(between, self.at_rest), np.inf)
