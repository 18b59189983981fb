"""Sides of cylinders in the canonical system: covered once, with bounds that hold, and solved by planted solutions."""

from __future__ import annotations

import numpy as np
import pytest

from handfast.model.bernstein import evaluate
from handfast.model.cylinder_side import CylinderSide
from handfast.papers.box_shrinking import Over, PaperSolver, ShrinkingSettings, SystemBox
from handfast.papers.canonical_equations import canonical
from handfast.papers.patch_form import PatchForm, cylinder_parameters
from handfast.readers.load_hand import load_hand
from tests.support.canonical_systems import TIGHT, at, check_solution, sah_system, tip
from tests.support.planted import bump, plant, pose, turn

X, Y, Z = np.eye(3)


@pytest.mark.parametrize("turned", [0.3, np.pi - 0.01, np.pi + 0.01, 5.0, 2 * np.pi])
@pytest.mark.parametrize("flip", [False, True])
def test_sides_are_covered_once(turned: float, flip: bool) -> None:
    rng = np.random.default_rng(2)
    side = CylinderSide(rng.normal(size=3), 0.5, X + Y, rng.normal(size=3), (-1.0, turned - 1.0), (-0.3, 0.5), flip)
    T = pose(rng.normal(size=3), turn(rng))
    form = PatchForm.of(side, T, 0.1)
    shares = np.sort(np.concatenate([[0.0, 1.0], rng.random(200)]))
    reached = []
    for share, v in zip(shares, rng.random(len(shares)), strict=True):
        u, height = cylinder_parameters(side, share, v)
        reached.append(u)
        m = evaluate(form.normals, u, height)
        norm = np.linalg.norm(m)
        there = form.at(u, height, m / norm)
        np.testing.assert_allclose(m / norm, T[:3, :3] @ side.outward(share, v), atol=1e-12)
        np.testing.assert_allclose(0.1 * there, T[:3, :3] @ side.at(share, v) + T[:3, 3], atol=1e-12)
        assert form.norm[0] <= norm <= form.norm[1] * (1 + TIGHT)
        for value, box in ((there, form.point_box), (m, form.normal_box), (m / norm, form.unit_box)):
            assert (box[0] - TIGHT <= value).all()
            assert (value <= box[1] + TIGHT).all()
    assert (np.diff(reached) > 0).all()
    assert (reached[0], reached[-1]) == pytest.approx((0, 1), abs=1e-12)


def test_boxes_are_tight() -> None:
    """A quarter of a cylinder about z: its normals fill a quarter of the circle."""
    form = PatchForm.of(CylinderSide(np.zeros(3), 2.0, Z, X, (0.0, np.pi / 2), (1.0, 4.0)), np.eye(4), 1.0)
    np.testing.assert_allclose(form.unit_box, [[0, 0, 0], [1, 1, 0]], atol=1e-11)
    np.testing.assert_allclose(form.point_box, [[0, 0, 1], [2, 2, 4]], atol=1e-11)


@pytest.mark.parametrize("turned", [1.0, 5.0])
def test_sides_on_hand_and_object(turned: float) -> None:
    """As many variables and equations as with patches; a planted solution solves it, a shifted one does not."""
    rng = np.random.default_rng(6)
    outer = CylinderSide(np.zeros(3), 0.03, Z, X, (-1.0, turned - 1.0), (0.0, 0.05))
    hollow = CylinderSide(X, 0.05, Y, Z, (0.5, 0.5 + turned), (-0.02, 0.02), flip=True)
    regions = [("index_distal", tip(), hollow), ("palm", outer, bump(rng)), ("thumb_distal", outer, outer)]
    planted = plant(load_hand("schunk-sah"), regions, rng)
    system = canonical(planted.task)
    plain = canonical(sah_system("index_distal palm thumb_distal").task)
    assert (system.n_v, system.n_e, system.d) == (plain.n_v, plain.n_e, plain.d)
    check_solution(planted, system)
    assert "contact 0: cap on index_distal, cylinder side on object" in system.describe()
    planted.spots[2][1][1] += 0.1  # a tenth of the height beside the contact
    assert np.abs(system.residual(at(planted, system))).max() > 1e-4


def test_box_shrinking_keeps_a_solution_and_discards_what_holds_none() -> None:
    rng = np.random.default_rng(2)
    side = CylinderSide(np.zeros(3), 0.03, Z, X, (-1.0, 1.0), (0.0, 0.05))
    planted = plant(load_hand("schunk-sah"), [("index_distal", tip(), side)], rng)
    system = canonical(planted.task, unit=1.0)
    x = system.expanded.lift(at(planted, system))
    solver = PaperSolver(system, ShrinkingSettings(over=Over.ORIGINAL, narrow=1e-6))
    low, high = (
        np.clip(x + sign * 0.005 * solver.root.sides, solver.root.lower, solver.root.upper) for sign in (-1, 1)
    )
    after = solver.shrink(SystemBox(low, high))
    assert isinstance(after, SystemBox)
    assert after.holds(x)
    point = system.layout.sides[0][1].point[0]
    low[point], high[point] = low[point] + 0.02, high[point] + 0.02  # the object's point beside its surface
    assert not isinstance(solver.shrink(SystemBox(low, high)), SystemBox)
