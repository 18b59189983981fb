"""Fields of files: what is taken, with its type and bounds, and the whole line for every fault."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.proofs.fields import (
    EQUALITY_TOLERANCE,
    MAX_JSON_NUMBER,
    MOST_MULTIPLICATIONS,
    ZERO,
    BadFile,
    Fields,
    cross,
    dot,
    floats,
    not_zero,
    number,
    numbers,
    product,
    rational,
    rationals,
    refuse_unknown,
    rounded,
    same,
)
from tests.support.refused import refused

BEYOND = float(np.nextafter(MAX_JSON_NUMBER, np.inf))


def test_limits() -> None:
    assert MAX_JSON_NUMBER == 1e50
    assert EQUALITY_TOLERANCE == 1e-9


def test_a_fault_names_field_and_problem() -> None:
    fault = BadFile("is missing", "a.b")
    assert (str(fault), fault.problem, fault.field) == ("a.b: is missing", "is missing", "a.b")
    bare = BadFile("is missing")
    assert (str(bare), bare.problem, bare.field) == ("is missing", "is missing", "")
    assert isinstance(fault, ValueError)


@pytest.mark.parametrize("data", [[], "text", 1, None])
def test_what_is_no_object_is_refused(data: Any) -> None:
    with refused("is no object", "place"):
        Fields(data, "place")


# --- objects


def test_each_field_is_taken_once_and_none_may_be_left() -> None:
    data = {"a": 1, "b": None, "c": 3}
    f = Fields(data, "top")
    assert f.names() == ("a", "b", "c")
    assert (f.has("a"), f.has("b"), f.has("d")) == (True, False, False)
    assert f.take("a") == 1
    assert not f.has("a")
    with refused("is missing", "top.a"):
        f.take("a")
    assert f.take("a", 7) == 7
    assert f.take("d", None) is None
    assert f.take("b", 5) == 5  # `has` took its null
    assert Fields({"b": None}).take("b", 5) is None  # a value, unless `has` was asked
    with refused("is not a known field; leave it out", "top.c"):
        f.done()
    assert f.names() == ("c",)
    assert f.take("c") == 3
    f.done()
    assert data == {"a": 1, "b": None, "c": 3}


def test_the_first_field_that_nobody_took_is_named() -> None:
    with refused("is not a known field; leave it out", "y"):
        Fields({"y": 1, "x": 2}).done()


def test_names_begin_with_the_place() -> None:
    assert Fields({}, "a[1]").at("b") == "a[1].b"
    assert Fields({}).at("b") == "b"


def test_objects_in_objects() -> None:
    inner = Fields({"a": {"b": 1}}, "top").object("a")
    assert inner.place == "top.a"
    assert inner.take("b") == 1
    with refused("is no object", "top.a"):
        Fields({"a": []}, "top").object("a")


def test_lists_of_objects() -> None:
    found = list(Fields({"a": [{"b": 1}, {"b": 2}]}, "top").objects("a"))
    assert [(f.place, f.take("b")) for f in found] == [("top.a[0]", 1), ("top.a[1]", 2)]
    assert list(Fields({}).objects("a", [])) == []
    with refused("is missing", "top.a"):
        Fields({}, "top").objects("a")
    for wrong in ("text", {"b": 1}, 3):
        with refused("is no list", "top.a"):
            Fields({"a": wrong}, "top").objects("a")
    with refused("is no object", "top.a[1]"):
        list(Fields({"a": [{}, 1]}, "top").objects("a"))


def test_tables_of_objects() -> None:
    rows: list[dict[str, Any]] = [{"x": 1, "y": "a"}, {"y": "b", "x": [2]}]
    assert Fields({"t": rows}).table("t", ["x", "y"]) == {"x": [1, [2]], "y": ["a", "b"]}
    assert Fields({"t": []}).table("t", ["x"]) == {"x": []}
    for wrong in ("text", {"x": 1}, 3):
        with refused("is no list", "top.t"):
            Fields({"t": wrong}, "top").table("t", ["x"])
    with refused("is missing", "top.t"):
        Fields({}, "top").table("t", ["x"])
    with refused("is no object", "top.t[1]"):
        Fields({"t": [{"x": 1}, 3]}, "top").table("t", ["x"])
    with refused("is missing", "top.t[1].y"):
        Fields({"t": [*rows[:1], {"x": 1}]}, "top").table("t", ["x", "y"])
    with refused("is not a known field; leave it out", "top.t[0].z"):
        Fields({"t": [rows[0] | {"z": 1}]}, "top").table("t", ["x", "y"])


# --- texts, truth values, whole numbers


def test_texts() -> None:
    assert Fields({"a": ""}).text("a") == ""
    assert Fields({}).text("a", "b") == "b"
    assert Fields({"a": "x"}).text("a", among=("x", "y")) == "x"
    with refused("is 1; a text is needed", "top.a"):
        Fields({"a": 1}, "top").text("a")
    with refused("is 'z'; 'x' or 'y' is needed", "top.a"):
        Fields({"a": "z"}, "top").text("a", among=("x", "y"))
    with refused("is missing", "a"):
        Fields({}).text("a", among=("x",))


def test_truth_values() -> None:
    assert Fields({"a": True}).flag("a") is True
    assert Fields({"a": False}).flag("a", True) is False
    assert Fields({}).flag("a", True) is True
    for wrong in (1, 0, "true", None):
        with refused(f"is {wrong!r}; true or false is needed", "top.a"):
            Fields({"a": wrong}, "top").flag("a")


def test_whole_numbers() -> None:
    assert Fields({"a": 0}).whole("a") == 0
    assert Fields({"a": -2}).whole("a", least=-2) == -2
    assert Fields({}).whole("a", 4) == 4
    for wrong in (-1, True, 1.0, "1", None):
        with refused(f"is {wrong!r}; a whole number of 0 or more is needed", "top.a"):
            Fields({"a": wrong}, "top").whole("a")
    with refused("is 2; a whole number of 3 or more is needed", "a"):
        Fields({"a": 2}).whole("a", least=3)


def test_lists_of_texts() -> None:
    assert Fields({"a": ["x", "y"]}).texts("a") == ("x", "y")
    assert Fields({}).texts("a", ()) == ()
    for wrong in ("xy", ["x", 1], 3, {"x": "y"}):
        with refused("is no list of texts", "top.a"):
            Fields({"a": wrong}, "top").texts("a")


# --- numbers


@pytest.mark.parametrize("value", [0, -3, 2.5, MAX_JSON_NUMBER, -MAX_JSON_NUMBER])
def test_numbers_come_back(value: float) -> None:
    found = number(value, "a")
    assert found == value
    assert isinstance(found, float)
    assert Fields({"a": value}).number("a") == value


@pytest.mark.parametrize("value", [True, False, "1", None, [1], float("nan"), float("inf"), -float("inf")])
def test_what_is_no_finite_number_is_refused(value: Any) -> None:
    with refused(f"is {value!r}; a finite number is needed", "top.a"):
        Fields({"a": value}, "top").number("a")


def test_bounds_of_a_number() -> None:
    assert Fields({"a": 2.0}).number("a", least=2.0) == 2.0
    assert Fields({}).number("a", 1.5) == 1.5
    with refused("is 1.5; 2 or more is needed", "top.a"):
        Fields({"a": 1.5}, "top").number("a", least=2.0)
    for beyond in (BEYOND, -BEYOND, 10**51, -(10**5000)):  # the last is beyond all floating-point numbers
        with refused("is beyond 1e+50, the largest number that is possible", "a"):
            number(beyond, "a", 0.0)
    with refused("is -1e-09; 0 or more is needed", "a"):
        number(-1e-9, "a", 0.0)


def test_numbers_by_name() -> None:
    assert Fields({"a": {"x": 1, "y": -2.5}}).named("a") == {"x": 1.0, "y": -2.5}
    assert Fields({}).named("a", {}) == {}
    with refused("is no object of numbers by name", "top.a"):
        Fields({"a": [1]}, "top").named("a")
    with refused("is True; a finite number is needed", "top.a.x"):
        Fields({"a": {"x": True}}, "top").named("a")


# --- tables


def test_tables_of_a_shape() -> None:
    found = Fields({"a": [[1, 2.5], [3, -4]]}).numbers("a", (2, 2))
    assert found.tolist() == [[1.0, 2.5], [3.0, -4.0]]
    assert found.dtype == np.float64
    assert not found.flags.writeable
    assert Fields({}).numbers("a", (1,), [5]).tolist() == [5.0]
    with refused("is missing", "top.a"):
        Fields({}, "top").numbers("a", (1,))


def test_an_array_is_copied() -> None:
    own = np.arange(3.0)
    found = numbers(own, (3,), "a")
    own[0] = 7.0
    assert found.tolist() == [0.0, 1.0, 2.0]
    assert own.flags.writeable


def test_any_length() -> None:
    assert numbers([1, 2, 3], (-1,), "a").shape == (3,)
    assert numbers([[1, 2, 3]], (-1, 3), "a").shape == (1, 3)
    assert numbers([], (-1,), "a").shape == (0,)
    assert numbers([], (-1, 3), "a").shape == (0, 3)
    assert numbers([], (0,), "a").shape == (0,)
    assert numbers([[], []], (2, 0), "a").shape == (2, 0)


@pytest.mark.parametrize(
    ("value", "shape", "problem"),
    [
        ([1, 2], (3,), "has 2 numbers; 3 are needed"),
        ([[1, 2]], (-1, 3), "has 1 x 2 numbers; n x 3 are needed"),
        ([1, 2, 3], (-1, 3), "has 3 numbers; n x 3 are needed"),
        ([[1]], (-1,), "has 1 x 1 numbers; n are needed"),
        (1.0, (3,), "has one numbers; 3 are needed"),
        ([], (3,), "has 0 numbers; 3 are needed"),
        ([1], (0,), "has 1 numbers; 0 are needed"),
        ([[1, 2], [3]], (2, 2), "is no table of 2 x 2 numbers"),
        ([[1, 2], 3], (-1, 2), "has [1, 2] where a number is needed"),
        ([[1, 2], "x"], (-1, 2), "has [1, 2] where a number is needed"),
        ([[1, 2], [3, "x"]], (-1, 2), "has 'x' where a number is needed"),
        ([[[1]]], (1, 1), "has 1 x 1 x 1 numbers; 1 x 1 are needed"),
        ([1, True], (2,), "has True where a number is needed"),
        ([1, "2"], (2,), "has '2' where a number is needed"),
        ("12", (2,), "has '12' where a number is needed"),
        ([[1, None]], (1, 2), "has None where a number is needed"),
        ({"a": 1}, (1,), "has {'a': 1} where a number is needed"),
        ([1, float("nan")], (2,), "has a number that is not finite, or beyond 1e+50"),
        ([-float("inf"), 1], (2,), "has a number that is not finite, or beyond 1e+50"),
        ([BEYOND], (1,), "has a number that is not finite, or beyond 1e+50"),
        ([-BEYOND], (1,), "has a number that is not finite, or beyond 1e+50"),
        ([10**400], (1,), "is no table of 1 numbers"),
    ],
)
def test_faults_of_tables(value: Any, shape: tuple[int, ...], problem: str) -> None:
    with refused(problem, "top.a"):
        Fields({"a": value}, "top").numbers("a", shape)


def test_tables_reach_the_largest_numbers() -> None:
    assert numbers([MAX_JSON_NUMBER, -MAX_JSON_NUMBER], (2,), "a").tolist() == [MAX_JSON_NUMBER, -MAX_JSON_NUMBER]


def test_numbers_of_numpy_in_lists() -> None:
    assert numbers([np.float32(0.5), np.int64(2)], (2,), "a").tolist() == [0.5, 2.0]


def test_rows_are_lists_or_tuples() -> None:
    assert numbers([[1], (2,)], (2, 1), "a").tolist() == [[1.0], [2.0]]


# --- names, and what says the same


def test_unknown_names() -> None:
    refuse_unknown("x", ["w", "x"], "joint", "a")
    with refused("has unknown joint 'y'; known are w, x", "a"):
        refuse_unknown("y", ["w", "x"], "joint", "a")
    with refused("has unknown motor 'y'; known are none", "a"):
        refuse_unknown("y", [], "motor", "a")


NEAR, OFF = 1 + 0.9e-9, 1 + 1.1e-9


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (1, 1.0),
        (1, NEAR),
        (NEAR, 1),
        (1e-9, 0.0),  # the tolerance itself
        (1e-9, 0),
        (NEAR, 1.0),
        (1.0, NEAR),
        (1e6 * NEAR, 1e6),  # relative above 1
        (10**6, 1e6 * NEAR),
        (-1e6 * NEAR, -1e6),
        (1e-12, 0.9e-9),  # absolute below 1
        (-0.4e-9, 0.4e-9),
        ("a", "a"),
        (None, None),
        (True, True),
        ([1, 2], (1, 2)),
        ({"a": [1.0, {"b": "c"}]}, {"a": [NEAR, {"b": "c"}]}),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}),
        ([], ()),
    ],
)
def test_the_same(a: Any, b: Any) -> None:
    assert same(a, b)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (OFF, 1.0),
        (1.0, OFF),
        (1, OFF),
        (1e6 * OFF, 1e6),
        (10**6, 1e6 * OFF),
        (1e6, -1e6),
        (1e-9 * 1.1, 0.0),
        (1, True),
        (True, 1),
        (False, 0),
        (True, False),
        (1, "1"),
        (None, 0),
        ("a", "b"),
        ([1, 2], [1, 3]),
        ([1, 2], [1]),
        ([1], [1, 2]),
        ([1, 2], [2, 1]),
        ({"a": 1}, {"b": 1}),
        ({"a": 1}, {"a": 2}),
        ({"a": 1, "b": 2}, {"a": 1}),
        ({"a": 1}, [1]),
        ([1], "1"),
        (["a"], "a"),
        (float("nan"), float("nan")),
    ],
)
def test_not_the_same(a: Any, b: Any) -> None:
    assert not same(a, b)
    assert not same(b, a)


# --- rational numbers ------------------------------------------------------------


def test_numbers_are_what_they_are() -> None:
    assert rational(0.75) == fmpq(3, 4)
    assert rational(-2.5) == fmpq(-5, 2)
    assert rational(3) == fmpq(3)
    assert rational(0.0) == ZERO == fmpq(0)
    # 0.1 in binary: 0x1.999999999999ap-4 = 7205759403792794 / 2^56, which is 3602879701896397 / 2^55
    assert rational(0.1) == fmpq(3602879701896397, 2**55)
    assert rational(0.1) != fmpq(1, 10)
    assert rational(5e-324) == fmpq(1, 2**1074)
    assert rational(1e308) == fmpq(int(1e308))


@pytest.mark.parametrize("wrong", [math.inf, -math.inf, math.nan])
def test_what_is_not_finite_has_none(wrong: float) -> None:
    with pytest.raises((OverflowError, ValueError), match="integer ratio"):
        rational(wrong)


def test_several() -> None:
    assert rationals([0.5, -0.25]) == [fmpq(1, 2), fmpq(-1, 4)]
    assert rationals(()) == []


def test_products_by_hand() -> None:
    # (1, 2, 3) x (5, 7, 11) = (2 11 - 3 7, 3 5 - 1 11, 1 7 - 2 5) = (1, 4, -3); scalar 5 + 14 + 33 = 52
    a, b = rationals([1, 2, 3]), rationals([5, 7, 11])
    assert cross(a, b) == [1, 4, -3]
    assert cross(b, a) == [-1, -4, 3]
    assert dot(a, b) == 52
    assert isinstance(dot(a, b), fmpq)
    assert dot([], []) == ZERO
    assert isinstance(dot([], []), fmpq)
    with pytest.raises(ValueError, match="zip"):
        dot(a, b[:2])


@pytest.mark.parametrize("shape", [(109, 40), (700, 40), (3, 130, 90), (2, 0, 90), (5, 0), (0, 40), (1, 2**18)])
def test_products_a_few_rows_at_a_time(shape: tuple[int, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """Of whole numbers, exactly; no part is so large that BLAS begins threads for it, 2^18 multiplications."""
    rng = np.random.default_rng(3)
    a = rng.integers(-9, 10, shape).astype(float)
    b = rng.integers(-9, 10, (*shape[:-2], shape[-1], 60)).astype(float)
    assert np.array_equal(product(a, b), a @ b)
    sizes, whole = [], np.concatenate
    monkeypatch.setattr(
        np, "concatenate", lambda parts, axis: [sizes.append(x.shape[-2]) for x in parts] and whole(parts, axis)
    )
    product(a, b)
    assert all(rows == 1 or rows * shape[-1] * 60 <= MOST_MULTIPLICATIONS for rows in sizes)
    assert (sum(sizes) > 0) == (shape[-2] > 1 and shape[-2] * shape[-1] * 60 > MOST_MULTIPLICATIONS)


def test_rounding_goes_to_the_nearest() -> None:
    assert rounded(fmpq(1, 10)) == 0.1
    assert rounded(fmpq(-1, 3)) == -1 / 3
    # halfway between 1 and 1 + 2^-52: to even; a little more: up
    assert rounded(fmpq(2**53 + 1, 2**53)) == 1.0
    assert rounded(fmpq(2**53 + 1, 2**53) + fmpq(1, 2**200)) == 1 + 2.0**-52
    assert [rounded(fmpq(sign * 10**400)) for sign in (1, -1)] == [np.inf, -np.inf]
    # integers far beyond the range of floating-point numbers: 3 10^400 / (4 10^400 - 1) is 0.75 but for rounding
    assert rounded(fmpq(3 * 10**400, 4 * 10**400 - 1)) == 0.75


def test_what_is_not_zero_never_becomes_zero() -> None:
    """Numbers below all floating-point ones: the smallest with their sign."""
    tiny = fmpq(1, 10**400)
    assert [rounded(tiny), not_zero(tiny), not_zero(-tiny), not_zero(ZERO)] == [0, 5e-324, -5e-324, 0]
    assert not_zero(fmpq(-1, 3)) == -1 / 3
    table = [[tiny, fmpq(1, 4)], [ZERO, fmpq(-2)]]
    assert floats(table).tolist() == [[0, 0.25], [0, -2]]
    assert floats(table, not_zero).tolist() == [[5e-324, 0.25], [0, -2]]
    assert floats([ZERO]).dtype == np.float64
