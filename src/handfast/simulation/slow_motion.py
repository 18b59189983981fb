"""A hand and an object that move slowly: one step after the other, contacts found anew in the real shapes each time.

`touch_points` says where they touch, or soon may, each point with a depth of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.core.transforms import cross, normal_frame, transform
from handfast.geometry.contact_patch import FACE_DEPTH
from handfast.geometry.contacts import patch_corners
from handfast.geometry.scene import HandObjectPair, Scene
from handfast.model.shape import Shape
from handfast.simulation.drag_step import StepProblem, drag_step
from handfast.simulation.hand_drive import JointResistance, MotorDrive

# of a contact [force units / grasp sizes]: the force unit presses it in by 3e-4 of the grasp's size
DRAG_STIFFNESS = 3e3
HARDER = 100.0  # times as stiff are gearings and joint stops
MAX_STEP_DURATION = 100.0  # duration of a step in which the force unit would drive a free object by as many grasp sizes
MAX_STEP_MOTION = 7.5e-3  # [grasp sizes, rad] that anything moves in a step; beyond it the step is made shorter
STEP_TRIES = 8  # of shorter steps
MIN_STEP_MOTION = 1e-5  # [grasp sizes, rad] a step in which nothing moves farther moves nothing
CARRIES = 1e-4  # [force units] a contact with less carries nothing
Pair = tuple[int, int, int]  # link, its shape, piece of the object
FLATTEST = 1e-3  # [m] points of a feature nearer to each other than this tell nothing of its tilt


@dataclass(frozen=True, eq=False)
class PointLoad:
    """A force that keeps its direction in the hand's frame while its point moves along with the object.

    Attributes:
        force: (3,) [N], hand's base frame.
        at: (3,) [m] where on the object it acts, object frame.
        torque: (3,) [N m] beside it, hand's base frame; keeps its direction, too.
    """

    force: Array
    at: Array
    torque: Array

    def wrench(self, pose: Array) -> Array:
        """(6,) in the object's frame, about its origin, with the object at a pose (4, 4)."""
        R = pose[:3, :3]
        force = R.T @ self.force
        return np.r_[force, R.T @ self.torque + cross(self.at, force)]


@dataclass(frozen=True, eq=False)
class Moved:
    """What a step did.

    Attributes:
        points: that were near at its beginning.
        pressure: (n,) [N] normal forces at its end.
        far: largest motion [grasp sizes, rad].
        whole: was the step of the full duration, with next to no drag?
    """

    points: TouchPoints
    pressure: Array
    far: float
    whole: bool


