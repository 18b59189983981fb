"""Grasps for a task: what a `handfast/grasps/1` file claims of each, put together from proofs of both halves.

Of each grasp: an exact configuration exists in which hand and object touch as the task asks, and every load alone is
held under its one preload. Contacts of the grasp are those of that configuration, to 1e-9 of the grasp's size, and
actuators those of the motors. What its joints are like and what ties them is geometry: `handfast verify` works it out
anew.

Or that there is none: no contact forces balance the loads, wherever on the object the contacts are (`unbalanced`), or
every configuration of some contacts is discarded, for several reasons together (`discarded_boxes`). A grasp may hold
its loads so many times (`strength`), and no placement of the contacts more than so many times (`bound`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from handfast.proofs import answers
from handfast.proofs.configurations import examined, farther, read_existence, solution
from handfast.proofs.constants import MAX_ETA
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.contact_force_limits import ForceLimits, contact_force_limits
from handfast.proofs.convex_solids import SolidsData
from handfast.proofs.discarded_boxes import replay_no_grasp
from handfast.proofs.existence import prove
from handfast.proofs.few_contacts import replay_of_loads
from handfast.proofs.fields import EQUALITY_TOLERANCE, Array, BadFile, Fields, refuse_no_limit, refuse_unknown
from handfast.proofs.grasp import GraspData, read_grasp
from handfast.proofs.intervals import Interval, sqr, sqrt
from handfast.proofs.motors import Motors
from handfast.proofs.question import CHECK, Question
from handfast.proofs.replay import Figure, Refused, Replay, down
from handfast.proofs.states import Problem, read_state
from handfast.proofs.synthesis import NAMES_CLAIM, SYNTHESIS_COURSE
from handfast.proofs.tasks import TaskData, read_task
from handfast.proofs.tolerance import EPS, load_scale
from handfast.proofs.unbalanced import Placements, replay_unbalanced

SCHEMA = "handfast/grasps/1"
SOLIDS_CLAIM = "that the solids are those of hand and object"
GRASPS_NOT_REPLAYED = (
    "what the answer repeats of its grasps, clearances, scores, lower bounds of commands and the course of the search"
)
JOINTS_CLAIM = (
    "that the joints of a grasp, what acts on them and what ties them are those of the hand at its configuration, and "
    "in which sense its motors drive them"
)
MOTION_MISSED = 1e-7  # of the load: what motions (3) make of contacts that are off by rounding
_Motor = tuple[dict[str, float], bool, bool]


def replay_grasps(data: Any, place: str = "") -> Replay:
    """The claims of a parsed file. Raises `BadFile`."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    task, driven, asked = read_task(f.take("task")), f.take("motors"), f.object("question")
    by_name = _read_motors(Fields(driven, f.at("motors")))
    loads, center = _read_loads(asked.object("loads"), asked.object("object"))
    solids = asked.object("solids") if asked.has("solids") else None
    terms = _Terms(asked, list(by_name))
    answer, entries = f.object("answer"), list(f.objects("grasps"))
    verdict, said = answer.text("verdict", among=("found", "none", "undecided")), answer.take("loads")
    for name in ("checksum", "record"):
        f.take(name)
    motors = terms.motors(task, driven)
    limits = terms.force_limits(task, motors)
    none = f.object("none") if f.has("none") else None
    bound = f.object("bound") if f.has("bound") else None
    f.done()
    refused = ""
    if none is not None and verdict != "none":
        refused = f"{verdict.upper()} with a proof that there is none"
    elif bound is not None and verdict != "found":
        refused = f"{verdict.upper()} with a bound of what grasps hold"
    elif (verdict == "found") != bool(entries):
        refused = f"{verdict.upper()} {'with' if entries else 'without'} a grasp"
    elif verdict != "found" and none is None:
        refused = f"{verdict.upper()} rests on the search itself, ask it again"
    elif not _same_loads(said, loads):
        refused = "the answer is about other loads"
    if any(entry == other for k, entry in enumerate(data["grasps"]) for other in data["grasps"][:k]):
        refused = "a grasp is there twice"
    if none is not None and refused:
        return Replay("grasps", "", refused, not_replayed=(SYNTHESIS_COURSE, NAMES_CLAIM))
    if none is not None:
        return _none(none, task, terms, limits, loads, center, solids, motors)
    try:
        equations = ContactEquations.of(task)
    except Refused as fault:
        return Replay("grasps", "", str(fault))
    parts = [_grasp(entry, equations, terms, by_name, loads, f"grasp {k}") for k, entry in enumerate(entries, start=1)]
    if bound is not None:
        factor = bound.number("factor", least=0.0)
        held = max((float(part.figures.get("factor") or 1.0) for part in parts), default=1.0)
        if factor < held:
            refused = refused or f"no placement is said to hold the loads {factor:g} times, and a grasp {held:g} times"
        part = replay_unbalanced(
            task.on_object, loads, terms.friction, limits, None, bound, factor, torsion=terms.torsion
        )
        parts.append(replace(part, name="bound"))
    missing = GRASPS_NOT_REPLAYED, JOINTS_CLAIM, NAMES_CLAIM
    return Replay("grasps", "", refused, parts=tuple(parts), not_replayed=missing)


