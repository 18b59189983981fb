"""Where a hand may start: palm poses around an object and pre-shapes, drawn at random and pushed up to the object.

Nothing here knows a particular hand: which way a hand reaches follows from where its fingertips go when it
closes. A gripper of two jaws starts around two points of the object that press against each other. All of this is a
heuristic; what becomes of a start is evaluated afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame, transform
from handfast.geometry.scene import Scene
from handfast.model.hand.anatomy import MIDWAY, Anatomy
from handfast.model.hand.hand import Hand, Link
from handfast.model.shape import Shape
from handfast.planning.candidates.surface import SurfaceSampler, near, turned
from handfast.planning.closing import waiting

JAWS = 2  # fingers of a gripper
CHOICES = 3  # places for its jaws, of which that nearest to the centre of mass may be taken
NEUTRAL = 2  # power that draws a joint towards rest: with 2, the mean deviation is a third of the largest
MEETING_SHARE = 0.75  # share of closing at which the fingertips meet
MIN_STEP_BACK = 2e-3  # [m] least step back of a gripper
PUSH_DISTANCE = 2e-4  # [m] the push ends when the hand is this near
SIDEWAYS = 10  # points drawn to find a side of the object
MIN_SIDE_SINE = 0.5  # sine of the angle between a direction and the normal of a side of it, at least
CLOSING_LOOKS = 10  # of closing that are looked at
NEARBY = 0.01  # [m]
PALM_CUTOFF = 0.05  # [m] distances beyond this are not computed
DRAWS = 20  # of a point, until another is opposite to it
JAW_FACE_DEPTH = 2e-3  # [m] what of a jaw is so near to its innermost point is its face
JAW_COSINE = 0.8  # cosine of the angle of its normals to the other jaw
MIN_PALM_DIRECTION = 1e-6  # length, or sine, below which a direction is none


@dataclass(frozen=True)
class Sampling:
    """How starts are drawn.

    Attributes:
        cone: [rad] the palm's approach is drawn this far about the hand's axis.
        tilt: [rad] and it points this far about the direction into the object, against the normal.
        aside: [m] standard deviation of the offset of the hand's centre from the surface point.
        opening: the pre-shape is closed by at most this share of the joints' ranges ..
        jitter: .. with this standard deviation from joint to joint.
        back: [m] mean of the step back after the push, exponential.
        aligned: share of the starts that approach straight along the hand's axis and against the normal, rolled
            so that the fingertips close against the normal of another point of the surface: for flat sides.
        central: share of the starts whose surface point is drawn towards the centre of mass by a random part of
            the way: for long objects.
        approach: (3,) direction in which the palm approaches, hand's base frame; None for what `palm_of` guesses.
    """

    cone: float = np.radians(40)
    tilt: float = np.radians(20)
    aside: float = 0.01
    opening: float = 0.6
    jitter: float = 0.1
    back: float = 0.02
    aligned: float = 0.5
    central: float = 0.5
    approach: tuple[float, ...] | None = field(default=None, repr=False)  # a palm shows it


STANDARD = Sampling()


@dataclass(frozen=True, eq=False)
class Palm:
    """Where a hand grasps and which way it approaches. Frame: the hand's base.

    Attributes:
        center: (3,) [m] in the middle of the half-closed fingertips; of a gripper, between the faces of its jaws.
        axis: (3,) unit, out of the palm's face to the centre: the way the palm approaches an object.
        opened, closed: (l,) configurations with every closing joint at its two ends, the others as `Anatomy.ends` says.
        anatomy: fingers, wrist and palm.
    """

    center: Array
    axis: Array
    opened: Array
    closed: Array
    anatomy: Anatomy = field(repr=False)

    @property
    def tips(self) -> tuple[int, ...]:
        """The fingertips that a closing joint moves."""
        hand = self.anatomy.hand
        return tuple(i for i in self.anatomy.tips if any(hand.closing[j] for j in hand.moved_by(i)))

    @property
    def jaws(self) -> bool:
        """Whether it is a gripper's, of two fingers that one joint or linkage moves each."""
        return len({self.anatomy.finger(i) for i in self.tips}) == JAWS == len(self.tips)


@dataclass(frozen=True, eq=False)
class PreShape:
    """A pre-shape, from which the hand is pushed up to an object.

    Attributes:
        q: (l,) configuration.
        pose: (4, 4) of the object, approach: (3,) unit, of the palm, both in the hand's base frame.
        around: whether the push ends at that pose, the object between the jaws, unless something touches before.
    """

    q: Array
    pose: Array
    approach: Array
    around: bool = False


