"""A grasp as a MuJoCo scene that closes, squeezes and lifts: hand and object in SI units, servos and their targets.

The object stands on the ground, on the firmest of its six sides. The hand hangs on a slide that lifts it; its motors
are position servos. What they are to do is told by keyframes, each with a time and the servos' targets: between two of
them targets go straight. A servo that is to press with a command f stands f / kp beyond its contact.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import refuse_existing, write_text
from handfast.core.transforms import matrix_quaternion, transform
from handfast.geometry.scene import add_solid
from handfast.model.grasp import Grasp
from handfast.model.servo import servo_commands
from handfast.model.shape import Shape
from handfast.readers.configuration_file import GraspParts, load_parts
from handfast.readers.grasp_file import load_grasp

STEP = 1e-3  # [s]
CREEP_RATIO = 100.0  # mujoco lets what sticks creep: less with a larger one
CONTACT_TIME = 4e-3  # [s] in which overlaps of contacts are undone
STIFF, SLIDE = 50.0, 2e4  # [N m/rad], [N/m] of servos
ARMATURE, MASS = 2e-3, 0.02  # [kg m^2] of joints, [kg] of links: the files of hands seldom say them
OPEN = 0.15  # [rad] by which motors that press are open at first
OPEN_SLIDE = 0.01  # [m]
HEIGHT = 0.1  # [m] of the lift
TIMES = {"open": 0.0, "closed": 1.0, "squeezed": 1.5, "lifted": 3.0}  # [s] at which targets are reached
FOOT = 5e-4  # [m] above the lowest point: what stands on the ground
_SIDES = [np.array(R, dtype=float) for R in (
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    [[1, 0, 0], [0, -1, 0], [0, 0, -1]], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
)]  # fmt: skip
HAND, OBJECT, GROUND = 1, 2, 4  # bits of what collides


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


def standing(vertices: Array, center: Array) -> Array:
    """(3, 3) turns an object with vertices (n, 3) so that it stands as firmly as it can: on one of six sides.

    Firm is what has its centre (3,) far inside of what it stands on, for its height.
    """
    best, firm = np.eye(3), -np.inf
    for R in _SIDES:
        turned, middle = vertices @ R.T, R @ center
        foot = turned[turned[:, 2] < turned[:, 2].min() + FOOT][:, :2] - middle[:2]
        angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        reach = (foot @ np.array([np.cos(angles), np.sin(angles)])).max(axis=0).min()  # [m] to the nearest edge
        steep = float(reach / max(middle[2] - turned[:, 2].min(), 1e-6))
        if steep > firm + 1e-6:
            best, firm = R, steep
    return best


class _Scene:
    """One scene in the making."""

    def __init__(self, parts: GraspParts, grasp: Grasp) -> None:
        self.hand, self.q, self.grasp = parts.hand, parts.q, grasp
        self.body = body = parts.body
        self.mu = float(grasp.mu.min())
        self.center = body.center_of_mass if grasp.center_of_mass is None else grasp.center_of_mass
        R = standing(body.vertices, self.center)
        self.at = transform([0.0, 0.0, -float((body.vertices @ R[2]).min())], R)  # (4, 4) of the object
        self.base = self.at @ np.linalg.inv(parts.pose)
        self.pressing = {n: f for n, f in grasp.preload.items() if f and n in self.hand.mechanism.actuators}

    def spec(self) -> Any:
        """The model, not compiled."""
        import mujoco

        spec = mujoco.MjSpec()
        spec.modelname = f"{self.hand.name} lifts {self.body.name}"
        spec.compiler.degree = False
        spec.option.timestep, spec.option.impratio = STEP, CREEP_RATIO
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
        self._add_servos(spec)
        for name, time in TIMES.items():
            ctrl = [*self._targets(name), HEIGHT if name == "lifted" else 0.0]
            spec.add_key(name=name, time=time, qpos=self._start().tolist(), ctrl=ctrl)
        return spec

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
            self._add_shape(spec, body, f"object/{k}", piece, contype=OBJECT, conaffinity=HAND | GROUND)

    def _add_hand(self, spec: Any) -> None:
        import mujoco

        R = self.base[:3, :3]
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
                name=link.name, pos=place[:3, 3].tolist(), quat=matrix_quaternion(place[:3, :3]).tolist(), gravcomp=1,
                mass=MASS, ipos=[0, 0, 0], inertia=[1e-5] * 3, explicitinertial=1,
            )  # fmt: skip
            made.append(body)
            for j in link.joints:
                joint = self.hand.joints[j]
                turns = joint.type == "revolute"
                body.add_joint(
                    name=joint.name, axis=joint.axis.tolist(), pos=joint.anchor.tolist(), ref=joint.ref,
                    type=mujoco.mjtJoint.mjJNT_HINGE if turns else mujoco.mjtJoint.mjJNT_SLIDE,
                    range=[joint.lower, joint.upper], limited=bool(joint.lower < joint.upper),
                    armature=ARMATURE if turns else 0.1, damping=[0.01 if turns else 1.0, 0, 0],
                    frictionloss=joint.law.friction,
                )  # fmt: skip
            for n, shape in enumerate(link.shapes):
                self._add_shape(spec, body, f"{link.name}/{n}", shape, contype=HAND, conaffinity=0)
        for c in self.hand.couplings:
            first, second = self.hand.joints[c.joint], self.hand.joints[c.driver]
            tie = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=first.name, name2=second.name)
            tie.objtype = mujoco.mjtObj.mjOBJ_JOINT
            tie.data[:5] = [c.offset + c.ratio * second.ref - first.ref, c.ratio, 0, 0, 0]

    def _add_servos(self, spec: Any) -> None:
        import mujoco

        def servo(name: str, kind: Any, target: str, kp: float, kd: float) -> None:
            made = spec.add_actuator(name=name, trntype=kind, target=target)
            made.gaintype, made.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
            made.gainprm[0], made.biasprm[:3] = kp, [0.0, -kp, -kd]

        m = self.hand.mechanism
        for name, row in zip(m.actuators, m.R, strict=True):
            tendon = spec.add_tendon(name=f"motor {name}")
            for joint, weight in zip(self.hand.joint_names, row, strict=True):
                if weight:
                    tendon.wrap_joint(joint, float(weight))
            kp = self.gain(name)
            servo(
                name,
                mujoco.mjtTrn.mjTRN_TENDON,
                f"motor {name}",
                kp,
                2 * np.sqrt(kp * (ARMATURE if kp == STIFF else 0.1)),
            )
        servo("lift", mujoco.mjtTrn.mjTRN_JOINT, "lift", 2e4, 2e3)

    def gain(self, motor: str) -> float:
        """kp of a motor's servo [N m/rad, or N/m where it moves slides]."""
        m = self.hand.mechanism
        moved = np.flatnonzero(m.R[m.actuators.index(motor)])
        return STIFF if all(self.hand.joints[j].type == "revolute" for j in moved) else SLIDE

    def _senses(self) -> Mapping[str, float]:
        """1 where a motor that closes goes to larger values, else -1."""
        m = self.hand.mechanism
        there = {n: float(m.R[m.actuators.index(n)] @ self.q) + 1.0 for n in self.pressing}
        return {n: np.sign(f) for n, f in servo_commands(self.hand, self.q, there, 1.0).items()}

    def _targets(self, when: str) -> list[float]:
        """Of the motors, in their order."""
        m, senses = self.hand.mechanism, self._senses()
        out = []
        for name, row in zip(m.actuators, m.R, strict=True):
            target, kp = float(row @ self.q), self.gain(name)
            if name in self.pressing and when == "open":
                target -= senses[name] * np.sign(self.pressing[name]) * (OPEN if kp == STIFF else OPEN_SLIDE)
            elif name in self.pressing and when != "closed":
                target += senses[name] * self.pressing[name] / kp
            out.append(target)
        return out

    def _start(self) -> Array:
        """The coordinates of the model at first: the object on the ground, the hand open."""
        q, m = self.q.copy(), self.hand.mechanism
        for name, target in zip(m.actuators, self._targets("open"), strict=True):
            row = m.R[m.actuators.index(name)]
            q += (target - row @ self.q) * row / (row @ row)
        named = {n: float(x) for n, x in zip(self.hand.joint_names, q, strict=True)}
        for c in self.hand.couplings:
            named[self.hand.joint_names[c.joint]] = c.offset + c.ratio * named[self.hand.joint_names[c.driver]]
        order = [n for link in self.hand.links for n in (self.hand.joint_names[j] for j in link.joints)]
        lower, upper = (dict(zip(self.hand.joint_names, bound, strict=True)) for bound in self.hand.limits.T)
        hand = [float(np.clip(named[n], lower[n], upper[n])) for n in order]
        return np.r_[self.at[:3, 3], matrix_quaternion(self.at[:3, :3]), 0.0, hand]

    def _add_shape(self, spec: Any, body: Any, name: str, shape: Shape, **bits: int) -> None:
        touch: dict[str, Any] = {"friction": [self.mu, 0.0, 0.0], "condim": 3, "solref": [CONTACT_TIME, 1.0]}
        add_solid(spec, body, name, shape, mass=0, **touch, **bits)