def _none(
    f: Fields,
    task: TaskData,
    terms: _Terms,
    limits: ForceLimits,
    loads: Mapping[str, Array],
    center: Array | None,
    solids: Fields | None,
    motors: Motors,
) -> Replay:
    """The claim that there is no grasp.

    Args:
        limits: of the normal forces at the contacts.
        solids: of hand and object, where the claim needs them.
    """
    asked = terms.friction, limits
    placements = Placements.of(task.on_object, np.array(list(loads.values())), *asked, terms.torsion)
    if f.has("fewest_contacts"):
        part = replay_of_loads(placements.count, placements.reach, loads, terms.friction, f, terms.torsion)
        return Replay("grasps", parts=(part,), not_replayed=(SYNTHESIS_COURSE, NAMES_CLAIM))
    if not f.has("contacts"):
        part = replay_unbalanced(task.on_object, loads, *asked, center, f, torsion=terms.torsion)
        return Replay("grasps", parts=(part,), not_replayed=(SYNTHESIS_COURSE, NAMES_CLAIM))
    if solids is None:
        raise BadFile("is missing", "question.solids")
    shapes = SolidsData.read(solids, [link.name for link in task.hand.links])
    part = replay_no_grasp(task, shapes, placements, list(loads), motors, f)
    return Replay("grasps", parts=(part,), not_replayed=(SYNTHESIS_COURSE, NAMES_CLAIM, SOLIDS_CLAIM))


def _same_loads(said: Any, loads: Mapping[str, Array]) -> bool:
    """The same names and wrenches, but for the rounding of a weight that is computed anew."""
    if not isinstance(said, Mapping) or said.keys() != loads.keys():
        return False
    return all(answers.matches(said[name], load.tolist()) for name, load in loads.items())


def _read_motors(f: Fields) -> dict[str, _Motor]:
    """How far each actuator moves with a joint, without its sense; is it a tendon, and can it be turned back?"""
    out: dict[str, _Motor] = {}
    for part in f.objects("actuators"):
        name, moved = part.text("name"), {joint: abs(x) for joint, x in part.named("joints").items() if x}
        if name in out:
            raise BadFile(f"'{name}' is there twice", f.at("actuators"))
        out[name] = moved, part.flag("tendon", False), part.flag("backdrivable", False)
    return out


class _Terms:
    """What all loads have in common: `friction`, `torsion`, `actuators` that may be commanded, and limits.

    Where none of these actuators moves a grasp, all of its own may be.
    """

    def __init__(self, f: Fields, actuators: list[str]) -> None:
        self.friction, self.actuators = f.number("friction", least=0.0), f.texts("actuators")
        self.torsion = f.number("torsion", 0.0, least=0.0)
        if self.torsion and not self.friction:
            raise BadFile("is there where friction is 0; a soft finger needs both", f.at("torsion"))
        for name in self.actuators:
            refuse_unknown(name, actuators, "actuator", f.at("actuators"))
        self.eta, self.torque_limits = f.number("eta", least=0.0), f.named("torque_limits")
        if not self.eta < MAX_ETA or (self.eta and self.torsion):
            right = f"0 to {MAX_ETA:.4f} is possible, above 0 with point contacts alone"
            raise BadFile(f"is {self.eta:g} rad; {right}", f.at("eta"))
        for name, value in self.torque_limits.items():
            refuse_unknown(name, actuators, "actuator", f.at("torque_limits"))
            refuse_no_limit(value, f.at(f"torque_limits.{name}"))
        self.force_limit = f.number("force_limit") if f.has("force_limit") else np.inf
        refuse_no_limit(self.force_limit, f.at("force_limit"))
        self.command_limit = f.number("command_limit", least=0.0) if f.has("command_limit") else np.inf
        f.done()

    def motors(self, task: TaskData, driven: Any) -> Motors:
        """What drives the hand, within these limits."""
        return Motors.read(Fields(driven, "motors"), task, self.torque_limits, self.command_limit)

    def force_limits(self, task: TaskData, motors: Motors) -> ForceLimits:
        """Of the normal forces at the contacts, by `force_limit` and by what the motors can do."""
        return contact_force_limits(task, motors, self.friction, self.torsion).up_to(self.force_limit)


