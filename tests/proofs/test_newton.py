"""Ranks of rows that may depend on each other by structure, parts between two modes, and what boxes allow for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.core import bundled
from handfast.model.grasp import Contact, Grasp
from handfast.proofs.grasp import StartData, read_grasp
from handfast.proofs.newton import (
    DEPENDENT,
    PRIME,
    ModeEquations,
    Modes,
    NotShown,
    System,
    between,
    greedy,
    independent,
    rounding,
    spans,
)
from handfast.proofs.states import ContactMode, Part, Problem, State
from handfast.proofs.tolerance import UNIT_ROUNDOFF
from handfast.readers.grasp_file import load_grasp
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
        ([[1, 0], [0, DEPENDENT]], [0, 0], [1, 1], None),
        ([[1, 0], [2, 0]], [1, 2], [1, 1], [0]),
        ([[1, 0], [2, 0]], [1, 2 + 2**-40], [1, 1], None),  # no motion keeps both
        ([[1, 0], [1, 2**-40]], [0, 0], [1, 1], None),
        ([[1, 0], [0, 1], [1, 1]], [1, 2, 3], [1, 1, 1], [0, 1]),
        ([[1, 0], [0, 1], [1, 1]], [1, 2, 4], [1, 1, 1], None),
    ],
)
def test_rows_that_are_held_are_kept_but_for_those_that_follow_exactly(table, at, units, kept) -> None:
    """Rows of motions (x, y) and at what they are held; the first of all rows is held by none."""
    columns = np.array([1.0, 2.0**-40])
    M = np.array([[7.0, 7.0], *table]) / columns
    exact_rows = [[fmpq(*x.as_integer_ratio()) for x in row] for row in M.tolist()]
    grasp = SimpleNamespace(rows=(M, M), row_units=np.array([1.0, *units]), column_units=columns)
    grasp.exact_rows, grasp.independent_rows = exact_rows, {}
    ends = [fmpq(*float(x).as_integer_ratio()) for x in (0, *at)]
    rows: Any = SimpleNamespace(at=np.array([0.0, *at]), exact=np.array(ends, dtype=object))
    answers = [independent(SimpleNamespace(grasp=grasp), np.arange(1, len(M)), rows) for _ in range(2)]  # type: ignore[arg-type]
    assert answers[0] is answers[1]  # it is remembered
    assert answers[0] is kept is None or (answers[0] - 1).tolist() == kept


A = np.ones(3) / 3**0.5
B = A + np.array([2e-9, -2e-9, 0])


@pytest.mark.parametrize(
    ("rows", "chosen"),
    [
        (np.zeros((0, 2)), []),
        ([[0, 0], [1, 0], [1, 0.9e-9], [1, 1.1e-9]], [1, 3]),
        ([[1, 0], [0, DEPENDENT]], [0]),  # as far as that, and no farther
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


found = cache(sliding)  # a search takes longer than a test


def slides(more: Any = 0.0) -> tuple[Problem, System]:
    """Three contacts slide, two stick; more: of the load than the state carries."""
    p, x = found()
    p = replace(p, grasp=replace(p.grasp))  # without what is remembered of it
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
    least = by_motions + 0.01 * wide.d_off[rows].sum(axis=1)[:, None]
    assert (wide.phi_off[rows] >= least).all()
    assert (wide.phi_off[rows] < 1.2 * least).all()
    assert (wide.v_off > box.v_off).all()
    with pytest.raises(NotShown, match="Newton's test fails"):
        replace(system, K_off=system.K_off + 10.0).box()


@pytest.mark.parametrize(
    ("share", "of_laws"), [(0.5, False), (0.5, True), (1.001, False), (1.001, True), (1e100, True)]
)
def test_a_box_contains_its_images_by_uncertain_derivatives(share: float, of_laws: bool) -> None:
    """y -> y - F(x0 + C y) keeps |y| <= rho where value + E rho <= rho, so rho >= (1 - E)^-1 value; E < 1 has to hold.

    E is by rounding |dA| |C|, by laws |B|^T dK |B C|; its largest eigenvalue is `share`.
    """
    p, s = slides()
    rows, size = s.laws.rows[:, :3], np.abs(s.inverse)
    by_K = np.zeros((len(s.value), len(rows)))
    by_K[:6] = p.grasp.rows[1][rows].sum(axis=1).T
    E = by_K @ np.abs(p.grasp.rows[0][rows] @ s.inverse[:6]).sum(axis=1) if of_laws else rounding(p) * s.A_size @ size
    grows = share / np.abs(np.linalg.eigvals(E)).max()
    wide = replace(s, K_off=s.K_off + grows) if of_laws else replace(s, A_size=grows * s.A_size)
    if share > 1:
        with pytest.raises(NotShown, match=r"Newton's test fails at a residual of \S+$") as fault:
            wide.box()
        assert fault.value.rounding  # more digits may show it
        return
    value = np.abs(s.value) + s.value_off
    least = size @ np.linalg.solve(np.eye(len(value)) - grows * E, value)
    assert (wide.box().v_off >= 0.999999 * least[:6]).all()


def coming_back(f: float = 1.0, short: float = 0.0) -> System:
    """In a step, contact 0 touches again after a gap. The load has a magnitude.

    f: times all forces and motions. short: by how much of it the contact does not.
    """
    p, s = slides()
    before = StartData((short - f * s.d[0]) * np.eye(5)[0], np.zeros(0), np.zeros(0))
    along = np.array([0, 0, 1.0, 0.01, 0, 0])
    wrench = p.wrench + p.grasp.rows[0][:3].T @ s.phi[:3] - 2.0 * along  # what the contact carried is not there
    p = replace(p, grasp=p.grasp.with_start(before), wrench=f * wrench, along=along, magnitude=2.0 * f)
    modes = replace(s.modes, contact=np.array([C.TOUCHES, C.SLIDES, C.SLIDES, C.STICKS, C.STICKS]))
    return System.of(p, modes, State.of(p.grasp, f * s.v, f * np.where(np.arange(16) < 3, 0.0, s.phi)), True)


def test_a_contact_that_comes_back_is_held_where_it_was() -> None:
    """A gap away: known to a rounding of that, beside those of the motion."""
    back = coming_back()
    gap, box = back.p.grasp.gaps[0], back.box()
    assert gap > 0.1
    assert back.linear[6:].all()  # what is held
    assert back.residual < 1e-12
    assert back.value_off[6] >= back.d_off[0] + 2 * UNIT_ROUNDOFF * gap
    assert box.d[0] == -gap
    assert UNIT_ROUNDOFF * gap <= box.d_off[0] <= 2 * UNIT_ROUNDOFF * gap
    assert back.value_off[6] <= back.d_off[0] + 4 * UNIT_ROUNDOFF * gap
    short = coming_back(short=1e-9)
    assert short.d[0] != -short.p.grasp.gaps[0] == short.box().d[0]  # there, whatever the floats miss


@pytest.mark.parametrize("f", [2.0**-80, 2.0**80])
def test_bounds_have_no_unit_of_force(f: float) -> None:
    one, other = coming_back(), coming_back(f)
    for a, b in ((one, other), (one.box(), other.box())):
        for name in ("value_off", "v_off", "d_off", "phi_off", "magnitude_off"):
            if hasattr(a, name):
                np.testing.assert_allclose(getattr(b, name), f * getattr(a, name), rtol=1e-6, err_msg=name)
    for name in ("A", "A_size", "K_off", "columns"):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9, atol=0, err_msg=name)


def test_forces_that_are_large_beside_the_sliding_turn_much() -> None:
    """A contact that had pressed with 1e4 N before the step: K has c_n / |d_t|, rounded."""
    p, s = slides()
    before = StartData(-1e4 * np.eye(5)[0], np.zeros(0), np.zeros(0))
    p = replace(p, grasp=p.grasp.with_start(before))
    pressed = System.of(p, s.modes, State.of(p.grasp, s.v, s.phi), False)
    assert np.abs(pressed.laws.K[0]).max() > 1e3
    assert (pressed.K_off >= 2 * UNIT_ROUNDOFF * np.abs(pressed.laws.K).max(axis=(1, 2))).all()


def test_forces_and_motions_are_missed_in_the_units_of_their_rows() -> None:
    """0.25 N of a contact that slides, and as much of a gap that is to close."""
    p, s = slides()
    unit = np.linalg.norm(p.grasp.rows[0][0] * np.r_[np.ones(3), np.ones(3) / p.grasp.size])
    off = System.of(p, s.modes, State.of(p.grasp, s.v, s.phi + 0.25 * np.eye(16)[0]), False)
    assert off.residual == pytest.approx(0.25 * unit / p.scale, rel=1e-9)
    short = coming_back(short=0.25)
    assert short.residual == pytest.approx(0.25 / unit / short.p.scale, rel=1e-9)


def test_a_magnitude_that_is_no_unknown_is_known() -> None:
    """1e6 N that all but cancel the rest of the load, and add to its rounding."""
    p, s = slides()
    large = 1e6 * np.eye(6)[0]
    q = replace(p, along=np.eye(6)[0], wrench=p.wrench - large, magnitude=1e6)
    known = System.of(q, s.modes, State.of(p.grasp, s.v, s.phi), False)
    np.testing.assert_array_equal(known.A, s.A)
    assert known.value_off[0] >= 3 * UNIT_ROUNDOFF * 1e6
    box = known.box()
    assert (box.magnitude, box.magnitude_off) == (1e6, 0.0)


@pytest.mark.parametrize(
    ("contact", "v", "k", "reason"),
    [
        ([C.OPEN, C.STICKS, C.SLIDES], 0.0, 2, "contact 2 slides by so little"),
        ([C.LEANS, C.OPEN, C.OPEN], 1.0, 0, "the equations of the modes lose rank"),
    ],
)
def test_where_nothing_is_shown_the_part_is_named(contact: Any, v: float, k: int, reason: str) -> None:
    """Three contacts at the origin, about which nothing keeps the body from turning."""
    p = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5) for _ in range(3)]), [0, 0, -1.0])
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.array(contact), np.zeros(3, dtype=bool), none, none)
    with pytest.raises(NotShown, match=reason) as fault:
        _ = System.of(p, modes, State.of(p.grasp, v * np.eye(6)[2], np.ones(10)), False).inverse
    assert fault.value.part == f"contact {k}"


def test_a_part_between_two_modes_has_an_equation_too_many() -> None:
    p, s = slides()
    modes = replace(s.modes, full=np.array([False, True, True, False, False]))
    with pytest.raises(NotShown, match="11 equations have only 10 unknowns: contact 1 is between two modes") as fault:
        _ = System.of(replace(p, force_limit=3.0), modes, State.of(p.grasp, s.v, s.phi), False).inverse
    assert fault.value.part == "contact 1"


def test_scaled_equations_have_no_unit_of_length() -> None:
    """Fig. 9 with its load's magnitude as an unknown, 1,024 times as large: the same numbers."""
    p, x = held(load_grasp(bundled.resolve("grasps", "fig9")), [0, 0, -0.5])
    modes, along = likeliest(p, x), np.array([0, 0, -1.0, 0.01, 0.002, 0])
    scaled = []
    for a in (1.0, 1024.0):
        g, w = p.grasp, np.r_[1, 1, 1, a, a, a]
        g = replace(g, positions=a * g.positions, origins=a * g.origins, command=a * g.command)
        q = replace(p, grasp=g, wrench=w * (p.wrench - 0.25 * along), along=w * along, magnitude=0.25)
        s = System.of(q, modes, replace(x, r=x.r / w, f=a * x.f, coupling=a * x.coupling), True)
        scaled.append(s.units[:, None] * s.A * s.columns)
    assert scaled[0].shape == (26, 27)
    np.testing.assert_allclose(*scaled, rtol=1e-12, atol=1e-12)