class SlowMotion:
    """A scene on the move; `step` changes it.

    Attributes:
        q, pose: joints (l,) and object (4, 4), hand's base frame.
        share: of the load that acts; driven: of the commands and of what springs of joints give.
        winding: do gearings follow what closes?
    """

    def __init__(
        self, scene: Scene, q: Array, pose: Array, drive: MotorDrive, load: PointLoad, units: tuple[float, float],
        friction: Mapping[str | None, float], middle: Array, rest: dict[Pair, float],
    ) -> None:  # fmt: skip
        """At rest, untouched.

        Args:
            units: force [N] and length [m].
            friction: coefficient by link.
            middle: (3,) [m] of the contacts, object frame: the point at which the object is dragged.
            rest: depths at which pairs of solids touch.
        """
        self.scene, self.hand, self.drive, self.load = scene, scene.hand, drive, load
        self.q, self.pose = np.array(q, dtype=float), np.array(pose, dtype=float)
        self.force, self.length = units
        self.share, self.driven, self.winding = 0.0, 0.0, False
        self._mu = [friction[link.name] for link in self.hand.links]
        self._middle, self._rest = middle, rest
        self._unit = np.array([1.0 if j.type == "revolute" else self.length for j in self.hand.joints])
        self._sense = np.where(drive.command < 0, -1.0, 1.0)
        self._gear = self._sense * (drive.rows @ self.q)
        self._resistance = JointResistance.of(self.hand)
        tendons = self.hand.tendons
        self._ends = np.vstack([np.eye(self.hand.l), *(t.row for t in tendons)])  # what has ends: joints, tendons
        limits = np.vstack([self.hand.limits, *(t.law.stops for t in tendons)])
        at = self._ends @ self.q
        self._limits = np.minimum(limits[:, 0], at), np.maximum(limits[:, 1], at)
        self._duration, self._farthest = MAX_STEP_DURATION, MAX_STEP_MOTION
        self._last = np.zeros(0)
        self._pressure: dict[Pair, list[float]] = {}

    def begin_at(self, turned: Array, shift: Array, joints: Mapping[str, float], share: float) -> None:
        """Begin elsewhere, under all of the commands and a share of the load: contacts press as deep as they are there.

        Args:
            turned: (3, 3), shift: (3,) [m] of the object from where it is, its own frame and origin.
            joints: by how much these are farther [rad, m]; couplings take others along.
        """
        basis = self._basis()
        known = [self.hand.joint(name) for name in joints]
        moved = np.array(list(joints.values())) / self._unit[known]
        x = np.linalg.lstsq(basis[known], moved, rcond=None)[0]
        self.q = self.hand.closed(self.q + self._unit * (basis @ x), self.q, as_far_as_possible=True)
        R, t = self.pose[:3, :3], self.pose[:3, 3]
        self.pose = transform(t + R @ shift, R @ turned)
        self.share, self.driven, self.winding = share, 1.0, True
        self._wind()

    def _wind(self) -> None:
        """Let gearings keep what has closed."""
        self._gear = np.maximum(self._gear, self._sense * (self.drive.rows @ self.q))

    def step(self) -> Moved:
        """One step, as far as nothing moves farther than `MAX_STEP_MOTION`."""
        reach = 2 * MAX_STEP_MOTION * self.length
        points = touch_points(self.scene, self.q, self.pose, reach, self._rest)
        basis = self._basis()
        problem, motions = self._problem(points, basis)
        x, c = np.zeros(len(problem.drag)), self._guess(points)
        h = min(MAX_STEP_DURATION, 8 * self._duration)
        for _ in range(STEP_TRIES):
            x, c = drag_step(problem, h, x, c)
            far = self._far(x, basis, motions)
            if far <= self._farthest:
                break
            h *= max(0.02, 0.7 * self._farthest / far)
            x = np.zeros(len(x))
        if far > 2 * self._farthest:
            x *= self._farthest / far
        self._duration = h
        self._damp(x, far)
        self._apply(x, basis)
        pressure = problem.pressure(x)
        self._keep(points, pressure)
        return Moved(points, self.force * pressure, far, h >= MAX_STEP_DURATION)

    def _damp(self, x: Array, far: float) -> None:
        """Let steps that undo each other, as about an axis that little turns the object about, be ever shorter."""
        last, self._last = self._last, x
        if len(last) == len(x) and far > MIN_STEP_MOTION and x @ last < -0.5 * np.linalg.norm(x) * np.linalg.norm(last):
            self._farthest = min(self._farthest, far) / 2
        else:
            self._farthest = min(MAX_STEP_MOTION, 1.5 * self._farthest)

    @property
    def middle(self) -> Array:
        """(3,) [m] where the middle of the first contacts is now."""
        out: Array = self.pose[:3, :3] @ self._middle + self.pose[:3, 3]
        return out

    def _basis(self) -> Array:
        """(l, k) orthonormal scaled motions of the joints that couplings, loops and locked actuators allow."""
        hand = self.hand
        coupled = hand.mechanism_at(self.q).A
        if self.drive.direct:  # a motor for each joint takes the couplings' place; loops stay
            coupled = coupled[len(hand.couplings) :]
        rows = np.vstack([coupled, self.drive.rows[~self.drive.moves], self.drive.held]) * self._unit
        if not len(rows):
            return np.eye(hand.l)
        _, s, V = np.linalg.svd(rows)
        rank = int((s > 1e-9 * s.max(initial=1e-300)).sum())
        return V[rank:].T

    def _problem(self, points: TouchPoints, basis: Array) -> tuple[StepProblem, Array]:
        """The step's problem, and (n, 6, x) motions of the object and of the finger at each point."""
        L, F, hand = self.length, self.force, self.hand
        k = basis.shape[1]
        middle = self.middle
        axes, origins = hand.joint_axes(self.q)
        turns = np.array([j.type == "revolute" for j in hand.joints])
        motions = np.zeros((len(points), 6, 6 + k))
        for i, (P, link) in enumerate(zip(points.positions, points.links, strict=True)):
            motions[i, :3, :3] = np.eye(3)
            motions[i, :3, 3:6] = np.cross((P - middle) / L, np.eye(3))
            chain = list(hand.moved_by(int(link)))
            J = np.zeros((3, hand.l))
            for j in chain:
                J[:, j] = cross(axes[j], P - origins[j]) / L if turns[j] else axes[j]
            motions[i, 3:, 6:] = J @ basis
        parting = motions[:, :3] - motions[:, 3:]
        local = np.einsum("ijk,ijn->ikn", points.frames, parting)
        acts = self._acting(middle)
        given, elastic = self._resistance.springs(self.q)
        torque = self._unit * self.driven * (self.drive.rows.T @ self.drive.command + given) / (F * L)
        push = np.r_[self.share * acts, basis.T @ torque]
        stops, room = self._stops(basis)
        mu = np.array([self._mu[i] for i in points.links])
        drag = np.r_[np.ones(3), np.full(3, 0.4), np.ones(k)]
        problem = StepProblem(
            drag,
            push,
            local[:, 0],
            local[:, 1:],
            points.depths / L,
            DRAG_STIFFNESS,
            mu,
            stops,
            room,
            HARDER * DRAG_STIFFNESS,
        )
        return (self._resisted(problem, elastic, basis) if self._resistance.laws else problem), motions

    def _resisted(self, problem: StepProblem, elastic: Array, basis: Array) -> StepProblem:
        """The problem with what springs give less as they go (l, l) [N m/rad, N/m], and with joints that rub."""
        per = self.force * self.length
        moved = self._unit[:, None] * basis
        S = np.zeros((len(problem.drag),) * 2)
        S[6:, 6:] = self.driven / per * moved.T @ elastic @ moved
        rows, most = self._resistance.rows @ moved, self._resistance.friction
        size = np.linalg.norm(rows, axis=1)
        rubs = (size > 1e-9) & (most > 0)
        rows = np.hstack([np.zeros((int(rubs.sum()), 6)), rows[rubs] / size[rubs, None]])
        return replace(problem, elastic=S, joints=rows, dry=(most * size)[rubs] / per)

    def _acting(self, middle: Array) -> Array:
        """(6,) the full load about the middle, scaled, hand's axes."""
        at = self.pose[:3, :3] @ self.load.at + self.pose[:3, 3]
        torque = self.load.torque + cross(at - middle, self.load.force)
        return np.r_[self.load.force / self.force, torque / (self.force * self.length)]

    def _stops(self, basis: Array) -> tuple[Array, Array]:
        """Rows and rooms of gearings that do not turn back, and of the ends of joints and tendons."""
        gear = self._sense * (self.drive.rows @ self.q)
        stand = self.drive.moves & self.drive.holds
        towards = -(self._sense[:, None] * self.drive.rows * self._unit)[stand]
        ends, at = self._ends * self._unit, self._ends @ self.q
        lower, upper = self._limits
        rooms = np.r_[(gear - self._gear)[stand], upper - at, at - lower]
        rows = np.vstack([towards, ends, -ends]) @ basis
        size = np.linalg.norm(rows, axis=1)
        kept = (size > 1e-9) & np.isfinite(rooms)
        rows, rooms, size = rows[kept], rooms[kept], size[kept]
        near = rooms / size <= 4 * MAX_STEP_MOTION
        return np.hstack([np.zeros((int(near.sum()), 6)), rows[near] / size[near, None]]), (rooms / size)[near]

    def _far(self, x: Array, basis: Array, motions: Array) -> float:
        """The largest motion of anything: object, joints, points."""
        parts = [
            float(np.linalg.norm(x[:3])),
            float(np.linalg.norm(x[3:6])),
            float(np.abs(basis @ x[6:]).max(initial=0)),
        ]
        moved = (motions @ x).reshape(-1, 3)
        return max([*parts, float(np.linalg.norm(moved, axis=1).max(initial=0.0))])

    def _apply(self, x: Array, basis: Array) -> None:
        from scipy.spatial.transform import Rotation

        middle, R = self.middle, self.pose[:3, :3]
        turned = Rotation.from_rotvec(x[3:6]).as_matrix() @ R
        q = self.q + self._unit * (basis @ x[6:])
        self.q = self.hand.closed(q, self.q, as_far_as_possible=True)
        self.pose = transform(middle + self.length * x[:3] - turned @ self._middle, turned)
        if self.winding:
            self._wind()

    def _guess(self, points: TouchPoints) -> Array:
        """(n,) forces that pairs of solids had in the last step."""
        left = {pair: list(values) for pair, values in self._pressure.items()}
        return np.array([left[p].pop(0) if left.get(p) else 0.0 for p in points.pairs])

    def _keep(self, points: TouchPoints, pressure: Array) -> None:
        self._pressure = {}
        for pair, value in zip(points.pairs, pressure.tolist(), strict=True):
            self._pressure.setdefault(pair, []).append(value)


