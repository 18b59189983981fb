"""The friction discretisation of Algorithm 1: sectors of the contact plane that are refined where needed.

Source: stability paper, sections IV and V. A sector of level p spans gamma / 2^(p-1) [rad]; its two
friction edges have length l_p, equation (16), so that every finer level lies inside the coarser one.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from handfast.core.arrays import Array

GAMMA = np.pi / 2  # the initial angle between edges


@lru_cache(maxsize=256)
def edge_length(p: int, q: int) -> float:
    """l_p = product over r = p .. q+1 of sec(gamma / 2^r): equations (14) for p = 1 and (16)."""
    return float(np.prod([1.0 / np.cos(GAMMA / 2**r) for r in range(p, q + 2)]))


@dataclass(frozen=True, order=True)
class Sector:
    """Angles from `index` to `index + 1`, in steps of gamma / 2^(level - 1)."""

    start: float  # in turns, exact in floating point; sorts sectors around the circle
    level: int

    @property
    def width(self) -> float:
        """In turns."""
        return 0.25 / 2 ** (self.level - 1)

    def halves(self) -> tuple[Sector, Sector]:
        return Sector(self.start, self.level + 1), Sector(self.start + self.width / 2, self.level + 1)


@dataclass(frozen=True, eq=False)
class Edges:
    """The friction edges d_1 .. d_k of one contact and the order in which they are neighbours.

    Attributes:
        D: (2, k) edge vectors, length l_p.
        length: (k,) l_p, the vector f of equation (15).
        midpoint: (k,) cos of half the sector angle, the factor l_{p+1} / l_p of (19), erratum applied.
        chain: indices into the edges in ring order; the first edge stands again at the end where the
            ring closes. Consecutive entries are a sector (or a zero-width step between levels).
        sectors: for each consecutive pair of the chain, the sector it belongs to.
    """

    D: Array
    length: Array
    midpoint: Array
    chain: tuple[int, ...]
    sectors: tuple[Sector, ...]


@dataclass(frozen=True)
class Discretisation:
    """All sectors of one contact, in order; `q` is the finest level of refinement (gamma / 2^q)."""

    q: int
    sectors: tuple[Sector, ...]

    @classmethod
    def coarse(cls, q: int) -> Discretisation:
        """Four sectors."""
        return cls(q, tuple(Sector(0.25 * i, 1) for i in range(4)))

    @classmethod
    def full(cls, q: int) -> Discretisation:
        """Every sector at the finest level: 4 * 2^q of them."""
        n = 4 * 2**q
        return cls(q, tuple(Sector(i / n, q + 1) for i in range(n)))

    def finest(self, sector: Sector) -> bool:
        """Is the sector as narrow as gamma / 2^q?"""
        return sector.level >= self.q + 1

    def refined(self, sector: Sector) -> Discretisation:
        """The sector bisected. Edges that lie between identical ones vanish with the sectors that needed them."""
        others = [s for s in self.sectors if s != sector]
        return Discretisation(self.q, tuple(sorted([*others, *sector.halves()])))

    def edges(self) -> Edges:
        """The edges of all sectors; neighbours of the same level share one."""
        ring: list[tuple[float, int]] = []  # direction and level
        owners: list[Sector] = []
        for s in self.sectors:
            for turn in (s.start, s.start + s.width):
                key = (turn % 1.0, s.level)
                if ring and ring[-1] == key:
                    continue
                if ring:
                    # a zero-width step between two levels belongs to the coarser one, which is the looser
                    step = ring[-1][0] == key[0]
                    owners.append(min(s, owners[-1], key=lambda o: o.level) if step else s)
                ring.append(key)
        keys = {key: i for i, key in enumerate(dict.fromkeys(ring))}
        angle = 2 * np.pi * np.array([k[0] for k in keys])
        length = np.array([edge_length(k[1], self.q) for k in keys])
        midpoint = np.array([np.cos(GAMMA / 2 ** k[1]) for k in keys])
        D = length * np.vstack([np.cos(angle), np.sin(angle)])
        return Edges(D, length, midpoint, tuple(keys[key] for key in ring), tuple(owners))