def test_every_sum_is_uncertain_by_a_rounding_of_its_terms() -> None:
    p, system = slides()
    rows, v, size = system.laws.rows, np.abs(system.v), p.grasp.rows[1]
    assert rounding(p) == 4 * (16 + 6 + 16) * UNIT_ROUNDOFF  # of 16 rows, one that is none, and 6 columns
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
    assert str(fault).endswith("with 320 bits, too")
    assert 1e-9 > at_limit.value_off[-1] >= at_limit.phi_off[at_limit.laws.rows[0, 0]] > 0
    far = System.of(replace(p, force_limit=1e9), at_limit.modes, x, False)
    assert 1e9 * UNIT_ROUNDOFF < far.value_off[-1] < 4.5e9 * UNIT_ROUNDOFF
    there = System.of(replace(p, force_limit=limit + 0.125), at_limit.modes, x, False)
    assert there.value_off[-1] < 2 * there.phi_off[there.laws.rows[0, 0]]  # it misses nothing
    np.testing.assert_array_equal(at_limit.A[-1, : len(system.v)], system.laws.K[0, 0] @ p.grasp.rows[0][:4])


def test_contacts_that_hold_almost_the_same_motions_show_nothing() -> None:
    """Two at one place with normals that are 1e-12 apart."""
    p = problem(Grasp([Contact([0, 0, 0], [1e-12 * k, 0, 1], 0.5) for k in range(2)]), [0, 0, -1.0])
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.full(2, C.STICKS), np.array([False, True]), none, none)
    x = State.of(p.grasp, np.zeros(6), np.zeros(len(p.grasp.rows[0])))
    with pytest.raises(NotShown, match="what is held at rest is dependent but for rounding") as fault:
        System.of(p, modes, x, False)
    assert fault.value.part == "contact 1"  # at its limit, or not


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


