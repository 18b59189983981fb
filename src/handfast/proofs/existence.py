"""That a state exists exactly: near the floats of a file there is a solution of the model.

A box about the floats contains an exact solution of the equations in their modes (`newton`, and `balls` where floating
point is too coarse), and every inequality of the modes holds all over that box: an exact state. Which modes are tried
follows from the floats. What cannot be shown exactly may hold to `tolerance.EPS` of load and commands: motions that
keep every row that is held exactly, forces that obey every law exactly, and (1) and (2) missed by no more than that.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from handfast.proofs.balls import refined, solution
from handfast.proofs.fields import Array
from handfast.proofs.grasp import GraspData
from handfast.proofs.newton import Box, NotShown, System, rounding
from handfast.proofs.states import (
    ULP,
    Contact,
    Modes,
    Part,
    Problem,
    State,
    acting,
    choices,
    modes_of,
    reaction_ends,
    sense,
)
from handfast.proofs.tolerance import EPS, LEAST, TOO_SMALL, WORK, about_centroid

NEAR = 1e-6  # relative to the forces that act: how far the forces that are proved may be from the printed ones
TRIES = 16  # modes that are tried


@dataclass(frozen=True)
class Proved:
    """What is proved of a state.

    Attributes:
        exact: is there an exact state within `radius` of it? tolerant: if not, one to 1e-9 of load and commands?
        reason: why not exactly; "" if it is.
        residual: what the floats themselves miss, relative to the scale of the load.
        radius: [N] how far from the floats the forces and motions at the contacts are at most.
        margin: the least by which an inequality of the modes is strict, relative to the forces that act.
        magnitude: between which the magnitude of the exact state is, where that is an unknown.
        modes: of the state that is proved; see `Modes.words`.
    """

    exact: bool
    tolerant: bool
    reason: str
    residual: float
    radius: float = np.inf
    margin: float = 0.0
    magnitude: tuple[float, float] | None = None
    modes: Modes | None = None


def prove(p: Problem, x: State, until: float = np.inf) -> Proved:
    """Is there an exact state of the problem near x? With the magnitude near what is said, if there is one.

    until: [s] of `time.monotonic`, after which no further modes are tried: nothing is shown then.
    """
    if not p.scale >= LEAST:
        return Proved(False, False, TOO_SMALL, np.inf)
    free = p.along is not None or p.drive is not None
    done = _attempts(p, x, until, free=free)
    if free and not done.exact:
        fixed = _attempts(p, x, until)
        done = fixed if fixed.exact else done
    if done.exact:
        return done
    rough = _attempts(p, x, until, balanced=False)
    return replace(done, tolerant=rough.tolerant, modes=rough.modes, magnitude=rough.magnitude)


def polished(p: Problem, x: State) -> tuple[Problem, State]:
    """The problem and the state after Newton's method in the likeliest modes; as they are where it fails.

    For a search, before it reports: the magnitude, if it is an unknown, is solved as well.
    """
    options = choices(p, x)
    try:
        system = System.of(p, modes_of(p.grasp, {name: kinds[0] for name, kinds in options.items()}), x, True, True)
        v, forces, magnitude = solution(system)
    except NotShown:
        return p, x
    return replace(p, magnitude=magnitude), State.of(p.grasp, v, forces)


def nearby(p: Problem, x: State, gap: float, until: float = np.inf) -> tuple[Problem, State]:
    """The problem and state nearest to x, with the magnitude at most a tenth of the gap lower, that is proved to exist.

    gap: how far above the magnitude the other bound is. As they are where none is proved, until [s] of
    `time.monotonic`.
    """
    for share in (0.0, 1e-4, 1e-2, 1e-1):
        less = replace(p, magnitude=p.magnitude - share * gap)
        fixed = replace(less, wrench=less.load, along=None)
        for tried in (less, fixed) if share == 0 else (fixed,):
            if time.monotonic() > until:
                return p, x
            solved, better = polished(tried, x)
            found = solved if tried is less else less
            if found.magnitude >= p.magnitude - gap / 10 and prove(found, better, until).exact:
                return found, better
    return p, x


def _attempts(p: Problem, x: State, until: float, balanced: bool = True, free: bool = False) -> Proved:
    """Modes that x may have, one after the other. balanced: exactly, else but for the slack in (1), (2)."""
    options = choices(p, x)
    chosen, reason, residual = dict.fromkeys(options, 0), "", np.inf
    for _ in range(TRIES):
        modes = modes_of(p.grasp, {name: options[name][k] for name, k in chosen.items()})
        try:
            system = System.of(p, modes, x, balanced, free)
            residual = min(residual, system.residual)
            try:
                return _shown(system, x, system.box(), residual)
            except NotShown as fault:
                if not fault.rounding:
                    raise
                return _shown(system, x, refined(system), residual)
        except NotShown as fault:
            reason = reason or str(fault)
            left = [name for name, kinds in options.items() if chosen[name] + 1 < len(kinds)]
            if not left or time.monotonic() > until:
                break
            chosen[fault.part if fault.part in left else left[-1]] += 1
    return Proved(False, False, reason, residual)


def _shown(s: System, x: State, box: Box, residual: float) -> Proved:
    """What a box shows. Raises `NotShown`."""
    p = s.p
    if not s.balanced:
        box = _within(p, s.modes, box)
        _within_slack(p, box, s.v)
    margin, radius = inequalities(p, s.modes, box), _radius(p, x, box)
    off = box.magnitude_off + 4 * ULP * abs(box.magnitude)
    ends = (box.magnitude - off, box.magnitude + off) if p.along is not None or p.drive is not None else None
    return Proved(s.balanced, not s.balanced, "", residual, radius, margin, ends, s.modes)


# --- what has to hold all over a box ---------------------------------------------------------------


def inequalities(p: Problem, modes: Modes, box: Box) -> float:
    """The least that an inequality of the modes leaves, relative to the forces that act. Raises `NotShown`."""
    g, T = p.grasp, p.grasp.contact_rows
    d, d_off = box.d[T], box.d_off[T] + 8 * ULP * np.abs(box.d[T])
    c, c_off = box.phi[T], box.phi_off[T] + 8 * ULP * np.abs(box.phi[T])
    _, _, actuators, _, joints = g.parts
    length = lambda x: np.sqrt((x * x).sum(axis=-1)) * (1 + 8 * ULP)  # noqa: E731
    slides = length(d[:, 1:]) * (1 - 32 * ULP) - length(d_off[:, 1:])
    gap = p.cos * (d[:, 0] - d_off[:, 0]) + p.sin * np.maximum(slides, 0.0)
    presses = c[:, 0] - c_off[:, 0]
    inside = g.mu * presses * (1 - 8 * ULP) - length(c[:, 1:]) - length(c_off[:, 1:])
    cone = ((modes.contact == Contact.STICKS) | (modes.contact == Contact.RUBS)) & (
        g.mu > 0
    )  # that of LEANS is kept by its ratio
    below = p.force_limit - c[:, 0] - np.where(modes.closed, c_off[:, 0], 0.0)
    arms = p.grasp.row_units
    f, t = box.phi[actuators], box.d[actuators] * sense(p)
    f_off = box.phi_off[actuators] + 4 * ULP * np.abs(f)
    drive = 0.0 if p.drive is None else np.abs(p.drive) * box.magnitude_off
    beyond = sense(p) * (f - p.command) - (f_off + drive + 4 * ULP * np.abs(p.command)) * (f != p.command)
    turns = t - box.d_off[actuators]
    commanded = (g.command != 0) | g.tendon
    limited = p.limit - np.abs(f) - np.where(np.abs(f) == p.limit, box.phi_off[actuators], f_off)
    lo, hi = reaction_ends(g)
    rho, rho_off, q, q_off = box.phi[joints], box.phi_off[joints], box.d[joints], box.d_off[joints]
    at_rest = (modes.joint == Part.RESTS) | (modes.joint == Part.LOW) | (modes.joint == Part.HIGH)
    carries = np.minimum(np.where(rho == lo, 0.0, rho - lo), np.where(rho == hi, 0.0, hi - rho)) - rho_off
    kind, unit_f, unit_t = modes.contact, arms[actuators], 1.0 / arms[actuators]
    all_of = (
        ("contact {}", "is not proved to be open", gap, kind == Contact.OPEN),
        ("contact {}", "is not proved to press", presses, modes.closed),
        ("contact {}", "is not proved to be inside its friction cone", inside, cone),
        ("contact {}", "is not proved to keep the force limit", below, modes.closed & ~modes.full),
        ("actuator {}", "is not proved to carry its command", beyond * unit_f, commanded & ~g.backdrivable),
        ("actuator {}", "is not proved to move in its sense", turns * unit_t, modes.actuator == Part.MOVES),
        ("actuator {}", "is not proved to keep its limit", limited * unit_f, np.isfinite(p.limit)),
        ("joint {}", "is not proved to carry its reaction", carries * arms[joints], at_rest),
        ("joint {}", "is not proved to close", (q - q_off) / arms[joints], modes.joint == Part.MOVES),
        ("joint {}", "is not proved to open", (-q - q_off) / arms[joints], modes.joint == Part.OPENS),
    )
    least = np.inf
    for name, fault, value, applies in all_of:
        value = np.where(applies, value, np.inf)
        k = int(np.argmin(value)) if len(value) else 0
        if len(value) and not value[k] >= 0:
            part = name.format(k)
            act = max(p.scale, float(np.abs(c).max()))
            raise NotShown(f"{_said(g, name, k)} {fault}: {value[k]:.2e} N", part, rounding=value[k] > -NEAR * act)
        least = min(least, float(value.min(initial=np.inf)))
    return least / max(p.scale, float(np.abs(c).max(initial=0.0)))


def _said(g: GraspData, name: str, k: int) -> str:
    names = {"actuator {}": g.actuators, "joint {}": g.joints}
    return f"{name.format('').strip()} '{names[name][k]}'" if name in names else name.format(k)


def _radius(p: Problem, x: State, box: Box) -> float:
    """[N] how far the box is from the floats at most. Raises `NotShown` if that is more than `NEAR`."""
    act = acting(p, x)
    motion = (np.abs(box.d - p.grasp.rows[0] @ x.motion) + box.d_off) / p.grasp.row_units
    force = (np.abs(box.phi - x.forces(p.grasp)) + box.phi_off) * p.grasp.row_units
    if not force.max() <= NEAR * act:
        where = row_name(p, int(np.argmax(force)))
        reason = f"{where}: the force of the state that is proved is {force.max():.1e} N from the printed one"
        raise NotShown(reason, rounding=True)
    return float(max(motion.max(), force.max()))


def row_name(p: Problem, k: int) -> str:
    """What a row of `GraspData.rows` is about."""
    g = p.grasp
    contacts, soft, actuators, couplings, _ = g.parts
    if k < contacts.stop:
        return f"contact {k // 3}"
    if k < soft.stop:
        return f"torsion of contact {g.soft[k - soft.start]}"
    if k < actuators.stop:
        return f"actuator '{g.actuators[k - actuators.start]}'"
    return f"coupling {k - couplings.start}" if k < couplings.stop else f"joint '{g.joints[k - couplings.stop]}'"


# --- to 1e-9 of load and commands ------------------------------------------------------------------


def _within(p: Problem, modes: Modes, box: Box) -> Box:
    """With the unknown forces, which may be chosen, inside what the laws allow."""
    g, phi = p.grasp, box.phi.copy()
    for i in np.flatnonzero(np.isin(modes.contact, (Contact.STICKS, Contact.RUBS)) & (g.mu > 0)):
        n, *t = p.grasp.contact_rows[i]
        most = g.mu[i] * (phi[n] - box.phi_off[n]) * (1 - 64 * ULP)
        size = float(np.linalg.norm(phi[t]))
        if most >= 0 and size > most:
            phi[t] *= most / size * (1 - 64 * ULP)
    _, _, actuators, _, joints = g.parts
    rests, f = modes.actuator == Part.RESTS, phi[actuators]
    f = np.where(rests & (sense(p) * (f - p.command) < 0), p.command, f)
    free = rests | (modes.actuator == Part.LOCKED)
    phi[actuators] = np.where(free, np.clip(f, -p.limit, p.limit), f)
    lo, hi = reaction_ends(g)
    phi[joints] = np.where(modes.joint == Part.RESTS, np.clip(phi[joints], lo, hi), phi[joints])
    return replace(box, phi=phi)


def _within_slack(p: Problem, box: Box, v: Array) -> None:
    """`NotShown` unless all of a box misses (1) and (2) by no more than `slack`, and does little work by it.

    v: (6 + l,) its motions, rounded. Proofs that no state exists cite the balance of energy, which gives way by
    WORK F^2 only.
    """
    g, (M, size), unit = p.grasp, p.grasp.rows, rounding(p)
    along = np.zeros(6) if p.along is None else p.magnitude * p.along
    load_size = np.abs(np.r_[np.abs(p.wrench) + np.abs(along), g.torque])
    missing = M.T @ box.phi + np.r_[p.load, g.torque]
    off = unit * (size.T @ np.abs(box.phi) + load_size) + size.T @ box.phi_off
    torque = about_centroid(g, missing[:6])
    arm = np.abs(g.centroid)[[1, 2, 0, 2, 0, 1]].reshape(2, 3)
    wide = off[:3] + 4 * ULP * np.abs(missing[:3])
    torque_off = off[3:6] + arm[0] * wide[[2, 0, 1]] + arm[1] * wide[[1, 2, 0]]
    parts = {
        "(1), forces": float(np.linalg.norm(np.abs(missing[:3]) + off[:3])),
        "(1), torques": float(np.linalg.norm(np.abs(torque) + torque_off)) / g.size,
    }
    torques = (np.abs(missing[6:]) + off[6:]) / g.joint_units
    parts |= {f"(2) of joint '{name}'": float(x) for name, x in zip(g.joints, torques, strict=True)}
    for name, x in parts.items():
        if not x <= EPS * p.scale * (1 - 1e-6):
            raise NotShown(f"{name} is missed by {x / p.scale:.1e} of the load", rounding=bool(off.max() > 0))
    if not p.mdp:
        return  # without the dissipation principle no proof cites the balance of energy
    joints, contacts = g.parts[4], g.parts[0]
    q_off = box.d_off[joints] + 4 * ULP * np.abs(v[6:])
    r_off = 2 * np.abs(np.linalg.pinv(g.G.T)) @ (box.d_off[contacts] + np.abs(g.J) @ q_off)
    moved = np.abs(v) * (1 + 1e-9) + np.concatenate([r_off, q_off])
    work = float((np.abs(missing) + off) @ moved) / p.scale**2
    if not work <= WORK * (1 - 1e-6):
        raise NotShown(f"what (1) and (2) miss does work of {work:.1e} of the load squared", rounding=True)
