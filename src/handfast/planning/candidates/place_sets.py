"""Sets of places of an object that go together: where forces balance each other and the hand opens wide enough."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.model.body import Body
from handfast.planning.candidates.places import Place
from handfast.planning.filters.balance import squeeze_imbalance, squeeze_margin
from handfast.planning.rejection import RejectionReason, Tally

MANY = 150_000  # sets of four and more places that are looked at


@dataclass(frozen=True)
class Reachable:
    """Which sets are looked for.

    Attributes:
        opening: [m] no two places of a set are further apart.
        radius: [m] sets are alike whose places are all within this of each other's.
        count: largest number of sets.
        seed: of what is drawn.
    """

    opening: float
    radius: float
    count: int
    seed: int


def balanced_sets(
    body: Body, places: tuple[Place, ...], k: int, friction: float, reach: Reachable, tally: Tally
) -> list[tuple[Indices, float]]:
    """Different sets of k places at which forces balance and that the hand opens wide enough for, with margins.

    Args:
        tally: counts what is rejected.
    """
    if len(places) < k:
        tally.add(RejectionReason.TOO_FEW_PLACES, 1, f"{len(places)} places on the surface; {k} are needed")
        return []
    points, inward = np.array([p.point for p in places]), -np.array([p.normal for p in places])
    rows = _sets(points, inward, k, reach.seed)
    rest = squeeze_imbalance(points[rows], inward[rows])
    steady = rest < friction
    if (~steady).any():
        least = rest[~steady].min()
        about = f"the best one is out of balance by {least:.2f} of the pushing force" if np.isfinite(least) else ""
        tally.add(RejectionReason.NO_SQUEEZE, int((~steady).sum()), about)
    rows, rest = rows[steady], rest[steady]
    pairs = np.triu_indices(k, 1)
    width = np.linalg.norm(points[rows[:, pairs[0]]] - points[rows[:, pairs[1]]], axis=2).max(axis=1, initial=0.0)
    wide = width > reach.opening
    if wide.any():
        figures = f"{1e3 * width[wide].min():.0f} mm and more; the hand opens to about {1e3 * reach.opening:.0f} mm"
        tally.add(RejectionReason.TOO_WIDE, int(wide.sum()), figures)
    rows, rest = rows[~wide], rest[~wide]
    size = float(np.ptp(body.vertices, axis=0).max())
    off = np.linalg.norm(points[rows].mean(axis=1) - body.center_of_mass, axis=1)
    small = np.array([p.size[1] for p in places])[rows].min(axis=1, initial=np.inf) / reach.radius
    order = np.argsort(rest / friction + off / (size / 2) - 0.3 * small, kind="stable")
    kept: list[tuple[Indices, float]] = []
    alike = unsteady = 0
    for row in rows[order]:
        if any(_alike(points[row], points[other], reach.radius) for other, _ in kept):
            alike += 1
            continue
        m = squeeze_margin(points[row], inward[row], friction)
        if m <= 0:
            unsteady += 1
            continue
        kept.append((row, m))
        if len(kept) == reach.count:
            break
    tally.add(RejectionReason.OUTSIDE_CONES, unsteady)
    tally.add(RejectionReason.ALIKE, alike, f"all places within {1e3 * reach.radius:.0f} mm of a better one's")
    left = len(rows) - len(kept) - alike - unsteady
    tally.add(RejectionReason.BEHIND, left, f"{reach.count} are looked at closely")
    return kept


def _sets(points: Array, inward: Array, k: int, seed: int) -> Indices:
    """(m, k) sets of places, ascending: all pairs or triples, or a sample of larger ones grown from good triples."""
    n = len(points)
    if k <= 3:
        return np.array(list(combinations(range(n), k)), dtype=int).reshape(-1, k)
    triples = np.array(list(combinations(range(n), 3)), dtype=int)
    rest = squeeze_imbalance(points[triples], inward[triples])
    triples = triples[np.argsort(rest, kind="stable")[: MANY // 50]]
    random = np.random.default_rng([seed, k])
    grown = np.repeat(triples, 50, axis=0)
    for _ in range(k - 3):
        grown = np.column_stack([grown, random.integers(n, size=len(grown))])
    grown = np.sort(grown, axis=1)
    return np.unique(grown[(np.diff(grown, axis=1) > 0).all(axis=1)], axis=0)


def _alike(a: Array, b: Array, radius: float) -> bool:
    """Whether every place of one set is within a radius of one of the other."""
    apart = np.linalg.norm(a[:, None] - b[None], axis=2)
    return bool(max(apart.min(axis=0).max(), apart.min(axis=1).max()) < radius)
