"""What there is to see: one description of solids, grasps, loads and arrows, for pictures, pages and the live view.

All in the object frame, SI units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.geometry.grasp_joints import TENDON
from handfast.model.body import Body
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.hand.hand import Hand
from handfast.model.shape import Faces, Shape
from handfast.stability.problem.witness import Witness

# [grasp sizes] lengths of the largest force, motion, and of a torque
FORCE_LENGTH, MOTION_LENGTH, MOMENT = 0.85, 0.4, 0.6
MIN_LOAD_LENGTH = 0.3  # [grasp sizes] length of a disturbance at least
SLOW = 0.02  # share of the fastest motion below which one is left out
SINGLE = 1e-6  # cosine of force and torque below which a wrench is a single force
SURFACE_DISTANCE = 5e-3  # [m] beyond its gap or depth, a contact that is this far off a surface is none of it
CELL_GROWTH = 1.25  # from one try to the next


@dataclass(frozen=True, eq=False)
class Mesh:
    """A solid to draw: vertices (n, 3) [m], faces (k, 3).

    In the object frame; with a `link` in that of the hand's link of this index, whose poses a `ShownGrasp` has.
    """

    vertices: Array
    faces: Faces
    kind: Literal["object", "hand"]
    link: int | None = None


@dataclass(frozen=True, eq=False)
class ShownLoad:
    """A load on a grasp.

    Attributes:
        title: the question.
        said: its answer in a sentence.
        wrench: (6,) the disturbance [N, N m]; None if it is not known.
        witness: the equilibrium under it; None if none was found.
    """

    title: str
    said: str
    wrench: Array | None
    witness: Witness | None


@dataclass(frozen=True, eq=False)
class ShownGrasp:
    """A grasp with its loads.

    Attributes:
        title: its name in a list; said: a line about it.
        poses: (n_links, 4, 4) of the hand's links, for meshes that are in the frames of links.
    """

    grasp: Grasp
    loads: tuple[ShownLoad, ...] = ()
    title: str = ""
    said: str = ""
    poses: Array = field(default_factory=lambda: np.zeros((0, 4, 4)))


@dataclass(frozen=True, eq=False)
class DrawnScene:
    """Grasps of one hand on one object; the meshes of both, as far as they are known."""

    grasps: tuple[ShownGrasp, ...]
    meshes: tuple[Mesh, ...] = ()

    @classmethod
    def of(cls, grasp: Grasp, loads: Sequence[ShownLoad] = (), meshes: Sequence[Mesh] = ()) -> DrawnScene:
        """A single grasp, meshes in the object frame."""
        return cls((ShownGrasp(grasp, tuple(loads), grasp.name),), tuple(meshes))

    def meshes_of(self, k: int) -> list[Mesh]:
        """All meshes in the object frame, the hand as in grasp k."""
        return placed(self.meshes, self.grasps[k].poses)


MovingScene = Callable[[Mapping[str, float]], list[Mesh]]


def link_meshes(hand: Hand, body: Body | None) -> list[Mesh]:
    """The object, if it is known, and the hand's collision shapes in the frames of their links."""
    meshes = [] if body is None else [Mesh(body.vertices, body.faces, "object")]
    for k, link in enumerate(hand.links):
        meshes += [Mesh(*shape.triangles(), "hand", k) for shape in link.shapes]
    return meshes


def link_poses(hand: Hand, q: Array, object_pose: Array) -> Array:
    """(n_links, 4, 4) of the hand's links at q in the object frame."""
    return np.linalg.inv(object_pose) @ hand.link_poses(q)


def placed(meshes: Iterable[Mesh], poses: Array) -> list[Mesh]:
    """Meshes in the object frame, those of links at their poses."""
    out = []
    for m in meshes:
        if m.link is not None:
            T = poses[m.link]
            m = Mesh(m.vertices @ T[:3, :3].T + T[:3, 3], m.faces, m.kind)
        out.append(m)
    return out


