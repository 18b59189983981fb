"""Regions over boxes: what holds every point, normal and derivative in a box, and how wide it is."""

from __future__ import annotations

import re
from fractions import Fraction
from math import comb
from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.regions import (
    MAX_PATCH_DEGREE,
    PARAMETER_RANGE,
    ContactSide,
    _blossoms,
    _hull,
    _narrowed,
    _Patches,
    _weights,
    read_region,
)


def bent(rows: int, columns: int, seed: int) -> list[Any]:
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(-1, 1, rows), np.linspace(-1, 1, columns), indexing="ij")
    flat = 0.02 * np.stack([u, v, 0.4 * (u**2 - v**2)], axis=-1) + [0.1, 0.0, 0.0]
    out: list[Any] = (flat + 1e-3 * rng.normal(size=flat.shape)).tolist()
    return out


REGIONS: dict[str, list[dict[str, Any]]] = {
    "bilinear": [{"bezier": bent(2, 2, 0)}, {"bezier": bent(2, 2, 1), "flip": True}],
    "degrees that differ": [{"bezier": bent(4, 2, 2)}, {"bezier": bent(2, 4, 3)}, {"bezier": bent(5, 3, 4)}],
    "kinds that differ": [
        {"cap": {"center": [0.1, 0, 0], "radius": 0.02, "axis": [1, 2, 3], "half_angle": 1.0}},
        {"bezier": bent(4, 4, 5)},
        {
            "cylinder_side": {
                "center": [0, 0, 0.1],
                "axis": [0, 1, 1],
                "x_axis": [1, 0, 0],
                "radius": 0.03,
                "angles": [0.1, 1.5],
                "heights": [0.0, 0.05],
            }
        },
    ],
}


def side(regions: list[dict[str, Any]]) -> tuple[ContactSide, int]:
    data = [read_region(Fields(region)) for region in regions]
    n = 2 * len(data)
    return ContactSide.of(data, np.arange(n).reshape(-1, 2), still=False), n


def boxes(n: int, half: float) -> tuple[Array, Array]:
    at = 0.1 + 0.8 * np.random.default_rng(0).random((8, n))
    return at - half, at + half


@pytest.mark.parametrize("half", [1e-9, 1e-3, 0.1])
@pytest.mark.parametrize("name", REGIONS)
def test_boxes_hold_what_is_at_their_points(name: str, half: float) -> None:
    those, n = side(REGIONS[name])
    low, high = boxes(n, half)
    over = those.over(Interval.between(low, high))
    shares = np.vstack([np.random.default_rng(1).random((40, n)), np.zeros(n), np.ones(n)])
    for share in shares:
        at = those.at(Interval.of(low + share * (high - low)))
        for box, point in zip(over, at, strict=True):
            for wide, thin in ((box.value, point.value), (box.slope, point.slope)):
                assert ((wide.lo <= thin.hi) & (thin.lo <= wide.hi)).all()  # thin: an exact value, rounded outwards


def test_boxes_of_patches_are_hardly_wider_than_what_is_in_them() -> None:
    """Points, normals and derivatives of normals, against their range at random points and the polynomials' own."""
    those, n = side(REGIONS["degrees that differ"] + [{"bezier": bent(4, 4, 5)}])
    low, high = boxes(n, 0.05)
    x, rng = Interval.between(low, high), np.random.default_rng(2)
    over, before = those.over(x), those.at(x)
    inside = [those.at(Interval.of(low + rng.random(low.shape) * (high - low))) for _ in range(200)]
    for k, most in ((0, 1.5), (1, 2.5)):
        values = np.stack([at[k].value.mid for at in inside])
        wide, wider = ((of[k].value.hi - of[k].value.lo).max(axis=2) for of in (over, before))
        assert np.median(wide / np.ptp(values, axis=0).max(axis=2)) < most
        assert np.median(wider / wide) > 2
        slopes = [(of[k].slope.hi - of[k].slope.lo).max(axis=(0, 3)) for of in (over, before)]
        assert np.median(slopes[1] / slopes[0]) > 2


