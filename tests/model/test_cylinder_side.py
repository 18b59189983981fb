"""Parts of the sides of cylinders and cones: points, normals, sizes, curvature, form in files, what is refused."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from handfast import ConeSide, CylinderSide, InputError
from handfast.core.files import validate
from handfast.geometry.curvature import curvature_at, principal_curvatures
from handfast.model.region import Bezier, Cap, Region
from handfast.readers.region_file import RegionEntry, region_to_dict
from tests.support.planted import bump, moved, pose, turn

X, Y, Z = np.eye(3)
QUARTER = CylinderSide(X, 0.5, 2 * Z, X + 3 * Z, (0.0, np.pi / 2), (-1.0, 3.0))
CONE = ConeSide(X, (1.0, 4.0), 2 * Z, X + 3 * Z, (0.0, np.pi / 2), (-1.0, 3.0))  # 3 wider over 4: a slope of 3, 4, 5


def some(seed: int) -> CylinderSide:
    rng = np.random.default_rng(seed)
    first, lowest = rng.uniform(-3, 3, 2)
    angles, heights = (first, first + rng.uniform(0.1, 6.2)), (lowest, lowest + rng.uniform(0.1, 2))
    return CylinderSide(rng.normal(size=3), 0.4, rng.normal(size=3), rng.normal(size=3), angles, heights, seed % 2 == 1)


def test_points_and_normals() -> None:
    np.testing.assert_allclose(QUARTER.at([0, 1], [0, 0.25]), [[1.5, 0, -1], [1, 0.5, 0]], atol=1e-15)
    np.testing.assert_allclose(QUARTER.outward([0, 1], [0, 1]), [X, Y], atol=1e-15)
    np.testing.assert_allclose(replace(QUARTER, flip=True).outward(0, 0), -X, atol=1e-15)
    middle, normal = QUARTER.middle
    np.testing.assert_allclose(middle, [1 + np.sqrt(0.125), np.sqrt(0.125), 1], atol=1e-15)
    np.testing.assert_allclose(normal, [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-15)


def test_points_normals_and_sizes_of_a_cone() -> None:
    np.testing.assert_allclose(CONE.at([0, 1], [0, 1]), [[2, 0, -1], [1, 4, 3]], atol=1e-15)
    np.testing.assert_allclose(CONE.outward([0, 1], [0, 1]), [0.8 * X - 0.6 * Z, 0.8 * Y - 0.6 * Z], atol=1e-15)
    np.testing.assert_allclose(replace(CONE, flip=True).outward(0, 0), 0.6 * Z - 0.8 * X, atol=1e-15)
    np.testing.assert_allclose(CONE.amid, [1, 0, 1])
    assert CONE.extent == pytest.approx(2.5)  # half of the way up, which is 5
    assert CONE.outermost == pytest.approx(np.sqrt(10) + 4)
    assert CONE.longest_normal == pytest.approx(np.linalg.norm(CONE.normal(0.3, 1)))
    assert region_to_dict(CONE)["cone_side"]["radii"] == [1.0, 4.0]
    entry = validate(RegionEntry, region_to_dict(CONE))
    np.testing.assert_array_equal(entry.region("r", False).at(0.2, 0.7), CONE.at(0.2, 0.7))
    with pytest.raises(InputError, match="radii: is 0; it must be positive"):
        replace(CONE, radii=(1.0, 0.0))
    with pytest.raises(InputError, match=re.escape("radii: has shape (3,), needs (2,)")):
        replace(CONE, radii=(1.0, 2.0, 3.0))  # type: ignore[arg-type]


def test_sizes() -> None:
    np.testing.assert_allclose(QUARTER.amid, [1, 0, 1])
    assert QUARTER.extent == pytest.approx(np.sqrt(0.125))  # half of the chord; it is higher than that
    assert replace(QUARTER, heights=(0, 0.1)).extent == pytest.approx(0.05)
    u, v = np.random.default_rng(0).random((2, 500))
    for seed in range(6):
        side = some(seed)
        assert np.linalg.norm(side.at(u, v), axis=1).max() <= side.outermost
        assert np.linalg.norm(side.normal(u, v), axis=1).max() <= side.longest_normal * (1 + 1e-12)


@pytest.mark.parametrize(
    "region", [some(1), some(2), CONE, bump(np.random.default_rng(1), (3, 2)), Cap(X, 0.3, Y, 2.0, True)]
)
def test_derivatives_are_those_of_differences_and_below_their_bounds(region: Region) -> None:
    rng, step, cells = np.random.default_rng(3), 1e-5, 4
    u, v = (lo + (hi - lo) * rng.uniform(0.01, 0.99, 200) for lo, hi in region.bounds)
    surface, normal = region.derivative_bounds(cells)

    def differences(f, order: tuple[int, int]) -> np.ndarray:
        a, b = step * np.array(order)
        return (f(u + a, v + b) - f(u - a, v - b)) / (2 * step)

    for k, (i, j) in enumerate(((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))):
        last = (1, 0) if i else (0, 1)
        before = i - last[0], j - last[1]
        found = region.at(u, v, i, j)
        np.testing.assert_allclose(found, differences(lambda a, b, o=before: region.at(a, b, *o), last), atol=2e-8)
        assert np.linalg.norm(found, axis=1).max() <= surface[..., k].max() * (1 + 1e-12)
        if i + j == 1:
            turned = np.linalg.norm(differences(region.outward, last), axis=1).max()
            assert turned <= normal[..., k].max() * (1 + 1e-6) + 1e-9
    along = np.cross(region.at(u, v, 1, 0), region.at(u, v, 0, 1))
    np.testing.assert_allclose(np.cross(along, region.outward(u, v)), 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(region.outward(u, v), axis=1), 1, atol=1e-12)


def test_curvature_is_that_of_a_cylinder() -> None:
    """1 / radius around, none along, in whatever frame; a hollow's is negative."""
    R = turn(np.random.default_rng(5))
    for side, sign in ((QUARTER, 1), (replace(QUARTER, flip=True), -1)):
        normal = R @ side.outward(0.3, 0.7)
        found = curvature_at(side, (0.3, 0.7), R, normal)
        np.testing.assert_allclose(principal_curvatures(found, normal), sorted([0, sign * 2.0]), atol=1e-12)
        np.testing.assert_allclose(found @ R @ Z, 0, atol=1e-12)
    with pytest.raises(InputError, match="needs the parameters of the contact on the patch"):
        curvature_at(QUARTER, None, R, X)


