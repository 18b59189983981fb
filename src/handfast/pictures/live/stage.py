"""What stands on the page before anything is asked: solids, contacts, the scale of arrows, the first look."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import normal_frame
from handfast.model.grasp import Grasp
from handfast.model.shape import Faces, Shape
from handfast.pictures.camera import views
from handfast.pictures.hand_scene import OF_HAND, OF_OBJECT
from handfast.pictures.scene import Mesh, coarse, finger_lines, source_meshes

ARROW = 2.2  # grasp sizes that the longest load is drawn with
PAD = 0.16  # grasp sizes around each contact, of an object that nobody knows
CONE = 0.3  # height of a friction cone in grasp sizes
RIM = 24  # corners of a cone
STEPS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0])


@dataclass(frozen=True, eq=False)
class Stage:
    """One grasp as it stands there. Object frame, SI units.

    Attributes:
        object: vertices (n, 3) and faces (k, 3); a hull around the contacts if `guessed`.
        hand: the same, None if it is not known; then `fingers` are lines from joint to joint to contact, (k, 2, 3).
        guessed: is the object not known?
        notes: what is not shown as it is, a sentence each.
        force_reach, torque_reach: [N] and [N m] up to which loads are drawn and dragged.
        eye, target, up: (3,) each, of the first look.
    """

    grasp: Grasp
    object: tuple[Array, Faces]
    hand: tuple[Array, Faces] | None
    fingers: Array
    guessed: bool
    notes: tuple[str, ...]
    force_reach: float
    torque_reach: float
    eye: Array
    target: Array
    up: Array

    @property
    def size(self) -> float:
        return self.grasp.size

    @property
    def object_triangles(self) -> Array:
        """(k, 3, 3) of the object."""
        vertices, faces = self.object
        return vertices[faces]

    @property
    def metres_per_newton(self) -> float:
        """Of a load's arrow, and of the map."""
        return ARROW * self.size / self.force_reach

    @property
    def metres_per_newton_metre(self) -> float:
        """Of a torque's arrow, and of a map of torques."""
        return ARROW * self.size / self.torque_reach

    def cones(self) -> tuple[Array, Faces]:
        """All friction cones as one mesh, apex at the contact."""
        vertices, faces = [], list[Faces]()
        angle = 2 * np.pi * np.arange(RIM) / RIM
        for c in self.grasp.contacts:
            _, t1, t2 = normal_frame(c.normal).T
            wide = min(c.friction, 1.5) * (np.outer(np.cos(angle), t1) + np.outer(np.sin(angle), t2))
            first = RIM * len(faces) + len(faces)
            vertices.append(np.vstack([c.position, c.position + CONE * self.size * (c.normal + wide)]))
            around = first + 1 + np.arange(RIM)
            faces.append(np.column_stack([np.full(RIM, first), around, np.roll(around, -1)]))
        return np.vstack(vertices), np.vstack(faces)


def stage_of(grasp: Grasp) -> Stage:
    """The solids behind a grasp if its files are there, and stand-ins if not."""
    meshes, notes = source_meshes(grasp)
    hand = _joined([m for m in meshes if m.kind == "hand"], OF_HAND)
    thing = _joined([m for m in meshes if m.kind == "object"], OF_OBJECT)
    lines = [line[i : i + 2] for line in finger_lines(grasp) for i in range(len(line) - 1)] if hand is None else []
    guessed = thing is None
    thing = thing or contact_hull(grasp)
    points = np.vstack([thing[0], grasp.positions, *(np.asarray(lines).reshape(-1, 3),)])
    solid = np.vstack([thing[0], grasp.positions])
    target = (solid.min(axis=0) + solid.max(axis=0)) / 2
    reach = max(float(np.linalg.norm(points - target, axis=1).max()), 2.2 * grasp.size)
    side = views(grasp, 1)[0].matrix  # right, up, towards the viewer
    up = np.array([0.0, 0.0, 1.0]) if grasp.mass else side[1]
    back = side[2] + 0.3 * side[1] + 0.2 * side[0]
    back = back - 0.6 * (back @ up) * up  # from a little above, wherever that is
    force, torque = reaches(grasp)
    return Stage(
        grasp,
        thing,
        hand,
        np.array(lines, dtype=float).reshape(-1, 2, 3),
        guessed,
        tuple(notes),
        force,
        torque,
        target + 2.3 * reach * back / np.linalg.norm(back),
        target,
        up,
    )


def reaches(grasp: Grasp) -> tuple[float, float]:
    """[N] and [N m] up to which loads are of interest: some weights, or else what the commands press with, rounded."""
    pressed = 0.0
    for name, value in grasp.preload.items():
        row = grasp.mechanism.R[grasp.mechanism.actuators.index(name)]
        arms = [
            max(float(np.linalg.norm(j.velocity_at(grasp.positions[i]))), 1e-6)
            for j, r in zip(grasp.joints, row, strict=True)
            if r
            for i in j.moves
        ]
        pressed += abs(value) / (float(np.mean(arms)) if arms else 1.0)
    weight = 9.81 * (grasp.mass or 0.0)
    force = rounded_up(2.5 * weight or pressed or 5.0)
    return force, rounded_up(force * grasp.size)


def rounded_up(x: float) -> float:
    """The next of `STEPS`, or of ten times, a tenth of them, ..."""
    ten = 10.0 ** np.floor(np.log10(x))
    return float(ten * STEPS[np.searchsorted(STEPS, x / ten * (1 - 1e-9))])


def contact_hull(grasp: Grasp) -> tuple[Array, Faces]:
    """The convex hull of small octahedra around the contacts, on their object side: all that is known of it."""
    pad = PAD * grasp.size
    corners = pad * np.vstack([np.eye(3), -np.eye(3)])
    points = np.vstack([c.position + pad * c.normal + corners for c in grasp.contacts])
    return Shape.hull(points).triangles()


def _joined(meshes: list[Mesh], most: int) -> tuple[Array, Faces] | None:
    """All meshes as one, each with its share of the triangles; None without any."""
    if not meshes:
        return None
    total = sum(len(m.faces) for m in meshes)
    vertices, faces, count = [], [], 0
    for m in meshes:
        v, f = m.vertices, np.asarray(m.faces)
        if total > most:
            try:
                v, f, _ = coarse(v, f, max(100, most * len(f) // total))
            except (InputError, ValueError):  # too thin for a grid: as it is
                v, f = m.vertices, np.asarray(m.faces)
        vertices.append(v)
        faces.append(f + count)
        count += len(v)
    return np.vstack(vertices), np.vstack(faces)
