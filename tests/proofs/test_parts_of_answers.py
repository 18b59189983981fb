"""Answers part by part, by hand: bounds and what they are to be shown for, what may be rounded, how proofs are told."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.proofs import answers, checker
from handfast.proofs.constants import END_TOLERANCE
from handfast.proofs.existence import Proved
from handfast.proofs.fields import EQUALITY_TOLERANCE, BadFile, Fields
from handfast.proofs.grasp import read_grasp
from handfast.proofs.question import CHECK, LARGEST_GOAL, SMALLEST_PRELOAD, TORQUES
from handfast.proofs.ranges import Known
from handfast.proofs.replay import Refused, Replay
from handfast.proofs.states import ContactMode
from tests.support.small_grasp import small_grasp

NEAR, OFF = 1 + 0.9 * EQUALITY_TOLERANCE, 1 + 1.1 * EQUALITY_TOLERANCE


@pytest.mark.parametrize(
    ("said", "shown", "same"),
    [
        (NEAR, 1.0, True), (OFF, 1.0, False), (2 - NEAR, 1.0, True), (2 - OFF, 1.0, False), (-OFF, -1.0, False),
        (1, 1.0, True), (True, 1.0, False), (1.0, True, False), (True, True, True), (True, False, False),
        (None, None, True), (None, 0.0, False), (0.0, None, False), ("a", "a", True), ("a", "b", False), (0, "", False),
        ([1.0, NEAR - 1], [1.0, 0.0], True),  # as a share of the largest
        ([1.0, OFF - 1], [1.0, 0.0], False),
        ([1.0], [1.0, 0.0], False), ((1.0, 2.0), [1.0, 2.0], True), (1.0, [1.0], False),
        ([], {}, False), ([], [], True),
        ({"a": [1e3], "b": 1e3 * (OFF - 1)}, {"a": [1e3], "b": 0.0}, False),
        ({"a": [1e3], "b": 1e3 * (NEAR - 1)}, {"a": (1e3,), "b": 0.0}, True),
        ({"a": 1.0, "b": 2.0}, {"a": 1.0}, False), ({}, {"a": 1.0}, False), ([1.0], {"a": 1.0}, False),
        ([{"a": 1e3, "b": OFF}], [{"a": 1e3, "b": 1.0}], False),  # of objects in a list key by key
        ([{"a": 1e3, "b": OFF}, {"b": 2.0}], [{"a": 1e3, "b": 1.0}, {"b": 2.0}], True),
        ([{"a": 1e3, "b": 1.0}, {"b": 2.0}], [{"a": 1e3, "b": 1.0}, {"a": 2.0}], False),
        ([{"a": 1.0}, 3], [{"a": 1.0}, {"a": 3.0}], False), ([{"a": 1.0}], [{"a": 1.0}] * 2, False),
        ({"a": 1.0}, [{"a": 1.0}], False), ([{"a": 2.0}], [{"a": 1.0}], False),
    ],
)  # fmt: skip
def test_what_is_the_same_but_for_rounding(said: Any, shown: Any, same: bool) -> None:
    assert answers.matches(said, shown) == same


def test_numbers_that_are_close_are_so_as_a_share_of_the_largest() -> None:
    b = np.array([-4.0, 1.0])
    for off, same in (([0, 4 * (NEAR - 1)], True), ([4 * (NEAR - 1), 0], True), ([0, -4 * (OFF - 1)], False)):
        assert answers.close(b + np.array(off), b) == same
    assert answers.close(np.zeros(2), np.zeros(2))
    assert answers.close(np.zeros(0), np.zeros(0))
    assert not answers.close(np.array([1e-300, 0.0]), np.zeros(2))


@pytest.mark.parametrize(
    ("key", "shown", "told", "fine"),
    [
        ("residual", 1e-3, 1e-3 + 0.9e-12, True),
        ("residual", 1e-3, 1e-3 + 1.1e-12, False),
        ("motion", 4.0, 4 * (1 + 0.9e-6), True),
        ("motion", 4.0, 4 * (1 - 1.1e-6), False),
        ("motion", 4.0, None, False),
        ("motion", None, 4.0, False),
        ("motion", 4.0, True, False),
        ("motion_cap", 4.0, 0.0, True),
        ("motion_cap", 4.0, -1e-300, False),
        ("motion_cap", 4.0, 4.1, False),
        ("motion_cap", None, 1.0, False),
        ("gap", 4.0, 3.9, False),
    ],
)
def test_what_an_answer_may_say_otherwise(key: str, shown: Any, told: Any, fine: bool) -> None:
    """Residuals and motions may be rounded, caps may be smaller."""
    if fine:
        answers.compare({key: told, "nodes": 3}, {key: shown}, ["nodes"])
    else:
        with pytest.raises(Refused, match=f"^{key} is not what the rest of the file shows$"):
            answers.compare({key: told, "nodes": 3}, {key: shown}, ["nodes"])
    with pytest.raises(Refused, match=r"^nodes is nothing that it can say; leave it out$"):
        answers.compare({key: told, "nodes": 3}, {key: shown}, [])
    with pytest.raises(Refused, match=f"^{key} is missing$"):
        answers.compare({}, {key: shown}, ["nodes"])


@pytest.mark.parametrize(
    ("exact", "tolerant", "fault", "refused_for", "claim"),
    [
        (True, False, "", "", "it holds, with virtual motions of 2.5 N"),
        (True, False, "too little", "too little", "it holds"),
        (False, True, "", "", "it holds, with virtual motions of 2.5 N, to 1e-9 of the load"),
        (False, True, "too little", "too little", "it holds, to 1e-9 of the load"),
        (False, False, "", "it is none", "it holds, to 1e-9 of the load"),
        (False, False, "too little", "it is none", "it holds, to 1e-9 of the load"),
    ],
)
def test_how_a_state_is_told(exact: bool, tolerant: bool, fault: str, refused_for: str, claim: str) -> None:
    found = Proved(exact, tolerant, "it is none", 1e-12, 0.5, 2.5)
    figures = {"residual": 1e-12, "exact": exact, "radius": 0.5, "motion": 2.5}
    assert answers.held("name", "it holds", found, fault) == Replay("name", claim, refused_for, figures)


@pytest.mark.parametrize(
    ("reason", "cap", "complete", "claim", "refused_for"),
    [
        ("", None, True, "none", ""),
        ("", 8.0, False, "none, up to virtual motions of 8 N", ""),
        ("", 8.0, True, "none, up to virtual motions of 8 N", "too near"),
        ("leaf 0", None, True, "none", "leaf 0"),
        ("leaf 0", 8.0, True, "none", "leaf 0"),
    ],
)
def test_how_a_refutation_is_told(
    reason: str, cap: float | None, complete: bool, claim: str, refused_for: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, asked = checker.Checked(not reason, 3, 0.25, reason, cap=cap), list[Any]()
    q = SimpleNamespace(homogeneous=False, has_scalar=True)
    c, motion = SimpleNamespace(question=q), np.ones(6)
    monkeypatch.setattr(checker, "verify", lambda given, to_the_end: found if given is c else None)

    def cap_fault(*args: Any) -> str:
        asked.append(args)
        return "too near"

    monkeypatch.setattr(answers, "cap_fault", cap_fault)
    figures = {"motion_cap": cap, "leaves": 3, "margin": 0.25}
    done = answers.refuted("none", c, 5.0, motion, complete)  # type: ignore[arg-type]
    assert done == Replay("certificate", claim, refused_for, figures)
    assert answers.motion_cap(done) == cap
    assert asked == [(q, 8.0, 5.0, motion)] * (complete and cap is not None and not reason)


@pytest.mark.parametrize(
    ("homogeneous", "has_scalar", "magnitude", "told"),
    [
        (True, True, 0.0, "8 N for each time of the direction"),
        (False, False, 0.0, "8 N for each time of the direction"),
        (True, True, 5.0, "40 N"),
        (False, True, 0.0, "8 N"),
        (False, False, None, "8 N"),
    ],
)
def test_where_nothing_is_resisted_a_cap_is_that_of_each_time_of_the_direction(
    homogeneous: bool, has_scalar: bool, magnitude: float | None, told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checker, "verify", lambda given, to_the_end: checker.Checked(True, 1, 0.5, "", cap=8.0))
    c = SimpleNamespace(question=SimpleNamespace(homogeneous=homogeneous, has_scalar=has_scalar))
    done = answers.refuted("none", c, magnitude, None, False)  # type: ignore[arg-type]
    assert done.claim == f"none, up to virtual motions of {told}"
    assert answers.motion_cap(done) == float(told.split()[0])


def of_answer(query: str, q: Any, **said: Any) -> answers.SavedAnswer:
    """An answer as far as its bounds are looked at."""
    return answers.SavedAnswer(q, {"query": query, "verdict": "holds", "stop": "complete"} | said, None, None)


@pytest.mark.parametrize(("value", "number"), [(1, 1.0), (2.5, 2.5), (None, None), (0, 0.0)])
def test_numbers_of_an_answer(value: Any, number: float | None) -> None:
    found = of_answer("max", None, lower=value).number("lower")
    assert found == number
    assert type(found) is type(number)
    assert of_answer("max", None).number("lower") is None
    for bad in (True, False, "1", [1.0]):
        with pytest.raises(Refused, match=re.escape(f"lower is {bad!r}, no number")):
            of_answer("max", None, lower=bad).number("lower")


TIMES = "times the direction is resisted"
ABOVE_4, NOTHING = f"nothing above 4 {TIMES}", "nothing is resisted"
ALONG = np.array([0, 2.0, 0, 0, 0, 0])
END = 100.0  # magnitudes up to here are looked at


def of_maximum(goal: str = LARGEST_GOAL, base: float = 0.0, **said: Any) -> answers.SavedAnswer:
    q = SimpleNamespace(
        goal=goal, has_scalar=goal != CHECK, homogeneous=goal == SMALLEST_PRELOAD, seeks_commands=False,
        wrench=base * ALONG if goal != CHECK else ALONG, direction=ALONG, torque_limits={}, force_limit=np.inf,
        grasp=SimpleNamespace(command=np.zeros(2), start=None), equivalent=SimpleNamespace(torque=np.zeros(2)),
    )  # fmt: skip
    return of_answer("max", q, **said)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ({"lower": 2.0, "upper": 4.0}, ""),
        ({"lower": None}, "a largest magnitude of None"),
        ({"lower": -1.0}, "a largest magnitude of -1.0"),
        ({"lower": 0.0}, "HOLDS without a magnitude that is resisted"),
        ({"lower": 0.0, "base": 1.0}, ""),
        ({"lower": 1.0, "verdict": "undecided"}, "UNDECIDED with a magnitude that is resisted"),
        ({"lower": 0.0, "verdict": "undecided"}, ""),
        ({"lower": 0.0, "verdict": "slips", "upper": 0.0}, ""),
        ({"lower": 0.0, "verdict": "slips", "upper": 1.0}, "SLIPS with bounds above 0"),
        ({"lower": 0.0, "verdict": "slips", "upper": None}, "SLIPS with bounds above 0"),
        ({"lower": END, "unbounded": True, "upper": END}, "unbounded, with a bound"),
        ({"lower": 0.0, "unbounded": True, "verdict": "undecided"}, "unbounded, with a bound"),
        ({"lower": END * (1 - 1.9e-6), "unbounded": True}, ""),
        ({"lower": END * (1 - 2.1e-6), "unbounded": True}, "unbounded, but shown up to 99.9998 only; 100 is needed"),
        ({"lower": 0.0, "unbounded": True}, "unbounded, but shown up to 0 only; 100 is needed"),
    ],
)
def test_bounds_that_contradict_the_verdict(said: dict[str, Any], why: str) -> None:
    saved_one = of_maximum(**said)
    if why:
        with pytest.raises(Refused, match=f"^{re.escape(why)}$"):
            answers.Maximum()._check_bounds(saved_one, END)
    else:
        answers.Maximum()._check_bounds(saved_one, END)


@pytest.mark.parametrize(
    ("goal", "said", "need"),
    [
        (LARGEST_GOAL, {"lower": 2.0, "upper": None}, None),
        (LARGEST_GOAL, {"lower": 2.0, "upper": 4.0}, (ABOVE_4, 4, (4, END))),
        (LARGEST_GOAL, {"lower": 4.0, "upper": 4.0}, (ABOVE_4, 4, (4, END))),
        (LARGEST_GOAL, {"lower": 2.0, "upper": 60.0}, (f"nothing above 60 {TIMES}", 60, (60, 120))),
        (LARGEST_GOAL, {"lower": 0.0, "upper": 0.0, "verdict": "slips"}, (NOTHING, 0, (0, END))),
        (SMALLEST_PRELOAD, {"lower": 2.0, "upper": 4.0}, (ABOVE_4, 4, (1 / END, 1 / 4))),
        (SMALLEST_PRELOAD, {"lower": 0.0, "upper": 0.0, "verdict": "slips"}, (NOTHING, 0, (1 / END, np.inf))),
        (CHECK, {"lower": 0.0, "upper": 0.0, "verdict": "slips"}, (NOTHING, 0, (0, 0))),
        (LARGEST_GOAL, {"lower": 4.5, "upper": 4.0}, "its lower bound 4.5 is above its upper bound 4"),
        (CHECK, {"lower": 2.0, "upper": 4.0}, "has an upper bound where magnitudes make no difference"),
    ],
)  # fmt: skip
def test_what_an_upper_bound_has_to_be_shown_for(
    goal: str, said: dict[str, Any], need: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From the bound to twice as far, and to the end of the search; of the smallest preload one over these."""
    ends = {CHECK: "as a direction"}
    monkeypatch.setattr(answers, "_with_direction", lambda _: "as a direction")
    monkeypatch.setattr(answers, "farthest", lambda q: END if q == ends.get(goal, q) else 0.0)
    if isinstance(need, str):
        with pytest.raises(Refused, match=f"^{re.escape(need)}$"):
            answers.Maximum().refuted(of_maximum(goal, **said))
        return
    found = answers.Maximum().refuted(of_maximum(goal, **said))
    if need is None:
        assert found is None
        return
    assert found is not None
    assert found[:2] == need[:2]
    np.testing.assert_allclose(found[2], need[2], rtol=3e-6)
    (lo, hi), (least, most) = found[2], need[2]
    first, last = (EQUALITY_TOLERANCE, END_TOLERANCE) if goal == LARGEST_GOAL else (END_TOLERANCE, EQUALITY_TOLERANCE)
    if goal != CHECK:  # and no more than that but for rounding
        assert lo == pytest.approx(least * (1 + first), rel=1e-12)
        assert hi == (most if most == np.inf else pytest.approx(most * (1 - last), rel=1e-12))


