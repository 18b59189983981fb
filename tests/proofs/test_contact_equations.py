"""Rotations of quaternions of any length: by the formula written out, whole numbers without any rounding."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.contact_equations import _bilinear, rotations
from handfast.proofs.intervals import Interval
from tests.support.planted_proofs import Spot, equations_of, odd_hand, plant


def matrix(q: Array) -> Array:
    """Of a quaternion (w, x, y, z), times its squared length."""
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


@pytest.mark.parametrize("seed", range(4))
def test_the_matrix_of_a_quaternion_and_its_derivatives(seed: int) -> None:
    """The matrix is quadratic: its derivative is half of what it changes by from one less to one more."""
    q = np.random.default_rng(seed).integers(-8, 9, 4).astype(float)
    by = (q @ _bilinear()).reshape(4, 3, 3)
    wanted = [(matrix(q + e) - matrix(q - e)) / 2 for e in np.eye(4)]
    assert by.tolist() == np.array(wanted).tolist()
    R, slope = rotations(Interval.of(q[None]))
    size = q @ q
    np.testing.assert_allclose((R.lo + R.hi)[0] / 2, matrix(q) / size, atol=1e-14)
    for k in range(4):  # of the matrix over the squared length, whose derivative is 2 q
        np.testing.assert_allclose(
            (slope.lo + slope.hi)[k, 0] / 2, (wanted[k] - 2 * q[k] * matrix(q) / size) / size, atol=1e-14
        )


@pytest.mark.parametrize("kinds", [("cap", "bilinear"), ("bicubic", "cap"), ("cap", "cap")])
def test_derivatives_are_what_values_change_by(kinds: tuple[str, ...]) -> None:
    """At a planted configuration, along a direction in all coordinates; all is known but for rounding."""
    rng = np.random.default_rng(5)
    planted = plant(odd_hand(rng), [Spot(*spot, "bilinear") for spot in zip(("b3", "c2"), kinds, strict=True)], rng)
    equations = equations_of(planted.task)
    x, h = np.array([planted.values[label] for label in equations.column]), 1e-6
    along = rng.normal(size=len(x))
    found = equations.at(Interval.of(np.array([x, x + h * along, x - h * along])))
    caps = np.array([kind == "cap" for kind in kinds])
    assert found.F.value.shape == (3, (3 * caps + 5 * ~caps).sum())
    assert np.abs(found.F.value.mid[0]).max() < 1e-12
    for dual in (found.F, found.opposite):
        assert (dual.slope.hi - dual.slope.lo)[:, 0].max() < 1e-12
        change = (dual.value.mid[1] - dual.value.mid[2]) / (2 * h)
        np.testing.assert_allclose(np.tensordot(along, dual.slope.mid[:, 0], 1), change, atol=1e-7)
    assert (found.opposite.value.mid[0, ~caps] > 0).all()  # surfaces of hand and object face each other
    on_hand = [label for label in equations.column if label.startswith("contact:") and label[-1] in "uv"]
    assert on_hand == [f"contact:{k}:{name}" for k in np.flatnonzero(~caps) for name in "uv"]
