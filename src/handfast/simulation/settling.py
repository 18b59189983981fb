"""Where a grasp ends up that slips: followed in slow steps until nothing moves, and asked about again there."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array, frozen
from handfast.core.errors import InputError, kinds_checked, refuse_other_kinds
from handfast.geometry.contacts import THRESHOLD, contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.readers.configuration_file import load_parts
from handfast.simulation.bodies import link_friction
from handfast.simulation.hand_drive import (
    MotorDrive,
    backdrivable_motors,
    locked_joints,
    motors_of,
    other_joints,
    with_laws_of,
)
from handfast.simulation.settled import PathPoint, Rest, Settled
from handfast.simulation.simulate import force_unit, simulate
from handfast.simulation.slow_motion import (
    CARRIES,
    DRAG_STIFFNESS,
    MAX_STEP_MOTION,
    MIN_STEP_MOTION,
    Moved,
    PointLoad,
    SlowMotion,
)
from handfast.stability.answers import CheckAnswer, MaxAnswer
from handfast.stability.answers.load_path import LoadPath, comes_after
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.settings import Loading, Settings
from handfast.stability.studies.questions import check, maximum

MAX_SETTLING_STEPS = 2000
COMMAND_PARTS, LOADS = 4, 20  # equal parts in which commands and load come
RESTING = 3  # whole steps in a row at the full load that move nothing
SLID = 2.0  # steps' worth of the longest step: a part of the load that moves it farther made it slip
SETTLING_SETTINGS = Settings(timeout=20.0)
NO_STATE = "no state of the commands alone is shown: it is followed from rest"
MAX_CONTACT_GAP = 1e-3  # [m] a contact of the file with none of the shapes' so near is told of

OnPath = Callable[[float, float], None]


@dataclass(frozen=True, eq=False)
class GraspInScene:
    """A grasp with the solids that it is between.

    Attributes:
        grasp: commands, friction and contacts as asked about.
        scene: hand and object.
        q, pose: joints (l,) and object (4, 4), hand's base frame.
        names: of hand and object, for the configuration file.
    """

    grasp: Grasp
    scene: Scene
    q: Array
    pose: Array
    names: tuple[str | None, str | None] = (None, None)

    @classmethod
    def of(cls, grasp: Grasp) -> GraspInScene:
        """From the files that the grasp's provenance names.

        Raises:
            InputError: it names none, they are gone or have changed, or cannot be read.
        """
        parts = load_parts(grasp, "settle needs their shapes; make the grasp with contacts, close or plan")
        hand = with_laws_of(parts.hand, grasp, parts.q, parts.pose)
        return cls(grasp, Scene(hand, parts.body), parts.q, parts.pose, parts.files)

    @property
    def hand(self) -> Hand:
        return self.scene.hand

    @property
    def body(self) -> Body:
        return self.scene.body

    @property
    def mechanism(self) -> Literal["hand", "direct"]:
        """Whose motors the grasp has, see `motors_of`."""
        return motors_of(self.grasp, self.hand)


@dataclass(frozen=True, eq=False, kw_only=True)
class SettleOptions:
    """How a grasp is followed to where it ends up.

    Attributes:
        at: (3,) [m] the point of the object, object frame, at which the force acts: it moves along, and the force keeps
            its direction in the hand. A weight acts at the centre of mass. What torque is left keeps its direction.
        follow: also a grasp that `check` certifies.
        distance: [m] beyond which it has left; the grasp's size, or the object's if that is smaller, unless given.
        steps: the most there may be.
        judge: ask how much of the load the last grasp resists, and what `simulate` says of it.
        loading: as of `check`, which is so asked about both grasps.
        settings: of `check` and `maximum`, 20 s each unless given.

    Raises:
        InputError: a distance that is not above 0, no steps, an unknown way of loading.
    """

    at: Sequence[float] | Array = (0.0, 0.0, 0.0)
    follow: bool = False
    distance: float | None = None
    steps: int = MAX_SETTLING_STEPS
    judge: bool = True
    loading: Loading = "together"
    settings: Settings | None = None

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        comes_after(self.loading)
        if self.distance is not None and not (np.isfinite(self.distance) and self.distance > 0):
            raise InputError(f"is {self.distance}; a length above 0 [m] is needed", field="distance")
        if self.steps < 1:
            raise InputError(f"is {self.steps}; at least 1 is needed", field="steps")


@kinds_checked
def settle(
    grasp: Grasp | GraspInScene,
    wrench: Sequence[float] | Array,
    *,
    on_progress: OnPath | None = None,
    **options: Any,
) -> Settled:
    """Where does the grasp end up under a load that it does not resist?

    If `check` does not certify the grasp as it stands, it is followed in steps of a slow motion (`drag_step`): first
    the commands come, then the load, in parts, each when nothing moves any more. Contacts are found anew in the real
    shapes before each step. The grasp at rest is asked about by `check`: it alone decides between settles and rests.
    Deterministic. With `loading="preload-first"` the motion goes on from where the load's path ends: hand, object and
    gearings stand as its last state says, and the load is what that state carries.

    Args:
        grasp: whose provenance names hand, object and configuration, or with its scene.
        wrench: (6,) force [N] and torque [N m] on the object at its origin, object frame, or (3,) a force.
        on_progress: called after each step with the share of the load and the distance moved [m].
        options: of `SettleOptions`, by name: `settle(grasp, [0, 1, 0], judge=False)`.

    Raises:
        InputError: no files or changed ones, a wrench of another length, nothing that acts, soft fingers.
    """
    begun = time.perf_counter()
    asked = SettleOptions(**options)
    settings, loading = asked.settings or SETTLING_SETTINGS, asked.loading
    placed = grasp if isinstance(grasp, GraspInScene) else GraspInScene.of(grasp)
    grasp = placed.grasp
    grasp.refuse_soft_fingers("settling")
    w = np.asarray(wrench, dtype=float).ravel()
    w = frozen(np.r_[w, 0, 0, 0] if len(w) == 3 else w, (6,), "wrench")
    length = _length(placed)
    bound = length if asked.distance is None else asked.distance
    load = _point_load(w, frozen(asked.at, (3,), "at"), placed.pose)
    before = certified(grasp, w, settings, loading)
    found = Settled(
        Rest.HOLDS, grasp, before, w, (), placed.hand.joint_names, None, "load", grasp, before, w, None, None, "",
        placed.scene, 0.0, _notes(placed), loading,
    )  # fmt: skip
    if asked.follow or before is None or before.verdict is not Verdict.HOLDS:
        motion = _motion(placed, load, (force_unit(grasp, w), length))
        of_load = None if before is None or not isinstance(before.path, LoadPath) else before.path
        if loading != "together" and (of_load is None or not of_load.held):
            found = replace(found, notes=(*found.notes, NO_STATE))
        path, onset, ending = _followed(motion, placed, bound, asked.steps, on_progress, of_load)
        found = replace(found, rest=ending, path=tuple(path), onset=onset[0], onset_of=onset[1])
        found = replace(found, last=None, after=None, last_wrench=None)
        if ending is Rest.RESTS:
            found = _asked_again(found, placed, motion, load.wrench(motion.pose), settings, asked.judge)
    return replace(found, seconds=time.perf_counter() - begun)


def _asked_again(
    found: Settled, placed: GraspInScene, motion: SlowMotion, wrench: Array, settings: Settings, judge: bool
) -> Settled:
    """What is at rest, with the grasp that is there and what is said of it under the load (6,) as it acts there."""
    last = _last(placed, motion)
    if last is None:
        return replace(found, notes=(*found.notes, "at rest it touches nothing"))
    after = certified(last, wrench, settings, found.loading)
    notes = found.notes
    if after is None:
        notes = (*notes, "no forces whatever at the contacts found at rest balance the load exactly")
    most, simulated = _judged(last, wrench, settings, found.loading) if judge else (None, "")
    closing = {j.name: int(s) for j, s in zip(placed.hand.joints, placed.hand.closing, strict=True)}
    configuration = Configuration.of(
        placed.hand, motion.q, motion.pose, hand=placed.names[0], object=placed.names[1],
        closing=closing, preload=last.preload or None,
    )  # fmt: skip
    rest = Rest.SETTLES if after is not None and after.verdict is Verdict.HOLDS else Rest.RESTS
    return replace(
        found, rest=rest, last=last, after=after, last_wrench=wrench, most=most, simulated=simulated,
        placed=configuration, notes=notes,
    )  # fmt: skip


def certified(grasp: Grasp, wrench: Array, settings: Settings, loading: Loading = "together") -> CheckAnswer | None:
    """What `check` says; None where no forces whatever at the contacts balance the load, which it refuses."""
    scaled_problem.as_wrench(wrench, "wrench")
    unbalanced = scaled_problem.unbalanced(grasp, wrench)
    return None if unbalanced else check(grasp, wrench, loading=loading, settings=settings)


def _point_load(w: Array, at: Array, pose: Array) -> PointLoad:
    R = pose[:3, :3]
    return PointLoad(R @ w[:3], at, R @ (w[3:] - np.cross(at, w[:3])))


def _length(placed: GraspInScene) -> float:
    """[m] the grasp's size; where its contacts are nearly one point, or the object is smaller, of the object's."""
    radius = float(np.linalg.norm(np.ptp(placed.body.vertices, axis=0))) / 2
    return float(np.clip(placed.grasp.size, radius / 4, radius))


def _motion(placed: GraspInScene, load: PointLoad, units: tuple[float, float]) -> SlowMotion:
    """The scene at the beginning: what is near enough to be a contact touches without pressing."""
    grasp = placed.grasp
    drive = MotorDrive.of(
        placed.hand, grasp.preload, placed.mechanism, backdrivable_motors(grasp), locked_joints(grasp)
    )
    near = placed.scene.nearest(placed.q, placed.pose, THRESHOLD)
    rest = {(p.link, p.shape, p.piece): -p.distance for p in near}
    friction, middle = link_friction(grasp, float(grasp.mu.min())), grasp.middle
    return SlowMotion(placed.scene, placed.q, placed.pose, drive, load, units, friction, middle, rest)


def _gone_on(motion: SlowMotion, placed: GraspInScene, path: LoadPath) -> PathPoint:
    """The motion at the end of a load's path, whose springs have unit stiffness, and what is there."""
    from scipy.spatial.transform import Rotation

    grasp, share = placed.grasp, path.reached
    w = path.held[-1].witness
    assert share is not None
    assert w is not None
    per = DRAG_STIFFNESS * motion.force / motion.length  # [N/m] of a contact
    r, q = (x / per for x in path.moved)
    axes, _ = placed.hand.joint_axes(placed.q)
    joints = {}
    for joint, far in zip(grasp.joints, q.tolist(), strict=True):
        if joint.name in placed.hand.joint_names:  # the length of a tendon is none of them
            axis = placed.pose[:3, :3].T @ axes[placed.hand.joint(joint.name)]
            joints[joint.name] = far * float(np.sign(axis @ joint.axis))
    motion.begin_at(Rotation.from_rotvec(r[3:]).as_matrix(), r[:3], joints, share)
    c_n = w.state.c[::3]
    carries = c_n > CARRIES * motion.force
    links = tuple(str(c.link) for c, there in zip(grasp.contacts, carries, strict=True) if there)
    moved = _distance(grasp.positions, placed.pose, motion.pose)
    return PathPoint(share, moved, motion.pose, motion.q, links, grasp.positions[carries], c_n[carries])


