"""Collision: how far a hand is from an object and from itself, apart from the contacts that are asked for.

At a requested contact the link is meant to touch, and a mesh lies a little off the smooth region that it
stands for. A pair of convex solids whose deepest point lies within a disc about such a contact is therefore
exempt there, and since a pair has one deepest point only, the rest of both surfaces is then sampled.

Limits of what is measured. Solids are convex pieces: the depth in an object of several pieces is that in
the deepest piece, at most the depth in their union. Nothing beyond the cutoff is seen. Outside its discs an exempt
pair counts from a depth of `EXEMPT_DEPTH` on, where a sample is inside; samples are about a third of a radius apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, require_positive
from handfast.core.transforms import transform
from handfast.geometry.scene import HandObjectPair, Scene, beyond_rest, checked_pose
from handfast.model.grasp import unit
from handfast.model.hand.coupling import coupled
from handfast.model.shape import Shape

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

DISC = 5e-3  # [m]
COLLISION_CUTOFF = 0.02  # [m]
ALLOWED_DEPTH = 1e-3  # [m] penetration that is let pass
EXEMPT_DEPTH = 5e-5  # [m] an exempt pair no deeper than this is not sampled
PAIR_SAMPLES = 100  # configurations in which a pair of links must overlap to count as overlapping always
GRADIENT_STEP = 1e-6  # [m] of the differences that give a surface's direction

Pair = tuple[int, int]


@dataclass(frozen=True, eq=False)
class Requested:
    """A contact that is asked for, in the hand's base frame.

    Attributes:
        link: name of the hand link that is to touch.
        point: (3,) [m].
        normal: (3,) unit, from the hand into the object.
    """

    link: str
    point: Array
    normal: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", frozen(self.point, (3,), "point"))
        object.__setattr__(self, "normal", unit(self.normal, "normal"))


@dataclass(frozen=True, eq=False)
class SeparationVector:
    """Two points that are too near to each other, or inside: what a step takes apart.

    To first order the distance grows by direction @ (motion of point_a with its link - that of point_b).

    Attributes:
        link_a: index of a hand link.
        point_a: (3,) [m] on it, base frame.
        link_b: index of another link, None for the object.
        point_b: (3,) [m] on that, base frame.
        direction: (3,) unit, base frame, in which point_a has to go.
        distance: [m], negative in penetration.
    """

    link_a: int
    point_a: Array
    link_b: int | None
    point_b: Array
    direction: Array
    distance: float


@dataclass(frozen=True, eq=False)
class Clearances:
    """How far the hand is from the object and from itself; distances in [m], negative in penetration.

    Attributes:
        links: names of the hand's links.
        to_object: (n_links,) outside the discs; the cutoff if farther. A pair that is exempt counts only
            where it penetrates outside its disc.
        requested: the link of each requested contact.
        at_contacts: (b,) inside the discs; a gap there may be underestimated.
        pairs: names of the links that may meet.
        between: (k,) of these pairs, without what may overlap as at rest; the cutoff if farther.
        left_out: pairs that overlap in the hand's model whatever its joints do, and are not judged.
        cutoff: [m].
    """

    links: tuple[str, ...]
    to_object: Array
    requested: tuple[str, ...]
    at_contacts: Array
    pairs: tuple[tuple[str, str], ...]
    between: Array
    left_out: tuple[tuple[str, str], ...]
    cutoff: float

    @property
    def nearest_link(self) -> str:
        """Name of the link of the smallest `to_object`."""
        return self.links[int(self.to_object.argmin())]

    @property
    def nearest_pair(self) -> tuple[str, str] | None:
        """Names of the links of the smallest `between`; None if none may meet."""
        return self.pairs[int(self.between.argmin())] if self.pairs else None

    @property
    def least_to_object(self) -> float:
        """Smallest of `to_object`."""
        return float(self.to_object.min(initial=self.cutoff))

    @property
    def least_at_contacts(self) -> float:
        """Smallest of `at_contacts`."""
        return float(self.at_contacts.min(initial=self.cutoff))

    @property
    def least_between(self) -> float:
        """Smallest of `between`."""
        return float(self.between.min(initial=self.cutoff))

    def free(
        self, depth: float = ALLOWED_DEPTH, at_contacts: float = ALLOWED_DEPTH, self_depth: float = ALLOWED_DEPTH
    ) -> bool:
        """Whether nothing penetrates by more than what is let pass.

        Args:
            depth: [m] into the object, outside the discs.
            at_contacts: [m] into the object, inside them.
            self_depth: [m] of one link into another.
        """
        return not self.reasons(depth, at_contacts, self_depth)

    def reasons(
        self, depth: float = ALLOWED_DEPTH, at_contacts: float = ALLOWED_DEPTH, self_depth: float = ALLOWED_DEPTH
    ) -> tuple[str, ...]:
        """Why it is not free, in words, what exceeds its allowance most first; () if it is. As `free`."""
        found = [
            (d + depth, f"{name} is {-d * 1e3:.2g} mm inside the object")
            for name, d in zip(self.links, self.to_object.tolist(), strict=True)
        ]
        found += [
            (d + at_contacts, f"{name} is {-d * 1e3:.2g} mm inside the object at contact {k}")
            for k, (name, d) in enumerate(zip(self.requested, self.at_contacts.tolist(), strict=True))
        ]
        found += [
            (d + self_depth, f"{a} meets {b} by {-d * 1e3:.2g} mm")
            for (a, b), d in zip(self.pairs, self.between.tolist(), strict=True)
        ]
        return tuple(words for excess, words in sorted(found) if excess < 0)

    def to_json(self) -> dict[str, Any]:
        """The smallest distances and where they are."""
        return {
            "to_object": self.least_to_object,
            "nearest_link": self.nearest_link,
            "at_contacts": self.at_contacts.tolist(),
            "between_links": self.least_between,
            "nearest_pair": self.nearest_pair and list(self.nearest_pair),
            "left_out": [list(pair) for pair in self.left_out],
        }


class Collisions:
    """Clearances of one hand and one object, asked for as often as needed. Not thread-safe; deterministic.

    Attributes:
        scene: as given.
        radius: [m] of the disc about a requested contact.
        cutoff: [m] nothing further apart is seen.
        left_out: pairs of links that are not judged.
        at_rest: as given; zeros otherwise.

    Args:
        left_out: `always_meeting(scene)` unless given; ask it of the hand as it is built, before a task
            narrowed its limits, if its model needs exceptions.
        at_rest: (k,) [m] of `scene.self_pairs`, by how much each may overlap, see `rest_overlaps`; none unless given.

    Raises:
        InputError: a radius or cutoff that is not positive.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        radius: float = DISC,
        cutoff: float = COLLISION_CUTOFF,
        left_out: Sequence[Pair] | None = None,
        at_rest: Array | None = None,
    ) -> None:
        for name, value in (("radius", radius), ("cutoff", cutoff)):
            require_positive(value, name, "a length above 0 [m] is needed")
        self.scene, self.radius, self.cutoff = scene, radius, cutoff
        self.left_out = tuple(always_meeting(scene) if left_out is None else left_out)
        self.at_rest = np.zeros(len(scene.self_pairs)) if at_rest is None else at_rest
        self._judged = tuple(pair for pair in scene.self_pairs if pair not in self.left_out)
        self._row = {pair: k for k, pair in enumerate(self._judged)}
        self._judged_at_rest = self.at_rest[[k for k, pair in enumerate(scene.self_pairs) if pair in self._row]]
        self._judged_names, self._left_out_names = self._named(self._judged), self._named(self.left_out)
        self._surfaces: dict[Pair, _SampledSurface] = {}

    def clearances(self, q: Array, object_pose: Array, requested: Sequence[Requested] = ()) -> Clearances:
        """How far the hand at q (l,) is from the object at `object_pose` (4, 4), base frame, and from itself.

        Raises:
            InputError: a pose that is not rigid, a requested contact of an unknown link.
        """
        object_pairs, self_pairs = self.scene.pairs(q, checked_pose(object_pose), self.cutoff)
        apart, at_contacts = self._apart(object_pairs, requested)
        to_object = np.full(len(self.scene.hand.links), self.cutoff)
        for p in apart:
            to_object[p.link_a] = min(to_object[p.link_a], p.distance)
        between = np.full(len(self._judged), self.cutoff)
        for m in self_pairs:
            k = self._row.get((m.first, m.second))
            if k is not None:
                between[k] = min(between[k], m.distance)
        between = beyond_rest(between, self._judged_at_rest)
        return Clearances(
            self.scene.hand.link_names,
            to_object,
            tuple(r.link for r in requested),
            at_contacts,
            self._judged_names,
            between,
            self._left_out_names,
            self.cutoff,
        )

    def separations(
        self, q: Array, object_pose: Array, requested: Sequence[Requested] = (), margin: float = ALLOWED_DEPTH
    ) -> list[SeparationVector]:
        """What is nearer than `margin` [m] and should not be, deepest first; discs and pairs as in `clearances`.

        Raises:
            InputError: as `clearances`, and a margin beyond the cutoff.
        """
        if not margin <= self.cutoff:
            raise InputError(f"is {margin:g}; beyond the cutoff of {self.cutoff:g} m nothing is seen", field="margin")
        reach = max(margin, GRADIENT_STEP)
        object_pairs, self_pairs = self.scene.pairs(q, checked_pose(object_pose), reach)
        found, _ = self._apart(object_pairs, requested)
        for m in (m for m in self_pairs if (m.first, m.second) in self._row):
            beyond = m.distance + self._judged_at_rest[self._row[m.first, m.second]]
            if m.distance >= 0 or beyond < 0:  # else as at rest
                distance = m.distance if m.distance >= 0 else beyond
                found.append(SeparationVector(m.first, m.on_first, m.second, m.on_second, -m.normal, distance))
        return sorted((p for p in found if p.distance < margin), key=lambda p: p.distance)

    def _named(self, pairs: Sequence[Pair]) -> tuple[tuple[str, str], ...]:
        return tuple((self.scene.hand.link_names[a], self.scene.hand.link_names[b]) for a, b in pairs)

    def _apart(
        self, near: list[HandObjectPair], requested: Sequence[Requested]
    ) -> tuple[list[SeparationVector], Array]:
        """Object pairs outside the discs, and the distance inside each disc, as the scene is placed."""
        owner = [self.scene.hand.link(r.link) for r in requested]
        found, inside = [], np.full(len(requested), np.inf)
        for n in near:
            discs = [k for k, link in enumerate(owner) if link == n.link and self._in_disc(n, requested[k])]
            if not discs:
                found.append(SeparationVector(n.link, n.on_hand, None, n.on_object, -n.normal, n.distance))
                continue
            inside[discs] = np.minimum(inside[discs], n.distance)
            if n.distance < -EXEMPT_DEPTH:
                own = np.array([r.point for r, link in zip(requested, owner, strict=True) if link == n.link])
                found += self._rest(n, own)
        for k in np.flatnonzero(np.isinf(inside)).tolist():  # its nearest point is somewhere else
            inside[k] = self._gap(owner[k], requested[k].point)
        return found, inside

    def _in_disc(self, n: HandObjectPair, r: Requested) -> bool:
        """Whether a pair meets at a requested contact, and from the right side."""
        off = (n.on_hand + n.on_object) / 2 - r.point
        return bool(off @ off <= self.radius**2 and n.normal @ r.normal >= 0)

    def _gap(self, link: int, point: Array) -> float:
        """[m] between a link and the object at a point on or near both, at most the cutoff."""
        shapes = self.scene.hand.links[link].shapes
        if not shapes:
            return self.cutoff
        mine, its = _at(self.scene.placed[link], point), _at(self.scene.placed[-1], point)
        depth = max(s.depth(mine)[0] for s in shapes) + max(s.depth(its)[0] for s in self.scene.body.pieces)
        return float(min(-depth, self.cutoff))

    def _rest(self, n: HandObjectPair, points: Array) -> list[SeparationVector]:
        """Where an exempt pair is deepest further than the radius from the link's contact points; [] if nowhere."""
        scene, depth, found = self.scene, 0.0, (np.zeros(3), 0)
        solids = (scene.hand.links[n.link].shapes[n.shape], scene.body.pieces[n.piece])
        poses = (scene.placed[n.link], scene.placed[-1])
        surfaces = (self._surface((n.link, n.shape), solids[0]), self._surface((-1, n.piece), solids[1]))
        for one, other, behind in ((0, 1, n.normal @ n.on_object), (1, 0, -n.normal @ n.on_hand)):
            x = surfaces[one].about(surfaces[other], _local(poses[one], poses[other]))
            x = x @ poses[one][:3, :3].T + poses[one][:3, 3]
            along = x @ n.normal if other else -x @ n.normal  # all that overlaps is in the slab of the deepest points
            x = x[along >= behind - GRADIENT_STEP]
            x = x[(((x[:, None] - points) ** 2).sum(axis=2) > self.radius**2).all(axis=1)]
            if len(x):
                inside = solids[other].depth(_at(poses[other], x))
                if inside.max() > depth:
                    depth, found = float(inside.max()), (x[inside.argmax()], other)
        x, other = found
        if not depth:
            return []
        out = poses[other][:3, :3] @ _outwards(solids[other], _at(poses[other], x))[0]
        if other:  # a point of the hand is inside the object
            return [SeparationVector(n.link, x, None, x + depth * out, out, -depth)]
        return [SeparationVector(n.link, x + depth * out, None, x, -out, -depth)]

    def _surface(self, key: Pair, shape: Shape) -> _SampledSurface:
        if key not in self._surfaces:
            self._surfaces[key] = _SampledSurface(samples(shape, self.radius / 3))
        return self._surfaces[key]


