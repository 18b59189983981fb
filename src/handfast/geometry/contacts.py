"""Contacts of a hand at a configuration with an object, and the grasp they make."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array
from handfast.core.errors import InputError, kinds_checked, refuse_other_kinds, require_positive
from handfast.geometry.contact_patch import patch
from handfast.geometry.grasp_joints import joints_and_mechanism
from handfast.geometry.scene import HandObjectPair, PoseLike, Scene, checked_joints, checked_pose
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.hand.hand import Hand
from handfast.model.provenance import Provenance, SourceFile
from handfast.model.shape import Shape

THRESHOLD = 5e-4  # [m] surfaces nearer than this touch
HIDDEN_DEPTH = 1e-5  # [m] a point this deep inside another solid of the same body is on no real surface
SEAM = 5e-5  # [m] above a hidden face, the neighbour begins at the latest here
DEPTH_ROUNDING = 1e-7  # [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactOptions:
    """How contacts are looked for, and what they are like.

    Attributes:
        threshold: [m] surfaces nearer than this touch.
        friction: coefficient; the object's unless given.
        torsion: coefficient of torsional friction [m], of soft fingers; "hand" is what the hand's file says of its
            parts (MJCF, condim 4). Point contacts by default.
        merge_distance: [m] and merge_angle: [rad] within which points and normals of one link are one contact.
        scene: a `Scene` of the same hand and object, to save compiling one.
    """

    threshold: float = THRESHOLD
    friction: float | None = None
    torsion: float | Literal["hand"] = 0.0
    merge_distance: float = 2e-3
    merge_angle: float = 0.17
    scene: Scene | None = None

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        require_positive(self.threshold, "threshold", "a distance above 0 [m] is needed")


@dataclass(frozen=True, eq=False, kw_only=True)
class ContactGraspOptions(ContactOptions):
    """What the grasp of a hand that touches an object is made with.

    Attributes:
        preload: commanded forces by actuator name [N m, N]; absent actuators are locked.
        lock: joints held rigidly whatever the actuators do.
        mechanism: "hand" for the hand's own, "direct" for one motor per joint, named like the joint.
        laws: which of the hand's joint laws count, see `Hand.with_laws`.
        backdrivable: names of motors that give what they are commanded and no more, beside those of the hand.
        name: of the grasp; "HAND on OBJECT" unless given.
    """

    preload: Mapping[str, float] | None = None
    lock: Sequence[str] = ()
    mechanism: Literal["hand", "direct"] = "hand"
    laws: str = "all"
    backdrivable: Collection[str] = ()
    name: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mechanism not in ("hand", "direct"):
            raise InputError(f"is '{self.mechanism}'; 'hand' or 'direct' is needed", field="mechanism")


@kinds_checked
def find_contacts(
    hand: Hand, q: Array | Mapping[str, float], body: Body, object_pose: PoseLike, threshold: float = THRESHOLD,
    **options: Any,
) -> tuple[Contact, ...]:  # fmt: skip
    """Where the hand touches the object, in the **object** frame.

    Each pair of convex solids nearer than `threshold` gives the corners of the patch on which they
    meet: one point for a fingertip, two for an edge, up to four for faces. A point lies midway between
    the two surfaces; its normal points into the object; its depth is the pair's penetration [m],
    negative for a gap. Points on a face hidden inside another piece of the object, or inside another
    solid of the same link, are dropped. Points of one link that are near to each other are merged into
    their mean. Order: by link, then by position.

    Args:
        q: (l,) configuration, or values by joint name; the others follow `Hand.configuration`.
        object_pose: of the object in the hand's base frame: (4, 4), or position (3,) [m] and quaternion (w, x, y, z).
        options: of `ContactOptions`, by name: `find_contacts(hand, q, body, pose, friction=0.5, scene=scene)`.

    Raises:
        InputError: a pose that is not rigid, a configuration of the wrong length, a negative threshold, a scene of
            another hand or object.
    """
    asked = ContactOptions(threshold=threshold, **options)
    return _found(hand, checked_joints(hand, q), body, checked_pose(object_pose), asked)


def _found(hand: Hand, q: Array, body: Body, pose: Array, asked: ContactOptions) -> tuple[Contact, ...]:
    if asked.scene is not None:
        _refuse_another(asked.scene, hand, body)
    near = (asked.scene or Scene(hand, body)).nearest(q, pose, asked.threshold)
    poses = hand.link_poses(q)
    to_object = np.linalg.inv(pose)
    mu = body.friction if asked.friction is None else asked.friction
    torsion = 0.0 if mu == 0 and asked.torsion == "hand" else asked.torsion
    contacts: list[Contact] = []
    for link in sorted({n.link for n in near}):
        solids = [s.placed(to_object @ poses[link]) for s in hand.links[link].shapes]
        own = hand.links[link].torsion or (0.0,) * len(solids)
        seen: list[Contact] = []
        hidden: list[Contact] = []
        for n in (n for n in near if n.link == link):
            normal = to_object[:3, :3] @ n.normal
            middle = to_object[:3, :3] @ (n.on_hand + n.on_object) / 2 + to_object[:3, 3]
            for p, inside in zip(*patch_corners(n, solids, body.pieces, normal, middle), strict=True):
                soft = own[n.shape] if torsion == "hand" else torsion
                found = Contact(p, normal, mu, hand.links[link].name, -n.distance, soft)
                (hidden if inside else seen).append(found)
        if not seen:  # pressed in so far that every nearest point is inside something
            seen = [max(hidden, key=lambda c: c.depth)]
        contacts += _merged(seen, asked.merge_distance, asked.merge_angle)
    return tuple(contacts)


@kinds_checked
def contact_grasp(
    hand: Hand, q: Array | Mapping[str, float], body: Body, object_pose: PoseLike, **options: Any
) -> Grasp:
    """The grasp that a hand at q has on an object: contacts, joints and mechanism in the object frame.

    The grasp has the joints that move a contact and those coupled to them or driven by the same
    actuators. A joint whose closing sense is negative is turned round, and an actuator that would open
    its joints under positive force is too, so that positive preloads close; tendons keep their sense.
    The grasp knows the object's mass and centre of mass, and the files of hand and object. Its joints have the
    friction of the hand's, what their springs give at q, and the stops at which they stand, to within 0.001 rad or
    0.1 mm: `Joint.law`.

    Args:
        q: and object_pose as in `find_contacts`.
        options: of `ContactGraspOptions`, by name: `contact_grasp(hand, q, body, pose, preload={"motor": 0.1})`.

    Raises:
        InputError: nothing within the threshold (the nearest link is named), an unknown joint to lock,
            an unknown actuator, and whatever `find_contacts` raises.
    """
    asked = ContactGraspOptions(**options)
    q, pose = checked_joints(hand, q), checked_pose(object_pose)
    scene = asked.scene or Scene(hand, body)
    contacts = _found(hand, q, body, pose, replace(asked, scene=scene))
    if not contacts:
        raise nothing_near(scene, q, pose, asked.threshold)
    grasp = grasp_of(
        hand.with_laws(asked.laws).with_backdrivable(asked.backdrivable),
        q,
        contacts,
        pose,
        preload=asked.preload,
        lock=asked.lock,
        mechanism=asked.mechanism,
        name=asked.name or f"{hand.name} on {body.name}",
    )
    return of_body(grasp, hand, body)


def of_body(grasp: Grasp, hand: Hand, body: Body) -> Grasp:
    """A grasp with the mass and centre of mass of its object, and the files of hand and object."""
    came = Provenance(SourceFile.of(hand.source, "hand"), SourceFile.of(body.source, "object", body.scale))
    return grasp.about(mass=body.mass, center_of_mass=body.center_of_mass, provenance=came)


def grasp_of(
    hand: Hand,
    q: Array,
    contacts: Sequence[Contact],
    object_pose: Array,
    *,
    preload: Mapping[str, float] | None = None,
    lock: Sequence[str] = (),
    mechanism: Literal["hand", "direct"] = "hand",
    name: str | None = None,
) -> Grasp:
    """The grasp of a hand at q with contacts that are known already: `contact_grasp` without the detection.

    Loops of the hand count to first order at q, as couplings (`Hand.mechanism_at`). What the hand's joints have besides
    their motors, the grasp's have at q: `handfast.geometry.grasp_joints`.

    Args:
        contacts: object frame; `link` names the hand link of each.

    Raises:
        InputError: no contacts, an unknown link, joint or actuator.
    """
    moving = [hand.moved_by(hand.link(c.link)) for c in contacts]
    held = frozenset(hand.joint(joint, field="lock") for joint in lock)
    joints, drives = joints_and_mechanism(hand, q, object_pose, moving, held=held, mechanism=mechanism)
    return Grasp(contacts, joints, drives, preload, name or hand.name)


def nothing_near(scene: Scene, q: Array, pose: Array, threshold: float) -> InputError:
    """The error for a hand that does not touch, naming the nearest link."""
    reach = 10.0
    d = scene.distance(q, pose, reach)
    link = scene.hand.links[int(d.argmin())].name
    return InputError(
        f"no link is within {threshold * 1e3:g} mm of the object; nearest: {link} at {d.min() * 1e3:.3g} mm"
    )


def deepest(contacts: Sequence[Contact]) -> Contact | None:
    """The contact with the most penetration, None if there are no contacts."""
    return max(contacts, key=lambda c: c.depth, default=None)


def _refuse_another(scene: Scene, hand: Hand, body: Body) -> None:
    """`InputError` if a scene is not of this hand's links and this object's solids; masses and senses may differ."""
    if scene.hand.links is not hand.links and scene.hand.link_names != hand.link_names:
        raise InputError(f"is of the hand {scene.hand.name}, not of {hand.name}", field="scene")
    if scene.body.pieces is not body.pieces and not np.array_equal(scene.body.vertices, body.vertices):
        raise InputError(f"is of the object {scene.body.name}, not of {body.name}", field="scene")


def patch_corners(
    pair: HandObjectPair, solids: Sequence[Shape], pieces: Sequence[Shape], normal: Array, middle: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """(k, 3) [m] corners of the patch on which two solids meet, and (k,) which of them are on no real surface.

    Args:
        solids, pieces: those of the hand's link and of the object, in one frame.
        normal, middle: (3,) of the pair in that frame, into the object; midway between the nearest points.
    """
    corners, half = patch(solids[pair.shape], pieces[pair.piece], normal, middle), pair.distance / 2 * normal
    on_object, on_hand = (corners + half, -normal, pieces, pair.piece), (corners - half, normal, solids, pair.shape)
    return corners, _hidden_points(*on_object) | _hidden_points(*on_hand)


def _hidden_points(points: Array, outwards: Array, solids: Sequence[Shape], own: int) -> NDArray[np.bool_]:
    """(k,) whether points on the surface of one solid of a body lie on no real surface of that body.

    A point does not if it is inside another of the body's solids; none of the points does if just above
    their middle there is another solid, as on the seam where two pieces of an object meet.
    """
    out = np.zeros(len(points), dtype=bool)
    above = points.mean(axis=0) + SEAM * outwards
    for k, solid in enumerate(solids):
        if k != own:
            out |= (solid.depth(points) > HIDDEN_DEPTH) | (solid.depth(above)[0] > DEPTH_ROUNDING)
    return out


def _merged(points: list[Contact], distance: float, angle: float) -> list[Contact]:
    """One link's contacts with near-duplicates replaced by their mean; deepest first leads a cluster.

    Means can lie nearer to each other than the points did, so this goes on until none are left.
    """
    groups = [[c] for c in points]
    while True:
        fewer = _clustered(groups, distance, angle)
        if len(fewer) == len(groups):
            return sorted((_mean(g) for g in fewer), key=lambda c: tuple(c.position.round(7)))
        groups = fewer


def _clustered(groups: list[list[Contact]], distance: float, angle: float) -> list[list[Contact]]:
    """Groups joined with those whose means are near the mean of a leading one."""
    left = sorted(((_mean(g), g) for g in groups), key=lambda m: (-round(m[0].depth, 7), *m[0].position.round(7)))
    out = []
    while left:
        lead = left[0][0]
        near = [
            np.linalg.norm(c.position - lead.position) <= distance and c.normal @ lead.normal >= np.cos(angle)
            for c, _ in left
        ]
        out.append([c for (_, group), yes in zip(left, near, strict=True) if yes for c in group])
        left = [m for m, yes in zip(left, near, strict=True) if not yes]
    return out


def _mean(group: list[Contact]) -> Contact:
    """A contact in the middle of a group, as deep as the deepest, which comes first."""
    lead = group[0]
    if len(group) == 1:
        return lead
    normal = np.mean([c.normal for c in group], axis=0)
    position = np.mean([c.position for c in group], axis=0)
    return Contact(position, normal / np.linalg.norm(normal), lead.friction, lead.link, lead.depth, lead.torsion)
