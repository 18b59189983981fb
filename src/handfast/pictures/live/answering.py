"""What the page asks of the stability engine: the one place that knows which functions answer.

A verdict comes first, the largest load in its direction next, then the map, coarse and finer: each stage is passed on
as soon as it is there. The replay of the proofs is asked for by itself, since nothing interrupts it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.pictures.live.view_state import ViewState
from handfast.stability.answers import CheckAnswer, MaxAnswer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.scaled_problem import unbalanced
from handfast.stability.problem.settings import OnStep, Progress, Settings
from handfast.stability.studies.questions import check, maximum

LIVE_DIRECTIONS = 72  # of a map
DIRECTION_ROUNDS = 0, 3, 1, 5, 2, 4  # each asks every sixth direction from there on: at first a coarse map all around
VERDICT_TIMEOUT = 1.0  # [s] after which a verdict that nobody waits for any more is given up
QUICK = Settings(gap=1e-2, verify=False, timeout=20.0, jobs=1)  # proofs are replayed when the page is at rest
OF_MAP = Settings(gap=3e-3, verify=False, timeout=0.5, jobs=1)
Indices = NDArray[np.intp]


class OutdatedError(Exception):
    """What is being asked is no longer wanted."""


@dataclass(frozen=True, eq=False)
class PlaneMap:
    """The largest loads in the directions of a plane, as far as they are known.

    Attributes:
        key: `ViewState.map_key` of what was asked.
        at: (3,) [m] where they act.
        directions: (n, 3) unit, object frame, of the forces, or of the torques if `is_torque`.
        sizes: (n,) [N, N m] what is resisted in each: infinite without a bound, NaN where it was not asked yet.
    """

    key: tuple[object, ...]
    at: Array
    directions: Array
    is_torque: bool
    sizes: Array

    @property
    def known(self) -> Indices:
        """(k,) indices of the directions asked so far, ascending; all at the end."""
        return np.flatnonzero(~np.isnan(self.sizes))


@dataclass(frozen=True, eq=False)
class Reply:
    """What is known about a state.

    Attributes:
        check: is its load resisted? None where no forces at the contacts balance it, whatever the friction: it is not.
        most: the largest load in its direction; None until it is known.
        map: None until a piece of it is known, or without one.
        replayed: were the proofs of verdict and maximum replayed by the checkers, and found right?
    """

    state: ViewState
    check: CheckAnswer | None
    most: MaxAnswer | None = None
    map: PlaneMap | None = None
    replayed: bool = False

    @property
    def verdict(self) -> Verdict:
        return Verdict.SLIPS if self.check is None else self.check.verdict


def answer(state: ViewState, before: Reply | None, outdated: Callable[[], bool], tell: Callable[[Reply], None]) -> None:
    """Answer a state in stages, each of them told.

    Args:
        before: what was told last, whose map is kept if it is that of this state.
        outdated: is there a newer state? Then the verdict is still told, unless it takes long, and the rest is left.
    """
    start = time.monotonic()

    def late(_: Progress) -> None:
        if outdated() and time.monotonic() - start > VERDICT_TIMEOUT:
            raise OutdatedError

    def leave(_: Progress) -> None:
        if outdated():
            raise OutdatedError

    try:
        possible = not unbalanced(state.grasp, state.wrench)
        found = (
            check(state.asked, state.wrench, limits=GraspLimits(state.eta), settings=QUICK, on_progress=late)
            if possible
            else None
        )
        kept = before.map if before and before.map and before.map.key == state.map_key else None
        reply = Reply(state, found, map=kept)
        tell(reply)
        if outdated():
            return
        if not unbalanced(state.grasp, state.direction):
            most = maximum(
                state.asked, state.direction, limits=GraspLimits(state.eta), settings=QUICK, on_progress=leave
            )
            reply = replace(reply, most=most)
            tell(reply)
        for piece in _pieces(state, kept, leave):
            reply = replace(reply, map=piece)
            tell(reply)
    except OutdatedError:
        return


def replay(reply: Reply) -> bool:
    """Do verdict and maximum stand up to the independent checkers? It may take seconds."""
    check, most = reply.check, reply.most
    return check is not None and most is not None and check.verify().ok and most.verify().ok


def _pieces(state: ViewState, known: PlaneMap | None, leave: OnStep) -> Iterator[PlaneMap]:
    """The map, finer and finer, from where it was left."""
    axes, key = state.map_axes, state.map_key
    sizes = known.sizes if known else np.full(LIVE_DIRECTIONS, np.nan)
    if axes is None or key is None or not np.isnan(sizes).any():
        return
    angles = 2 * np.pi * np.arange(LIVE_DIRECTIONS) / LIVE_DIRECTIONS
    directions = np.column_stack([np.cos(angles), np.sin(angles)]) @ axes
    directions[np.abs(directions) < 1e-12] = 0.0
    if state.is_torque:
        wrenches = np.hstack([np.zeros_like(directions), directions])
    else:
        wrenches = np.hstack([directions, np.cross(state.at, directions)])
    wrenches = wrenches + 0.0  # no -0
    step, done, limits = len(DIRECTION_ROUNDS), LIVE_DIRECTIONS - int(np.isnan(sizes).sum()), GraspLimits(state.eta)
    for begin in DIRECTION_ROUNDS[done * step // LIVE_DIRECTIONS :]:
        sizes = sizes.copy()
        for i in range(begin, LIVE_DIRECTIONS, step):
            sizes[i] = 0.0
            if not unbalanced(state.grasp, w := wrenches[i]):
                most = maximum(state.asked, w, limits=limits, settings=OF_MAP, on_progress=leave)
                sizes[i] = np.inf if most.unbounded else np.nan_to_num(most.lower)
        yield PlaneMap(key, state.at, directions, state.is_torque, sizes)