def always_meeting(scene: Scene) -> tuple[Pair, ...]:
    """Pairs of `scene.self_pairs` that overlap at every one of `PAIR_SAMPLES` configurations within the limits.

    They are drawn uniformly, mimic joints following their drivers. Such an overlap is a fault of the
    collision model, not of a configuration. Links that no joint moves against each other within its limits
    are no such pair: a task that fixes two fingers in each other is at fault itself.
    """
    hand, rng = scene.hand, np.random.default_rng(0)
    lower, upper = hand.limits.T
    free = {j for j in range(hand.l) if lower[j] < upper[j]}
    left = {p for p in scene.self_pairs if free & (set(hand.moved_by(p[0])) ^ set(hand.moved_by(p[1])))}
    for _ in range(PAIR_SAMPLES):
        if not left:
            break
        q = np.clip(coupled(hand, lower + rng.random(hand.l) * (upper - lower)), lower, upper)
        left &= {(m.first, m.second) for m in scene.self_collisions(q, GRADIENT_STEP) if m.distance < 0}
    return tuple(sorted(left))


# --- surfaces ---------------------------------------------------------------------------------------


class _SampledSurface:
    """Points on a solid, ready to be asked which of them lie about another solid."""

    def __init__(self, points: Array) -> None:
        from scipy.spatial import cKDTree

        self.points = points
        self.middle = (points.min(axis=0) + points.max(axis=0)) / 2
        self.radius = float(np.linalg.norm(points - self.middle, axis=1).max())
        self._tree: cKDTree = cKDTree(points)

    def about(self, other: _SampledSurface, pose: Array) -> Array:
        """(n, 3) the points within the bounding sphere of another surface at `pose` (4, 4), own frame."""
        middle = pose[:3, :3] @ other.middle + pose[:3, 3]
        return self.points[self._tree.query_ball_point(middle, other.radius)]


