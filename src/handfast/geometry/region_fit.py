"""A Bezier patch through part of a triangle mesh: regions for objects that are known as meshes only."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.model.bernstein import bernstein
from handfast.model.region import Bezier
from handfast.model.shape import Faces

STEEPEST = np.radians(80)  # a triangle further from the mean direction than this cannot be projected along it
SIDE_SHARES = (1.0, 0.75, 0.5, 0.25, 0.0)  # how far the patch's sides follow the outline, from the corners' chords on
REGULAR = 0.2  # least sine of the angle between the parameter lines, and least ratio of areas over the patch
OUTSIDE_SHARES = 0.01, 0.6  # of the selection's size, and of its edges, by which a parameter line may leave it
MIN_COVERAGE, MAX_COVERAGE = 0.6, 1.2  # coverage
FIT_SAMPLES = 25  # samples along each side of the patch
CHECK_POINTS = 25  # points along each side at which the errors are measured
FIT_ROUNDS = 8  # of moving the samples' parameters to their foot points


@dataclass(frozen=True, eq=False)
class Fitted:
    """A patch and how far it is from the selected faces.

    Attributes:
        patch: its outward normal agrees with the faces' winding.
        error_max, error_rms: [m] distances over both ways, from the patch to the mesh and from the part of the
            selection that it covers to the patch.
        coverage: the patch's area over that of the selection; a round selection is covered in part, because
            the normal of a four-sided patch vanishes in a corner without an angle.
    """

    patch: Bezier
    error_max: float
    error_rms: float
    coverage: float


def fit(vertices: Array, faces: Faces, selection: object, degree: tuple[int, int] = (3, 3)) -> Fitted:
    """The Bezier patch of a degree that is nearest, in the least squares sense, to some faces of a mesh.

    The faces are projected along their mean direction, the outline is taken as four smooth sides between the
    points furthest into the corners of the smallest rectangle about it, and the plane between them (a Coons
    patch) gives each sample its first parameters; foot points improve them. Vertices at the same place count
    as one.

    Args:
        vertices: (n, 3) [m].
        faces: (k, 3), wound outwards.
        selection: indices of faces, or a mask (k,).
        degree: of the patch in both directions, u along the longer side of the rectangle.

    Raises:
        InputError: a selection that is empty, not connected, closed, with a hole or wound both ways, that
            turns too far to be projected, or whose outline cannot be taken as four sides; a degree below 1.
    """
    if min(degree) < 1:
        raise InputError(f"is {degree[0]} x {degree[1]}; at least 1 x 1 is needed", field="degree")
    vertices, same = np.unique(np.asarray(vertices, dtype=float), axis=0, return_inverse=True)
    faces = same.reshape(-1)[np.asarray(faces)]
    chosen = faces[_selected(selection, len(faces))]
    outline = _outline(chosen)
    corners = vertices[chosen]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    frame = _frame(area, vertices[outline])
    middle = corners.reshape(-1, 3).mean(axis=0)
    local = (corners - middle) @ frame.T
    samples, u, v = _samples(local, (vertices[outline] - middle) @ frame.T)
    try:
        points = _least_squares(samples, u, v, degree)
        patch = Bezier(points @ frame + middle)
    except InputError as fault:
        raise InputError(f"cannot be fitted: the patch {fault.problem}", field="selection") from None
    everything = (vertices[faces] - middle) @ frame.T
    errors = np.concatenate([_to_faces(points, everything), _to_patch(points, samples, u, v, local)])
    coverage = _area(patch) / float(np.linalg.norm(area, axis=1).sum())
    if not MIN_COVERAGE < coverage < MAX_COVERAGE:
        problem = (
            f"has an outline that cannot be taken as four sides: the patch would cover {100 * coverage:.0f} % of it"
        )
        raise InputError(problem, field="selection")
    return Fitted(patch, float(errors.max()), float(np.sqrt((errors**2).mean())), coverage)


def fit_grid(points: Array, degree: tuple[int, int] = (3, 3)) -> Fitted:
    """The Bezier patch of a degree through a grid of points of a surface, in least squares.

    Point (i, j) keeps the parameters i / (g - 1), j / (h - 1), as is right for a grid that was drawn on the surface
    evenly, and quick. The errors are distances of patch and grid, taken as bilinear between its points, at the same
    parameters: upper bounds of the distances between the two surfaces there.

    Args:
        points: (g, h, 3) [m], more along each side than the degree.
        degree: of the patch in both directions.

    Raises:
        InputError: too few points for the degree, or the patch's normal vanishes.
    """
    points = np.asarray(points, dtype=float)
    least = min(degree[0], degree[1])
    enough = points.ndim == 3 and points.shape[2] == 3 and least >= 1
    if not enough or points.shape[0] <= degree[0] or points.shape[1] <= degree[1]:
        problem = f"has shape {points.shape}; more points a side than the degree, of three coordinates, are needed"
        raise InputError(problem, field="points")
    u, v = (np.linspace(0, 1, n) for n in points.shape[:2])
    A, B = (np.linalg.pinv(bernstein(d, x)) for d, x in zip(degree, (u, v), strict=True))
    try:
        patch = Bezier(np.einsum("ai,bj,ijk->abk", A, B, points))
    except InputError as fault:
        raise InputError(f"cannot be fitted: the patch {fault.problem}", field="points") from None
    errors = []
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):  # the points, and the middles of sides and cells
        a = (points[1:] + points[:-1]) / 2 if i else points
        a = (a[:, 1:] + a[:, :-1]) / 2 if j else a
        at = np.meshgrid((u[1:] + u[:-1]) / 2 if i else u, (v[1:] + v[:-1]) / 2 if j else v, indexing="ij")
        errors.append(np.linalg.norm(patch.at(*at) - a, axis=2).ravel())
    error = np.concatenate(errors)
    diagonals = points[1:, 1:] - points[:-1, :-1], points[:-1, 1:] - points[1:, :-1]
    area = float(np.linalg.norm(np.cross(*diagonals), axis=2).sum()) / 2
    return Fitted(patch, float(error.max()), float(np.sqrt((error**2).mean())), _area(patch) / area)


# --- the selection -----------------------------------------------------------------------------------


def _selected(selection: object, count: int) -> Indices:
    """Face indices, ascending, each once."""
    given = np.asarray(selection)
    if given.dtype == bool:
        if given.shape != (count,):
            raise InputError(f"has shape {given.shape}; a mask of the mesh needs ({count},)", field="selection")
        given = np.flatnonzero(given)
    if not given.size:
        raise InputError("is empty; at least one face is needed", field="selection")
    if given.dtype.kind not in "iu" or given.min() < 0:
        raise InputError("has no such face; indices from 0 on, or a mask, are needed", field="selection")
    if given.max() >= count:
        raise InputError(f"has face {given.max()}, beyond the mesh's {count}; they count from 0", field="selection")
    return np.unique(given)


def _outline(faces: Faces) -> Indices:
    """Vertices around the boundary of one disc of faces, in the order of their winding."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    if len(np.unique(edges, axis=0)) < len(edges):
        raise InputError("has both windings, or an edge with more than two faces", field="selection")
    owner = np.tile(np.arange(len(faces)), 3)
    _, same = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    order = np.argsort(same.ravel(), kind="stable")
    twin = same.ravel()[order][1:] == same.ravel()[order][:-1]
    pairs = owner[order][:-1][twin], owner[order][1:][twin]
    joined = coo_array((np.ones(len(pairs[0])), pairs), (len(faces), len(faces)))
    pieces, _ = connected_components(joined, directed=False)
    if pieces > 1:
        raise InputError(f"falls into several pieces ({pieces}) that share no edge; one is needed", field="selection")
    shared = {(int(b), int(a)) for a, b in edges}
    border = [(int(a), int(b)) for a, b in edges if (int(a), int(b)) not in shared]
    if not border:
        raise InputError("is closed; a region has an outline", field="selection")
    after = dict(border)
    loop = [border[0][0]]
    while len(after) == len(border) and len(loop) < len(border) and after[loop[-1]] != loop[0]:
        loop.append(after[loop[-1]])
    if len(loop) < len(border) or len(np.unique(faces)) - len(edges) + int(twin.sum()) + len(faces) != 1:
        raise InputError("has holes, or touches itself in a corner; a disc is needed", field="selection")
    return np.array(loop)


