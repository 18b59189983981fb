"""A plan's proofs are replayed, and what was changed in one is found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast import load_body, load_hand
from handfast.core.answer import Verdict
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanLimits
from handfast.planning.results.plan import Plan
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
