"""Ranks of rows that may depend on each other by structure, parts between two modes, and what boxes allow for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.model.grasp import Contact, Grasp
from handfast.proofs.newton import PRIME, ModeEquations, Modes, NotShown, System, between, greedy, independent, spans
from handfast.proofs.states import ContactMode, Part, Problem, State
from handfast.proofs.tolerance import UNIT_ROUNDOFF
from tests.proofs.test_existence import held, likeliest, pivot, sliding
from tests.support.exact_states import problem


@pytest.mark.parametrize(
    "basis, others, so",
    [
        ([[1, 0, 1], [0, 1, 1]], [[1, 1, 2]], True),
        ([[1, 0, 1], [0, 1, 1]], [[1, 1, 2 + fmpq(1, 2**70)]], False),
        ([[1, 0], [2, 0]], [[0, 1]], False),  # as many as the rank of all, but dependent themselves
        ([[1, 0], [2, 0]], [[3, 0]], True),
        ([[1, 0]], [[0, PRIME]], False),  # modulo the prime it is 0
        ([], [[0, 0]], True),
        ([], [[0, 1]], False),
    ],
)
def test_rows_span_others_exactly(basis, others, so: bool) -> None:
    rational = lambda rows: [[fmpq(x) for x in row] for row in rows]  # noqa: E731
    assert spans(rational(basis), rational(others)) is so


@pytest.mark.parametrize(
    ("table", "at", "units", "kept"),
    [
        ([], [], [], []),
        ([[1, 0], [0, 1]], [0, 0], [1, 1], [0, 1]),
        ([[1, 0], [0, 1e-12]], [0, 0], [1, 1e-12], [0, 1]),  # in its own unit it is no small row
        ([[1, 0], [0, 1e-12]], [0, 0], [1, 1], None),
        ([[1, 0], [2, 0]], [1, 2], [1, 1], [0]),
        ([[1, 0], [2, 0]], [1, 2 + 2**-40], [1, 1], None),  # no motion keeps both
        ([[1, 0], [1, 2**-40]], [0, 0], [1, 1], None),
        ([[1, 0], [0, 1], [1, 1]], [1, 2, 3], [1, 1, 1], [0, 1]),
        ([[1, 0], [0, 1], [1, 1]], [1, 2, 4], [1, 1, 1], None),
    ],
)
def test_rows_that_are_held_are_kept_but_for_those_that_follow_exactly(table, at, units, kept) -> None:
    """Rows of motions (x, y) and at what they are held; the first of all rows is held by none."""
    M = np.array([[7.0, 7.0], *table])
    exact_rows = [[fmpq(*x.as_integer_ratio()) for x in row] for row in M.tolist()]
    grasp = SimpleNamespace(rows=(M, M), row_units=np.array([1.0, *units]), column_units=np.ones(2))
    grasp.exact_rows, grasp.independent_rows = exact_rows, {}
    ends = [fmpq(*float(x).as_integer_ratio()) for x in (0, *at)]
    rows: Any = SimpleNamespace(at=np.array([0.0, *at]), exact=np.array(ends, dtype=object))
    for _ in range(2):  # the second answer is remembered
        found = independent(SimpleNamespace(grasp=grasp), np.arange(1, len(M)), rows)  # type: ignore[arg-type]
        assert found is kept is None or (found - 1).tolist() == kept


A = np.ones(3) / 3**0.5
B = A + np.array([2e-9, -2e-9, 0])


@pytest.mark.parametrize(
    ("rows", "chosen"),
    [
        (np.zeros((0, 2)), []),
        ([[0, 0], [1, 0], [1, 0.9e-9], [1, 1.1e-9]], [1, 3]),
        ([A, B, A + 2.0**28 * (B - A), [0, 0, 1]], [0, 1, 3]),  # B off A is known to 1e-7 only
    ],
)
def test_rows_are_chosen_that_are_not_near_the_span_of_those_before(rows: Any, chosen: list[int]) -> None:
    assert greedy(np.array(rows, dtype=float)).tolist() == chosen


C, P = ContactMode, Part


@pytest.mark.parametrize(
    ("contact", "full", "actuator", "joint", "part"),
    [
        ([C.STICKS, C.SLIDES], [False, False], [P.LOCKED, P.MOVES], [P.FREE, P.BACK], ""),
        ([C.STICKS, C.TOUCHES], [False, False], [P.LOW], [P.LOW], "contact 1"),
        ([C.LEANS, C.TOUCHES], [False, False], [], [], "contact 0"),
        ([C.STICKS, C.STICKS], [False, True], [P.LOW], [], "contact 1"),
        ([C.STICKS], [False], [P.RESTS, P.LOW], [P.HIGH], "actuator 1"),
        ([C.STICKS], [False], [P.RESTS, P.HIGH], [], "actuator 1"),
        ([], [], [P.LOWEST], [P.LOW], "actuator 0"),
        ([], [], [P.OPENS], [P.LOWEST, P.LOW], "joint 1"),
        ([], [], [], [P.HIGH], "joint 0"),
    ],
)
def test_which_part_is_between_two_modes(contact: Any, full: Any, actuator: Any, joint: Any, part: str) -> None:
    arrays = (np.array(x, dtype=kind) for x, kind in ((contact, int), (full, bool), (actuator, int), (joint, int)))
    modes: Modes = SimpleNamespace(**dict(zip(("contact", "full", "actuator", "joint"), arrays, strict=True)))  # type: ignore[assignment]
    assert between(modes) == part


def slides(more: Any = 0.0) -> tuple[Problem, System]:
    """Three contacts slide, two stick; more: of the load than the state carries."""
    p, x = sliding()
    modes, p = likeliest(p, x), replace(p, wrench=p.wrench + more)
    assert modes.contact.tolist() == [3, 3, 3, 2, 2]
    return p, System.of(p, modes, x, False)


@pytest.mark.parametrize("axis", range(6))
def test_what_a_state_misses_is_relative_to_its_load(axis: int) -> None:
    """0.25 N, or as much at the grasp's length."""
    p, _ = slides()
    p, system = slides(np.eye(6)[axis] * (0.25 if axis < 3 else 0.25 * p.grasp.size))
    assert system.residual == pytest.approx(0.25 / p.scale, rel=1e-9)


