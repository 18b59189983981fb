"""A witness: an exact solution of the model that anyone can check with the equations alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.presented import Presented
from handfast.model.grasp import Grasp
from handfast.proofs.states import State
from handfast.stability.problem import judge, model
from handfast.stability.problem.judge import Residuals
from handfast.stability.problem.model import Energy

VALID = 1e-9  # relative residual of a witness, every equation
# of `to_json`
WITNESS_KEYS = "residual", "contacts", "joint_torques", "actuator_forces", "object_motion", "joint_motion"


@dataclass(frozen=True, eq=False)
class Witness(Presented):
    """A state with the grasp, disturbance and commands that it answers for.

    Attributes:
        grasp: the grasp, whose `command` is the one in force.
        wrench: (6,) the disturbance [N, N m].
        state: motions and forces.
        eta: uncertainty of the contact normals [rad].
        mdp: does it have to satisfy the maximum dissipation principle?
    """

    grasp: Grasp
    wrench: Array
    state: State
    eta: float
    mdp: bool

    @cached_property
    def residuals(self) -> Residuals:
        """Relative residuals of (1)-(8), from `stability/model`."""
        return judge.residuals(self.grasp, self.wrench, self.state, eta=self.eta, mdp=self.mdp)

    @property
    def valid(self) -> bool:
        """Does it solve the exact model within 1e-9?"""
        return self.residuals.worst <= VALID

    @cached_property
    def energy(self) -> Energy:
        """Where the virtual work goes."""
        return model.energy(self.grasp, self.wrench, self.state)

    @cached_property
    def forces(self) -> Array:
        """(m, 3) contact forces on the object [N], object frame."""
        c = self.state.c.reshape(-1, 3)
        return np.array([k.frame @ ci for k, ci in zip(self.grasp.contacts, c, strict=True)])

    @cached_property
    def motions(self) -> Array:
        """(m, 3) virtual motions of the object relative to the finger at each contact, object frame."""
        d = model.relative_motion(self.grasp, self.state.r, self.state.q).reshape(-1, 3)
        return np.array([k.frame @ di for k, di in zip(self.grasp.contacts, d, strict=True)])

    @property
    def largest_motion(self) -> float:
        """[N] at unit stiffness: the largest motion at any contact, of the object or against the finger."""
        object_ = (self.grasp.G.T @ self.state.r).reshape(-1, 3)
        relative = model.relative_motion(self.grasp, self.state.r, self.state.q).reshape(-1, 3)
        return float(np.linalg.norm(np.vstack([object_, relative]), axis=1).max())

    @property
    def contact_states(self) -> list[str]:
        """Per contact "open", "stick" or "slide"."""
        g, x = self.grasp, self.state
        d = model.sliding(g, model.relative_motion(g, x.r, x.q), model.turning(g, x.r, x.q))
        c = self.state.c.reshape(-1, 3)
        tiny = VALID * model.force_scale(self.wrench, self.state.c)
        return [
            "open" if ci[0] <= tiny else "slide" if np.linalg.norm(di) > tiny else "stick"
            for ci, di in zip(c, d, strict=True)
        ]

    def to_json(self) -> dict[str, Any]:
        """The keys of a `check` answer; `joint_reactions` besides where joints have laws of their own.

        The contacts of soft fingers have their `torsion`, about the normal.
        """
        forces, motions = self.forces, self.motions
        c = self.state.c.reshape(-1, 3)
        tau = model.joint_torques(self.grasp, self.state.c, self.state.torsion)
        own = zip(self.grasp.joints, self.state.reaction, strict=True)
        reactions = {"joint_reactions": {j.name: float(x) for j, x in own}} if self.grasp.has_laws else {}
        return reactions | {
            "residual": self.residuals.worst,
            "contacts": [
                {
                    "link": contact.link,
                    "position": contact.position.tolist(),
                    "force": forces[i].tolist(),
                    "normal_force": float(c[i, 0]),
                    "friction_force": float(np.linalg.norm(c[i, 1:])),
                    "motion": motions[i].tolist(),
                    "state": self.contact_states[i],
                }
                | ({"torsion": float(self.state.torsion[i])} if contact.torsion else {})
                for i, contact in enumerate(self.grasp.contacts)
            ],
            "joint_torques": {j.name: float(t) for j, t in zip(self.grasp.joints, tau, strict=True)},
            "actuator_forces": dict(zip(self.grasp.mechanism.actuators, self.state.f.tolist(), strict=True)),
            "object_motion": self.state.r.tolist(),
            "joint_motion": {j.name: float(q) for j, q in zip(self.grasp.joints, self.state.q, strict=True)},
        }
