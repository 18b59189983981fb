"""What there is to see of a grasp, whoever draws it: solids, where they come from, and directions to look along."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from handfast.core.errors import InputError
from handfast.geometry.grasp_joints import TENDON

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.model.body import Body
    from handfast.model.grasp import Grasp, GraspJoint
    from handfast.model.hand.hand import Hand
    from handfast.model.shape import Faces, Shape

SINGLE = 1e-6  # cosine of force and moment below which a wrench is a single force
OFF = 5e-3  # [m] beyond its gap or depth, a contact that is this far off a surface is none of it
EDGE = 1e-9  # a ray through an edge meets both triangles
WIDER = 1.25  # from one try to the next


@dataclass(frozen=True, eq=False)
class Mesh:
    """A solid to draw: vertices (n, 3) [m] in the object frame, faces (k, 3)."""

    vertices: Array
    faces: Faces
    kind: Literal["object", "hand"]


MovingScene = Callable[[Mapping[str, float]], list[Mesh]]


def scene_meshes(hand: Hand, q: Array, body: Body, object_pose: Array) -> list[Mesh]:
    """The object and the hand's collision shapes at q, in the object frame."""
    to_object = np.linalg.inv(object_pose)
    meshes = [Mesh(body.vertices, body.faces, "object")]
    for link, pose in zip(hand.links, hand.link_poses(q), strict=True):
        for shape in link.shapes:
            vertices, faces = shape.placed(to_object @ pose).triangles()
            meshes.append(Mesh(vertices, faces, "hand"))
    return meshes


# --- where to look from ---


@dataclass(frozen=True, eq=False)
class View:
    """A direction to look along: rows of `matrix` are right, up and towards the viewer."""

    title: str
    matrix: Array

    @classmethod
    def of(cls, azimuth: float, elevation: float, title: str) -> View:
        a, e = np.radians([azimuth, elevation])
        back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(title, np.array([right, np.cross(back, right), back]))


ALONG = {
    "x": View("seen from +x", np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])),
    "y": View("seen from −y", np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])),
    "z": View("seen from +z", np.eye(3)),
}


def views(grasp: Grasp, count: int = 2) -> list[View]:
    """The axis view in which the contacts spread most, one at an angle, then the other axes."""
    p = grasp.positions
    flat = sorted("xyz", key=lambda a: float(np.var(p[:, "xyz".index(a)])))
    order = [ALONG[flat[0]], View.of(-55.0, 28.0, "at an angle"), *(ALONG[a] for a in flat[1:])]
    return order[:count]


def placed_joints(grasp: Grasp) -> list[GraspJoint]:
    """The joints that are somewhere: not those that stand for the length of a tendon."""
    return [j for j in grasp.joints if j.moves or not j.name.startswith(TENDON)]


def applied(wrench: Array, near: Array, reach: float) -> tuple[Array, Array]:
    """Where a wrench (6,) is drawn, and the wrench about that point.

    A single force is drawn on its line of action, at the point nearest to `near` (3,) if that is within `reach`
    [m] of it, such as a weight through the centre of mass; everything else at the origin.
    """
    F, M = wrench[:3], wrench[3:]
    f2, m2 = float(F @ F), float(M @ M)
    if f2 > 0 and m2 > 0 and abs(float(F @ M)) <= SINGLE * np.sqrt(f2 * m2):
        at = np.cross(F, M) / f2
        at = at + (near - at) @ F / f2 * F
        if np.linalg.norm(at - near) <= reach:
            return at, np.r_[F, np.zeros(3)]
    return np.zeros(3), wrench


