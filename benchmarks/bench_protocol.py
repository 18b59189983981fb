"""DexGraspBench's test of a grasp, written anew from its description: MuJoCo, six pushes of the object's weight.

The hand goes from pre-grasp to grasp to squeeze in a hundred steps each, by its own position servos; then a force of
10 m acts on the object, along each of six axes in turn, for two seconds without gravity. The grasp passes if
the object has moved by less than 5 cm and 15 degrees in each. Steps of 4 ms, implicitfast, elliptic cones with
torsional friction, noslip 2, impratio 10. The hand's root follows its path exactly here; there a weld holds it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.transforms import quaternion_matrix, transform

FRICTION = (0.6, 0.02)  # sliding, torsional [m]
MASS, PUSH = 0.1, 1.0  # [kg], [N] = 10 m
FAR, TURNED = 0.05, 15.0  # [m], [degrees]
DEEPEST = 0.01  # [m] of penetration at the pre-grasp
STEPS, WAIT, LOOKS = 100, 50, 10  # per stage; steps between two looks at the object, and how many looks


@dataclass(frozen=True, eq=False)
class Settled:
    """The hand after the squeeze, before any push.

    Attributes:
        joints: values by name. targets: what the servos want, gains: how they push for it, largest: how much at most,
            all by actuator; `largest` has those alone that have a limit.
        root: name of the hand's root body; object_pose: (4, 4) in its frame.
        turned: (3, 3) from the object's frame to the world's, in which pushes are; center: (3,) of mass, in the former.
        positions, normals: (n, 3) of the contacts that press, into the object, in the object's frame; links (n,).
        squeeze: [N] sum of their normal forces. within: how many points the hand's own parts touch each other at.
    """

    joints: dict[str, float]
    targets: dict[str, float]
    gains: dict[str, float]
    largest: dict[str, float]
    root: str
    object_pose: Array
    turned: Array
    center: Array
    positions: Array
    normals: Array
    links: tuple[str, ...]
    squeeze: float
    within: int


@dataclass(frozen=True, eq=False)
class ProtocolOutcome:
    """Per direction −x, +x, −y, +y, −z, +z: held?; `settled` is None if the pre-grasp penetrates too deeply."""

    held: tuple[bool, ...]
    settled: Settled | None

    @property
    def passes(self) -> bool:
        return self.settled is not None and all(self.held)


class GraspBench:
    """A hand and an object in MuJoCo. `run` puts one grasp to the test."""

    def __init__(self, hand: Path, pieces: list[Path], scale: float, friction: tuple[float, float] = FRICTION) -> None:
        import mujoco

        spec = mujoco.MjSpec.from_file(str(hand))
        self.root = spec.worldbody.first_body()
        self.offset = transform(self.root.pos, quaternion_matrix(self.root.quat))
        self.root.mocap = True
        root = self.root.name
        for g in spec.geoms:
            g.solimp[:3], g.solref[:2] = [0.5, 0.99, 0.0001], [0.005, 1]  # the hand is as stiff as its authors say
        thing = spec.worldbody.add_body(name="object")
        thing.add_freejoint()
        for k, piece in enumerate(pieces):
            spec.add_mesh(name=f"piece_{k}", file=str(piece.resolve()), scale=[scale] * 3)
            thing.add_geom(name=f"piece_{k}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"piece_{k}")
        for g in spec.geoms:
            g.friction[:2], g.condim = friction, 4
        option = spec.option
        option.timestep, option.integrator = 0.004, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        option.disableflags = mujoco.mjtDisableBit.mjDSBL_GRAVITY
        option.cone, option.noslip_iterations, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 2, 10
        self.model = m = spec.compile()
        self.data = mujoco.MjData(m)
        self.object, self.palm = m.body("object").id, m.body(root).id
        share = MASS / float(m.body_mass[self.object])
        m.body_mass[self.object] *= share
        m.body_inertia[self.object] *= share
        mujoco.mj_setConst(m, self.data)
        mujoco.mj_forward(m, self.data)
        moment = np.zeros((m.nu, m.nv))
        mujoco.mju_sparse2dense(
            moment, self.data.actuator_moment, self.data.moment_rownnz, self.data.moment_rowadr,
            self.data.moment_colind,
        )  # fmt: skip
        self.moment = moment[:, : m.nv - 6]

    def run(self, stages: tuple[Array, Array, Array], object_pose: Array) -> ProtocolOutcome:
        """Pre-grasp, grasp, squeeze as (7 + joints,) each, and the object's pose (7,), as the layout has them."""
        import mujoco

        m, d = self.model, self.data
        settled = self.squeezed(stages, object_pose)
        if settled is None:
            return ProtocolOutcome((False,) * 6, None)
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.zeros(mujoco.mj_stateSize(m, kind))
        mujoco.mj_getState(m, d, state, kind)
        held = []
        for axis in range(3):
            for sign in (-1.0, 1.0):
                mujoco.mj_setState(m, d, state, kind)
                d.xfrc_applied[self.object, axis] = sign * PUSH
                held.append(self._stays(object_pose))
        return ProtocolOutcome(tuple(held), settled)

    def squeezed(self, stages: tuple[Array, Array, Array], object_pose: Array) -> Settled | None:
        """The hand after the squeeze; None if the pre-grasp penetrates too deeply. Arguments as of `run`."""
        import mujoco

        m, d = self.model, self.data
        mujoco.mj_resetData(m, d)
        d.qpos[:-7], d.qpos[-7:] = stages[0][7:], object_pose
        d.ctrl[:] = self.moment @ stages[0][7:]
        self._place(stages[0][:7])
        mujoco.mj_forward(m, d)
        if d.ncon and float(d.contact.dist.min()) < -DEEPEST:
            return None
        for before, after in ((stages[0], stages[1]), (stages[1], stages[2])):
            for k in range(10):
                at = before + (k + 1) / 10 * (after - before)
                self._place(np.r_[at[:3], at[3:7] / np.linalg.norm(at[3:7])])
                d.ctrl[:] = self.moment @ at[7:]
                mujoco.mj_step(m, d, STEPS // 10)
        return self._settled()

    def _place(self, pose: Array) -> None:
        import mujoco

        at = transform(pose[:3], quaternion_matrix(pose[3:])) @ self.offset
        self.data.mocap_pos[0] = at[:3, 3]
        mujoco.mju_mat2Quat(self.data.mocap_quat[0], at[:3, :3].ravel())

    def _stays(self, object_pose: Array) -> bool:
        import mujoco

        for _ in range(LOOKS):
            mujoco.mj_step(self.model, self.data, WAIT)
            now = self.data.qpos[-7:]
            angle = 2 * np.degrees(np.arccos(min(1.0, abs(float(now[3:] @ object_pose[3:])))))
            if not np.isfinite(now).all() or np.linalg.norm(now[:3] - object_pose[:3]) >= FAR or angle >= TURNED:
                return False
        return True

    def _settled(self) -> Settled:
        import mujoco

        m, d = self.model, self.data
        at = [np.eye(4), np.eye(4)]
        for pose, body in zip(at, (self.palm, self.object), strict=True):
            pose[:3, :3], pose[:3, 3] = d.xmat[body].reshape(3, 3), d.xpos[body]
        inverse = np.linalg.inv(at[1])
        positions, normals, links, squeeze, within = [], [], [], 0.0, 0
        force = np.zeros(6)
        for k in range(d.ncon):
            contact = d.contact[k]
            bodies = [int(m.geom_bodyid[g]) for g in contact.geom]
            if self.object not in bodies:
                within += 1
                continue
            mujoco.mj_contactForce(m, d, k, force)
            if force[0] <= 0:
                continue
            squeeze += float(force[0])
            sense = 1.0 if bodies[1] == self.object else -1.0  # a contact's normal points from its first geom
            positions.append(inverse[:3, :3] @ contact.pos + inverse[:3, 3])
            normals.append(sense * inverse[:3, :3] @ contact.frame[:3])
            links.append(m.body(bodies[0] if bodies[1] == self.object else bodies[1]).name)
        return Settled(
            {m.joint(j).name: float(d.qpos[m.jnt_qposadr[j]]) for j in range(m.njnt - 1)},
            {m.actuator(u).name: float(d.ctrl[u]) for u in range(m.nu)},
            {m.actuator(u).name: float(m.actuator_gainprm[u, 0]) for u in range(m.nu)},
            {m.actuator(u).name: float(m.actuator_forcerange[u, 1]) for u in range(m.nu) if m.actuator_forcelimited[u]},
            m.body(self.palm).name,
            np.linalg.inv(at[0]) @ at[1],
            at[1][:3, :3],
            m.body_ipos[self.object].copy(),
            np.array(positions).reshape(-1, 3),
            np.array(normals).reshape(-1, 3),
            tuple(links),
            squeeze,
            within,
        )


def recorded(path: Path) -> dict[str, Any]:
    """A grasp of DexGraspBench's layout, read without running anything in it."""
    from handfast.datasets.published.array_file import read_array_file

    return dict(read_array_file(path))