def test_derivatives_that_are_not_known_widen_a_box() -> None:
    """Each by 0.01: the forces of contacts that slide, by motions which are uncertain together; by 10 there is none."""
    _, system = slides()
    rows, box = system.laws.rows[:3, :3], system.box()
    wide = replace(system, K_off=system.K_off + 0.01).box()
    by_motions = np.einsum("cij,cj->ci", np.abs(system.laws.K[:3, :3, :3]), wide.d_off[rows])
    assert (wide.phi_off[rows] >= by_motions + 0.01 * wide.d_off[rows].sum(axis=1)[:, None]).all()
    assert (wide.v_off > box.v_off).all()
    with pytest.raises(NotShown, match="Newton's test fails"):
        replace(system, K_off=system.K_off + 10.0).box()


def test_every_sum_is_uncertain_by_a_rounding_of_its_terms() -> None:
    p, system = slides()
    rows, v, size = system.laws.rows, np.abs(system.v), p.grasp.rows[1]
    assert (system.d_off >= 4 * sum(size.shape) * UNIT_ROUNDOFF * (size @ v)).all()
    rounded = UNIT_ROUNDOFF * np.abs(system.laws.force)
    rounded += np.einsum("cij,cj->ci", np.abs(system.laws.K), system.d_off[rows])
    assert (system.phi_off[rows] >= rounded).all()
    assert (system.box().phi_off[rows] >= rounded).all()
    of_forces = size.T @ (UNIT_ROUNDOFF * np.abs(system.phi) + system.phi_off)
    assert (system.value_off[: len(v)] >= of_forces + UNIT_ROUNDOFF * np.abs(np.r_[p.wrench, p.grasp.torque])).all()


def test_a_force_at_its_limit_is_as_uncertain_as_the_force() -> None:
    p, system = slides()
    limit, full = float(system.laws.force[0, 0]) - 0.125, np.arange(5) == 0
    x = State.of(p.grasp, system.v, system.phi)
    at_limit = System.of(replace(p, force_limit=limit), replace(system.modes, full=full), x, False)
    assert at_limit.value[-1] == pytest.approx(0.125)
    fault = at_limit.fails(rounding=False)
    assert (fault.part, fault.rounding) == ("contact 0", False)
    assert at_limit.value_off[-1] >= at_limit.phi_off[at_limit.laws.rows[0, 0]] > 0
    np.testing.assert_array_equal(at_limit.A[-1, : len(system.v)], system.laws.K[0, 0] @ p.grasp.rows[0][:4])


def test_contacts_that_hold_almost_the_same_motions_show_nothing() -> None:
    """Two at one place with normals that are 1e-12 apart."""
    p = problem(Grasp([Contact([0, 0, 0], [1e-12 * k, 0, 1], 0.5) for k in range(2)]), [0, 0, -1.0])
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.full(2, C.STICKS), np.zeros(2, dtype=bool), none, none)
    x = State.of(p.grasp, np.zeros(6), np.zeros(len(p.grasp.rows[0])))
    with pytest.raises(NotShown, match="what is held at rest is dependent but for rounding"):
        System.of(p, modes, x, False)


