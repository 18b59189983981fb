"""The twin in motion: commands, load and gearings, one step of the engine after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import cross, matrix_quaternion
from handfast.model.grasp import Grasp
from handfast.simulation.twin import DRAG_TIME, TWIN_CREEP_RATIO, Twin


@dataclass(frozen=True, eq=False)
class Moment:
    """What is measured at one moment, in the twin's units.

    Attributes:
        time: [s].
        load: share of the wrench that acts.
        shift: (3,) the object's displacement at the contacts' middle, and turn: (3,) its rotation vector [rad].
        joints: (f,) displacement of the free joints.
        forces: (m, 3) contact forces on the object: normal, and two tangential components, in the contacts' frames.
        places: (m + s, 3) displacements of the object's points at the contacts, and of one beside each soft finger, a
            grasp size away: it may turn about its normal.
        speed: largest speed of such a point.
        points: how many contact points the engine has.
    """

    time: float
    load: float
    shift: Array
    turn: Array
    joints: Array
    forces: Array
    places: Array
    speed: float
    points: int

    @property
    def moved(self) -> float:
        return float(np.linalg.norm(self.places, axis=1).max())

    @classmethod
    def nothing(cls, contacts: int, joints: int) -> Moment:
        """The beginning."""
        still = np.zeros((contacts, 3))
        return cls(0.0, 0.0, np.zeros(3), np.zeros(3), np.zeros(joints), still, still, 0.0, 0)


class Stepper:
    """Steps a twin under a load.

    A gearing that does not turn backwards is the lower limit of its actuator's displacement, moved along as the
    actuator closes: it carries what is more than the command and nothing else. docs/simulation.md compares other ways.
    """

    def __init__(self, twin: Twin, grasp: Grasp, wrench: Array) -> None:
        """At rest, untouched.

        Args:
            grasp: whose twin it is.
            wrench: (6,) the full load about the object's origin, in the twin's units.
        """
        import mujoco

        self._mujoco, self._twin, self._model = mujoco, twin, twin.model
        self.data: Any = mujoco.MjData(twin.model)
        self._model.tendon_range[list(twin.gear), 0] = 0.0
        self._object = int(self._model.body("object").id)
        at = int(self._model.joint("object").id)
        self._q, self._v = int(self._model.jnt_qposadr[at]), int(self._model.jnt_dofadr[at])
        points = grasp.positions / twin.length
        self._middle = points.mean(axis=0)
        self._arms = points - self._middle
        self._frames = np.array([c.frame for c in grasp.contacts])
        self._marks = np.vstack([self._arms, self._arms[grasp.soft] + self._frames[grasp.soft, :, 1]])
        self._wrench = wrench
        self._close = twin.given + twin.drive @ twin.command
        self._rubs = twin.model.dof_frictionloss.copy()
        self._gears = [t for t, winds in zip(twin.gear, twin.winds, strict=True) if winds]
        self._contact_of = self._tips(len(points))
        self.load = 0.0
        self.rubs = bool(np.any(twin.model.dof_frictionloss))  # whether a joint has dry friction
        self.winding = True  # whether gearings follow
        mujoco.mj_forward(self._model, self.data)

    def place(self, joints: Array, pose: Array) -> None:
        """Begin elsewhere, at rest: gearings stand where that brings their actuators.

        Args:
            joints: (f,) displacements of the free joints, in the twin's units.
            pose: (4, 4) of the object, in the twin's units.
        """
        for copies, value in zip(self._twin.copies, joints, strict=True):
            self.data.qpos[list(copies)] = value
        self.data.qpos[self._q : self._q + 3] = pose[:3, 3]
        self.data.qpos[self._q + 3 : self._q + 7] = matrix_quaternion(pose[:3, :3])
        self._mujoco.mj_forward(self._model, self.data)
        for t in self._twin.gear:
            self._model.tendon_range[t, 0] = self.data.ten_length[t]

    def soften(self, times: float) -> None:
        """Make what the engine gives way in sticking contacts so many times as large; it creeps as much faster."""
        self._model.opt.impratio = TWIN_CREEP_RATIO / times

    def command(self, share: float) -> None:
        """From now on every motor has this share of its command, and joints of their given torques and friction.

        What rubs with all its friction while the command is still small would keep the hand from touching.
        """
        self._model.dof_frictionloss[:] = share * self._rubs
        self._close = share * (self._twin.given + self._twin.drive @ self._twin.command)

    def run(self, steps: int, load_step: float = 0.0) -> None:
        """Go on by some steps, the load growing by `load_step` in each.

        Raises:
            FloatingPointError: the engine's numbers have run away.
        """
        # plain numbers: for vectors of three, arrays would take longer than the engine's step
        d, m, step = self.data, self._model, self._mujoco.mj_step
        R, velocity = d.xmat[self._object].reshape(3, 3), d.qvel[self._v : self._v + 6]
        applied = d.xfrc_applied[self._object]
        origin, middle, driven = d.xpos[self._object], d.xipos[self._object], d.qfrc_applied
        drag = 1.0 / DRAG_TIME
        turning_drag = drag * float(m.body_inertia[self._object][0])
        wx, wy, wz, tx, ty, tz = self._wrench.tolist()
        for _ in range(steps):
            self.load += load_step
            load = self.load
            v0, v1, v2, *_ = velocity.tolist()
            a, b, c = (R @ velocity[3:]).tolist()
            x, y, z = (R @ self._middle).tolist()
            # the force acts at the object's origin, which moves along with it; its direction stays
            (ox, oy, oz), (mx, my, mz) = origin.tolist(), middle.tolist()
            ax, ay, az = ox - mx, oy - my, oz - mz
            fx, fy, fz = load * wx, load * wy, load * wz
            applied[:] = (
                fx - drag * (v0 + (b * z - c * y)),
                fy - drag * (v1 + (c * x - a * z)),
                fz - drag * (v2 + (a * y - b * x)),
                load * tx + (ay * fz - az * fy) - turning_drag * a,
                load * ty + (az * fx - ax * fz) - turning_drag * b,
                load * tz + (ax * fy - ay * fx) - turning_drag * c,
            )
            driven[:] = self._close
            step(m, d)
            self.hold_gears()
        warned = d.warning[self._mujoco.mjtWarning.mjWARN_BADQACC].number
        if warned or not np.isfinite(d.qpos).all():
            raise FloatingPointError("the engine's numbers have run away")

    def hold_gears(self) -> None:
        """Let the gearings follow what has closed; called after every step."""
        if self.winding:
            for t in self._gears:
                at = self.data.ten_length[t]
                if at > self._model.tendon_range[t, 0]:
                    self._model.tendon_range[t, 0] = at

    def _speed_of_middle(self, R: Array, velocity: Array) -> Array:
        return velocity[:3] + cross(R @ velocity[3:], R @ self._middle)

    def moment(self) -> Moment:
        """What is measured now."""
        d, m = self.data, self._model
        R = d.xmat[self._object].reshape(3, 3)
        velocity = d.qvel[self._v : self._v + 6]
        turning, centre = R @ velocity[3:], self._speed_of_middle(R, velocity)
        places = d.xipos[self._object] - self._middle + self._marks @ (R.T - np.eye(3))
        speeds = [np.linalg.norm(centre + cross(turning, R @ arm)) for arm in self._marks]
        forces = np.zeros((len(self._arms), 3))
        found = np.zeros(6)
        for k in range(d.ncon):
            c = d.contact[k]
            i = self.contact_of(c)
            if i is None:
                continue
            self._mujoco.mj_contactForce(m, d, k, found)
            # mujoco's force is upon its second solid, in a frame whose normal points there, with tangents of its own
            sense = 1.0 if int(m.geom_bodyid[c.geom2]) == self._object else -1.0
            forces[i] += sense * (self._frames[i].T @ R.T @ c.frame.reshape(3, 3).T @ found[:3])
        turn = np.zeros(3)
        self._mujoco.mju_quat2Vel(turn, d.qpos[self._q + 3 : self._q + 7], 1.0)
        return Moment(
            float(d.time), self.load, d.xipos[self._object] - self._middle, turn,
            d.qpos[[int(m.jnt_qposadr[m.dof_jntid[a]]) for a in self._twin.address]], forces, places,
            float(max(speeds)), int(d.ncon),
        )  # fmt: skip

    def _tips(self, contacts: int) -> dict[int, int]:
        return {int(self._model.geom(f"tip {i}").id): i for i in range(contacts)}

    def contact_of(self, point: Any) -> int | None:
        """Index of the grasp's contact to which one of the engine's contact points belongs; None if to none."""
        return self._contact_of[int(point.geom1)]
