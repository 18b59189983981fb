"""The `handfast/grasps/2` file: what it says is computed again from what it rests on, and forgeries are refused."""

from __future__ import annotations

import copy
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import InputError, Task, grasp_for, load_body, load_grasp, load_task, verify
from handfast.cli import main
from handfast.cli.question_tables import grasp_digest
from handfast.planning.tasks import grasps_file
from handfast.planning.tasks.asked import Asked
from handfast.planning.tasks.follows import Follows, contacts_at, grasp_at
from handfast.planning.tasks.grasps_file import asked_digest
from handfast.planning.tasks.proved import Grasps
from handfast.planning.tasks.replay import ReplayedGrasps, difference
from handfast.stability.loads import Loads
from handfast.synthesis.embedded import digest, task_to_dict
from handfast.synthesis.solution import Solution

Data = dict[str, Any]
Change = Callable[[Data], None]
LIMITS = {"force_limit": 50.0, "command_limit": 2.0, "torque_limits": {"thumb_middle": 3.0}}


@pytest.fixture(scope="module")
def found() -> Grasps:
    """Weights and a wrench, with every kind of limit."""
    body = load_body("scalpel")
    loads = Loads.gravity(body, ["-z", "-y"]).scaled(1.25) + Loads.wrench([0.1, 0, -0.2, 0, 0.001, 0], "cut")
    return grasp_for(load_task("scalpel-incision"), body, loads, count=2, timeout=120, jobs=1, eta=0.02, **LIMITS)


@pytest.fixture(scope="module")
def saved(found: Grasps) -> Data:
    return json.loads(json.dumps(grasps_file.to_dict(found)))


def replayed(data: Data) -> ReplayedGrasps:
    done = verify(grasps_file.from_dict(data))
    assert isinstance(done, ReplayedGrasps)
    return done


def renew(data: Data, *, question: bool = True) -> Data:
    """What a forger does: the checksum of the changed file, and of the changed question."""
    if question and all(key in data for key in ("answer", "task", "motors", "question")):
        data["answer"]["question"] = asked_digest(data)
    data["checksum"] = digest({k: v for k, v in data.items() if k != "checksum"})
    return data


def refusal(data: Data) -> str:
    """Why a file is not proved, '' if it is."""
    try:
        return replayed(data).reason
    except InputError as fault:
        return str(fault)


# --- the file as it is written ----------------------------------------------------------------------


def test_it_is_proved_and_says_what(found: Grasps, saved: Data) -> None:
    done = replayed(saved)
    assert done.ok, done.reason
    assert (done.loads, len(done.reasons)) == (6, 2)
    assert 0 < done.residual < 1e-9
    q = done.question
    assert (q["friction"], q["eta"], q["mdp"]) == (load_body("scalpel").friction, 0.02, True)
    assert {k: q[k] for k in LIMITS} == LIMITS
    assert (q["hand"]["name"], q["object"]["name"], q["task"]["name"]) == ("schunk-sah", "scalpel", "scalpel-incision")
    assert q["loads"]["cut"] == {"wrench": [0.1, 0.0, -0.2, 0.0, 0.001, 0.0], "weight": None}
    assert q["loads"]["gravity -z"]["weight"] == {"along": [0.0, 0.0, -1.0], "g": 9.81, "factor": 1.25}
    assert q["loads"]["gravity -z"]["wrench"][2] == pytest.approx(-1.25 * 9.81 * 0.04, rel=1e-12)
    assert q["preloads"] == [g.grasp.preload for g in found.grasps]


def test_numbers_come_back_exactly(found: Grasps, saved: Data) -> None:
    again = grasps_file.from_dict(saved)
    for g, s in zip(found.grasps, again.grasps, strict=True):
        np.testing.assert_array_equal(s.q, g.q)
        for name, check in zip(found.loads.names, g.answer.checks, strict=True):
            assert check.witness is not None
            np.testing.assert_array_equal(s.witnesses[name].c, check.witness.state.c)
    np.testing.assert_array_equal(again.loads.wrenches, found.loads.wrenches)
    hand, own = again.task.hand, found.task.hand
    np.testing.assert_array_equal(hand.mechanism.R, own.mechanism.R)
    np.testing.assert_array_equal(hand.mechanism.A, own.mechanism.A)
    np.testing.assert_array_equal(hand.closing, own.closing)


