"""Scene: distances between the links of a hand, and between them and an object, by mujoco's collider."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from holdfast.body import Body
from holdfast.errors import InputError
from holdfast.hand.model import Hand
from holdfast.mechanism import Array
from holdfast.shape import Shape, quaternion_matrix, rigid, transform

Indices = NDArray[np.intp]

TOUCHING = 1e-7  # [m] below this the two nearest points no longer give a direction
NUDGE = 1e-6  # [m]


@dataclass(frozen=True, eq=False)
class Near:
    """The nearest points of a hand shape and an object piece.

    Attributes:
        link, shape: index of the hand link, and of the shape in it.
        piece: index of the object piece.
        distance: [m], negative in penetration.
        on_hand, on_object: (3,) [m], base frame.
        normal: (3,) unit, base frame, from the hand into the object.
    """

    link: int
    shape: int
    piece: int
    distance: float
    on_hand: Array
    on_object: Array
    normal: Array


class Scene:
    """A hand and an object, compiled once and placed as often as needed. Frame: the hand's base.

    Distances are mujoco's, to about 1e-9 m for polyhedra and primitives; only pairs whose bounding
    spheres are nearer than the cutoff are evaluated. Not thread-safe; deterministic.

    Raises:
        InputError: a shape that mujoco cannot take as a convex solid.
    """

    def __init__(self, hand: Hand, body: Body) -> None:
        import mujoco  # slow to import

        self.hand, self.body = hand, body
        owners = [i for i, link in enumerate(hand.links) for _ in link.shapes]
        self.owner = np.array(owners + [-1] * len(body.pieces))
        self.number = np.array([k for link in hand.links for k in range(len(link.shapes))])
        shapes = [s for link in hand.links for s in link.shapes] + list(body.pieces)
        self._hand_geoms = np.flatnonzero(self.owner >= 0)
        self._body_geoms = np.flatnonzero(self.owner < 0)
        self._model = _compile(mujoco, shapes)
        self._data = mujoco.MjData(self._model)
        self._measure = mujoco.mj_geomDistance
        m = self._model
        self._local = np.array(
            [transform(p, quaternion_matrix(r)) for p, r in zip(m.geom_pos, m.geom_quat, strict=True)]
        )
        self._between = np.zeros(6)
        self._radius = m.geom_rbound.copy()
        self._self_pairs = self._link_pairs()
        reach = np.linalg.norm(self._local[:, :3, 3], axis=1) + self._radius
        self.link_radius = np.array([max([0.0, *reach[self.owner == i]]) for i in range(len(hand.links))])

    # `link_radius` (n_links,) [m]: a sphere about each link's origin that holds its shapes

    def place(self, q: Array, object_pose: Array) -> None:
        """Put the hand at q (l,) and the object at its pose (4, 4) in the hand's base frame."""
        poses = np.concatenate([self.hand.link_poses(q), np.asarray(object_pose, dtype=float)[None]])
        world = poses[self.owner] @ self._local  # owner -1, the object, is the last pose
        self._data.geom_xpos[:] = world[:, :3, 3]
        self._data.geom_xmat[:] = world[:, :3, :3].reshape(-1, 9)

    def distance(self, q: Array, object_pose: Array, cutoff: float = 0.05) -> Array:
        """(n_links,) [m] signed distance of each link to the object; `cutoff` if further or without shape."""
        self.place(q, object_pose)
        return self._link_distances(cutoff)

    def nearest(self, q: Array, object_pose: Array, cutoff: float) -> list[Near]:
        """Every pair of hand shape and object piece nearer than `cutoff` [m], in the order of the shapes."""
        self.place(q, object_pose)
        found = []
        for a, b in self._close_pairs(self._hand_geoms, self._body_geoms, cutoff):
            d, on_hand, on_object = self._pair(a, b, cutoff)
            if d < cutoff:
                normal = self._normal(a, b, d, on_hand, on_object)
                link, piece = int(self.owner[a]), int(b - len(self._hand_geoms))
                found.append(Near(link, int(self.number[a]), piece, d, on_hand, on_object, normal))
        return found

    def clearances(self, q: Array, object_pose: Array, cutoff: float = 0.05) -> tuple[Array, Array]:
        """Signed distances [m] of the links to the object (n_links,), and of the `self_pairs` (k,)."""
        self.place(q, object_pose)
        return self._link_distances(cutoff), self._self_distances(cutoff)

    @property
    def self_pairs(self) -> list[tuple[int, int]]:
        """Pairs of links that may meet; not a parent and its child, nor two links that move as one."""
        return [pair for pair, _, _ in self._self_pairs]

    def _link_distances(self, cutoff: float) -> Array:
        out = np.full(len(self.hand.links), cutoff)
        for a, b in self._close_pairs(self._hand_geoms, self._body_geoms, cutoff):
            link = self.owner[a]
            out[link] = min(out[link], self._measure(self._model, self._data, a, b, cutoff, None))
        return out

    def _self_distances(self, cutoff: float) -> Array:
        out = np.full(len(self._self_pairs), cutoff)
        for k, (_, first, second) in enumerate(self._self_pairs):
            for a, b in self._close_pairs(first, second, cutoff):
                out[k] = min(out[k], self._measure(self._model, self._data, a, b, cutoff, None))
        return out

    def _close_pairs(self, first: Indices, second: Indices, cutoff: float) -> list[tuple[int, int]]:
        """Geom pairs whose bounding spheres are nearer than the cutoff, in order."""
        x, r = self._data.geom_xpos, self._radius
        apart = np.linalg.norm(x[first][:, None] - x[second], axis=2) - r[first][:, None] - r[second]
        return [(int(first[i]), int(second[j])) for i, j in np.argwhere(apart < cutoff)]

    def _pair(self, a: int, b: int, cutoff: float) -> tuple[float, Array, Array]:
        d = self._measure(self._model, self._data, a, b, cutoff, self._between)
        return float(d), self._between[:3].copy(), self._between[3:].copy()

    def _normal(self, a: int, b: int, d: float, on_hand: Array, on_object: Array) -> Array:
        """Unit vector from the hand into the object, even where the surfaces meet exactly."""
        if abs(d) >= TOUCHING:
            step = np.sign(d) * (on_object - on_hand)
            return step / np.linalg.norm(step)
        x = self._data.geom_xpos
        before, outwards = x[b].copy(), x[b] - x[a]
        for direction in (outwards, *np.eye(3), *-np.eye(3)):  # a little apart, the direction is clear
            if np.linalg.norm(direction) < 1e-12:
                continue
            x[b] = before + NUDGE * direction / np.linalg.norm(direction)
            d, p, s = self._pair(a, b, 10 * NUDGE)
            x[b] = before
            if abs(d) >= TOUCHING and np.linalg.norm(s - p) > 0.5 * abs(d):
                return np.sign(d) * (s - p) / np.linalg.norm(s - p)
        return outwards / max(float(np.linalg.norm(outwards)), 1e-12)

    def _link_pairs(self) -> list[tuple[tuple[int, int], Indices, Indices]]:
        """Link pairs that can meet: not in one rigid group, not parent and child group."""
        links = self.hand.links
        group: list[int] = []  # links that move as one share the index of the first
        parent: list[int] = []  # of each group: the nearest group above it that has shapes
        for i, link in enumerate(links):
            if link.parent >= 0 and not link.joints:
                group.append(group[link.parent])
                parent.append(parent[link.parent])
            else:
                group.append(i)
                above = group[link.parent] if link.parent >= 0 else -1
                while above >= 0 and not any(links[k].shapes for k in range(i) if group[k] == above):
                    above = parent[above]
                parent.append(above)
        pairs = []
        for i in range(len(links)):
            for j in range(i + 1, len(links)):
                first, second = np.flatnonzero(self.owner == i), np.flatnonzero(self.owner == j)
                adjacent = group[i] == group[j] or group[i] == parent[j] or group[j] == parent[i]
                if len(first) and len(second) and not adjacent:
                    pairs.append(((i, j), first, second))
        return pairs