@pytest.mark.parametrize(
    ("joint", "mode", "idle"),
    [
        ({}, P.FREE, True),
        ({"torque": 0.1}, P.FREE, False),
        ({"friction": 0.2}, P.MOVES, False),  # its friction is given
        ({"friction": 0.2}, P.RESTS, False),
    ],
)
def test_a_joint_that_no_contact_loads_is_idle_only_without_a_torque(joint: Any, mode: int, idle: bool) -> None:
    turning = {"name": "a", "axis": [0, 0, 1], "origin": [0.1, 0, 0], "moves": [0]} | joint
    contact = {"position": [0, 0, 0], "normal": [1, 0, 0], "friction": 0.5}
    g = read_grasp({"schema": "handfast/grasp/1", "contacts": [contact], "joints": [turning]}, "")
    modes = Modes(np.array([C.OPEN]), np.zeros(1, dtype=bool), np.full(g.a, P.MOVES), np.array([mode]))
    x = State.of(g, np.zeros(7), np.zeros(len(g.rows[0])))
    e = ModeEquations.of(Problem(g, np.zeros(6)), modes, x, False)
    assert e.idle.tolist() == [True] * 6 + [idle]
    exact, carries = g.exact_table.copy(), e.rows.unknown | (e.rows.given != 0)
    exact[carries, 3] = fmpq(1, 2**2000)  # which no float shows
    g._exact_tables[:] = [exact]
    assert e.idle[3] != carries.any() == ("friction" in joint)