def first_hit(vertices: Array, faces: Faces, eye: Array, through: Array) -> float:
    """The share of the way from `eye` (3,) to `through` (3,) at which a mesh is first met; 1 if it is not met."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    ray = through - eye
    across = np.cross(ray, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles along the ray
        away = eye - a
        u = np.einsum("ij,ij->i", away, across) / volume
        turned = np.cross(away, b - a)
        v = turned @ ray / volume
        share = np.einsum("ij,ij->i", c - a, turned) / volume
        met = (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1 + EDGE) & (share > 0) & (share < 1)
    return float(share[met].min(initial=1.0))


# --- the solids behind a grasp file ---


def source_meshes(grasp: Grasp) -> tuple[list[Mesh], list[str]]:
    """Hand and object behind a grasp, in the object frame, and why they are not there, a sentence each.

    They are read from the files that the grasp's provenance names, if all three are there with the same checksums,
    and shown if the grasp's contacts lie on them: a contact or a scale that was changed afterwards has no checksum.
    The checksum is that of the file itself: a mesh that a hand file names may have changed all the same.
    """
    scene, faults = moving_scene(grasp)
    return (scene({}) if scene else []), faults


def moving_scene(grasp: Grasp) -> tuple[MovingScene | None, list[str]]:
    """The same for any displacement [rad, m] of joints by name; the object stays where it is. None if unknown."""
    from handfast.model.provenance import Provenance
    from handfast.readers.configuration_file import load_configuration
    from handfast.readers.load_body import load_body
    from handfast.readers.load_hand import load_hand

    came = grasp.provenance or Provenance()
    faults = came.faults()
    if not faults and came.hand and came.object and came.configuration:
        try:
            placed = load_configuration(came.configuration.path)
            hand, q = placed.applied(load_hand(came.hand.path))
            body = load_body(came.object.path, scale=came.object.scale)
            faults = _off(grasp, hand, np.linalg.inv(placed.pose) @ hand.link_poses(q), body.pieces)
            if not faults:

                def at(moved: Mapping[str, float]) -> list[Mesh]:
                    more = np.array([moved.get(name, 0.0) for name in hand.joint_names])
                    return scene_meshes(hand, q + more, body, placed.pose)

                return at, []
        except InputError as fault:
            faults = [str(fault)]
    return None, [f"Hand and object are not shown: {'; '.join(faults)}."]


def _off(grasp: Grasp, hand: Hand, poses: Array, pieces: Sequence[Shape]) -> list[str]:
    """A sentence about the first contact that is not on the object, or not on its link; `poses` in the object frame."""
    for i, contact in enumerate(grasp.contacts):
        solids = {"the object": pieces}
        if contact.link in hand.link_names:
            k = hand.link(contact.link)
            solids[contact.link] = [shape.placed(poses[k]) for shape in hand.links[k].shapes]
        for name, shapes in solids.items():
            depth = max((float(s.depth(contact.position[None])[0]) for s in shapes), default=0.0)
            if abs(depth) > OFF + abs(contact.depth):
                changed = "contacts, scale or configuration are not those of this grasp"
                return [f"contact {i} is at least {1e3 * abs(depth):.3g} mm off the surface of {name}: {changed}"]
    return []


# --- fewer triangles ---


def coarse(vertices: Array, faces: Faces, most: int) -> tuple[Array, Faces, float]:
    """A triangle mesh with at most `most` triangles: vertices that share a cell of a grid become their mean.

    A mesh that has no more is returned as it is.

    Args:
        vertices: (n, 3) [m]; `faces`: (k, 3).

    Returns:
        Vertices, faces, and the side of a cell [m]: details below it are lost. 0 if nothing changed.
    """
    faces = np.asarray(faces)
    if len(faces) <= most:
        return vertices, faces, 0.0
    low = vertices.min(axis=0)
    cell = float(np.ptp(vertices, axis=0).max()) / np.sqrt(most)  # a flat square would have twice as many as asked
    while True:
        _, owner = np.unique(np.floor((vertices - low) / cell).astype(np.int64), axis=0, return_inverse=True)
        owner = owner.reshape(-1)
        kept = owner[faces]
        a, b, c = kept.T
        kept = kept[(a != b) & (b != c) & (c != a)]
        first = np.unique(np.sort(kept, axis=1), axis=0, return_index=True)[1]
        kept = kept[np.sort(first)]
        if len(kept) <= most:
            break
        cell *= WIDER
    count = np.bincount(owner)[:, None]
    middles = np.column_stack([np.bincount(owner, weights=x) for x in vertices.T]) / count
    used, compact = np.unique(kept, return_inverse=True)
    return middles[used], compact.reshape(-1, 3), cell