def _frame(area: Array, outline: Array) -> Array:
    """(3, 3) rows: along and across the smallest rectangle about the outline, and the mean direction.

    `area` (k, 3) are the faces' normals, as long as their areas.
    """
    from scipy.spatial import ConvexHull

    size = np.linalg.norm(area, axis=1)
    up = area.sum(axis=0) / max(float(np.linalg.norm(area.sum(axis=0))), 1e-300)
    real = size > 1e-12 * size.max(initial=0.0)
    if not real.any():
        raise InputError("has no area", field="selection")
    steepest = float(np.arccos(np.clip((area[real] / size[real, None]) @ up, -1, 1)).max())
    if steepest > STEEPEST:
        turned, most = np.degrees([steepest, STEEPEST])
        what = f"turns by {turned:.0f} degrees from its mean direction, like a hemisphere or more"
        problem = f"{what}; up to {most:.0f} can be fitted"
        raise InputError(problem, field="selection")
    plane = np.array([*normal_frame(up).T[1:]])
    flat = outline @ plane.T
    hull = flat[ConvexHull(flat).vertices]
    best: tuple[float, Array] | None = None
    for step in np.roll(hull, -1, axis=0) - hull:
        along = step / np.linalg.norm(step)
        turn = np.array([along, [-along[1], along[0]]])
        spread = np.ptp(hull @ turn.T, axis=0)
        if best is None or spread[0] * spread[1] < best[0] * (1 - 1e-9):
            best = (
                float(spread[0] * spread[1]),
                turn if spread[0] >= spread[1] else np.array([-turn[1], turn[0]])[[0, 1]],
            )
    assert best is not None
    axes = best[1] @ plane
    return np.array([axes[0], np.cross(up, axes[0]), up])


