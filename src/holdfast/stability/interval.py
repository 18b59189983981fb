"""Up to which magnitude is everything resisted? The resisted magnitudes need not be an interval (section VII-B).

Asked at sampled magnitudes, neighbours helping each other: a magnitude counts as resisted with an exact
witness and as a hole with a certificate that it slips. Between samples nothing is proved; the first border is
bisected to a thousandth of the range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from holdfast.answer import Verdict
from holdfast.mechanism import Array
from holdfast.stability.engine import front
from holdfast.stability.goal import Goal
from holdfast.stability.outcome import INF
from holdfast.stability.problem import Problem
from holdfast.stability.settings import Settings

SAMPLES = 64
FINE = 1e-3  # of the range


@dataclass(frozen=True)
class Interval:
    """Which magnitudes are resisted, as sampled.

    Attributes:
        holds_from_zero_to: the largest sampled magnitude below which every sample is resisted; 0 if the smallest
            is not, or if the preload (with the base load) alone is not in equilibrium.
        holes: (first, last) sampled magnitudes that slip between resisted ones.
        undecided: samples that were neither witnessed nor refuted.
        samples: how many were asked.
    """

    holds_from_zero_to: float
    holes: tuple[tuple[float, float], ...]
    undecided: int
    samples: int


def resisted(
    p: Problem, largest: float, settings: Settings | None = None, *, unbounded: bool = False, samples: int = SAMPLES
) -> Interval:
    """Sample the magnitudes below `largest`, which is witnessed, of a maximum's problem `p`; see `Interval`.

    Evenly, or if the maximum is `unbounded` from a millionth of it up, in equal ratios.
    """
    settings = settings or Settings()
    ask = _Asker(p, settings)
    share = np.geomspace(1e-6, 1.0, samples)[:-1] if unbounded else np.arange(1, samples) / samples
    at = largest * np.concatenate([[0.0], share])
    verdicts = [ask(float(s)) for s in at]
    first = next((k for k, v in enumerate(verdicts) if v is not Verdict.HOLDS), None)
    if first is None:
        return Interval(float(largest), (), 0, len(at))
    to = float(at[first - 1]) if first else 0.0
    if first:
        beyond = float(at[first])
        while beyond - to > FINE * (beyond if unbounded else largest):
            middle = (to + beyond) / 2
            if ask(middle) is Verdict.HOLDS:
                to = middle
            else:
                beyond = middle
    return Interval(to, _holes(at, verdicts), sum(v is Verdict.UNDECIDED for v in verdicts), ask.asked)


class _Asker:
    """Checks at one magnitude after another, each started from the last witness."""

    def __init__(self, p: Problem, settings: Settings) -> None:
        self.p, self.settings, self.asked = p, settings, 0
        self._point: Array | None = None

    def __call__(self, s: float) -> Verdict:
        p = self.p
        at = replace(p, w0=p.w0 + s / p.stretch * p.direction, wrench=p.wrench + s * p.along)
        guess = [] if self._point is None else [self._point]
        found = front.search(at, Goal.EXISTS, self.settings, guess=guess)
        self.asked += 1
        if found.witness is not None:
            self._point = found.point
            return Verdict.HOLDS
        return Verdict.SLIPS if found.bound == INF else Verdict.UNDECIDED


def _holes(at: Array, verdicts: Sequence[Verdict]) -> tuple[tuple[float, float], ...]:
    """Runs of SLIPS that a resisted magnitude follows."""
    holes: list[tuple[float, float]] = []
    begin: int | None = None
    for k, v in enumerate(verdicts):
        if v is Verdict.SLIPS and begin is None:
            begin = k
        elif v is not Verdict.SLIPS and begin is not None:
            if v is Verdict.HOLDS:
                holes.append((float(at[begin]), float(at[k - 1])))
            begin = None
    return tuple(holes)