def palm_of(hand: Hand, approach: object = None) -> Palm:
    """Where the palm is and which way it approaches, from its solids and the closing senses.

    It approaches out of its face: along the normals of its solids that are seen from where the fingertips meet.

    Args:
        approach: (3,) in place of the axis, base frame, any length.

    Raises:
        InputError: no joint that closes or no fingertip with a solid, a zero approach.
    """
    anatomy = Anatomy.of(hand)
    opened, closed = anatomy.ends(hand.closing)
    half = anatomy.within(opened + MIDWAY * (closed - opened))
    palm = Palm(np.zeros(3), np.zeros(3), opened, closed, anatomy)
    if not palm.tips:
        raise InputError("no link with a solid is moved by a closing joint; give closing senses", field="closing")
    points = Pads.of(anatomy, palm.tips, half).points if palm.jaws else anatomy.middles(half, palm.tips)
    center = points.mean(axis=0)
    axis = _out_of_face(palm) if approach is None else frozen(approach, (3,), "approach")
    if np.linalg.norm(axis) < 1e-9:
        raise InputError("is zero; the direction in which the palm approaches is needed", field="approach")
    return replace(palm, center=center, axis=axis / np.linalg.norm(axis))


def _out_of_face(palm: Palm) -> Array:
    """(3,) the mean normal of the palm's solids as seen from where the fingertips meet, each face by its solid angle.

    Where none is seen, as that is in a solid, the direction from their middle.
    """
    anatomy = palm.anatomy
    q = anatomy.within(palm.opened + MEETING_SHARE * (palm.closed - palm.opened))
    point = anatomy.middles(q, palm.tips).mean(axis=0)
    if not anatomy.palm:
        return np.asarray(point)
    poses = anatomy.hand.link_poses(q)
    solids = [(poses[i], *shape.triangles()) for i in anatomy.palm for shape in anatomy.hand.links[i].shapes]
    a, b, c = np.vstack([(vertices @ T[:3, :3].T + T[:3, 3])[faces] for T, vertices, faces in solids]).swapaxes(0, 1)
    normals = np.cross(b - a, c - a)  # as long as twice the area
    away = point - (a + b + c) / 3
    angles = np.maximum(np.einsum("ij,ij->i", normals, away), 0.0) / np.linalg.norm(away, axis=1) ** 3
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    seen = (angles / lengths) @ normals
    middle = np.asarray(point - anatomy.middles(q, anatomy.palm).mean(axis=0))
    return np.asarray(seen) if seen @ middle > 0 else middle


def draw(rng: np.random.Generator, hand: Hand, palm: Palm, surface: SurfaceSampler, how: Sampling) -> PreShape:
    """A random start, the hand's centre on a point of the object's surface: the hand is to be pushed up from afar."""
    q = _preshape(rng, hand, palm, how)
    start = _between_jaws(rng, palm, q, surface, how) if palm.jaws else None
    if start:
        return start
    point, normal = surface.draw(rng)
    if how.aligned and rng.random() < how.aligned:
        approach, R = palm.axis, _squarely(rng, palm, surface, q, normal)
    else:
        into = near(rng, -normal, how.tilt)
        approach = near(rng, palm.axis, how.cone)
        R = turned(into, approach, rng.uniform(0, 2 * np.pi))
    if how.central and rng.random() < how.central:
        point = surface.middle + rng.random() * (point - surface.middle)
    point = point + how.aside * rng.standard_normal(3)
    return PreShape(q, transform(palm.center - R @ point, R), approach)


def _between_jaws(
    rng: np.random.Generator, palm: Palm, q: Array, surface: SurfaceSampler, how: Sampling
) -> PreShape | None:
    """Two points of the object that press against each other, between the jaws; None if there are none.

    The palm comes from anywhere around the line on which they lie, in a share of the starts square to another side. A
    share is drawn to the centre of mass: of a few pairs they take that whose middle is nearest.
    """
    pads = Pads.of(palm.anatomy, palm.tips, q)
    draws = CHOICES if rng.random() < how.central else 1
    pairs = [antipodal(rng, surface, pads.width) for _ in range(draws)]
    found = min((p for p in pairs if p), key=lambda p: float(np.linalg.norm(p[0] - surface.middle)), default=None)
    if found is None:
        return None
    middle, line = found
    square = rng.random() < how.aligned
    seen = (_aside(rng, surface, line), -palm.axis) if square else None
    R = squeezed(pads.line, line, seen, rng.uniform(0, 2 * np.pi))
    depth = how.aside * rng.standard_normal()
    return PreShape(q, transform(palm.center + depth * palm.axis - R @ middle, R), palm.axis, around=True)


