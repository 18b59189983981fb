"""What of an answer was replayed, made of parts."""

from __future__ import annotations

import math

from handfast.proofs.replay import Refused, Replay, down, up

GOOD, BAD = Replay("good", "it holds"), Replay("bad", "it slips", "a leaf is open")


def test_defaults() -> None:
    bare = Replay("name")
    assert (bare.claim, bare.refused, dict(bare.figures), bare.parts, bare.not_replayed) == ("", "", {}, (), ())
    assert bare.ok
    assert bare.reason == ""
    assert bare.replayed == ()
    assert issubclass(Refused, Exception)


def test_reasons() -> None:
    assert (GOOD.ok, GOOD.reason) == (True, "")
    assert (BAD.ok, BAD.reason) == (False, "a leaf is open")
    assert Replay("all", parts=(GOOD, BAD)).reason == "bad: a leaf is open"
    assert not Replay("all", parts=(GOOD, BAD)).ok
    assert Replay("all", parts=(GOOD, GOOD)).ok
    first = Replay("first", refused="x")
    assert Replay("all", parts=(first, BAD)).reason == "first: x"
    assert Replay("all", refused="own", parts=(BAD,)).reason == "own"
    assert Replay("top", parts=(GOOD, Replay("all", parts=(BAD,)))).reason == "all: bad: a leaf is open"


def test_parts_by_name() -> None:
    both = Replay("all", parts=(GOOD, BAD))
    assert both.part("bad") is BAD
    assert both.part("good") is GOOD
    assert both.part("all") is None


def test_claims_that_are_proved() -> None:
    inner = Replay("inner", "both", parts=(GOOD, BAD))
    assert GOOD.replayed == ("it holds",)
    assert BAD.replayed == ()
    assert inner.replayed == ("both", "it holds")
    # the name of a part that has parts itself is put before its lines
    assert Replay("top", parts=(inner, GOOD)).replayed == ("inner: both", "inner: it holds", "it holds")
    assert Replay("top", "claim", "refused", parts=(GOOD,)).replayed == ("it holds",)


def test_as_json() -> None:
    assert GOOD.to_json() == {"name": "good", "claim": "it holds", "ok": True, "reason": ""}
    whole = Replay(
        "top",
        "c",
        figures={"a": math.inf, "b": math.nan, "c": 1.5, "d": "x", "e": 3, "f": None, "g": True},
        parts=(BAD,),
        not_replayed=("what nobody sees",),
    )
    assert whole.to_json() == {
        "name": "top",
        "claim": "c",
        "ok": False,
        "reason": "bad: a leaf is open",
        "a": None,
        "b": None,
        "c": 1.5,
        "d": "x",
        "e": 3,
        "f": None,
        "g": True,
        "parts": [{"name": "bad", "claim": "it slips", "ok": False, "reason": "a leaf is open"}],
        "not_replayed": ["what nobody sees"],
    }


def test_what_is_neither_proved_nor_refused() -> None:
    late, no = Replay("late", "it holds", undecided="no time"), Replay("no", "it slips", "it holds")
    for done, fault, is_open in (
        (late, "", "no time"),
        (Replay("all", parts=(GOOD, late)), "", "late: no time"),
        (Replay("all", parts=(late, no)), "no: it holds", "late: no time"),
    ):
        assert (done.fault, done.open, done.ok) == (fault, is_open, False)
        assert done.reason == (fault or is_open)
    assert late.replayed == ()
    assert late.to_json()["undecided"] is True
    assert "undecided" not in Replay("all", parts=(late, no)).to_json()


def test_bounds_are_rounded_to_the_side_where_they_are_true() -> None:
    assert [down(x, 3) for x in (4.1999, 0.0123456, 356.7, 8.0, 0.0, math.inf)] == [
        "4.19",
        "0.0123",
        "356",
        "8",
        "0",
        "inf",
    ]
    assert [up(x, 3) for x in (4.1901, 0.0123456, 356.7, 8.0, 5.551, 0.0)] == ["4.2", "0.0124", "357", "8", "5.56", "0"]
    assert (down(2 / 3), up(1 / 3), down(0.5), up(0.5)) == ("0.666666", "0.333334", "0.5", "0.5")
    assert (down(0.35), up(0.45), down(0.1)) == ("0.35", "0.45", "0.1")  # floats beside what was typed
    assert (down(9.9999999e8), up(9.9999991e8), down(math.nextafter(1, 0))) == ("9.99999e+08", "1e+09", "0.999999")