def _read_loads(f: Fields, thing: Fields) -> tuple[Mapping[str, Array], Array | None]:
    """(6,) [N, N m] by name: wrenches as they are given, or the object's weight. If all are weights, where they act."""
    thing.text("name")
    mass = thing.number("mass", least=0.0) if thing.has("mass") else None
    centre = thing.numbers("center_of_mass", (3,))
    thing.done()
    out: dict[str, Array] = {}
    weights = True
    for name in f.names():
        load = f.object(name)
        if load.has("wrench") == load.has("weight"):
            raise BadFile("needs either a wrench or a weight", load.place)
        if load.has("wrench"):
            out[name], weights = load.numbers("wrench", (6,)), False
        else:
            weight = load.object("weight")
            along, size = weight.numbers("along", (3,)), weight.number("factor") * weight.number("g")
            weight.done()
            if not mass or not along.any():
                raise BadFile("needs an object with a mass, and a direction", weight.place)
            along = along / np.abs(along).max()
            force = size * mass * along / np.linalg.norm(along)
            out[name] = np.concatenate([force, np.cross(centre, force)])
        load.done()
    if not out:
        raise BadFile("is empty; at least one load is needed", f.place)
    return out, centre if weights else None


def _elsewhere(
    grasp: GraspData, joints: Mapping[str, float], equations: ContactEquations, x: Interval
) -> tuple[str, Array, Array]:
    """Which contact or joint of a grasp is not the one of an exact configuration, but for rounding; '' if all are.

    And how far points (m,) [m] and normals (m,) of its contacts are from there, at most.

    x: (1, n) coordinates between which the configuration is.
    """
    none = np.zeros(grasp.m)
    task = equations.task
    links = tuple(task.hand.links[link].name for link in task.links)
    if grasp.m > 1 and not grasp.spans:
        return "its contacts are in one place", none, none
    if grasp.links != links:
        return f"its contacts are of {', '.join(grasp.links)}; those of the task are of {', '.join(links)}", none, none
    at = equations.sides.object.at(x)
    point = at.point.value[0]
    size = min(grasp.size, task.size)  # joints may be anywhere
    points = sqrt(sqr(point - grasp.positions).sum()).hi
    normals = sqrt(sqr(at.normal.value[0] + grasp.frames[:, :, 0]).sum()).hi
    for right, what in ((points <= EQUALITY_TOLERANCE * size, "point"), (normals <= EQUALITY_TOLERANCE, "normal")):
        if not right.all():
            return f"the {what} of contact {right.argmin()} is not that of the configuration", none, none
    drive = equations.sides.drive
    values = drive.at(x)[0]
    for k, j in enumerate(drive.joints):
        if not (values[k] - joints[task.hand.joints[j]]).mag <= task.tolerance(j):
            return f"{task.hand.joints[j]} is not that of the configuration", none, none
    return "", points, normals


def _other_motors(grasp: GraspData, motors: Mapping[str, _Motor]) -> str:
    """Which actuator of a grasp is not as the hand's that move one of its joints, but for senses; '' if all are."""
    due = {name: motor for name, motor in motors.items() if motor[0].keys() & set(grasp.joints)}
    rows = ({j: abs(x) for j, x in zip(grasp.joints, row, strict=True) if x} for row in grasp.R.tolist())
    said = dict(zip(grasp.actuators, zip(rows, grasp.tendon, grasp.backdrivable, strict=True), strict=True))
    wrong = [name for name in {**due, **said} if due.get(name) != said.get(name)]
    return f"its actuator {wrong[0]} is not that of the motors" if wrong else ""