def _aside(rng: np.random.Generator, surface: SurfaceSampler, line: Array) -> Array:
    """(3,) a normal of the object, of a side on which a line through it does not come out, if there is one."""
    for _ in range(SIDEWAYS):
        normal = surface.draw(rng)[1]
        if np.linalg.norm(np.cross(normal, line)) > MIN_SIDE_SINE:
            break
    return normal


def _preshape(rng: np.random.Generator, hand: Hand, palm: Palm, how: Sampling) -> Array:
    """(l,) closing joints up to some share closed, abductions near rest, spreads anywhere, the wrist at rest.

    A gripper of two jaws starts open: it has no other pre-shape, and the object has to fit between them.
    """
    share = np.clip(how.opening * rng.random() + how.jitter * rng.standard_normal(hand.l), 0.0, 1.0)
    share *= not palm.jaws
    share[list(waiting(hand))] = 0.0  # straight until the finger touches
    q = palm.opened + share * (palm.closed - palm.opened)
    lower, upper = hand.limits.T
    rest, drawn = palm.anatomy.neutral, rng.random(hand.l)
    off = 2 * drawn - 1
    near = rest + np.abs(off) ** NEUTRAL * np.where(off > 0, upper - rest, lower - rest)
    abducts = (lower < rest) & (rest < upper)
    still = np.where(abducts, near, lower + drawn * (upper - lower))
    fixed = [*palm.anatomy.wrist, *hand.idle]
    still[fixed] = rest[fixed]
    return palm.anatomy.within(np.where(hand.closing == 0, still, q))


def calmer(palm: Palm, q: Array, share: float) -> Array:
    """q (l,) with the joints that neither close nor spread, but bend both ways, a share of the way from rest."""
    lower, upper = palm.anatomy.hand.limits.T
    rest = palm.anatomy.neutral
    abducts = (palm.anatomy.hand.closing == 0) & (lower < rest) & (rest < upper)
    return palm.anatomy.within(np.where(abducts, rest + share * (q - rest), q))


def pushed(scene: Scene, start: PreShape, back: float) -> Array | None:
    """The object's pose (4, 4) once the hand was pushed along its approach up to the object, then `back` [m].

    Every step of the push is as long as the distance that is left, so that no surface is passed. Jaws end where the
    object is between them; if something touches before, they step back by a part only, as they are short. None if the
    hand passes the object by.
    """
    size = float(np.linalg.norm(scene.body.vertices - scene.body.center_of_mass, axis=1).max())
    reach = float(np.linalg.norm(scene.hand.link_poses(start.q)[:, :3, 3], axis=1).max() + scene.link_radius.max())
    pose = start.pose.copy()
    ahead = size + reach + float(np.linalg.norm(start.pose[:3, 3]))
    last = 0.0 if start.around else -ahead
    while ahead > last:
        pose[:3, 3] = start.pose[:3, 3] + ahead * start.approach
        gap = scene.distance(start.q, pose, PALM_CUTOFF).min()
        if gap < PUSH_DISTANCE:
            pose[:3, 3] += (MIN_STEP_BACK + back / 4 if start.around else back) * start.approach
            return pose
        ahead -= gap
    return start.pose if start.around else None


def sweeps(scene: Scene, anatomy: Anatomy, q: Array, pose: Array) -> NDArray[np.bool_]:
    """(n_links,) which links come near the object in a few steps of closing that nothing stops.

    A quick look ahead; between the steps and behind what stops, it may be wrong either way.
    """
    hand = scene.hand
    near = np.zeros(len(hand.links), dtype=bool)
    lower, upper = hand.limits.T
    room = np.where(hand.closing > 0, upper - q, np.where(hand.closing < 0, q - lower, 0.0))
    for share in np.linspace(0.0, 1.0, CLOSING_LOOKS):
        near |= scene.distance(anatomy.within(q + share * room * hand.closing), pose, 2 * NEARBY) < NEARBY
    return near