def test_the_whole_of_a_patch_is_within_its_control_points() -> None:
    points = np.array(bent(4, 3, 6))
    those, _ = side([{"bezier": points.tolist()}])
    hull = those.over(Interval.between(np.zeros((1, 2)), np.ones((1, 2)))).point.value
    assert (hull.lo[0, 0] >= points.min(axis=(0, 1)) - 1e-12).all()
    assert (hull.hi[0, 0] <= points.max(axis=(0, 1)) + 1e-12).all()


def test_patches_of_a_high_degree_are_not_cut() -> None:
    those, n = side([{"bezier": bent(12, 3, 7)}, {"bezier": bent(3, 3, 8)}])
    x = Interval.between(*boxes(n, 1e-3))
    assert all(
        np.array_equal(a.value.ends, b.value.ends) and np.array_equal(a.slope.ends, b.slope.ends)
        for a, b in zip(those.over(x), those.at(x), strict=True)
    )


@pytest.mark.parametrize("name", REGIONS)
def test_boxes_that_share_some_contacts_are_as_each_alone(name: str) -> None:
    """In any order, also of a contact that has few different boxes among many."""
    those, n = side(REGIONS[name])
    low, high = boxes(n, 0.01)
    its = np.random.default_rng(3).integers(8, size=(12, n // 2)).repeat(2, axis=1)
    its[:, 2:4] %= 2
    low, high = (np.hstack([end[its, np.arange(n)], end[:1].repeat(12, axis=0)]) for end in (low, high))  # more behind
    together = those.over(Interval.between(low, high))
    for k in range(12):
        alone = those.over(Interval.between(low[k : k + 1], high[k : k + 1]))
        for a, b in zip(together, alone, strict=True):
            assert a.value.ends[k] == pytest.approx(b.value.ends[0], rel=1e-13, abs=1e-15)
            assert a.slope.ends[:, k] == pytest.approx(b.slope.ends[:, 0], rel=1e-13, abs=1e-15)


@pytest.mark.parametrize(
    ("kind", "change", "why"),
    [
        (0, {"radius": 0.0}, "is 0; it must be positive"),
        (0, {"radius": -0.5}, "is -0.5; it must be positive"),
        (0, {"half_angle": 0.0}, "is 0; it must be positive"),
        (0, {"half_angle": 3.15}, "pi or less is needed"),
        (2, {"radius": -0.03}, "is -0.03; it must be positive"),
        (2, {"angles": [0.1, 0.1]}, "the lower one first"),
        (2, {"angles": [0.0, 6.3]}, "at most a full turn"),
        (2, {"heights": [0.05, 0.0]}, "the lower one first"),
    ],
)
def test_what_is_no_region(kind: int, change: dict[str, Any], why: str) -> None:
    ((name, region),) = REGIONS["kinds that differ"][kind].items()
    assert read_region(Fields({name: region})).kind == name
    with pytest.raises(BadFile, match=why):
        read_region(Fields({name: region | change}))


@pytest.mark.parametrize(
    ("rows", "columns", "good"),
    [(1, 2, False), (2, 1, False), (2, MAX_PATCH_DEGREE + 1, True), (2, MAX_PATCH_DEGREE + 2, False)],
)
def test_patches_have_two_points_and_no_more_than_are_possible(rows: int, columns: int, good: bool) -> None:
    points = Fields({"bezier": np.ones((rows, columns, 3)).tolist()})
    if good:
        assert read_region(points).numbers["bezier"].shape == (rows, columns, 3)
    else:
        with pytest.raises(BadFile, match="points; 2 x 2 to"):
            read_region(points)


# --- one by one ---------------------------------------------------------------------------------------------

CAP = {"center": [0.1, 0.2, 0], "radius": 0.02, "axis": [0, 0, 2], "half_angle": 1.0}
CYLINDER = {
    "center": [0, 0, 0.1],
    "axis": [0, 0, 3],
    "x_axis": [1, 0, 0],
    "angles": [0, np.pi / 2],
    "heights": [0, 0.05],
}
CONE: dict[str, dict[str, Any]] = {"cone_side": CYLINDER | {"radii": [0.03, 0.01]}}
FLAT: dict[str, Any] = {"bezier": [[[0, 0, 0], [0, 0.2, 0]], [[0.1, 0, 0], [0.1, 0.2, 0]]]}


def surface(region: dict[str, Any], u: float, v: float, still: bool = False) -> list[Array]:
    """(3,) point, normal and tangents of one region."""
    at = ContactSide.of([read_region(Fields(region))], np.array([[0, 1]]), still=still).at(
        Interval.of(np.array([[u, v]]))
    )
    return [part.value.mid[0, 0] for part in at]


def test_a_cap_by_hand() -> None:
    """About z, with the first axis e x a of the coordinate axis that a is least along: x x z = -y."""
    s, t = 0.3, 0.4
    direction = np.array([np.sin(s) * np.sin(t), -np.sin(s) * np.cos(t), np.cos(s)])
    for flip, sign in ((False, 1), (True, -1)):
        point, normal, first, second = surface({"cap": CAP, "flip": flip}, s, t)
        assert point == pytest.approx(np.array([0.1, 0.2, 0]) + 0.02 * direction)
        assert normal == pytest.approx(sign * direction)
        assert first == pytest.approx([np.cos(s) * np.sin(t), -np.cos(s) * np.cos(t), -np.sin(s)])
        assert second == pytest.approx([np.cos(t), np.sin(t), 0])
    centre, axis, *others = surface({"cap": CAP, "flip": True}, s, t, still=True)
    assert centre == pytest.approx([0.1, 0.2, 0])
    assert all(those == pytest.approx([0, 0, 1]) for those in (axis, *others))


def test_the_side_of_a_cylinder_by_hand() -> None:
    """A third of a quarter turn, two fifths of 50 mm up."""
    around = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0])
    for flip, sign in ((False, 1), (True, -1)):
        region = {"cylinder_side": CYLINDER | {"radius": 0.03}, "flip": flip}
        point, normal, first, second = surface(region, 1 / 3, 0.4)
        assert point == pytest.approx(0.03 * around + [0, 0, 0.12])
        assert normal == pytest.approx(sign * around)
        assert first == pytest.approx([-np.sin(np.pi / 6), np.cos(np.pi / 6), 0])
        assert second == pytest.approx([0, 0, 1])


