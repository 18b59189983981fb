"""Regions over boxes: what holds every point, normal and derivative in a box, and how wide it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.intervals import Interval
from handfast.proofs.regions import MAX_PATCH_DEGREE, ContactSide, read_region


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
