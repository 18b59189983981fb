"""Grasps for a task, by hand: what the checker adds to the proofs that a file is made of.

A block of 50 mm between the round fingertips of a gripper, which is driven on its left slide and coupled: with 2 N
there each fingertip presses with 1 N. Friction is 0.8, so that both hold 1.6 N together: 3.2 times the loads of 0.5 N.
A second motor, on the right slide, is commanded nothing.
"""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.planning.results import grasps_file
from handfast.proofs import grasps
from handfast.proofs.configurations import examined, read_existence, solution
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.contact_force_limits import ForceLimits
from handfast.proofs.existence import Proved
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.grasp import read_grasp
from handfast.proofs.grasps import replay_grasps
from handfast.proofs.replay import Replay
from handfast.proofs.synthesis import NAMES_CLAIM, SYNTHESIS_COURSE
from handfast.proofs.tasks import read_task
from handfast.synthesis.embedded_task import task_to_dict
from tests.support.holds import grip

Data = dict[str, Any]
SIDES = {"left_finger": 1.0, "right_finger": -1.0}
DOWN = [0.0, 0.0, -0.5, 0.0, 0.0, 0.0]
WIDTH = 0.05  # [m]


def state(z: float) -> Data:
    """Each finger pushes up with z [N]: the tangents of the two contacts are opposite."""
    forces = [1.0, z, 0.0, 1.0, -z, 0.0]
    return {"r": [0.0] * 6, "q": [1.0, 1.0], "c": forces, "f": [2.0, 0.0], "coupling": [1.0]}


def question() -> Data:
    weight = {"along": [0.0, 0.0, -1.0], "g": 10.0, "factor": 0.5}
    return {
        "object": {"name": "block", "mass": 0.1, "center_of_mass": [0.0, 0.0, 0.0]},
        "loads": {"down": {"wrench": DOWN}, "weight": {"weight": weight}},
        "friction": 0.8,
        "actuators": ["grip"],
        "eta": 0.0,
        "torque_limits": {},
        "force_limit": 60.0,
        "command_limit": 2.0,
    }


def found() -> Data:
    """The file of one grasp, which holds three times its loads."""
    task = grip(WIDTH)
    contacts = [
        {"position": [0, y * WIDTH / 2, 0], "normal": [0, -y, 0], "friction": 0.8, "link": link, "depth": 0.0}
        for link, y in SIDES.items()
    ]
    joints = [
        {"name": name, "type": "prismatic", "axis": [0, -y, 0], "origin": [0, 0.04 * y, 0], "moves": [k]}
        for k, (name, y) in enumerate((("left_slide", 1.0), ("right_slide", -1.0)))
    ]
    actuators = [
        {"name": name, "joints": {joint: 1.0}, "tendon": False, "backdrivable": name == "spare"}
        for name, joint in (("grip", "left_slide"), ("spare", "right_slide"))
    ]
    labels = ["position:1", "joint:left_slide", *(f"contact:{k}:{x}" for k in (0, 1) for x in "st")]
    existence = {
        "schema": "handfast/existence/1",
        "joints": {"left_slide": 0.015},
        "position": [0.0, 0.0, 0.095],
        "quaternion": [1.0, 0.0, 0.0, 0.0],
        "contacts": [{"link": link, "object": [0.5, 0.5], "hand": None} for link in SIDES],
        "dependent": labels,
        "radii": [1e-9, 1e-9, 1e-7, 1e-7, 1e-7, 1e-7],
    }
    mechanism = {"actuators": actuators, "couplings": [{"left_slide": -1.0, "right_slide": 1.0}]}
    grasp = {"schema": "handfast/grasp/1", "name": "grip", "contacts": contacts, "joints": joints}
    grasp |= {"mechanism": mechanism, "preload": {"grip": 2.0}}
    motors = grasps_file.motors_to_dict(task.hand)
    motors["actuators"] = copy.deepcopy(actuators)
    entry = {"existence": existence, "joints": {"left_slide": 0.015, "right_slide": 0.015}, "grasp": grasp}
    entry["witnesses"] = {load: state(0.25) for load in ("down", "weight")}
    entry["strength"] = {"factor": 3.0, "witnesses": {load: state(0.75) for load in ("down", "weight")}}
    answer = {"verdict": "found", "loads": {"down": DOWN, "weight": DOWN}}
    data = {"schema": "handfast/grasps/1", "task": task_to_dict(task), "motors": motors, "question": question()}
    return json.loads(json.dumps(data | {"answer": answer, "grasps": [entry], "checksum": "", "record": {}}))


def none(proof: Data, **asked: Any) -> Data:
    """The file that says that there is no grasp."""
    data = found() | {"grasps": [], "none": proof}
    data["answer"]["verdict"] = "none"
    data["question"] |= asked
    return data


def changed(data: Data, *changes: Callable[[Data], Any]) -> Replay:
    for change in changes:
        change(data)
    return replay_grasps(data)


def changed_entry(*changes: Callable[[Data], Any]) -> Data:
    data = found()
    for change in changes:
        change(data)
    return data["grasps"][0]


def put(path: str, value: Any) -> Callable[[Data], None]:
    """Another value at a path, or none if it is `...`."""

    def change(data: Data) -> None:
        *inner, last = (int(key) if key.isdigit() else key for key in path.split("/"))
        for key in inner:
            data = data[key]  # type: ignore[index]
        if value is ...:
            del data[last]  # type: ignore[arg-type]
        else:
            data[last] = value  # type: ignore[index]

    return change


