"""What stands on the page (solids, contacts, scale of arrows, first look), and what is set: load, preload, friction.

Pure: each change makes a new state.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import cross, normal_frame
from handfast.model.grasp import Grasp
from handfast.model.shape import Faces, Shape
from handfast.pictures.camera import views
from handfast.pictures.hand_picture import HAND_TRIANGLES, OBJECT_TRIANGLES
from handfast.pictures.scene import Mesh, coarse, finger_lines, source_meshes
from handfast.stability.answers.margin import rubbed

MapPlane = Literal["with the load", "xy", "xz", "yz", "none"]
MAP_PLANES: tuple[MapPlane, ...] = ("with the load", "xy", "xz", "yz", "none")
MIN_LOAD = 1e-12  # [N, N m] a smaller load is none
FIRST_LOAD_SHARE = 0.3  # of what is drawn, where no weight is known
MAX_PLANE_COSINE = 0.95  # cosine to the third axis of the load's frame up to which a plane is kept
LOAD_ARROW = 2.2  # grasp sizes that the longest load is drawn with
CONTACT_PAD = 0.16  # grasp sizes around each contact, of an object that nobody knows
CONE_HEIGHT = 0.3  # height of a friction cone in grasp sizes
CONE_CORNERS = 24  # corners of a cone
ROUND_NUMBERS = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0])


@dataclass(frozen=True, eq=False)
class ViewState:
    """One setting of all controls. Everything in the object frame, SI units.

    Attributes:
        number: which of the grasps.
        grasp: as its file has it.
        at: (3,) [m] where the load acts.
        frame: (3, 3) columns of the handle that turns the load; the force starts along the first, the map that follows
            the load lies in the first two.
        force, torque: (3,) [N], (3,) [N m], about `at`.
        command: (a,) of the actuators, instead of the grasp's.
        friction: times the grasp's coefficients.
        eta: [rad] by which the normals may be off.
        plane: of the map.
    """

    number: int
    grasp: Grasp
    at: Array
    frame: Array
    force: Array
    torque: Array
    command: Array
    friction: float = 1.0
    eta: float = 0.0
    plane: MapPlane = "with the load"

    @classmethod
    def of(cls, grasp: Grasp, number: int = 0) -> ViewState:
        """The weight along -z at the centre of mass, if both are known; else a force down in the flattest view."""
        flat = views(grasp, 1)[0].matrix
        at = np.zeros(3) if grasp.center_of_mass is None else np.array(grasp.center_of_mass)
        heavy = bool(grasp.mass) and grasp.center_of_mass is not None
        down = np.array([0.0, 0.0, -1.0]) if heavy else -flat[1]
        frame = np.column_stack([down, flat[0], cross(down, flat[0])])
        if abs(down @ flat[0]) > MIN_LOAD:
            frame = normal_frame(down)
        force = (9.81 * (grasp.mass or 0.0) if heavy else FIRST_LOAD_SHARE * reaches(grasp)[0]) * down
        return cls(number, grasp, at, frame, force, np.zeros(3), grasp.command)

    @property
    def wrench(self) -> Array:
        """(6,) the load [N, N m] about the object's origin."""
        return np.r_[self.force, self.torque + cross(self.at, self.force)]

    @property
    def direction(self) -> Array:
        """(6,) the load over its size: over its force [N], or its torque [N m] if there is no force.

        Where there is no load, that of 1 N along the handle.
        """
        size = self.size
        if size > MIN_LOAD:
            return self.wrench / size
        along = self.frame[:, 0]
        return np.r_[along, cross(self.at, along)]

    @property
    def size(self) -> float:
        """Of the load: [N], or [N m] of a torque alone."""
        force = float(np.linalg.norm(self.force))
        return force if force > MIN_LOAD else float(np.linalg.norm(self.torque))

    @property
    def is_torque(self) -> bool:
        """Is the load a torque alone?"""
        return not np.linalg.norm(self.force) > MIN_LOAD and bool(np.linalg.norm(self.torque) > MIN_LOAD)

    @cached_property
    def asked(self) -> Grasp:
        """The grasp with commands and friction as they are set."""
        grasp = self.grasp if self.friction == 1.0 else rubbed(self.grasp, self.friction)
        return grasp.with_preload(self.command)

    @property
    def grasp_key(self) -> tuple[object, ...]:
        """Equal for states that ask about the same grasp."""
        return self.number, self.command.tobytes(), self.friction, self.eta

    @cached_property
    def map_axes(self) -> Array | None:
        """(2, 3) unit vectors that span the map's plane, the same for all handles in that plane; None without a map."""
        if self.plane == "none":
            return None
        if self.plane != "with the load":
            return np.array([np.eye(3)["xyz".index(a)] for a in self.plane])
        normal = np.round(self.frame[:, 2], 6)
        normal /= np.linalg.norm(normal)
        least = np.eye(3)[int(np.abs(normal).argmin())]
        first = least - (least @ normal) * normal
        first /= np.linalg.norm(first)
        return np.array([first, cross(normal, first)])

    @property
    def map_key(self) -> tuple[object, ...] | None:
        """Equal for states that have the same map; None without one."""
        if self.map_axes is None:
            return None
        shape = np.round(np.vstack([self.map_axes, self.at]), 9) + 0.0
        return (*self.grasp_key, self.is_torque, shape.tobytes())

    # --- changes ---------------------------------------------------------------------------------

    def turned(self, frame: Array) -> ViewState:
        """With the handle turned to a frame (3, 3), and the load with it."""
        by = frame @ self.frame.T
        return replace(self, frame=frame, force=by @ self.force, torque=by @ self.torque)

    def moved(self, at: Array) -> ViewState:
        """With the load at another point (3,) [m]."""
        return replace(self, at=np.asarray(at, dtype=float))

    def pulled(self, force: Array, at: Array | None = None) -> ViewState:
        """With this force (3,) [N] for the load, at another point (3,) if one is given."""
        force = np.asarray(force, dtype=float)
        frame = following(self.frame, force)
        return replace(self, frame=frame, force=force, torque=np.zeros(3), at=self.at if at is None else np.array(at))

    def twisted(self, torque: Array) -> ViewState:
        """With this torque (3,) [N m] for the load."""
        torque = np.asarray(torque, dtype=float)
        return replace(self, frame=following(self.frame, torque), force=np.zeros(3), torque=torque)

    def with_force(self, size: float) -> ViewState:
        """With the force as large as this [N], in its direction or, if there is none, along the handle."""
        return replace(self, force=_resized(self.force, size, self.frame[:, 0]))

    def with_torque(self, size: float) -> ViewState:
        """With the torque as large as this [N m], about its axis or, if there is none, along the handle."""
        return replace(self, torque=_resized(self.torque, size, self.frame[:, 0]))

    def weighted(self) -> ViewState:
        """With the load as it was at first."""
        first = ViewState.of(self.grasp, self.number)
        return replace(self, at=first.at, frame=first.frame, force=first.force, torque=first.torque)

    def commanded(self, actuator: int, value: float) -> ViewState:
        """With another command [N m or N] of one actuator."""
        command = np.array(self.command)
        command[actuator] = value
        return replace(self, command=command)

    def preloaded(self, factor: float) -> ViewState:
        """With all commands of the file times a factor."""
        return replace(self, command=factor * self.grasp.command)

    def with_friction(self, mu: float) -> ViewState:
        """With all coefficients times one factor, so that their mean is `mu`."""
        mean = float(np.mean(self.grasp.mu))
        return self if mean == 0 else replace(self, friction=mu / mean)

    def with_normals(self, eta: float) -> ViewState:
        """With normals that may be off by `eta` [rad]."""
        return replace(self, eta=eta)

    def with_plane(self, plane: MapPlane) -> ViewState:
        """With another map."""
        return replace(self, plane=plane)

    def leafed(self, grasp: Grasp, number: int) -> ViewState:
        """Another grasp with its own load; the factor of friction, normals and the kind of map stay."""
        return replace(ViewState.of(grasp, number), friction=self.friction, eta=self.eta, plane=self.plane)


