"""Closed loops: pins between two links, the joints that follow from them, where these stand and how they move."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array, Indices, Mask, frozen
from handfast.core.errors import InputError

MAX_LOOP_GAP = 1e-6  # [m] gap that is let pass: of axes that a file gives with few digits
EXACT_LOOP_GAP = 1e-13  # [m] gap at which nothing more is to be gained
NEWTON = 30  # steps at most; near the solution three or four do
LOOP_PROGRESS = 0.9  # from nearby a step leaves less of the gap; or else the way is at its end, where others go astray
STRIDE = 0.2  # [rad] by which a loop is moved at once, so that it stays on its branch
LOOP_SLIDE = 0.01  # [m] the same of a prismatic joint
MIN_LOOP_STEP = 1e-7  # of the way, below which it is at its end
INDEPENDENT = 1e-5  # sine of the angle between a column and those before it
SINGULAR_RATIO = 1e-7  # ratio of the singular values from which on a joint's motion is not determined
LOOP_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Loop:
    """A pin: a point of one link that always is a point of another, which closes a loop of the linkage.

    Attributes:
        name: for messages.
        first, second: indices of the links.
        on_first, on_second: (3,) [m] the point, in the frame of each.
    """

    name: str
    first: int
    second: int
    on_first: Array
    on_second: Array

    def __post_init__(self) -> None:
        for key in ("on_first", "on_second"):
            object.__setattr__(self, key, frozen(getattr(self, key), (3,), f"loop {self.name}.{key}"))


@dataclass(frozen=True, eq=False)
class LoopClosure:
    """The loops of one hand: which joints follow from which, and where.

    Positions are found by Newton's method on the gaps of the pins, along the way from a configuration at which all
    are closed, so that a linkage stays assembled the way it is.

    Attributes:
        names: (l,) of the joints.
        gaps: from q (l,) to the gaps (3n,) [m] of the pins and their Jacobian (3n, l).
        follow: (l, l) and offset (l,): `follow @ q + offset` has coupled joints where their drivers put them.
        limits: (l, 2).
        strides: (l,) by which each joint is moved at once.
        pins: name of each pin.
        assembled: (l,) at which all are closed.
        dependent: indices of the joints that follow from the others.
    """

    names: tuple[str, ...]
    gaps: Callable[[Array], tuple[Array, Array]]
    follow: Array
    offset: Array
    limits: Array
    strides: Array
    pins: tuple[str, ...]
    assembled: Array
    dependent: tuple[int, ...]

    @classmethod
    def of(
        cls,
        names: tuple[str, ...],
        gaps: Callable[[Array], tuple[Array, Array]],
        couplings: tuple[Array, Array],
        limits: Array,
        prismatic: Sequence[bool],
        pins: tuple[str, ...],
        start: Array,
        driven: Mask,
    ) -> LoopClosure:
        """Assemble the loops from a start (l,), and choose the dependent joints: those without motors, outermost first.

        Args:
            prismatic: (l,) which joints slide.
            driven: (l,) which joints an actuator moves.

        Raises:
            InputError: a loop that cannot be closed, with what remains of its gap.
        """
        strides = np.where(prismatic, LOOP_SLIDE, STRIDE)
        found = cls(names, gaps, *couplings, limits, strides, pins, start, ())
        free = np.flatnonzero(np.diag(found.follow) == 1.0)
        q, J = found._newton(start, free)
        if q is None:
            raise found._open(J, "cannot be closed")
        J = gaps(q)[1] @ found.follow
        order = sorted(free.tolist(), key=lambda j: (bool(driven[j]), -j))
        dependent: list[int] = []
        span = np.zeros((len(J), 0))
        for j in order:
            column = J[:, j]
            rest = column - span @ (span.T @ column)
            if np.linalg.norm(rest) > INDEPENDENT * max(float(np.linalg.norm(column)), 1e-6):
                dependent.append(j)
                span = np.linalg.qr(J[:, dependent])[0]
        return cls(names, gaps, *couplings, limits, strides, pins, q, tuple(sorted(dependent)))

    def closed(self, q: Array, start: Array | None = None, *, as_far_as_possible: bool = False) -> Array:
        """q (l,) with the dependent joints where the others put them.

        Args:
            start: (l,) a configuration near it at which the loops are closed; `assembled` unless given.
            as_far_as_possible: stop where the loops, or the limits of dependent joints, let nobody pass.

        Raises:
            InputError: there is no such configuration on the way from the start.
        """
        at = np.array(self.assembled if start is None else start, dtype=float)
        at[~self._moving] = np.asarray(q, dtype=float)[~self._moving]
        own = list(self.dependent)
        way = np.asarray(q, dtype=float) - at
        way[own] = 0.0
        tolerance = max(self._excess(at), LOOP_ROUNDING) if as_far_as_possible else np.inf
        done, step = 0.0, 1.0 / max(1.0, float(np.ceil(np.max(np.abs(way) / self.strides))))
        shortest, gap = MIN_LOOP_STEP * step, np.zeros(3)
        while done < 1:
            step = min(step, 1 - done)
            guess = at + step * way
            guess[own] += step * (self._tangent(at) @ way)
            reached, gap = self._newton(guess, np.array(own), LOOP_PROGRESS)
            if reached is not None and self._excess(reached) <= tolerance:
                at, done, step = reached, done + step, 2 * step if done else step
                step = min(step, 1.0 / max(1.0, float(np.max(np.abs(way) / self.strides))))
                continue
            step /= 2
            if step < shortest:
                if as_far_as_possible:
                    return at
                raise self._open(gap, f"cannot be closed at {self._where(q)}")
        return at

    def rows(self, q: Array, *, refuse: bool = True) -> Array:
        """(k, l) rows of A: the motion of each dependent joint less what the others make of it, to first order at q.

        Args:
            refuse: singular positions, where the others do not determine the motion; else the least motion counts.

        Raises:
            InputError: the loops are in a singular position.
        """
        T = self._tangent(np.asarray(q, dtype=float), refuse=refuse)
        rows = -T
        rows[np.arange(len(T)), list(self.dependent)] = 1.0
        return rows

    def _tangent(self, q: Array, refuse: bool = False) -> Array:
        """(k, l) motion of the dependent joints per motion of each joint that is neither dependent nor coupled."""
        own = list(self.dependent)
        J = self.gaps(q)[1] @ self.follow
        left, values, right = np.linalg.svd(J[:, own], full_matrices=False)
        if refuse and values[-1] < SINGULAR_RATIO * values[0]:
            names = ", ".join(self.names[j] for j in own)
            raise InputError(f"is in a singular position: the motion of {names} is not determined", field=self._named())
        rank = values >= SINGULAR_RATIO * values[0]
        others = np.diag(self.follow) == 1.0
        others[own] = False
        T = np.zeros((len(own), len(q)))
        T[:, others] = -(right[rank].T / values[rank]) @ (left[:, rank].T @ J[:, others])
        T[np.abs(T) < LOOP_ROUNDING] = 0.0
        return T

    def _newton(self, q: Array, unknown: Indices, fewer: float = np.inf) -> tuple[Array | None, Array]:
        """A solution near q by moving some joints, None if there is none; and the gaps that are left.

        fewer: each step has to leave so much of the gap at most.
        """
        at, before = self.follow @ q + self.offset, np.inf
        for _ in range(NEWTON):
            gap, J = self.gaps(at)
            size = float(np.abs(gap).max(initial=0.0))
            if size < EXACT_LOOP_GAP or size > fewer * before or (size <= MAX_LOOP_GAP and size > 0.5 * before):
                break
            before = size
            step = np.linalg.lstsq((J @ self.follow)[:, unknown], -gap, rcond=SINGULAR_RATIO)[0]
            step *= min(1.0, 5 * float(np.min(self.strides[unknown] / np.maximum(np.abs(step), LOOP_ROUNDING))))
            at = at.copy()
            at[unknown] += step
            at = self.follow @ at + self.offset
        else:
            gap = self.gaps(at)[0]
        return (at if np.abs(gap).max(initial=0.0) <= MAX_LOOP_GAP else None), gap

    def _excess(self, q: Array) -> float:
        """By how much a joint is beyond its limits, of those that follow from others; 0 if none is."""
        follows = np.diag(self.follow) != 1.0
        follows[list(self.dependent)] = True
        lower, upper = self.limits[follows].T
        return float(np.max([lower - q[follows], q[follows] - upper], initial=0.0))

    @cached_property
    def _moving(self) -> Mask:
        """(l,) the joints that move an end of a loop against the other."""
        J = self.gaps(self.assembled)[1]
        free = np.abs(J @ self.follow).max(axis=0, initial=0.0) > LOOP_ROUNDING
        return np.asarray(free | (np.abs(self.follow[:, free]).max(axis=1, initial=0.0) > 0))

    def _where(self, q: Array) -> str:
        """The values of what moves the loops."""
        moves = self._moving & (np.diag(self.follow) == 1.0)
        moves[list(self.dependent)] = False
        return ", ".join(f"{self.names[j]} = {q[j]:g}" for j in np.flatnonzero(moves)) or "any configuration"

    def _named(self) -> str:
        return f"loop {self.pins[0]}" if len(self.pins) == 1 else "loops"

    def _open(self, gaps: Array, what: str) -> InputError:
        sizes = np.linalg.norm(gaps.reshape(-1, 3), axis=1)
        worst = int(sizes.argmax())
        left = f"its ends stay {sizes[worst] * 1e3:.3g} mm apart"
        return InputError(f"{what}; {left}", field=f"loop {self.pins[worst]}")