def test_two_tasks_of_one_hand_have_its_checksum_and_each_their_own(saved: Data) -> None:
    other = copy.deepcopy(saved)
    lower, upper = other["task"]["hand"]["joints"][0]["limits"]
    other["task"]["hand"]["joints"][0]["limits"] = [lower - 0.1, upper]
    a, b = replayed(saved).question, replayed(renew(other)).question
    assert a["hand"] == b["hand"]
    assert a["task"]["sha256"] != b["task"]["sha256"]
    assert a["sha256"] != b["sha256"]


def test_loads_know_the_weights_they_are_made_of() -> None:
    body = load_body("scalpel")
    loads = (
        Loads.tilt(body, [1, 0, 0], 1.0, steps=3).scaled(2) + Loads.wrench(np.ones(6)) + Loads.gravity(body, "x", 1.6)
    )
    assert loads.weights[3] is None
    for name, wrench, weight in zip(loads.names, loads.wrenches, loads.weights, strict=True):
        if weight is not None:
            factor, g = (1, 1.6) if name == "gravity +x" else (2, 9.81)
            assert (weight.factor, weight.g) == (factor, g)
            np.testing.assert_allclose(np.linalg.norm(wrench[:3]), factor * g * body.mass, rtol=1e-12)
            np.testing.assert_allclose(weight.wrench(body.mass, body.center_of_mass), wrench, rtol=1e-12, atol=1e-18)


def test_it_needs_neither_engine_nor_search(saved: Data, tmp_path: Path) -> None:
    (tmp_path / "g.json").write_text(json.dumps(saved))
    code = (
        "import sys, handfast; done = handfast.verify(sys.argv[1]); assert done.ok, done.reason;"
        "names = ('numba', 'mujoco', 'pyscipopt', 'gurobipy', 'highspy', 'handfast.stability.search',"
        " 'handfast.synthesis.search.kernel', 'handfast.planning.tasks.climb');"
        "sys.exit(' '.join(n for n in names if n in sys.modules) or 0)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "g.json")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


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
    "uncoupled": (grasp("mechanism", "couplings", to=[]), r"grasp\.mechanism\.couplings has 0 entries"),
    "preload": (grasp("preload", to={}), r"grasp 1: answer\.preload\.\w+ is 0\.\d+; of .* 0\.0"),
    "one command": (grasp("preload", to=tripled), r"answer\.preload\.\w+ is"),
    "name": (grasp("name", to="better"), r"grasp\.name is \"better\""),
    "joint": (at("grasps", 0, "joints", "index_proximal", to=lambda q: q + 1e-4), "index_proximal is not at the value"),
    "unused finger": (_unused_finger, r"answer\.configuration\.joints\.ring_proximal is 0\.698132; .* 0\.598132"),
    "beyond": (at("grasps", 0, "joints", "ring_middle", to=9.0), "ring_middle is beyond its limits"),
    "existence": (at("grasps", 0, "existence", "position", 2, to=longer), "grasp 1: "),
    "swapped witnesses": (_swapped_witnesses, "grasp 1: gravity -z: witness: the residual"),
    "no witness": (_without_witness, "has witnesses for 2 loads, not for each of gravity -z"),
    "short witness": (
        at("grasps", 0, "witnesses", "cut", "q", to=[0.0]),
        "cut: its witness has 1 numbers for q",
    ),
    "force": (at("grasps", 0, "witnesses", "cut", "c", 0, to=longer), "cut: witness: the residual"),
    "swapped grasps": (_swapped_grasps, r"grasp 1: answer\.preload"),
    "no grasps": (_nothing, "FOUND without a grasp"),
    "one answer": (_one_word, r"answer\.grasps: has 1 entries for 2 grasps"),
    "none": (at("answer", "verdict", to="none"), "NONE with a grasp"),
    "load": (at("answer", "loads", "gravity -z", 2, to=longer), r"answer\.loads\.gravity -z\[2\] is"),
    "said preload": (said("preload", "thumb_middle", to=0.0), r"answer\.preload\.thumb_middle is 0"),
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
    "eta": (asked("eta", to=0.4), "witness: the residual"),
    "torque limit": (asked("torque_limits", "thumb_middle", to=1e-6), "thumb_middle carries more than its limit"),
    "force limit": (asked("force_limit", to=1e-4), "a normal force is above its limit"),
    "command limit": (asked("command_limit", to=1e-5), r"is commanded .*; the limit is 1e-05"),
    "actuator": (_other_actuator, "is commanded, which was not asked for"),
    "mass": (asked("object", "mass", to=0.03), r"gravity -\w: witness: the residual|answer\.loads"),
    "centre": (asked("object", "center_of_mass", 0, to=0.0), r"witness: the residual"),
    "g": (asked("loads", "gravity -z", "weight", "g", to=1.62), "witness: the residual"),
    "along": (asked("loads", "gravity -z", "weight", "along", to=[0, 0.1, -1]), "witness: the residual"),
    "safety": (asked("loads", "gravity -y", "weight", "factor", to=2.0), "witness: the residual"),
    "wrench": (asked("loads", "cut", "wrench", 0, to=longer), "witness: the residual"),
    "weight and wrench": (_weight_and_wrench, "gravity -z: needs either a wrench or a weight"),
    "no mass": (asked("object", "mass", to=None), "question.object.mass: is null, but a load is its weight"),
    "motor": (at("motors", "actuators", 3, "joints", to=tripled), r"grasp\.mechanism"),
    "closing": (at("motors", "closing", "index_proximal", to=-1), r"grasp\.(joints|mechanism)"),
    "coupled": (at("task", "hand", "couplings", to=[]), "grasp|existence|free joints"),
}


