"""The precision grasp as a task: thumb and index fingertip on opposite faces of a small cube."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.hand.hand import Hand
from handfast.model.region import Bezier, Cap
from handfast.synthesis.task import ContactPair, Task

PAD = np.array([0.5, 0.0, 0.87])  # middle of the pad in a distal frame: palmar, a little towards the tip
HALF_ANGLE = np.radians(60)


def pinch(
    hand: Hand, *, fingers: tuple[str, str] = ("index", "thumb"), edge: float = 0.02, patch: float = 0.008
) -> Task:
    """Both fingertips on a cube of a given edge [m], origin at its centre, each on a square of side `patch` [m].

    The squares are in the middle of the faces +x (first finger) and -x. A fingertip is the sphere among the
    shapes of the link `<finger>_distal` that lies furthest out along its x; the pad is the cap of 60
    degrees about (0.5, 0, 0.87) of that frame.

    Raises:
        InputError: no such link, or no sphere on it.
    """
    pairs = []
    for finger, side in zip(fingers, (1.0, -1.0), strict=True):
        link = f"{finger}_distal"
        pairs.append(ContactPair(link, fingertip(hand, link), _face(side, edge / 2, patch / 2)))
    return Task.of(hand, tuple(pairs), name=f"pinch-{hand.name}")


def fingertip(hand: Hand, link: str) -> Cap:
    """The pad of a spherical fingertip, link frame."""
    balls = [s for s in hand.links[hand.link(link)].shapes if s.kind == "sphere"]
    if not balls:
        raise InputError("has no sphere among its shapes; a spherical fingertip is needed", field=link)
    tip = max(balls, key=lambda s: float(s.pose[0, 3]))
    return Cap(tip.pose[:3, 3], tip.size[0], PAD, HALF_ANGLE)


def _face(side: float, x: float, half: float) -> Bezier:
    """A square about the x axis at side * x, outward normal along side * x."""
    corners: Array = np.array([[[side * x, u, v] for v in (-half, half)] for u in (-half, half)])
    return Bezier(corners, flip=side < 0)