def _squarely(rng: np.random.Generator, palm: Palm, surface: SurfaceSampler, q: Array, normal: Array) -> Array:
    """(3, 3) the approach against a normal, rolled so that the widest-apart fingertips face another normal."""
    tips = palm.anatomy.middles(q, palm.tips)
    frame = normal_frame(palm.axis)
    flat = (tips - tips.mean(axis=0)) @ frame[:, 1:]
    across = np.linalg.svd(flat, full_matrices=True)[2][0] if len(tips) > 1 else np.array([1.0, 0.0])
    R = turned(-normal, palm.axis, 0.0)
    for _ in range(SIDEWAYS):  # a normal that is seen from the palm says nothing about the sides
        other = (R @ surface.draw(rng)[1]) @ frame[:, 1:]
        if np.linalg.norm(other) > MIN_SIDE_SINE:
            break
    roll = float(np.arctan2(across[1], across[0]) - np.arctan2(other[1], other[0]))
    return turned(-normal, palm.axis, roll)


# --- jaws ---


@dataclass(frozen=True, eq=False)
class Pads:
    """The faces that two jaws turn to each other. Frame: the hand's base.

    Attributes:
        points: (2, 3) [m] their middles.
        line: (3,) unit, the direction in which they face each other, from the first to the second.
    """

    points: Array
    line: Array

    @property
    def width(self) -> float:
        """[m] between them."""
        return max(0.0, float((self.points[1] - self.points[0]) @ self.line))

    @classmethod
    def of(cls, anatomy: Anatomy, tips: tuple[int, ...], q: Array) -> Pads:
        """Of two fingertips at q (l,): what of their solids is innermost, and which way that faces."""
        first, second = anatomy.middles(q, tips)
        apart = second - first
        length = float(np.linalg.norm(apart))
        towards = apart / length if length > MIN_PALM_DIRECTION else np.eye(3)[0]
        poses = anatomy.hand.link_poses(q)
        faces = [_face(anatomy.hand.links[i], poses[i], s * towards) for i, s in zip(tips, (1, -1), strict=True)]
        line = faces[0][1] - faces[1][1]
        return cls(np.array([point for point, _ in faces]), line / max(float(np.linalg.norm(line)), MIN_PALM_DIRECTION))


def _face(link: Link, pose: Array, towards: Array) -> tuple[Array, Array]:
    """The middle (3,) [m] of what of a link is outermost in a direction (3,), and its mean normal (3,), unit."""
    solids = [(vertices @ pose[:3, :3].T + pose[:3, 3], faces) for vertices, faces in map(Shape.triangles, link.shapes)]
    a, b, c = np.vstack([vertices[faces] for vertices, faces in solids]).swapaxes(0, 1)
    corners = np.vstack([vertices for vertices, _ in solids])
    height = corners @ towards
    outermost = corners[height > height.max() - JAW_FACE_DEPTH]
    normals = np.cross(b - a, c - a)
    within = np.minimum(np.minimum(a @ towards, b @ towards), c @ towards) > height.max() - JAW_FACE_DEPTH
    within &= normals @ towards > JAW_COSINE * np.linalg.norm(normals, axis=1)
    normal = normals[within].sum(axis=0) if within.any() else towards
    return (outermost.min(axis=0) + outermost.max(axis=0)) / 2, normal / np.linalg.norm(normal)


def antipodal(rng: np.random.Generator, surface: SurfaceSampler, width: float) -> tuple[Array, Array] | None:
    """The middle (3,) [m] of two points of the surface, and the unit direction (3,) from one to the other.

    It goes straight in at the first, as a flat jaw turns an object until they lie on each other, and comes out within
    the friction cone of the second, so that forces along it balance (Nguyen 1988). None after some draws without.

    Args:
        width: [m] they are at most so far apart.
    """
    for _ in range(DRAWS):
        point, normal = surface.draw(rng)
        opposite = surface.opposite(point, -normal)
        if opposite is None:
            continue
        other, facing = opposite
        sliding = np.arccos(min(1.0, abs(float(facing @ normal))))
        if np.linalg.norm(other - point) <= width and np.tan(sliding) <= surface.friction:
            return (point + other) / 2, -normal
    return None


def squeezed(closing: Array, line: Array, seen: tuple[Array, Array] | None, roll: float) -> Array:
    """(3, 3) a rotation of the object that lays a direction of it, `line` (3,), along that in which jaws close.

    Args:
        closing: (3,) unit, from one jaw to the other.
        seen: directions (3,) of the object and of the hand's base frame that come together as far as rolling about the
            line goes; None for the roll [rad].
    """
    R = turned(line, closing, 0.0)
    if seen:
        flat = normal_frame(closing)[:, 1:]
        of, to = (R @ seen[0]) @ flat, seen[1] @ flat
        roll = float(np.arctan2(to[1], to[0]) - np.arctan2(of[1], of[0]))
    return turned(line, closing, roll)