# --- where they touch ---


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
    points: list[tuple[Array, Array, float, Pair]] = []
    solids: dict[int, list[Shape]] = {}
    for p in found:
        key = (p.link, p.shape, p.piece)
        deepest = -p.distance - rest.get(key, 0.0)
        if deepest < -reach:
            continue
        if p.link not in solids:
            solids[p.link] = [s.placed(link_poses[p.link]) for s in scene.hand.links[p.link].shapes]
        corners, below = _points(p, solids[p.link], pieces)
        frame = normal_frame(p.normal)
        points += [(point, frame, deepest - lower, key) for point, lower in zip(corners, below, strict=True)]
    n, (at, frames, depths, pairs) = len(points), zip(*points, strict=True) if points else ((),) * 4
    return TouchPoints(
        np.array(at).reshape(n, 3), np.array(frames).reshape(n, 3, 3), np.array(depths, dtype=float),
        np.array([link for link, *_ in pairs], dtype=np.intp), tuple(pairs),
    )  # fmt: skip


def _points(p: HandObjectPair, solids: list[Shape], pieces: list[Shape]) -> tuple[Array, Array]:
    """(k, 3) corners of the patch on real surfaces, and (k,) how much less deep each is than the deepest."""
    a, b = solids[p.shape], pieces[p.piece]
    corners, hidden = patch_corners(p, solids, pieces, p.normal, (p.on_hand + p.on_object) / 2)
    if len(corners) == 1:
        return corners[~hidden], np.zeros(int((~hidden).sum()))
    plane = normal_frame(p.normal)[:, 1:]
    overlap = _height(a, p.normal, plane, corners) + _height(b, -p.normal, plane, corners)
    return corners[~hidden], (overlap.max() - overlap)[~hidden]


def _height(solid: Shape, n: Array, plane: Array, at: Array) -> Array:
    """(k,) how far the supporting edge or face of a solid reaches along n at points of a patch."""
    points = solid.feature(n, FACE_DEPTH)
    middle = points.mean(axis=0)
    flat = (points - middle) @ plane
    _, s, V = np.linalg.svd(flat, full_matrices=False)
    V = V[s > FLATTEST]
    if not len(V):
        return np.zeros(len(at))
    slope = np.linalg.lstsq(flat @ V.T, (points - middle) @ n, rcond=None)[0]
    out: Array = (at - middle) @ plane @ V.T @ slope
    return out
