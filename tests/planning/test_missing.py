"""What is missing to discard a box of configurations: measured in another way, or known by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from handfast import Loads, grasp_for
from handfast.cli.grasp import balance_text, joined_text, missing_text, progress_text
from handfast.planning.joined_search import ContactSetSearch
from handfast.planning.missing import Missing, of_collision, of_contacts
from handfast.planning.no_balance import NoBalance
from handfast.proofs.discarded_boxes import Boxes
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.posed_boxes import OBJECT_LINK
from tests.support.holds import grip
from tests.support.joined_searches import LIGHT, joined, walled


def searched(gap: float, boxes: int) -> ContactSetSearch:
    """Of the left finger before a wall."""
    part = joined(grip(0.05), walled(gap)).sets[0]
    while part.boxes < boxes:
        part.step()
    return part


def test_of_a_collision_the_depth_that_is_missing() -> None:
    """At points, against depths of the solids themselves: 1 mm more than both balls, and inside both."""
    part = searched(0.012, 200)
    found, seen = part.collision.reason, set()
    for at in part.open[:3]:
        middle = np.repeat(at.box.mean(axis=1)[None, :, None], 2, axis=2)
        boxes = Boxes.of(part.contacts, middle, np.array([at.chart]))
        for claim in range(0, len(found), len(found) // 12):
            link, k, body, m = found.which[claim].tolist()
            assert body == OBJECT_LINK
            point = boxes.middle.seen(link, OBJECT_LINK, found.points[[claim]]).value.mid
            hand, thing = part.collision.sampled[link, k].shape, part.collision.sampled[OBJECT_LINK, m].shape
            own, deep = float(hand.depth(found.points[[claim]])[0]), float(thing.depth(point)[0])
            said = of_collision(found, boxes, claim, ["?"] * 9)
            assert said
            due = max(0.0, 1e-3 - own) - deep
            assert said.missing == pytest.approx(max(due, 0.0), abs=1e-8)
            assert said.near == float(due < 0)  # a point has no size
            seen.add(due < 0)
    assert seen == {True, False}


def conditions(middle: list[float], half: list[float], low: list[float], high: list[float]) -> Missing | None:
    """Of two contacts and one box of half width 1: each condition changes by its half as the one coordinate goes on."""
    rows, widths = np.array([middle]), np.array([half])
    away = Interval.between(-np.ones((1, 1)), np.ones((1, 1)))
    over = Dual(Interval.between(rows - widths, rows + widths), Interval.of(widths[None]))
    contacts = SimpleNamespace(low=np.array(low), high=np.array(high), task=SimpleNamespace(links=(0, 1)))
    parts = [SimpleNamespace(rows=at) for at in (over, Dual.constant(Interval.of(rows), 0))]
    return of_contacts(contacts, SimpleNamespace(over=parts[0], middle=parts[1], away=away))  # type: ignore[arg-type]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_of_contacts_the_way_that_is_missing(sign: float) -> None:
    """Places have to meet, a direction has to be 0.5 or more. The first place is off by d, and changes by 2 mm."""
    far, low, high = [1e-3, 1e-3], [0.0, 0, 0, 0.5], [0.0, 0, 0, np.inf]
    for d, missing, near in ((0.0, 2e-3, 0.0), (0.5e-3, 1.5e-3, 0.25), (1.5e-3, 0.5e-3, 0.75), (2.5e-3, 0.0, 1.0)):
        said = conditions([sign * d, 0, 0, 0.9], [2e-3, 3e-3, 3e-3, 0.1], low, high)
        assert said
        assert said.missing == pytest.approx(missing, abs=1e-12)
        assert said.near == pytest.approx(near, abs=1e-9)
    said = conditions([*far, 0.0, 0.4], [1.0, 1.0, 1.0, 0.2], low, high)  # the direction: 0.1 of 0.2, by 20 mm
    assert said
    assert (said.missing, said.near) == (pytest.approx(0.1 * 0.02), pytest.approx(0.5))
    assert conditions([*far, 0.0, 0.9], [1.0, 1.0, 1.0, 0.2], [-9.0] * 3 + [0.5], [9.0] * 3 + [1.2]) is None


def test_the_nearest_reason_comes_first_and_is_said() -> None:
    search = joined(grip(0.05), walled(0.012))
    search.run(300)
    told = search.searched
    assert told
    assert {m.reason for m in told.missing} == {"contacts", "collision"}
    assert [m.near for m in told.missing] == sorted((m.near for m in told.missing), reverse=True)
    assert told.missing[0].words in joined_text(told, grip(0.05))
    assert json.loads(json.dumps(told.to_json()))["missing"] == [m.to_json() for m in told.missing]
    largest = max(search.sets[0].open, key=lambda at: at.share)
    assert list(told.open.values()) == [tuple(side) for side in largest.box[: len(told.open)].tolist()]  # type: ignore[union-attr]


def test_where_a_set_is_given_up_is_said() -> None:
    """A configuration that no reason discards; what is missing there does not shrink with the box."""
    part = searched(0.05, 64)
    at = max(part.open, key=lambda at: at.share)
    part.stuck = at
    assert part.left is at
    part.stuck = None
    part.open = [replace(at, share=share) for share in (0.1, 0.3, 0.2)]
    assert part.left is part.open[1]
    part.open = []
    assert part.left is None
    assert part.missing == ()


def test_of_forces_alone_too() -> None:
    task = grip(0.05)
    search = NoBalance(task, Loads.wrench([0, 0, -0.5, 0, 0, 0]), 0.5, center=np.zeros(3), force_limits=0.6)
    assert search.searched.missing is None  # nothing was tried
    search._missing = lambda at: np.ones(len(at))  # type: ignore[method-assign]
    search.run(64)
    told = search.searched
    assert told.missing
    assert told.missing.reason == "balance"
    assert told.missing.words in balance_text(told)
    assert told.to_json()["missing"]["unit"] == "1"


def test_words() -> None:
    collision = Missing("collision", ("tip", "the object"), 4.2e-4, 0.62)
    assert collision.words == "tip 0.42 mm deeper in the object (or a box 0.62 times as wide)"
    assert collision.to_json()["unit"] == "m"
    slips = Missing("slips", (), 0.031, 0.0)
    assert slips.words == "3.1 % more work of the load against motors and contact forces (its middle lacks it, too)"
    assert "once it is looked at" in Missing("contacts", (), 0.0, 1.0).words
    assert missing_text() == missing_text(None) == ""
    assert missing_text(collision, slips) == f". What is missing to discard that: {collision.words}, or {slips.words}"


def test_an_undecided_answer_has_it_and_progress_says_how_far_the_proofs_are() -> None:
    answer = grasp_for(grip(0.05), walled(0.012), LIGHT, timeout=1.0, friction=0.8, jobs=1)
    if answer.joined is not None and not answer.joined.shown:
        assert answer.to_json()["joined"]["missing"]
    search, forces = joined(grip(0.05), walled(0.012)), NoBalance(grip(0.05), LIGHT, 0.5, center=np.zeros(3))
    search.run(300)
    told, none = search.searched, replace(forces.searched, boxes=4, discarded=0.5, balanced=None)
    said = progress_text(replace(answer, grasps=(), joined=told, balance=none))
    assert said.endswith(
        "judged; no forces at 50 % of the placements; 25 % of the configurations of left_finger discarded"
    )
    assert ";" not in progress_text(replace(answer, joined=None, balance=replace(none, balanced=np.zeros(4))))
