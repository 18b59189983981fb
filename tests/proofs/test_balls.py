"""Balls as floats: never less than they are."""

from __future__ import annotations

import numpy as np
from flint import arb, ctx

from handfast.proofs.balls import most


def test_sizes_of_balls_are_rounded_up() -> None:
    with ctx.workprec(320):
        balls = [arb(sign * k, radius) / 7 for k in range(1, 60) for sign in (1, -1) for radius in (0, 1e-30, 0.1)]
        bounds = most(np.array(balls, dtype=object).reshape(-1, 6))
        assert bounds.shape == (59, 6)
        for x, bound in zip(balls, bounds.ravel().tolist(), strict=True):
            assert arb(bound) >= abs(x)
            assert bound <= float(x.abs_upper()) * (1 + 1e-14)
        assert most(np.array([arb("nan"), arb("inf")], dtype=object)).tolist() == [np.inf, np.inf]
