"""The judge of `stability/model`, for many states of one grasp at once: equations (1) to (8), row by row.

The same residuals as `model.residuals`, and nothing of a search; rows whose numbers are so large or so small that sums
need more than floating point are given to that function itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.core.arrays import Array, Mask
from handfast.model.grasp import Grasp
from handfast.stability.problem import model
from handfast.stability.problem.model import LARGE, VANISHING, State


@dataclass(frozen=True, eq=False)
class StateRows:
    """k states of one grasp, see `model.State`: (k, 6), (k, l), (k, 3m), (k, a), (k, couplings), (k, l)."""

    r: Array
    q: Array
    c: Array
    f: Array
    coupling: Array
    reaction: Array

    def rows(self, which: Mask) -> StateRows:
        """Some of them."""
        parts = self.r, self.q, self.c, self.f, self.coupling, self.reaction
        return StateRows(*(part[which] for part in parts))

    def row(self, i: int) -> State:
        """One of them."""
        return State(self.r[i], self.q[i], self.c[i], self.f[i], self.coupling[i], self.reaction[i])


class Judge:
    """Residuals of states of one grasp under its commands, or others that are given.

    What belongs to the grasp alone is worked out once, so that a single state is judged sooner as well.
    """

    def __init__(self, grasp: Grasp, *, eta: float = 0.0, mdp: bool = True) -> None:
        self.grasp, self.eta, self.mdp = grasp, eta, mdp
        mech = grasp.mechanism
        self.arms = model.joint_arms(grasp)
        self.moment_arm = model.actuator_arms(grasp)
        self.middle, self.units = grasp.positions.mean(axis=0), model.joint_units(grasp)
        self.reach = float(np.abs(grasp.positions).max(initial=0.0))
        self.moves = model.commanded(grasp, np.zeros(mech.a))
        self.backdrivable = np.array(mech.backdrivable, dtype=bool)
        lo, hi = model.reaction_range(grasp)
        self.reaction_range = lo / self.arms, hi / self.arms
        self.slip = np.divide(self.arms, np.abs(mech.A), out=np.zeros(mech.A.shape), where=mech.A != 0)

    def worst(self, wrenches: Array, states: StateRows, commands: Array | None = None) -> Array:
        """(k,) the worst relative residual of each state, NaN where a number is.

        Args:
            wrenches: (k, 6) disturbances [N, N m], object frame.
            states: the candidates.
            commands: (k, a) commanded forces; those of the grasp by default.
        """
        f_c = np.broadcast_to(self.grasp.command, states.f.shape) if commands is None else commands
        with np.errstate(all="ignore"):
            out, plain = self._plain(wrenches, states, f_c)
        if plain.all():
            return out
        numbers = np.isfinite(
            np.concatenate([wrenches, states.r, states.q, states.c, states.f, states.coupling, states.reaction], axis=1)
        )
        for i in np.flatnonzero(~plain & numbers.all(axis=1)):
            options: dict[str, Any] = {"eta": self.eta, "mdp": self.mdp, "command": f_c[i]}
            out[i] = model.residuals(self.grasp, wrenches[i], states.row(int(i)), **options).worst
        return out

    def _plain(self, w: Array, x: StateRows, f_c: Array) -> tuple[Array, Mask]:
        """(k,) the residuals in floating point, and where that will do."""
        g, mech, k = self.grasp, self.grasp.mechanism, len(w)
        c = x.c.reshape(k, g.m, 3)
        largest = np.maximum(np.abs(w).max(axis=1), np.abs(x.c).max(axis=1, initial=0.0))
        F = np.maximum(_norm(w[:, :3]), _norm(w[:, 3:] - _cross(self.middle, w[:, :3])) / g.size)
        for i in np.flatnonzero(F <= 0):
            F[i] = model.load_scale(g, w[i], f_c[i])
        plain = (largest == 0) | (largest >= VANISHING)
        plain &= self._moderate(x, F)

        d = x.r @ g.G - x.q @ g.J.T
        torques = x.c @ g.J
        missing_force = x.c @ g.G.T + w
        missing_torque = torques - x.f @ mech.R - x.coupling @ mech.A
        if g.has_laws:
            missing_torque = missing_torque - g.given_torques - x.reaction
        t = x.q @ mech.R.T
        torque = missing_force[:, 3:] - _cross(self.middle, missing_force[:, :3])
        balance = np.maximum(_norm(missing_force[:, :3]), _norm(torque) / g.size) / F
        joints = np.abs(missing_torque) / (F[:, None] * self.units)

        d3 = d.reshape(k, g.m, 3)
        dt = np.sqrt((d3[:, :, 1:] ** 2).sum(axis=2))
        normal = np.abs(c[:, :, 0] - np.maximum(0.0, -(d3[:, :, 0] * np.cos(self.eta) + dt * np.sin(self.eta))))
        cone = np.sqrt((c[:, :, 1:] ** 2).sum(axis=2)) - g.mu * c[:, :, 0]
        reaction = model.reaction_defect(x.q * self.arms, x.reaction / self.arms, *self.reaction_range)
        parts = [normal, cone, self._actuators(x.f, t, f_c), reaction]
        if self.mdp:
            defect = c[:, :, 1:] * dt[:, :, None] + (g.mu * c[:, :, 0])[:, :, None] * d3[:, :, 1:]
            parts.append((np.abs(defect) / np.maximum(dt, F[:, None])[:, :, None]).reshape(k, -1))
        if len(mech.A):
            parts.append((np.abs(x.q @ mech.A.T)[:, :, None] * self.slip).reshape(k, -1))
        worst = np.concatenate([part / F[:, None] for part in parts] + [joints, balance[:, None]], axis=1)
        return worst.max(axis=1), plain

    def _moderate(self, x: StateRows, F: Array) -> Mask:
        """(k,) where rounding in sums cannot matter, see `model.linear_sums`."""
        g, mech = self.grasp, self.grasp.mechanism
        r = np.abs(x.r)
        largest = np.maximum(r[:, :3].max(axis=1), r[:, 3:].max(axis=1) * (self.reach + g.size))
        largest = np.maximum(largest, np.abs(x.c).max(axis=1, initial=0.0))
        largest = np.maximum(largest, (np.abs(x.q) * self.arms).max(axis=1, initial=0.0))
        largest = np.maximum(largest, (np.abs(x.reaction) / self.arms).max(axis=1, initial=0.0))
        largest = np.maximum(largest, (np.abs(x.f) / self.moment_arm).max(axis=1, initial=0.0))
        if len(mech.A):
            carried = np.abs(mech.A) * np.abs(x.coupling)[:, :, None] / self.arms
            largest = np.maximum(largest, carried.max(axis=(1, 2)))
        out: Mask = np.maximum(largest / F, self.reach / g.spacing) <= LARGE
        return out

    def _actuators(self, f: Array, t: Array, f_c: Array) -> Array:
        """(k, a) [N] how far (8) is missed, in the sense of each command."""
        sense = np.where(f_c < 0, -1.0, 1.0)
        t = sense * t * self.moment_arm
        slack = sense * (f - f_c) / self.moment_arm
        moves = (f_c != 0) | self.moves
        missed = np.maximum(np.maximum(-t, -slack), np.minimum(np.abs(t), np.abs(slack)))
        return np.where(self.backdrivable, np.abs(slack), np.where(moves, missed, np.abs(t)))


def _norm(x: Array) -> Array:
    """(k,) lengths of rows."""
    out: Array = np.sqrt((x * x).sum(axis=1))
    return out


def _cross(a: Array, b: Array) -> Array:
    """Of the last axes; `np.cross` takes several times as long."""
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]