def _grasp(
    f: Fields,
    equations: ContactEquations,
    terms: _Terms,
    motors: Mapping[str, _Motor],
    loads: Mapping[str, Array],
    name: str,
) -> Replay:
    """The claims of one grasp. motors: by name, see `_read_motors`."""
    existence = read_existence(f.take("existence"))
    joints, grasp = f.named("joints"), read_grasp(f.take("grasp"), f.at("grasp"))
    witnesses = f.object("witnesses")
    strength = f.object("strength") if f.has("strength") else None
    task = equations.task
    exists, at, _ = examined(equations, existence, "configuration")
    parts, refused = [exists], task.misplaced(joints, existence.joints)
    off = [np.zeros(grasp.m), np.zeros(grasp.m)]
    if at is not None and exists.ok and not refused:
        x = solution(equations, existence, at)
        refused, *off = _elsewhere(grasp, joints, equations, x)
        refused = refused or farther(equations, x, at)
    refused = refused or _other_motors(grasp, motors)
    if (grasp.mu != terms.friction).any():
        refused = refused or f"friction at its contacts is not {terms.friction:g}"
    if (grasp.lever != (terms.torsion / terms.friction if terms.torsion else 0.0)).any():
        refused = refused or f"torsion at its contacts is not {terms.torsion:g} m"
    commanded = [a for a, value in zip(grasp.actuators, grasp.command.tolist(), strict=True) if value]
    wrong = [a for a in commanded if a not in terms.actuators and set(terms.actuators) & set(grasp.actuators)]
    if wrong:
        refused = refused or f"{wrong[0]} is commanded, which was not asked for"
    most = float(np.abs(grasp.command).max(initial=0.0))
    if most > terms.command_limit * (1 + EQUALITY_TOLERANCE):
        refused = refused or f"commands go up to {most:g}; the limit is {terms.command_limit:g}"
    figures: dict[str, Figure] = {}
    asked = [(1.0, "", witnesses)]
    if strength is not None:
        figures["factor"] = factor = strength.number("factor", least=1.0)
        asked.append((factor, f"{down(factor, 4)} times ", strength.object("witnesses")))
        strength.done()
    for factor, times, states in asked:
        for load, wrench in loads.items():
            if not states.has(load):
                refused = refused or f"has no witness of {times}{load}"
                continue
            parts.append(_held(states.object(load), grasp, terms, times + load, factor * wrench, off))
        states.done()
    f.done()
    return Replay(name, "", refused, figures, parts=tuple(parts))


def _held(f: Fields, grasp: GraspData, terms: _Terms, load: str, wrench: Array, off: Sequence[Array]) -> Replay:
    """That a load (6,) is held in the state of a witness.

    off: how far points (m,) [m] and normals (m,) of the contacts may be from those of the configuration. What that
    makes of contact forces may be no more than what a state may miss, of motions `MOTION_MISSED`.
    """
    state = read_state(f, grasp)
    f.done()
    limits = {a: x for a, x in terms.torque_limits.items() if a in grasp.actuators}
    question = Question(grasp, CHECK, False, wrench, np.zeros(6), terms.eta, True, limits, terms.force_limit, ())
    found = prove(Problem.of(question, grasp.command, wrench), state)
    reason = "" if found.exact or found.tolerant else found.reason
    (points, normals), (arms, J), scale = off, grasp.force_arms, load_scale(grasp, wrench)
    c, d = (np.linalg.norm(y[: 3 * grasp.m].reshape(-1, 3), axis=1) for y in (state.c, grasp.rows[0] @ state.motion))
    twist = np.where(grasp.lever > 0, np.abs(state.torsion) / np.where(grasp.lever > 0, grasp.lever, 1.0), 0.0)
    turned, shifted = 2 * np.hypot(c, twist) * normals, c * points
    torques = turned @ J + shifted @ (grasp.moves & grasp.revolute)
    missed = max(
        turned.sum(), (turned @ arms + shifted.sum()) / grasp.size, (torques / grasp.joint_units).max(initial=0.0)
    )
    turns = np.abs(state.motion[3:6]).sum() + (grasp.moves & grasp.revolute) @ np.abs(state.motion[6:])
    moved = (2 * d * normals + turns * (points + grasp.lever * normals)).max()
    for size, most, what in ((missed, EPS, "forces"), (moved, MOTION_MISSED, "motions")):
        if not size <= most * scale:
            reason = reason or f"its contacts are not those of the configuration by {size:.1e} N with these {what}"
    claim = f"{load} is held" + ("" if found.exact else ", to 1e-9 of the load")
    return Replay(load, claim, reason, {"residual": found.residual, "exact": found.exact})
