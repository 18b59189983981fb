"""Answers of every query as they are saved, and planted faults in them."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from benchmarks.grasps import random_case
from handfast.proofs.certificate import Certificate, proof_to_dict, read_certificate
from handfast.proofs.kinds import Row
from handfast.proofs.question import read_question
from handfast.stability.answers.answer import Answer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum, torques
from tests.support.problems import bell, nest, pinch, solved, table


def w(*force: float) -> np.ndarray:
    return np.array([*force, 0, 0, 0], dtype=float)


HOLED = random_case(3, 510)  # resists 4.7 N, but slips at 2 to 3 N: the paper's warning in section VII-B
LIMITS = GraspLimits(torque_limits={"right": 0.3}, force_limit=50.0)
ANSWERS = {
    "check holds": lambda: check(bell(), w(0, 2.2, 0)),
    "check slips": lambda: check(bell(), w(0, 2.3, 0)),
    "check slips narrowly": lambda: check(bell(), w(0, 2.25, 0)),  # with eta 0.05 it holds
    "check with eta": lambda: check(bell(), w(0, 2.5, 0), limits=GraspLimits(eta=0.05)),
    "check with a limit": lambda: check(solved(5, 4).grasp, solved(5, 4).wrench, limits=GraspLimits(force_limit=2.0)),
    "check with limits": lambda: check(pinch(), w(0.5, 0.1, 0), limits=LIMITS),
    "check without dissipation": lambda: check(bell().with_preload(None), w(0, 1, 0), mdp=False),
    "max": lambda: maximum(bell(), w(0, 1, 0)),
    "max of another direction": lambda: maximum(bell(), w(0, 0.01, 0)),
    "max with base": lambda: maximum(table(), w(1, 0, 0), base=w(0, 0, -10)),
    "max with limits": lambda: maximum(pinch(), w(1, 0, 0), limits=LIMITS),
    "max unbounded": lambda: maximum(pinch(), w(1, 0, 0)),
    "max unbounded without preload": lambda: maximum(nest(), w(0, 0, -1)),
    "max slips": lambda: maximum(pinch().with_preload({"right": -0.1, "left": -0.1}), w(0, 1, 0)),
    "max slips without preload": lambda: maximum(nest(), w(0, 0, 1)),
    "max slips with base": lambda: maximum(table(), w(0, 0, 1), base=w(0, 0, 1)),
    "torques": lambda: torques(bell(), w(0, 1, 0)),
    "sum of torques": lambda: torques(
        bell(), w(0, 1, 0), objective="sum", limits=GraspLimits(torque_limits={"prox_1": 0.2})
    ),
    "torques of one": lambda: torques(bell(), w(0, 1, 0), actuators=["prox_1"]),
    "no torques needed": lambda: torques(pinch(), w(1, 0, 0)),
    "torques do not exist": lambda: torques(pinch().with_friction(0.0), w(0, 1, 0)),
    "torques without actuators": lambda: torques(nest(), w(0, 0, 1)),
    "undecided": lambda: check(bell(), w(0, 2.3, 0), settings=Settings(nodes=1)),
    "max with a hole": lambda: maximum(HOLED.grasp, HOLED.direction, interval=True),
    "max cut short": lambda: maximum(bell(), w(0, 1, 0), settings=Settings(nodes=100, gap=1e-9)),
}


@cache
def answer(name: str) -> Answer:
    return ANSWERS[name]()


@cache
def text(name: str) -> str:
    return json.dumps(answer(name).to_file())


def deep(data: Any, *path: Any) -> Any:
    for key in path:
        data = data[key]
    return data


def put(*path: Any, to: Any) -> Any:
    """A change of one entry: to a value, or to a function of what was there."""

    def change(data: dict) -> None:
        where = deep(data, *path[:-1])
        where[path[-1]] = to(where[path[-1]]) if callable(to) else to

    return change


def times(x: float) -> Any:
    return lambda v: x * v


def certificate_of(data: dict, *path: Any) -> Certificate:
    """A certificate of a result file, unpacked."""
    return read_certificate(deep(data, *path), "certificate", read_question(data["question"], "question"))


def proof(change: Callable[[Certificate], dict[str, Any]], *path: Any) -> Any:
    """A change of some arrays of a certificate, which is packed again."""
    path = path or ("certificate",)

    def altered(data: dict) -> None:
        c = certificate_of(data, *path)
        put(*path, to=proof_to_dict(replace(c, **change(c))))(data)

    return altered


def set_at(x: np.ndarray, i: int, value: float) -> np.ndarray:
    out = x.copy()
    out[i] = value
    return out


def negate_largest(c: Certificate) -> dict[str, Any]:
    i = int(c.multiplier.argmax())
    return {"multiplier": set_at(c.multiplier, i, -c.multiplier[i])}


def drop_leaf(c: Certificate) -> dict[str, Any]:
    return {"start": np.delete(c.start, -2)}


def move_sector(c: Certificate) -> dict[str, Any]:
    i = int(np.flatnonzero(c.left < c.right)[0])
    return {"right": set_at(c.right, i, c.right[i] - 1)}


def trivial(c: Certificate) -> dict[str, Any]:
    """A tree of its root alone, with one row that holds in every case."""
    root, row = np.zeros(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
    tree = {"parent": root - 1, "part": root, "state": root, "left": root, "right": root}
    return tree | {"start": [0, 1], "kind": row + Row.CN_UP, "index": row, "a": row, "b": row, "multiplier": row + 1.0}


def without_motions(data: dict) -> None:
    """A witness whose every number is 0, at a load that is."""
    for name in ("wrench", "r", "q", "c", "f", "coupling"):
        data["witness"][name] = [0.0] * len(data["witness"][name])
    data["answer"]["lower"] = 0.0


def at_hardly_any_load(data: dict) -> None:
    """The same, at a load whose square is too small for a number."""
    without_motions(data)
    data["answer"]["lower"] = 1e-200
    data["witness"]["wrench"] = (1e-200 * np.array(data["question"]["wrench"])).tolist()


def unbounded(data: dict) -> None:
    """A bounded maximum is called unbounded, its certificate is left out."""
    data["answer"] |= {"unbounded": True, "upper": None, "gap": 0.0, "certified": False}
    data["certificate"] = None


def both(*changes: Any) -> Any:
    def change(data: dict) -> None:
        for each in changes:
            each(data)

    return change


NO_STATE = "witness: Newton's test fails at a residual of"
FAULTS = [
    ("check holds", put("witness", "c", 0, to=times(1 + 1e-6)), NO_STATE),
    ("check holds", put("witness", "r", 1, to=times(1.01)), NO_STATE),
    ("check holds", put("witness", "wrench", 1, to=2.1), "witness: it is a state under another disturbance"),
    ("check holds", put("witness", "command", "prox_1", to=0.11), "witness: it is a state with other commands"),
    ("check holds", put("question", "wrench", 1, to=2.3), "witness: it is a state under another disturbance"),
    ("check holds", put("question", "grasp", "contacts", 1, "friction", to=0.9), NO_STATE),
    ("check holds", put("question", "grasp", "preload", "prox_1", to=0.05), "witness: it is a state with other comm"),
    ("check holds", put("question", "torque_limits", to={"prox_1": 0.01}), "witness: "),
    ("check holds", put("question", "force_limit", to=0.1), "witness: "),
    ("check holds", put("question", "eta", to=0.05), NO_STATE),
    (
        "check with a limit",
        put("question", "force_limit", to=1.0),
        "witness: contact 0 is not proved to keep the force",
    ),
    (
        "check with a limit",
        put("question", "torque_limits", to={"j2": 0.02}),
        "witness: actuator 'j2' is not proved to k",
    ),
    ("check holds", put("answer", "verdict", to="slips"), "answer: SLIPS with a witness"),
    ("check holds", put("answer", "verdict", to="undecided"), "answer: UNDECIDED with a witness"),
    ("check holds", put("answer", "certified", to=True), "answer: certified is not what the rest of the file"),
    ("check holds", put("answer", "contacts", 0, "force", to=[0, 0, 0]), "answer: contacts is not what the rest of"),
    ("check holds", put("witness", to=None), "answer: HOLDS without a witness"),
    ("check slips", put("answer", "verdict", to="holds"), "answer: HOLDS without a witness"),
    ("check slips", put("certificate", to=None), "answer: the disturbance is not resisted: no certificate"),
    ("check slips", put("question", "wrench", 1, to=2.2), "certificate: leaf .* is not proved"),
    ("check slips", proof(negate_largest), r"certificate: leaf \d+ .*the multiplier is negative"),
    ("check slips", proof(drop_leaf), r"certificate: has rows for \d+ leaves; the tree has \d+"),
    ("check slips", proof(move_sector), r"certificate: node \d+, split of contact"),
    (
        "check slips",
        proof(trivial),
        "certificate: leaf 0 .*is not proved",
    ),
    ("check slips", put("certificate", "cap_r", to=[1e-9] * 6), "certificate.cap_r: is not a known field"),
    ("check slips", put("answer", "certified", to=False), "answer: certified is not what the rest of the file shows"),
    ("check slips narrowly", put("question", "eta", to=0.05), "certificate: leaf"),
    ("max", put("answer", "lower", to=times(1.0001)), "witness: it is a state under another disturbance"),
    ("max", put("answer", "lower", to=times(0.9)), "answer: gap is not what"),
    ("max", put("answer", "upper", to=times(0.9999)), "certificate: it covers .* the answer needs"),
    ("max", put("answer", "upper", to=times(1.5)), "answer: gap is not what"),
    ("max", put("answer", "upper", to=None), "answer: has a certificate, but claims nothing"),
    ("max", put("answer", "gap", to=1e-6), "answer: gap is not what the rest of the file shows"),
    ("max", put("answer", "unbounded", to=True), "answer: unbounded, with a bound"),
    (
        "max",
        put("certificate", "scalar", 1, to=times(1.1)),
        "certificate: leaf .* (is not proved|does not hold in this case)",
    ),
    ("max", put("certificate", to=None), r"answer: nothing above 2\.22\d* times the direction is res.*: no cert"),
    ("max", proof(negate_largest), "certificate: leaf"),
    ("max", proof(drop_leaf), "certificate: has rows for"),
    ("max", proof(move_sector), "certificate: node"),
    ("max", put("question", "goal", to="largest"), "certificate: it covers"),
    ("max with base", put("answer", "upper", to=times(0.9995)), "certificate: it covers"),
    ("max with base", put("question", "wrench", 2, to=-9.0), "witness: it is a state under another"),
    ("max with base", put("certificate", "scalar", 1, to=times(0.05)), "certificate: it covers"),
    ("max unbounded", put("answer", "lower", to=times(0.05)), "answer: unbounded, but shown up to"),
    ("max slips", put("answer", "upper", to=0.1), "answer: SLIPS with bounds above 0"),
    ("max slips", put("certificate", "scalar", 1, to=1e3), "certificate: it covers 1e-07 to 1000; the answer needs"),
    ("max slips", put("certificate", "scalar", 0, to=1.0), "certificate: it covers 1 to inf; the answer needs"),
    ("max slips without preload", put("answer", "verdict", to="holds"), "answer: HOLDS without a witness"),
    ("max slips without preload", put("question", "force_limit", to=1.0), "answer: is of a maximum, its question"),
    ("torques", put("answer", "upper", to=times(0.9995)), "witness: its commands cost 0.04"),
    ("torques", put("answer", "lower", to=times(1.0001)), "certificate: it covers .* the answer needs"),
    ("torques", put("answer", "preload", "prox_1", to=0.0449), "answer: preload is not what"),
    ("torques", put("answer", "preload", to={"prox_1": 0.0}), "answer: preload is not what"),
    ("torques", put("witness", "command", to=lambda c: {n: -v for n, v in c.items()}), "witness: "),
    ("torques", put("question", "goal", to="check"), "question|answer: is of torques|driven"),
    (
        "torques",
        put("question", "grasp", "preload", to=lambda c: {n: -v for n, v in c.items()}),
        "witness: a command has the wrong sense",
    ),
    (
        "torques",
        put("question", "objective", to="sum"),
        "certificate: node .*, split of actuator .: needs LOCKED and MOVES",
    ),
    ("sum of torques", put("question", "objective", to="max"), "witness: its commands cost|certificate: leaf"),
    ("torques of one", put("witness", "command", "prox_2", to=0.01), "witness: an actuator is commanded that was"),
    ("torques do not exist", put("answer", "lower", to=0.1), "answer: SLIPS with bounds"),
    (
        "torques do not exist",
        put("certificate", "scalar", 1, to=1e6),
        "certificate: it covers 0 to 1000000; the",
    ),
    ("undecided", put("answer", "verdict", to="slips"), "answer: the disturbance is not resisted: no certificate"),
    # bounds that are none
    ("max", put("answer", "lower", to=-1.0), "answer: a largest magnitude of -1"),
    ("max", put("answer", "lower", to=2.3), "answer: its lower bound 2.3 is above its upper bound 2.2|witness: "),
    ("max with base", put("answer", "lower", to=4.5), "witness: it is a state under another|answer: its lower"),
    ("torques", put("answer", "lower", to=-1.0), "answer: a lower bound of -1"),
    ("torques", put("answer", "lower", to=0.05), r"answer: its lower bound 0\.05 is above its upper bound 0\.045"),
    ("no torques needed", put("answer", "lower", to=-1e-6), "answer: a lower bound of -1e-06"),
    # unbounded, with nothing that is held
    ("max unbounded without preload", without_motions, "answer: unbounded, but shown up to 0 only"),
    ("max unbounded without preload", at_hardly_any_load, "answer: unbounded, but shown up to 1e-200 only"),
    ("max unbounded", both(without_motions, put("question", "grasp", "preload", to={})), "witness|answer"),
    ("max unbounded", without_motions, "answer: unbounded, but shown up to 0 only|witness: "),
    ("max", both(unbounded, without_motions), "answer: unbounded, but shown up to 0 only"),
    ("max slips without preload", put("answer", "unbounded", to=True), "answer: unbounded, with a bound"),
    # what else an answer says
    (
        "max",
        put("answer", "holds_from_zero_to", to=2.0),
        "interval: its resolution is None; a number above 0, of 1 at most, is needed",
    ),
    (
        "max",
        put("answer", "holes", to=[[0.5, 0.6]]),
        "answer: has holes, but does not say up to where everything is resisted",
    ),
    ("max unbounded", put("answer", "gap", to=None), "answer: gap is not what"),
    ("max slips", put("answer", "gap", to=1e-3), "answer: gap is not what"),
    ("check holds", put("answer", "residual", to=1e-3), "answer: residual is not what"),
    ("check holds", put("answer", "residual", to=None), "answer: residual is not what"),
    ("check holds", put("answer", "contacts", 1, "state", to="open"), "answer: contacts is not what"),
    ("check holds", put("answer", "contacts", 1, "link", to="thumb"), "answer: contacts is not what"),
    ("check holds", put("answer", "contacts", 1, "position", 2, to=1e-6), "answer: contacts is not what"),
    ("check holds", put("answer", "contacts", 1, "normal_force", to=str), "answer: contacts is not what"),
    ("check holds", put("answer", "contacts", to=lambda c: c[:-1]), "answer: contacts is not what"),
    ("check holds", put("answer", "contacts", 0, to=None), "answer: contacts is not what"),
    ("check holds", put("answer", "joint_torques", "prox_1", to=times(1.001)), "answer: joint_torques is not what"),
    ("check holds", put("answer", "joint_torques", to=lambda t: t | {"thumb": 0.0}), "answer: joint_torques is not"),
    ("check holds", put("answer", "actuator_forces", "prox_1", to=0.2), "answer: actuator_forces is not what"),
    ("check holds", put("answer", "object_motion", 1, to=times(1.001)), "answer: object_motion is not what"),
    ("check holds", put("answer", "joint_motion", "prox_2", to=times(1.001)), "answer: joint_motion is not what"),
    ("check slips", put("answer", "contacts", to=[]), "answer: contacts is not what"),
    ("check slips", put("answer", "object_motion", to=[0.0] * 6), "answer: object_motion is not what"),
    ("check slips", put("answer", "joint_torques", to={"prox_1": 0.1}), "answer: joint_torques is not what"),
    ("check slips", put("answer", "residual", to=0.0), "answer: residual is not what"),
    ("check holds", put("answer", "motion", to=times(1.001)), "answer: motion is not what"),
    ("check holds", put("answer", "motion", to=0.0), "answer: motion is not what"),
    ("check holds", put("answer", "motion", to=None), "answer: motion is not what"),
    ("check holds", lambda data: data["answer"].pop("motion"), "answer: motion is missing"),
    ("max", put("answer", "motion", to=times(0.999)), "answer: motion is not what"),
    ("torques", put("answer", "motion", to=times(0.999)), "answer: motion is not what"),
    ("check slips", put("answer", "motion", to=1.0), "answer: motion is not what"),
    ("undecided", put("answer", "residual", to=0.0), "answer: residual is not what"),
    ("check slips", put("answer", "colour", to="red"), "answer: colour is nothing that it can say; leave it out"),
    ("check slips", put("answer", "motion_cap", to=1e4), "answer: motion_cap is not what the rest of the file shows"),
    ("check slips", lambda data: data["answer"].pop("residual"), "answer: residual is missing"),
    ("check slips", lambda data: data["answer"].pop("verified"), "answer.verified: is missing"),
    ("check slips", put("answer", "verified", to="yes"), "answer.*verified"),
    ("check slips", put("answer", "verified", to=1), "answer.*verified"),
    ("torques do not exist", put("answer", "preload", to={"left": 0.1}), "answer: preload is not what"),
    ("torques", put("answer", "colour", to="red"), "answer: colour is nothing that it can say"),
]


def far_contact(data: dict) -> None:
    """One contact more, 10^9 m away, that the motion opens: it carries nothing."""
    g, r = data["question"]["grasp"], np.array(data["witness"]["r"])
    place = np.array([1e9, 0.0, 0.0])
    away = r[:3] + np.cross(r[3:], place)
    normal = (away / np.linalg.norm(away)).tolist()
    g["contacts"].append({"position": place.tolist(), "normal": normal, "friction": 1.0, "link": "nowhere"})
    data["witness"]["c"] += [0.0, 0.0, 0.0]


def hardly_loaded(data: dict) -> None:
    """The same, and it carries next to nothing."""
    far_contact(data)
    data["witness"]["c"][-3] = 1e-15


def idle_actuators(data: dict, force: float = 1e10) -> None:
    """Two joints more that move nothing, commanded with 10^10 N m."""
    g = data["question"]["grasp"]
    for name in ("idle", "idle too"):
        g["joints"].append(g["joints"][0] | {"name": name, "moves": []})
        g["mechanism"]["actuators"].append({"name": name, "joints": {name: 1.0}, "tendon": False})
        g["preload"][name] = data["witness"]["command"][name] = 1e10
    data["witness"]["q"] += [0.0, 0.0]
    data["witness"]["f"] += [force, force]


def idle_and_slack(data: dict) -> None:
    """They do not pull as they are told."""
    idle_actuators(data, 0.0)


def overload(data: dict) -> None:
    """The answer is given for a load that is 1 N more, and 0.1 N m."""
    for wrench in (data["question"]["wrench"], data["witness"]["wrench"]):
        wrench[1] += 1.0
        wrench[5] += 0.1
