"""From regions to grasps: the search, its answer, the file, and the replay that trusts neither."""

from __future__ import annotations

import json
import pickle
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import (
    InputError,
    Reach,
    Stop,
    Task,
    Verdict,
    check,
    find_contacts,
    grasp_for,
    load_body,
    load_configuration,
    load_grasp,
    load_hand,
    load_task,
    save_grasp,
    verify,
)
from handfast.cli import main
from handfast.geometry.collision import Collisions
from handfast.geometry.scene import Scene
from handfast.planning.evaluation import local_search, preload_search
from handfast.planning.evaluation.evaluator import EVALUATION_CUTOFF, Evaluator, requests
from handfast.planning.evaluation.local_search import LocalSearch
from handfast.planning.evaluation.steps import Gradients, Steps
from handfast.planning.filters.non_contacting import NonContactingFingers
from handfast.planning.question import Allowed, PlanLimits, Requirements
from handfast.planning.ranking import RANKING_SENSES, rank
from handfast.planning.results.grasps import Grasps
from handfast.planning.search import Journal, RejectionReason
from handfast.stability.problem.loads import Loads
from handfast.stability.studies.questions import hold
from handfast.synthesis.search.starts import Starts, Walks
from handfast.synthesis.solution import whole
from handfast.synthesis.task_problem import TaskProblem
from tests.support.holds import grip

NAME = "scalpel-incision"
ONE = Loads.gravity(load_body("scalpel"), "z")  # six directions take eight times as long


@pytest.fixture(scope="module")
def found() -> Grasps:
    return grasp_for(load_task(NAME), count=2, timeout=120, jobs=1)


# --- the answer ---------------------------------------------------------------------------------


def test_grasps_are_proved_clear_and_hold(found: Grasps) -> None:
    assert (found.verdict, found.stop, len(found.grasps)) == (Reach.FOUND, Stop.COMPLETE, 2)
    body, hand = load_body("scalpel"), found.task.hand
    for g in found.grasps:
        assert g.solution.verify().ok
        # measured anew, with distances of the scene alone: outside the requested contacts nothing is deep
        fresh = Collisions(Scene(hand, body)).clearances(g.q, g.pose, requests(g.solution))
        assert fresh.free(1e-3, 1e-3, 1e-3)
        assert g.curvatures.min() > -1.0
        for w in Loads.gravity(body).wrenches:
            a = check(g.grasp, w)
            assert a.verdict is Verdict.HOLDS
            assert a.witness is not None
            assert a.witness.residuals.worst < 1e-9
        assert g.answer.lower <= g.command
        assert g.terms["from_limits"] > 0.01


def test_contacts_lie_on_the_object(found: Grasps) -> None:
    """Where a solid of the hand carries the region, the collider finds the certified contact too."""
    body, hand = load_body("scalpel"), found.task.hand
    for g in found.grasps:
        seen = find_contacts(hand, g.q, body, g.pose, threshold=1e-3)
        for c in g.grasp.contacts:
            if c.link != "palm":  # the authors' palm region lies on a knuckle that the bundled palm has not
                assert min(np.linalg.norm(c.position - s.position) for s in seen if s.link == c.link) < 4e-3


def test_every_start_is_counted_once(found: Grasps) -> None:
    assert found.tally.passed >= len(found.grasps)
    assert found.tally.total <= found.starts
    assert found.evaluated >= found.tally.total
    said = found.to_json()["fates"]
    assert list(said) == ["holds", "object", "itself", "curved", "unbalanced", "slips", "undecided", "alike"]
    assert sum(said.values()) == found.tally.total