@pytest.mark.parametrize("name", list(FORGED))
def test_a_forged_file_is_refused(saved: Data, name: str) -> None:
    change, match = FORGED[name]
    data = copy.deepcopy(saved)
    change(data)
    assert data != saved
    with pytest.raises(InputError, match="checksum: does not fit"):
        grasps_file.from_dict(data)
    reason = refusal(renew(data))
    assert re.search(match, reason), reason
    assert "\n" not in reason


def test_a_question_is_not_changed_alone(saved: Data) -> None:
    """Where every number still fits, the answer's own word of what it answers does not."""
    data = copy.deepcopy(saved)
    data["question"]["force_limit"] *= 2
    assert "the answer is to another question" in refusal(renew(data, question=False))
    done = replayed(renew(data))  # the weaker claim holds as well, and is what is printed
    assert done.ok
    assert done.question["force_limit"] == 2 * LIMITS["force_limit"]


def test_an_old_file_is_told_what_it_lacks(saved: Data) -> None:
    with pytest.raises(InputError, match="'handfast/grasps/1', which says neither friction nor gearing"):
        grasps_file.from_dict(saved | {"schema": "handfast/grasps/1"})


def test_differences_are_told_one_by_one() -> None:
    due = {"a": [1.0, 1e-20, None], "b": {"c": "x", "d": True}}
    assert difference(due, {"a": [1.0, -1e-20, None], "b": {"d": True, "c": "x"}}, "it") == ""
    assert difference(due, due | {"a": [1.0, 1e-8, None]}, "it").startswith("it.a[1] is 1e-08; of hand")
    assert difference(due, due | {"a": [1.0, 0.0]}, "it") == "it.a has 2 entries, not 3"
    assert difference(due, due | {"b": {"c": "x"}}, "it") == "it.b.d is missing"
    assert difference(due, due | {"b": {"c": "x", "d": 1}}, "it").startswith("it.b.d is 1; ")
    assert difference(due, due | {"e": 0}, "it") == "it.e follows from nothing in the file"
    assert difference(1e-9, 1.001e-9, "it") == ""
    assert difference(1e-9, 1.001e-9, "it", small=0.0).startswith("it is 1.001e-09; ")
    assert difference("x" * 99, "y" * 99, "it").count("x") < 60


