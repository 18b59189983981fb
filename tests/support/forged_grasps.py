"""Grasps of the scalpel with every kind of limit, and what a forger may do to their file."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

from handfast import InputError, grasp_for, load_body, load_task
from handfast.planning.question import PlanLimits
from handfast.planning.results import grasps_file
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.grasps_file import asked_digest
from handfast.planning.results.verify import verify
from handfast.proofs.replay import Replay
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import digest

Data = dict[str, Any]
Change = Callable[[Data], None]
# what is said of a witness that is no state: no exact one is near, or that one breaks an inequality of its modes
NO_STATE = r"(Newton's test fails|of the state that is proved is|is not proved to|is between two modes)"
LIMITS: dict[str, Any] = {"force_limit": 50.0, "command_limit": 2.0, "torque_limits": {"index_proximal": 3.0}}


@cache
def scalpel_grasps() -> Grasps:
    """For the weight and a wrench."""
    body = load_body("scalpel")
    loads = Loads.gravity(body, ["-z"]).scaled(1.25) + Loads.wrench([0.1, 0, -0.2, 0, 0.001, 0], "cut")
    limits = PlanLimits(eta=0.02, **LIMITS)
    return grasp_for(load_task("scalpel-incision"), body, loads, count=2, timeout=120, jobs=1, limits=limits)


@cache
def _file() -> str:
    return json.dumps(grasps_file.to_dict(scalpel_grasps().saved))


def scalpel_file() -> Data:
    """Their file, to be changed at will."""
    data: Data = json.loads(_file())
    return data


def replayed(data: Data) -> Replay:
    return verify(grasps_file.from_dict(data))


def renew(data: Data, *, question: bool = True) -> Data:
    """What a forger does: the checksum of the changed file, and of the changed question."""
    if question and all(key in data for key in ("answer", "task", "motors", "question")):
        data["answer"]["question"] = asked_digest(data)
    data["checksum"] = digest({k: v for k, v in data.items() if k != "checksum"})
    return data


def refusals(data: Data) -> list[str]:
    """Why a file is not proved, a line for each claim that is refused; [] if it is proved."""
    try:
        done = replayed(data)
    except InputError as fault:
        return [str(fault)]
    lines = list(_refused(done, ""))
    assert done.ok == (not lines)
    return lines


def _refused(done: Replay, at: str) -> Iterator[str]:
    if done.refused:
        yield at + done.refused
    for part in done.parts:
        yield from _refused(part, f"{at}{part.name}: ")


# --- changed in one place ---------------------------------------------------------------------------


def at(*path: Any, to: Any) -> Change:
    """Another value at a path; a function is given the old one."""

    def change(data: Data) -> None:
        *inner, last = path
        for key in inner:
            data = data[key]
        data[last] = to(data[last]) if callable(to) else to

    return change


def grasp(*path: Any, to: Any) -> Change:
    return at("grasps", 0, "grasp", *path, to=to)


def said(*path: Any, to: Any) -> Change:
    return at("answer", "grasps", 0, *path, to=to)


def asked(*path: Any, to: Any) -> Change:
    return at("question", *path, to=to)


def longer(x: Any) -> Any:
    return 1.01 * x


def negative(v: list[float]) -> list[float]:
    return [-x for x in v]


def tripled(of: dict[str, float]) -> dict[str, float]:
    return {name: 3 * x for name, x in of.items()}


def _swapped_witnesses(data: Data) -> None:
    w = data["grasps"][0]["witnesses"]
    w["cut"], w["gravity -z"] = w["gravity -z"], w["cut"]


def _without_witness(data: Data) -> None:
    del data["grasps"][0]["witnesses"]["cut"]


def _swapped_grasps(data: Data) -> None:
    data["grasps"].reverse()


def _nothing(data: Data) -> None:
    data["grasps"] = data["answer"]["grasps"] = []


def _one_word(data: Data) -> None:
    data["answer"]["grasps"].pop()


def _unused_finger(data: Data) -> None:
    data["task"]["hand"]["joints"][1]["limits"] = [0.0, 1.0]
    data["grasps"][0]["joints"]["ring_proximal"] -= 0.1


def _said_more(data: Data) -> None:
    data["answer"]["grasps"][0]["best"] = True


def _weight_and_wrench(data: Data) -> None:
    data["question"]["loads"]["gravity -z"]["wrench"] = [0.0] * 6


def _other_actuator(data: Data) -> None:
    name = next(iter(data["grasps"][0]["grasp"]["preload"]))
    data["question"]["actuators"].remove(name)


FORGED: dict[str, tuple[Change, str]] = {
    "friction": (grasp("contacts", 1, "friction", to=0.9), r"grasp 1: grasp\.contacts\[1\]\.friction is 0\.9; .* 0\.5"),
    "position": (grasp("contacts", 0, "position", 0, to=longer), r"grasp\.contacts\[0\]\.position\[0\] is"),
    "normal": (grasp("contacts", 2, "normal", to=negative), r"grasp\.contacts\[2\]\.normal\[\d\] is"),
    "link": (grasp("contacts", 1, "link", to="palm"), r"grasp\.contacts\[1\]\.link is"),
    "depth": (grasp("contacts", 0, "depth", to=1e-3), r"grasp\.contacts\[0\]\.depth is 0\.001; .* 0\.0"),
    "axis": (grasp("joints", 0, "axis", to=negative), r"grasp\.joints\[0\]\.axis\[\d\] is"),
    "origin": (grasp("joints", 0, "origin", 1, to=lambda y: y + 1e-3), r"grasp\.joints\[0\]\.origin\[1\] is"),
    "moves": (grasp("joints", 0, "moves", to=[]), r"grasp\.joints\[0\]\.moves has 0 entries"),
    "type": (grasp("joints", 0, "type", to="prismatic"), r"grasp\.joints\[0\]\.type is \"prismatic\""),
    "gearing": (
        grasp("mechanism", "actuators", 0, "joints", to=lambda r: {k: 3 * v for k, v in r.items()}),
        "grasp.mec",
    ),
    "tendon": (grasp("mechanism", "actuators", 0, "tendon", to=True), r"actuators\[0\]\.tendon is true; .* false"),
    "uncoupled": (
        grasp("mechanism", "couplings", to=[]),
        r"witnesses\.gravity -z\.coupling: has 3 numbers; 0 are needed",
    ),
    "preload": (grasp("preload", to={}), r"grasp 1: answer\.preload\.\w+ is 0\.\d+; of .* 0\.0"),
    "one command": (grasp("preload", to=tripled), r"answer\.preload\.\w+ is"),
    "name": (grasp("name", to="better"), r"grasp\.name is \"better\""),
    "joint": (at("grasps", 0, "joints", "index_proximal", to=lambda q: q + 1e-4), "index_proximal is not at the value"),
    "unused finger": (_unused_finger, r"answer\.configuration\.joints\.ring_proximal is 0\.698132; .* 0\.598132"),
    "beyond": (at("grasps", 0, "joints", "ring_middle", to=9.0), "ring_middle is beyond its limits"),
    "existence": (at("grasps", 0, "existence", "position", 2, to=longer), "grasp 1: "),
    "swapped witnesses": (_swapped_witnesses, rf"grasp 1: gravity -z: .*{NO_STATE}"),
    "no witness": (_without_witness, "grasp 1: has no witness of cut"),
    "short witness": (
        at("grasps", 0, "witnesses", "cut", "q", to=[0.0]),
        r"grasps\[0\]\.witnesses\.cut\.q: has 1 numbers; \d+ are needed",
    ),
    "force": (at("grasps", 0, "witnesses", "cut", "c", 0, to=longer), rf"grasp 1: cut: .*{NO_STATE}"),
    "swapped grasps": (_swapped_grasps, r"grasp 1: answer\.preload"),
    "no grasps": (_nothing, "FOUND without a grasp"),
    "one answer": (_one_word, r"answer\.grasps: has 1 entries for 2 grasps"),
    "none": (at("answer", "verdict", to="none"), "NONE with a grasp"),
    "load": (at("answer", "loads", "gravity -z", 2, to=longer), r"geometry: answer\.loads\.gravity -z\[2\] is"),
    "said preload": (said("preload", "index_proximal", to=0.0), r"answer\.preload\.index_proximal is 0"),
    "said largest": (said("upper", to=longer), r"answer\.upper is"),
    "said friction": (said("spare_friction", to=0.9), r"answer\.spare_friction is 0\.9"),
    "said curvature": (said("curvatures", 0, to=longer), r"answer\.curvatures\[0\] is"),
    "said dexterity": (said("dexterity", "manipulability", to=longer), r"answer\.dexterity\.manipulability is"),
    "said limits": (said("dexterity", "from_limits", to={}), r"answer\.dexterity\.from_limits\.\w+ is missing"),
    "said hand": (said("configuration", "hand", to="other"), r"answer\.configuration\.hand is \"other\""),
    "said pose": (said("configuration", "object_pose", "position", 0, to=longer), r"object_pose\.position\[0\] is"),
    "said more": (_said_more, r"answer\.best follows from nothing"),
    # of the question, with its own checksum renewed too
    "other friction": (asked("friction", to=0.6), r"contacts\[0\]\.friction is 0\.5; .* 0\.6"),
    "eta": (asked("eta", to=0.4), rf"grasp 1: gravity -z: .*{NO_STATE}"),
    "torque limit": (
        asked("torque_limits", "index_proximal", to=1e-6),
        "actuator 'index_proximal' is not proved to keep its limit",
    ),
    "force limit": (asked("force_limit", to=1e-4), r"contact \d is not proved to keep the force limit"),
    "command limit": (asked("command_limit", to=1e-5), r"is commanded .*; the limit is 1e-05"),
    "actuator": (_other_actuator, "is commanded, which was not asked for"),
    "mass": (asked("object", "mass", to=0.03), rf"grasp 1: gravity -z: .*{NO_STATE}"),
    "centre": (asked("object", "center_of_mass", 0, to=0.0), rf"grasp 1: gravity -z: .*{NO_STATE}"),
    "g": (asked("loads", "gravity -z", "weight", "g", to=1.62), rf"gravity -z: .*{NO_STATE}"),
    "along": (asked("loads", "gravity -z", "weight", "along", to=[0, 0.1, -1]), rf"gravity -z: .*{NO_STATE}"),
    "safety": (asked("loads", "gravity -z", "weight", "factor", to=2.0), rf"gravity -z: .*{NO_STATE}"),
    "wrench": (asked("loads", "cut", "wrench", 0, to=longer), rf"cut: .*{NO_STATE}"),
    "weight and wrench": (_weight_and_wrench, "gravity -z: needs either a wrench or a weight"),
    "no mass": (asked("object", "mass", to=None), "question.object.mass: is null, but a load is its weight"),
    "motor": (at("motors", "actuators", 3, "joints", to=tripled), r"grasp\.mechanism"),
    "closing": (at("motors", "closing", "index_proximal", to=-1), r"grasp\.(joints|mechanism)"),
    "coupled": (at("task", "hand", "couplings", to=[]), "grasp|existence|free joints"),
}