def test_a_grasp_and_what_it_holds_are_proved() -> None:
    done = replay_grasps(found())
    assert done.ok, done.reason
    assert done.name == "grasps"
    (grasp,) = done.parts
    assert (grasp.name, grasp.figures) == ("grasp 1", {"factor": 3.0})
    parts = {part.name: part.claim for part in grasp.parts}
    held = {name: f"{name} is held" for name in ("down", "weight", "3 times down", "3 times weight")}
    assert parts == {"configuration": "an exact one exists in its box"} | held
    assert all(part.figures == {"exact": True, "residual": 0.0} for part in grasp.parts[1:])
    assert done.not_replayed == (
        "what the answer repeats of its grasps, clearances, scores, lower bounds of commands and the course of the "
        "search",
        "that the joints of a grasp, what acts on them and what ties them are those of the hand at its configuration, "
        "and in which sense its motors drive them",
        NAMES_CLAIM,
    )


def renamed(entry: Data) -> Data:
    """With another name for the motor, whose limits would be those of no other."""
    text = json.dumps(entry).replace('{"name": "grip", "joints"', '{"name": "x", "joints"').replace('{"grip"', '{"x"')
    out: Data = json.loads(text)
    return out


G = "grasps/0/"
REFUSED = {
    "other forces": (put(G + "witnesses/weight/c/1", -0.25), "grasp 1: weight: .*missed"),
    "forces of once": (put(G + "strength/witnesses/down", state(0.25)), "grasp 1: 3 times down: .*missed"),
    "stronger": (put(G + "strength/factor", 3.1), "grasp 1: 3.1 times down: .*missed"),
    "slides": (put(G + "witnesses/down/r/0", 0.3), "grasp 1: down: "),  # friction is not along what slides
    "one contact": (put(G + "grasp/contacts/0/friction", 0.9), "grasp 1: friction at its contacts is not 0.8$"),
    "fixed": (
        put("task/hand/joints/1/limits", [0.015, 0.015]),
        "^joint right_slide is fixed by its limits, but follows",
    ),
    "no state": (put(G + "witnesses/weight", ...), "grasp 1: has no witness of weight$"),
    "no state of more": (put(G + "strength/witnesses/weight", ...), "grasp 1: has no witness of 3 times weight$"),
    "friction": (put("question/friction", 0.9), "grasp 1: friction at its contacts is not 0.9$"),
    "torsion": (put("question/torsion", 0.001), "grasp 1: torsion at its contacts is not 0.001 m$"),
    "other motor": (put("question/actuators", ["spare"]), "grasp 1: grip is commanded, which was not asked for$"),
    "command": (put("question/command_limit", 1.999), "grasp 1: commands go up to 2; the limit is 1.999$"),
    "force": (put("question/force_limit", 0.999), "grasp 1: down: contact 0 is not proved to keep the force limit"),
    "torque": (put("question/torque_limits", {"grip": 1.9}), "down: actuator 'grip' is not proved to keep its limit"),
    "said loads": (put("answer/loads/down", [0.0] * 6), "^the answer is about other loads$"),
    "said names": (put("answer/loads", {"down": DOWN}), "^the answer is about other loads$"),
    "not said": (put("answer/loads", None), "^the answer is about other loads$"),
    "mass": (put("question/object/mass", 0.2), "^the answer is about other loads$"),
    "centre": (put("question/object/center_of_mass", [0.01, 0.0, 0.0]), "^the answer is about other loads$"),
    "twice": (lambda data: data["grasps"].append(data["grasps"][0]), "^a grasp is there twice$"),
    "no grasp": (put("grasps", []), "^FOUND without a grasp$"),
    "none": (put("answer/verdict", "none"), "^NONE with a grasp$"),
    "pose": (put(G + "existence/position/1", 1e-6), "grasp 1: configuration: the floats do not meet the equations"),
    "joint": (put(G + "joints/left_slide", 0.016), "grasp 1: left_slide is not at the value that is proved$"),
    "coupling": (put(G + "joints/right_slide", 0.016), "grasp 1: right_slide does not follow its coupling$"),
    "link": (
        put(G + "grasp/contacts/1/link", "left_finger"),
        "grasp 1: its contacts are of left_finger, left_finger; those of the task are of left_finger, right_finger$",
    ),
    # contacts 0.025 m from their middle, of which 1e-9 is 0.025 nm; they are 0.095 m from the palm, which is no matter
    "point": (
        put(G + "grasp/contacts/1/position/2", 2.6e-11),
        "grasp 1: the point of contact 1 is not that of the configuration$",
    ),
    "normal": (
        put(G + "grasp/contacts/0/normal", [1.1e-9, -1.0, 0.0]),
        "grasp 1: the normal of contact 0 is not that of the configuration$",
    ),
    "renamed": (
        lambda data: data["grasps"][0].update(renamed(data["grasps"][0])),
        "grasp 1: its actuator grip is not that of the motors$",
    ),
    "gearing": (
        put(G + "grasp/mechanism/actuators/0/joints/left_slide", 2.0),
        "grasp 1: its actuator grip is not that of the motors$",
    ),
    "tendon": (
        put(G + "grasp/mechanism/actuators/0/tendon", True),
        "grasp 1: its actuator grip is not that of the motors$",
    ),
    "turned back": (
        put(G + "grasp/mechanism/actuators/1/backdrivable", False),
        "grasp 1: its actuator spare is not that of the motors$",
    ),
    "no motor": (
        lambda data: data["motors"]["actuators"].append({"name": "third", "joints": {"left_slide": 1.0}}),
        "grasp 1: its actuator third is not that of the motors$",
    ),
}


@pytest.mark.parametrize(("change", "reason"), REFUSED.values(), ids=REFUSED)
def test_what_is_said_otherwise_is_refused(change: Callable[[Data], None], reason: str) -> None:
    fault = changed(found(), change).fault
    assert re.search(reason, fault), fault


