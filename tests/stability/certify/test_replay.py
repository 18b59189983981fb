"""Result files and `verify`: what is saved replays without engine or solver, and no fault in it passes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handfast
from handfast.cli import main
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.stability import model, result_file
from handfast.stability.answers import Answer, CheckAnswer
from handfast.stability.certify.certificate import Row
from handfast.stability.certify.certificate_file import question_to_dict, save_certificate
from handfast.stability.certify.certificate_file import to_dict as certificate_to_dict
from handfast.stability.certify.replay import verify
from handfast.stability.goal import STRONGEST
from handfast.stability.queries import check, maximum, torques
from handfast.stability.settings import Settings
from handfast.stability.witness import KEYS
from tests.support.certificates import CASES, prove
from tests.support.problems import bell, nest, pinch, table


def w(*force: float) -> np.ndarray:
    return np.array([*force, 0, 0, 0], dtype=float)


LIMITS: dict[str, Any] = {"torque_limits": {"right": 0.3}, "force_limit": 50.0}
ANSWERS = {
    "check holds": lambda: check(bell(), w(0, 2.2, 0)),
    "check slips": lambda: check(bell(), w(0, 2.3, 0)),
    "check with eta": lambda: check(bell(), w(0, 2.5, 0), eta=0.05),
    "check with limits": lambda: check(pinch(), w(0.5, 0.1, 0), **LIMITS),
    "check without dissipation": lambda: check(bell().with_preload(None), w(0, 1, 0), mdp=False),
    "max": lambda: maximum(bell(), w(0, 1, 0)),
    "max of another direction": lambda: maximum(bell(), w(0, 0.01, 0)),
    "max with base": lambda: maximum(table(), w(1, 0, 0), base=w(0, 0, -10)),
    "max with limits": lambda: maximum(pinch(), w(1, 0, 0), **LIMITS),
    "max unbounded": lambda: maximum(pinch(), w(1, 0, 0)),
    "max unbounded without preload": lambda: maximum(nest(), w(0, 0, -1)),
    "max slips": lambda: maximum(pinch().with_preload({"right": -0.1, "left": -0.1}), w(0, 1, 0)),
    "max slips without preload": lambda: maximum(nest(), w(0, 0, 1)),
    "max slips with base": lambda: maximum(table(), w(0, 0, 1), base=w(0, 0, 1)),
    "torques": lambda: torques(bell(), w(0, 1, 0)),
    "sum of torques": lambda: torques(bell(), w(0, 1, 0), objective="sum", torque_limits={"prox_1": 0.2}),
    "torques of one": lambda: torques(bell(), w(0, 1, 0), actuators=["prox_1"]),
    "no torques needed": lambda: torques(pinch(), w(1, 0, 0)),
    "torques do not exist": lambda: torques(pinch().with_friction(0.0), w(0, 1, 0)),
    "torques without actuators": lambda: torques(nest(), w(0, 0, 1)),
    "undecided": lambda: check(bell(), w(0, 2.3, 0), settings=Settings(node_limit=1)),
    "max cut short": lambda: maximum(bell(), w(0, 1, 0), settings=Settings(node_limit=100, gap=1e-9)),
}


@cache
def answer(name: str) -> Answer:
    return ANSWERS[name]()


@cache
def text(name: str) -> str:
    return json.dumps(result_file.to_dict(result_file.Result.of(answer(name))))


@pytest.mark.parametrize("name", ANSWERS)
def test_what_is_saved_is_proved(name: str, tmp_path: Path) -> None:
    a, path = answer(name), tmp_path / "r.json"
    a.save(path)
    done = verify(path)
    assert done.ok, done.reason
    assert (done.witness is not None) == (a.verdict is Verdict.HOLDS)
    assert done.witness is None or done.witness.residual <= 1e-9
    assert (done.certificate is not None) == (a.certificate is not None)
    assert a.verdict is not Verdict.SLIPS or done.certificate is not None
    assert done.to_json() | {"seconds": 0} == verify(a).to_json() | {"seconds": 0}  # every bit comes back
    assert json.loads(path.read_text())["answer"] == a.to_json()
    with pytest.raises(InputError, match=r"r\.json: exists already"):
        a.save(path)


def test_the_sample_has_every_verdict() -> None:
    assert {(a.to_json()["query"], a.verdict) for a in map(answer, ANSWERS)} >= {
        (query, verdict) for query in ("check", "max", "torques") for verdict in (Verdict.HOLDS, Verdict.SLIPS)
    }
    assert answer("undecided").verdict is Verdict.UNDECIDED
    assert answer("max cut short").stop is Stop.NODES


def test_constants_are_those_of_the_engine() -> None:
    from handfast.stability.search import reduced

    assert STRONGEST == reduced.STRONGEST


# --- planted faults -----------------------------------------------------------------------------------


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


def negate_largest(data: dict) -> None:
    y = deep(data, "certificate", "rows", "multiplier")
    y[int(np.argmax(y))] *= -1


def drop_leaf(data: dict) -> None:
    data["certificate"]["leaves"].pop()
    data["certificate"]["rows"]["start"].pop(-2)


def move_sector(data: dict) -> None:
    nodes = data["certificate"]["nodes"]
    at = next(i for i, (a, b) in enumerate(zip(nodes["left"], nodes["right"], strict=True)) if a < b)
    nodes["right"][at] -= 1


def trivial(data: dict) -> None:
    """A proof that holds: of a claim about motions too small to matter."""
    c = data["certificate"]
    c["schema"] = "handfast/certificate/1"
    c["cap_r"], c["cap_q"] = [1e-9] * 6, [1e-9] * len(c["question"]["grasp"]["joints"])
    c["nodes"] = {"parent": [-1], "part": [0], "state": [0], "left": [0], "right": [0]}
    c["leaves"] = [0]
    c["rows"] = {"start": [0, 1], "kind": [int(Row.CN_UP)], "index": [0], "a": [0], "b": [0], "multiplier": [1.0]}


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


FAULTS = [
    ("check holds", put("witness", "c", 0, to=times(1 + 1e-6)), "witness: the residual is"),
    ("check holds", put("witness", "r", 1, to=times(1.01)), "witness: the residual is"),
    ("check holds", put("witness", "wrench", 1, to=2.1), "witness: it is a state under another disturbance"),
    ("check holds", put("witness", "command", "prox_1", to=0.11), "witness: it is a state with other commands"),
    ("check holds", put("question", "wrench", 1, to=2.3), "witness: it is a state under another disturbance"),
    ("check holds", put("question", "grasp", "contacts", 1, "friction", to=0.9), "witness: the residual is"),
    ("check holds", put("question", "grasp", "preload", "prox_1", to=0.05), "witness: it is a state with other comm"),
    ("check holds", put("question", "torque_limits", to={"prox_1": 0.01}), "witness: prox_1 carries more than its"),
    ("check holds", put("question", "force_limit", to=0.1), "witness: a normal force is above its limit"),
    ("check holds", put("question", "eta", to=0.05), "witness: the residual is"),
    ("check holds", put("answer", "verdict", to="slips"), "answer: SLIPS with a witness"),
    ("check holds", put("answer", "verdict", to="undecided"), "answer: UNDECIDED with a witness"),
    ("check holds", put("answer", "certified", to=True), "answer: certified is not what the rest of the file"),
    ("check holds", put("answer", "contacts", 0, "force", to=[0, 0, 0]), "answer: contacts is not what the rest of"),
    ("check holds", put("witness", to=None), "answer: HOLDS without a witness"),
    ("check slips", put("answer", "verdict", to="holds"), "answer: HOLDS without a witness"),
    ("check slips", put("certificate", to=None), "answer: the disturbance is not resisted: no certificate"),
    ("check slips", put("question", "wrench", 1, to=2.2), "certificate: it answers another question"),
    ("check slips", negate_largest, r"certificate: leaf \d+ .*the multiplier is negative"),
    ("check slips", drop_leaf, r"certificate: node \d+ is neither split nor a leaf"),
    ("check slips", move_sector, r"certificate: node \d+, split of contact"),
    ("check slips", trivial, "certificate: it has caps on motions; an answer of this version is about all of them"),
    ("check slips", put("certificate", "schema", to="handfast/certificate/1"), "certificate.cap_r: is missing"),
    ("check slips", put("answer", "certified", to=False), "answer: certified is not what the rest of the file shows"),
    ("check with eta", put("question", "eta", to=0.0), "certificate: it answers another question"),
    ("max", put("answer", "lower", to=times(1.0001)), "witness: it is a state under another disturbance"),
    ("max", put("answer", "lower", to=times(0.9)), "witness: it is a state under another disturbance"),
    ("max", put("answer", "upper", to=times(0.9999)), "certificate: it covers .* the answer needs"),
    ("max", put("answer", "upper", to=times(1.5)), "answer: gap is not what"),
    ("max", put("answer", "upper", to=None), "answer: has a certificate, but claims nothing"),
    ("max", put("answer", "gap", to=1e-6), "answer: gap is not what the rest of the file shows"),
    ("max", put("answer", "unbounded", to=True), "answer: unbounded, with a bound"),
    ("max", put("certificate", "scalar", 1, to=times(1.1)), "certificate: leaf .* is not proved"),
    ("max", put("certificate", to=None), r"answer: nothing above 2\.22\d* times the direction is res.*: no cert"),
    ("max", negate_largest, "certificate: leaf"),
    ("max", drop_leaf, "certificate: node"),
    ("max", move_sector, "certificate: node"),
    ("max", put("question", "goal", to="largest"), "certificate: it answers another question|witness: "),
    ("max with base", put("answer", "upper", to=times(0.9995)), "certificate: it covers"),
    ("max with base", put("question", "wrench", 2, to=-9.0), "witness: it is a state under another"),
    ("max with base", put("certificate", "scalar", 1, to=times(0.5)), "certificate: it covers"),
    ("max unbounded", put("answer", "lower", to=times(0.5)), "answer: unbounded, but shown up to"),
    ("max slips", put("answer", "upper", to=0.1), "answer: SLIPS with bounds above 0"),
    ("max slips", put("certificate", "scalar", 1, to=1e3), "certificate: it covers 0.* to 1000; the answer needs"),
    ("max slips", put("certificate", "scalar", 0, to=1.0), "certificate: it covers 1 to inf; the answer needs"),
    ("max slips without preload", put("answer", "verdict", to="holds"), "answer: HOLDS without a witness"),
    ("max slips without preload", put("question", "force_limit", to=1.0), "answer: is of a maximum, its question"),
    ("torques", put("answer", "upper", to=times(0.9995)), "witness: its commands cost 0.04"),
    ("torques", put("answer", "lower", to=times(1.0001)), "certificate: it covers .* the answer needs"),
    ("torques", put("answer", "preload", "prox_1", to=0.0449), "witness: the answer gives other commands"),
    ("torques", put("answer", "preload", to={"prox_1": 0.0}), "witness: the answer's commands are of other actuators"),
    ("torques", put("witness", "command", to=lambda c: {n: -v for n, v in c.items()}), "witness: a command has the w"),
    ("torques", put("question", "goal", to="check"), "question|answer: is of torques|driven"),
    ("sum of torques", put("question", "objective", to="max"), "witness: its commands cost|certificate: it answers"),
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
    ("max", both(unbounded, without_motions), "witness: the residual is|answer: unbounded, but shown up to 0 only"),
    ("max slips without preload", put("answer", "unbounded", to=True), "answer: unbounded, with a bound"),
    # what else an answer says
    ("max", put("answer", "holds_from_zero_to", to=2.0), "interval: it states no resolution"),
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
    ("undecided", put("answer", "residual", to=0.0), "answer: residual is not what"),
    ("check slips", put("answer", "colour", to="red"), "answer: colour is nothing that it can say; leave it out"),
    ("check slips", put("answer", "motion_cap", to=1e4), "answer: motion_cap is not what the rest of the file shows"),
    ("check slips", lambda data: data["answer"].pop("residual"), "answer: residual is missing"),
    ("check slips", lambda data: data["answer"].pop("verified"), "answer: verified is missing"),
    ("check slips", put("answer", "verified", to="yes"), "answer.*verified"),
    ("check slips", put("answer", "verified", to=1), "answer.*verified"),
    ("torques do not exist", put("answer", "preload", to={"left": 0.1}), "answer: preload is not what"),
    ("torques", put("answer", "colour", to="red"), "answer: colour is nothing that it can say"),
]


@pytest.mark.parametrize(("name", "change", "reason"), FAULTS, ids=range(len(FAULTS)))
def test_planted_faults_are_refused(name: str, change: Any, reason: str, tmp_path: Path) -> None:
    data = json.loads(text(name))
    change(data)
    path = tmp_path / "r.json"
    path.write_text(json.dumps(data))
    try:
        done = verify(path)
    except InputError as fault:  # not even a question
        said = str(fault)
    else:
        assert not done.ok
        said = done.reason
    assert "\n" not in said
    assert re.search(reason, said), said


def test_what_is_recorded_and_not_proved(tmp_path: Path) -> None:
    """The course of a search: another one shows the same. Nor does it say so."""
    data = json.loads(text("check slips"))
    data["answer"] |= {"seconds": 1e3, "nodes": 7, "stop": "time", "verified": False}
    (tmp_path / "r.json").write_text(json.dumps(data))
    done = verify(tmp_path / "r.json")
    assert done.ok
    said = json.dumps(done.to_json() | {"seconds": 0})
    assert not any(word in said for word in ("1000", "nodes", "time", "stop"))


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


@pytest.mark.parametrize("grow", [far_contact, hardly_loaded, idle_actuators, idle_and_slack])
def test_nothing_idle_hides_an_imbalance(grow: Any, tmp_path: Path) -> None:
    """However large the numbers of what takes no part, what is missing is judged by what acts."""
    data = json.loads(text("check holds"))
    grow(data)
    if grow is far_contact:  # of the others some torque goes nowhere
        assert result_file.from_dict(data).witness.residuals.worst < 1e-9
    overload(data)
    assert result_file.from_dict(data).witness.residuals.worst > 0.1
    (tmp_path / "r.json").write_text(json.dumps(data))
    assert re.search("witness: the residual is", verify(tmp_path / "r.json").reason)


@pytest.mark.parametrize("size", [1.0, 1e-12, 1e-170, 1e-200, 1e-310])
def test_no_load_is_too_small_to_slip(size: float, tmp_path: Path) -> None:
    """A fixture cannot pull: a state without forces is none under any load."""
    data = result_file.to_dict(result_file.Result.of(check(nest(), w(0, 0, -1))))
    for wrench in (data["question"]["wrench"], data["witness"]["wrench"]):
        wrench[2] = size
    for name in ("r", "c"):
        data["witness"][name] = [0.0] * len(data["witness"][name])
    (tmp_path / "r.json").write_text(json.dumps(data))
    assert re.search("witness: the residual is", verify(tmp_path / "r.json").reason)


# --- version 1 ------------------------------------------------------------------------------------------


@cache
def first_text() -> str:
    """An answer of version 1: its certificate has caps, and it says which."""
    reach = 1e4 * 1.1  # [N] ten thousand times the force that acts
    question = CASES["check"][0]
    size = question.grasp.size
    caps = np.repeat([reach, reach / size], 3), reach / model.joint_arms(question.grasp)
    c = prove(question, caps=caps)
    assert c is not None
    said = {"schema": "handfast/answer/1", "query": "check", "verdict": "slips", "stop": "complete", "seconds": 0.1}
    said |= {"nodes": 10, "certified": True, "motion_cap": reach, **dict.fromkeys(KEYS)}
    bare = {"schema": "handfast/result/1", "question": question_to_dict(question), "answer": said, "witness": None}
    return json.dumps(bare | {"certificate": certificate_to_dict(c)})


def caps_times(x: float) -> Any:
    def change(data: dict) -> None:
        for name in ("cap_r", "cap_q"):
            data["certificate"][name] = [x * v for v in data["certificate"][name]]
        data["answer"]["motion_cap"] *= x

    return change


def test_the_first_version_is_read(tmp_path: Path) -> None:
    path = tmp_path / "r.json"
    path.write_text(first_text())
    done = verify(path)
    assert done.ok, done.reason
    assert done.certificate.motion == pytest.approx(1.1e4)
    assert done.certificate.claim == "the disturbance is not resisted, up to virtual motions of 11000 N"


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (caps_times(1e-6), "certificate: it covers motions up to 0.011 N only; this question's begin to matter at"),
        (trivial, "certificate: it covers motions up to 1e-09 N only; this question's begin to matter at"),
        (lambda d: d["certificate"].pop("cap_r"), "certificate.cap_r: is missing"),
        (lambda d: [d["certificate"].pop("cap_r"), d["certificate"].pop("cap_q")], "certificate.cap_.: is missing"),
        (put("certificate", "cap_q", 0, to=1.0), "certificate: it covers motions up to"),
        (put("answer", "motion_cap", to=times(2)), "answer: motion_cap is not what the rest of the file shows"),
        (put("answer", "motion_cap", to=None), "answer: motion_cap is not what the rest of the file shows"),
        (put("answer", "verified", to=True), "answer: verified is nothing that it can say"),
        (put("schema", to="handfast/result/2"), "certificate: it has caps on motions; an answer of this version"),
        (negate_largest, "certificate: leaf"),
        (drop_leaf, "certificate: node"),
    ],
)
def test_faults_of_the_first_version(change: Any, reason: str, tmp_path: Path) -> None:
    data = json.loads(first_text())
    change(data)
    path = tmp_path / "r.json"
    path.write_text(json.dumps(data))
    try:
        said = verify(path).reason
    except InputError as fault:
        said = str(fault)
    assert re.search(reason, said), said


def test_unbounded_means_as_far_as_the_search_goes(tmp_path: Path) -> None:
    """A witness at less than the search's end does not show it."""
    a = maximum(bell(), w(0, 1, 0))
    data = result_file.to_dict(result_file.Result.of(a))
    unbounded(data)
    (tmp_path / "r.json").write_text(json.dumps(data))
    assert re.search(r"unbounded, but shown up to 2\.22\d* only", verify(tmp_path / "r.json").reason)