def test_an_equation_that_is_not_linear_is_never_left_out() -> None:
    """The friction of a contact that slides is a share of what it presses with: no line, and nothing balances it."""
    p, none = problem(Grasp([Contact([0.5, 0, 0], [1, 0, 0], 0.5)]), [-1.0, 0, 0]), np.zeros(0, dtype=np.int64)
    modes = Modes(np.array([C.SLIDES]), np.zeros(1, dtype=bool), none, none)
    x = State.of(p.grasp, np.array([-1.0, -1.0, 0, 0, 0, 0]), np.array([1.0, 0.5, 0, 0]))
    system = System.of(p, modes, x, False)
    assert system.used.tolist() == [0, 1, 2, 4, 5]
    assert not system.linear.any()
    with pytest.raises(NotShown):
        system.box()


@pytest.mark.parametrize(("across", "so"), [(0.001, False), (0.0, True)])
def test_a_magnitude_may_settle_what_no_motion_does(across: float, so: bool) -> None:
    """0.001 N across is carried by nothing: there is none where the magnitude is 1, if it has a part in that."""
    p = pressed([-1.0, 0, 0, 0, 0, 0]).p
    wrench, along = np.array([0, 0, -0.001, 0, 0, 0]), np.array([-1.0, 0, across, 0, 0, 0])
    p = replace(p, wrench=wrench, along=along, magnitude=2.0)
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.array([C.SLIDES]), np.zeros(1, dtype=bool), none, none)
    x = State.of(p.grasp, np.array([-1.0, 0, 0, 0, 0, 0]), np.array([1.0, 0, 0, 0]))
    assert System.of(p, modes, x, True).contradictory is so


