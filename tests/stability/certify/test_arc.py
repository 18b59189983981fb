"""Arcs: no state of one is worse than its bound."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp
from handfast.stability import model
from handfast.stability.certify import arc
from handfast.stability.certify.arc import Arc
from handfast.stability.certify.certificate import Question
from handfast.stability.goal import LARGEST
from handfast.stability.model import State
from handfast.stability.queries import MaxAnswer, maximum
from handfast.stability.witness import VALID
from tests.support.problems import table

# --- arcs -------------------------------------------------------------------------------------------


def test_no_state_of_an_arc_is_worse_than_its_bound(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    grasp, direction, answer = holed
    seen = 0
    for a in answer.interval.arcs:
        most = arc.residual_bound(answer.question, a)
        assert most <= VALID
        for s in np.linspace(a.first, a.last, 7):
            assert model.residuals(grasp, s * direction, a.state(float(s))).worst <= most * (1 + 1e-6) + 1e-15
            seen += 1
    assert seen > 100


PARTS = [f.name for f in fields(model.Residuals)]


@pytest.mark.parametrize("eta", [0.0, 0.05])
@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3, 0.3, 3.0])
def test_the_bounds_hold_for_any_curve(holed: tuple[Grasp, np.ndarray, MaxAnswer], size: float, eta: float) -> None:
    """Also for arcs that are no solutions at all, states with errors: equation by equation, and not by far."""
    grasp, direction, answer = holed
    rng = np.random.default_rng(int(1e9 * size))
    q = replace(answer.question, eta=eta)
    tight = dict.fromkeys(PARTS, np.inf)
    for a in answer.interval.arcs[::3]:
        controls = tuple(
            State(*(x + size * rng.normal(size=x.shape) for x in (s.r, s.q, s.c, s.f, s.coupling))) for s in a.controls
        )
        bad = Arc(a.first, a.last, controls)
        most = arc.residuals(q, bad)
        found = [
            model.residuals(grasp, s * direction, bad.state(float(s)), eta=eta)
            for s in np.linspace(a.first, a.last, 33)
        ]
        for name in PARTS:
            worst = max(getattr(r, name) for r in found)
            assert worst <= getattr(most, name) * (1 + 1e-9) + 1e-15
            if worst > 0:
                tight[name] = min(tight[name], getattr(most, name) / worst)
    assert all(ratio < 5 for name, ratio in tight.items() if np.isfinite(ratio)) or size > 1


def test_a_turn_of_friction_is_seen_along_and_across() -> None:
    """One contact that slides along t1; friction of full strength, but turned: missing energy, and a force across."""
    grasp = Grasp([Contact(np.array([0.1, 0, 0]), np.array([0, 0, 1.0]), 0.5)])
    r = grasp.contacts[0].frame @ np.array([-1.0, 2.0, 0.0])  # d = (-1, 2, 0)
    for angle in (1e-6, 1e-3, 0.5, np.pi):
        c = np.array([1.0, -0.5 * np.cos(angle), 0.5 * np.sin(angle)])
        state = State(np.r_[r, np.zeros(3)], np.zeros(0), c, np.zeros(0), np.zeros(0))
        q = Question(grasp, LARGEST, np.zeros(6), np.array([0, 0, -1.0, 0, 0, 0]))
        said = arc.residuals(q, Arc(1.0, 1.5, (state, state)))
        found = model.residuals(grasp, np.array([0, 0, -1.0, 0, 0, 0]), state)
        assert found.dissipation <= said.dissipation <= 1.5 * found.dissipation
        assert said.dissipation >= 0.4 * angle / np.pi


def test_a_length_is_enclosed_between_its_nodes() -> None:
    """From (-1, 1) to (1, 1) a straight line is 1 long in the middle, not sqrt 2 as at both ends."""
    curve = np.array([[[-1.0, 1.0]], [[1.0, 1.0]]])
    length, off = arc._norm(curve, arc.least_norm(curve))
    assert length == pytest.approx(np.full((2, 1), np.sqrt(2)))
    assert np.sqrt(2) - 1 <= off[0] < 1.0


def test_the_worst_normal_closes_a_contact_in_the_middle_of_an_arc() -> None:
    """Open at both ends, where it slides faster; in the middle the gap is closed by normals that are off."""
    grasp = Grasp([Contact(np.array([0.1, 0, 0]), np.array([0, 0, 1.0]), 0.5)])
    eta, frame = 0.1, grasp.contacts[0].frame
    ends = []
    for side in (-1.0, 1.0):
        r = np.r_[frame @ np.array([-1.2 * np.tan(eta), side, 1.0]), np.zeros(3)]
        ends.append(State(r, np.zeros(0), np.zeros(3), np.zeros(0), np.zeros(0)))
    push = np.array([0, 0, -1.0, 0, 0, 0])
    q = Question(grasp, LARGEST, np.zeros(6), push, eta=eta)
    between = Arc(1.0, 1.5, tuple(ends))
    found = [model.residuals(grasp, s * push, between.state(s), eta=eta).normal for s in (1.0, 1.25, 1.5)]
    assert found[0] == found[2] == 0.0
    assert 0.0 < found[1] <= arc.residuals(q, between).normal


def test_a_convex_combination_across_a_slip_is_refused(holed: tuple[Grasp, np.ndarray, MaxAnswer]) -> None:
    """Two right states on both sides of a hole do not make those between them right."""
    _, _, answer = holed
    ((first, last),) = answer.interval.holes
    left = max((a for a in answer.interval.arcs if a.last <= first), key=lambda a: a.last)
    right = min((a for a in answer.interval.arcs if a.first >= last), key=lambda a: a.first)
    across = Arc(left.last, right.first, (left.controls[-1], right.controls[0]))
    assert arc.residual_bound(answer.question, across) > 1e-3


def test_a_limit_that_is_passed_between_two_magnitudes_is_seen() -> None:
    answer = maximum(table(), [1, 0, 0, 0, 0, 0], base=[0, 0, -10, 0, 0, 0], interval=True)
    a = answer.interval.arcs[0]
    most = max(float(s.c[0::3].max()) for s in a.controls)
    assert arc.residual_bound(replace(answer.question, force_limit=0.99 * most), a) == np.inf
    assert arc.residual_bound(replace(answer.question, force_limit=1.01 * most), a) <= VALID


def test_a_contact_without_friction_has_an_arc() -> None:
    """A smooth table: straight down, everything is resisted."""
    answer = maximum(table(mu=0.0), [0, 0, -1.0, 0, 0, 0], base=[0, 0, -10, 0, 0, 0], interval=True)
    assert answer.interval.holds_from_zero_to == answer.lower
    assert answer.verify().ok


def test_bezier_products_and_least_norms() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(4, 2, 3)), rng.normal(size=(4, 2, 3))
    t = np.linspace(0, 1, 11)
    three, six = arc.bernstein(3, t), arc.bernstein(6, t)
    along = [np.einsum("ti,inj->tnj", three, x) for x in (a, b)]
    assert np.einsum("ti,inj->tnj", six, arc.product(a, b)) == pytest.approx(along[0] * along[1], abs=1e-12)
    assert (arc.least_norm(a) <= np.linalg.norm(along[0], axis=2).min(axis=0) + 1e-12).all()


@pytest.mark.parametrize(("first", "last", "count"), [(1.0, 1.0, 2), (2.0, 1.0, 2), (-1.0, 1.0, 2), (0.0, 1.0, 1)])
def test_arcs_that_are_none(first: float, last: float, count: int) -> None:
    state = State(np.zeros(6), np.zeros(0), np.zeros(3), np.zeros(0), np.zeros(0))
    with pytest.raises(InputError, match="range of magnitudes" if count == 2 else "controls"):
        Arc(first, last, (state,) * count)