def test_the_side_of_a_cone_by_hand() -> None:
    """The radius falls from 30 to 10 mm over 50 mm: at two fifths it is 22 mm, the normal leans upwards by 2 : 5."""
    around, up = np.array([np.cos(np.pi / 6), np.sin(np.pi / 6), 0]), np.array([0, 0, 1.0])
    point, normal, _, second = surface(CONE, 1 / 3, 0.4)
    assert point == pytest.approx(0.022 * around + [0, 0, 0.12])
    assert normal == pytest.approx((5 * around + 2 * up) / np.sqrt(29))
    assert second == pytest.approx((5 * up - 2 * around) / np.sqrt(29))
    shifted = CONE["cone_side"] | {"angles": [np.pi / 6, np.pi / 2], "heights": [0.02, 0.05]}
    point, normal, first, _ = surface({"cone_side": shifted}, 0.0, 0.0)
    assert point == pytest.approx(0.03 * around + [0, 0, 0.12])
    assert normal == pytest.approx((3 * around + 2 * up) / np.sqrt(13))
    assert first == pytest.approx([-np.sin(np.pi / 6), np.cos(np.pi / 6), 0])


def test_a_flat_patch_by_hand() -> None:
    for flip, sign in ((False, 1), (True, -1)):
        point, normal, first, second = surface(FLAT | {"flip": flip}, 0.25, 0.5)
        assert point == pytest.approx([0.025, 0.1, 0])
        assert normal == pytest.approx([0, 0, sign])
        assert first == pytest.approx([0.1, 0, 0])
        assert second == pytest.approx([0, 0.2, 0])


def test_a_patch_of_degree_two_by_hand() -> None:
    """x = 2 u (1 - u) + 3 u^2, y = v, z = u v."""
    points = [[[x, v, u * v] for v in (0, 1)] for u, x in ((0, 0), (0.5, 1), (1, 3))]
    u, v = 0.3, 0.6
    point, normal, first, second = surface({"bezier": points}, u, v)
    assert point == pytest.approx([2 * u * (1 - u) + 3 * u**2, v, u * v])
    assert first == pytest.approx([2 + 2 * u, 0, v])
    assert second == pytest.approx([0, 1, u])
    assert normal == pytest.approx(
        np.array([-v, -u * (2 + 2 * u), 2 + 2 * u]) / np.linalg.norm([v, u * (2 + 2 * u), 2 + 2 * u])
    )


