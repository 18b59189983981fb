"""How far a hand is from an object and from itself, at a glance: for choosing, not for judging."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.core.arrays import Array
from handfast.geometry.collision import always_meeting
from handfast.geometry.scene import Scene


class QuickLook:
    """Least signed distances of one hand and one object; `handfast.geometry.collision` looks closely.

    Attributes:
        scene: as given. Pairs of links that overlap at every configuration are left out.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        overlapping = set(always_meeting(scene))
        self._counted = np.array([pair not in overlapping for pair in scene.self_pairs], dtype=bool)

    def depths(self, q: Array, pose: Array) -> tuple[float, float]:
        """Largest overlap [m] of hand and object, and of two links, 0 if none; arguments as of `clearance`."""
        links, between = self.scene.clearances(q, pose)
        return max(0.0, -links.min()), max(0.0, -between[self._counted].min(initial=0.0))

    def clearance(self, q: Array, pose: Array, *, but: Sequence[str] = ()) -> float:
        """[m] the least distance of any link, `but` for some by name, to the object, and of links to each other.

        Args:
            q: (l,) configuration; `pose`: (4, 4) of the object in the hand's base frame.
        """
        links, between = self.scene.clearances(q, pose)
        counted = np.array([name not in but for name in self.scene.hand.link_names])
        return float(min([np.inf, *links[counted], *between[self._counted]]))