@pytest.mark.parametrize(
    ("said", "magnitude", "claim"),
    [
        (0.0, 0.0, "the base load is resisted"),
        (2.0, 2.0, "2 times the direction is resisted, or more"),
        (2.0, 2.5, "2 times the direction is resisted, or more"),
        (0.5, 0.5, "0.5 times the direction is resisted, or more"),
        (2.0, 1.9, ""),
        (2.0, -1.0, ""),
    ],
)
def test_the_state_of_a_maximum_reaches_what_is_said(said: float, magnitude: float, claim: str) -> None:
    saved_one = of_maximum(lower=said, base=3.0)
    w = SimpleNamespace(wrench=(3.0 + magnitude) * ALONG)
    if not claim:
        with pytest.raises(Refused, match=r"^witness: it is a state under another disturbance$"):
            answers.Maximum().held(saved_one, w)  # type: ignore[arg-type]
        return
    found = answers.Maximum().held(saved_one, w)  # type: ignore[arg-type]
    assert found[0] == claim
    assert found[1].tolist() == (3 * ALONG).tolist()
    assert found[2] is (ALONG if said else None)
    assert found[3] == pytest.approx(magnitude)
    assert found[4].tolist() == [0, 0]
    w.wrench = w.wrench + np.eye(6)[0] * 1e-3 if said else 4.0 * ALONG
    with pytest.raises(Refused, match="under another disturbance"):
        answers.Maximum().held(saved_one, w)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("magnitude", "fault"),
    [
        (None, ""),
        ((2.0, 2.0), ""),
        ((2.0, 2.0 + 1.9e-6), ""),
        ((2.0, 2.1), "at a magnitude of 2, not at 2"),
        ((2.1, 2.1), "at a magnitude of 2.1, not at 2"),
        ((1.9, 2.1), "from a magnitude of 1.9 on"),
    ],
)
def test_the_magnitude_that_is_proved_is_what_is_said(
    magnitude: tuple[float, float] | None, fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No less, and that of the load which the witness is said to be under, but for a millionth of it."""
    monkeypatch.setattr(answers, "size_of", lambda g, w: np.abs(w).max())
    monkeypatch.setattr(answers, "load_scale", lambda g, w: np.abs(w).max())
    monkeypatch.setattr(answers, "drives", lambda q: 0.5 * np.abs(ALONG).max())
    found, w = Proved(True, False, "", 0.0, magnitude=magnitude), SimpleNamespace(wrench=2.0 * ALONG)
    said = answers.Maximum().held_fault(of_maximum(lower=2.0), w, found)  # type: ignore[arg-type]
    assert said == (f"it is proved {fault}" if fault else "")
    assert answers.Maximum().least(of_maximum(lower=2.0)) == 2
    assert answers.Maximum().least(of_maximum()) == 0
    assert answers.Query().least(of_maximum(lower=2.0)) == -np.inf


@pytest.mark.parametrize(
    "change",
    [{"goal": SMALLEST_PRELOAD, "has_scalar": False}, {"torque_limits": {"a": 1.0}}, {"force_limit": 1.0},
     {"grasp": SimpleNamespace(command=np.array([0.0, 1.0]), start=None)},
     {"grasp": SimpleNamespace(command=np.zeros(2), start="pressed")},
     {"equivalent": SimpleNamespace(torque=np.array([1.0, 0]))},
     {"wrench": np.zeros(6)}, {"goal": TORQUES, "has_scalar": True, "seeks_commands": True}],
)  # fmt: skip
def test_where_magnitudes_make_no_difference_nothing_else_acts(change: dict[str, Any]) -> None:
    """A check of a load along a direction is a maximum without commands, given torques and limits alone."""
    fine = of_maximum(CHECK)
    base, along = answers.line(fine)
    assert (base.tolist(), along.tolist()) == ([0] * 6, ALONG.tolist())
    vars(fine.question).update(change)
    with pytest.raises(Refused, match=f"^is of a maximum, its question of '{fine.question.goal}'$"):
        answers.line(fine)


STAYS = "an actuator is commanded that was to stay locked, or a backdrivable one otherwise"


def of_torques(*, sums: bool = False, **said: Any) -> answers.SavedAnswer:
    """Three actuators, the first two sought, the first pulled in the other sense; the last is backdrivable."""
    g = SimpleNamespace(backdrivable=mask(0, 0, 1), command=np.array([-1.0, 0.5, 0.25]))
    q = SimpleNamespace(grasp=g, sought=mask(1, 1, 0), sums=sums, goal=TORQUES, wrench=ALONG, driven=("a", "b"))
    g.actuators = ("a", "b", "c")
    return of_answer("torques", q, **said)


def mask(*flags: int) -> np.ndarray:
    return np.array(flags, dtype=bool)


@pytest.mark.parametrize(
    ("command", "upper", "sums", "fault"),
    [
        ([-0.5, 3.0, 0.25], 3.0, False, ""),
        ([-0.5, 3.0, 0.25], 3.5, True, ""),
        ([-0.5, 0.25, 0.25], 0.5, False, ""),
        ([-0.5, 3.0, 0.25], 3.0 * NEAR, False, ""),
        ([-0.5, 3.0, 0.25], 3.0 * OFF, False, "its commands cost 3; the answer says 3.0000000033000003"),
        ([-0.5, 3.0, 0.25], None, False, "its commands cost 3; the answer says None"),
        ([-0.5, 3.0, 0.25], 3.0, True, "its commands cost 3.5; the answer says 3.0"),
        ([0.5, 3.0, 0.25], 3.0, False, "a command has the wrong sense"),
        ([-0.5, -3.0, 0.25], 3.0, False, "a command has the wrong sense"),
        ([0.0, 3.0, 0.25], 3.0, False, ""),
        ([-0.5, 3.0, 0.0], 3.0, False, STAYS),
    ],
)  # fmt: skip
def test_what_commands_cost(command: list[float], upper: float | None, sums: bool, fault: str) -> None:
    w = SimpleNamespace(command=np.array(command))
    assert answers.Torques().held_fault(of_torques(sums=sums, upper=upper), w, None) == fault  # type: ignore[arg-type]


def test_an_actuator_that_is_not_sought_stays_locked() -> None:
    one = of_torques(upper=0.5)
    one.question.sought = mask(1, 0, 0)
    for other, fault in ((0.0, ""), (1e-9, STAYS)):
        w = SimpleNamespace(command=np.array([-0.5, other, 0.25]))
        assert answers.Torques().held_fault(one, w, None) == fault  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("said", "need"),
    [
        ({"lower": 2.0, "upper": 2.0}, ("no commands below 2 suffice", 2, (0, 2))),
        ({"lower": 2.0, "upper": None}, ("no commands below 2 suffice", 2, (0, 2))),
        ({"lower": 0.0, "upper": 4.0}, None),
        ({"verdict": "slips", "lower": None, "upper": None}, ("no commands suffice", 0, (0, np.inf))),
        ({"verdict": "slips", "lower": 1.0, "upper": None}, "SLIPS with bounds"),
        ({"verdict": "slips", "lower": None, "upper": 1.0}, "SLIPS with bounds"),
        ({"lower": None, "upper": 1.0}, "a lower bound of None"),
        ({"lower": -1.0, "upper": 1.0}, "a lower bound of -1.0"),
        ({"lower": 2.0, "upper": 1.0}, "its lower bound 2 is above its upper bound 1"),
    ],
)
def test_what_a_bound_on_commands_has_to_be_shown_for(said: dict[str, Any], need: Any) -> None:
    if isinstance(need, str):
        with pytest.raises(Refused, match=f"^{re.escape(need)}$"):
            answers.Torques().refuted(of_torques(**said))
    else:
        assert answers.Torques().refuted(of_torques(**said)) == need
    back = of_torques(**said)
    back.question.sought = mask(1, 1, 1)
    with pytest.raises(Refused, match=r"^a backdrivable motor is sought: its command is given$"):
        answers.Torques().refuted(back)
    other = of_torques(**said)
    other.question.goal = "check"  # type: ignore[misc]
    with pytest.raises(Refused, match=r"^is of torques, its question of 'check'$"):
        answers.Torques().refuted(other)


def test_the_state_of_commands() -> None:
    w = SimpleNamespace(wrench=ALONG, command=np.array([-0.5, 3.0, 0.25]))
    for upper, claim in ((3.0, "commands of 3 suffice"), (None, "commands of 0 suffice")):
        found = answers.Torques().held(of_torques(upper=upper), w)  # type: ignore[arg-type]
        assert (found[0], found[1] is ALONG, found[2:4], found[4] is w.command) == (claim, True, (None, 0), True)
    w.wrench = 1.001 * ALONG
    with pytest.raises(Refused, match=r"^witness: it is a state under another disturbance$"):
        answers.Torques().held(of_torques(upper=3.0), w)  # type: ignore[arg-type]
    shown = answers.Torques().shown(replace(of_torques(lower=2.0, upper=3.0), witness=w), None)  # type: ignore[arg-type]
    assert shown == {"preload": {"a": -0.5, "b": 3.0}, "lower": 2, "upper": 3}
    assert answers.Torques().shown(of_torques(lower=2.0, upper=3.0), None) == {
        "preload": None,
        "lower": 2,
        "upper": None,
    }


@pytest.mark.parametrize(
    ("said", "gap"),
    [
        ({"lower": 2.0, "upper": 5.0}, 1.5),
        ({"lower": 0.0, "upper": 5.0}, None),
        ({"lower": 2.0, "upper": None}, None),
        ({"lower": 0.0, "upper": 0.0}, 0.0),
        ({"lower": 2.0, "upper": None, "unbounded": True}, 0.0),
    ],
)
def test_how_far_the_bounds_of_a_maximum_are_apart(said: dict[str, Any], gap: float | None) -> None:
    """Relative to the lower one. Nothing of an interval is told where it is not asked for."""
    shown = answers.Maximum().shown(of_maximum(**said), None)
    wanted = {"lower": said["lower"], "upper": said["upper"], "gap": gap, "unbounded": said.get("unbounded", False)}
    assert shown == wanted | {"holds_from_zero_to": None, "attained": True, "limit": None}
    assert type(shown["unbounded"]) is bool


def test_what_a_maximum_says_of_an_interval_and_of_a_limit() -> None:
    keys = {"holds_from_zero_upper": 4.5, "holes": [], "unproved": [[4.0, 4.5]], "resolution": 0.1}
    said: dict[str, Any] = {"lower": 2.0, "upper": 5.0, "holds_from_zero_to": 4.0} | keys
    shown = answers.Maximum().shown(of_maximum(**said), None)
    assert {key: shown[key] for key in keys} == keys
    for value, fine in ((2.0, True), (5.0, True), (5.0 * NEAR, True), (5.0 * OFF, False), (1.9, False), (3, False)):
        with_limit = of_maximum(**said, limit={"value": value})
        if fine:
            shown = answers.Maximum().shown(with_limit, None)
            assert (shown["attained"], shown["limit"]) == (False, {"value": value})
        else:
            with pytest.raises(Refused, match=r"^its limit lies outside of its bounds$"):
                answers.Maximum().shown(with_limit, None)
    for limit, upper in ((3.0, 5.0), ({"value": 3.0}, None)):
        with pytest.raises(Refused, match=r"^its limit lies outside of its bounds$"):
            answers.Maximum().shown(of_maximum(**said | {"upper": upper}, limit=limit), None)


# --- smaller magnitudes


def interval(**said: Any) -> answers.SavedAnswer:
    """What is said to hold from 0 on, with two arcs and a certificate."""
    told: dict[str, Any] = {
        "lower": 4.0,
        "upper": 5.0,
        "holds_from_zero_to": 2.0,
        "resolution": 0.1,
        "holes": [],
        "unproved": [],
    }
    arcs = SimpleNamespace(first=0.0, last=1.0), SimpleNamespace(first=1.0, last=2.0)
    found = of_maximum(**told | said)
    q: Any = found.question
    q.magnitudes = lambda scalar: (10 * scalar[0], 10 * scalar[1])
    q.claim = lambda scalar: f"none of {scalar[0]} to {scalar[1]}"
    certificate = SimpleNamespace(scalar=(0.3, 0.4))
    return replace(found, arcs=arcs, slips=(certificate,))  # type: ignore[arg-type]


@pytest.mark.parametrize("key", ["holds_from_zero_upper", "holes", "unproved"])
def test_nothing_is_said_of_an_interval_that_is_not_there(key: str) -> None:
    said: dict[str, Any] = {key: [[1.0, 2.0]]}
    with pytest.raises(Refused, match=r"^has holes, but does not say up to where everything is resisted$"):
        answers.Maximum().smaller(of_maximum(**said))
    none: dict[str, Any] = {key: [], "resolution": 0.1}
    assert answers.Maximum().smaller(of_maximum(**none)) == []
    for more in ({"arcs": interval().arcs}, {"slips": interval().slips}):
        with pytest.raises(Refused, match=r"^has states or certificates of smaller magnitudes, but claims nothing"):
            answers.Maximum().smaller(replace(of_maximum(), **more))


@pytest.mark.parametrize(
    "reasons",
    [
        ("", "of arcs", "of slips", "of ranges"),
        ("", "", "of slips", "of ranges"),
        ("", "", "", "of ranges"),
        ("first", "of arcs", "", ""),
        ("", "", "", ""),
    ],
)
def test_how_an_interval_is_told(reasons: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    one = interval(holes=[[1.0, 1.5], [1.75, 2]])
    of_arcs = {0.0: (reasons[0], 0.5), 1.0: (reasons[1], 0.25)}
    monkeypatch.setattr(answers.ranges, "replayed", lambda q, arc: of_arcs[arc.first] if q is one.question else None)
    monkeypatch.setattr(answers, "_slips_fault", lambda saved: reasons[2] if saved is one else None)
    monkeypatch.setattr(answers, "_ranges_fault", lambda saved, _: reasons[3] if len(_) == 2 and saved is one else None)
    claim = "everything up to 2 times the direction is resisted, nothing at 1 to 1.5, 1.75 to 2"
    claim += " but for 0.1 of the magnitude at the ends"
    figures = {"arcs": 2, "slips": 1, "residual": 0.5}
    (found,) = answers.Maximum().smaller(one)
    assert found == Replay(
        "interval", claim + ", to 1e-9 of load and commands", next(filter(None, reasons), ""), figures
    )
    bare = replace(interval(), arcs=())
    monkeypatch.setattr(answers, "_slips_fault", lambda _: "")
    monkeypatch.setattr(answers, "_ranges_fault", lambda *_: "")
    (found,) = answers.Maximum().smaller(bare)
    assert found.claim == "everything up to 2 times the direction is resisted, to 1e-9 of load and commands"
    assert found.figures == {"arcs": 0, "slips": 1, "residual": 0.0}


def test_where_nothing_holds_from_zero_on_nothing_is_said_to(monkeypatch: pytest.MonkeyPatch) -> None:
    """0 says that it is not shown of any magnitude, not that the base load is resisted."""
    monkeypatch.setattr(answers.ranges, "replayed", lambda q, arc: ("", 0.5))
    monkeypatch.setattr(answers, "_slips_fault", lambda _: "")
    monkeypatch.setattr(answers, "_ranges_fault", lambda *_: "")
    (found,) = answers.Maximum().smaller(interval(holds_from_zero_to=0.0))
    assert found.claim == "of magnitudes from 0 on nothing is said, to 1e-9 of load and commands"
    (found,) = answers.Maximum().smaller(interval(holds_from_zero_to=0.0, holes=[[0.0, 1 / 3]]))
    claim = "nothing at 0 to 0.333333 but for 0.1 of the magnitude at the ends, to 1e-9 of load and commands"
    assert found.claim == claim


def test_certificates_of_smaller_magnitudes_have_no_cap(monkeypatch: pytest.MonkeyPatch) -> None:
    for reason, cap, fault in (
        ("", None, ""),
        ("leaf 0", None, "none of 0.3 to 0.4: leaf 0"),
        ("", 8.0, "none of 0.3 to 0.4: proved up to virtual motions of 8 N only"),
    ):
        found = checker.Checked(not reason, 3, 0.25, reason, cap=cap)
        monkeypatch.setattr(checker, "verify", lambda c, f=found, **_: f if c.scalar == (0.3, 0.4) else None)
        assert answers._slips_fault(interval()) == fault


def test_what_is_said_of_smaller_magnitudes_is_what_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of arcs from 0 to 1 and 1 to 2, and a certificate of 3 to 4."""
    shown, asked = Known(2.0, 4.5, ((3.0, 4.0),), ((2.5, 3.0),)), list[Any]()

    def known(*args: Any) -> Known:
        asked.append(args)
        return shown

    monkeypatch.setattr(answers, "known", known)
    monkeypatch.setattr("handfast.proofs.tolerance.farthest", lambda q: 1e5)
    told: dict[str, Any] = {"holds_from_zero_upper": 4.5, "unproved": [[2.5, 3.0]]}
    one, holes = interval(**told), [(3.0, 4.0)]
    assert answers._ranges_fault(one, holes) == ""
    assert asked == [([(0, 1), (1, 2)], [(3, 4)], 4, 5, 0.1, 10)]
    others: list[dict[str, Any]] = [{"holds_from_zero_to": 2.5}, {"holds_from_zero_upper": None}, {"unproved": []}]
    for other in others:
        said = answers._ranges_fault(interval(**told | other), holes)
        assert said.startswith("it says Known(")
        assert said.endswith(f"; what is shown is {shown}")
    assert answers._ranges_fault(one, []).startswith("it says")
    assert answers._ranges_fault(interval(**told | {"lower": None, "upper": None}), holes) == ""
    assert asked[-1][2:4] == (0, np.inf)
    for bad in (None, 0.0, -1.0, 1.1):
        fault = f"its resolution is {bad}; a number above 0, of 1 at most, is needed"
        assert answers._ranges_fault(interval(**told | {"resolution": bad}), holes) == fault
    below = replace(one, slips=(*one.slips, SimpleNamespace(scalar=(-1.0, 0.0))))  # type: ignore[arg-type]
    assert answers._ranges_fault(below, holes) == "a certificate is about magnitudes below 0"
    twice = replace(one, arcs=(one.arcs[0], one.arcs[0]))
    assert answers._ranges_fault(twice, holes) == "an arc is there twice"

    def fails(*_: Any) -> Known:
        raise ValueError("they overlap")

    monkeypatch.setattr(answers, "known", fails)
    assert answers._ranges_fault(one, holes) == "they overlap"


def test_where_magnitudes_make_no_difference_the_bounds_are_all_that_is_said() -> None:
    told: dict[str, Any] = {"holds_from_zero_upper": 5.0, "goal": CHECK}
    with_arcs = interval(**told | {"holds_from_zero_to": 4.0})
    fault = "it has states or certificates where magnitudes make no difference"
    for less in ({"arcs": ()}, {"slips": ()}, {}):
        assert answers._ranges_fault(replace(with_arcs, **less), []) == fault  # type: ignore[arg-type]
    bare = replace(with_arcs, arcs=(), slips=())
    assert answers._ranges_fault(bare, []) == ""
    for bad in (-5.0, 0.0, 1e6):
        said = replace(bare, said=bare.said | {"resolution": bad})
        assert answers._ranges_fault(said, []) == f"its resolution is {bad}; a number above 0, of 1 at most, is needed"
    assert answers._ranges_fault(bare, [(1.0, 2.0)]).startswith("it says")
    none = {"lower": None, "upper": None, "holds_from_zero_to": None, "holds_from_zero_upper": None}
    assert answers._ranges_fault(replace(interval(**told | none), arcs=(), slips=()), []) == ""


@pytest.mark.parametrize(
    "value", [3, "none", [1.0], [[1.0]], [[1.0, 2.0, 3.0]], [(1.0, 2.0)], [[1.0, None]], [[1.0, True]], {}]
)
def test_what_is_no_list_of_ranges(value: Any) -> None:
    with pytest.raises(Refused, match=r"^holes is no list of pairs of numbers$"):
        answers._pairs(of_maximum(holes=value), "holes")
    for fine, pairs in (([[1, 2.5]], [(1.0, 2.5)]), ([], []), (None, [])):
        assert answers._pairs(of_maximum(holes=fine), "holes") == pairs


def test_a_witness_says_all_commands() -> None:
    q = SimpleNamespace(grasp=SimpleNamespace(actuators=("a", "b")))
    for command in ({"a": 1.0}, {"a": 1.0, "b": 1.0, "c": 1.0}):
        with pytest.raises(BadFile, match=r"^w\.command: are not those of the actuators a, b$"):
            answers._read_witness(Fields({"wrench": [0] * 6, "command": command}, "w"), q)  # type: ignore[arg-type]


# --- files, and the parts of a replay


def test_an_answer_is_read_with_all_its_proofs(monkeypatch: pytest.MonkeyPatch) -> None:
    said: dict[str, Any] = {"schema": "handfast/answer/1", "query": "max", "verdict": "holds", "stop": "time"}
    said |= {"seconds": 0.0, "nodes": 0, "verified": True, "lower": 2.0}
    data = {"schema": "handfast/result/1", "question": "of it", "answer": said, "witness": None, "certificate": None}
    monkeypatch.setattr(answers, "read_question", lambda x, place: (x, place))
    monkeypatch.setattr(answers.ranges, "read_arc", lambda f, q: (f.take("arc"), f.place, q))
    monkeypatch.setattr(answers, "read_certificate", lambda x, place, q: (x, place, q))
    monkeypatch.setattr(answers, "_read_witness", lambda f, q: (f.take("state"), f.place, q))
    q = ("of it", "file.question")
    found = answers.read_answer(data | {"arcs": [{"arc": 1}, {"arc": 2}], "slips": [3]}, "file")
    assert (found.question, found.said, found.witness, found.certificate) == (q, said, None, None)
    assert found.arcs == ((1, "file.arcs[0]", q), (2, "file.arcs[1]", q))
    assert found.slips == ((3, "file.slips[0]", q),)
    found = answers.read_answer(data | {"witness": {"state": 4}, "certificate": 5}, "file")
    assert (found.arcs, found.slips) == ((), ())
    assert (found.witness, found.certificate) == ((4, "file.witness", q), (5, "file.certificate", q))
    wrong = [("schema", "handfast/answer/0"), ("query", "hold"), ("verdict", "yes"), ("stop", "end"), ("seconds", -1.0)]
    for key, bad in [*wrong, ("nodes", -1), ("nodes", 0.5), ("verified", 1), ("verified", None)]:
        with pytest.raises(BadFile, match=rf"^file\.answer\.{key}: "):
            answers.read_answer(data | {"answer": said | {key: bad}}, "file")
        with pytest.raises(BadFile, match=rf"^file\.answer\.{key}: is missing"):
            answers.read_answer(data | {"answer": {k: x for k, x in said.items() if k != key}}, "file")
    with pytest.raises(BadFile, match=r"^file\.colour: is not a known field"):
        answers.read_answer(data | {"colour": "red"}, "file")


C, ROOT = SimpleNamespace(scalar=(0.5, 8.0)), SimpleNamespace(scalar=None)  # certificates


@pytest.mark.parametrize(
    ("query", "said", "need", "c", "claim", "complete"),
    [
        ("check", {"verdict": "slips", "stop": "time"}, ("none", 0.0, (0.0, 0.0)), ROOT, "none", True),
        ("max", {}, ("none", 4.0, (4.0, 8.0)), C, "none, up to 80 times the direction", True),
        ("max", {"stop": "time"}, ("none", 0.0, (0.5, 8.0)), C, "none, up to 80 times the direction", False),
        ("torques", {"stop": "time"}, ("none", 0.0, (0.5, 8.0)), C, "none", False),
        ("max", {}, ("none", 4.0, (0.4, 8.0)), C, "", True),
        ("max", {}, ("none", 4.0, (0.5, 8.1)), C, "", True),
        ("max", {}, ("none", 0.0, (0.0, 0.0)), ROOT, "none", True),
    ],
)  # fmt: skip
def test_what_a_certificate_is_held_against(
    query: str, said: dict[str, Any], need: Any, c: Any, claim: str, complete: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []

    def refuted(*args: Any) -> Replay:
        asked.append(args)
        return Replay("certificate", figures={"motion_cap": 7.0})

    monkeypatch.setattr(answers, "refuted", refuted)
    q, motion = SimpleNamespace(magnitudes=lambda scalar: (0.0, 10 * scalar[1])), np.ones(6)
    witness = SimpleNamespace(state=SimpleNamespace(motion=motion))
    for w, moved in ((None, None), (witness, motion)):
        one = replace(of_answer(query, q, **said), certificate=c, witness=w)  # type: ignore[arg-type]
        asked.clear()
        parts, cap = answers._certificate(one, SimpleNamespace(refuted=lambda _: need))  # type: ignore[arg-type]
        if claim:
            assert (parts[0].figures, cap) == ({"motion_cap": 7.0}, 7)
            assert asked == [(claim, c, None if query == "check" else need[1], moved, complete)]
        else:
            lo, hi = need[2]
            assert parts == [Replay("certificate", "none", f"it covers 0.5 to 8; the answer needs {lo:g} to {hi:g}")]
            assert (asked, cap) == ([], None)


def test_a_certificate_is_there_where_one_is_needed_and_nowhere_else() -> None:
    one, none = of_answer("check", None), SimpleNamespace(refuted=lambda _: None)
    assert answers._certificate(one, none) == ([], None)  # type: ignore[arg-type]
    with pytest.raises(Refused, match=r"^has a certificate, but claims nothing that needs one$"):
        answers._certificate(replace(one, certificate=C), none)  # type: ignore[arg-type]
    with pytest.raises(Refused, match=r"^the claim: no certificate$"):
        answers._certificate(one, SimpleNamespace(refuted=lambda _: ("the claim", 0.0, (0.0, 0.0))))  # type: ignore[arg-type]


def test_an_answer_is_refused_for_its_parts_first_then_for_what_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    bad, good, done = Replay("witness", "it holds", "no state"), Replay("certificate", "none"), list[Any]()
    query = SimpleNamespace(smaller=lambda _: [Replay("interval")])
    monkeypatch.setitem(answers.QUERIES, "max", query)

    def compare(saved: Any, asked: Any, proved: Any, cap: Any) -> None:
        assert asked is query
        done.append((proved, cap))
        if saved.said.get("lower"):
            raise Refused("lower is wrong")

    monkeypatch.setattr(answers, "_compare", compare)
    monkeypatch.setattr(answers, "_certificate", lambda saved, asked: ([good], 7.0) if saved and asked is query else 0)
    monkeypatch.setattr(answers, "_witness", lambda saved, asked: ("proved", good) if saved and asked is query else 0)
    one = of_answer("max", None)
    found = answers.replay(one)
    assert (found.claim, found.refused) == ("", "")
    assert (found.name, found.ok, [p.name for p in found.parts]) == (
        "max",
        True,
        ["certificate", "certificate", "interval"],
    )
    assert found.not_replayed == (answers.ANSWER_NOT_REPLAYED,)
    assert answers.replay(of_answer("max", None, limit={})).not_replayed[0] == answers.LIMIT_CLAIM
    found = answers.replay(of_answer("max", None, lower=3.0))
    assert found.reason == "answer: lower is wrong"
    assert done == [("proved", 7)] * 3
    unheld = of_answer("max", None, verdict="undecided")
    assert len(answers.replay(unheld).parts) == 2
    assert done[3:] == [(None, 7)]
    monkeypatch.setattr(answers, "_witness", lambda *_: ("proved", bad))
    assert answers.replay(one).reason == "witness: no state"
    assert answers.replay(replace(unheld, witness=1)).reason == "witness: no state"  # type: ignore[arg-type]
    assert len(done) == 4


def test_the_state_of_an_answer_is_that_of_its_commands(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, state = list[Any](), SimpleNamespace()
    w = SimpleNamespace(command=np.array([1.0, 2.0]), state=state)

    def prove(problem: Any, x: Any, least: float) -> Proved:
        asked.append((problem, x, least))
        return Proved(True, False, "", 1e-12, 0.5, 2.5)

    monkeypatch.setattr(answers, "prove", prove)
    monkeypatch.setattr(answers, "Problem", SimpleNamespace(of=lambda *args: args))
    query = SimpleNamespace(
        held=lambda saved, w: ("it holds", "base", "along", 4.0, np.array([1.0, 2.0])),
        least=lambda saved: 3.0, held_fault=lambda saved, w, found: "too little" if found.motion != 2.5 else "",
    )  # fmt: skip
    one = replace(of_answer("max", "of it"), witness=w)  # type: ignore[arg-type]
    found, part = answers._witness(one, query)  # type: ignore[arg-type]
    (problem, x, least), *_ = asked
    assert (problem[0], problem[2:], x is state, least) == ("of it", ("base", "along", 4.0), True, 3)
    assert problem[1].tolist() == [1, 2]
    assert found is not None
    assert (part.name, part.claim, part.ok) == ("witness", "it holds, with virtual motions of 2.5 N", True)
    w.command = np.array([1.0, 2.001])
    found, part = answers._witness(one, query)  # type: ignore[arg-type]
    assert (found, part) == (None, Replay("witness", "it holds", "it is a state with other commands"))
    with pytest.raises(Refused, match=r"^HOLDS without a witness$"):
        answers._witness(of_answer("max", None), query)  # type: ignore[arg-type]
    with pytest.raises(Refused, match=r"^SLIPS with a witness$"):
        answers._witness(replace(of_answer("max", None, verdict="slips"), witness=w), query)  # type: ignore[arg-type]


def test_a_check_says_that_its_load_is_held_or_not() -> None:
    g = SimpleNamespace(command="its own", start=None)
    q = SimpleNamespace(wrench=ALONG, goal=CHECK, grasp=g, claim=lambda _: "none")
    w, query = SimpleNamespace(wrench=ALONG * NEAR), answers.Query()
    held = query.held(of_answer("check", q), w)  # type: ignore[arg-type]
    assert held == ("the disturbance is resisted", ALONG, None, 0.0, "its own")
    g.start = "pressed"
    assert query.held(of_answer("check", q), w)[0] == "the disturbance is resisted from the state before"  # type: ignore[arg-type]
    w.wrench = ALONG * OFF
    with pytest.raises(Refused, match=r"^witness: it is a state under another disturbance$"):
        query.held(of_answer("check", q), w)  # type: ignore[arg-type]
    assert query.refuted(of_answer("check", q, verdict="slips")) == ("none", 0.0, (0.0, 0.0))
    assert query.refuted(of_answer("check", q)) is None
    q.goal = TORQUES
    with pytest.raises(Refused, match=r"^is of a check, its question of 'torques'$"):
        query.refuted(of_answer("check", q))
    assert query.held_fault(None, w, None) == ""  # type: ignore[arg-type]


def test_what_is_said_of_a_state_by_hand() -> None:
    """The object moves along x by 1. Contact 0, a soft finger of lever 1/2, has n, t1, t2 along z, y and -x.

    Its joints: turn moves it by 1/4 along t2 and turns it by 1/2 over the lever, slide moves it along t1 and contact 1
    against t2, roll moves contact 1 by 1/4 along t1 and t2.
    """
    g = read_grasp(small_grasp(), "g")
    x = SimpleNamespace(
        motion=np.eye(9)[0], r=np.eye(6)[0], q=np.array([0.0, 2.0, 3.0]), c=np.array([2.0, 3.0, 4.0, 1.0, 8.0, -4.0]),
        f=np.array([7.0, 8.0, 9.0]), torsion=np.array([0.25, 0.0]), reaction=np.array([4.0, 5.0, 6.0]),
    )  # fmt: skip
    modes = SimpleNamespace(contact=np.array([ContactMode.RUBS, ContactMode.TOUCHES]))
    names = {"link": "tip", "position": [0.5, 0, 0], "normal_force": 2, "friction_force": 5, "state": "slide"}
    first = names | {"force": [-4, 3, 2], "motion": [1, 0, 0], "torsion": 0.25}
    names = {"link": "", "position": [0, -0.25, 0.25], "normal_force": 1, "state": "open"}
    second = names | {"force": [-1, 4, -8], "motion": [1, 0, 0], "friction_force": pytest.approx(np.sqrt(80))}
    wanted = {
        "residual": 1e-12,
        "contacts": [first, second],
        "joint_torques": {"turn": 1.25, "slide": 7, "roll": 1},
        "actuator_forces": {"pull": 7, "push": 8, "back": 9},
        "object_motion": [1, 0, 0, 0, 0, 0],
        "joint_motion": {"turn": 0, "slide": 2, "roll": 3},
        "joint_reactions": {"turn": 4, "slide": 5, "roll": 6},
    }
    for exact, tolerant in ((True, False), (False, True)):
        proved = Proved(exact, tolerant, "", 1e-12, modes=modes)  # type: ignore[arg-type]
        assert answers.described(g, x, proved) == wanted  # type: ignore[arg-type]
    free = replace(
        g, friction=0 * g.friction, torque=0 * g.torque, stop=0 * g.stop, backdrivable=g.backdrivable & False
    )
    assert answers.described(free, x, proved).keys() == wanted.keys() - {"joint_reactions"}  # type: ignore[arg-type]
    none = answers.described(g, x, Proved(False, False, "", 1.0))  # type: ignore[arg-type]
    assert none == dict.fromkeys(wanted.keys() - {"joint_reactions"})


def test_of_a_check_nothing_but_its_state_is_told() -> None:
    assert answers.Query().shown(of_answer("check", SimpleNamespace(grasp=None)), None) == answers.UNPROVED_STATE | {
        "margin": None
    }


@pytest.mark.parametrize("proved", [None, Proved(False, True, "", 1e-12, 0.5, 2.5)])
def test_what_every_answer_says_is_compared(proved: Proved | None, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(answers, "compare", lambda *args: asked.append(args))
    own = {"schema": "handfast/answer/1", "query": "max", "verdict": "holds"}
    one = replace(of_answer("max", None, schema=own["schema"], lower=2.0), certificate=C)  # type: ignore[arg-type]
    query = SimpleNamespace(shown=lambda saved, found: {"lower": 3.0} if saved.said and found is proved else None)
    state = {"exact": None if proved is None else False, "motion": None if proved is None else 2.5}
    for saved, certified, cap in ((one, True, 7.0), (replace(one, certificate=None), False, None)):
        answers._compare(saved, query, proved, cap)  # type: ignore[arg-type]
        shown = own | state | {"certified": certified, "motion_cap": cap, "lower": 3.0}
        assert asked.pop() == (saved.said, shown, answers.COURSE_KEYS, None)


def test_of_a_check_its_state_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    proved, w = Proved(True, False, "", 0.0), SimpleNamespace(state="the state")
    monkeypatch.setattr(answers, "described", lambda *args: {"told": args})
    one = replace(of_answer("check", SimpleNamespace(grasp="its grasp")), witness=w)  # type: ignore[arg-type]
    assert answers.Query().shown(one, proved) == {"told": ("its grasp", "the state", proved), "margin": None}
    assert answers.Query().shown(one, None) == answers.UNPROVED_STATE | {"margin": None}
    assert answers.Query().shown(replace(one, witness=None), proved) == answers.UNPROVED_STATE | {"margin": None}


def test_a_witness_is_read_with_its_state(monkeypatch: pytest.MonkeyPatch) -> None:
    g = SimpleNamespace(actuators=("a", "b"), commands=lambda by_name, field: (by_name, field))
    monkeypatch.setattr(answers, "read_state", lambda f, of: (f.take("state"), of is g))
    data = {"wrench": [0, 1, 2, 3, 4, 5], "command": {"b": 1.0, "a": 2.0}, "state": 7}
    found = answers._read_witness(Fields(data, "w"), SimpleNamespace(grasp=g))  # type: ignore[arg-type]
    assert (found.wrench.tolist(), found.state) == ([0, 1, 2, 3, 4, 5], (7, True))
    assert found.command == ({"b": 1.0, "a": 2.0}, "w.command")
    with pytest.raises(BadFile, match=r"^w\.more: is not a known field"):
        answers._read_witness(Fields(data | {"more": 1}, "w"), SimpleNamespace(grasp=g))  # type: ignore[arg-type]


def test_how_far_magnitudes_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "farthest", lambda q: q)
    monkeypatch.setattr(answers, "_with_direction", lambda q: ("as a direction", q))
    for goal in (LARGEST_GOAL, CHECK):
        one = of_maximum(goal)
        wanted = one.question if goal == LARGEST_GOAL else ("as a direction", one.question)
        assert answers.Maximum()._end(one) == wanted