@pytest.mark.parametrize("name", [*REGIONS, "cone"])
def test_derivatives_are_those_of_what_is_there(name: str) -> None:
    """By differences over 2e-6, of points, normals and tangents; no contact depends on another's parameters."""
    regions: list[dict[str, Any]] = [CONE, {"cap": CAP, "flip": True}] if name == "cone" else REGIONS[name]
    those, n = side(regions)
    x = 0.1 + 0.8 * np.random.default_rng(4).random((1, n))
    at = those.at(Interval.of(x))
    for column in range(n):
        k, step = column // 2, 1e-6 * np.eye(n)[column]
        ends = [those.at(Interval.of(x + sign * step)) for sign in (-1, 1)]
        for part, low, high in zip(at, *ends, strict=True):
            change = (high.value.mid - low.value.mid)[0] / 2e-6
            assert part.slope.mid[column % 2, 0, k] == pytest.approx(change[k], abs=2e-8)
            assert (part.slope.hi - part.slope.lo < 1e-9).all()
            assert not np.delete(change, k, axis=0).any()


def test_contacts_are_in_their_order_whatever_their_kinds() -> None:
    kinds: list[dict[str, Any]] = [
        {"bezier": bent(4, 2, 2)},
        {"cap": CAP},
        {"bezier": bent(2, 4, 3)},
        CONE,
        {"bezier": bent(4, 2, 5)},
    ]
    those, n = side(kinds)
    x = 0.1 + 0.8 * np.random.default_rng(5).random((3, n))
    both = those.at(Interval.of(x)), those.over(Interval.between(x - 0.01, x + 0.01))
    for k, region in enumerate(kinds):
        alone, _ = side([region])
        own = x[:, 2 * k : 2 * k + 2]
        for one, its in zip(
            both, (alone.at(Interval.of(own)), alone.over(Interval.between(own - 0.01, own + 0.01))), strict=True
        ):
            for a, b in zip(one, its, strict=True):
                assert a.value.mid[:, k] == pytest.approx(b.value.mid[:, 0], abs=1e-12)
                assert a.slope.mid[:, :, k] == pytest.approx(b.slope.mid[:, :, 0], abs=1e-12)


def test_derivatives_are_spread_to_the_columns_of_each_contact() -> None:
    """The second contact has no parameters."""
    data = [read_region(Fields(FLAT))] * 3
    those = ContactSide.of(data, np.array([[3, 1], [-1, -1], [0, 4]]), still=False)
    given = Dual(Interval.of(np.ones((2, 3, 3))), Interval.of(np.arange(1.0, 37).reshape(2, 2, 3, 3)))
    spread = those.spread(given, 5)
    assert spread.value is given.value
    wanted = np.zeros((5, 2, 3, 3))
    for column, (i, k) in {3: (0, 0), 1: (1, 0), 0: (0, 2), 4: (1, 2)}.items():
        wanted[column, :, k] = given.slope.mid[i, :, k]
    assert spread.slope.mid.tolist() == wanted.tolist()
    assert those.spread(given, 0).slope.shape == (0, 2, 3, 3)


@pytest.mark.parametrize("degree", [9, 10])
def test_patches_up_to_a_degree_are_narrowed(degree: int) -> None:
    those, n = side([{"bezier": bent(degree + 1, 2, 7)}])
    x = Interval.between(*boxes(n, 0.05))
    narrow, wide = (of(x).normal.value for of in (those.over, those.at))
    assert (np.median((narrow.hi - narrow.lo) / (wide.hi - wide.lo)) < 0.9) == (degree == 9)


# --- bounds over boxes ------------------------------------------------------------------------------------------


def test_the_hull_of_the_parts_of_boxes() -> None:
    parts = Interval.between(*np.array([[[[1.0]], [[3]], [[-5]], [[0]]], [[[2.0]], [[4]], [[-4]], [[7]]]]))  # (4, 1, 1)
    hull = _hull(parts, 2)
    assert (hull.lo.ravel().tolist(), hull.hi.ravel().tolist()) == ([1, -5], [4, 7])


