"""Whether a hand and an object can be of one world: a mesh in millimetres is a thousand times too large."""

from __future__ import annotations

import numpy as np

from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.hand.anatomy import Anatomy
from handfast.model.hand.hand import Hand

ABSURD = 100.0  # an object so many times larger or smaller than the hand is refused
STRANGE = 12.0  # .. or warned about


def hand_size(hand: Hand) -> float:
    """[m] the longest side of a box about palm and open fingers; an arm below the palm does not count."""
    anatomy = Anatomy.of(hand)
    poses = hand.link_poses(anatomy.ends(hand.closing)[0])
    own = [i for i in range(len(hand.links)) if i in anatomy.palm or anatomy.finger(i) >= 0]
    corners = [s.triangles()[0] @ poses[i][:3, :3].T + poses[i][:3, 3] for i in own for s in hand.links[i].shapes]
    return float(np.ptp(np.vstack(corners), axis=0).max()) if corners else 0.0


def object_size(body: Body) -> float:
    """[m] the longest side of a box about the object."""
    return float(np.ptp(body.vertices, axis=0).max())


def compared(hand: Hand, body: Body) -> str:
    """A warning if the object is far larger or smaller than the hand, '' if it is not.

    Raises:
        InputError: it is a hundred times larger or smaller.
    """
    own, its = hand_size(hand), object_size(body)
    ratio = its / own if own and its else 1.0
    if 1 / STRANGE <= ratio <= STRANGE:
        return ""
    smaller = "a mesh in millimetres needs --scale 0.001, one in inches --scale 0.0254"
    help_ = smaller if ratio > 1 else "its mesh may be in metres already: --scale 1"
    sizes = f"is {_length(its)} long, the hand {_length(own)}; {help_}"
    if not 1 / ABSURD <= ratio <= ABSURD:
        raise InputError(sizes, source=body.name or None, field="size")
    return f"{body.name or 'the object'} {sizes}"


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 1 else f"{1e3 * metres:.3g} mm"