def samples(shape: Shape, spacing: float) -> Array:
    """(n, 3) [m] points on a solid's surface, corners among them, about `spacing` apart, carrier's frame."""
    vertices, faces = shape.triangles()
    corners = vertices[faces]
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    turned = (sides.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, apex = np.take_along_axis(corners, turned[:, :, None], axis=1).swapaxes(0, 1)  # a to b is the longest side
    long = sides.max(axis=1)
    height = np.linalg.norm(np.cross(b - a, apex - a), axis=1) / long
    counts = np.ceil(np.column_stack([long, height]) / spacing).astype(int)
    points = []
    for k, (along, up) in enumerate(counts):
        u, t = np.arange(along + 1)[:, None, None] / along, np.arange(up)[:, None] / max(up, 1)
        points.append(((1 - t) * (a[k] + u * (b[k] - a[k])) + t * apex[k]).reshape(-1, 3))
    inner = np.vstack(points)
    cells = ((inner - inner.min(axis=0)) / spacing).round().astype(int)  # one of each: the rows crowd at an apex
    _, first = np.unique(np.ravel_multi_index(cells.T, cells.max(axis=0) + 1), return_index=True)
    found = np.vstack([vertices, inner[np.sort(first)]])
    if shape.kind not in ("box", "mesh"):  # facets lie a little below the curve
        found += shape.depth(found)[:, None] * _outwards(shape, found)
    return found


def _outwards(shape: Shape, points: Array) -> Array:
    """(n, 3) unit directions in which (n, 3) or (3,) points leave a solid soonest, carrier's frame."""
    p = np.atleast_2d(points)
    steps = GRADIENT_STEP * np.eye(3)
    slope = np.stack([shape.depth(p - e) - shape.depth(p + e) for e in steps], axis=1)
    length = np.linalg.norm(slope, axis=1, keepdims=True)
    away = p - shape.centroid  # where all directions are equal
    other = away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
    return np.where(length > GRADIENT_STEP * 1e-3, slope / np.maximum(length, 1e-15), other)


def _at(pose: Array, points: Array) -> Array:
    """Points (..., 3) of the base frame in the frame at `pose` (4, 4)."""
    return (points - pose[:3, 3]) @ pose[:3, :3]


def _local(pose: Array, other: Array) -> Array:
    """(4, 4) one pose of the base frame in the frame at another."""
    return transform(_at(pose, other[:3, 3]), pose[:3, :3].T @ other[:3, :3])