def test_what_may_be_left_out_or_is_weaker() -> None:
    assert changed(found(), put("question/force_limit", ...), put("question/command_limit", ...)).ok
    assert changed(found(), put("question/torque_limits", {"grip": 2.5, "spare": 0.1})).ok
    done = changed(found(), put(G + "strength", ...))
    assert done.ok
    assert [part.name for part in done.parts[0].parts] == ["configuration", "down", "weight"]
    wrenches = [put("question/loads/weight", ...), put("answer/loads/weight", ...), put("question/object/mass", ...)]
    wrenches += [put(G + "strength", ...), put(G + "witnesses/weight", ...)]
    assert changed(found(), *wrenches).ok
    lighter = [put("question/object/mass", 0.05), put("answer/loads/weight", [0.0, 0.0, -0.25, 0.0, 0.0, 0.0])]
    assert "grasp 1: weight: " in changed(found(), *lighter).fault  # the forces are those of more


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        (put("question/friction", -0.1), "friction: is -0.1; 0 or more is needed"),
        (put("question/torsion", -0.1), "torsion: is -0.1; 0 or more is needed"),
        (put("question/eta", -0.1), "eta: is -0.1; 0 or more is needed"),
        (put("question/eta", 0.7854), "^question.eta: is 0.7854 rad; 0 to 0.7854 is possible, above 0 with point cont"),
        (lambda d: d["question"].update(eta=0.1, torsion=0.001), "^question.eta: is 0.1 rad; 0 to .* point contacts"),
        (put("question/force_limit", -1.0), "^question.force_limit: is -1; a limit is positive$"),
        (put("question/force_limit", 0.0), "^question.force_limit: is 0; a limit is positive$"),
        (put("question/command_limit", -1.0), "^question.command_limit: is -1; 0 or more is needed$"),
        (put("question/torque_limits", {"grip": 0.0}), "^question.torque_limits.grip: is 0; a limit is positive$"),
        (
            put("question/torque_limits", {"thumb": 1.0}),
            "^question.torque_limits: has unknown actuator 'thumb'; known are grip, spare$",
        ),
        (put("motors/actuators/1/name", "grip"), "^motors.actuators: 'grip' is there twice$"),
        (put("question/object/mass", -0.1), "mass: is -0.1; 0 or more is needed"),
        (put("question/object/mass", 0.0), "weight: needs an object with a mass, and a direction"),
        (put("question/object/mass", ...), "weight: needs an object with a mass, and a direction"),
        (put("question/loads/weight/weight/along", [0, 0, 0]), "weight: needs an object with a mass, and a direction"),
        (put("question/loads", {}), "^question.loads: is empty; at least one load is needed"),
        (put("question/loads/down", {}), "^question.loads.down: needs either a wrench or a weight"),
        (put("question/loads/weight/wrench", DOWN), "^question.loads.weight: needs either a wrench or a weight"),
        (put("question/loads/down/more", 1), "down.*more"),
        (put("question/loads/weight/weight/more", 1), "weight.*more"),
        (put("question/more", 1), "more"),
        (put("question/object/more", 1), "more"),
        (put("more", 1), "more"),
        (put(G + "more", 1), "more"),
        (put(G + "witnesses/more", {}), "more"),
        (put(G + "strength/more", {}), "more"),
        (put(G + "witnesses/down/more", 1), "more"),
        (put("question/actuators", ["thumb"]), "question.actuators: .*thumb"),
        (put("motors/actuators/0/name", 1), "^motors.actuators.0..name"),
        (put("answer/verdict", "maybe"), "answer.verdict"),
        (put("schema", "handfast/grasps/0"), "schema"),
        (put(G + "strength/factor", 0.99), "factor: is 0.99; 1 or more is needed"),
    ],
)
def test_what_no_file_of_grasps_says(change: Callable[[Data], None], fault: str) -> None:
    with pytest.raises(BadFile, match=fault):
        changed(found(), change)


def test_contacts_and_motors_are_the_same_but_for_rounding_and_senses() -> None:
    near = [put(G + "grasp/contacts/1/position/2", 2.4e-11), put(G + "grasp/contacts/0/normal", [0.9e-9, -1.0, 0.0])]
    grasp, motors = read_grasp(changed_entry(*near)["grasp"], "g"), grasps._read_motors(Fields(found()["motors"]))
    equations = ContactEquations.of(read_task(found()["task"]))
    proof = read_existence(found()["grasps"][0]["existence"])
    _, at, _ = examined(equations, proof, "")
    assert at is not None
    where = (
        {"left_slide": 0.015, "right_slide": 0.015},
        equations,
        solution(equations, proof, at),
    )
    assert grasps._elsewhere(grasp, *where)[0] == ""
    grasp.__dict__["size"] = 1e6  # as of a contact alone that a joint turns which is said to be far: 1 mm would be near
    assert grasps._elsewhere(grasp, *where)[0] == ""
    off = read_grasp(changed_entry(put(G + "grasp/contacts/1/position/2", 1e-10))["grasp"], "g")
    off.__dict__["size"] = 1e6
    assert grasps._elsewhere(off, *where)[0] == "the point of contact 1 is not that of the configuration"
    assert grasps._other_motors(grasp, motors) == ""
    turned = changed_entry(put(G + "grasp/mechanism/actuators/0/joints/left_slide", -1.0))["grasp"]
    assert grasps._other_motors(read_grasp(turned, "g"), motors) == ""
    elsewhere = {"far": ({"other": 1.0}, False, False), "none": ({}, False, False)}  # they move no joint of the grasp
    assert grasps._other_motors(grasp, motors | elsewhere) == ""


def test_a_grasp_is_that_of_the_exact_configuration_and_not_of_its_floats() -> None:
    """In boxes that reach so far the floats may be 0.02 mm above where the fingertips touch, or 1 um beside it."""
    raised = [put(G + f"existence/contacts/{k}/object/1", 0.501) for k in (0, 1)]  # of 20 mm
    raised += [put(G + f"grasp/contacts/{k}/position/2", 2e-5) for k in (0, 1)]
    moved = [put(G + f"{where}joints/left_slide", 0.015001) for where in ("", "existence/")]
    moved += [put(G + "joints/right_slide", 0.015001)]
    wide, open_ = [1e-8, 1e-8, *[0.002] * 4], [1e-5, 1e-5, *[3e-9] * 4]
    for changes, radii, what in ((raised, wide, "the point of contact 0"), (moved, open_, "left_slide")):
        assert changed(found(), put(G + "existence/radii", radii)).ok
        done = changed(found(), put(G + "existence/radii", radii), *changes)
        assert all(part.ok for part in done.parts[0].parts)
        assert done.fault == f"grasp 1: {what} is not that of the configuration"