def _followed(
    motion: SlowMotion,
    placed: GraspInScene,
    bound: float,
    steps: int,
    on_progress: OnPath | None,
    of_load: LoadPath | None = None,
) -> tuple[list[PathPoint], tuple[float | None, str], Rest]:
    """The path, at which share of what it first slipped, and whether it is at rest, has left or still moves.

    of_load: the load's path from whose last state it goes on, if it has one.
    """
    start, points = motion.pose, placed.grasp.positions
    nothing = np.zeros((0, 3)), np.zeros(0)
    path = [PathPoint(0.0, 0.0, motion.pose, motion.q, (), *nothing)]
    onset: tuple[float | None, str] = (None, "load")
    loading = not placed.grasp.preload  # nothing to command: the load begins at once
    if of_load is not None and of_load.held:
        loading = True
        path.append(_gone_on(motion, placed, of_load))
    else:
        motion.driven, motion.share = (1.0, 1.0 / LOADS) if loading else (1.0 / COMMAND_PARTS, 0.0)
    quiet, since = 0, 0.0
    for _ in range(steps):
        done = motion.step()
        moved = _distance(points, start, motion.pose)
        path.append(_path_point(motion, done, moved))
        if on_progress:
            on_progress(motion.share, moved)
        since += done.far
        if onset[0] is None and since > SLID * MAX_STEP_MOTION:
            onset = (motion.share, "load") if loading else (motion.driven, "commands")
        if moved > bound:
            return path, onset, Rest.LEAVES
        quiet = quiet + 1 if done.whole and done.far <= MIN_STEP_MOTION else 0
        if quiet == 0:
            continue
        if motion.share >= 1 and quiet >= RESTING:
            return path, onset, Rest.RESTS
        if motion.share < 1:
            quiet, since = 0, 0.0
            if motion.driven < 1:
                motion.driven = min(1.0, motion.driven + 1 / COMMAND_PARTS)
            else:
                loading, motion.winding = True, True
                motion.share = min(1.0, round(motion.share + 1 / LOADS, 9))
    return path, onset, Rest.UNDECIDED


