"""Derivatives in interval arithmetic: they enclose differences in 600 bits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from handfast.proofs.intervals import (
    Dual,
    Interval,
    columns,
    cos,
    cross,
    dot,
    join,
    sin,
    sqr,
    sqrt,
    unit,
)
from tests.support.enclosures import balls, encloses

RULES: dict[str, Callable] = {
    "+": lambda x, y: x + y + 2.0,
    "-": lambda x, y: 1.0 - (x - y) - 3.0,
    "*": lambda x, y: 0.5 * x * y * x,
    "/": lambda x, y: x / (y * y + 1.0) / 3.0,
    "negative": lambda x, y: -x * y,
    "power": lambda x, y: _of(x, sqr, lambda v: v * v) - y,
    "root": lambda x, y: _of(x * x + y * y + 1.0, sqrt, np.sqrt),
    "sine": lambda x, y: _of(x * y, sin, np.sin),
    "cosine": lambda x, y: _of(x * y + y, cos, np.cos),
    "constant": lambda x, y: x * C - C * y + C + (C - x) / C,
}
C = np.array([1.5, -2.0, 0.25])


def _of(x: object, function: Callable, plain: Callable) -> object:
    return function(x) if isinstance(x, Dual) else plain(x)


@pytest.mark.parametrize("name", RULES)
def test_derivatives_enclose_exact_ones(name: str) -> None:
    """At random points of a box, by differences in 600 bits."""
    flint, rng, rule = pytest.importorskip("flint"), np.random.default_rng(7), RULES[name]
    h = 2.0**-150
    for radius in (0.0, 1e-6, 0.1):
        middle = rng.normal(size=(2, 3))
        X = Interval.around(middle, radius)
        x, y = (Dual(X[i], Interval.of(np.repeat(np.eye(2)[i][:, None], 3, axis=1))) for i in range(2))
        r = rule(x, y)
        with flint.ctx.workprec(600):
            for _ in range(5):
                p = balls(middle + radius * rng.uniform(-1, 1, size=(2, 3)))
                value = rule(*p)
                assert encloses(r.value, value)
                slopes = [
                    (rule(*(p + d)) - rule(*(p - d))) / (2 * h)
                    for d in (np.array([[h], [0.0]]), np.array([[0.0], [h]]))
                ]
                assert encloses(r.slope, np.array(slopes), 1e-60)


def test_derivatives_of_products_of_matrices_and_vectors() -> None:
    """A matrix times, sum, cross, unit and columns, in one function of two variables."""
    flint, rng = pytest.importorskip("flint"), np.random.default_rng(8)
    A, B = rng.normal(size=(2, 3, 3)), rng.normal(size=(3, 3))

    def function(x: object, y: object) -> tuple:
        """With x and y as (2, 1, 1)."""
        M = x * A + y * y * B
        N = (A @ M) * M
        if isinstance(x, Dual):
            u, v = N[..., 0, :], unit(N[..., 1, :])
            return columns([cross(u, v), u])[..., 0], dot(u, v), join([u, v], -1), N.sum()
        u, v = N[..., 0, :], N[..., 1, :]
        v = v / np.sqrt((v * v).sum(axis=-1))[..., None]
        w = np.stack([u[..., i - 2] * v[..., i - 1] - u[..., i - 1] * v[..., i - 2] for i in range(3)], -1)
        return w, (u * v).sum(axis=-1), np.concatenate([u, v], -1), N.sum(axis=-1)

    middle, radius, h = np.array([0.4, -0.7]), 1e-7, 2.0**-150
    X = Interval.around(middle, radius)
    x, y = (
        Dual(X[i] + np.zeros((2, 1, 1)), Interval.of(np.eye(2)[i].reshape(2, 1, 1, 1) + np.zeros((2, 2, 1, 1))))
        for i in range(2)
    )
    results = function(x, y)
    with flint.ctx.workprec(600):
        p = balls(np.tile((middle + 0.5 * radius).reshape(2, 1, 1, 1), (1, 2, 1, 1)))
        steps = [h * np.eye(2)[i].reshape(2, 1, 1, 1) for i in range(2)]
        slopes = [
            [(a - b) / (2 * h) for a, b in zip(function(*(p + d)), function(*(p - d)), strict=True)] for d in steps
        ]
        for r, value, *slope in zip(results, function(*p), *slopes, strict=True):
            assert encloses(r.value, value)
            assert encloses(r.slope, np.array(slope), 1e-60)