def test_where_the_object_is_is_told_of_the_exact_configuration() -> None:
    """Its contacts and joints are those of the exact one, the object's place is 2 um off, in a box of 3 um."""
    data = found()
    proof = data["grasps"][0]["existence"]
    number = proof["dependent"].index("position:1")
    proof["radii"][number] = 3e-6
    assert replay_grasps(data).ok
    proof["position"][1] += 2e-6
    words = "grasp 1: position of the exact configuration may be 2e-06 from what is said"
    assert replay_grasps(data).reason == words


def test_a_grasp_of_more_contacts_is_none_of_the_task() -> None:
    """A third contact below the block, on which nothing presses: all else is as it was."""
    data = found()
    one = data["grasps"][0]
    one["grasp"]["contacts"].append(
        {"position": [0, 0, -0.01], "normal": [0, 0, 1], "friction": 0.8, "link": "left_finger"}
    )
    one["grasp"]["joints"][0]["moves"].append(2)
    for states in (one["witnesses"], one["strength"]["witnesses"]):
        for load in states.values():
            load["c"] += [0.0] * 3
    done = replay_grasps(data)
    assert done.fault.startswith("grasp 1: its contacts are of left_finger, right_finger, left_finger; those of the ")
    assert all(part.ok for part in done.parts[0].parts)


def test_torsion_needs_friction() -> None:
    with pytest.raises(BadFile, match=r"^question\.torsion: is there where friction is 0"):
        changed(found(), put("question/friction", 0.0), put("question/torsion", 0.001))


# --- no grasp, and none that holds more ---------------------------------------------------------------

# the object moves down, along the faces: without friction nothing works against the load
SLIDES = {"motions": [{"loads": {"down": 1.0}, "twist": [0, 0, -1, 0, 0, 0]}], "tree": [-1]}


def test_of_no_grasp_something_is_shown() -> None:
    done = replay_grasps(none(SLIDES, friction=0.0))
    assert done.ok, done.reason
    assert (done.name, done.claim, done.not_replayed) == ("grasps", "", (SYNTHESIS_COURSE, NAMES_CLAIM))
    (part,) = done.parts
    assert (part.name, part.figures) == ("balance", {"boxes": 1})
    assert part.claim.endswith("with a friction of 0 and normal forces up to 60 N no contact forces balance down")
    assert "boxes are not refuted" in replay_grasps(none(SLIDES)).fault
    data = none(SLIDES, friction=0.0)
    assert changed(data, put("answer/verdict", "found")).fault == "FOUND with a proof that there is none"
    assert changed(data, put("answer/verdict", "undecided")).fault == "UNDECIDED with a proof that there is none"
    other = changed(none(SLIDES, friction=0.0), put("answer/loads/down", [0.0] * 6))
    assert (other.name, other.claim, other.fault, other.parts) == ("grasps", "", "the answer is about other loads", ())
    fixed = changed(found(), put("task/hand/joints/1/limits", [0.015, 0.015]))
    assert (fixed.name, fixed.claim, fixed.parts) == ("grasps", "", ())
    for verdict in ("none", "undecided"):
        alone = changed(none(SLIDES), put("none", ...), put("answer/verdict", verdict))
        assert alone.fault == f"{verdict.upper()} rests on the search itself, ask it again"


def test_forces_are_limited_by_the_file_and_by_the_motors() -> None:
    """Each contact gives 0.8 times its normal force: 0.3 N are too few for 0.5 N, 0.32 N are not.

    The motor gives 0.3 N for both fingers. Where a fingertip is touched 0.5 rad from its axis, a normal force c pushes
    it back with c (cos 0.5 - 0.8 sin 0.5) at least: it is 0.607 N at most, and both contacts hold 0.971 N; a bound that
    is less than a ninth above is good enough. At 1 rad friction alone keeps the finger where it is.
    """
    assert replay_grasps(none(SLIDES, force_limit=0.3)).ok
    assert "boxes are not refuted" in replay_grasps(none(SLIDES, force_limit=0.32)).fault

    def by_motors(load: float, half_angle: float, **asked: float) -> Replay:
        wrench = [0.0, 0.0, -load, 0.0, 0.0, 0.0]
        data = none(SLIDES, loads={"down": {"wrench": wrench}}, torque_limits={"grip": 0.3}, **asked)
        data["question"]["force_limit"], data["answer"]["loads"] = None, {"down": wrench}
        del data["motors"]["actuators"][1:], data["motors"]["laws"]
        for contact in data["task"]["contacts"]:
            contact["hand"]["cap"]["half_angle"] = half_angle
        return replay_grasps(data)

    assert by_motors(1.08, 0.5).ok
    assert "boxes are not refuted" in by_motors(0.971, 0.5).fault
    assert "boxes are not refuted" in by_motors(10.0, 1.0).fault
    # nothing turns here, so that torsion makes neither limits nor forces across larger
    assert by_motors(1.08, 0.5, torsion=0.001).ok


def test_weights_say_how_far_the_line_through_two_contacts_is() -> None:
    """Contacts are within 10 mm of the middle: a centre 60 mm above is 50 mm from each line, or more."""
    data = none({"motions": [{"loads": {"weight": 1.0}, "twist": [0, 0, -1, 0, 0, 0]}], "tree": [-1]}, friction=0.0)
    changed(data, put("question/loads/down", ...), put("answer/loads/down", ...))
    changed(data, put("question/object/center_of_mass", [0.0, 0.0, 0.06]))
    (part,) = replay_grasps(data).parts
    assert 0.045 < part.figures["line_distance"] <= 0.05
    assert "the line through them is at least 4" in part.claim
    data["question"]["loads"]["push"] = {"wrench": DOWN}
    data["answer"]["loads"]["push"] = DOWN
    assert "line_distance" not in replay_grasps(data).parts[0].figures


