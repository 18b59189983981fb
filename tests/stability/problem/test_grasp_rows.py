"""Many grasps of one shape as arrays are these grasps one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.stability.problem import judge, model, scaled_problem
from handfast.stability.problem.grasp_limits import NO_LIMITS
from handfast.stability.problem.grasp_rows import GraspRows, shape_of
from handfast.stability.problem.model import StateRows
from tests.support.problems import bell, nest, pinch, solved, table
from tests.support.rounding_edges import hand

KINDS = {
    "random": [solved(seed, 4).grasp.with_preload(np.array([0.1 + seed, 0.0, 2.0 - seed])) for seed in (0, 1, 3, 5)],
    "coupled": [hand(), hand(-1.0), hand().with_friction(0.3)],
    "two contacts": [pinch(), pinch(0.3, 0.05), pinch(offset=0.01)],
    "fixtures": [nest(), nest(0.5)],
    "one point": [Grasp([Contact(np.array([0.0, 0.0, 0.02]), np.array([0.0, 0.0, 1.0]), 0.5)])],
}
GRASPS = pytest.mark.parametrize("grasps", list(KINDS.values()), ids=list(KINDS))


def loads(k: int) -> np.ndarray:
    return np.random.default_rng(k).normal(size=(k, 6)) * [1, 1, 1, 0.05, 0.05, 0.05]


@GRASPS
def test_maps_and_lengths(grasps: list[Grasp]) -> None:
    assert len({shape_of(g) for g in grasps}) == 1
    rows = GraspRows.of(grasps)
    for name in ("G", "J", "size", "spacing", "mu", "positions", "touches", "command"):
        each = np.array([getattr(g, name) for g in grasps], dtype=float)
        np.testing.assert_allclose(getattr(rows, name), each, rtol=1e-13, atol=1e-15, err_msg=name)
    for ask in (model.joint_arms, model.joint_units, model.actuator_arms, model.commanded):
        np.testing.assert_allclose(ask(rows), [ask(g) for g in grasps], rtol=1e-13)


@GRASPS
@pytest.mark.parametrize("loaded", [False, True])
def test_scaled_problems(grasps: list[Grasp], loaded: bool) -> None:
    W = loads(len(grasps))
    balanced = [not scaled_problem.unbalanced(g, w) for g, w in zip(grasps, W, strict=True)]
    base, along = (W, None) if loaded else (0 * W, W)
    many = scaled_problem.build_rows(GraspRows.of(grasps), base, along, NO_LIMITS)
    for k in np.flatnonzero(balanced):
        one = scaled_problem.build(grasps[k], base[k], None if along is None else along[k])
        for name in ("G", "J", "R", "A", "w0", "direction", "f_c", "force", "direction_scale", "actuator_scale"):
            np.testing.assert_allclose(getattr(many, name)[k], getattr(one, name), rtol=1e-12, atol=1e-13, err_msg=name)
        assert many.moves.tolist() == one.moves.tolist()


@GRASPS
@pytest.mark.parametrize("eta", [0.0, 0.2])
def test_states_are_judged_alike(grasps: list[Grasp], eta: float) -> None:
    """Those of huge motions too, whose sums are taken without rounding, and those of vanishing numbers."""
    rng, g, k = np.random.default_rng(0), grasps[0], 4 * len(grasps)
    sizes = 6, g.l, 3 * g.m, g.mechanism.a, len(g.mechanism.A), g.l
    x = [rng.normal(size=(k, n)) for n in sizes]
    x[0][1] *= 1e7
    w = loads(k)
    for part in (w, *x):
        part[2] *= 1e-120
    states, each = StateRows(*x), [grasps[i % len(grasps)] for i in range(k)]
    found = judge.residuals(GraspRows.of(each), w, states, eta=eta).worst
    alone = [judge.residuals(each[i], w[i], states.row(i), eta=eta).worst for i in range(k)]
    np.testing.assert_allclose(found, alone, rtol=1e-9)


def test_a_row_depends_on_no_other() -> None:
    grasps = KINDS["random"]
    whole, w = GraspRows.of(grasps), loads(len(grasps))
    for k, g in enumerate(grasps):
        for one in (GraspRows.of([g]), whole.rows(np.array([k]))):
            a, b = (
                scaled_problem.build_rows(rows, 0 * v, v, NO_LIMITS) for rows, v in ((whole, w), (one, w[k : k + 1]))
            )
            for name in ("G", "J", "R", "w0", "direction", "f_c", "force"):
                np.testing.assert_array_equal(getattr(a, name)[k], getattr(b, name)[0], err_msg=name)


def test_what_stands_by_itself() -> None:
    """Laws of joints and soft fingers; other sizes, types and places of commands are other shapes."""
    g = bell()
    rubbing = Grasp(g.contacts, [replace(j, friction=0.01) for j in g.joints], g.mechanism, g.command)
    soft = Grasp([replace(c, torsion=0.002) for c in g.contacts], g.joints, g.mechanism, g.command)
    assert shape_of(rubbing) is None
    assert shape_of(soft) is None
    sliding = Grasp(g.contacts, [replace(j, type="prismatic") for j in g.joints], g.mechanism, g.command)
    others = [g, sliding, g.with_preload({"prox_1": 0.1}), pinch(), table(), nest()]
    assert len({shape_of(other) for other in others}) == len(others)
    assert shape_of(g) == shape_of(g.with_friction(0.2)) == shape_of(g.with_preload(2 * g.command))