def _compile(mujoco: Any, shapes: list[Shape]) -> Any:
    """One mujoco model with a geom per shape, each in its own frame."""
    kinds = mujoco.mjtGeom
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-9, 300
    for i, s in enumerate(shapes):
        w = _quaternion(s.pose[:3, :3])
        common: dict[str, Any] = {"pos": s.pose[:3, 3], "quat": w}
        body = spec.worldbody.add_body(name=f"body_{i}")
        match s.kind:
            case "mesh":
                mesh = spec.add_mesh(name=f"mesh_{i}")
                mesh.uservert = s.vertices.ravel().tolist()
                mesh.userface = s.faces.ravel().tolist()
                # a thin solid has next to no volume, which the other ways to its inertia refuse
                mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
                body.add_geom(type=kinds.mjGEOM_MESH, meshname=f"mesh_{i}", **common)
            case "box":
                body.add_geom(type=kinds.mjGEOM_BOX, size=np.array(s.size) / 2, **common)
            case "sphere":
                body.add_geom(type=kinds.mjGEOM_SPHERE, size=[s.size[0], 0, 0], **common)
            case "ellipsoid":
                body.add_geom(type=kinds.mjGEOM_ELLIPSOID, size=s.size, **common)
            case _:
                kind = kinds.mjGEOM_CAPSULE if s.kind == "capsule" else kinds.mjGEOM_CYLINDER
                body.add_geom(type=kind, size=[s.size[0], s.size[1] / 2, 0], **common)
    try:
        return spec.compile()
    except ValueError as fault:
        raise InputError(f"a solid cannot be used for collision ({' '.join(str(fault).split())})") from None


def _quaternion(R: Array) -> Array:
    """(4,) unit quaternion (w, x, y, z) of a rotation matrix."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(R).as_quat(scalar_first=True)


def checked_pose(pose: object) -> Array:
    """An object pose (4, 4); `InputError` unless it is a rigid motion."""
    return rigid(pose, "object_pose")