def following(frame: Array, along: Array) -> Array:
    """A frame (3, 3) whose first column is along a vector (3,), its plane kept where the vector is near it."""
    length = float(np.linalg.norm(along))
    if length < MIN_LOAD:
        return frame
    first = along / length
    third = frame[:, 2] if abs(first @ frame[:, 2]) < MAX_PLANE_COSINE else frame[:, 1]
    third = third - (third @ first) * first
    third /= np.linalg.norm(third)
    return np.column_stack([first, cross(third, first), third])


def _resized(v: Array, size: float, otherwise: Array) -> Array:
    length = float(np.linalg.norm(v))
    return size * (v / length if length > MIN_LOAD else otherwise)


# --- what stands there ---


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
        return LOAD_ARROW * self.size / self.force_reach

    @property
    def metres_per_newton_metre(self) -> float:
        """Of a torque's arrow, and of a map of torques."""
        return LOAD_ARROW * self.size / self.torque_reach

    def cones(self) -> tuple[Array, Faces]:
        """All friction cones as one mesh, apex at the contact."""
        vertices, faces = [], list[Faces]()
        angle = 2 * np.pi * np.arange(CONE_CORNERS) / CONE_CORNERS
        for c in self.grasp.contacts:
            _, t1, t2 = normal_frame(c.normal).T
            wide = min(c.friction, 1.5) * (np.outer(np.cos(angle), t1) + np.outer(np.sin(angle), t2))
            first = CONE_CORNERS * len(faces) + len(faces)
            vertices.append(np.vstack([c.position, c.position + CONE_HEIGHT * self.size * (c.normal + wide)]))
            around = first + 1 + np.arange(CONE_CORNERS)
            faces.append(np.column_stack([np.full(CONE_CORNERS, first), around, np.roll(around, -1)]))
        return np.vstack(vertices), np.vstack(faces)


def stage_of(grasp: Grasp) -> Stage:
    """The solids behind a grasp if its files are there, and stand-ins if not."""
    meshes, notes = source_meshes(grasp)
    hand = _joined([m for m in meshes if m.kind == "hand"], HAND_TRIANGLES)
    thing = _joined([m for m in meshes if m.kind == "object"], OBJECT_TRIANGLES)
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
    """The next of `ROUND_NUMBERS`, or of ten times, a tenth of them, ..."""
    ten = 10.0 ** np.floor(np.log10(x))
    return float(ten * ROUND_NUMBERS[np.searchsorted(ROUND_NUMBERS, x / ten * (1 - 1e-9))])


def contact_hull(grasp: Grasp) -> tuple[Array, Faces]:
    """The convex hull of small octahedra around the contacts, on their object side: all that is known of it."""
    pad = CONTACT_PAD * grasp.size
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
