"""What `grasp` hands on of its options: the centre of mass, the pairs of links that may overlap."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from handfast import load_task
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.planning import grasp_for
from handfast.planning.question import link_pairs
from handfast.readers.load_body import load_body
from tests.support.program import complains, run

Ask = Callable[..., tuple[Body, dict[str, Any]]]
TASK = "scalpel-incision"


class Asked(Exception):
    """What a search was asked, in place of searching."""


@pytest.fixture
def asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[Body, dict[str, Any]]]:
    def note(task: Any, body: Body, loads: Any, **how: Any) -> None:
        raise Asked(body, how)

    monkeypatch.setattr(grasp_for, "grasp_for", note)

    def of(*options: str) -> tuple[Body, dict[str, Any]]:
        with pytest.raises(Asked, match=r"Body") as told:
            run(capsys, "grasp", TASK, *options)
        body, how = told.value.args
        return body, how

    return of


def test_the_centre_of_mass_goes_into_the_object(asked: Ask) -> None:
    body, _ = asked("--mass", "0.3", "--com", "0.01", "0", "-0.02")
    np.testing.assert_array_equal(body.center_of_mass, [0.01, 0, -0.02])
    assert body.mass == 0.3
    body, how = asked()
    np.testing.assert_array_equal(body.center_of_mass, load_body("scalpel").center_of_mass)
    assert how["options"].ignored == ()


def test_pairs_that_may_overlap_are_left_out_of_the_scene_and_stand_in_the_question(
    asked: Ask, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = ("ring_distal", "middle_distal")
    body, how = asked("--ignore-pair", *pair)
    assert how["options"].ignored == (pair,)
    monkeypatch.undo()
    questions = []

    def stop(work: Any, *_: Any) -> None:
        links = work.evaluator.task.hand.link_names
        judged = {frozenset((links[a], links[b])) for a, b in work.evaluator.collisions.scene.self_pairs}
        questions.append((frozenset(pair) in judged, grasp_for.question_of(work, body)))
        raise Asked(body)

    monkeypatch.setattr(grasp_for, "_TaskSearch", stop)
    for ignored in ((), (pair,), (pair[::-1],)):
        with pytest.raises(Asked):
            grasp_for.grasp_for(load_task(TASK), body, ignored=ignored)
    (before, first), (without, second), (turned, third) = questions
    assert (before, without, turned) == (True, False, False)
    assert first != second == third


def test_a_link_that_the_hand_does_not_have(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(InputError, match=r"ignored: unknown link 'thumb'; known: palm"):
        grasp_for.grasp_for(load_task(TASK), ignored=[("thumb", "palm")])
    complains(capsys, ["grasp", TASK, "--ignore-pair", "thumb", "palm"], ["unknown link 'thumb'"])


def test_a_pair_is_two_links_and_counts_once(capsys: pytest.CaptureFixture[str]) -> None:
    hand = load_task(TASK).hand
    assert link_pairs(hand, [("palm", "thumb_base"), ("thumb_base", "palm")]) == (("palm", "thumb_base"),)
    complains(capsys, ["grasp", TASK, "--ignore-pair", "palm", "palm"], ["palm with itself; two links are needed"])