@pytest.mark.parametrize(
    ("value", "middle", "kept"),
    [
        ((-9, 9), 1.0, (-1.25, 3.25)),  # by 0.5 of 2 to 4, and by 0.25 of -1
        ((-1, 9), 1.0, (-1, 3.25)),
        ((-9, 2), 1.0, (-1.25, 2)),
        ((np.nan, np.nan), 1.0, (-1.25, 3.25)),
        ((-9, 9), np.nan, (-9, 9)),
    ],
)
def test_values_over_a_box_are_those_in_its_middle_and_what_changes(
    value: tuple[float, float], middle: float, kept: tuple[float, float]
) -> None:
    def one(lo: float, hi: float) -> Interval:
        return Interval.between(np.full((1, 1, 3), lo), np.full((1, 1, 3), hi))

    slope = Interval(np.stack([one(2, 4).ends, one(-1, -1).ends]))
    away = Interval.between(*(sign * np.array([0.5, 0.25]).reshape(2, 1, 1, 1) for sign in (-1, 1)))
    found = _narrowed(Dual(one(*value), slope), one(middle, middle), away)
    for end, wanted in zip((found.value.lo, found.value.hi), kept, strict=True):
        assert end == pytest.approx(np.full((1, 1, 3), wanted))
    assert found.slope is slope


def test_weights_of_the_control_points_of_a_part() -> None:
    """From 1/4 to 3/4: of a line its ends, of a parabola (1 - u)^2, 2 u (1 - u), u^2 blossoms at both ends."""
    low, high = (Interval.of(np.full((2, 1, 1), end)) for end in (0.25, 0.75))
    constant, line, parabola = _blossoms(low, high, 2)
    assert constant.mid[0, 0, 0].tolist() == [[1]]
    assert line.mid[1, 0, 0] == pytest.approx(np.array([[0.75, 0.25], [0.25, 0.75]]))
    assert parabola.mid[0, 0, 0] == pytest.approx(
        np.array([[9 / 16, 6 / 16, 1 / 16], [3 / 16, 10 / 16, 3 / 16], [1 / 16, 6 / 16, 9 / 16]])
    )


@pytest.mark.parametrize(("degree", "wide"), [(3, False), (60, True), (MAX_PATCH_DEGREE, True)])
def test_binomials_are_enclosed(degree: int, wide: bool) -> None:
    """Those of a high degree are no floating-point numbers."""
    binomials, up, down = _weights((degree, 1), degree + 1)
    low, high = (end[..., 0, 0] for end in (binomials.lo, binomials.hi))
    for less in range(3):
        for i in range(degree - less + 1):
            assert Fraction(low[0, less, i]) <= comb(degree - less, i) <= Fraction(high[0, less, i])
            assert (up[0, less, i], down[0, less, i]) == (i, degree - less - i)
        assert (np.abs(high[0, less, degree - less + 1 :]) < 1e-200).all()
    assert high[1, :, :2] == pytest.approx(np.array([[1, 1], [1, 0], [0, 0]]))
    assert (low[0, :, 0] < high[0, :, 0]).any() == wide
    assert (high <= low * (1 + 1e-15) + 1e-200).all()


def test_many_boxes_of_a_high_degree_are_worked_out_a_few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """40 boxes of two patches of degree 59, of which 9 are as many weights as are held at once."""
    asked, own = [], _Patches._sums

    def sums(patches: _Patches, x: Interval) -> Interval:
        asked.append(len(x.ends))
        return own(patches, x)

    monkeypatch.setattr(_Patches, "_sums", sums)
    two, n = side([{"bezier": bent(60, 60, 6)}, {"bezier": bent(60, 60, 7)}])
    corner = np.random.default_rng(8).uniform(0.0, 0.9, (40, n))
    boxes = Interval.between(corner, corner + 1e-3)
    many = two.at(boxes)
    assert asked == [9] * 4 + [4]
    for k in (0, 8, 9, 39):
        alone = two.at(boxes[k : k + 1])
        assert (alone.normal.value.ends[0] == many.normal.value.ends[k]).all()
        assert (alone.point.slope.ends[:, 0] == many.point.slope.ends[:, k]).all()


# --- in files -----------------------------------------------------------------------------------------------------