def scene_meshes(hand: Hand, q: Array, body: Body | None, object_pose: Array) -> list[Mesh]:
    """The object, if it is known, and the hand's collision shapes at q, in the object frame."""
    return placed(link_meshes(hand, body), link_poses(hand, q, object_pose))


def triangles(meshes: Iterable[Mesh]) -> Array:
    """(n, 3, 3) of all meshes of the hand."""
    return np.concatenate([np.zeros((0, 3, 3)), *(m.vertices[m.faces] for m in meshes if m.kind == "hand")])


# --- arrows and lines ---


@dataclass(frozen=True, eq=False)
class Arrow:
    """From `at` (3,) by `step` (3,) [m]; a torque has two heads."""

    kind: Literal["forces", "motions", "disturbance"]
    at: Array
    step: Array
    heads: int = 1


def arrows(grasp: Grasp, wrench: Array | None, witness: Witness | None) -> list[Arrow]:
    """Forces of the hand on the object, virtual motions, and the disturbance.

    All forces share one scale, motions have another; small ones are left out.
    """
    size, p, out = grasp.size, grasp.positions, []
    w = np.zeros(6) if wrench is None else wrench
    forces, motions = (np.zeros((0, 3)),) * 2 if witness is None else (witness.forces, witness.motions)
    strength, speed = np.linalg.norm(forces, axis=1), np.linalg.norm(motions, axis=1)
    largest = max(float(strength.max(initial=0.0)), float(np.linalg.norm(w[:3])))
    for at, force, f in zip(p, forces, strength, strict=False):
        if f > 1e-6 * largest:
            out.append(Arrow("forces", at, FORCE_LENGTH * size / largest * force))
    fastest = float(speed.max(initial=0.0))
    for at, motion, v in zip(p, motions, speed, strict=False):
        if v > SLOW * fastest:
            out.append(Arrow("motions", at, MOTION_LENGTH * size / fastest * motion))
    at, about = applied(w, p.mean(axis=0), 2 * size)
    force, torque = float(np.linalg.norm(about[:3])), float(np.linalg.norm(about[3:]))
    if force > 1e-9 * largest:
        out.append(Arrow("disturbance", at, size * max(FORCE_LENGTH / largest, MIN_LOAD_LENGTH / force) * about[:3]))
    if torque > 1e-9 * largest * size:
        out.append(Arrow("disturbance", at, MOMENT * size / torque * about[3:], heads=2))
    return out


def finger_lines(grasp: Grasp) -> list[Array]:
    """Per contact the points (k, 3) from joint to joint to it, in the order in which they move each other."""
    lines = []
    for i, c in enumerate(grasp.contacts):
        chain = [j for j in grasp.joints if i in j.moves]
        chain.sort(key=lambda j: (-len(j.moves), -float(np.linalg.norm(j.origin - c.position))))
        lines.append(np.array([*(j.origin for j in chain), c.position]))
    return lines


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
    from handfast.readers.configuration_file import load_parts

    faults = (grasp.provenance or Provenance()).faults()
    if not faults:
        try:
            parts = load_parts(grasp)
            hand, q, body, pose = parts.hand, parts.q, parts.body, parts.pose
            faults = _off(grasp, hand, np.linalg.inv(pose) @ hand.link_poses(q), body.pieces)
            if not faults:

                def at(moved: Mapping[str, float]) -> list[Mesh]:
                    more = np.array([moved.get(name, 0.0) for name in hand.joint_names])
                    return scene_meshes(hand, q + more, body, pose)

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
            if abs(depth) > SURFACE_DISTANCE + abs(contact.depth):
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
        cell *= CELL_GROWTH
    count = np.bincount(owner)[:, None]
    middles = np.column_stack([np.bincount(owner, weights=x) for x in vertices.T]) / count
    used, compact = np.unique(kept, return_inverse=True)
    return middles[used], compact.reshape(-1, 3), cell