def test_few_contacts_hold_no_loads_of_both_signs() -> None:
    up = [0.0, 0.0, 0.5, 0.0, 0.0, 0.0]

    def file(few: int, **asked: Any) -> Data:
        data = none({"fewest_contacts": few}, loads={"down": {"wrench": DOWN}, "up": {"wrench": up}}, **asked)
        data["answer"]["loads"] = {"down": DOWN, "up": up}
        data["task"]["contacts"] = data["task"]["contacts"][:1]
        return data

    done = replay_grasps(file(2))
    assert done.ok
    assert done.parts[0].claim.startswith("1 contacts cannot hold down, up with a friction of 0.8: loads of both signs")
    assert (done.parts[0].figures, done.not_replayed) == ({"contacts": 2}, (SYNTHESIS_COURSE, NAMES_CLAIM))
    assert replay_grasps(file(2, torsion=0.001)).ok
    assert replay_grasps(file(2, friction=0.0)).ok  # loads of both signs along one direction
    assert replay_grasps(file(3)).fault == "balance: shown is only that it takes 2"
    assert replay_grasps(file(1)).fault == "balance: shown is only that it takes 2"


def bounded(factor: float, limit: float = 1.0) -> Data:
    """Two contacts with 1 N each hold 1.6 N by friction: 3.2 times the loads."""
    data = found()
    data["question"]["force_limit"] = limit
    data["bound"] = SLIDES | {"factor": factor}
    return data


def test_a_bound_is_above_what_any_placement_holds() -> None:
    done = replay_grasps(bounded(3.21, 1.001))
    assert done.parts[-1].name == "bound"
    assert done.parts[-1].ok
    assert "forces balance 3.21 times or more down" in done.parts[-1].claim
    assert "bound: 1 of 1 boxes are not refuted" in replay_grasps(bounded(3.2, 1.001)).fault
    assert replay_grasps(bounded(2.9, 0.5)).fault == (
        "no placement is said to hold the loads 2.9 times, and a grasp 3 times"
    )
    data = bounded(2.9, 0.5)
    data["grasps"].append(copy.deepcopy(data["grasps"][0]))
    del data["grasps"][1]["strength"]
    assert replay_grasps(data).fault.endswith("and a grasp 3 times")  # the stronger of both
    data = bounded(3.21, 1.001)
    del data["grasps"][0]["strength"]
    assert replay_grasps(data).ok
    data["bound"]["factor"] = 0.9
    assert "no placement is said to hold the loads 0.9 times, and a grasp 1 times" in replay_grasps(data).fault
    data["answer"]["verdict"], data["grasps"] = "undecided", []
    assert replay_grasps(data).fault == "UNDECIDED with a bound of what grasps hold"


def test_every_configuration_is_discarded() -> None:
    """A ball of 1.1 m about a point 1 m behind the middle of the left side, and one of 0.5 m about the fingertip.

    Wherever on the square they touch, the middle of the fingertip is 1.1 m - |(0.01, 1.005, 0.01) m| = 94.9 mm deep in
    the first, so that they overlap by 594.9 mm.
    """

    def ball(radius: float, y: float, z: float) -> Data:
        pose = [[1, 0, 0, 0], [0, 1, 0, y], [0, 0, 1, z], [0, 0, 0, 1]]
        return {"kind": "sphere", "size": [radius], "pose": pose}

    claim = {"link": "left_finger", "solid": 0, "body": None, "other": 0, "point": [0, 0.005, 0.045]}
    proof = {"contacts": [0], "motions": [], "faces": [], "collisions": [claim], "tree": [-2] * 4}
    fingers = [{"link": "left_finger", "solids": [ball(0.5, 0.005, 0.045)]}]
    solids = {"links": fingers, "object": [ball(1.1, -0.975, 0.0)], "depth": 0.594, "pairs": []}
    done = replay_grasps(none(proof, solids=solids))
    assert done.ok, done.reason
    assert done.not_replayed == (SYNTHESIS_COURSE, NAMES_CLAIM, "that the solids are those of hand and object")
    figures = {"boxes": 4, "contacts": 0, "balance": 0, "slips": 0, "collision": 4}
    assert (done.parts[0].name, done.parts[0].figures) == ("no grasp", figures)
    assert "left_finger is more than 594 mm inside the object (100 %) of 4 boxes" in done.parts[0].claim
    assert "box 0 of the tree is not" in replay_grasps(none(proof, solids=solids | {"depth": 0.596})).fault
    with pytest.raises(BadFile, match=r"^question\.solids: is missing"):
        replay_grasps(none(proof))
    assert "solids" not in found()["question"]
    assert changed(found(), put("question/solids", solids)).ok  # what is found does not need them


# --- what is asked of other proofs -------------------------------------------------------------------------


def listening(monkeypatch: pytest.MonkeyPatch, *names: str) -> dict[str, Any]:
    """What the last call of each of these was asked; all of it is proved."""
    heard: dict[str, Any] = {}

    def put_in(name: str) -> None:
        def ask(*given: Any, **how: Any) -> Replay:
            heard[name] = given, how
            return Replay(name)

        monkeypatch.setattr(grasps, name, ask)

    for name in names:
        put_in(name)
    return heard


