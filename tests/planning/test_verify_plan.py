"""A plan's proofs are replayed, and what was changed in one is found."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handfast import load_body, load_hand
from handfast.core.answer import Reach, Stop, Verdict
from handfast.core.errors import InputError
from handfast.geometry.scene import Scene
from handfast.model.grasp import Grasp
from handfast.planning.evaluation.attempt import Runner
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanLimits
from handfast.planning.results.folder import PlanFolder
from handfast.planning.results.plan import Plan
from handfast.planning.results.verify import touch_fault
from handfast.planning.search import RejectionReason
from handfast.saved import verify
from handfast.stability.problem.loads import Loads


@pytest.fixture(scope="module")
def planned() -> Plan:
    return plan(load_hand("barrett-bh8-280"), load_body("ball"), count=1, seed=1, jobs=1)


def reason(planned: Plan, **changed: object) -> str:
    """Why a plan is refused whose grasp was changed; '' if it is not."""
    (one,) = planned.grasps
    return replace(planned, grasps=(replace(one, **changed),)).verify().reason  # type: ignore[arg-type]


def test_every_grasp_and_every_load_is_replayed(planned: Plan) -> None:
    done = planned.verify()
    assert done.ok, done.reason
    assert [part.name for part in done.parts] == ["grasp 0"]
    loads = [f"{n}: the disturbance is resisted" for n in planned.loads.names]
    shown = [line.split(", with virtual motions of ")[0] for line in done.replayed[:-1] if ", margin: " not in line]
    assert [f"grasp 0: loads: {line}" for line in [f"one preload holds {len(loads)} loads", *loads]] == shown
    margins = [line for line in done.replayed if ", margin: " in line]
    assert all(any(f"loads: {n}, margin: " in line for line in margins) for n in planned.loads.names)
    assert done.replayed[-1] == "grasp 0: contacts, joints and mechanism are those of the hand on the object"
    assert any("what became of the other starts" in line for line in done.not_replayed)


def test_what_was_changed_is_refused(planned: Plan) -> None:
    (one,) = planned.grasps
    answer = one.answer
    first, *others = answer.checks
    assert first.witness is not None
    forces = replace(first.witness.state, c=1.01 * first.witness.state.c)
    forged = replace(first, found=replace(first.found, state=forces))
    changed = replace(one, answer=replace(answer, checks=(forged, *others)))
    loads = replace(planned, grasps=(changed,)).verify().parts[0].part("loads")
    assert loads is not None
    assert [part.name for part in loads.parts if not part.ok] == ["gravity +x"]
    assert "of the state that is proved is" in loads.parts[0].reason
    assert "grasp 0: loads: answer: gravity +x has no answer" in reason(planned, answer=replace(answer, checks=()))
    assert "undecided with a preload" in reason(planned, answer=replace(answer, verdict=Verdict.UNDECIDED))
    half = {n: f / 2 for n, f in one.grasp.preload.items()}
    assert "another preload" in reason(planned, grasp=one.grasp.with_preload(half))
    assert "another grasp" in reason(planned, grasp=one.grasp.with_friction(0.6))


def test_the_hand_has_to_make_the_grasp(planned: Plan) -> None:
    (one,) = planned.grasps
    bent = one.q.copy()
    bent[0] += 1e-3
    assert "of hand, configuration and question it is" in reason(planned, q=bent)
    raised = one.pose.copy()
    raised[2, 3] += 1e-3
    assert reason(planned, pose=raised)


def test_the_question_has_to_be_the_plans(planned: Plan) -> None:
    asked = planned.asked

    def said(**changed: object) -> str:
        return replace(planned, asked=replace(asked, **changed)).verify().reason  # type: ignore[arg-type]

    assert "other loads" in said(loads=Loads.gravity(planned.body, "-z"))
    assert "other limits" in said(options=replace(asked.options, limits=PlanLimits(force_limit=0.1)))
    assert "larger than allowed" in said(options=replace(asked.options, limits=PlanLimits(command_limit=1e-6)))
    moved = replace(planned.body, friction=0.4)
    assert "do not touch there so" in said(body=moved)


@pytest.mark.parametrize(("turned", "same"), [(2e-5, True), (3e-4, False)])
def test_normals_are_those_that_are_measured_but_for_their_rounding(planned: Plan, turned: float, same: bool) -> None:
    """Across a gap of 3 micrometres at a round handle they differ by 1e-6, by the last digits of the pose."""
    (one,) = planned.grasps
    first, *others = one.grasp.contacts
    aside = np.cross(first.normal, [0.3, -0.5, 0.8])
    off = replace(first, normal=first.normal + turned * aside / np.linalg.norm(aside))
    grasp = Grasp([off, *others], one.grasp.joints, one.grasp.mechanism)
    fault = touch_fault(Scene(planned.hand, planned.body), one.q, one.pose, grasp)
    assert (fault == "") == same
    assert same or "contact 0 of" in fault


def test_joints_have_to_be_within_the_hands_limits(planned: Plan) -> None:
    (one,) = planned.grasps
    hand = planned.hand
    k = hand.joint("finger_1_prox")
    short = replace(hand.joints[k], upper=float(one.q[k]) - 0.05)
    joints = (*hand.joints[:k], short, *hand.joints[k + 1 :])
    asked = replace(planned.asked, hand=replace(hand, joints=joints))
    assert "finger_1_prox: is" in replace(planned, asked=asked).verify().reason
    assert "its configuration has 3 joints, the hand 8" in reason(planned, q=one.q[:3])


def test_the_object_has_to_be_as_heavy_as_the_plans(planned: Plan) -> None:
    (one,) = planned.grasps
    heavy = one.grasp.about(mass=99.0)
    posed = [c.posed for c in one.answer.checks if c.posed]
    asked = [replace(p, source=replace(p.problem, grasp=heavy)) for p in posed]
    checks = tuple(replace(c, posed=p) for c, p in zip(one.answer.checks, asked, strict=True))
    assert "another mass" in reason(planned, grasp=heavy, answer=replace(one.answer, checks=checks, grasp=heavy))


def test_a_contact_off_the_object_is_found(planned: Plan) -> None:
    (one,) = planned.grasps
    turned = one.pose.copy()
    turned[:3, :3] = turned[:3, :3] @ np.diag([-1.0, -1.0, 1.0])
    assert reason(planned, pose=turned)


# --- how many contacts it takes -----------------------------------------------------------------------

BARRETT = "barrett-bh8-280"


def impossible(folder: Path, **changes: Any) -> Plan:
    """A plan for what cannot be held by so few contacts, and its folder."""
    body = load_body("can", friction=changes.pop("friction", None))
    loads = changes.pop("loads", Loads.gravity(body))
    made: PlanFolder = PlanFolder(folder, BARRETT, "can")
    return plan(load_hand(BARRETT), body, loads=loads, journal=made, jobs=1, **changes)


def test_what_so_few_contacts_cannot_hold_is_not_tried(tmp_path: Path) -> None:
    found = impossible(tmp_path, friction=0.0, contacts=3)
    assert (found.verdict, found.stop, found.tried, found.diagnosis) == (Reach.NONE, Stop.COMPLETE, 0, [])
    assert found.fewest_contacts.startswith("1 to 3 contacts on its surface cannot hold")
    assert found.verify().ok
    done = verify(tmp_path)
    assert done.ok, done.reason
    assert any("1 to 3 contacts" in line for line in done.replayed)
    four = plan(found.hand, found.body, contacts=4, attempts=2, jobs=1, give_up=1)
    assert four.verdict is Verdict.UNDECIDED
    assert four.fewest_contacts
    limits = PlanLimits(force_limit=1.0)
    assert impossible(tmp_path / "b", contacts=6, limits=limits).verdict is Reach.NONE
    turned = impossible(tmp_path / "c", friction=0.0, loads=Loads.wrench([0, 0, 0, 0, 0, 0.1]))
    assert turned.verdict is Reach.NONE
    assert turned.fewest_contacts.startswith("no number of contacts")


def test_it_has_to_be_the_question_of_the_plan(tmp_path: Path) -> None:
    impossible(tmp_path, friction=0.0, contacts=3)
    file = tmp_path / "contacts.json"
    said = json.loads(file.read_text("utf-8"))
    for changed in (
        {"friction": 0.0, "loads": {**said["loads"], "gravity +x": [1.0, 0, 0, 0, 0, 0]}},
        {"center_of_mass": [0, 0, 0.01]},
        {"object": "ball"},
        {"solids": [{"kind": "sphere", "size": [0.04]}]},
        {"contacts": 7},
    ):
        file.write_text(json.dumps(said | changed), "utf-8")
        assert not verify(tmp_path).ok, changed
    file.write_text(json.dumps(said), "utf-8")
    assert verify(tmp_path).ok
    entry = json.loads((tmp_path / "plan.json").read_text("utf-8"))
    (tmp_path / "plan.json").write_text(json.dumps(entry | {"contacts_file": "../contacts.json"}), "utf-8")
    with pytest.raises(InputError, match="a file of the folder is needed"):
        verify(tmp_path)


@pytest.mark.slow
def test_grasps_have_no_more_contacts_than_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Runner, "measured", lambda _, g, *__: g)  # margins are not asked for
    hand, body = load_hand(BARRETT), load_body("ball")
    any_number = plan(hand, body, attempts=8, count=8, seed=1, jobs=1)
    most = min(g.grasp.m for g in any_number.grasps)
    found = plan(hand, body, attempts=8, count=8, seed=1, jobs=1, contacts=most)
    assert {g.index for g in found.grasps} == {g.index for g in any_number.grasps if g.grasp.m <= most}
    assert found.tally[RejectionReason.MANY] >= len(any_number.grasps) - len(found.grasps)
    with pytest.raises(InputError, match="positive"):
        plan(hand, body, contacts=0)
