"""The patch on which two convex solids meet, and few contacts in place of many of a patch.

Solids meet where their supporting vertex, edge or face overlap. Of a patch of many contacts, those are kept whose
wrenches span what all of them could apply. It is made of contacts of one link whose normals differ by little. Each
contact can apply the wrenches of its friction cone, here the cone's edges; those of a contact that is left out should
lie in the convex cone of the wrenches of those that are kept. The error of leaving it out is the largest distance of
one of its edges from that cone, relative to the edge's length, with torques about the object's centre of mass divided
by its radius. A distance is found by non-negative least squares. Eight edges stand for a round cone from within:
between the edges of one that is left out the distance can be larger by some per cent of itself, beside those of kept
ones it is smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.model.body import Body
from handfast.model.grasp import Contact
from handfast.model.shape import Shape

FACE_DEPTH = 1e-4  # [m] what is this near to the outermost plane of a solid belongs to its face
CORNER_TOLERANCE = 1e-6  # [m]
PATCH_CORNERS = 4
PATCH_CONE_EDGES = 8
PATCH_ANGLE = np.radians(30)  # normals of one patch differ from its first by no more
REDUCTION_TOLERANCE = 0.05


def patch(a: Shape, b: Shape, normal: Array, middle: Array) -> Array:
    """(k, 3) [m] corners of the patch on which two touching solids meet, 1 <= k <= 4.

    Args:
        a, b: solids in one frame, with `normal` (3,) the unit direction from a into b.
        middle: (3,) midway between their nearest points: the plane of the patch goes through it, and
            it is the answer where a point touches.
    """
    n = np.asarray(normal)
    plane = normal_frame(n)[:, 1:].copy()  # (3, 2)
    first = outline((a.feature(n, FACE_DEPTH) - middle) @ plane)
    second = outline((b.feature(-n, FACE_DEPTH) - middle) @ plane)
    if len(first) == 1 or len(second) == 1:
        return np.asarray(middle)[None]
    corners = few(outline(overlap(first, second)))
    return corners @ plane.T + middle if len(corners) else np.asarray(middle)[None]


def outline(points: Array) -> Array:
    """Convex outline of (n, 2) points, anticlockwise; one point or two where they coincide or line up."""
    p = points[np.lexsort((points[:, 1], points[:, 0]))]
    if len(p) == 0 or np.ptp(p, axis=0).max() < CORNER_TOLERANCE:
        return p[:1]

    def chain(q: Array) -> list[Array]:
        out: list[Array] = []
        for x in q:
            while len(out) > 1 and _turn(out[-2], out[-1], x) <= CORNER_TOLERANCE * np.linalg.norm(x - out[-2]):
                out.pop()
            if not out or np.linalg.norm(x - out[-1]) > CORNER_TOLERANCE:
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
    if len(corners) <= PATCH_CORNERS:
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
        return bool(np.linalg.norm(a + along * (b - a) - p) <= CORNER_TOLERANCE)
    return all(_turn(a, b, p) >= -CORNER_TOLERANCE * np.linalg.norm(b - a) for a, b in _edges(outline))


def _turn(a: Array, b: Array, c: Array) -> float:
    """Twice the signed area of the triangle a, b, c."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


# --- few in place of many ---


@dataclass(frozen=True, eq=False)
class ReducedContacts:
    """What is left of contacts.

    Attributes:
        contacts: those that are kept, in their order.
        before: how many there were.
        error: the largest relative distance of an edge of a left-out contact's cone from the cone of the kept ones.
    """

    contacts: tuple[Contact, ...]
    before: int
    error: float


def reduced_contacts(
    contacts: Sequence[Contact], body: Body, tolerance: float = REDUCTION_TOLERANCE
) -> ReducedContacts:
    """The contacts without those that add no more than `tolerance` to the wrenches of their patch; 0 keeps all."""
    if not (np.isfinite(tolerance) and 0 <= tolerance < 1):
        raise InputError(f"is {tolerance}; a number from 0 to below 1 is needed", field="tolerance")
    if tolerance == 0:
        return ReducedContacts(tuple(contacts), len(contacts), 0.0)
    radius = float(np.linalg.norm(body.vertices - body.center_of_mass, axis=1).max())
    kept: list[int] = []
    error = 0.0
    for patch in patches(contacts):
        edges = [wrench_edges(contacts[i], body.center_of_mass, radius) for i in patch]
        chosen, worst = spanning(edges, tolerance)
        kept += [patch[k] for k in chosen]
        error = max(error, worst)
    return ReducedContacts(tuple(contacts[i] for i in sorted(kept)), len(contacts), error)


def patches(contacts: Sequence[Contact]) -> list[list[int]]:
    """Contacts of one link whose normals are within `PATCH_ANGLE` of that of the deepest that is left, as indices."""
    left = sorted(range(len(contacts)), key=lambda i: (contacts[i].link, -contacts[i].depth, i))
    found = []
    while left:
        lead = contacts[left[0]]
        near = [
            i for i in left if contacts[i].link == lead.link and contacts[i].normal @ lead.normal >= np.cos(PATCH_ANGLE)
        ]
        found.append(near)
        left = [i for i in left if i not in near]
    return found


def wrench_edges(contact: Contact, center: Array, radius: float) -> Array:
    """(EDGES, 6) unit wrenches along the edges of a contact's friction cone, torques about `center` over `radius`."""
    n, t1, t2 = contact.frame.T
    around = 2 * np.pi * np.arange(PATCH_CONE_EDGES) / PATCH_CONE_EDGES
    forces = n + contact.friction * (np.outer(np.cos(around), t1) + np.outer(np.sin(around), t2))
    wrenches = np.hstack([forces, np.cross(contact.position - center, forces) / radius])
    return wrenches / np.linalg.norm(wrenches, axis=1)[:, None]


def spanning(edges: Sequence[Array], tolerance: float) -> tuple[list[int], float]:
    """Which contacts' cones span all the others' to a tolerance, and the error that is left.

    The one alone that misses least, if that is enough; else the outermost first, then always the one that is missed
    most; at last those that the later ones made superfluous go.
    """
    n = len(edges)
    if n == 1:
        return [0], 0.0
    alone = [max(distance_to_cone(e, edges[k]) for i, e in enumerate(edges) if i != k) for k in range(n)]
    best = int(np.argmin(alone))
    if alone[best] <= tolerance:
        return [best], alone[best]
    chosen = [int(np.argmax(alone))]

    def missed(kept: Sequence[int]) -> Array:
        cone = np.vstack([edges[k] for k in kept])
        return np.array([0.0 if i in kept else distance_to_cone(e, cone) for i, e in enumerate(edges)])

    errors = missed(chosen)
    while errors.max() > tolerance:
        chosen.append(int(errors.argmax()))
        errors = missed(chosen)
    for k in list(chosen[:-1]):
        fewer = [c for c in chosen if c != k]
        without = missed(fewer)
        if without.max() <= tolerance:
            chosen, errors = fewer, without
    return sorted(chosen), float(errors.max())


def distance_to_cone(wrenches: Array, cone: Array) -> float:
    """The largest distance of unit wrenches (k, 6) from the convex cone of others (m, 6)."""
    from scipy.optimize import nnls

    return max(float(nnls(cone.T, w)[1]) for w in wrenches)
