"""Many states are judged as one by one."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.model.grasp import Grasp
from handfast.stability.problem import judge
from handfast.stability.problem.model import StateRows
from tests.support.problems import bell, pinch, table
from tests.support.rounding_edges import hand

K = 24


def states(g: Grasp, seed: int) -> tuple[np.ndarray, StateRows]:
    """Loads and states out of every balance; some carry nothing, some are as large or small as numbers get."""
    rng, mech = np.random.default_rng(seed), g.mechanism
    sizes = 6, g.l, 3 * g.m, mech.a, len(mech.A), g.l
    x = [rng.normal(size=(K, n)) for n in sizes]
    x[2][1] = x[2][2, :3] = 0.0
    w = rng.normal(size=(K, 6))
    w[1] = 0.0
    for i, factor in ((3, 1e-120), (4, 1e20)):
        w[i] *= factor
        for part in x:
            part[i] *= factor
    x[0][5] *= 1e7  # motions whose sums are taken without rounding
    return w, StateRows(*x)


@pytest.mark.parametrize("g", [pinch(), bell(), table(), hand(), hand(-1.0)], ids=lambda g: g.name)
@pytest.mark.parametrize(("eta", "mdp"), [(0.0, True), (0.2, True), (0.0, False)])
def test_rows_are_judged_as_one_by_one(g: Grasp, eta: float, mdp: bool) -> None:
    w, x = states(g, 1)
    commands = np.random.default_rng(2).normal(size=x.f.shape) * (g.command != 0)
    for f_c in (None, commands):
        found = judge.residuals(g, w, x, eta=eta, mdp=mdp, command=f_c).worst
        each = [
            judge.residuals(g, w[i], x.row(i), eta=eta, mdp=mdp, command=None if f_c is None else f_c[i]).worst
            for i in range(K)
        ]
        np.testing.assert_allclose(found, each, rtol=1e-9)


@pytest.mark.parametrize("part", ["r", "q", "c", "f", "coupling", "reaction"])
def test_each_unknown_counts(part: str) -> None:
    """At rest nothing is missed; whatever is changed is seen."""
    g = hand().with_preload(None)
    rest = StateRows(*(np.zeros((1, n)) for n in (6, g.l, 3 * g.m, g.mechanism.a, len(g.mechanism.A), g.l)))
    nothing = np.zeros((1, 6))
    assert judge.residuals(g, nothing, rest).worst[0] == 0.0
    getattr(rest, part)[0, 0] = 0.1
    assert judge.residuals(g, nothing, rest).worst[0] > 1e-3


def test_what_is_no_number_is_not_good_enough() -> None:
    w, x = states(pinch(), 3)
    x.c[7, 2] = np.nan
    found = judge.residuals(pinch(), w, x).worst
    assert not found[7] <= 1e-9
    assert np.isfinite(np.delete(found, 7)).all()