def test_what_one_contact_misses_is_a_share_of_its_load() -> None:
    """It presses with 1 N against 4 N."""
    assert pressed([-4.0, 0, 0, 0, 0, 0]).residual == pytest.approx(0.75)


def given(A: Any, columns: Any, linear: Any, exact: Any, units: Any = 1.0) -> System:
    """Equations whose exact rows say what is linear in them."""
    A = np.array(A, dtype=float)
    k: Any = np.arange(len(A))
    none: Any = None
    system = System(*[none] * 8, k, k, A, A, units * np.ones(len(A)), k, 0.0)  # type: ignore[call-arg]
    rows = [[fmpq(x) for x in row] for row in exact]
    vars(system).update(columns=np.array(columns, dtype=float), linear=np.array(linear), exact=rows)
    return system


@pytest.mark.parametrize(
    ("A", "columns", "linear", "exact", "kept"),
    [
        ([[1, 0], [1, 0]], [1, 1], [True, True], [[1, 0, 2], [1, 0, 2]], [0]),
        ([[1, 0], [1, 0]], [1, 1], [True, True], [[1, 0, 2], [1, 0, 3]], [0, 1]),  # they contradict each other
        ([[1, 0], [1, 0]], [1, 1], [True, False], [[1, 0, 2], [1, 0, 2]], [0, 1]),
        ([[1, 0], [1, 0], [1, 0]], [1, 1], [True, True, False], [[1, 0, 2]] * 3, [0, 1, 2]),  # one of them is curved
        ([[1, 0], [1, 1e-12]], [1, 1e-6], [True, True], [[1, 0, 2], [1, 0, 2]], [0]),  # 1e-18 is rounding
        ([[1, 0], [1, 1e-12]], [1, 1e6], [True, True], [[1, 0, 2], [1, 0, 2]], [0, 1]),
    ],
)
def test_equations_are_left_out_that_follow_from_others_and_are_all_linear(
    A: Any, columns: Any, linear: Any, exact: Any, kept: list[int]
) -> None:
    assert given(A, columns, linear, exact)._without_dependent().used.tolist() == kept


@pytest.mark.parametrize(
    ("C", "unit", "column", "so"),
    [
        (np.zeros((6, 0)), 1.0, 1.0, True),
        (np.eye(2), 1.0, 1.0, True),
        (np.diag([1.0, -1e10]), 1.0, 1.0, False),
        ([[0.9 / DEPENDENT]], 1.0, 1.0, True),
        ([[1.0 / DEPENDENT]], 1.0, 1.0, False),
        ([[1e7]], 1e-3, 1.0, False),  # of what is measured in 0.001, a unit moves as much
        ([[1e10]], 1.0, 1e3, True),
    ],
)
def test_an_inverse_is_too_large_by_the_units_of_equations_and_unknowns(
    C: Any, unit: float, column: float, so: bool
) -> None:
    C = np.array(C)
    system = given(np.zeros(C.T.shape), np.full(len(C), column), [], [], unit)
    vars(system)["inverse"] = C
    assert system.regular is so


def test_forces_and_held_motions_are_scaled_by_the_units_of_their_rows() -> None:
    _, s = slides()
    e, g = s.of_modes, s.p.grasp
    np.testing.assert_allclose(s.columns[6:] * g.row_units[e.unknown], 1.0)
    np.testing.assert_allclose(s.units[6:] * g.row_units[e.kept], 1.0)


def test_what_misses_nothing_is_a_solution_whatever_the_derivatives() -> None:
    _, s = slides()
    none = np.zeros(len(s.value))
    box = replace(s, value=none, value_off=none, A=0.0 * s.A).box()
    assert not box.v_off.any()
    np.testing.assert_array_equal(box.d_off[:9], s.d_off[:9])