# --- changed everywhere -----------------------------------------------------------------------------


def rebuilt(found: Grasps, task: Task, loads: Loads, asked: Asked, preload: Callable[[float], float]) -> Data:
    """The file of a forger who computes again all that is computed, and keeps the witnesses."""
    grasps = []
    for g in found.grasps:
        solution = Solution.of(task, g.solution.existence)
        bare = grasp_at(solution, g.q, contacts_at(solution, asked.friction))
        commands = {n: preload(v) for n, v in (g.answer.preload or {}).items()}
        grasp = bare.with_preload(commands)
        f = Follows.of(solution, g.q, grasp, commands, loads)
        answer = replace(g.answer, preload=commands, loads=loads, upper=f.command)
        parts = {"spare_friction": f.spare_friction, "curvatures": f.curvatures, "dexterity": f.dexterity}
        grasps.append(replace(g, solution=solution, grasp=grasp, answer=answer, **parts))
    forged = replace(found, task=task, loads=loads, asked=asked, grasps=tuple(grasps))
    return json.loads(json.dumps(grasps_file.to_dict(forged)))


def geared(task: Task) -> Task:
    mechanism = replace(task.hand.mechanism, R=2 * task.hand.mechanism.R)
    return replace(task, hand=replace(task.hand, mechanism=mechanism))


@pytest.mark.parametrize(
    "change",
    [
        {"asked": lambda a: replace(a, friction=0.1)},
        {"asked": lambda a: replace(a, eta=0.3)},
        {"task": geared},
        {"preload": lambda v: 0.5 * v},
        {"loads": lambda x: x.scaled(1.5)},
        {},
    ],
    ids=["friction", "normals", "gearing", "preload", "loads", "nothing"],
)
def test_what_is_changed_everywhere_does_not_balance(found: Grasps, change: dict[str, Any]) -> None:
    def same(x: Any) -> Any:
        return x

    parts = {"task": found.task, "loads": found.loads, "asked": found.asked}
    changed = {name: change.get(name, same)(value) for name, value in parts.items()}
    reason = refusal(rebuilt(found, **changed, preload=change.get("preload", same)))
    assert ("witness: the residual is" in reason) if change else not reason


# --- any value ----------------------------------------------------------------------------------------

# What may be changed in an accepted file: nothing is claimed of it.
DESCRIPTIVE = ("record",)
# What is no claim but proof: another one will do as well.
PROOFS = ("existence", "witnesses")
MUTANTS = 250


