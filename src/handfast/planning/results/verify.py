"""Checks plans and grasps again: what is proved of them (`handfast.proofs`), and what is measured anew.

Measured are contacts, joints and mechanism, by the hand's kinematics at the configuration, and what follows from these.
What cannot be computed again stands in a file's `record`, of which nothing is claimed.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from handfast.core.answer import Reach, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import NUMBER_TOLERANCE, Finite, Strict, read_json, validate
from handfast.geometry.contacts import find_contacts, grasp_of
from handfast.geometry.scene import Scene
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.attempt import PENETRATION, Attempts, PlannedGrasp
from handfast.planning.evaluation.evaluator import Derived, contacts_at, grasp_at
from handfast.planning.evaluation.preload_search import PreloadSearch
from handfast.planning.filters.balance import held_by_contacts
from handfast.planning.question import Requirements
from handfast.planning.results import grasps_file
from handfast.planning.results.grasps_file import SavedGrasp, SavedGrasps, loads_to_dict, motors_to_dict
from handfast.proofs import few_contacts, grasps
from handfast.proofs.few_contacts import Fewest
from handfast.proofs.fields import BadFile
from handfast.proofs.replay import Replay
from handfast.readers import grasp_file
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import load_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import digest, fingerprint, task_to_dict

MAX_VALUE_LENGTH = 60  # characters of a value that are shown
# what is computed in several steps has an error of this size times `NUMBER_TOLERANCE`, however small it is
COMPUTED_SIZE = 1e-3

FOLLOWS = "contacts, joints and mechanism are those of the hand at the configuration, and what follows from these"
OBJECT_CLAIM = "loads, friction, solids and centre of mass are those of the plan and of the object's file"
HAND_CLAIM = "contacts, joints and mechanism are those of the hand on the object"
CONTACT_TOLERANCE = 1e-6  # [m] a contact lies as near to one that is measured
# by which its normal may differ: that of a curved face has the direction across a gap of micrometres, of which the ends
# are found to about 1e-11 m
NORMAL_TOLERANCE = 1e-4
PLAN_NOT_REPLAYED = ("that links overlap no deeper than said: measured on convex pieces, like the contacts",)

# --- grasps for a task ------------------------------------------------------------------------------


def verify(saved: SavedGrasps) -> Replay:
    """Does every grasp exist, is it what is said of it, and does it hold every load under its preload?"""
    data = grasps_file.to_dict(saved)
    proved = proved_grasps(data)
    return with_geometry(proved, measured(saved))


def with_geometry(proved: Replay, geometry: Replay) -> Replay:
    """What is proved of a file, and what of it is measured anew, which then need not be believed."""
    missing = tuple(line for line in proved.not_replayed if line != grasps.JOINTS_CLAIM)
    return replace(proved, parts=(*proved.parts, geometry), not_replayed=missing)


def proved_grasps(data: dict[str, Any]) -> Replay:
    """What of a parsed file is proved; `InputError` if it is none."""
    try:
        return grasps.replay_grasps(data)
    except BadFile as fault:
        raise InputError(fault.problem, field=fault.field or None) from None


def measured(saved: SavedGrasps) -> Replay:
    """Is every grasp that of the hand at its configuration, and is all else said that follows? Worked out anew."""
    parts = []
    for k, g in enumerate(saved.grasps, start=1):
        try:
            fault = _fault(g, saved.loads, saved.requirements)
        except InputError as problem:
            fault = str(problem)
        parts.append(Replay(f"grasp {k}", FOLLOWS, fault))
    return Replay("geometry", "", _answer_fault(saved), parts=tuple(parts))


def question_of(saved: SavedGrasps) -> dict[str, Any]:
    """What the grasps of a file are proved for, and which hand, object and task that is relative to; JSON.

    Names are labels; what they stand for is told apart by its `sha256`: of a hand links, joints without limits,
    couplings, motors and closing senses; of an object the regions to touch, mass and centre of mass; of a task hand,
    limits, regions and bounds; of solids, where a NONE rests on them, all shapes and what may overlap.
    """
    task, thing, asked = task_to_dict(saved.task), saved.object, saved.requirements
    joints = [{key: value for key, value in j.items() if key != "limits"} for j in task["hand"]["joints"]]
    hand = {key: task["hand"][key] for key in ("links", "couplings")} | {"joints": joints}
    hand |= {"motors": motors_to_dict(saved.task.hand)}
    body: dict[str, Any] = {"mass": thing.mass, "center_of_mass": list(thing.center_of_mass)}
    shape = [{"region": c["object"]} for c in task["contacts"]]
    made = loads_to_dict(saved.loads)
    return {
        "sha256": saved.question,
        "hand": {"name": saved.task.hand.name, "sha256": digest(hand)},
        "object": {"name": thing.name, **body, "sha256": digest(body | {"regions": shape})},
        "task": {"name": saved.task.name, "sha256": fingerprint(task)},
        "loads": {n: {"wrench": w, "weight": made[n].get("weight")} for n, w in saved.loads.by_name.items()},
        "friction": asked.friction,
        "actuators": list(asked.actuators),
        "eta": asked.eta,
        "torque_limits": dict(asked.torque_limits or {}),
        "force_limit": asked.force_limit,
        "command_limit": asked.command_limit,
        "mdp": True,
        "preloads": [g.grasp.preload for g in saved.grasps],
        **({"torsion": asked.torsion} if asked.torsion else {}),
    } | ({} if saved.solids is None else {"solids": {"sha256": digest(dict(saved.solids))}})


def _answer_fault(saved: SavedGrasps) -> str:
    """What the answer as a whole says that does not follow; '' if nothing."""
    answer = saved.answer
    proved = answer.verdict is Reach.NONE and saved.none is not None and not saved.grasps
    if answer.verdict is not Reach.FOUND and not proved:
        rest = "with a grasp" if saved.grasps else "has no grasp to prove: it rests on the search itself"
        return f"{answer.verdict.upper()} {rest}"
    if not (saved.grasps or proved):
        return "FOUND without a grasp"
    if answer.question != saved.question:
        return "the answer is to another question: task, motors or question were changed"
    return difference(saved.loads.by_name, answer.loads, "answer.loads", small=0.0)


def _fault(g: SavedGrasp, loads: Loads, requirements: Requirements) -> str:
    """What is said of a grasp that does not follow from hand, configuration and question; '' if nothing."""
    bare = grasp_at(g.solution, g.q, contacts_at(g.solution, requirements.friction, requirements.torsion))
    grasp, driven = bare.with_preload(g.grasp.preload), requirements.driven(bare)
    preload = {name: grasp.preload.get(name, 0.0) for name in driven}
    return (
        difference(grasp_file.to_dict(bare) | {"preload": g.said.get("preload")}, g.said, "grasp")
        or difference(grasp.preload, g.said["preload"], "grasp.preload", small=0.0)
        or _commands_fault(grasp, driven, requirements)
        or difference(preload, g.answer.get("preload"), "answer.preload", small=0.0)
        or difference(Derived.of(g.solution, g.q, grasp, preload, loads).to_json(), g.answer, "answer")
    )


def _commands_fault(grasp: Grasp, driven: list[str], asked: Requirements) -> str:
    """Which command was not allowed; '' if all were."""
    for name, value in grasp.preload.items():
        if name not in driven:
            return f"{name} is commanded, which was not asked for"
        if asked.command_limit is not None and abs(value) > asked.command_limit * (1 + NUMBER_TOLERANCE):
            return f"{name} is commanded {value:g}; the limit is {asked.command_limit:g}"
    return ""


# --- plans ------------------------------------------------------------------------------------------


def verify_planned(asked: Attempts, scene: Scene, found: PlannedGrasp) -> Replay:
    """Is a grasp the hand's on the object, within the limits, and does it hold every load under its preload?

    Args:
        scene: of the hand and the object of `asked`.
    """
    measured = Replay("geometry", HAND_CLAIM, _planned_fault(asked, scene, found))
    return Replay("grasp", parts=(replace(found.held.verify(), name="loads"), measured), not_replayed=PLAN_NOT_REPLAYED)


class SceneEntry(Strict):
    """What `plan.json` says of hand and object beside their files; without it what their files say."""

    joint_laws: str = "all"
    backdrivable: list[str] = Field(default_factory=list)
    friction: Finite | None = None
    scale: Finite = 1.0


class NumbersEntry(Strict):
    """Numbers of `plan.json` that its grasps are held against."""

    torsion: Finite = 0.0
    safety: Finite = 1.0


def measured_plan(folder: Path) -> Replay:
    """Are the grasps in the folder of a plan the hand's on the object? Measured anew, from the files that it names.

    Raises:
        InputError: a file is missing or broken, or names no hand or no object.
    """
    file, parts = str(folder / "plan.json"), []
    plan = read_json(folder / "plan.json", "plan")
    try:
        made = validate(SceneEntry, plan.get("scene", {}))
    except InputError as fault:
        raise fault.within("scene").at(file) from None
    try:
        numbers = validate(NumbersEntry, {key: plan[key] for key in NumbersEntry.model_fields if key in plan})
    except InputError as fault:
        raise fault.at(file) from None
    if plan.get("query") != "plan":
        raise InputError(f"is {plan.get('query')!r}; 'plan' is needed", field="query", source=file)
    for entry in (*plan.get("grasps", []), *plan.get("others", [])):
        if "configuration_file" not in entry:
            where = f"{entry['grasp_file']}.configuration_file"
            raise InputError("is missing; the grasp is measured at it", field=where, source=file)
        place = load_configuration(folder / entry["configuration_file"])
        if place.hand is None or place.object is None:
            raise InputError("names no hand or no object", source=str(folder / entry["configuration_file"]))
        hand, q = place.applied(load_hand(place.hand).with_laws(made.joint_laws).with_backdrivable(made.backdrivable))
        body = load_body(place.object, friction=made.friction, scale=made.scale)
        scene, grasp = Scene(hand, body), load_grasp(folder / entry["grasp_file"])
        held = read_json(folder / entry["hold_file"], "hold")
        same = _without_preload(held["question"]["grasp"]) == _without_preload(grasp_file.to_dict(grasp))
        wrong = "" if same else "its proof is about another grasp"
        proved = held["answer"].get("margin")
        times = None if proved is None else numbers.safety * proved
        if any(c.torsion != numbers.torsion for c in grasp.contacts):
            wrong = wrong or f"its torsion is not that of the plan, {numbers.torsion:g} m"
        wrong = wrong or ("margin" in entry and difference(times, entry["margin"], "margin")) or ""
        parts.append(Replay(entry["grasp_file"], HAND_CLAIM, wrong or _hand_fault(scene, q, place.pose, grasp)))
    if plan.get("contacts_file"):
        parts.append(Replay(plan["contacts_file"], OBJECT_CLAIM, _contacts_fault(folder, plan, made)))
    return Replay("geometry", parts=tuple(parts), not_replayed=PLAN_NOT_REPLAYED)


def _contacts_fault(folder: Path, plan: dict[str, Any], made: SceneEntry) -> str:
    """What of the question how many contacts it takes is not that of the plan and of its object; '' if nothing."""
    said = read_json(folder / plan["contacts_file"], few_contacts.SCHEMA)
    loads = Loads(tuple(plan["loads"]), np.array(list(plan["loads"].values())).reshape(-1, 6))
    body, limit = load_body(said["object"], friction=made.friction, scale=made.scale), said.get("force_limit")
    torsion = plan.get("torsion", 0.0)
    held = held_by_contacts(body, loads, np.inf if limit is None else limit, torsion=torsion)
    due = few_contacts.to_json(held, loads.names, said["object"], Fewest(said.get("contacts"), said.get("reason", "")))
    return difference(dict(due), said, plan["contacts_file"])


def _planned_fault(asked: Attempts, scene: Scene, found: PlannedGrasp) -> str:
    """What is wrong with a grasp beside its answer; '' if nothing."""
    grasp, answer, limits = found.grasp, found.answer, asked.options.limits
    if answer.verdict is not Verdict.HOLDS:
        return "its loads are not held"
    if answer.loads.by_name != asked.loads.by_name:
        return "its answer is about other loads"
    if any(c.torsion != asked.options.torsion for c in grasp.contacts):
        return "its contacts have another torsion"
    if answer.limits != limits.of_grasp(grasp):
        return "its answer is within other limits"
    of_checks = [a.posed.problem.grasp for a in answer.checks if a.posed]
    own = _without_preload(grasp_file.to_dict(grasp))
    if any(_without_preload(grasp_file.to_dict(g)) != own for g in of_checks):
        return "its answer is about another grasp"
    if {n: f for n, f in (answer.preload or {}).items() if f} != grasp.preload:
        return "its answer is about another preload"
    if PreloadSearch(asked.body, asked.loads, limits).strength(grasp) > 1:
        return "its commands are larger than allowed"
    hand, body = asked.hand, asked.body
    if len(found.q) != hand.l:
        return f"its configuration has {len(found.q)} joints, the hand {hand.l}"
    same_center = grasp.center_of_mass is None or np.array_equal(grasp.center_of_mass, body.center_of_mass)
    if grasp.mass not in (None, body.mass) or not same_center:
        return "its object has another mass or centre of mass"
    try:
        hand.configuration(dict(zip(hand.joint_names, found.q.tolist(), strict=True)))  # limits and loops
        return _hand_fault(scene, found.q, found.pose, grasp)
    except InputError as fault:
        return str(fault)


def _without_preload(data: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in data.items() if key != "preload"}


def _hand_fault(scene: Scene, q: Array, pose: Array, grasp: Grasp) -> str:
    """What of a grasp does not follow from hand, configuration q (l,) and contacts; '' if nothing."""
    made = grasp_of(scene.hand, q, grasp.contacts, pose, name=grasp.name)
    due, said = (grasp_file.to_dict(Grasp(g.contacts, g.joints, g.mechanism, None, g.name)) for g in (made, grasp))
    return difference(due, said, "grasp") or touch_fault(scene, q, pose, grasp)


def touch_fault(scene: Scene, q: Array, pose: Array, grasp: Grasp) -> str:
    """Which contact is not where hand and object touch, or how deep they are in each other; '' if all is well.

    q: (l,) configuration. pose: (4, 4) of the object in the hand's base frame.
    """
    measured = find_contacts(scene.hand, q, scene.body, pose, scene=scene)
    for k, c in enumerate(grasp.contacts):
        near = [m for m in measured if m.link == c.link and np.abs(m.position - c.position).max() <= CONTACT_TOLERANCE]
        if not any(np.abs(m.normal - c.normal).max() <= NORMAL_TOLERANCE and m.friction == c.friction for m in near):
            return f"contact {k} of {c.link}: hand and object do not touch there so"
    deep = max(c.depth for c in measured)
    return "" if deep <= PENETRATION else f"hand and object penetrate by {deep * 1e3:.3g} mm"


# --- JSON -------------------------------------------------------------------------------------------


def difference(due: Any, said: Any, at: str, small: float = COMPUTED_SIZE) -> str:
    """Where JSON is not what it should be: its path and both values, one line; '' if nowhere but for rounding.

    Numbers are compared by their difference: as a share of the largest in their list, or of `small` if that is larger.
    """
    if isinstance(due, dict) and isinstance(said, dict):
        for key in [*due, *said]:
            if key not in said:
                return f"{at}.{key} is missing"
            if key not in due:
                return f"{at}.{key} follows from nothing in the file"
        return next(filter(None, (difference(due[key], said[key], f"{at}.{key}", small) for key in due)), "")
    if isinstance(due, list) and isinstance(said, list):
        if len(due) != len(said):
            return f"{at} has {len(said)} entries, not {len(due)}"
        pairs = enumerate(zip(due, said, strict=True))
        small = max([small, *(abs(x) for x in due if _is_number(x))])
        return next(filter(None, (difference(a, b, f"{at}[{i}]", small) for i, (a, b) in pairs)), "")
    if _is_number(due) and _is_number(said):
        same = abs(due - said) <= NUMBER_TOLERANCE * max(small, abs(due))
    else:
        same = type(due) is type(said) and due == said
    return "" if same else f"{at} is {_shown(said)}; of hand, configuration and question it is {_shown(due)}"


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool)


def _shown(x: Any) -> str:
    text = json.dumps(x)
    return text if len(text) <= MAX_VALUE_LENGTH else f"{text[:MAX_VALUE_LENGTH]}..."
