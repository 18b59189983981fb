"""Where a hand and an object touch, or soon may, each point with a depth of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.transforms import normal_frame
from handfast.geometry.contact_patch import FLAT, patch
from handfast.geometry.contacts import hidden_points
from handfast.geometry.scene import HandObjectPair, Scene
from handfast.model.shape import Shape

Pair = tuple[int, int, int]  # link, its shape, piece of the object
FLATTEST = 1e-3  # [m] points of a feature nearer to each other than this tell nothing of its tilt


@dataclass(frozen=True, eq=False)
class TouchPoints:
    """Points at which a finger and the object touch or are near to, in the hand's base frame.

    Attributes:
        positions: (n, 3) [m], midway between the surfaces.
        frames: (n, 3, 3) columns: the normal into the object, and two tangents.
        depths: (n,) [m] how far the surfaces are in each other; negative apart.
        links: (n,) index of the hand's link.
        pairs: n of which solids.
    """

    positions: Array
    frames: Array
    depths: Array
    links: Indices
    pairs: tuple[Pair, ...]

    def __len__(self) -> int:
        return len(self.depths)


def touch_points(scene: Scene, q: Array, pose: Array, reach: float, rest: dict[Pair, float]) -> TouchPoints:
    """All points nearer than `reach` [m].

    Args:
        rest: depths at which pairs of solids are taken to touch, 0 for those that are not in it.
    """
    found = scene.nearest(q, pose, reach + max([0.0, *(-d for d in rest.values())]))
    link_poses = scene.placed
    pieces = [piece.placed(pose) for piece in scene.body.pieces]
    positions: list[Array] = []
    frames: list[Array] = []
    depths: list[float] = []
    links: list[int] = []
    pairs: list[Pair] = []
    solids: dict[int, list[Shape]] = {}
    for p in found:
        key = (p.link, p.shape, p.piece)
        deepest = -p.distance - rest.get(key, 0.0)
        if deepest < -reach:
            continue
        if p.link not in solids:
            solids[p.link] = [s.placed(link_poses[p.link]) for s in scene.hand.links[p.link].shapes]
        at, below = _points(p, solids[p.link], pieces)
        frame = normal_frame(p.normal)
        for point, lower in zip(at, below, strict=True):
            positions.append(point)
            frames.append(frame)
            depths.append(deepest - lower)
            links.append(p.link)
            pairs.append(key)
    n = len(depths)
    return TouchPoints(
        np.array(positions).reshape(n, 3), np.array(frames).reshape(n, 3, 3), np.array(depths, dtype=float),
        np.array(links, dtype=np.intp), tuple(pairs),
    )  # fmt: skip


def _points(p: HandObjectPair, solids: list[Shape], pieces: list[Shape]) -> tuple[Array, Array]:
    """(k, 3) corners of the patch on real surfaces, and (k,) how much less deep each is than the deepest."""
    a, b = solids[p.shape], pieces[p.piece]
    middle = (p.on_hand + p.on_object) / 2
    corners = patch(a, b, p.normal, middle)
    on_object, on_hand = corners + p.distance / 2 * p.normal, corners - p.distance / 2 * p.normal
    hidden = hidden_points(on_object, -p.normal, pieces, p.piece) | hidden_points(on_hand, p.normal, solids, p.shape)
    if len(corners) == 1:
        return corners[~hidden], np.zeros(int((~hidden).sum()))
    plane = normal_frame(p.normal)[:, 1:]
    overlap = _height(a, p.normal, plane, corners) + _height(b, -p.normal, plane, corners)
    return corners[~hidden], (overlap.max() - overlap)[~hidden]


def _height(solid: Shape, n: Array, plane: Array, at: Array) -> Array:
    """(k,) how far the supporting edge or face of a solid reaches along n at points of a patch."""
    points = solid.feature(n, FLAT)
    middle = points.mean(axis=0)
    flat = (points - middle) @ plane
    _, s, V = np.linalg.svd(flat, full_matrices=False)
    V = V[s > FLATTEST]
    if not len(V):
        return np.zeros(len(at))
    slope = np.linalg.lstsq(flat @ V.T, (points - middle) @ n, rcond=None)[0]
    out: Array = (at - middle) @ plane @ V.T @ slope
    return out