@pytest.mark.parametrize(("which", "room"), [(np.ones(9), 2e-6), (np.eye(9)[0], 0.25)])
def test_a_box_is_hardly_wider_than_what_the_equations_miss(which: Any, room: float) -> None:
    """1e-9 each, which is far more than roundings; or one of them, where a box grows once."""
    _, s = slides()
    box, step = replace(s, value=1e-9 * which, value_off=0.0 * which).box(), np.abs(s.inverse[:6]) @ (1e-9 * which)
    assert (box.v_off >= step).all()
    assert (box.v_off <= (1 + room) * step + 1e-6 * step.max() * (room > 0.1)).all()


def test_a_box_that_has_to_grow_grows_by_little() -> None:
    """An error of a tenth in the derivative of one equation: 1 / 0.9 is enough; 1.1, a fifth more, is tried."""
    s = pressed([-1.0, 0, 0, 0, 0, 0])
    value = np.abs(s.value) + s.value_off
    box = replace(s, A_size=0.1 / rounding(s.p) * np.abs(s.A)).box()
    step = np.abs(s.inverse[0]) @ value
    assert step / 0.9 <= box.v_off[0] <= 1.33 * step


def test_forces_in_a_wide_box_are_uncertain_by_all_that_their_derivatives_change() -> None:
    """1e-3 is missed: the contacts' motions differ by as much as the box says, their laws' derivatives by that."""
    p, s = slides()
    box, rows = replace(s, value_off=np.full(len(s.value), 1e-3)).box(), s.laws.rows[:3]
    off = box.d_off[rows]
    change = s.laws.change(p, np.r_[np.linalg.norm(off, axis=1), 0, 0])[:3]
    least = np.einsum("cij,cj->ci", np.abs(s.laws.K[:3]), off) + (change * off.sum(axis=1))[:, None]
    assert (change > 1e-3).all()
    assert (box.phi_off[rows[:, :3]] >= least[:, :3]).all()
    assert (box.phi_off[rows[:, :3]] <= (1 + 1e-9) * least[:, :3]).all()


def skew(contact: Any, slip: float = 0.0, mu: float = 0.5) -> System:
    """A contact at the origin, pressed by 1 along a skew normal, slips by little; one beside it, by 1."""
    p = problem(Grasp([Contact([0, 0, 0], [0.36, 0.48, 0.8], mu), Contact([0, 0, 1.0], [0, 1, 0], mu)]), np.zeros(3))
    normal, across = p.grasp.rows[0][:2]
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.array(contact), np.zeros(2, dtype=bool), none, none)
    x = State.of(p.grasp, slip * across - normal, np.eye(len(p.grasp.rows[0]))[0])
    return System.of(replace(p, wrench=-normal[:6]), modes, x, False)


def test_motions_that_cancel_are_uncertain_by_a_rounding_of_their_terms() -> None:
    """A contact without friction that is pressed along its normal: across it nothing moves but for rounding."""
    s = skew([C.SLIDES, C.OPEN], mu=0.0)
    box = replace(s, d_off=0.0 * s.d_off, value_off=s.value_off + 1e-3).box()
    assert (box.d_off[1:3] >= rounding(s.p) * (s.p.grasp.rows[1] @ box.v_off)[1:3]).all()
    assert (box.d_off[1:3] > 0).all()
    assert (box.d_off[1:3] < 1e-12).all()


def test_forces_of_a_contact_that_hardly_slides_are_uncertain_by_its_own_motion() -> None:
    s = skew([C.SLIDES, C.SLIDES], 1e-13)
    rows, K_off = s.laws.rows, s.K_off
    assert K_off[0] > 0.01 > 1e-12 > K_off[1]
    off = s.d_off[rows]
    least = np.einsum("cij,cj->ci", np.abs(s.laws.K), off) + (K_off * off.sum(axis=1))[:, None]
    rounded = s.laws.rounding(s.p, s.d)[:, None]
    np.testing.assert_allclose(s.phi_off[rows][:, :3], (least + rounded)[:, :3], rtol=1e-9)
    assert (slides()[1].K_off[3:] == 32 * UNIT_ROUNDOFF).all()  # what sticks turns nowhere