# --- what verify takes ----------------------------------------------------------------------------------


def test_a_bare_certificate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    c = answer("max").certificate
    assert c is not None
    save_certificate(c, tmp_path / "c.json")
    done = verify(tmp_path / "c.json")
    assert done.ok
    assert done.witness is None
    assert done.certificate.leaves == len(c.leaves)
    assert "times the preload" in done.certificate.claim
    assert verify(c).certificate == done.certificate
    assert main(["verify", str(tmp_path / "c.json")]) == 0
    assert "PROVED  certificate of bell" in capsys.readouterr().out


def test_an_answer_that_knows_no_question_is_not_saved(tmp_path: Path) -> None:
    bare = CheckAnswer(Verdict.UNDECIDED, Stop.TIME, 0.0, 0, (), None, None)
    with pytest.raises(InputError, match="answer: does not know its question"):
        bare.save(tmp_path / "r.json")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("schema"), "schema: is missing; handfast/result/2 or handfast/certificate/2 is needed"),
        (lambda d: d.update(schema="handfast/grasp/1"), "schema: is 'handfast/grasp/1'; handfast/result/2 or"),
        (lambda d: d.update(colour=1), "colour: is not a known field"),
        (lambda d: d["answer"].update(query="map"), "answer"),
        (lambda d: d["answer"].update(verdict="maybe"), "answer.*verdict"),
        (lambda d: d["witness"].update(wrench=[1.0]), r"witness.wrench"),
        (lambda d: d["witness"].update(c=[1.0]), r"witness.c: has 1 numbers, needs 12"),
        (lambda d: d["witness"]["command"].update(thumb=1), r"witness.command: unknown actuator 'thumb'"),
        (lambda d: d["certificate"].pop("leaves"), "certificate.leaves: is missing"),
        (lambda d: d["question"].update(goal="guess"), "question.goal"),
        (lambda d: d["question"]["grasp"].pop("contacts"), "question.grasp.contacts: is missing"),
    ],
)
def test_bad_files_are_one_line(change, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = json.loads(text("max"))
    change(data)
    path = tmp_path / "r.json"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=message):
        verify(path)
    assert main(["verify", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"handfast: {path}: ")
    assert said.count("\n") == 1


def test_it_needs_neither_engine_nor_solver(tmp_path: Path) -> None:
    answer("max").save(tmp_path / "r.json")
    code = (
        "import sys, handfast; done = handfast.verify(sys.argv[1]); assert done.ok, done.reason;"
        "names = ('numba', 'llvmlite', 'scipy', 'pyscipopt', 'gurobipy', 'highspy', 'handfast.stability.search');"
        "sys.exit(' '.join(n for n in names if n in sys.modules) or 0)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "r.json")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_on_the_command_line(tmp_path: Path, monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    handfast.save_grasp(bell(), "bell.json")
    asked = [["check", "--wrench", "0", "2.3", "0"], ["max", "--direction", "0", "1", "0"]]
    for command, *options in [*asked, ["torques", "--wrench", "0", "1", "0"]]:
        question = [command, "bell.json", *options, "--save", f"{command}.json"]
        assert main(question) == 0
        assert f"Written: {command}.json" in capsys.readouterr().out
        assert main(question) == 2
        assert "exists already; give --force" in capsys.readouterr().err
        assert main([*question, "--force", "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["certified"] is True
        assert said["verified"] is True
        assert said["motion_cap"] is None
        assert main(["verify", f"{command}.json"]) == 0
        out = capsys.readouterr().out
        assert out.startswith(f"PROVED  {command} of bell: ")
        assert "leaves, margin" in out
    assert main(["check", "bell.json", "--wrench", "0", "1", "0", "--save", "a.txt"]) == 2
    assert "a.txt: a name that ends in .json is needed" in capsys.readouterr().err

    assert main(["check", "bell.json", "--wrench", "0", "2.3", "0", "--node-limit", "1", "--save", "open.json"]) == 3
    assert main(["verify", "open.json"]) == 0
    assert "NOTHING CLAIMED  check of bell: UNDECIDED, stop nodes" in capsys.readouterr().out

    data = json.loads(Path("max.json").read_text())
    assert data["answer"]["upper"] == pytest.approx(data["answer"]["lower"], rel=1e-3)
    data["answer"]["upper"] -= 0.5 * (data["answer"]["upper"] - data["answer"]["lower"])
    Path("wrong.json").write_text(json.dumps(data))
    assert main(["verify", "wrong.json"]) == 1
    out = capsys.readouterr().out
    assert out.startswith("REFUSED  max of bell")
    assert "certificate: it covers" in out
    assert main(["verify", "wrong.json", "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert set(said) == {"schema", "ok", "witness", "interval", "certificate", "seconds", "reason", "question"}
    assert (said["schema"], said["ok"], said["witness"]["ok"]) == ("handfast/verification/1", False, True)
    assert said["certificate"]["ok"] is False
