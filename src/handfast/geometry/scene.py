"""Scene: distances between the links of a hand, and between them and an object, by mujoco's collider."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.libraries import quiet
from handfast.core.transforms import matrix_quaternion, quaternion_matrix, rigid, transform
from handfast.model.body import Body
from handfast.model.grasp import NORMAL_TOLERANCE
from handfast.model.hand.anatomy import Anatomy, rigid_groups
from handfast.model.hand.hand import Hand
from handfast.model.shape import Shape

Indices = NDArray[np.intp]

PoseLike = Array | tuple[Sequence[float] | Array, Sequence[float] | Array]
"""A rigid motion: (4, 4), or a position (3,) [m] and a unit quaternion (w, x, y, z)."""

TOUCHING_DISTANCE = 1e-7  # [m] below this the two nearest points no longer give a direction
NUDGE = 1e-6  # [m]
OVERLAP_CUTOFF = 1e-3  # [m] what is further apart does not overlap
FAR_POSE = transform(np.full(3, 1e3), np.eye(3))  # a place of the object where no hand reaches


@dataclass(frozen=True, eq=False)
class HandObjectPair:
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


@dataclass(frozen=True, eq=False)
class SelfCollisionPair:
    """The nearest points of shapes of two links of the hand that may meet.

    Attributes:
        first, second: indices of the links, one of `Scene.self_pairs`.
        distance: [m], negative in penetration.
        on_first, on_second: (3,) [m], base frame.
        normal: (3,) unit, base frame, from the first into the second.
    """

    first: int
    second: int
    distance: float
    on_first: Array
    on_second: Array
    normal: Array


class Scene:
    """A hand and an object, compiled once and placed as often as needed. Frame: the hand's base.

    Distances are mujoco's, to about 1e-9 m for polyhedra and primitives; only pairs whose bounding
    spheres are nearer than the cutoff are evaluated. Not thread-safe; deterministic.

    Attributes:
        hand, body: as given.
        self_pairs: pairs of links that may meet: not a parent and its child, nor two that move as one,
            nor the hand's `non_colliding`, nor `ignored`.
        link_radius: (n_links,) [m], of a sphere about each link's origin that holds its shapes.
        placed: (n_links + 1, 4, 4) the links' poses as last placed and the object's, base frame.

    Args:
        ignored: pairs of links, by name, that are not looked at together.

    Raises:
        InputError: a shape that mujoco cannot take as a convex solid, an ignored link that the hand does not have.
    """

    def __init__(self, hand: Hand, body: Body, ignored: Iterable[tuple[str, str]] = ()) -> None:
        import mujoco  # slow to import

        self.hand, self.body = hand, body
        owners = [i for i, link in enumerate(hand.links) for _ in link.shapes]
        self.owner = np.array(owners + [-1] * len(body.pieces))
        self.number = np.array([k for link in hand.links for k in range(len(link.shapes))])
        shapes = [s for link in hand.links for s in link.shapes] + list(body.pieces)
        self._model = _compile(mujoco, shapes)
        self._data = mujoco.MjData(self._model)
        self._measure = mujoco.mj_geomDistance
        m = self._model
        self._local = np.array(
            [transform(p, quaternion_matrix(r)) for p, r in zip(m.geom_pos, m.geom_quat, strict=True)]
        )
        self._between = np.zeros(6)
        self._radius = m.geom_rbound.copy()
        self.placed = np.tile(np.eye(4), (len(hand.links) + 1, 1, 1))
        mine, its = np.flatnonzero(self.owner >= 0), np.flatnonzero(self.owner < 0)
        self._to_object = (np.repeat(mine, len(its)), np.tile(its, len(mine)))
        self.ignored = tuple(ignored)
        left_out = {frozenset(map(hand.link, pair)) for pair in self.ignored}
        self.self_pairs = [pair for pair in self._meeting_links() if frozenset(pair) not in left_out]
        both = [(a, b, k) for k, (i, j) in enumerate(self.self_pairs) for a in self._of(i) for b in self._of(j)]
        self._to_self = tuple(np.array(both, dtype=int).reshape(-1, 3).T)
        reach = np.linalg.norm(self._local[:, :3, 3], axis=1) + self._radius
        self.link_radius = np.array([max([0.0, *reach[self._of(i)]]) for i in range(len(hand.links))])

    def place(self, q: Array, object_pose: Array) -> None:
        """Put the hand at q (l,) and the object at its pose (4, 4) in the hand's base frame."""
        self.placed = np.concatenate([self.hand.link_poses(q), np.asarray(object_pose, dtype=float)[None]])
        world = self.placed[self.owner] @ self._local  # owner -1, the object, is the last pose
        self._data.geom_xpos[:] = world[:, :3, 3]
        self._data.geom_xmat[:] = world[:, :3, :3].reshape(-1, 9)

    def distance(self, q: Array, object_pose: Array, cutoff: float = 0.05) -> Array:
        """(n_links,) [m] signed distance of each link to the object; `cutoff` if further or without shape."""
        self.place(q, object_pose)
        return self._link_distances(cutoff)

    def nearest(self, q: Array, object_pose: Array, cutoff: float) -> list[HandObjectPair]:
        """Every pair of hand shape and object piece nearer than `cutoff` [m], in the order of the shapes."""
        self.place(q, object_pose)
        return self._nearest(cutoff)

    def pairs(
        self, q: Array, object_pose: Array, cutoff: float
    ) -> tuple[list[HandObjectPair], list[SelfCollisionPair]]:
        """`nearest`, and every pair of shapes of two links that may meet and are nearer than `cutoff` [m]."""
        self.place(q, object_pose)
        return self._nearest(cutoff), self._self_collisions(cutoff)

    def self_collisions(self, q: Array, cutoff: float) -> list[SelfCollisionPair]:
        """Every pair of shapes of two links that may meet and are nearer than `cutoff` [m]."""
        self.place(q, self.placed[-1])
        return self._self_collisions(cutoff)

    def clearances(self, q: Array, object_pose: Array, cutoff: float = 0.05) -> tuple[Array, Array]:
        """Signed distances [m] of the links to the object (n_links,), and of the `self_pairs` (k,)."""
        self.place(q, object_pose)
        return self._link_distances(cutoff), self._self_distances(cutoff)

    def _nearest(self, cutoff: float) -> list[HandObjectPair]:
        found = []
        for _, a, b, nearest in self._met(self._to_object, cutoff):
            found.append(HandObjectPair(int(self.owner[a]), int(self.number[a]), b - len(self.number), *nearest))
        return found

    def _self_collisions(self, cutoff: float) -> list[SelfCollisionPair]:
        first, second, pair = self._to_self
        found = []
        for i, _, _, nearest in self._met((first, second), cutoff):
            one, other = self.self_pairs[pair[i]]
            found.append(SelfCollisionPair(one, other, *nearest))
        return found

    def _met(
        self, pairs: tuple[Indices, Indices], cutoff: float
    ) -> Iterator[tuple[int, int, int, tuple[float, Array, Array, Array]]]:
        """Pairs of geoms nearer than the cutoff: number, geoms, distance, point on each, normal into the second."""
        for i in self._close(pairs, cutoff):
            a, b = int(pairs[0][i]), int(pairs[1][i])
            d, on_first, on_second = self._pair(a, b, cutoff)
            if d < cutoff:
                yield i, a, b, (d, on_first, on_second, self._normal(a, b, d, on_first, on_second))

    def _link_distances(self, cutoff: float) -> Array:
        out = np.full(len(self.hand.links), cutoff)
        hand, body = self._to_object
        for i in self._close(self._to_object, cutoff):
            d = self._measure(self._model, self._data, hand[i], body[i], cutoff, None)
            out[self.owner[hand[i]]] = min(out[self.owner[hand[i]]], d)
        return out

    def _self_distances(self, cutoff: float) -> Array:
        out = np.full(len(self.self_pairs), cutoff)
        first, second, pair = self._to_self
        for i in self._close((first, second), cutoff):
            out[pair[i]] = min(out[pair[i]], self._measure(self._model, self._data, first[i], second[i], cutoff, None))
        return out

    def _of(self, link: int) -> Indices:
        """The geoms of a link."""
        return np.flatnonzero(self.owner == link)

    def _close(self, pairs: tuple[Indices, ...], cutoff: float) -> Indices:
        """Which pairs of geoms have bounding spheres nearer than the cutoff."""
        first, second = pairs
        x, r = self._data.geom_xpos, self._radius
        reach = cutoff + r[first] + r[second]
        return np.flatnonzero(((x[first] - x[second]) ** 2).sum(axis=1) < reach**2)

    def _pair(self, a: int, b: int, cutoff: float) -> tuple[float, Array, Array]:
        d = self._measure(self._model, self._data, a, b, cutoff, self._between)
        return float(d), self._between[:3].copy(), self._between[3:].copy()

    def _normal(self, a: int, b: int, d: float, on_hand: Array, on_object: Array) -> Array:
        """Unit vector from the hand into the object, even where the surfaces meet exactly."""
        if abs(d) >= TOUCHING_DISTANCE:
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
            if abs(d) >= TOUCHING_DISTANCE and np.linalg.norm(s - p) > 0.5 * abs(d):
                return np.sign(d) * (s - p) / np.linalg.norm(s - p)
        return outwards / max(float(np.linalg.norm(outwards)), 1e-12)

    def _meeting_links(self) -> list[tuple[int, int]]:
        """Link pairs that can meet: not in one rigid group, not parent and child group, not excluded by the hand."""
        links = self.hand.links
        group = rigid_groups(self.hand)
        parent: list[int] = []  # of each group: the nearest group above it that has shapes
        for i, link in enumerate(links):
            if group[i] != i:
                parent.append(parent[link.parent])
            else:
                above = group[link.parent] if link.parent >= 0 else -1
                while above >= 0 and not any(links[k].shapes for k in range(i) if group[k] == above):
                    above = parent[above]
                parent.append(above)
        pairs = []
        for i in range(len(links)):
            for j in range(i + 1, len(links)):
                adjacent = group[i] == group[j] or group[i] == parent[j] or group[j] == parent[i]
                free = self.hand.may_collide(links[i].name, links[j].name)
                if links[i].shapes and links[j].shapes and free and not adjacent:
                    pairs.append((i, j))
        return pairs


