"""A grasp as a MuJoCo scene that closes, squeezes and lifts: hand and object in SI units, servos and their targets.

The object stands on the ground, as firmly as it can. The hand hangs on a slide that lifts it. What the
servos do is told by keyframes, each with a time and the servos' targets: between two of them targets go straight.

Every motor is a position servo. One that is commanded has a force limit, its command, and a target beyond its contact:
it presses with the command wherever the contact is. If it does not turn back, a second servo is its gearing: it pushes
in the closing sense alone, without limit, and its target is where the motor stands: at the grasp's own position while
the hand closes and squeezes, and from "locked" on where it stood when it had squeezed, which is found by running the
scene. A motor without command stands at its target.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import refuse_existing, write_text
from handfast.core.transforms import matrix_quaternion, transform
from handfast.geometry.scene import add_solid
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.model.mesh_pieces import joined
from handfast.readers.configuration_file import GraspParts, load_parts
from handfast.readers.grasp_file import load_grasp
from handfast.simulation.bodies import link_friction
from handfast.simulation.hand_drive import (
    JointResistance,
    MotorDrive,
    backdrivable_motors,
    locked_joints,
    motors_of,
    with_laws_of,
)

SCENE_TIME_STEP = 1e-3  # [s]
SCENE_CREEP_RATIO = 1e3  # mujoco lets what sticks creep: less with a larger one
CONTACT_TIME = 4e-3  # [s] in which overlaps of contacts are undone
SERVO_STIFFNESS, STIFF_SLIDE = 1e3, 1e6  # [N m/rad], [N/m] of servos
ARMATURE, ARMATURE_SLIDE, MASS = 2e-3, 0.1, 0.02  # [kg m^2], [kg] of joints, [kg] of links: files of hands seldom say
DRAG = 0.5  # of a command is spent on viscous friction while the hand closes: what is squeezed comes to rest
GEARING_FORCE = 1e6  # [N m, N] no gearing gives way to less
OPEN_ANGLE = 0.15  # [rad] by which motors that press are open at first
OPEN_SLIDE = 0.01  # [m]
HEIGHT = 0.1  # [m] of the lift
TIMES = {"open": 0.0, "closed": 1.0, "squeezed": 2.0, "locked": 2.1, "lifted": 3.6}  # [s] at which targets are reached
FOOT_HEIGHT = 5e-4  # [m] above the lowest point: what stands on the ground
CLEARLY = 0.1  # by how much of its firmness a side has to be exceeded for the object to stand on something else
_SIDES = [np.array(R, dtype=float) for R in (
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    [[1, 0, 0], [0, -1, 0], [0, 0, -1]], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
)]  # fmt: skip
HAND, OBJECT, GROUND = 1, 2, 4  # bits of what collides
TAKEN = {"world", "object", "lift", "ground"}  # names of the scene's own parts: the hand's are told apart from them


def export_scenes(source: Path, target: Path, *, force: bool = False) -> list[Path]:
    """Write a scene for each grasp file of a folder, or for one; the files that were written.

    Args:
        source: a folder that `plan`, `grasp` or `import` filled, or a grasp file.
        target: a folder, or a file that ends in .xml for one grasp.

    Raises:
        InputError: no grasp files, several and a single target, a target that exists, and as `scene_text`.
    """
    found = sorted({*source.glob("*.grasp.json"), *source.glob("grasp-*.json")}) if source.is_dir() else [source]
    if not found:
        raise InputError("has no grasp files; a folder of `plan`, `grasp` or `import` is needed", source=str(source))
    single = target.suffix.lower() == ".xml"
    if single and len(found) > 1:
        raise InputError(f"is one file for {len(found)} grasps; give a folder", source=str(target))
    files = [target if single else target / f"{f.name.removesuffix('.json').removesuffix('.grasp')}.xml" for f in found]
    for file in files:
        refuse_existing(file, force=force)
    for grasp, file in zip(found, files, strict=True):
        write_text(file, scene_text(load_grasp(grasp)), force=force)
    return files


def scene_text(grasp: Grasp) -> str:
    """The MJCF of a grasp that knows its hand, its object, its configuration and a mass.

    Raises:
        InputError: a file that is missing or has changed, no mass, a hand whose linkage has loops.
    """
    grasp.refuse_soft_fingers("the scene")
    if not grasp.mass:
        raise InputError(
            "is missing; what is lifted needs one: plan or import with --mass", source=grasp.name, field="mass"
        )
    parts = load_parts(grasp)
    if parts.hand.loops:
        raise InputError("has a linkage with loops, which the scene cannot have", source=parts.hand.name)
    return str(_Scene(parts, grasp).spec().to_xml())


def play(model: Any, data: Any, until: float) -> None:
    """Run a scene up to a time [s], its controls straight between the keyframes; the last one's stay.

    Args:
        model, data: an `mujoco.MjModel` of a scene and its `mujoco.MjData`, set to the first keyframe at first.
    """
    import mujoco

    while data.time < until:
        data.ctrl[:] = [np.interp(data.time, model.key_time, ctrl) for ctrl in model.key_ctrl.T]
        mujoco.mj_step(model, data)


def standing(vertices: Array, center: Array) -> Array:
    """(3, 3) turns an object with vertices (n, 3) so that it stands as firmly as it can.

    Firm is what has its centre (3,) far inside of what it stands on, for its height. It stands on a side along its own
    axes, or on a face of its convex hull where that is clearly firmer: a bent object would topple from every side.
    """
    hull = ConvexHull(vertices)
    corners, angles = vertices[hull.vertices], np.linspace(0, 2 * np.pi, 32, endpoint=False)
    around = np.array([np.cos(angles), np.sin(angles)])

    def firmness(R: Array) -> float:
        turned, middle = corners @ R.T, R @ center
        lowest = turned[:, 2].min()
        foot = turned[turned[:, 2] < lowest + FOOT_HEIGHT][:, :2] - middle[:2]
        reach = (foot @ around).max(axis=0).min()  # [m] to the nearest edge
        return round(float(reach / max(middle[2] - lowest, 1e-6)), 6)

    side = max(_SIDES, key=firmness)
    face = max((_onto_ground(n) for n in np.unique(hull.equations[:, :3].round(9), axis=0)), key=firmness)
    firm = firmness(side)
    return face if firmness(face) > firm + CLEARLY * abs(firm) else side


def _onto_ground(normal: Array) -> Array:
    """(3, 3) turns a unit vector (3,) down, on the shortest way."""
    axis, down = np.cross(normal, [0.0, 0.0, -1.0]), -float(normal[2])
    if down < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    K = np.cross(axis, np.eye(3)).T  # K @ v is axis x v
    return np.eye(3) + K + K @ K / (1 + down)


@dataclass(frozen=True, eq=False)
class _Motor:
    """A motor of the hand, in the sense in which its command is positive.

    Attributes:
        row: (l,) its displacement by joint values.
        at: its displacement at the grasp.
        command: [N m, N], 0 or more.
        moves: whether it is commanded, a tendon that may go slack, or backdrivable; else it stands.
        holds: whether it does not turn back.
        slides: whether it moves a slide.
    """

    name: str
    row: Array
    at: float
    command: float
    moves: bool
    holds: bool
    slides: bool

    @classmethod
    def all_of(cls, drive: MotorDrive, hand: Hand, q: Array) -> list[_Motor]:
        """Those of a hand at q (l,), without what swings freely."""
        out = []
        each = zip(drive.names, drive.rows, drive.command, drive.moves, drive.holds, strict=True)
        for name, closing, f, moves, holds in each:
            row = -closing if f < 0 else closing
            slides = any(hand.joints[j].type == "prismatic" for j in np.flatnonzero(row))
            if f or holds:
                out.append(cls(name, row, float(row @ q), abs(float(f)), bool(moves), bool(holds), slides))
        return out

    @property
    def tendon(self) -> str:
        return f"motor {self.name}"

    @property
    def size(self) -> float:
        """Square of what it moves by when its joints move by 1: from joints' stiffness to its own."""
        return float(self.row @ self.row)

    @property
    def opening(self) -> float:
        """By how much it is open at first if it presses, in its displacement."""
        return (OPEN_SLIDE if self.slides else OPEN_ANGLE) * self.size / float(np.abs(self.row).max())

    @property
    def gains(self) -> tuple[float, float]:
        """kp and kd of its servos."""
        stiffness, mass = (STIFF_SLIDE, ARMATURE_SLIDE) if self.slides else (SERVO_STIFFNESS, ARMATURE)
        return stiffness / self.size, 2 * np.sqrt(stiffness * mass) / self.size

    def targets(self, when: str, squeezed: float) -> list[float]:
        """Of its servo, and of its gearing if it has one; `squeezed` is where it stood then."""
        if not self.command:
            return [self.at]
        beyond = {"open": -self.opening, "closed": 0.0}.get(when, self.opening)
        stands = {"open": self.at - self.opening, "closed": self.at, "squeezed": self.at}.get(when, squeezed)
        return [self.at + beyond, stands] if self.holds else [self.at + beyond]