def _distance(points: Array, start: Array, pose: Array) -> float:
    """[m] the farthest that any of the object's points has gone."""
    first = points @ start[:3, :3].T + start[:3, 3]
    now = points @ pose[:3, :3].T + pose[:3, 3]
    return float(np.linalg.norm(now - first, axis=1).max())


def _path_point(motion: SlowMotion, done: Moved, moved: float) -> PathPoint:
    carries = done.pressure > CARRIES * motion.force
    R, t = motion.pose[:3, :3], motion.pose[:3, 3]
    links = tuple(motion.hand.links[int(i)].name for i in done.points.links[carries])
    return PathPoint(
        motion.share, moved, motion.pose, motion.q, links, (done.points.positions[carries] - t) @ R,
        done.pressure[carries],
    )  # fmt: skip


def _last(placed: GraspInScene, motion: SlowMotion) -> Grasp | None:
    """The grasp where the motion stands, with the commands of those actuators that move a contact."""
    try:
        bare = contact_grasp(
            placed.hand, motion.q, placed.body, motion.pose, mechanism=placed.mechanism, scene=placed.scene,
            lock=locked_joints(placed.grasp), backdrivable=backdrivable_motors(placed.grasp),
            name=f"{placed.grasp.name} settled",
        )  # fmt: skip
    except InputError:
        return None
    mu = link_friction(placed.grasp, float(placed.grasp.mu.min()))
    contacts = [replace(c, friction=mu[c.link]) for c in bare.contacts]
    kept = {n: f for n, f in placed.grasp.preload.items() if n in bare.mechanism.actuators}
    last = Grasp(contacts, bare.joints, bare.mechanism, kept, bare.name)
    mass = placed.grasp.mass if placed.grasp.mass is not None else bare.mass
    centre = placed.grasp.center_of_mass if placed.grasp.center_of_mass is not None else bare.center_of_mass
    return last.about(mass=mass, center_of_mass=centre, provenance=bare.provenance)