def by_motors(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Limits of 5 and 7 N; and what they were asked for."""
    asked: list[Any] = []

    def limits(*given: Any) -> ForceLimits:
        asked.append(given)
        return ForceLimits.of(np.array([5.0, 7.0]), 2)

    monkeypatch.setattr(grasps, "contact_force_limits", limits)
    return asked


@pytest.mark.parametrize("alone", [True, False])
def test_what_shows_that_nothing_balances_the_loads(alone: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The centre of mass counts where all loads are weights."""
    heard, limits = listening(monkeypatch, "replay_unbalanced"), by_motors(monkeypatch)
    data = none(SLIDES, force_limit=6.0, torsion=0.001, torque_limits={"grip": 0.3})
    changed(data, put("question/object/center_of_mass", [0.0, 0.0, 0.06]))
    if alone:
        changed(data, put("question/loads/down", ...), put("answer/loads/down", ...))
    assert replay_grasps(data).ok
    (regions, loads, friction, most, center, proof), how = heard["replay_unbalanced"]
    assert [region.kind for region in regions] == ["bezier", "bezier"]
    assert {name: load.tolist() for name, load in loads.items()} == {
        name: pytest.approx(DOWN) for name in (["weight"] if alone else ["down", "weight"])
    }
    assert (friction, most.most.tolist(), how) == (0.8, [5, 6], {"torsion": 0.001})
    assert (None if center is None else center.tolist()) == ([0, 0, 0.06] if alone else None)
    assert proof.names() == ("motions", "tree")
    ((task, motors, *terms),) = limits[-1:]
    assert (len(task.links), motors.limits.tolist(), terms) == (2, [0.3, 2.0], [0.8, 0.001])


def test_what_shows_that_few_contacts_hold_no_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = listening(monkeypatch, "replay_of_loads")
    assert replay_grasps(none({"fewest_contacts": 3}, torsion=0.001)).ok
    (count, reach, loads, friction, proof, torsion), how = heard["replay_of_loads"]
    assert (count, list(loads), friction, torsion, how) == (2, ["down", "weight"], 0.8, 0.001, {})
    # contacts are on squares of 20 mm at 25 mm from the middle
    assert reach == pytest.approx(np.linalg.norm([0.01, 0.025, 0.01]), rel=0.01)
    assert proof.names() == ("fewest_contacts",)


def test_what_shows_that_every_configuration_is_discarded(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = listening(monkeypatch, "replay_no_grasp")
    by_motors(monkeypatch)
    solids = {"links": [], "object": [], "depth": 0.25, "pairs": []}
    done = replay_grasps(none({"contacts": [0]}, solids=solids, torsion=0.001))
    assert (done.name, done.ok, done.not_replayed[-1]) == ("grasps", True, grasps.SOLIDS_CLAIM)
    (task, shapes, placements, names, motors, proof), how = heard["replay_no_grasp"]
    assert (len(task.links), shapes.of_object, names, how) == (2, (), ["down", "weight"], {})
    assert placements.count == 2
    assert placements.loads == pytest.approx(np.array([DOWN, DOWN]))
    assert (placements.friction, placements.torsion, placements.factor) == (0.8, 0.001, 1)
    assert placements.limits.most.tolist() == [5, 7]
    assert motors.limits.tolist() == [np.inf, 2.0]
    assert proof.names() == ("contacts",)


@pytest.mark.parametrize(
    ("factor", "strength", "refused"),
    [
        (3.0, 3.0, ""),
        (2.9, 3.0, "no placement is said to hold the loads 2.9 times, and a grasp 3 times"),
        (1.0, None, ""),
        (0.9, None, "no placement is said to hold the loads 0.9 times, and a grasp 1 times"),
    ],
)
def test_what_shows_that_no_placement_holds_more(
    factor: float, strength: float | None, refused: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard = listening(monkeypatch, "replay_unbalanced")
    by_motors(monkeypatch)
    figures = {} if strength is None else {"factor": strength}
    monkeypatch.setattr(grasps, "_grasp", lambda *of: Replay(of[-1], figures=figures))
    data = found() | {"bound": SLIDES | {"factor": factor}}
    data["question"] |= {"torsion": 0.001, "force_limit": 6.0}
    done = replay_grasps(data)
    assert (done.refused, [part.name for part in done.parts]) == (refused, ["grasp 1", "bound"])
    (regions, loads, friction, most, center, proof, times), how = heard["replay_unbalanced"]
    assert (len(regions), list(loads), friction, most.most.tolist()) == (2, ["down", "weight"], 0.8, [5, 6])
    assert (center, times, how) == (None, factor, {"torsion": 0.001})
    assert proof.names() == ("motions", "tree")


def test_a_bound_is_of_what_grasps_hold() -> None:
    assert replay_grasps(none(SLIDES) | {"bound": SLIDES | {"factor": 3.0}}).fault == (
        "NONE with a bound of what grasps hold"
    )


def test_faults_of_motors_and_grasps_have_their_place() -> None:
    with pytest.raises(BadFile, match=r"^motors\.actuators\[0\]\.tendon: is 1; true or false is needed$"):
        changed(found(), put("motors/actuators/0/tendon", 1))
    with pytest.raises(BadFile, match=r"^grasps\[0\]\.grasp\.contacts\[0\]\.friction: is -1; 0 or more is needed$"):
        changed(found(), put(G + "grasp/contacts/0/friction", -1))


# --- one grasp, part by part -------------------------------------------------------------------------------


def terms(**other: Any) -> Any:
    asked = {name: x for name, x in question().items() if name not in ("object", "loads")}
    return grasps._Terms(Fields(asked | other), ["grip", "spare"])


LOADS = {"a": np.array([0, 0, -0.5, 0, 0, 0]), "b": np.array([0, 0, 0, 0.25, 0, 0])}


def claimed(
    monkeypatch: pytest.MonkeyPatch, entry: Data, misplaced: str = "", **asked: Any
) -> tuple[Replay, list[Any]]:
    """What becomes of an entry whose configuration exists, and which loads are asked to be held, in which states."""
    held: list[Any] = []

    def holds(f: Fields, grasp: Any, its: Any, load: str, wrench: Any, off: Any) -> Replay:
        held.append((load, wrench.tolist(), f.take("r")))
        return Replay(load)

    equations: Any = SimpleNamespace(task=SimpleNamespace(misplaced=lambda joints, proved: misplaced))
    monkeypatch.setattr(grasps, "examined", lambda of, existence, name: (Replay(name), None, {}))
    monkeypatch.setattr(grasps, "_held", holds)
    motors = grasps._read_motors(Fields(found()["motors"]))
    return grasps._grasp(Fields(entry), equations, terms(**asked), motors, LOADS, "grasp 1"), held


def entry(**preload: float) -> Data:
    one: Data = found()["grasps"][0]
    one["grasp"]["preload"] = preload
    one["witnesses"] = {load: {"r": f"of {load}"} for load in LOADS}
    one["strength"] = {"factor": 3.0, "witnesses": {load: {"r": f"of more {load}"} for load in LOADS}}
    return one


def test_every_load_is_held_and_so_many_times(monkeypatch: pytest.MonkeyPatch) -> None:
    done, held = claimed(monkeypatch, entry(grip=2.0))
    assert (done.name, done.ok, done.claim, done.figures) == ("grasp 1", True, "", {"factor": 3.0})
    assert [part.name for part in done.parts] == ["configuration", "a", "b", "3 times a", "3 times b"]
    assert held == [
        ("a", [0, 0, -0.5, 0, 0, 0], "of a"),
        ("b", [0, 0, 0, 0.25, 0, 0], "of b"),
        ("3 times a", [0, 0, -1.5, 0, 0, 0], "of more a"),
        ("3 times b", [0, 0, 0, 0.75, 0, 0], "of more b"),
    ]
    more = entry(grip=2.0)
    more["strength"]["factor"] = 2.903703845  # 2.904 times the load may be none that is held
    done, _ = claimed(monkeypatch, more)
    assert [part.name for part in done.parts][3:] == ["2.903 times a", "2.903 times b"]
    alone = entry(grip=2.0)
    del alone["strength"]
    done, held = claimed(monkeypatch, alone)
    assert (done.figures, len(held)) == ({}, 2)


@pytest.mark.parametrize(
    ("preload", "asked", "refused"),
    [
        ({}, {"command_limit": 0.5}, ""),
        ({"grip": -2.0}, {}, ""),
        ({"grip": 2.0 * (1 + 0.9e-9)}, {}, ""),
        ({"grip": 2.0 * (1 + 1.1e-9)}, {}, "commands go up to 2; the limit is 2"),
        ({"grip": -2.5}, {}, "commands go up to 2.5; the limit is 2"),
        ({"spare": 1.0}, {}, "spare is commanded, which was not asked for"),
        ({"spare": 0.0}, {}, ""),
        ({"spare": 1.0}, {"actuators": []}, ""),  # nobody said which
        ({"grip": 1.0}, {"friction": 0.7}, "friction at its contacts is not 0.7"),
        ({"grip": 1.0}, {"friction": 0.0}, "friction at its contacts is not 0"),
        ({"grip": 1.0}, {"torsion": 0.001}, "torsion at its contacts is not 0.001 m"),
    ],
)
def test_terms_of_a_grasp(preload: Any, asked: Any, refused: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert claimed(monkeypatch, entry(**preload), **asked)[0].refused == refused


def test_the_first_fault_of_a_grasp_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = entry(spare=9.0)
    assert claimed(monkeypatch, wrong, "left_slide is elsewhere", friction=0.7)[0].refused == "left_slide is elsewhere"
    assert claimed(monkeypatch, wrong, friction=0.7, torsion=0.1)[0].refused == "friction at its contacts is not 0.7"
    assert claimed(monkeypatch, wrong)[0].refused == "spare is commanded, which was not asked for"
    del wrong["witnesses"]["b"], wrong["strength"]["witnesses"]["a"]
    done, held = claimed(monkeypatch, wrong | {"grasp": entry(grip=1.0)["grasp"]})
    assert done.refused == "has no witness of b"
    assert [load for load, *_ in held] == ["a", "3 times b"]
    one = entry(grip=1.0)
    one["grasp"]["contacts"][1] |= {"torsion": 0.001}
    assert claimed(monkeypatch, one, torsion=0.001)[0].refused == "torsion at its contacts is not 0.001 m"
    one["grasp"]["contacts"][0] |= {"torsion": 0.001}
    assert claimed(monkeypatch, one, torsion=0.001)[0].refused == ""


@pytest.mark.parametrize(
    ("exact", "tolerant", "claim", "reason"),
    [
        (True, False, "a is held", ""),
        (False, True, "a is held, to 1e-9 of the load", ""),
        (False, False, "a is held, to 1e-9 of the load", "why"),
    ],
)
def test_a_witness_of_a_load(
    exact: bool, tolerant: bool, claim: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def proves(p: Any, x: Any) -> Proved:
        asked.append((p, x))
        return Proved(exact, tolerant, "why", 0.25)

    monkeypatch.setattr(grasps, "prove", proves)
    grasp = read_grasp(found()["grasps"][0]["grasp"], "g")
    its = terms(torque_limits={"grip": 1.5, "spare": 9.0}, eta=0.125, force_limit=4.0)
    done = grasps._held(Fields(state(0.25)), grasp, its, "a", LOADS["a"], NEARBY)
    assert (done.name, done.claim, done.reason) == ("a", claim, reason)
    assert done.figures == {"residual": 0.25, "exact": exact}
    ((p, x),) = asked
    assert (p.wrench.tolist(), p.command.tolist(), p.mdp) == (LOADS["a"].tolist(), [2, 0], True)
    assert (p.limit.tolist(), p.force_limit, p.sin) == ([1.5, 9], 4, np.sin(0.125))
    assert x.c.tolist() == state(0.25)["c"]
    with pytest.raises(BadFile, match="more: is not a known field"):
        grasps._held(Fields(state(0.25) | {"more": 1}), grasp, its, "a", LOADS["a"], NEARBY)


def test_weights_act_at_the_centre_of_mass() -> None:
    """1/2 of 10 m/s^2 times 0.1 kg along (3, 0, -4) / 5, at 0.2 m along y."""

    def read(**loads: Any) -> Any:
        thing = {"name": "block", "mass": 0.1, "center_of_mass": [0, 0.2, 0]}
        return grasps._read_loads(Fields(loads, "loads"), Fields(thing, "object"))

    weight = {"weight": {"along": [3.0, 0, -4.0], "g": 10.0, "factor": 0.5}}
    loads, center = read(w=weight)
    assert loads["w"] == pytest.approx(np.array([0.3, 0, -0.4, 0.2 * -0.4, 0, -0.2 * 0.3]))
    assert center.tolist() == [0, 0.2, 0]
    loads, center = read(w=weight, d={"wrench": DOWN})
    assert (list(loads), loads["d"].tolist(), center) == (["w", "d"], DOWN, None)


def test_limits_that_are_not_there_are_none() -> None:
    bare = {
        name: x for name, x in question().items() if name not in ("object", "loads", "force_limit", "command_limit")
    }
    none = grasps._Terms(Fields(bare), ["grip"])
    assert (none.force_limit, none.command_limit, none.torsion, none.torque_limits) == (np.inf, np.inf, 0, {})
    with pytest.raises(BadFile, match=r"^q\.actuators: has unknown actuator 'grip'; known are spare$"):
        grasps._Terms(Fields(bare, "q"), ["spare"])
    with pytest.raises(BadFile, match=r"^bound\.factor: is -1; 0 or more is needed$"):
        replay_grasps(found() | {"bound": SLIDES | {"factor": -1}})


def test_contacts_in_one_place_are_no_grasp_of_a_task() -> None:
    """4e-15 m apart and 1 m from the origin: the size of the grasp would be that of the hand, or 1 m."""
    data = found()
    entry = data["grasps"][0]["grasp"]
    for contact, y in zip(entry["contacts"], (2e-15, -2e-15), strict=True):
        contact["position"] = [1.0, y, 0.0]
    assert not read_grasp(entry, "g").spans
    assert replay_grasps(data).reason == "grasp 1: its contacts are in one place"
    entry["contacts"][0]["position"][1] = 1e-13
    assert read_grasp(entry, "g").spans
    assert replay_grasps(data).reason == "grasp 1: the point of contact 0 is not that of the configuration"


NEARBY = np.zeros(2), np.zeros(2)  # contacts as in the configuration


def test_contacts_that_are_a_little_off_hold_no_load_of_their_own() -> None:
    """Normals may be 10^-9 off, but not if that times what presses is more than 10^-9 of the load, of 0.5 N."""
    grasp, load = read_grasp(found()["grasps"][0]["grasp"], "g"), np.array([0, 0, -0.5, 0, 0, 0])
    none, force, most = np.zeros(2), np.hypot(1.0, 0.25), 0.5e-9  # [N] at each of the two contacts, and allowed
    for by, shown in ((0.99, True), (1.01, False)):
        for off in ((np.array([by * most * grasp.size / force, 0]), none), (none, np.full(2, by * most / force / 4))):
            done = grasps._held(Fields(state(0.25)), grasp, terms(), "a", load, off)
            assert done.ok == shown
            assert shown or done.refused.startswith("its contacts are not those of the configuration by ")


@pytest.mark.parametrize(("turn", "shown"), [(0.99, True), (1.01, False)])
def test_what_motions_make_of_contacts_that_are_off_counts(
    turn: float, shown: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The object turns about the line through both contacts, which moves nothing; these are 1e-16 m off.

    Or a finger about a line through its contact, of point fingers and of soft ones with normals that are off.
    """
    grasp, load = read_grasp(found()["grasps"][0]["grasp"], "g"), np.array([0, 0, -0.5, 0, 0, 0])
    moving = state(0.25) | {"r": [0.0, 0, 0, 0, turn * 0.5e-7 / 1e-16, 0]}
    off = np.full(2, 1e-16), np.zeros(2)
    assert grasps._held(Fields(moving), grasp, terms(), "a", load, off).ok == shown
    monkeypatch.setattr(grasps, "prove", lambda p, x: Proved(True, False, "", 0.0))
    turning = {"revolute": np.ones(2, dtype=bool), "origins": grasp.positions[np.nonzero(grasp.moves.T)[1]]}
    hinged, moving = replace(grasp, **turning), state(0.25) | {"q": [turn * 0.5e-7 / 1e-16, 0.0]}
    assert grasps._held(Fields(moving), hinged, terms(), "a", load, off).ok == shown
    soft = replace(hinged, lever=np.full(2, 0.01))
    off = np.zeros(2), np.full(2, 1e-14)
    assert grasps._held(Fields(moving), soft, terms(), "a", load, off).ok == shown


def test_what_contacts_that_are_off_make_of_torques_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """About a joint 10 m away, and as torsion 10 times as large as the force, over the lever."""
    monkeypatch.setattr(grasps, "prove", lambda p, x: Proved(True, False, "", 0.0))
    near, load = read_grasp(found()["grasps"][0]["grasp"], "g"), np.array([0, 0, -0.5, 0, 0, 0])
    turning = np.ones(2, dtype=bool)
    far = replace(near, revolute=turning, axes=np.tile([1.0, 0, 0], (2, 1)), origins=np.tile([0.0, 0, 10.0], (2, 1)))
    soft, force = replace(near, lever=np.full(2, 0.01)), np.hypot(1.0, 0.25)
    twisted = state(0.25) | {"torsion": [0.1, 0.0]}
    twist = np.hypot(10, force) / force  # its lever, of 10 mm, is an arm, too
    for grasp, x, times in ((far, state(0.25), 10 / near.size), (soft, twisted, twist * (1 + 0.01 / near.size))):
        for by, shown in ((0.9, True), (1.1, False)):  # the first contact alone
            off = np.zeros(2), np.array([by * 0.5e-9 / (2 * force * times), 0.0])
            assert grasps._held(Fields(x), grasp, terms(), "a", load, off).ok == shown
