"""Triangle meshes as convex pieces: their parts as they are where they are convex, decomposed where they are not."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from handfast.core import kept
from handfast.core.arrays import Array
from handfast.core.errors import InputError, require_positive
from handfast.core.libraries import deferred_interrupt
from handfast.core.limited import TIMEOUT_REASON, limited
from handfast.core.parallel import default_jobs
from handfast.core.transforms import rigid
from handfast.model.shape import Faces, Mesh, Shape, refuse_far, volume_and_centroid

COACD_SECONDS, COACD_MEMORY = 300, 4 << 30  # [bytes]; solids of a hundred thousand triangles take a minute
COACD_START, RATE = 2.0, 400.0  # [s] and triangles per second of processor time, roughly, that CoACD takes
WARNING_SECONDS = 5.0  # [s] what takes longer is said beforehand
CONVEX = 0.02  # a piece is convex if its hull adds less than this share of volume
MAX_BODY_LENGTH = 5.0  # [m] no hand holds what is longer
MAX_PIECES = 200  # pieces
COACD_CONCAVITY = 0.05  # concavity that CoACD leaves
LOG = logging.getLogger("handfast")


def checked_scale(scale: float) -> None:
    """`InputError` unless it can be metres per unit."""
    require_positive(scale, "scale", "metres per unit of the mesh are needed, more than 0")


def checked_mesh(v: Array, f: Faces, source: str) -> Mesh:
    """Vertices (n, 3) and faces (k, 3) with duplicates merged; `InputError` if they are no triangle mesh."""
    if v.ndim != 2 or v.shape[1] != 3:
        raise InputError(f"has vertices of {v.shape[-1]} coordinates; three are needed", source=source)
    if f.ndim != 2 or f.shape[1] != 3 or f.min() < 0 or f.max() >= len(v):
        raise InputError(f"has a triangle with a corner that is none of its {len(v)} vertices", source=source)
    if not np.isfinite(v).all():
        raise InputError("has a vertex that is NaN or infinite", source=source)
    unique, inverse = np.unique(v, axis=0, return_inverse=True)
    return unique, inverse.reshape(-1)[f]


class Solid(NamedTuple):
    """Triangle meshes as a solid: `pieces` that are convex, the `volume` [m^3] and its `center` (3,) [m].

    Volume and centre of a part that is not convex are those of its closed surface: the pieces fill hollows, such as
    the bowl of a thin glass. Those of a convex part are its hull's.
    """

    pieces: list[Shape]
    volume: float
    center: Array


def center_of_volume(solids: Iterable[Solid | Shape]) -> Array | None:
    """(3,) [m] of solids together, as if they did not overlap; None if they have no volume."""
    each = [(s.volume, s.center if isinstance(s, Solid) else s.centroid) for s in solids]
    whole = sum(volume for volume, _ in each)
    return np.sum([volume * center for volume, center in each], axis=0) / whole if whole > 0 else None


def pieces_of(solids: Iterable[Solid | Shape]) -> list[Shape]:
    """The convex pieces of solids."""
    return [piece for s in solids for piece in (s.pieces if isinstance(s, Solid) else [s])]


def solid_of(meshes: list[Mesh], name: str, scale: float = 1.0, pose: object = None) -> Solid:
    """Triangle meshes (n, 3), (k, 3) of one object taken apart, scaled to metres and placed at `pose` (4, 4).

    Triangles that are wound otherwise than their neighbours are turned round. Where a part is not convex, so is a mesh
    that is turned inside out, and small holes are closed. That, a
    size that no hand holds, many pieces, and a decomposition of more than some seconds are said in a warning.

    Raises:
        InputError: lengths out of all proportion, no volume, a surface that is not convex and open, or has one side,
            a decomposition that takes more than `COACD_SECONDS` and `COACD_MEMORY`.
    """
    pose = rigid(np.eye(4) if pose is None else pose)
    groups = [(v * scale, f) for v, f in meshes]
    for vertices, _ in groups:
        refuse_far(vertices, name)
    long = max(float(np.ptp(v, axis=0).max()) for v, _ in groups)
    if long > MAX_BODY_LENGTH:
        LOG.warning("%s: is %.3g m long; a mesh in millimetres needs the scale 0.001", name, long)
    if len(groups) > 1 and not all(closed(f) for _, f in groups):
        groups = [_merged(groups)]  # groups that only colour one solid
    parts = [(v, _wound_alike(f, name)) for group in groups for v, f in components(*group)]
    if _hollow(parts):
        parts = [_merged(groups)]
    convex = [is_convex(v, f) for v, f in parts]
    if not all(convex) and sum(volume_and_centroid(v, f)[0] for v, f in parts if closed(f)) < 0:
        LOG.warning("%s: is turned inside out; its triangles are taken the other way round", name)
        parts = [(v, f[:, ::-1]) for v, f in parts]
    pieces: list[Shape] = []
    solids: list[tuple[float, Array]] = []
    for (v, f), whole in zip(parts, convex, strict=True):
        surface = (v, f) if whole else _solid_surface(v, f, name)
        hulls = [v] if whole else _apart(*surface, name)
        made = [Shape.hull(points, pose, f"{Path(name).stem}/{len(pieces) + i}") for i, points in enumerate(hulls)]
        solids.append((made[0].volume, made[0].centroid) if whole else _volume(*surface, made, pose))
        pieces += made
    if len(pieces) > MAX_PIECES:
        LOG.warning("%s: has %d convex pieces, each of which is compared with each solid of a hand", name, len(pieces))
    whole_volume = sum(volume for volume, _ in solids)
    centers = [volume * center for volume, center in solids]
    center = np.sum(centers, axis=0) / whole_volume if whole_volume > 0 else pose[:3, 3]
    return Solid(pieces, whole_volume, center)


def _volume(vertices: Array, faces: Faces, pieces: list[Shape], pose: Array) -> tuple[float, Array]:
    """Volume and its centre of a part: of its closed surface, unless that crosses itself so that it has none."""
    volume, center = volume_and_centroid(vertices, faces)
    if volume and ((center >= vertices.min(axis=0)) & (center <= vertices.max(axis=0))).all():
        return abs(volume), pose[:3, :3] @ center + pose[:3, 3]
    volumes = np.array([p.volume for p in pieces])
    whole = float(volumes.sum())
    return whole, volumes @ np.array([p.centroid for p in pieces]) / whole if whole else pose[:3, 3]


def surface_facts(meshes: list[Mesh], scale: float = 1.0) -> dict[str, Any]:
    """What triangle meshes (n, 3), (k, 3) are like as they stand.

    `size` (3) [m], `triangles`, `parts` that are connected, `convex` whether all are, `open_edges`, `badly_wound`
    edges whose triangles are wound in two senses, and `decomposing`, if any is not convex, about how long that
    takes [s of processor time].
    """
    parts = [part for v, f in meshes for part in components(v * scale, f)]
    whole = np.vstack([v for v, _ in parts])
    solid = [not _shared_edges(f)[2].any() and is_convex(v, f) for v, f in parts]
    facts: dict[str, Any] = {
        "size": np.ptp(whole, axis=0).tolist(),
        "triangles": sum(len(f) for _, f in parts),
        "parts": len(parts),
        "convex": all(solid),
        "open_edges": sum(len(open_edges(f)) for _, f in parts),
        "badly_wound": sum(int(_shared_edges(f)[2].sum()) for _, f in parts),
    }
    many = sum(len(f) for (_, f), convex in zip(parts, solid, strict=True) if not convex)
    return facts | ({"decomposing": COACD_START + many / RATE} if many else {})


def _solid_surface(vertices: Array, faces: Faces, name: str) -> Mesh:
    """A part that is not convex with its holes closed."""
    if open_edges(faces):
        filled = _filled(vertices, faces)
        if filled is None:
            edges = open_edges(faces)
            near = ", ".join(f"{x:.3g}" for x in vertices[edges[0][0]])
            problem = f"is open: {len(edges)} of its edges belong to one triangle alone, the first near ({near}) m"
            raise InputError(f"{problem}; what is not convex needs a closed surface, or convex pieces")
        LOG.warning("%s: is open; %d triangles close its holes", name, len(filled[1]) - len(faces))
        vertices, faces = filled
    if _shared_edges(faces)[2].any():
        raise InputError("has a surface with one side, as a Moebius strip; a solid is needed, or convex pieces")
    return vertices, faces


def _apart(vertices: Array, faces: Faces, name: str) -> list[Array]:
    """Vertices of the convex pieces of a part that is not convex, and closed; those of an earlier time if there are."""
    same = kept.digest(f"coacd {version('coacd')} {COACD_CONCAVITY}", vertices, faces)
    pieces = kept.recalled(same)
    if pieces:
        return pieces
    seconds = COACD_START + len(faces) / RATE
    if seconds > WARNING_SECONDS:
        told = "%s: is not convex; to take %d triangles apart takes about %d s of processor time, at most %d s"
        LOG.warning(told, name, len(faces), round(seconds), COACD_SECONDS * default_jobs())
    pieces = decompose(vertices, faces)
    kept.keep(same, pieces)
    return pieces


def _wound_alike(faces: Faces, name: str) -> Faces:
    """Triangles of a connected surface with all in one sense, that of most; as they are where they cannot be."""
    first, second, same = _shared_edges(faces)
    if not same.any():
        return faces
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    n = len(faces)
    beside = coo_array((np.ones(len(first)), (first, second)), (n, n)).tocsr()
    differs = {*zip(first[same].tolist(), second[same].tolist(), strict=True)}
    turned = np.zeros(n, dtype=bool)
    of_face = connected_components(beside, directed=False)[1]
    for begin in np.unique(of_face, return_index=True)[1].tolist():
        order, before = breadth_first_order(beside, begin, directed=False)
        for i, j in zip(order[1:].tolist(), before[order[1:]].tolist(), strict=True):
            turned[i] = turned[j] ^ ((i, j) in differs or (j, i) in differs)
        if 2 * turned[order].sum() > len(order):
            turned[order] = ~turned[order]
    out = faces.copy()
    out[turned] = out[turned][:, ::-1]
    LOG.warning("%s: %d of %d triangles are wound otherwise than the others; turned round", name, turned.sum(), n)
    return out


def _shared_edges(faces: Faces) -> tuple[Array, Array, Array]:
    """(k,) of edges with two triangles: which these are, and whether both run along it the same way, as none should."""
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, which, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    order = np.argsort(which.reshape(-1), kind="stable")
    at = (np.cumsum(count) - count)[count == 2]
    one, other = order[at], order[at + 1]
    n = len(faces)
    return one % n, other % n, edges[one, 0] == edges[other, 0]


def open_edges(faces: Faces) -> list[tuple[int, int]]:
    """Edges that belong to one triangle alone, as its corners follow each other."""
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, which, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    return [(int(a), int(b)) for a, b in edges[count[which.reshape(-1)] == 1]]


def _filled(vertices: Array, faces: Faces) -> Mesh | None:
    """The mesh with its holes closed by fans about their middles; None where that is more than a mend.

    A mend adds no more than `CONVEX` of the surface's area, or closes one flat hole, as of a bottle without a bottom.
    """
    follows: dict[int, list[int]] = {}
    for a, b in open_edges(faces):
        follows.setdefault(b, []).append(a)  # triangles that close a hole run along its edges the other way
    points, fans, rings = [*vertices], [*faces], 0
    while follows:
        start = at = next(iter(follows))
        ring = []
        while True:
            ring.append(at)
            after = follows.get(at, [])
            if not after:
                return None  # wound in both senses
            at = after.pop()
            if not after:
                del follows[ring[-1]]
            if at == start:
                break
        rings += 1
        points.append(vertices[ring].mean(axis=0))
        fans += [np.array([p, q, len(points) - 1]) for p, q in pairwise([*ring, start])]
    mended = np.array(points), np.array(fans)
    if _area(*mended) <= (1 + CONVEX) * _area(vertices, faces) or (rings == 1 and _flat(vertices[ring])):
        return mended
    return None


def _flat(points: Array) -> bool:
    """Whether points (n, 3) are in one plane, but for `CONVEX` of their width."""
    away = points - points.mean(axis=0)
    normal = np.linalg.svd(away)[2][-1]
    return bool(np.abs(away @ normal).max() <= CONVEX * np.ptp(points, axis=0).max())


def _area(vertices: Array, faces: Faces) -> float:
    """[m^2] of all triangles."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2


