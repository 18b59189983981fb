"""The cases into which a node is split where no point says how.

Closed contacts come before undecided ones: what sticks or slides has more rows than what is merely closed.
"""

from __future__ import annotations

import itertools

import numpy as np

from handfast.core.arrays import Indices, Mask
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    CLOSED,
    FREE,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN_DIRECTIONS,
    UNDECIDED,
)
from handfast.stability.search.rows import FINEST_PATCH, MIN_SECTOR_WIDTH

REST_STATES = {FREE: LOCKED, BELOW: LOW, ABOVE: HIGH}  # of actuators that are not decided: the case besides MOVES


def split(state: Indices, m: int, mdp: bool, robust: bool, soft: Mask) -> tuple[int, list[Indices]]:
    """The part of a node's state (3m + a,) to be split, and its children's states; -1 and none if all is decided.

    robust: open contacts have sectors, too. soft: (m,) which contacts are soft fingers, which slide in patches.
    """
    free = np.flatnonzero(np.isin(state[3 * m :], list(REST_STATES)))
    if len(free):
        j = int(free[0])
        return _changed(state, m, m + j, [(REST_STATES[int(state[3 * m + j])], 0, 0), (MOVES, 0, 0)])
    width = np.where(soft, 0, state[2 * m : 3 * m] - state[m : 2 * m])
    if mdp and (soft & (state[:m] == CLOSED)).any():
        i = int(np.flatnonzero(soft & (state[:m] == CLOSED))[0])
        return _changed(state, m, i, [(STICK, 0, 0), *((SLIDE, 8 + k, 0) for k in range(8))])
    whole = (state[:m] == CLOSED) | (robust & (state[:m] == OPEN) & (width == 0))
    if mdp and whole.any():
        i = int(np.flatnonzero(whole)[0])
        kind = SLIDE if state[i] == CLOSED else OPEN
        left, right = (int(state[m + i]), int(state[2 * m + i])) if width[i] else (0, TURN_DIRECTIONS)
        ends = [left + k * (right - left) // 3 for k in range(4)]
        sectors = [(kind, a, b) for a, b in itertools.pairwise(ends)]
        stuck = [(STICK, *((left, right) if width[i] else (0, 0)))] if kind == SLIDE else []
        return _changed(state, m, i, [*stuck, *sectors])
    undecided = np.flatnonzero(state[:m] == UNDECIDED)
    if len(undecided):
        return _changed(state, m, int(undecided[0]), [(CLOSED, 0, 0), (OPEN, 0, 0)])
    patches = np.where(soft & (state[:m] == SLIDE), state[m : 2 * m], FINEST_PATCH)
    if m and patches.min() < FINEST_PATCH:
        i = int(patches.argmin())
        return _changed(state, m, i, [(SLIDE, 2 * int(patches[i]) + k, 0) for k in (0, 1)])
    i = int(width.argmax()) if m else 0
    if not m or width[i] <= MIN_SECTOR_WIDTH:
        return -1, []
    left, right = int(state[m + i]), int(state[2 * m + i])
    cut = (left + right) // 2
    return _changed(state, m, i, [(int(state[i]), left, cut), (int(state[i]), cut, right)])


def _changed(state: Indices, m: int, part: int, children: list[tuple[int, int, int]]) -> tuple[int, list[Indices]]:
    out = []
    for kind, left, right in children:
        child = state.copy()
        if part < m:
            child[part], child[m + part], child[2 * m + part] = kind, left, right
        else:
            child[2 * m + part] = kind
        out.append(child)
    return part, out
