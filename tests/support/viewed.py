"""Grasps for the live page, small enough to be answered in milliseconds, and a canvas that keeps what it is told."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.pictures.live.answering import Reply, answer, replay
from handfast.pictures.live.shown_state import Shown, SlipMotion
from handfast.pictures.live.view_state import Stage, ViewState
from handfast.readers.grasp_file import from_dict
from tests.support.program import planar


def jaws(mu: float = 0.5, preload: float = 10.0, **known: Any) -> Grasp:
    """Two jaws that press with `preload` [N] along x: 2 mu preload [N] is the largest weight along z, by hand."""
    contacts = [Contact([x, 0, 0], [-np.sign(x), 0, 0], mu) for x in (-0.03, 0.03)]
    slides = [GraspJoint(n, [-np.sign(x), 0, 0], [x, 0, 0], (i,), "prismatic") for i, (n, x) in enumerate(JAWS)]
    return Grasp(contacts, slides, preload={n: preload for n, _ in JAWS}, name="jaws", **known)


JAWS = ("left", -0.03), ("right", 0.03)


def two_fingers() -> Grasp:
    """The planar grasp of the program's tests, of which nothing but contacts and joints is known."""
    return from_dict(planar(), name="two-fingers")


def replies(state: ViewState, outdated: Callable[[], bool] = lambda: False, before: Reply | None = None) -> list[Reply]:
    """Everything that is told about a state, in order, and at the end with its proofs replayed."""
    told: list[Reply] = []
    answer(state, before, outdated, told.append)
    if told[-1].most is not None:
        told.append(replace(told[-1], replayed=replay(told[-1])))
    return told


class KeptCanvas:
    """What was drawn last."""

    def __init__(self) -> None:
        self.stages: list[Stage] = []
        self.said: list[str] = []
        self.drawn: list[tuple[ViewState, Shown]] = []
        self.motion: SlipMotion | None = None

    def put(self, state: ViewState, stage: Stage) -> None:
        self.stages.append(stage)

    def draw(self, state: ViewState, stage: Stage, reply: Reply | None, what: Shown, source: str) -> None:
        self.drawn.append((state, what))

    def move(self, motion: SlipMotion | None, seconds: float) -> None:
        self.motion = motion

    def say(self, text: str) -> None:
        self.said.append(text)


def until(condition: Callable[[], Any]) -> Any:
    """Wait for something that another thread brings about; a test in which it does not come never ends, and fails."""
    while not (found := condition()):
        time.sleep(0.01)
    return found