# --- samples -----------------------------------------------------------------------------------------


def _samples(corners: Array, outline: Array) -> tuple[Array, Array, Array]:
    """(m, 3) points of the faces, and their first parameters u (m,) and v (m,); local frame, z the mean direction."""
    flat, size = outline[:, :2], float(np.ptp(outline[:, :2], axis=0).max())
    within = (flat - flat.min(axis=0)) / np.ptp(flat, axis=0) - 0.5
    at = [int((within @ d).argmax()) for d in np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])]
    turned = [(a - at[0]) % len(flat) for a in at]
    if sorted(set(turned)) != turned:
        raise InputError("has an outline with no four corners: two of them fall together", field="selection")
    ring = np.roll(flat, -at[0], axis=0)
    ring = np.vstack([ring, ring[:1]])
    sides = [ring[a : b + 1] for a, b in pairwise([*turned, len(flat)])]
    allowed = max(
        OUTSIDE_SHARES[0] * size, OUTSIDE_SHARES[1] * float(np.linalg.norm(np.diff(ring, axis=0), axis=1).mean())
    )
    steps = np.linspace(0, 1, FIT_SAMPLES)
    for follow in SIDE_SHARES:
        grid = _coons([_along(side, steps, follow) for side in sides], steps)
        if not _regular(grid):
            continue
        points, outside = _lifted(grid.reshape(-1, 2), corners)
        if outside <= allowed:
            u, v = np.meshgrid(steps, steps, indexing="ij")
            return points, u.ravel(), v.ravel()
    raise InputError("has an outline that cannot be taken as four sides; select a simpler one", field="selection")


def _along(side: Array, steps: Array, follow: float) -> Array:
    """(g, 2) points along the cubic that is nearest to a polyline, ends kept, drawn to its chord as `follow` falls."""

    def bends(t: Array) -> Array:
        return np.column_stack([t * (1 - t), t * (1 - t) * (2 * t - 1)])

    run = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))])
    dense = np.linspace(0, 1, 8 * FIT_SAMPLES)
    line = np.column_stack([np.interp(dense, run / run[-1], side[:, i]) for i in (0, 1)])
    chord = side[0] + dense[:, None] * (side[-1] - side[0])
    bulge = np.linalg.lstsq(bends(dense), line - chord, rcond=None)[0]
    return side[0] + steps[:, None] * (side[-1] - side[0]) + follow * bends(steps) @ bulge


def _coons(sides: list[Array], steps: Array) -> Array:
    """(g, g, 2) the Coons patch between four sides (g, 2), in order round; u along the first one."""
    bottom, right, top, left = sides[0], sides[1], sides[2][::-1], sides[3][::-1]
    u, v = steps[:, None, None], steps[None, :, None]
    ruled = (1 - v) * bottom[:, None] + v * top[:, None] + (1 - u) * left[None] + u * right[None]
    tensor = (1 - u) * ((1 - v) * bottom[0] + v * top[0]) + u * ((1 - v) * bottom[-1] + v * top[-1])
    return ruled - tensor


def _regular(grid: Array) -> bool:
    """Whether the parameter lines cross at an angle and one way round, cell by cell."""
    du, dv = np.diff(grid, axis=0), np.diff(grid, axis=1)
    low, high = (du[:, :-1], dv[:-1]), (du[:, 1:], dv[1:])
    for a, b in (low, high, (du[:, :-1], dv[1:]), (du[:, 1:], dv[:-1])):
        cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
        length = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
        if (cross < REGULAR * length).any() or cross.min() < REGULAR**2 * np.median(cross):
            return False
    return True


def _lifted(flat: Array, corners: Array) -> tuple[Array, float]:
    """Points (m, 3) of the faces above or below points (m, 2), and how far [m] the worst of these is outside.

    Where a point is outside, the nearest face is continued.
    """
    a, b, c = (corners[:, i, :2] for i in range(3))
    det = flat_cross(b - a, c - a)
    keep = det > 1e-12 * det.max()
    a, b, c, det, kept = a[keep], b[keep], c[keep], det[keep], corners[keep]
    height = det / np.max([np.linalg.norm(s, axis=1) for s in (b - a, c - b, a - c)], axis=0)
    points, worst = np.empty((len(flat), 3)), 0.0
    for i, p in enumerate(flat):
        w = np.column_stack([flat_cross(y - p, z - p) for y, z in ((b, c), (c, a), (a, b))]) / det[:, None]
        short = np.maximum(-w.min(axis=1), 0) * height
        best = int(short.argmin())
        worst = max(worst, float(short[best]))
        points[i] = w[best] @ kept[best]
    return points, worst


