"""The faces of a central arrangement of planes in three dimensions, in exact arithmetic.

On the unit sphere the planes are great circles: rays are where they cross, two-dimensional faces are arcs between
neighbouring crossings, cells lie beside arcs. n planes have at most n (n - 1) rays, 2 n (n - 1) arcs and n (n - 1) + 2
cells.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cmp_to_key
from itertools import combinations
from math import gcd, lcm

import numpy as np
from flint import fmpq

from handfast.core.arrays import Indices

Integers = tuple[int, int, int]
UNIT_AXES: tuple[Integers, ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True, eq=False)
class Face:
    """A face, open relative to its span.

    Attributes:
        dimension: 1, 2 or 3.
        signs: (n,) of the rows that were given, -1, 0 or 1.
        rays: integer vectors whose combinations with factors >= 0 are the closed face.
    """

    dimension: int
    signs: Indices
    rays: tuple[Integers, ...]


def faces(rows: Sequence[Sequence[fmpq]]) -> Iterator[Face]:
    """All faces of the planes {x: row . x = 0} but the origin.

    rows: nonzero 3-vectors, in any position. Where all planes share a line, the coordinate planes are added, so that
    every face is spanned by its rays; a finer arrangement covers the same motions.
    """
    given = [_primitive([int(v * lcm(*(int(w.q) for w in row))) for v in row]) for row in rows]
    planes, place = _distinct(given)
    rays = _rays(planes)
    if len(rays) <= 2:
        planes, place = _distinct([*given, *UNIT_AXES])
        rays = _rays(planes)
    at = np.array([[_sign(p, r) for p in planes] for r in rays], dtype=np.int8)
    back = np.array([k for k, _ in place[: len(given)]])
    sense = np.array([s for _, s in place[: len(given)]], dtype=np.int8)

    def face(dimension: int, signs: Indices) -> Face:
        closure = ((at == 0) | (at == signs)).all(axis=1)
        spanned = tuple(rays[k] for k in np.flatnonzero(closure))
        return Face(dimension, signs[back] * sense, spanned)

    for signs in at:
        yield face(1, signs)
    cells: set[bytes] = set()
    for i, plane in enumerate(planes):
        around = _around(plane, [k for k in range(len(rays)) if at[k, i] == 0], rays)
        for k, after in zip(around, around[1:] + around[:1], strict=True):
            arc = np.where(at[k] != 0, at[k], at[after])
            yield face(2, arc)
            for side in (-1, 1):
                cell = arc.copy()
                cell[i] = side
                if cell.tobytes() not in cells:
                    cells.add(cell.tobytes())
                    yield face(3, cell)


def _distinct(rows: Sequence[Integers]) -> tuple[list[Integers], list[tuple[int, int]]]:
    """The planes, each once, and for every row the number of its plane and on which side of it the row points."""
    planes: dict[Integers, int] = {}
    place = []
    for row in rows:
        sense = 1 if next(v for v in row if v) > 0 else -1
        a, b, c = row
        place.append((planes.setdefault((sense * a, sense * b, sense * c), len(planes)), sense))
    return list(planes), place


def _rays(planes: Sequence[Integers]) -> list[Integers]:
    """Where two planes cross, both ways, each once."""
    found: dict[Integers, None] = {}
    for a, b in combinations(planes, 2):
        x, y, z = _primitive(_cross(a, b))
        found[x, y, z] = found[-x, -y, -z] = None
    return list(found)


def _around(plane: Integers, chosen: list[int], rays: Sequence[Integers]) -> list[int]:
    """The chosen rays, all in the plane, in the order of their angles about its normal."""
    first = rays[chosen[0]]
    across = _cross(plane, first)
    flat = {k: (_dot(first, rays[k]), _dot(across, rays[k])) for k in chosen}

    def compare(k: int, h: int) -> int:
        (x, y), (u, v) = flat[k], flat[h]
        upper, other = (y, x) > (0, 0), (v, u) > (0, 0)  # angles in (0, 180] of the first half, as y > 0 or y = 0 < x
        if upper != other:
            return -1 if upper else 1
        turn = x * v - y * u
        return -1 if turn > 0 else int(turn < 0)

    return sorted(chosen, key=cmp_to_key(compare))


def _primitive(row: Sequence[int]) -> Integers:
    """The same direction in the smallest integers."""
    k = gcd(*row)
    a, b, c = (v // k for v in row)
    return a, b, c


def _cross(a: Integers, b: Integers) -> Integers:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Integers, b: Integers) -> int:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _sign(a: Integers, b: Integers) -> int:
    value = _dot(a, b)
    return (value > 0) - (value < 0)
