"""Questions and certificates as they are made: what is kept, what is refused, where the unknowns are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.stability.certify.certificate import MAX_ETA, TURN, Certificate, Columns, Question, Row, directions
from handfast.stability.goal import (
    ANY_STATE,
    LARGEST,
    SMALLEST_LARGEST_COMMAND,
    SMALLEST_PRELOAD,
    SMALLEST_SUM_OF_COMMANDS,
)
from tests.support.certificates import empty
from tests.support.problems import pinch
from tests.support.rounding_edges import BOTH, QUESTIONS, D, W, hand

# --- questions -------------------------------------------------------------------------------------------------


def test_a_question_keeps_what_it_was_given() -> None:
    """As floats, in arrays and a dictionary of its own."""
    limits, wrench = {"m": 2, "t": 1}, W.copy()
    q = Question(hand(), LARGEST, wrench, D.copy(), torque_limits=limits, force_limit=3.0)
    limits["m"], wrench[0] = 7, 99.0
    assert q.torque_limits == {"m": 2.0, "t": 1.0}
    assert {type(v) for v in q.torque_limits.values()} == {float}
    assert q.wrench.tolist() == W.tolist()
    assert q.direction is not None
    assert q.direction.tolist() == D.tolist()
    for array in (q.wrench, q.direction):
        assert array.dtype == np.float64
        assert not array.flags.writeable
    assert Question(hand(), SMALLEST_LARGEST_COMMAND, W, driven=list(BOTH)).driven == BOTH
    plain = Question(hand())
    assert (plain.goal, plain.direction, plain.eta, plain.mdp, plain.force_limit) == (ANY_STATE, None, 0.0, True, None)
    assert (plain.wrench.tolist(), plain.torque_limits, plain.driven) == ([0.0] * 6, {}, ())


@pytest.mark.parametrize(
    ("given", "field", "words"),
    [
        ({"wrench": [1.0, 2.0]}, "wrench", "shape"),
        ({"wrench": [np.nan] * 6}, "wrench", "finite"),
        ({"direction": D}, "direction", "has no meaning where the goal is 'check'"),
        ({"goal": LARGEST}, "direction", "is needed where the goal is 'largest'"),
        ({"goal": LARGEST, "direction": D[:5]}, "direction", "shape"),
        ({"eta": -1e-9}, "eta", r"is -1e-09 rad; 0 to 0\.7854 is possible"),
        ({"eta": MAX_ETA}, "eta", "is possible"),
        ({"eta": np.nan}, "eta", "is possible"),
        ({"eta": 0.1, "mdp": False}, "eta", "needs the maximum dissipation principle"),
        ({"torque_limits": {"x": 1.0}}, "torque_limits", "unknown actuator 'x'"),
        ({"torque_limits": {"m": 0.0}}, "torque_limits, force_limit", "a limit is positive and finite"),
        ({"torque_limits": {"m": -1.0, "t": 1.0}}, "torque_limits, force_limit", "a limit is positive and finite"),
        ({"torque_limits": {"m": np.inf}}, "torque_limits.m", "finite"),
        ({"force_limit": 0.0}, "torque_limits, force_limit", "a limit is positive and finite"),
        ({"force_limit": np.inf}, "torque_limits, force_limit", "a limit is positive and finite"),
        ({"force_limit": np.nan}, "torque_limits, force_limit", "a limit is positive and finite"),
        ({"goal": SMALLEST_PRELOAD, "direction": D, "wrench": W}, "goal", "knows no base load and no limits"),
        ({"goal": SMALLEST_PRELOAD, "direction": D, "force_limit": 1.0}, "goal", "knows no base load and no limits"),
        ({"goal": SMALLEST_PRELOAD, "direction": D, "torque_limits": {"m": 1.0}}, "goal", "knows no base load"),
        ({"driven": ("m",)}, "driven", "have no meaning where the goal is 'check'"),
        ({"goal": SMALLEST_LARGEST_COMMAND, "driven": ("x",)}, "driven", "unknown actuator 'x'"),
    ],
)
def test_what_is_no_question(given: dict[str, Any], field: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as fault:
        Question(hand(), **given)
    assert str(fault.value).startswith(f"{field}: ")


def test_what_is_a_question_just_so() -> None:
    assert Question(hand(), eta=float(np.nextafter(MAX_ETA, 0.0))).eta < np.pi / 4
    assert Question(hand(), eta=0.0, mdp=False).mdp is False
    assert Question(hand(), force_limit=1e-300, torque_limits={"m": 1e-300}).force_limit == 1e-300
    assert Question(hand(), SMALLEST_LARGEST_COMMAND, W, driven=()).driven == ()


def test_what_follows_from_a_question() -> None:
    """Which actuators are driven, may move, and are counted the other way."""
    check, driven = Question(hand(-1.0), wrench=W), Question(hand(-1.0), SMALLEST_LARGEST_COMMAND, W, driven=BOTH)
    assert check.is_driven.tolist() == [False] * 3
    assert driven.is_driven.tolist() == [True, True, False]
    assert check.is_driven.dtype == driven.is_driven.dtype == np.dtype(bool)
    assert check.may_move.tolist() == [True, False, True]
    assert driven.may_move.tolist() == [True, True, True]
    assert check.sense.tolist() == [-1.0, 1.0, 1.0]
    assert driven.sense.tolist() == [-1.0, 1.0, 1.0]
    assert Question(hand(-1.0), SMALLEST_LARGEST_COMMAND, W, driven=("n",)).sense.tolist() == [1.0] * 3
    assert Question(hand(), wrench=W).sense.tolist() == [1.0] * 3


@pytest.mark.parametrize("name", QUESTIONS)
def test_where_the_unknowns_are(name: str) -> None:
    """r (6), q (3), c (9), f (3), one coupling; then the scalar of what is sought, and efforts if they are summed."""
    at = Columns.of(QUESTIONS[name][0])
    sought, efforts = int(name != "check" and name != "turned"), 3 * (name == "sum")
    parts = [(p.start, p.stop) for p in (at.r, at.q, at.c, at.f, at.coupling, at.scalar, at.e)]
    end = 22 + sought
    assert parts == [(0, 6), (6, 9), (9, 18), (18, 21), (21, 22), (22, end), (end, end + efforts)]
    assert at.n == end + efforts


def test_directions_turn_exactly() -> None:
    quarter = TURN // 4
    k = np.array([0, quarter, 2 * quarter, 3 * quarter, TURN, -quarter])
    np.testing.assert_array_equal(directions(k), [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 0], [0, -1]])
    eighth = directions(np.array([TURN // 8, TURN // 8 + quarter, TURN // 12]))
    np.testing.assert_allclose(eighth, [[0.5**0.5, 0.5**0.5], [-(0.5**0.5), 0.5**0.5], [0.75**0.5, 0.5]], atol=1e-6)
    np.testing.assert_allclose(eighth[:2], [[0.5**0.5, 0.5**0.5], [-(0.5**0.5), 0.5**0.5]], atol=1e-15)


# --- certificates ----------------------------------------------------------------------------------------------

ROWS = [(Row.CN_UP, 0, 1, 2), (Row.CN_DOWN, 1, 3, 4), (Row.TANGENT, 0, 5, 6)]


def plain(question: Question | None = None, scalar: Any = None, **more: Any) -> Certificate:
    return empty(question or Question(pinch()), scalar, ROWS, [0.5, 0.25, 0.125], **more)


def test_a_certificate_keeps_arrays_of_its_own() -> None:
    c = plain()
    assert c.references.shape == (0, 3)
    for name in ("parent", "part", "state", "left", "right", "leaves", "start", "kind", "index", "a", "b"):
        assert getattr(c, name).dtype == np.int64, name
        assert not getattr(c, name).flags.writeable
    assert (c.multiplier.dtype, c.multiplier.flags.writeable) == (np.float64, False)
    assert (c.capped, c.cap_r, c.cap_q) == (False, None, None)
    kind = np.array([0, 1, 5])
    other = replace(c, kind=kind, references=[[1, 2, 3]])
    kind[0] = 9
    assert other.kind.tolist() == [0, 1, 5]
    assert other.references.tolist() == [[1.0, 2.0, 3.0]]
    assert not other.references.flags.writeable
    capped = plain(caps=([1, 2, 3, 4, 5, 0], [0, 2]))
    assert capped.capped
    assert (capped.cap_r.tolist(), capped.cap_q.tolist()) == ([1.0, 2.0, 3.0, 4.0, 5.0, 0.0], [0.0, 2.0])
    assert not capped.cap_r.flags.writeable
    assert not capped.cap_q.flags.writeable


@pytest.mark.parametrize("name", ["parent", "state", "leaves", "kind", "index", "a", "b"])
def test_whole_numbers_have_an_end(name: str) -> None:
    """-2^31 to 2^31 - 1."""
    c = plain()
    for size, fits in ((2**31 - 1, True), (2**31, False), (-(2**31), True), (-(2**31) - 1, False)):
        value = getattr(c, name).copy()
        value[0] = size
        if fits:
            assert getattr(replace(c, **{name: value}), name)[0] == size
        else:
            with pytest.raises(InputError, match=rf"^{name}: has a number beyond 2\^31"):
                replace(c, **{name: value})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"part": [0, 0]}, r"^part: has shape \(2,\), needs \(1,\)"),
        ({"right": []}, r"^right: has shape \(0,\), needs \(1,\)"),
        ({"leaves": [[0]]}, r"^leaves: has shape \(1, 1\), needs \(1,\)"),
        ({"leaves": [0, 0]}, r"^start: has shape \(2,\), needs \(3,\)"),
        ({"index": [0]}, r"^index: has shape \(1,\), needs \(3,\)"),
        ({"multiplier": [1.0] * 4}, r"^multiplier: has shape \(4,\), needs \(3,\)"),
        ({"start": [0, 2]}, "^start: must rise from 0 to the number of rows, 3"),
        ({"start": [1, 3]}, "^start: must rise from 0 to the number of rows, 3"),
        ({"leaves": [0, 0], "start": [0, 4, 3]}, "^start: must rise from 0"),
        ({"leaves": [0, 0], "start": [0, -1, 3]}, "^start: must rise from 0"),
        ({"references": [[1.0, 2.0]]}, "^references: has shape"),
        ({"references": [[1.0, 2.0, np.inf]]}, "^references"),
        ({"cap_r": np.ones(6)}, "^cap_r, cap_q: caps are of all motions, or of none"),
        ({"cap_q": np.ones(2)}, "^cap_r, cap_q: caps are of all motions, or of none"),
        ({"cap_r": np.ones(6), "cap_q": np.ones(3)}, "^cap_q: has shape"),
        ({"cap_r": np.ones(5), "cap_q": np.ones(2)}, "^cap_r: has shape"),
        ({"cap_r": np.ones(6), "cap_q": [1.0, -1e-300]}, "^cap_q: is negative; a cap is 0 or more"),
        ({"cap_r": [0.0] * 5 + [-1.0], "cap_q": np.ones(2)}, "^cap_r: is negative; a cap is 0 or more"),
        ({"cap_r": [np.inf] * 6, "cap_q": np.ones(2)}, "^cap_r"),
        ({"scalar": (0.0, 1.0)}, "^scalar: is the range of the goal's scalar; null for a check"),
    ],
)
def test_what_is_no_certificate(change: dict[str, Any], said: str) -> None:
    given = {k: np.array(v) if k not in ("scalar", "references") else v for k, v in change.items()}
    with pytest.raises(InputError, match=said):
        replace(plain(), **given)
    none = np.zeros(0, dtype=np.int64)
    with pytest.raises(InputError, match=r"^parent: is empty; the root at least is needed"):
        replace(plain(), **dict.fromkeys(("parent", "part", "state", "left", "right"), none))


def test_a_leaf_may_have_no_rows() -> None:
    c = replace(plain(), leaves=np.array([0, 0, 0]), start=np.array([0, 0, 3, 3]))
    assert np.diff(c.start).tolist() == [0, 3, 0]


@pytest.mark.parametrize(
    ("goal", "scalar", "capped", "fits"),
    [
        ("preload", (0.0, 1.0), False, True),
        ("preload", (0.0, 0.0), False, True),
        ("preload", (0.0, np.inf), False, True),
        ("preload", (0.0, np.inf), True, False),
        ("preload", (0.0, 1.0), True, True),
        ("preload", (1.0, 0.5), False, False),
        ("preload", (-0.5, 1.0), False, False),
        ("largest", (-0.5, 1.0), False, True),
        ("largest", (-np.inf, 1.0), False, False),
        ("largest", (np.nan, 1.0), False, False),
        ("largest", (0.0, np.nan), False, False),
        ("sum", (-1e-300, 1.0), False, False),
    ],
)
def test_ranges_of_the_scalar(goal: str, scalar: tuple[float, float], capped: bool, fits: bool) -> None:
    question, given = (
        {
            "preload": Question(pinch(), SMALLEST_PRELOAD, direction=D),
            "largest": Question(pinch(), LARGEST, W, D),
            "sum": Question(pinch(), SMALLEST_SUM_OF_COMMANDS, W, driven=("left",)),
        }[goal],
        {"caps": (np.ones(6), np.ones(2))} if capped else {},
    )
    if fits:
        c = plain(question, [int(x) if np.isfinite(x) and x == int(x) else x for x in scalar], **given)
        assert c.scalar == scalar
        assert [type(x) for x in c.scalar] == [float, float]
        return
    with pytest.raises(InputError, match=r"^scalar: is .* to .*, not a range that the goal knows"):
        plain(question, scalar, **given)


def test_a_goal_with_a_scalar_needs_its_range() -> None:
    with pytest.raises(InputError, match=r"^scalar: is the range of the goal's scalar; null for a check"):
        plain(Question(pinch(), LARGEST, W, D))


def test_some_of_the_leaves() -> None:
    """In the order that is asked, with their rows, and all nodes."""
    c = replace(plain(), leaves=np.array([7, 8, 9]), start=np.array([0, 1, 1, 3]))
    for chosen, kinds, start in (
        ([0, 1, 2], [0, 1, 5], [0, 1, 1, 3]),
        ([2, 0], [1, 5, 0], [0, 2, 3]),
        ([2, 1, 2], [1, 5, 1, 5], [0, 2, 2, 4]),
        ([1], [], [0, 0]),
        ([], [], [0]),
    ):
        some = c.some(np.array(chosen, dtype=np.int64))
        assert some.leaves.tolist() == [7 + k for k in chosen]
        assert (some.kind.tolist(), some.start.tolist()) == (kinds, start)
        for name in ("index", "a", "b", "multiplier"):
            of_kind = dict(zip(c.kind.tolist(), getattr(c, name).tolist(), strict=True))
            assert getattr(some, name).tolist() == [of_kind[k] for k in kinds]
        assert some.parent.tolist() == c.parent.tolist()
