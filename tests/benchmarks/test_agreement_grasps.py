"""The questions of the agreement study: promised numbers, one fixed order, what is missing is said."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks.agreement_grasps import SIZES, Question, lawful_case, questions
from benchmarks.closed_grasps import CHOSEN, ClosedHands
from benchmarks.grasps import presses, pressing
from benchmarks.simulation_agreement import RESULTS

NOWHERE = ClosedHands(Path("nowhere"), Path("nowhere"))


@pytest.fixture(scope="module")
def asked() -> list[Question]:
    return questions(NOWHERE)


@pytest.mark.slow
def test_more_than_a_thousand_questions_have_names_of_their_own(asked: list[Question]) -> None:
    names = [q.name for q in asked]

    assert len(set(names)) == len(names) > 1000
    assert {q.family for q in asked} >= {"bundled", "random", "random, laws", *(f"closed {n}" for n in CHOSEN)}
    assert [q.name for q in questions(NOWHERE)] == names
    first = names[: len(names) // 4]  # shuffled: every hand is among the first quarter
    assert all(any(n.startswith(f"closed {hand}") for n in first) for hand in CHOSEN)


def test_answers_that_are_kept_are_to_questions_that_are_asked(asked: list[Question]) -> None:
    known = {q.name: q for q in asked}

    for name, answer in json.loads(RESULTS.read_text())["questions"].items():
        assert known[name].family == answer["family"]


def test_hands_and_objects_that_are_not_there_are_named(asked: list[Question]) -> None:
    missing = {q.missing for q in asked if q.missing}

    assert {"hand allegro", "hand shadow", "hand adroit", "object mustard_bottle"} <= missing
    assert not any("barrett" in m or "sah" in m for m in missing)


@pytest.mark.parametrize("hand", ["barrett", "sah"])
def test_bundled_hands_close_to_grasps_that_press(asked: list[Question], hand: str) -> None:
    question = next(q for q in asked if q.family == f"closed {hand}" and not q.missing)
    grasp, direction = question.made()

    assert grasp.m in SIZES
    assert pressing(grasp, 0.99) is not None  # commands are rounded
    assert direction[:3] @ direction[:3] == pytest.approx(1.0)


def test_lawful_fingers_press_through_their_laws() -> None:
    """Without what its joints carry, a finger whose tendon bends two joints presses nothing."""
    case = lawful_case(4, 1)
    tendons = [lawful_case(m, 0).grasp.mechanism.tendon for m in (4, 6, 8)]

    assert presses(case.grasp)
    assert all(j.friction >= 0 for j in case.grasp.joints)
    assert any(j.friction for j in case.grasp.joints)
    assert any(map(any, tendons))