def _hollow(parts: list[Mesh]) -> bool:
    """Whether one part is the inner surface of another: inside it, and wound the other way."""
    outer = max(parts, key=lambda part: abs(volume_and_centroid(*part)[0]))
    size, hull = volume_and_centroid(*outer)[0], None
    for v, f in parts:
        if closed(f) and volume_and_centroid(v, f)[0] * size < 0:
            hull = hull or Shape.hull(outer[0])
            if (hull.depth(v) > 0).all():
                return True
    return False


def closed(faces: Faces) -> bool:
    """Whether every edge belongs to two triangles."""
    edges = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all())


def components(vertices: Array, faces: Faces) -> list[Mesh]:
    """The connected parts of a triangle mesh, in the order of their first triangles."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    n = len(vertices)
    i, j = np.concatenate([faces[:, 0], faces[:, 1]]), np.concatenate([faces[:, 1], faces[:, 2]])
    label = connected_components(coo_array((np.ones(len(i)), (i, j)), (n, n)), directed=False)[1]
    of_face = label[faces[:, 0]]
    _, first = np.unique(of_face, return_index=True)
    parts = []
    for name in of_face[np.sort(first)]:
        used, compact = np.unique(faces[of_face == name], return_inverse=True)
        parts.append((vertices[used], compact.reshape(-1, 3)))
    return parts


def is_convex(vertices: Array, faces: Faces) -> bool:
    """Whether a mesh is its own convex hull: to 2 % of its volume, or of its size if it is open."""
    hull = Shape.hull(vertices)
    if closed(faces):
        return abs(volume_and_centroid(vertices, faces)[0]) >= (1 - CONVEX) * hull.volume
    points = np.vstack([vertices, vertices[faces].mean(axis=1)])
    return bool(hull.depth(points).max() <= CONVEX * np.ptp(vertices, axis=0).max())


def joined(meshes: list[Mesh]) -> Mesh:
    """Several triangle meshes as one."""
    starts = np.cumsum([0] + [len(v) for v, _ in meshes])
    vertices = np.vstack([v for v, _ in meshes])
    return vertices, np.vstack([f + start for (_, f), start in zip(meshes, starts, strict=False)])


def _merged(meshes: list[Mesh]) -> Mesh:
    """Several triangle meshes as one, with the vertices that they share merged."""
    vertices, faces = joined(meshes)
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    return unique, inverse.reshape(-1)[faces]


def decompose(vertices: Array, faces: Faces) -> list[Array]:
    """Vertices of convex pieces that together approximate a solid, by CoACD, with a fixed seed.

    On a surface that cuts itself CoACD may come to no end, or end the process that it runs in.

    Raises:
        InputError: it cannot be done within `COACD_SECONDS` and `COACD_MEMORY`, or the time of `limited.within`.
    """
    limits = {"memory": COACD_MEMORY, "seconds": COACD_SECONDS, "threads": default_jobs()}
    try:  # its threads (OpenMP) do not work in a forked process
        return limited(_pieces, vertices, faces, new=True, **limits)
    except InputError as fault:
        if fault.problem == TIMEOUT_REASON:
            raise InputError(
                f"taking it apart into convex pieces {TIMEOUT_REASON}; give more, or convex pieces"
            ) from None
        problem = "cannot be taken apart into convex pieces; is its surface closed, and does not cut itself?"
        raise InputError(f"{problem} (CoACD {fault.problem})") from None


def _pieces(vertices: Array, faces: Faces) -> list[Array]:
    with deferred_interrupt():
        import coacd  # slow to import

    coacd.set_log_level("off")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces), threshold=COACD_CONCAVITY, seed=0)
    return [np.asarray(v, dtype=float) for v, _ in parts]
