"""The patch on which two convex solids meet: where their supporting vertex, edge or face overlap."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame
from handfast.model.shape import Shape

FLAT = 1e-4  # [m] what is this near to the outermost plane of a solid belongs to its face
SAME = 1e-6  # [m]
CORNERS = 4


def patch(a: Shape, b: Shape, normal: Array, middle: Array) -> Array:
    """(k, 3) [m] corners of the patch on which two touching solids meet, 1 <= k <= 4.

    Args:
        a, b: solids in one frame, with `normal` (3,) the unit direction from a into b.
        middle: (3,) midway between their nearest points: the plane of the patch goes through it, and
            it is the answer where a point touches.
    """
    n = np.asarray(normal)
    plane = normal_frame(n)[:, 1:].copy()  # (3, 2)
    first = outline((a.feature(n, FLAT) - middle) @ plane)
    second = outline((b.feature(-n, FLAT) - middle) @ plane)
    if len(first) == 1 or len(second) == 1:
        return np.asarray(middle)[None]
    corners = few(outline(overlap(first, second)))
    return corners @ plane.T + middle if len(corners) else np.asarray(middle)[None]


def outline(points: Array) -> Array:
    """Convex outline of (n, 2) points, anticlockwise; one point or two where they coincide or line up."""
    p = points[np.lexsort((points[:, 1], points[:, 0]))]
    if len(p) == 0 or np.ptp(p, axis=0).max() < SAME:
        return p[:1]

    def chain(q: Array) -> list[Array]:
        out: list[Array] = []
        for x in q:
            while len(out) > 1 and _turn(out[-2], out[-1], x) <= SAME * np.linalg.norm(x - out[-2]):
                out.pop()
            if not out or np.linalg.norm(x - out[-1]) > SAME:
                out.append(x)
        return out

    lower, upper = chain(p), chain(p[::-1])
    return np.array(lower[:-1] + upper[:-1])


def overlap(first: Array, second: Array) -> Array:
    """(k, 2) points whose outline is the overlap of two outlines (segments or polygons); may be none."""
    points = [p for p in first if _inside(p, second)] + [p for p in second if _inside(p, first)]
    for p0, p1 in _edges(first):
        for s0, s1 in _edges(second):
            v, w = p1 - p0, s1 - s0
            across = v[0] * w[1] - v[1] * w[0]
            if abs(across) < 1e-9 * np.linalg.norm(v) * np.linalg.norm(w):
                continue  # parallel: their ends are among the points already
            x = s0 - p0
            t, r = (x[0] * w[1] - x[1] * w[0]) / across, (x[0] * v[1] - x[1] * v[0]) / across
            if 0 <= t <= 1 and 0 <= r <= 1:
                points.append(p0 + t * v)
    return np.array(points).reshape(-1, 2)


def few(corners: Array) -> Array:
    """At most four of an outline's corners, spread as widely as possible."""
    if len(corners) <= CORNERS:
        return corners
    far = np.linalg.norm(corners[:, None] - corners[None], axis=2).round(9)
    i, j = np.unravel_index(far.argmax(), far.shape)
    side = np.array([_turn(corners[i], corners[j], c) for c in corners]).round(12)
    return corners[sorted({int(i), int(j), int(side.argmax()), int(side.argmin())})]


def _edges(outline: Array) -> list[tuple[Array, Array]]:
    pairs = [(outline[k - 1], outline[k]) for k in range(len(outline))]
    return pairs[1:] if len(outline) == 2 else pairs


def _inside(p: Array, outline: Array) -> bool:
    if len(outline) == 2:
        a, b = outline
        along = np.clip((p - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        return bool(np.linalg.norm(a + along * (b - a) - p) <= SAME)
    return all(_turn(a, b, p) >= -SAME * np.linalg.norm(b - a) for a, b in _edges(outline))


def _turn(a: Array, b: Array, c: Array) -> float:
    """Twice the signed area of the triangle a, b, c."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