def _judged(last: Grasp, wrench: Array, settings: Settings, loading: Loading) -> tuple[MaxAnswer | None, str]:
    """How much of the load the last grasp resists, and how a simulation of it ends."""
    asked = wrench.any() and not scaled_problem.unbalanced(last, wrench)
    most = maximum(last, wrench, loading=loading, settings=settings) if asked else None
    return most, str(simulate(last, wrench, ramp=4.0).ending)


def _notes(placed: GraspInScene) -> tuple[str, ...]:
    """What of the grasp is not what its shapes say."""
    try:
        found = contact_grasp(placed.hand, placed.q, placed.body, placed.pose, scene=placed.scene).positions
    except InputError as fault:
        raise InputError(f"its hand does not touch the object: {fault}", source=placed.grasp.name) from None
    apart = np.linalg.norm(placed.grasp.positions[:, None] - found[None], axis=2)
    off = int((apart.min(axis=1) > MAX_CONTACT_GAP).sum())
    more = int((apart.min(axis=0) > MAX_CONTACT_GAP).sum())
    notes = [f"{off} of the file's contacts are more than 1 mm from any contact of the shapes"] if off else []
    notes += [f"{more} contacts of the shapes are none of the file's"] if more else []
    differs = other_joints(placed.hand, placed.grasp, placed.q, placed.pose)
    if differs:
        notes.append(f"not as the hand's file has it, and at rest as there: {', '.join(differs)}")
    return tuple(notes)