def test_an_equation_that_says_nothing_is_left_out() -> None:
    """(2) of a swivel whose axis passes the fingertip is a row of zeros."""
    grasp, load = pivot(0.0)
    p, x = held(grasp, load)
    system = System.of(p, likeliest(p, x), x, False)
    assert system.used.tolist() == [0, 1, 2, 3, 4, 5, 7, 8, 9, 10]
    assert system.A.shape == (10, 11)
    assert system.regular


def test_the_magnitude_is_an_unknown_of_the_balance() -> None:
    """2.5 of a direction and the rest of the load: the same state, and derivatives by differences."""
    p, x = sliding()
    along = np.array([2.0, 0.5, 0.0, 0.0, 0.02, 0.0])
    q = replace(p, wrench=p.wrench - 2.5 * along, along=along, magnitude=2.5)
    system = System.of(q, likeliest(q, x), x, True)
    assert system.residual < 1e-12
    e, M = system.of_modes, p.grasp.rows[0]
    start = np.concatenate([system.v, system.phi[e.unknown], [2.5]])
    for k, one in enumerate(1e-4 * np.abs(start).clip(1e-3) * np.eye(len(start))):
        there, back = (e.at(M, start + sign * one)[3] for sign in (1, -1))
        np.testing.assert_allclose(system.A[:, k], (there - back) / (2 * one[k]), rtol=1e-4, atol=1e-4)
    assert (system.columns[-1] * np.abs(along * p.grasp.column_units[:6])).max() == pytest.approx(1.0)
    box = system.box()
    assert box.magnitude == 2.5
    assert 0 < box.magnitude_off < 1e-9


def pressed(load: list[float]) -> System:
    """A contact without friction that presses along x against a load."""
    p = problem(Grasp([Contact([-0.05, 0, 0], [1, 0, 0], 0.0)]), load)
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.array([C.SLIDES]), np.zeros(1, dtype=bool), none, none)
    motion = np.array([-1.0, 0, 0, 0, 0, 0])
    return System.of(p, modes, State.of(p.grasp, motion, np.array([1.0, 0, 0, 0])), False)


def test_a_balance_that_reads_0_is_left_out_and_a_load_that_nothing_carries_is_none() -> None:
    system = pressed([-1.0, 0, 0, 0, 0, 0])
    assert system.used.tolist() == [0]
    assert not system.contradictory
    assert system.box().v[0] == -1.0
    for axis in range(1, 6):
        load = np.eye(6)[axis] * 1e-300
        system = pressed([-1.0, *load[1:]])
        assert axis in system.used
        assert system.contradictory
        with pytest.raises(NotShown, match="lose rank"):
            system.box()


def test_a_balance_along_a_direction_is_kept_at_a_magnitude_of_0() -> None:
    """An open contact carries nothing."""
    p, none = pressed([-1.0, 0, 0, 0, 0, 0]).p, np.zeros(0, dtype=np.int64)
    modes = Modes(np.array([C.OPEN]), np.zeros(1, dtype=bool), none, none)
    x = State.of(p.grasp, np.zeros(6), np.zeros(4))
    for wrench, along, magnitude, idle in (
        ([0.0] * 6, None, 0.0, [0, 1, 2, 3, 4, 5]),
        ([0.0, 0, 0, 0, 1, 0], None, 0.0, [0, 1, 2, 3, 5]),
        ([0.0] * 6, [0.0, 1, 0, 0, 0, 0], 0.0, [0, 2, 3, 4, 5]),
        ([0.0] * 6, [0.0, 1e-200, 0, 0, 0, 0], 1e-200, [0, 2, 3, 4, 5]),
    ):
        q = replace(p, wrench=np.array(wrench), along=None if along is None else np.array(along), magnitude=magnitude)
        for free in (False, True):
            assert np.flatnonzero(ModeEquations.of(q, modes, x, free).idle).tolist() == idle


@pytest.mark.parametrize(("more", "so"), [(0.0, False), (2.0**-52, True)])
def test_balances_that_follow_from_each_other_contradict_only_another_load(more: float, so: bool) -> None:
    """A contact off the centre turns the object as much as it pushes it: by 1/2 about z, exactly."""
    p = problem(Grasp([Contact([0, -0.5, 0], [1, 0, 0], 0.0)]), [-1.0, 0, 0, 0, 0, -0.5 * (1 + more)])
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.array([C.SLIDES]), np.zeros(1, dtype=bool), none, none)
    x = State.of(p.grasp, np.array([-1.0, 0, 0, 0, 0, 0]), np.array([1.0, 0, 0, 0]))
    system = System.of(p, modes, x, False)
    assert (system.used.tolist() == [0], system.contradictory) == (not so, so)
