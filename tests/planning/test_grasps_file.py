"""The `handfast/grasps/1` file and the answer that it holds: what they say is computed again."""

from __future__ import annotations

import copy
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import load_body, load_grasp
from handfast.cli import main
from handfast.cli.verify import grasp_digest
from handfast.planning.results import grasps_file
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.verify import question_of
from handfast.stability.problem.loads import Loads
from tests.support.forged_grasps import (
    LIMITS,
    Data,
    renew,
    replayed,
    scalpel_file,
    scalpel_grasps,
)


@pytest.fixture(scope="module")
def found() -> Grasps:
    return scalpel_grasps()


@pytest.fixture(scope="module")
def saved() -> Data:
    return scalpel_file()


# --- the file as it is written ----------------------------------------------------------------------


def test_it_is_proved_and_says_what(found: Grasps, saved: Data) -> None:
    done = replayed(saved)
    assert done.ok, done.reason
    *grasps, geometry = done.parts
    assert [g.name for g in grasps] == [g.name for g in geometry.parts] == ["grasp 1", "grasp 2"]
    for g in grasps:
        configuration, *held = g.parts
        assert (configuration.name, [x.name for x in held]) == ("configuration", list(found.loads.names))
        assert all(x.figures["exact"] and x.figures["residual"] < 1e-9 for x in held)
    q = question_of(grasps_file.from_dict(saved))
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
    a, b = (question_of(grasps_file.from_dict(data)) for data in (saved, renew(other)))
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
        "names = ('numba', 'mujoco', 'pyscipopt', 'gurobipy', 'highspy', 'handfast.stability.search.engine',"
        " 'handfast.stability.search.search', 'handfast.stability.search.kernel', 'handfast.synthesis.search.kernel',"
        " 'handfast.planning.evaluation.local_search');"
        "sys.exit(' '.join(n for n in names if n in sys.modules) or 0)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "g.json")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# --- the answer checks itself -----------------------------------------------------------------------


def test_an_answer_checks_itself(found: Grasps, saved: Data) -> None:
    done = found.verify()
    assert done.ok, done.reason
    assert done.to_json() == replayed(saved).to_json()
    assert any("clearances" in line for line in done.not_replayed)
    for k in (1, 2):
        own = [f"grasp {k}: an exact one exists in its box", *(f"grasp {k}: {n} is held" for n in found.loads.names)]
        assert [line for line in done.replayed if line.startswith(f"grasp {k}: ")] == own


def test_an_answer_that_is_not_so_says_why(found: Grasps) -> None:
    first, second = found.grasps
    slippery = replace(first, grasp=first.grasp.with_friction(0.9))
    done = replace(found, grasps=(second, slippery)).verify()
    assert done.reason == f"grasp 2: friction at its contacts is not {found.requirements.friction:g}"
    good, bad = done.parts[:2]
    assert (good.ok, bad.ok) == (True, False)
    geometry = done.part("geometry")
    assert geometry is not None
    assert geometry.parts[0].ok
    assert re.match(r"grasp\.contacts\[0\]\.friction is 0\.9; .* 0\.5", geometry.parts[1].reason)
    loose = replace(found, requirements=replace(found.requirements, command_limit=1e-5)).verify()
    assert "the limit is 1e-05" in loose.reason
    assert replace(found, grasps=()).verify().reason == "FOUND without a grasp"


# --- the command line -----------------------------------------------------------------------------------


def test_verify_prints_what_it_has_proved(saved: Data, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "grasps.json"
    path.write_text(json.dumps(saved))
    assert main(["verify", str(path)]) == 0
    text = capsys.readouterr().out
    for part in (
        "PROVED  grasps of scalpel-incision",
        "Proved: each load alone is held under one preload; friction 0.5; normals off by up to 1.146°; maximum diss",
        "index_proximal carries up to 3; normal forces up to 50 N; commands up to 2",
        "1.25 × weight",
        "as stated",
        "hand 'schunk-sah' sha256 ",
        "object 'scalpel' sha256 ",
        "what the answer repeats of its grasps, clearances, scores, lower bounds of commands and the course of the "
        "search",
        "not from forgery",
    ):
        assert part in text, part
    assert main(["verify", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["question"] == question_of(grasps_file.from_dict(saved))
    forged = copy.deepcopy(saved)
    forged["grasps"][1]["grasp"]["contacts"][0]["friction"] = 0.7
    path.write_text(json.dumps(renew(forged)))
    assert main(["verify", str(path)]) == 1
    text = capsys.readouterr().out
    assert text.startswith("REFUSED")
    assert "grasp 2: friction at its contacts is not 0.5" in text
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
