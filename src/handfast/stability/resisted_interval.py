"""Which magnitudes below the largest are resisted? They need not be an interval (section VII-B)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.proofs.arcs import Arc
from handfast.proofs.certificate import Certificate
from handfast.stability.goal import Range


@dataclass(frozen=True)
class ResistedInterval:
    """Which magnitudes are resisted, with the proofs.

    Attributes:
        holds_from_zero_to: every magnitude up to it is resisted, see `ranges.Known`.
        upper: a magnitude that slips; between the two it is not known.
        holes: (first, last) magnitudes between which all slip, though more is resisted.
        unproved: ranges of which nothing was shown.
        resolution: relative: the ends of holes lie no farther than this outside them, as a share of the magnitude
            or, if that is more, of the other forces in play.
        arcs: states of the magnitudes that are resisted; none where magnitudes make no difference.
        slips: certificates of the holes.
        interrupted: Ctrl-C came before all was looked at.
    """

    holds_from_zero_to: float
    upper: float
    holes: tuple[Range, ...]
    unproved: tuple[Range, ...]
    resolution: float
    arcs: tuple[Arc, ...]
    slips: tuple[Certificate, ...]
    interrupted: bool = False

    def to_json(self) -> dict[str, Any]:
        """Its keys in the answer of `max`, beside `holds_from_zero_to`."""
        return {
            "holds_from_zero_upper": self.upper if np.isfinite(self.upper) else None,
            "holes": [list(r) for r in self.holes],
            "unproved": [list(r) for r in self.unproved],
            "resolution": self.resolution,
        }