def test_a_rigid_motion_moves_its_points() -> None:
    side, T = some(2), pose(np.array([0.1, 2, 3]), turn(np.random.default_rng(6)))
    np.testing.assert_allclose(moved(side, T).at(0.2, 0.9), T[:3, :3] @ side.at(0.2, 0.9) + T[:3, 3], atol=1e-12)


# --- files ------------------------------------------------------------------------------------------


def read(data: object) -> Region:
    return validate(RegionEntry, data).region("here", False)


@pytest.mark.parametrize("region", [some(3), some(4), bump(np.random.default_rng(1), flip=True), Cap(X, 0.3, Y, 2.0)])
def test_every_number_comes_back(region: Region) -> None:
    written = region_to_dict(region)
    again = read(written)
    assert type(again) is type(region)
    assert again.flip == region.flip
    np.testing.assert_allclose(again.at(0.3, 0.6), region.at(0.3, 0.6), atol=1e-15)
    if isinstance(region, Bezier):
        assert region_to_dict(again) == written


GOOD = region_to_dict(QUARTER)["cylinder_side"]


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("radius", 0, "cylinder_side.radius: is 0; it must be positive [m]"),
        ("radius", None, "cylinder_side.radius: is missing"),
        ("axis", [0, 0, 0], "cylinder_side.axis: is zero; a direction is needed"),
        ("axis", [0, 1], "cylinder_side.axis[2]: is missing"),
        ("x_axis", [0, 0, 0], "cylinder_side.x_axis: is zero; a direction is needed"),
        ("x_axis", [0, 0, -3], "cylinder_side.x_axis: is parallel to axis; a direction across it is needed"),
        ("angles", [1, 1], "cylinder_side.angles: is [1, 1]; the lower one comes first [rad]"),
        ("angles", [0, 6.3], "cylinder_side.angles: is 6.3 wide; a full turn is 6.28318531 [rad]"),
        ("angles", [1e5, 1e5 + 1], "cylinder_side.angles: is [100000, 100001]; at most 100 rad either way is possible"),
        ("heights", [0.2, 0.1], "cylinder_side.heights: is [0.2, 0.1]; the lower one comes first [m]"),
        ("heights", [0.2], "cylinder_side.heights[1]: is missing"),
        ("height", [0, 1], "cylinder_side.height: is not a known field"),
        ("center", [0, 0, float("nan")], "cylinder_side.center[2]: "),
    ],
)
def test_each_wrong_field_has_its_message(field: str, value: object, message: str) -> None:
    data = {key: x for key, x in (GOOD | {field: value}).items() if x is not None}
    with pytest.raises(InputError, match=re.escape(message)):
        read({"cylinder_side": data})


def test_a_full_turn_is_allowed_and_two_kinds_are_not() -> None:
    assert isinstance(read({"cylinder_side": GOOD | {"angles": [-np.pi, np.pi]}}), CylinderSide)
    with pytest.raises(InputError, match="exactly one of bezier, cap, cylinder_side, cone_side is needed"):
        read({"cylinder_side": GOOD} | region_to_dict(Cap(X, 0.3, Y, 2.0)))
