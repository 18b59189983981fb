"""Small synthesis tasks with known answers, for the tests."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from handfast.model.region import Bezier, Cap
from handfast.readers.load_hand import load_hand
from handfast.synthesis.task import ContactPair, Task

OPEN = 0.08  # [m] between the gripper's fingertips when it is open: wider objects do not fit
HARD = 0.1614  # [m] edge of a block at the end of what the Schunk hand can pinch: not decided within a minute
LARGE = 0.168  # [m] edge of a block a little too large for the Schunk hand's pinch: ten thousands of boxes to show it


def square(side: float, y: float, half: float = 0.01) -> Bezier:
    """A square at y across the y axis, its outward normal along side * y."""
    corners = np.array([[[u, y, v] for v in (-half, half)] for u in (-half, half)])
    return Bezier(corners, flip=side > 0)


def grip(width: float, **others: Any) -> Task:
    """A block of a given width between the round fingertips of the gripper; possible if 0 < width < OPEN."""
    pairs = []
    for side, link in ((1.0, "left_finger"), (-1.0, "right_finger")):
        tip = Cap((0, 0.005 * side, 0.045), 0.005, (0, -side, 0), 1.0)
        pairs.append(ContactPair(link, tip, square(side, side * width / 2)))
    return Task.of(load_hand("parallel-gripper"), tuple(pairs), name="grip", **others)


def flat_grip(width: float) -> Task:
    """The same with flat fingertips on parallel sides: possible, but each side turns the block the same way."""
    pairs = []
    for side, link in ((1.0, "left_finger"), (-1.0, "right_finger")):
        points = np.array([[[u, 0, v] for v in (0.03, 0.06)] for u in (-0.01, 0.01)])
        pairs.append(ContactPair(link, Bezier(points, flip=side < 0), square(side, side * width / 2)))
    return Task.of(load_hand("parallel-gripper"), tuple(pairs), name="flat")


def pinch(edge: float = 0.03, **others: Any) -> Task:
    """A block between index finger and thumb of the Schunk hand: many ways."""
    pairs = []
    for side, link in ((1.0, "index_distal"), (-1.0, "thumb_distal")):
        tip = Cap((0.02, 0, 0), 0.013, (0.5, 0, 0.87), 1.0)
        pairs.append(ContactPair(link, tip, square(side, side * edge / 2)))
    return Task.of(load_hand("schunk-sah"), tuple(pairs), name="pinch", **others)


def grip_file(width: float = 0.05) -> dict[str, Any]:
    """`grip` as a `handfast/task/1` object."""

    def contact(side: float, link: str) -> dict[str, Any]:
        cap = {"center": [0, 0.005 * side, 0.045], "radius": 0.005, "axis": [0, -side, 0], "half_angle": 1.0}
        points = square(side, side * width / 2).points.tolist()
        hand = {"link": link, "region": {"cap": cap}}
        return {"hand": hand, "object": {"region": {"bezier": points, "flip": side > 0}}}

    return {
        "schema": "handfast/task/1",
        "hand": "parallel-gripper",
        "contacts": [contact(1.0, "left_finger"), contact(-1.0, "right_finger")],
    }


def turned(task: Task) -> Task:
    """With the second region of the object facing the other way."""
    a, b = task.contact_pairs
    return replace(task, contact_pairs=(a, replace(b, object=Bezier(b.object.points, not b.object.flip))))