def places(x: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every value in a JSON object, leaves and branches."""
    for key, value in x.items() if isinstance(x, dict) else enumerate(x) if isinstance(x, list) else ():
        yield (*path, key)
        yield from places(value, (*path, key))


def mutated(x: Any, rng: np.random.Generator) -> Any:
    """Another value of the same kind; None where none is."""
    if isinstance(x, bool):
        return not x
    if isinstance(x, int | float):
        return x * float(rng.choice([-1.0, 0.5, 1.001, 2.0])) if x else float(rng.choice([1e-3, 1.0]))
    if isinstance(x, str):
        return x + "x" if rng.random() < 0.5 else x[1:]
    if isinstance(x, list) and len(x) > 1 and rng.random() < 0.5:
        i, j = rng.choice(len(x), 2, replace=False)
        return [x[j] if k == i else x[i] if k == j else y for k, y in enumerate(x)]
    if isinstance(x, list) and x:
        i = int(rng.integers(len(x)))
        return x[:i] + x[i + 1 :]
    if isinstance(x, dict) and x:
        gone = list(x)[int(rng.integers(len(x)))]
        return {k: v for k, v in x.items() if k != gone}
    return 1.0 if x is None else None


def claims(data: Data) -> dict[str, Any]:
    """All that a file says and `verify` prints as proved."""
    stated = {k: v for k, v in replayed(data).question.items() if k != "sha256"}
    grasps = [g["grasp"] for g in data["grasps"]]
    return {"question": stated, "answer": data["answer"] | {"question": ""}, "grasps": grasps}


def meaning(data: Data) -> Any:
    """What a file asks, once it is read: fields that may be left out are there."""
    what = grasps_file.from_dict(data)
    return task_to_dict(what.task), grasps_file.motors_to_dict(what.task.hand), data["question"]


def test_accepted_mutants_claim_the_same(saved: Data) -> None:
    rng = np.random.default_rng(14)
    all_places = [p for p in places(saved) if p[0] != "checksum"]
    own, accepted, refused = claims(saved), 0, 0
    for place in (all_places[int(k)] for k in rng.choice(len(all_places), MUTANTS, replace=False)):
        data, knows = copy.deepcopy(saved), bool(rng.random() < 0.5)
        old = _value(data, place)
        at(*place, to=lambda x: mutated(x, rng))(data)
        if _value(data, place) == old:
            continue
        reason = refusal(renew(data, question=knows))
        assert "\n" not in reason
        refused, accepted = refused + bool(reason), accepted + (not reason)
        if reason or place[0] in DESCRIPTIVE:
            continue
        other = difference(own, claims(data), "claims")
        if place[0] == "grasps" and place[2] in PROOFS:
            assert not other, (place, other)
        elif place[0] in ("task", "motors", "question"):  # another question, truly answered: then it says so
            assert knows, place
            assert other or meaning(data) == meaning(saved), place
        else:
            assert not other, (place, other)
    assert accepted >= 20
    assert refused >= MUTANTS // 2


def _value(data: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        data = data[key]
    return data


# --- the command line -----------------------------------------------------------------------------------


def test_verify_prints_what_it_has_proved(saved: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "grasps.json"
    path.write_text(json.dumps(saved))
    assert main(["verify", str(path)]) == 0
    text = capsys.readouterr().out
    for part in (
        "PROVED  grasps of scalpel-incision",
        "Proved: each load alone is held under one preload; friction 0.5; normals off by up to 1.146°; maximum diss",
        "thumb_middle carries up to 3; normal forces up to 50 N; commands up to 2",
        "1.25 × weight",
        "as stated",
        "hand 'schunk-sah' sha256 ",
        "object 'scalpel' sha256 ",
        "clearances, scores, lower bounds and the course of the search",
        "not from forgery",
    ):
        assert part in text, part
    assert main(["verify", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["question"] == replayed(saved).question
    forged = copy.deepcopy(saved)
    forged["grasps"][1]["grasp"]["contacts"][0]["friction"] = 0.7
    path.write_text(json.dumps(renew(forged)))
    assert main(["verify", str(path)]) == 1
    text = capsys.readouterr().out
    assert text.startswith("REFUSED")
    assert "grasp 2: grasp.contacts[0].friction is 0.7" in text
    assert "Proved:" not in text


def test_verify_prints_the_question_of_a_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "check.json"
    query = ["check", "fig1", "--wrench", "0", "1", "0", "--force-limit", "3", "--save", str(path)]
    assert main([*query, "--torque-limit", "finger_1_prox=2"]) == 0
    capsys.readouterr()
    assert main(["verify", str(path)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Proved: 1 N along +y" in text
    assert "friction 1; preload 0.1 N·m at finger_1_prox and finger_2_prox; normals exact; maximum dissipation" in text
    assert "finger_1_prox carries up to 2; normal forces up to 3 N" in text
    assert "relative to grasp 'fig1' sha256 " in text
    assert main(["verify", str(path), "--json"]) == 0
    q = json.loads(capsys.readouterr().out)["question"]
    assert (q["wrench"], q["mdp"], q["force_limit"]) == ([0, 1, 0, 0, 0, 0], True, 3.0)
    assert q["grasp"]["preload"] == load_grasp("fig1").preload
    assert q["grasp"]["sha256"] == grasp_digest(load_grasp("fig1").with_preload(None))
    assert q["grasp"]["sha256"] != grasp_digest(load_grasp("fig1").with_friction(0.9))


def test_verify_says_without_maximum_dissipation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "check.json"
    main(["check", "fig1", "--wrench", "0", "1", "0", "--no-mdp", "--save", str(path)])
    capsys.readouterr()
    main(["verify", str(path)])
    assert "friction without maximum dissipation, which may create energy" in capsys.readouterr().out