def _compile(mujoco: Any, shapes: list[Shape]) -> Any:
    """One mujoco model with a geom per shape, each in its own frame."""
    spec = mujoco.MjSpec()
    spec.option.ccd_tolerance = 1e-9
    for i, s in enumerate(shapes):
        # a thin solid has next to no volume, which other ways to a mesh's inertia refuse
        shell = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        add_solid(spec, spec.worldbody.add_body(name=f"body_{i}"), f"solid_{i}", s, inertia=shell)
    try:
        with quiet():
            return spec.compile()
    except (ValueError, mujoco.FatalError) as fault:
        raise InputError(f"a solid cannot be used for collision ({' '.join(str(fault).split())})") from None


def add_solid(
    spec: Any, body: Any, name: str, shape: Shape, *, length: float = 1.0, inertia: Any = None, **geom: Any
) -> None:
    """Add a solid to a body of a `mujoco.MjSpec` whose frame is that of the solid's carrier.

    Args:
        length: [m] that is 1 in the model.
        inertia: how that of a mesh is found, of its convex hull unless given.
        geom: further attributes of the geom.
    """
    import mujoco

    size, given = np.zeros(3), np.array(shape.size) / length
    if shape.kind == "box":
        size[:] = given / 2
    elif shape.kind in ("capsule", "cylinder"):
        size[:2] = given[0], given[1] / 2
    else:
        size[: len(given)] = given
    if shape.kind == "mesh":
        spec.add_mesh(
            name=name,
            uservert=(shape.vertices / length).ravel().tolist(),
            userface=shape.faces.ravel().tolist(),
            inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX if inertia is None else inertia,
        )
        geom["meshname"] = name
    body.add_geom(
        name=name,
        type=getattr(mujoco.mjtGeom, f"mjGEOM_{shape.kind.upper()}"),
        size=size.tolist(),
        pos=(shape.pose[:3, 3] / length).tolist(),
        quat=matrix_quaternion(shape.pose[:3, :3]).tolist(),
        **geom,
    )


