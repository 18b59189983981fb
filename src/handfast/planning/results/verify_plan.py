"""Checks a grasp of a plan again: that it is the hand's on the object, and every load under its preload.

The witnesses are put into the equations of the model by `HoldAnswer.verify`, which needs nothing of a search. Joints
and mechanism are made anew of hand and configuration, contacts are measured anew.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import read_json
from handfast.geometry.contacts import find_contacts, grasp_of
from handfast.geometry.scene import Scene
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.attempt import PENETRATION, Attempts, PlannedGrasp
from handfast.planning.evaluation.preload_search import PreloadSearch
from handfast.planning.results.verify_grasps import difference
from handfast.proofs.replay import Replay
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import load_grasp, to_dict
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

CLOSE = 1e-6  # [m] a contact lies as near to one that is measured
LIMITS = "eta", "torque_limits", "force_limit"
NOT_REPLAYED = ("that links overlap no deeper than said: measured on convex pieces, like the contacts",)


def verify_planned(asked: Attempts, scene: Scene, found: PlannedGrasp) -> Replay:
    """Is a grasp the hand's on the object, within the limits, and does it hold every load under its preload?

    Args:
        scene: of the hand and the object of `asked`.
    """
    geometry = Replay("geometry", "contacts, joints and mechanism are those of the hand on the object")
    measured = replace(geometry, refused=_fault(asked, scene, found))
    return Replay("grasp", parts=(replace(found.held.verify(), name="loads"), measured), not_replayed=NOT_REPLAYED)


def measured_plan(folder: Path) -> Replay:
    """Are the grasps in the folder of a plan the hand's on the object? Measured anew, from the files that it names.

    Raises:
        InputError: a file is missing or broken, or names no hand or no object.
    """
    plan, parts = read_json(folder / "plan.json", "plan"), []
    for entry in (*plan["grasps"], *plan["others"]):
        place = load_configuration(folder / entry["configuration_file"])
        if place.hand is None or place.object is None:
            raise InputError("names no hand or no object", source=str(folder / entry["configuration_file"]))
        hand, q = place.applied(load_hand(place.hand))
        scene, grasp = Scene(hand, load_body(place.object)), load_grasp(folder / entry["grasp_file"])
        held = read_json(folder / entry["hold_file"], "hold")["question"]["grasp"]
        same = {key: value for key, value in held.items() if key != "preload"} == _named(grasp)
        made = grasp_of(hand, q, grasp.contacts, place.pose, name=grasp.name)
        wrong = "" if same else "its proof is about another grasp"
        wrong = (
            wrong or difference(_of_hand(made), _of_hand(grasp), "grasp") or touch_fault(scene, q, place.pose, grasp)
        )
        claim = "contacts, joints and mechanism are those of the hand on the object"
        parts.append(Replay(entry["grasp_file"], claim, wrong))
    return Replay("geometry", parts=tuple(parts), not_replayed=NOT_REPLAYED)


def _named(grasp: Grasp) -> dict[str, object]:
    return {key: value for key, value in to_dict(grasp).items() if key != "preload"}


def _fault(asked: Attempts, scene: Scene, found: PlannedGrasp) -> str:
    """What is wrong with a grasp beside its answer; '' if nothing."""
    grasp, answer = found.grasp, found.answer
    if answer.verdict is not Verdict.HOLDS:
        return "its loads are not held"
    if answer.loads.by_name != asked.loads.by_name:
        return "its answer is about other loads"
    if any(answer.limits.get(n) != asked.limits.of_a_load[n] for n in LIMITS):
        return "its answer is within other limits"
    of_checks = [a.posed.problem.grasp for a in answer.checks if a.posed]
    if any(to_dict(g.with_preload(None)) != to_dict(grasp.with_preload(None)) for g in of_checks):
        return "its answer is about another grasp"
    if {n: f for n, f in (answer.preload or {}).items() if f} != grasp.preload:
        return "its answer is about another preload"
    if PreloadSearch(asked.body, asked.loads, asked.limits).strength(grasp) > 1:
        return "its commands are larger than allowed"
    hand, body = asked.hand, asked.body
    if len(found.q) != hand.l:
        return f"its configuration has {len(found.q)} joints, the hand {hand.l}"
    if grasp.mass not in (None, body.mass) or not _same_point(grasp.center_of_mass, body.center_of_mass):
        return "its object has another mass or centre of mass"
    try:
        hand.configuration(dict(zip(hand.joint_names, found.q.tolist(), strict=True)))  # limits and loops
        made = grasp_of(hand, found.q, grasp.contacts, found.pose, name=grasp.name)
    except InputError as fault:
        return str(fault)
    wrong = difference(_of_hand(made), _of_hand(grasp), "grasp")
    return wrong or touch_fault(scene, found.q, found.pose, grasp)


def _same_point(stated: Array | None, known: Array | None) -> bool:
    return stated is None or (known is not None and np.array_equal(stated, known))


def _of_hand(grasp: Grasp) -> dict[str, object]:
    """What of a grasp follows from hand, configuration and contacts."""
    bare = Grasp(grasp.contacts, grasp.joints, grasp.mechanism, None, grasp.name)
    return to_dict(bare)


def touch_fault(scene: Scene, q: Array, pose: Array, grasp: Grasp) -> str:
    """Which contact is not where hand and object touch, or how deep they are in each other; '' if all is well.

    q: (l,) configuration. pose: (4, 4) of the object in the hand's base frame.
    """
    measured = find_contacts(scene.hand, q, scene.body, pose, scene=scene)
    for k, c in enumerate(grasp.contacts):
        near = [m for m in measured if m.link == c.link and np.abs(m.position - c.position).max() <= CLOSE]
        if not any(np.abs(m.normal - c.normal).max() <= CLOSE and m.friction == c.friction for m in near):
            return f"contact {k} of {c.link}: hand and object do not touch there so"
    deep = max(c.depth for c in measured)
    return "" if deep <= PENETRATION else f"hand and object penetrate by {deep * 1e3:.3g} mm"
