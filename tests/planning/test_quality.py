"""What tells planned grasps apart: margin, fragility, largest command, clearance, what the dynamics engine holds."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.simulation_floor import pinch
from handfast import Verdict, check, load_body, load_hand, maximum, verify
from handfast.cli.plan import PlanGrasps
from handfast.core.errors import InputError
from handfast.planning.evaluation import attempt
from handfast.planning.evaluation import quality as measured
from handfast.planning.evaluation.attempt import Attempts, PlannedGrasp, Runner
from handfast.planning.evaluation.quality import GraspQuality, largest_command
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanOptions
from handfast.planning.ranking import best_first
from handfast.planning.results.plan import Plan
from handfast.planning.search import RejectionReason, Tally, UnitResult
from handfast.simulation.bodies import Bodies
from handfast.stability.problem.loads import Loads

SAFETY = 1.5


def test_a_safety_below_one_would_not_hold_the_loads_themselves() -> None:
    with pytest.raises(InputError, match=r"safety: is 0\.5: the loads themselves would not be held"):
        PlanOptions(safety=0.5)
    assert PlanOptions(safety=1.0).safety == 1.0


@pytest.fixture(scope="module")
def planned() -> Plan:
    hand, body = load_hand("barrett-bh8-280"), load_body("can")
    return plan(hand, body, count=2, seed=0, jobs=1, safety=SAFETY)


def test_a_margin_is_how_often_the_load_as_it_was_given_is_held(planned: Plan) -> None:
    given = Loads.gravity(planned.body)
    np.testing.assert_allclose(planned.loads.wrenches, SAFETY * given.wrenches)
    for g in planned.grasps:
        assert g.quality is not None
        least = {name: maximum(g.grasp, w).lower for name, w in given.by_name.items()}
        assert g.quality.margin == pytest.approx(min(least.values()), rel=0.02)
        assert least[g.quality.weakest] == pytest.approx(min(least.values()), rel=0.02)
        assert g.quality.margin >= SAFETY
        weakest = given.wrenches[given.names.index(g.quality.weakest)]
        assert check(g.grasp, 0.999 * g.quality.margin * weakest).verdict is Verdict.HOLDS


def test_margins_are_proved_with_the_loads(planned: Plan) -> None:
    (one, *_) = planned.grasps
    assert set(one.answer.margins) == set(planned.loads.names)
    assert planned.verify().ok


def quality(margin: float, *leans: str, clearance: float = 0.01) -> GraspQuality:
    return GraspQuality(margin, "down", leans, clearance)


def test_best_first_is_robust_then_margin_then_command(planned: Plan) -> None:
    def grasp(measured: GraspQuality | None, command: float) -> PlannedGrasp:
        (g, *_) = planned.grasps
        return replace(g, quality=measured, answer=replace(g.answer, upper=command))

    ranked = [
        grasp(quality(np.inf), 3.0),
        grasp(quality(2.0), 9.0),
        grasp(quality(1.504), 1.0),  # as good as the next, to 1 %
        grasp(quality(1.501), 2.0),
        grasp(quality(4.0, "tilt"), 1.0),
        grasp(None, 0.1),
    ]
    for order in ([5, 3, 1, 4, 2, 0], [2, 0, 5, 1, 3, 4]):
        assert best_first([ranked[k] for k in order]) == ranked


@pytest.mark.parametrize(
    ("every", "tried", "chosen", "left"),
    [(3, 6, [2, 5], [0, 1, 3, 4]), (5, 8, [4, 0], [1, 2, 3, 5, 6, 7]), (9, 8, [0, 1], [2, 3, 4, 5, 6, 7])],
)
def test_robust_grasps_are_sought_four_times_as_long_as_any(
    planned: Plan, monkeypatch: pytest.MonkeyPatch, every: int, tried: int, chosen: list[int], left: list[int]
) -> None:
    """Two are asked for, every start gives one, the last of `every` is robust."""
    (g, *_) = planned.grasps

    def run(_: Runner, number: int) -> UnitResult[PlannedGrasp]:
        pose = g.pose.copy()
        pose[0, 3] += 0.02 * number
        measured = quality(2.0) if number % every == every - 1 else quality(2.0, "motion")
        return UnitResult(Tally(1), (replace(g, index=number, pose=pose, quality=measured),))

    monkeypatch.setattr(Runner, "run", run)
    found = plan(planned.hand, planned.body, count=2, jobs=1)
    assert (found.tried, found.verdict, str(found.stop)) == (tried, Verdict.HOLDS, "complete")
    assert [g.index for g in found.grasps] == chosen
    assert sorted(g.index for g in found.others) == left


@pytest.mark.slow
def test_larger_commands_make_a_fragile_grasp_robust(monkeypatch: pytest.MonkeyPatch) -> None:
    hand, body = load_hand("barrett-bh8-280"), load_body("bottle")
    asked = Attempts(hand, body, Loads.gravity(body).scaled(SAFETY), PlanOptions(safety=SAFETY))
    (firm,) = Runner(asked).run(98).found
    monkeypatch.setattr(attempt, "FIRMER", ())
    (least,) = Runner(asked).run(98).found
    assert (firm.robust, least.robust) == (True, False)
    assert firm.answer.upper == pytest.approx(1.25 * least.answer.upper)
    assert firm.held.verify().ok
    for w in asked.loads.wrenches:
        assert check(firm.grasp, w).verdict is Verdict.HOLDS
    monkeypatch.setattr(attempt, "FIRMER", (1.25,))
    weak = replace(hand, strengths={name: 1.1 * abs(f) for name, f in least.grasp.preload.items()})
    (bounded,) = Runner(replace(asked, hand=weak)).run(98).found
    assert bounded.grasp.preload == least.grasp.preload  # beyond what the motors have


def test_what_was_made_firmer_is_asked_again_only_under_another_load(
    planned: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    (g, *_) = planned.grasps
    monkeypatch.setattr(measured, "leans_on", lambda answer, options, name: (name,))
    weakest = g.answer.weakest
    for known, leans in (("", (weakest,)), ("another", (weakest,)), (weakest, ())):
        assert measured.quality(g.answer, PlanOptions(), 0.01, known).leans_on == leans


@pytest.mark.slow
def test_plans_come_best_first_and_say_so_in_their_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    how = {"hand": "barrett-bh8-280", "object": "can", "count": 2, "jobs": 1, "output": folder}
    assert PlanGrasps(**how).run() == 0
    said = capsys.readouterr().out
    assert "1.5 times each of" in said
    assert "Best first: robust before fragile" in said
    data = json.loads((folder / "plan.json").read_text("utf-8"))
    assert data["safety"] == SAFETY
    order = [(e["fragile"], -round(e["margin"], 2), abs(e["largest_command"]["value"])) for e in data["grasps"]]
    assert order == sorted(order)
    for e in data["grasps"]:
        assert e["largest_command"]["unit"] == "N m"
        assert abs(e["largest_command"]["value"]) == max(map(abs, e["preload"].values()))
        held = json.loads((folder / e["hold_file"]).read_text("utf-8"))
        assert e["margin"] == pytest.approx(SAFETY * held["answer"]["margin"])
    assert verify(folder).ok
    data["grasps"][0]["margin"] *= 1.1
    (folder / "plan.json").write_text(json.dumps(data))
    assert "margin is" in verify(folder).reason


def test_the_unit_of_a_command_is_that_of_what_it_drives() -> None:
    slide = pinch(0.4)
    assert largest_command(slide) == {"actuator": "slide", "value": 1.0, "unit": "N"}
    assert largest_command(slide.with_preload(None))["actuator"] is None


def test_what_the_engine_lets_go_is_not_kept(planned: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    loads = Loads.gravity(planned.body, ["-z", "x"]).scaled(SAFETY)
    asked = replace(planned.asked, options=PlanOptions(safety=SAFETY, simulate=True))
    assert asked.question != planned.asked.question
    asked = replace(asked, loads=loads)
    monkeypatch.setattr(Runner, "measured", lambda _, g, *__: g)  # margins are not asked for
    runner = Runner(asked)
    index = planned.grasps[0].index
    kept = runner.run(index)
    assert [g.index for g in kept.found] == [index]
    heavy = Attempts(asked.hand, asked.body, asked.loads.scaled(20.0), asked.options)
    (g,) = kept.found
    shown = Bodies.of(asked.hand, g.q, asked.body, g.pose)
    assert not Runner(heavy).simulated(g.grasp, shown)
    monkeypatch.setattr(Runner, "simulated", lambda *_: False)
    assert runner.run(index).tally[RejectionReason.SIMULATED] == 1