def flat_cross(a: Array, b: Array) -> Array:
    """(...) of vectors (..., 2)."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


# --- the patch ---------------------------------------------------------------------------------------


def _least_squares(samples: Array, u: Array, v: Array, degree: tuple[int, int]) -> Array:
    """(M+1, N+1, 3) control points; the parameters of inner samples move to their foot points between rounds."""
    inner: Mask = (u > 0) & (u < 1) & (v > 0) & (v < 1)
    shape = (degree[0] + 1, degree[1] + 1, 3)

    def solve(u: Array, v: Array) -> tuple[Array, float]:
        A = np.einsum("mi,mj->mij", bernstein(degree[0], u), bernstein(degree[1], v)).reshape(len(u), -1)
        b = np.linalg.solve(A.T @ A, A.T @ samples)  # well enough conditioned for the degrees in use
        return b.reshape(shape), float(((A @ b - samples) ** 2).sum())

    best, least = solve(u, v)
    points = best
    for _ in range(FIT_ROUNDS):
        moved = _foot(points, samples, u, v, 1)
        u, v = np.where(inner, moved[0], u), np.where(inner, moved[1], v)
        points, misfit = solve(u, v)
        if misfit >= least * (1 - 1e-6):
            break
        best, least = points, misfit
    return best


def _foot(points: Array, samples: Array, u: Array, v: Array, rounds: int) -> tuple[Array, Array]:
    """Parameters of points of the patch nearer to the samples: Gauss-Newton steps, kept within [0, 1]."""
    patch = Bezier(points)
    for _ in range(rounds):
        away = samples - patch.at(u, v)
        pu, pv = patch.at(u, v, 1, 0), patch.at(u, v, 0, 1)
        a, b, c = (np.einsum("mi,mi->m", x, y) for x, y in ((pu, pu), (pu, pv), (pv, pv)))
        f, g = np.einsum("mi,mi->m", pu, away), np.einsum("mi,mi->m", pv, away)
        det = a * c - b * b
        u, v = np.clip(u + (c * f - b * g) / det, 0, 1), np.clip(v + (a * g - b * f) / det, 0, 1)
    return u, v


def _to_patch(points: Array, samples: Array, u: Array, v: Array, corners: Array) -> Array:
    """(m,) [m] distance to the patch of the samples and of the vertices that are above it or below it."""
    from scipy.spatial import KDTree

    spots = np.unique(corners.reshape(-1, 3), axis=0)
    nearest = KDTree(samples).query(spots)[1]
    spots, u, v = np.vstack([samples, spots]), np.append(u, u[nearest]), np.append(v, v[nearest])
    before = np.linalg.norm(spots - Bezier(points).at(u, v), axis=1)
    u, v = _foot(points, spots, u, v, 10)
    after = np.linalg.norm(spots - Bezier(points).at(u, v), axis=1)
    covered = (np.minimum(u, v) > 0) & (np.maximum(u, v) < 1)
    covered[: len(samples)] = True
    return np.minimum(before, after)[covered]


def _to_faces(points: Array, corners: Array) -> Array:
    """(m,) [m] distance of points all over the patch to the nearest face."""
    from trimesh.triangles import closest_point

    steps = np.linspace(0, 1, CHECK_POINTS)
    u, v = np.meshgrid(steps, steps)
    spots = Bezier(points).at(u, v).reshape(-1, 3)
    far = np.array([np.linalg.norm(corners[:, 0] - p, axis=1).min() for p in spots]) + 1e-12  # to the nearest corner
    least, most = corners.min(axis=1), corners.max(axis=1)
    close = ((least <= spots.max(axis=0) + far.max()) & (most >= spots.min(axis=0) - far.max())).all(axis=1)
    corners, least, most = corners[close], least[close], most[close]
    found = np.empty(len(spots))
    for i, spot in enumerate(spots):
        near = np.linalg.norm(np.clip(spot, least, most) - spot, axis=1) <= far[i]  # to the boxes about the faces
        nearest = closest_point(corners[near], np.tile(spot, (int(near.sum()), 1)))
        found[i] = np.linalg.norm(nearest - spot, axis=1).min()
    return found


def _area(patch: Bezier) -> float:
    """[m^2] by quadrature."""
    x, w = np.polynomial.legendre.leggauss(12)
    u, v = np.meshgrid((x + 1) / 2, (x + 1) / 2)
    return float(np.linalg.norm(patch.normal(u, v), axis=-1) @ w @ w / 4)
