"""That a state exists exactly: near the floats of a file there is a solution of the model.

A box about the floats contains an exact solution of the equations in their modes (`newton`, and `balls` where floating
point is too coarse), and every inequality of the modes holds all over that box: an exact state. Which modes are tried
follows from the floats. What cannot be shown exactly may hold to `tolerance.EPS` of the load: see `near`.
"""

from __future__ import annotations

import heapq
import time
from dataclasses import dataclass, replace

import numpy as np

from handfast.proofs.balls import refined, solution
from handfast.proofs.fields import Array, Mask
from handfast.proofs.grasp import GraspData
from handfast.proofs.intervals import UNDERFLOW_BOUND
from handfast.proofs.near import Near, near
from handfast.proofs.newton import Box, NotShown, System
from handfast.proofs.states import (
    ContactMode,
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
from handfast.proofs.tolerance import MIN_FORCE_SCALE, MIN_SIZE, TOO_SMALL, UNIT_ROUNDOFF, motion_size

# relative to the forces that act: how far the forces that are proved may be from the printed ones; motions, relative to
# the largest motion where that is more
FORCE_DEVIATION = 1e-6
MODE_TRIES = 16  # modes that are tried
# relative to the forces that act: inequalities kept by less are to be kept by so much
ACTIVE_SLACK, REQUIRED_SLACK = 1e-7, 1e-8


@dataclass(frozen=True)
class Proved:
    """What is proved of a state.

    Attributes:
        exact: is there an exact state within `radius` of it? tolerant: if not, one to 1e-9 of the load?
        reason: why not exactly; "" if it is.
        residual: what the floats themselves miss, relative to the scale of the load.
        radius: [N] how far from the floats the forces and motions at the contacts are at most.
        motion: [N] `tolerance.motion_size` of the state that is proved, at most.
        margin: the least by which an inequality of the modes is strict, relative to the forces that act.
        magnitude: between which the magnitude of the exact state is, where that is an unknown.
        modes: of the state that is proved; see `Modes.words`.
    """

    exact: bool
    tolerant: bool
    reason: str
    residual: float
    radius: float = np.inf
    motion: float = np.inf
    margin: float = 0.0
    magnitude: tuple[float, float] | None = None
    modes: Modes | None = None

    def reaches(self, least: float) -> bool:
        """Is the magnitude that is proved so large? True without one."""
        return self.magnitude is None or self.magnitude[0] >= least


def prove(p: Problem, x: State, least: float = -np.inf, within: float | None = None, tries: int = MODE_TRIES) -> Proved:
    """Is there an exact state of the problem near x? With the magnitude near what is said, if there is one.

    least: the magnitude that has to be reached; a state with a smaller one is shown only where nothing else is.
    within: [N] the largest `radius` that counts, for motions; without it `FORCE_DEVIATION` of all that is printed.
    tries: modes that are tried, the likeliest first; with one, the magnitude is not fixed where it could be.
    """
    if not (p.scale >= MIN_FORCE_SCALE and p.grasp.size >= MIN_SIZE):
        return Proved(False, False, TOO_SMALL, np.inf)
    free = p.along is not None
    within = _told(p, x) if within is None else within
    with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which shows nothing
        done = _attempts(p, x, tries, within, free=free)
        if free and tries > 1 and not (done.exact and done.reaches(least)):
            fixed = _attempts(p, x, tries, within)
            done = fixed if fixed.exact else done
    if (done.exact and done.reaches(least)) or not p.granted > 0:
        return done
    rough = near(p, x)
    if not rough.shown:
        rough = min(rough, _nearer(p, x, rough.modes), key=lambda found: found.missed)
    fault = f"{rough.where} is missed by {rough.missed:.1e} of the load" if not rough.shown else ""
    fault = fault or _farther(p, x, within, rough.forces, rough.changed, rough.apart)
    if not fault:
        at, radius = None if p.along is None else (p.magnitude, p.magnitude), max(rough.forces, rough.changed)
        return Proved(False, True, done.reason, rough.missed, radius, rough.motion, 0.0, at, rough.modes)
    return done if done.exact else replace(done, reason=f"{done.reason}; {fault}", residual=rough.missed)


def _nearer(p: Problem, x: State, modes: Modes) -> Near:
    """What a state misses after Newton's method in some modes; all of it where that fails, or leads elsewhere."""
    elsewhere = Near(np.inf, "all", modes, np.inf, np.inf, np.inf)
    try:
        v, forces, _ = solution(System.of(p, modes, x, False))
    except NotShown:
        return elsewhere
    apart = (np.abs(forces - x.forces(p.grasp)) * p.grasp.told_units).max()
    if not apart <= FORCE_DEVIATION * acting(p, x):
        return elsewhere
    found, g = near(p, State.of(p.grasp, v, forces)), p.grasp
    moved = float((np.abs(g.rows[0] @ (v - x.motion)) / g.told_units).max())
    away = found.apart + motion_size(g, v - x.motion)
    return replace(found, forces=found.forces + float(apart), changed=found.changed + moved, apart=away)


def polished(p: Problem, x: State, modes: Modes | None = None) -> tuple[Problem, State]:
    """The problem and the state after Newton's method in some modes, the likeliest ones; as they are where it fails.

    For a search, before it reports: the magnitude, if it is an unknown, is solved as well.
    """
    if modes is None:
        modes = modes_of(p.grasp, {name: kinds[0] for name, kinds in choices(p, x).items()})
    try:
        v, forces, magnitude = solution(System.of(p, modes, x, True))
    except NotShown:
        return p, x
    return replace(p, magnitude=magnitude), State.of(p.grasp, v, forces)


def exactly(p: Problem, x: State) -> tuple[Problem, State]:
    """An exact state with the same forces, however far its motions are from x; as they are where none is proved."""
    far = prove(p, x, within=np.inf)
    return polished(p, x, far.modes) if far.exact else (p, x)


def nearby(p: Problem, x: State, gap: float, until: float = np.inf, thorough: bool = True) -> tuple[Problem, State]:
    """The problem and state nearest to x, with the magnitude at most a tenth of the gap lower, that is proved to exist.

    x: that `prove` does not show.
    gap: how far above the magnitude the other bound is. As they are where none is proved, until [s] of
    `time.monotonic`.
    thorough: every mode is tried also of smaller magnitudes where Newton's method fails in the likeliest ones.
    """
    for share in (0.0, 1e-4, 1e-2, 1e-1):
        less = replace(p, magnitude=p.magnitude - share * gap)
        fixed = replace(less, wrench=less.load, along=None)
        for tried in (less, fixed) if share == 0 else (fixed,):
            if time.monotonic() > until:
                return p, x
            solved, better = polished(tried, x)
            if better is x and (share == 0 or not thorough):
                continue  # at its own magnitude it was asked before
            found = solved if tried is less else less
            asked = found if share == 0 else fixed  # as an unknown the magnitude would lead back to where it was
            if found.magnitude >= p.magnitude - gap / 10 and prove(asked, better).exact:
                return found, better
    return p, x


def _attempts(p: Problem, x: State, most: int, within: float, free: bool = False) -> Proved:
    """Modes that x may have, the likeliest first."""
    options = choices(p, x)
    names, reason, residual = list(options), "", np.inf
    queue, known = [(0, 0, (0,) * len(options))], {(0,) * len(options)}
    alone: dict[tuple[str, int], NotShown] = {}  # faults of a part's mode, whatever the others'
    tries = 0
    while queue and tries < most and len(known) < 8 * most:
        cost, _, chosen = heapq.heappop(queue)
        try:
            for mode in zip(names, chosen, strict=True):
                if mode in alone:
                    raise alone[mode]
            modes = modes_of(p.grasp, {name: options[name][k] for name, k in zip(names, chosen, strict=True)})
            system = System.of(p, modes, x, free)
            residual, tries = min(residual, system.residual), tries + 1
            return _tried(system, x, within, residual)
        except NotShown as fault:
            reason = reason or str(fault)
            if fault.alone:
                alone[fault.part, chosen[names.index(fault.part)]] = fault
            for i, name in enumerate(names):  # the part that is at fault first
                other = *chosen[:i], chosen[i] + 1, *chosen[i + 1 :]
                if chosen[i] + 1 < len(options[name]) and other not in known:
                    known.add(other)
                    heapq.heappush(queue, (cost + (1 if name == fault.part else 2), len(known), other))
    return Proved(False, False, reason, residual)


def _tried(s: System, x: State, within: float, residual: float) -> Proved:
    """What is shown in the modes of a system: in floating point, farther inside of them, or in balls."""
    try:
        return _shown(s, x, s.box(), within, residual)
    except NotShown as fault:
        if not fault.rounding or (not s.regular and s.contradictory):
            raise
    try:
        inside = System.of(s.p, s.modes, _inside(s), s.sought)
        return _shown(inside, x, inside.box(), within, residual)
    except NotShown:
        return _shown(s, x, refined(s), within, residual)


def _inside(s: System) -> State:
    """The nearest state that solves the linearised equations and keeps every inequality by a little, if any does."""
    p, e, nv, (n, step) = s.p, s.of_modes, len(s.v), (s.A.shape[1], ACTIVE_SLACK * s.p.scale)
    d, phi = np.zeros((n, len(s.d))), np.zeros((n, len(s.d)))  # by each of the scaled unknowns
    d[:nv] = (p.grasp.rows[0] * s.columns[:nv]).T
    phi[:, s.laws.rows] = np.einsum("cij,ncj->nci", s.laws.K, d[:, s.laws.rows])
    places = nv + np.arange(len(e.unknown))
    phi[:, -1], phi[places, e.unknown] = 0.0, s.columns[places]

    def values(d: Array, phi: Array) -> Array:
        none = np.zeros(len(s.d))
        of_all = slacks(p, s.modes, Box(s.v, none[:nv], d, none, phi, none))
        return np.concatenate([np.where(applies, value, np.inf) for *_, value, applies in of_all], axis=-1)

    act, here = acting(p, State.of(p.grasp, s.v, s.phi)), values(s.d, s.phi)
    least = here < ACTIVE_SLACK * act
    kept = (values(s.d + step * d, s.phi + step * phi)[:, least] - here[least]).T / step
    both = np.vstack([s.units[:, None] * s.A * s.columns, kept])
    short = np.concatenate([-s.units * s.value, REQUIRED_SLACK * act - here[least]])
    try:
        x = s.columns * np.linalg.lstsq(both, short, rcond=1e-12)[0]
    except np.linalg.LinAlgError:
        raise NotShown("no state is farther inside of the modes") from None
    forces = s.phi.copy()
    forces[e.unknown] += x[places]
    return State.of(p.grasp, s.v + x[:nv], forces)


def _shown(s: System, x: State, box: Box, within: float, residual: float) -> Proved:
    """What a box shows. Raises `NotShown`."""
    p = s.p
    margin, radius = inequalities(p, s.modes, box), _radius(p, x, box, within)
    off = box.magnitude_off + 4 * UNIT_ROUNDOFF * abs(box.magnitude)
    ends = (box.magnitude - off, box.magnitude + off) if p.along is not None else None
    motion = motion_size(p.grasp, box.v, box.v_off)
    return Proved(True, False, "", residual, radius, motion, margin, ends, s.modes)


# --- what has to hold all over a box ---------------------------------------------------------------


def slacks(p: Problem, modes: Modes, box: Box) -> list[tuple[str, str, Array, Mask]]:
    """By how much every inequality is kept all over a box [N], (..., k) of k contacts, actuators or joints.

    With the name of what it is about, what is wrong where it is negative, and (k,) to which of them it applies.
    """
    g, T = p.grasp, p.grasp.contact_rows
    d, d_off = box.d[..., T], box.d_off[T] + 8 * UNIT_ROUNDOFF * np.abs(box.d[..., T])
    c, c_off = box.phi[..., T], box.phi_off[T] + 8 * UNIT_ROUNDOFF * np.abs(box.phi[..., T])
    _, _, actuators, _, joints = g.parts
    length = lambda x: np.hypot.reduce(x, axis=-1) * (1 + 16 * UNIT_ROUNDOFF)  # noqa: E731  # squares would underflow
    slides = length(d[..., 1:]) * (1 - 32 * UNIT_ROUNDOFF) - length(d_off[..., 1:])
    gap = g.gaps + p.cos * (d[..., 0] - d_off[..., 0]) + p.sin * np.maximum(slides, 0.0)
    gap = gap - np.where(g.gaps != 0, 16 * UNIT_ROUNDOFF * (np.abs(g.gaps) + np.abs(d[..., 0])), 0.0)
    presses = c[..., 0] - c_off[..., 0]
    inside = g.mu * presses * (1 - 8 * UNIT_ROUNDOFF) - length(c[..., 1:]) - length(c_off[..., 1:]) - UNDERFLOW_BOUND
    rubs = ((modes.contact == ContactMode.STICKS) | (modes.contact == ContactMode.RUBS)) & (
        g.mu > 0
    )  # LEANS is by its ratio
    below = p.force_limit - c[..., 0] - c_off[..., 0]
    arms = p.grasp.row_units
    f, t = box.phi[..., actuators], box.d[..., actuators] * sense(p)
    f_off = box.phi_off[actuators] + 4 * UNIT_ROUNDOFF * np.abs(f)
    loose = (f != p.command) | (box.phi_off[actuators] > 0)  # else it is the command itself
    beyond = sense(p) * (f - p.command) - (f_off + 4 * UNIT_ROUNDOFF * np.abs(p.command)) * loose
    beyond = beyond if box.carried is None else box.carried
    turns = t - box.d_off[actuators]
    turns = np.where(g.slack != 0, (turns + g.slack) - 4 * UNIT_ROUNDOFF * (np.abs(t) + g.slack), turns)
    commanded = (g.command != 0) | g.tendon
    limited = p.limit - np.abs(f) - np.where(np.abs(f) == p.limit, box.phi_off[actuators], f_off)
    lo, hi = reaction_ends(g)
    rho, rho_off, q, q_off = box.phi[..., joints], box.phi_off[joints], box.d[..., joints], box.d_off[joints]
    at_rest = (modes.joint == Part.RESTS) | (modes.joint == Part.LOW) | (modes.joint == Part.HIGH)
    carries = np.minimum(np.where(rho == lo, 0.0, rho - lo), np.where(rho == hi, 0.0, hi - rho)) - rho_off
    side, way = np.sign(g.stops_left), np.abs(g.stops_left)
    beyond_stop = side * q + way - q_off - 4 * UNIT_ROUNDOFF * (np.abs(q) + way)
    leans = side * rho - g.friction - rho_off - 4 * UNIT_ROUNDOFF * (np.abs(rho) + g.friction)
    went = (side != 0) & (modes.joint != Part.BACK)
    kind, unit_f, unit_t = modes.contact, arms[actuators], 1.0 / arms[actuators]
    return [
        ("contact {}", "is not proved to be open", gap, kind == ContactMode.OPEN),
        ("contact {}", "is not proved to press", presses, modes.closed),
        ("contact {}", "is not proved to be inside its friction cone", inside, rubs),
        ("contact {}", "is not proved to keep the force limit", below, modes.closed & ~modes.full),
        ("actuator {}", "is not proved to carry its command", beyond * unit_f, commanded & ~g.backdrivable),
        ("actuator {}", "is not proved to move in its sense", turns * unit_t, modes.actuator == Part.MOVES),
        ("actuator {}", "is not proved to keep its limit", limited * unit_f, np.isfinite(p.limit)),
        ("joint {}", "is not proved to carry its reaction", carries * arms[joints], at_rest),
        ("joint {}", "is not proved to close", (q - q_off) / arms[joints], modes.joint == Part.MOVES),
        ("joint {}", "is not proved to open", (-q - q_off) / arms[joints], modes.joint == Part.OPENS),
        ("joint {}", "is not proved to stay off its stop", beyond_stop / arms[joints], went),
        ("joint {}", "is not proved to lean on its stop", leans * arms[joints], modes.joint == Part.BACK),
    ]


def inequalities(p: Problem, modes: Modes, box: Box) -> float:
    """The least that an inequality of the modes leaves, relative to the forces that act. Raises `NotShown`."""
    least = np.inf
    act = max(p.scale, float(np.abs(box.phi[p.grasp.contact_rows]).max(initial=0.0)))
    for name, fault, every, applies in slacks(p, modes, box):
        value = np.where(applies, every, np.inf)
        k = int(np.argmin(value)) if len(value) else 0
        if len(value) and not value[k] >= 0:
            reason = f"{_said(p.grasp, name, k)} {fault}: {value[k]:.2e} N"
            raise NotShown(reason, name.format(k), rounding=value[k] > -FORCE_DEVIATION * act)
        least = min(least, float(value.min(initial=np.inf)))
    return least / act


def _said(g: GraspData, name: str, k: int) -> str:
    names = {"actuator {}": g.actuators, "joint {}": g.joints}
    return f"{name.format('').strip()} '{names[name][k]}'" if name in names else name.format(k)


def _radius(p: Problem, x: State, box: Box, within: float) -> float:
    """[N] how far the box is from the floats at most. Raises `NotShown` where that is more than counts, see `prove`."""
    motion = (np.abs(box.d - p.grasp.rows[0] @ x.motion) + box.d_off) / p.grasp.told_units
    force = (np.abs(box.phi - x.forces(p.grasp)) + box.phi_off) * p.grasp.told_units
    fault = _farther(p, x, within, force.max(), motion.max(), motion_size(p.grasp, box.v - x.motion, box.v_off))
    if fault:
        off = force if force.max() > FORCE_DEVIATION * acting(p, x) else motion
        raise NotShown(f"{row_name(p, int(np.argmax(off)))}: {fault}", rounding=True)
    return float(max(motion.max(), force.max()))


def _told(p: Problem, x: State) -> float:
    """[N] how far motions may be from those of a state that are printed."""
    return FORCE_DEVIATION * max(acting(p, x), motion_size(p.grasp, x.motion))


def _farther(p: Problem, x: State, within: float, forces: float, motions: float, apart: float) -> str:
    """What is proved too far from a state's floats: forces and motions at the contacts, or all motions; "" if nothing.

    apart: as `motion_size`, which knows joints that turn close by a contact.
    """
    if not forces <= FORCE_DEVIATION * acting(p, x):
        return f"the force of the state that is proved is {forces:.1e} N from the printed one"
    if not (motions <= within and (apart <= within or apart <= _told(p, x))):
        return f"the motion of the state that is proved is {max(motions, apart):.1e} N from the printed one"
    return ""


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