def checked_pose(pose: object) -> Array:
    """An object pose (4, 4), also from a position and a quaternion; `InputError` unless it is a rigid motion."""
    if isinstance(pose, tuple | list) and len(pose) == 2:
        position = frozen(pose[0], (3,), "object_pose.position")
        quaternion = frozen(pose[1], (4,), "object_pose.quaternion")
        length = float(np.linalg.norm(quaternion))
        if abs(length - 1) > NORMAL_TOLERANCE:
            problem = f"has length {length:.4g}; a unit quaternion w, x, y, z is needed"
            raise InputError(problem, field="object_pose.quaternion")
        return rigid(transform(position, quaternion_matrix(quaternion)), "object_pose")
    return rigid(pose, "object_pose")


def checked_joints(hand: Hand, q: Any, field: str = "q") -> Array:
    """A configuration (l,), also from values by joint name; `InputError` for other counts, names or numbers."""
    if isinstance(q, Mapping):
        try:
            return hand.configuration(q)
        except InputError as fault:
            raise fault.within(field) from None
    if np.shape(q) != (hand.l,) or not np.isfinite(np.asarray(q, dtype=float)).all():
        raise InputError(f"needs {hand.l} finite joint values, in the order of the hand's joints", field=field)
    return np.asarray(q, dtype=float)


def rest_overlaps(scene: Scene, *, at_zero: bool = False) -> Array:
    """(k,) [m] overlaps of the scene's pairs of links in the hand at rest (`Anatomy.neutral`), 0 if there is none.

    Args:
        at_zero: of pairs that joints at 0 hold so, no others: where limits may have been narrowed since the hand was
            read, a joint that is not at 0 need not be at rest.
    """
    hand = scene.hand
    rest = Anatomy.of(hand).neutral
    overlaps = np.maximum(0.0, -scene.clearances(rest, FAR_POSE, OVERLAP_CUTOFF)[1])
    if at_zero:
        turned = set(np.flatnonzero(rest).tolist())
        moved = [bool(turned & (set(hand.moved_by(a)) ^ set(hand.moved_by(b)))) for a, b in scene.self_pairs]
        overlaps[moved] = 0.0
    return overlaps


def beyond_rest(between: Array, at_rest: Array) -> Array:
    """Distances of pairs [m], negative in penetration, without what overlaps at rest."""
    return np.where(between < 0, np.minimum(0.0, between + at_rest), between)