@pytest.mark.slow
def test_the_same_seed_finds_the_same_on_two_cores() -> None:
    one, two = (grasp_for(load_task(NAME), loads=ONE, count=2, timeout=120, jobs=jobs) for jobs in (1, 2))
    assert len(one.grasps) == 2
    assert one.tally == two.tally
    for a, b in zip(one.grasps, two.grasps, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
        np.testing.assert_array_equal(a.pose, b.pose)
        assert a.answer.preload == b.answer.preload


def test_ranks(found: Grasps) -> None:
    scores = [g.score for g in found.grasps]
    assert scores == sorted(scores, reverse=True)
    a, b = found.grasps
    best = replace(a, answer=replace(a.answer, upper=0.5 * min(g.command for g in found.grasps)))
    assert rank([a.terms, a.terms]) == [0.5, 0.5]
    shares = rank([best.terms, b.terms])
    assert sum(shares) == pytest.approx(1.0)
    wins = sum(s * (best.terms[t] - b.terms[t]) > 0 for t, s in RANKING_SENSES.items())
    assert shares[0] == pytest.approx(wins / len(RANKING_SENSES))


def test_none_where_the_hand_cannot_reach() -> None:
    answer = grasp_for(grip(0.5), load_body("slab"), timeout=60, jobs=1)
    assert (answer.verdict, answer.grasps) == (Reach.NONE, ())
    assert answer.synthesis is not None
    assert answer.synthesis.verdict is Reach.NONE


def test_a_time_limit_is_undecided() -> None:
    answer = grasp_for(load_task(NAME), count=1, timeout=1e-6, jobs=1)
    assert (answer.verdict, answer.stop, answer.grasps) == (Reach.UNDECIDED, Stop.TIME, ())


@pytest.mark.slow
def test_an_interruption_keeps_what_was_found() -> None:
    def stop(_: object) -> None:
        raise KeyboardInterrupt

    answer = grasp_for(load_task(NAME), loads=ONE, count=50, jobs=1, journal=Journal(stop))
    assert answer.stop is Stop.INTERRUPTED
    assert 0 < len(answer.grasps) < 50
    assert all(g.solution.verify().ok for g in answer.grasps)


def test_an_interruption_while_commands_are_sought_ends_that(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was found stays, with the first commands that held; the least are not waited for."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(LocalSearch, "proof", interrupted)
    answer = grasp_for(load_task(NAME), loads=ONE, count=50, jobs=1)
    assert answer.stop is Stop.INTERRUPTED
    assert answer.grasps
    assert all(g.answer.verdict is Verdict.HOLDS and g.answer.lower == 0 for g in answer.grasps)
    assert not answer.search.found  # whoever goes on looks for the least ones again


def test_an_interruption_of_a_query_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """A query that Ctrl-C ended says so in its answer, which is no reason to drop the grasp and go on."""
    stopped = replace(hold(load_grasp("fig1"), Loads.wrench([0, 0, 0])), stop=Stop.INTERRUPTED)
    monkeypatch.setattr(preload_search, "hold", lambda *_, **__: stopped)
    answer = grasp_for(load_task(NAME), loads=ONE, count=50, jobs=1)
    assert (answer.stop, answer.grasps, answer.tally.total) == (Stop.INTERRUPTED, (), 0)


def test_units_can_be_sent_to_another_machine() -> None:
    """Machine code and clock are those of the machine; what a unit finds is the same."""
    task = load_task(NAME)
    scene = Scene(task.hand, load_body(task.object or ""))
    evaluator = Evaluator(TaskProblem.of(task), Collisions(scene, cutoff=EVALUATION_CUTOFF), ONE, 0.5, Allowed())
    work = LocalSearch(evaluator, 0, Requirements(friction=0.5, actuators=tuple(task.hand.closing_actuators)))
    work.end = time.monotonic() + 50
    sent = pickle.loads(pickle.dumps(work))
    assert 40 < sent.end - time.monotonic() <= 50
    one, other = (w.starts.run(4) for w in (work, sent))
    assert [c.x.tolist() for c in one] == [c.x.tolist() for c in other]


def test_what_cannot_balance_is_never_returned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without friction a scalpel in four contacts cannot be held from six sides: one unit of few starts."""
    monkeypatch.setattr(sys.modules["handfast.planning.grasp_for"], "FIRST_BOXES", 64)
    monkeypatch.setattr(local_search, "RAW", 6)
    monkeypatch.setattr(LocalSearch, "numbers", lambda _, first: iter([first]))
    answer = grasp_for(load_task(NAME), friction=0.0, timeout=None, jobs=1)
    assert answer.verdict is Reach.UNDECIDED
    assert answer.tally.passed == 0
    assert answer.tally[RejectionReason.UNBALANCED] > 0


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"count": 0}, "count: is 0; a positive number"),
        ({"timeout": -1.0}, "timeout: is -1; a positive number"),
        ({"seed": -1}, "seed: is -1; a number from 0 on is needed"),
        ({"actuators": ["elbow"]}, "elbow"),
        ({"limits": PlanLimits(torque_limits={"elbow": 1.0})}, "torque limit: unknown actuator 'elbow'"),
        ({"body": load_body("jar")}, None),
    ],
)
def test_bad_questions(options: dict[str, Any], match: str | None) -> None:
    if match is None:
        massless = replace(load_body("jar"), mass=None)
        with pytest.raises(InputError, match="give the object a mass"):
            grasp_for(load_task(NAME), massless)
    else:
        with pytest.raises(InputError, match=match):
            grasp_for(load_task(NAME), **options)


def test_a_depth_below_zero() -> None:
    with pytest.raises(InputError, match=r"self_depth: is -0\.001 m; 0 or more is needed"):
        Allowed(self_depth=-1e-3)


def test_a_task_without_an_object_needs_one() -> None:
    with pytest.raises(InputError, match="names no object; give one"):
        grasp_for(replace(load_task(NAME), object=None))


# --- the steps ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bench() -> tuple[Evaluator, Walks, list[Any]]:
    task, body = load_task("teapot-service"), load_body("teapot")
    problem = TaskProblem.of(task)
    evaluator = Evaluator(
        problem, Collisions(Scene(task.hand, body), cutoff=EVALUATION_CUTOFF), Loads.gravity(body, "-y"), 0.5, Allowed()
    )
    starts = Starts(problem, 0)
    return evaluator, Walks(starts), starts.run(12)


def test_gradients_are_those_of_differences(bench: tuple[Evaluator, Walks, list[Any]]) -> None:
    evaluator, _, found = bench
    problem, task = evaluator.problem, evaluator.task
    gradients, x, h = Gradients(problem), found[0].x, 1e-6
    local, link = np.array([0.03, -0.02, 0.05]), task.hand.link("thumb_distal")
    first = len(problem.free)

    def joints(x: np.ndarray) -> np.ndarray:
        named = dict(zip(problem.labels, x * problem.lengths, strict=True))
        return whole(task, {k.removeprefix("joint:"): v for k, v in named.items() if k.startswith("joint:")})

    def on_link(x: np.ndarray) -> np.ndarray:
        T = task.hand.link_poses(joints(x))[link]
        return T[:3, :3] @ local + T[:3, 3]

    def on_object(x: np.ndarray) -> np.ndarray:
        w, *v = x[first + 3 : first + 7] / np.linalg.norm(x[first + 3 : first + 7])
        turned = local + 2 * np.cross(v, np.cross(v, local) + w * local)
        return turned + problem.unit * x[first : first + 3]

    for point, J in (
        (on_link, gradients.link(link, on_link(x), joints(x))),
        (on_object, gradients.object(on_object(x), x)),
    ):
        for i in range(problem.n):
            e = np.zeros(problem.n)
            e[i] = h
            np.testing.assert_allclose(J[:, i], (point(x + e) - point(x - e)) / (2 * h), atol=1e-7)


def test_steps_away_take_apart_what_penetrates(bench: tuple[Evaluator, Walks, list[Any]]) -> None:
    evaluator, walks, found = bench
    steps = Steps(evaluator, walks, np.random.default_rng(0))
    deep = [c for c in map(evaluator.candidate, found) if c and not c.clearances.free(1e-3, 1e-3, 1e-3)]
    assert len(deep) >= 5
    better = 0
    for c in deep:
        new = [evaluator.candidate(k) for k in steps.away(c, (0.01, 0.03))]
        before = np.minimum(c.clearances.to_object, 0).sum() + np.minimum(c.clearances.between, 0).sum()
        after = [
            np.minimum(k.clearances.to_object, 0).sum() + np.minimum(k.clearances.between, 0).sum() for k in new if k
        ]
        better += bool(after) and max(after) > before
    assert better >= 0.7 * len(deep)


def test_a_step_of_nothing_costs_the_same(bench: tuple[Evaluator, Walks, list[Any]]) -> None:
    evaluator, _, found = bench
    c = evaluator.candidate(found[0])
    assert c is not None
    assert evaluator.candidate(found[0], below=c.cost) is None
    again = evaluator.candidate(found[0], below=c.cost + 1e-9)
    assert again is not None
    assert again.cost == c.cost


def test_non_contacting_fingers_move_out_of_the_way() -> None:
    """A bent ring finger moves no contact; where synthesis leaves it, it is often in the pot or in another finger."""
    narrow, body = load_task("teapot-service"), load_body("teapot")
    bent = {f"ring_{part}": (0.6, 1.3) for part in ("proximal", "middle", "distal")}
    limits = {n: (lo, hi) for n, (lo, hi) in zip(narrow.hand.joint_names, narrow.hand.limits.tolist(), strict=True)}
    task = Task.of(
        load_hand("schunk-sah"), narrow.contact_pairs, limits=limits | bent, pose=narrow.pose, object="teapot"
    )
    hand = task.hand
    fingers = NonContactingFingers(task, Collisions(Scene(hand, body), cutoff=EVALUATION_CUTOFF))
    assert [{hand.joint_names[j].split("_")[0] for j in finger.joints} for finger in fingers.fingers] == [{"ring"}]
    problem = TaskProblem.of(task)
    evaluator = Evaluator(problem, fingers.collisions, Loads.gravity(body, "-y"), 0.5, Allowed())
    helped = 0
    for certified in Starts(problem, 0).run(16):
        c = evaluator.candidate(certified)
        assert c is not None
        assert (task.hand.limits[:, 0] - 1e-9 <= c.q).all()
        assert (c.q <= task.hand.limits[:, 1] + 1e-9).all()
        before = fingers.collisions.clearances(c.solution.q, c.solution.pose, requests(c.solution))
        ring = [i for i, name in enumerate(before.links) if name.startswith("ring")]
        assert min(c.clearances.to_object[ring].min(), 0) >= min(before.to_object[ring].min(), 0) - 1e-12 or (
            c.clearances.least_between > before.least_between
        )
        helped += bool((c.q != c.solution.q).any())
    assert helped > 0


# --- the file -----------------------------------------------------------------------------------


def test_the_file_proves_it_all(found: Grasps, tmp_path: Path) -> None:
    file = tmp_path / "grasps.json"
    found.save(file)
    done = verify(file)
    assert done.ok, done.reason
    assert found.verify().to_json() == done.to_json()
    assert sum(line.endswith("is held") for line in done.replayed) == 12
    with pytest.raises(InputError, match="exists already"):
        found.save(file)


def test_from_its_file_alone_a_grasp_gets_the_same_verdict(found: Grasps, tmp_path: Path) -> None:
    save_grasp(found.grasps[0].grasp, tmp_path / "grasp.json")
    again = load_grasp(tmp_path / "grasp.json")
    for w in found.loads.wrenches:
        assert check(again, w).verdict is Verdict.HOLDS


# --- the command line ---------------------------------------------------------------------------


@pytest.mark.slow
def test_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    status = main(
        ["grasp", NAME, "-n", "1", "-o", "out", "--report", "page.html", "--up", "z", "--json", "--jobs", "1"]
    )
    answer = json.loads(capsys.readouterr().out)
    assert (status, answer["verdict"], answer["query"]) == (0, "found", "grasp")
    assert sorted(p.name for p in Path("out").iterdir()) == [
        "configuration-1.json",
        "grasp-1.json",
        "grasps.json",
        "search.json",
    ]
    assert list(answer["loads"]) == ["gravity -z"]
    assert "<canvas" in Path("page.html").read_text()
    assert main(["verify", "out/grasps.json"]) == 0
    assert "PROVED" in capsys.readouterr().out
    w = [f"{x:.17g}" for x in answer["loads"]["gravity -z"]]
    assert main(["check", "out/grasp-1.json", "--wrench", *w]) == 0
    assert capsys.readouterr().out.startswith("HOLDS")
    placed = load_configuration("out/configuration-1.json")
    assert placed.hand == "schunk-sah"
    assert main(["grasp", NAME, "-o", "out"]) == 2
    assert "holds grasps already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "match"),
    [
        (["nowhere"], "bundled: guitar-holding"),
        ([NAME, "-n", "0"], "--count: is 0; a positive number"),
        ([NAME, "--object", "jug"], "no bundled object of that name"),
        ([NAME, "--tilt", "z", "60"], "--tilt: is about z; x or y is needed, z points up"),
        ([NAME, "--loads", "none.json"], "none.json: no such file"),
        ([NAME, "--safety", "0"], "safety: is 0; a positive number"),
        ([NAME, "--torque-limit", "elbow=1"], "elbow"),
        ([NAME, "--report", "page.txt"], "ends in .html"),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], match: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["grasp", *arguments]) == 2
    said = capsys.readouterr().err
    assert match in said
    assert said.count("\n") == 1
