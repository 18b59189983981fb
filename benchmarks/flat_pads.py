"""A block between flat pads, upright: tasks of which the least torques that can hold the weight are known by hand."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from handfast import Task, load_hand
from handfast.model.body import Body
from handfast.model.region import Bezier, Region
from handfast.model.shape import Shape
from handfast.synthesis.task import ContactPair, PoseBounds

BLOCK = Body.of([Shape("box", (0.02, 0.05, 0.02))], mass=1.0, friction=0.5)
HALF, TURN = 1e-3, 1e-3  # [m] half the side of the regions; by how much the components of the block's axes may differ
LEVER = """<mujoco><compiler angle="radian"/><worldbody>
<body name="palm"><geom type="box" size="0.02 0.04 0.005" pos="0 0 -0.01"/>
<body name="left" pos="0 0.04 0"><joint name="left" axis="1 0 0" range="-0.000349 0.000349"/>
<geom type="box" size="0.005 0.005 0.03" pos="0 0 0.03"/></body>
<body name="right" pos="0 -0.04 0"><joint name="right" axis="-1 0 0" range="-0.000349 0.000349"/>
<geom type="box" size="0.005 0.005 0.03" pos="0 0 0.03"/></body></body></worldbody>
<actuator><motor name="left" joint="left"/><motor name="right" joint="right"/></actuator></mujoco>"""
LONG = 0.06  # [m] from the axes of these fingers to the middle of their pads


def held_flat(hand: Any, links: tuple[str, str], pad: Callable[[float], Region]) -> Task:
    """The block between two pads, upright in the palm frame but for `TURN`."""
    sides = (1.0, -1.0)
    pairs = [ContactPair(link, pad(s), side_of_block(s)) for s, link in zip(sides, links, strict=True)]
    near, off = [1 - TURN, 1.0], [-TURN, TURN]
    axes = np.array([[near, off, off], [off, near, off], [off, off, near]])
    return Task.of(hand, tuple(pairs), name="flat", pose=PoseBounds(np.array([[-1.0, 1.0]] * 3), axes))


def side_of_block(side: float) -> Region:
    """Its outward normal along side * y."""
    points = np.array([[[u, side * 0.025, v] for v in (-HALF, HALF)] for u in (-HALF, HALF)])
    return Bezier(points, flip=side > 0)


def jaws(*_: Any) -> Task:
    """One motor moves both jaws: its force is the sum of what they push with."""

    def pad(side: float) -> Region:
        points = np.array([[[u, 0, 0.045 + v] for v in (-HALF, HALF)] for u in (-HALF, HALF)])
        return Bezier(points, flip=side < 0)

    return held_flat(load_hand("parallel-gripper").with_laws("none"), ("left_finger", "right_finger"), pad)


def levers(folder: Path) -> Task:
    """Two fingers, each with a motor."""
    (folder / "levers.xml").write_text(LEVER)

    def pad(side: float) -> Region:
        points = np.array([[[u, -0.015 * side, LONG + v] for v in (-HALF, HALF)] for u in (-HALF, HALF)])
        return Bezier(points, flip=side < 0)

    return held_flat(load_hand(folder / "levers.xml").with_laws("none"), ("left", "right"), pad)