def test_what_a_region_in_a_file_is() -> None:
    cap = read_region(Fields({"cap": CAP, "flip": True}))
    assert (cap.kind, cap.sign, cap.ball, cap.radius, cap.half_angle) == ("cap", -1, True, 0.02, 1.0)
    assert cap.ends.tolist() == [[0, 1.0], [-PARAMETER_RANGE, PARAMETER_RANGE]]
    for region in (FLAT, CONE, {"cylinder_side": CYLINDER | {"radius": 0.03}, "flip": False}):
        other = read_region(Fields(region))
        assert (other.sign, other.ball, other.ends.tolist()) == (1, False, [[0, 1], [0, 1]])
    sphere = read_region(Fields({"cap": CAP | {"half_angle": np.pi}}))
    assert sphere.half_angle == np.pi
    assert np.sin(sphere.half_angle) > 0 > np.sin(sphere.ends[0, 1])  # the pole across is between the two
    less = np.nextafter(np.pi, 0.0)
    assert read_region(Fields({"cap": CAP | {"half_angle": less}})).ends[0].tolist() == [0, less]
    turn = {"cylinder_side": CYLINDER | {"radius": 0.03, "angles": [-1.0, -1.0 + 2 * np.pi]}}
    assert read_region(Fields(turn)).numbers["angles"].tolist() == [-1.0, -1.0 + 2 * np.pi]


@pytest.mark.parametrize(
    ("region", "words"),
    [
        ({}, "r: exactly one of bezier, cap, cylinder_side, cone_side is needed"),
        ({"cap": CAP} | CONE, "r: exactly one of bezier, cap, cylinder_side, cone_side is needed"),
        ({"cap": CAP, "flip": 1}, "r.flip: is 1; true or false is needed"),
        ({"cap": CAP, "more": 1}, "r.more: is not a known field; leave it out"),
        ({"cap": CAP | {"more": 1}}, "r.cap.more: is not a known field; leave it out"),
        (FLAT | {"more": 1}, "r.more: is not a known field; leave it out"),
        ({"cap": CAP | {"half_angle": 4.0}}, "r.cap.half_angle: is 4; pi or less is needed [rad]"),
        ({"cap": CAP | {"radius": -1}}, "r.cap.radius: is -1; it must be positive"),
        ({"cone_side": CONE["cone_side"] | {"radii": [0.1, 0]}}, "r.cone_side.radii: has 0; radii are positive"),
        (
            {"cone_side": CONE["cone_side"] | {"heights": [1, 1]}},
            "r.cone_side.heights: is [1, 1]; the lower one first, at most a full turn",
        ),
        (
            {"cone_side": CONE["cone_side"] | {"angles": [0, 2 * np.pi * (1 + 1e-11)]}},
            "r.cone_side.angles: is [0, 6.28319]; the lower one first, at most a full turn",
        ),
        ({"bezier": [[[0, 0, 0]] * 2]}, "r.bezier: has 1 x 2 points; 2 x 2 to 101 x 101 are possible"),
    ],
)
def test_faults_of_regions_name_their_field(region: dict[str, Any], words: str) -> None:
    with pytest.raises(BadFile, match=f"^{re.escape(words)}$"):
        read_region(Fields(region, "r"))


@pytest.mark.parametrize(("name", "values", "slopes"), [("bilinear", 0.85, 0.5), ("degrees that differ", 0.95, 0.7)])
def test_what_is_over_a_box_is_narrower_where_it_is_cut(name: str, values: float, slopes: float) -> None:
    """Normals and their derivatives, of boxes a fifth as wide as the region."""
    those, n = side(REGIONS[name])
    x = Interval.between(*boxes(n, 0.1))
    cut, whole = (of(x).normal for of in (those.over, those._over))
    for narrow, wide, most in ((cut.value, whole.value, values), (cut.slope, whole.slope, slopes)):
        assert np.median((narrow.hi - narrow.lo).max(axis=-1) / (wide.hi - wide.lo).max(axis=-1)) < most
        assert (narrow.lo >= wide.lo - 1e-9).all()
        assert (narrow.hi <= wide.hi + 1e-9).all()


def test_a_cap_of_the_hand_stands_still() -> None:
    still = ContactSide.of([read_region(Fields({"cap": CAP}))], np.array([[0, 1]]), still=True)
    for part in still.at(Interval.of(np.array([[0.3, 0.4]]))):
        assert part.slope.shape == (2, 1, 1, 3)
        assert not part.slope.mag.any()