class _Scene:
    """One scene in the making."""

    def __init__(self, parts: GraspParts, grasp: Grasp) -> None:
        self.hand, self.q, self.grasp = with_laws_of(parts.hand, grasp, parts.q, parts.pose), parts.q, grasp
        self.body = body = parts.body
        solid, _ = joined([piece.triangles() for piece in body.pieces])
        self.center = body.center_of_mass if grasp.center_of_mass is None else grasp.center_of_mass
        R = standing(solid, self.center)
        self.at = transform([0.0, 0.0, -float((solid @ R[2]).min())], R)  # (4, 4) of the object
        self.base = self.at @ np.linalg.inv(parts.pose)
        turning, own = backdrivable_motors(grasp), motors_of(grasp, self.hand)
        self.drive = MotorDrive.of(self.hand, grasp.preload, own, turning, locked_joints(grasp))
        self.motors = _Motor.all_of(self.drive, self.hand, self.q)
        self.couplings = () if self.drive.direct else self.hand.couplings

    def spec(self) -> Any:
        """The model, not compiled."""
        import mujoco

        spec = mujoco.MjSpec()
        spec.modelname = f"{self.hand.name} lifts {self.body.name}"
        spec.compiler.degree = False
        spec.option.timestep, spec.option.impratio = SCENE_TIME_STEP, SCENE_CREEP_RATIO
        spec.option.cone, spec.option.integrator = (
            mujoco.mjtCone.mjCONE_ELLIPTIC,
            mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
        )
        spec.worldbody.add_light(pos=[0, 0, 2])
        spec.worldbody.add_geom(
            name="ground", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 0.1], contype=GROUND, conaffinity=OBJECT
        )
        self._add_object(spec)
        self._add_hand(spec)
        self._add_ties(spec)
        self._add_servos(spec)
        start = self._start().tolist()
        squeezed = {motor.name: motor.at for motor in self.motors}
        for name, time in TIMES.items():
            if name == "locked":
                squeezed = self._squeezed(spec.compile())
            ctrl = [t for motor in self.motors for t in motor.targets(name, squeezed[motor.name])]
            spec.add_key(name=name, time=time, qpos=start, ctrl=[*ctrl, HEIGHT if name == "lifted" else 0.0])
        return spec

    def _squeezed(self, model: Any) -> dict[str, float]:
        """Where the motors stand when the hand has squeezed."""
        import mujoco

        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        play(model, data, TIMES["squeezed"])
        return {motor.name: float(data.tendon(motor.tendon).length[0]) for motor in self.motors}

    def _add_object(self, spec: Any) -> None:
        turn = matrix_quaternion(self.at[:3, :3]).tolist()
        body = spec.worldbody.add_body(name="object", pos=self.at[:3, 3].tolist(), quat=turn)
        body.add_freejoint(name="object")
        center = self.center
        arms = self.body.vertices - center
        C = float(self.grasp.mass or 0.0) * arms.T @ arms / len(arms)
        about = np.trace(C) * np.eye(3) - C
        body.mass, body.ipos, body.explicitinertial = self.grasp.mass, center.tolist(), 1
        body.fullinertia = about[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
        for k, piece in enumerate(self.body.pieces):
            add_solid(spec, body, f"object/{k}", piece, **_touching(0.0), contype=OBJECT, conaffinity=HAND | GROUND)

    def _add_hand(self, spec: Any) -> None:
        import mujoco

        R, friction = self.base[:3, :3], link_friction(self.grasp)
        mount = spec.worldbody.add_body(
            name="lift", pos=self.base[:3, 3].tolist(), quat=matrix_quaternion(R).tolist(), gravcomp=1,
            mass=1.0, ipos=[0, 0, 0], inertia=[1e-2] * 3, explicitinertial=1,
        )  # fmt: skip
        mount.add_joint(name="lift", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=R[2].tolist())
        made: list[Any] = []
        for link in self.hand.links:
            parent = made[link.parent] if link.parent >= 0 else mount
            place = link.pose if link.parent >= 0 else np.eye(4)
            body = parent.add_body(
                name=_named(link.name), pos=place[:3, 3].tolist(), quat=matrix_quaternion(place[:3, :3]).tolist(),
                gravcomp=1, mass=MASS, ipos=[0, 0, 0], inertia=[1e-5] * 3, explicitinertial=1,
            )  # fmt: skip
            made.append(body)
            for j in link.joints:
                joint = self.hand.joints[j]
                turns = joint.type == "revolute"
                body.add_joint(
                    name=_named(joint.name), axis=joint.axis.tolist(), pos=joint.anchor.tolist(), ref=joint.ref,
                    type=mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE,
                    range=[joint.lower, joint.upper], limited=bool(joint.lower < joint.upper),
                    armature=ARMATURE if turns else ARMATURE_SLIDE, damping=[0.01 if turns else 1.0, 0, 0],
                )  # fmt: skip
            for n, shape in enumerate(link.shapes):
                add_solid(
                    spec, body, f"{_named(link.name)}/{n}", shape,
                    **_touching(friction[link.name]), contype=HAND, conaffinity=0,
                )  # fmt: skip

    def _add_ties(self, spec: Any) -> None:
        """Couplings as they are at the grasp, whose clutches may have opened, joints that are locked, and springs."""
        import mujoco

        joints = self.hand.joints
        away = [q - j.ref for q, j in zip(self.q, joints, strict=True)]
        ties = [(int(np.flatnonzero(row)[0]), -1, 0.0) for row in self.drive.held]
        ties += [(c.joint, c.driver, c.ratio) for c in self.couplings]
        for joint, driver, ratio in ties:
            tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=_named(joints[joint].name))
            if driver >= 0:
                tie.name2 = _named(joints[driver].name)
            tie.objtype = mujoco.mjtObj.mjOBJ_JOINT
            tie.data[:5] = [away[joint] - ratio * (away[driver] if driver >= 0 else 0.0), ratio, 0, 0, 0]
        resists = JointResistance.of(self.hand)
        for n, (law, row) in enumerate(zip(resists.laws, resists.rows, strict=True)):
            tendon = self._tendon(spec, f"resists {n}", row)
            tendon.stiffness, tendon.springlength = [law.stiffness, 0, 0], law.rest
            tendon.frictionloss = law.friction

    def _tendon(self, spec: Any, name: str, row: Array) -> Any:
        tendon = spec.add_tendon(name=name)
        for joint, weight in zip(self.hand.joint_names, row, strict=True):
            if weight:
                tendon.wrap_joint(_named(joint), float(weight))
        return tendon

    def _add_servos(self, spec: Any) -> None:
        import mujoco

        def servo(name: str, kind: Any, target: str, gains: tuple[float, float], *limits: float) -> None:
            made = spec.add_actuator(name=name, trntype=kind, target=target)
            made.gaintype, made.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
            made.gainprm[0], made.biasprm[:3] = gains[0], [0.0, -gains[0], -gains[1]]
            if limits:
                made.forcelimited, made.forcerange = 1, limits

        by_tendon = mujoco.mjtTrn.mjTRN_TENDON
        for motor in self.motors:
            tendon = self._tendon(spec, motor.tendon, motor.row)
            if motor.command:
                tendon.damping = [DRAG * motor.command * TIMES["closed"] / motor.opening, 0, 0]
                servo(_named(motor.name), by_tendon, tendon.name, motor.gains, -motor.command, motor.command)
                if motor.holds:
                    servo(f"{motor.name} gearing", by_tendon, tendon.name, motor.gains, 0.0, GEARING_FORCE)
            elif motor.moves:  # a tendon, which pulls alone
                servo(_named(motor.name), by_tendon, tendon.name, motor.gains, 0.0, GEARING_FORCE)
            else:
                servo(_named(motor.name), by_tendon, tendon.name, motor.gains)
        servo("lift", mujoco.mjtTrn.mjTRN_JOINT, "lift", (2e4, 2e3))

    def _start(self) -> Array:
        """The coordinates of the model at first: the object on the ground, the hand open."""
        q = self.q.copy()
        for motor in self.motors:
            if motor.command:
                q -= motor.opening * motor.row / motor.size
        for c in self.couplings:
            if c.driver >= 0:
                q[c.joint] = self.q[c.joint] + c.ratio * (q[c.driver] - self.q[c.driver])
        q = np.clip(q, *self.hand.limits.T)
        order = [j for link in self.hand.links for j in link.joints]
        return np.r_[self.at[:3, 3], matrix_quaternion(self.at[:3, :3]), 0.0, q[order]]


def _named(name: str) -> str:
    """The scene's name of a link, joint or motor of the hand."""
    return f"hand {name}" if name in TAKEN else name


def _touching(friction: float) -> dict[str, Any]:
    """How a solid touches: of two, the larger friction counts."""
    return {"mass": 0, "friction": [friction, 0.0, 0.0], "condim": 3, "solref": [CONTACT_TIME, 1.0]}
