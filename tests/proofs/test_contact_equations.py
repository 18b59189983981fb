"""Rotations of quaternions of any length: by the formula written out, whole numbers without any rounding."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.proofs.contact_equations import _bilinear, rotations
from handfast.proofs.intervals import Interval


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
