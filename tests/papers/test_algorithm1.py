"""Algorithm 1, the paper's method, on the solvers of the extra `reference`; and that the engine agrees with it."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.papers import friction_relaxation, mixed_integer_solvers
from handfast.papers.algorithm1 import RefinementSettings, check, maximum, torques
from handfast.papers.mixed_integer import SolverResult, SolverStatus
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.studies import questions as queries
from tests.support.problems import bell, nest, pinch, solved, table

pytestmark = [
    pytest.mark.optional,
    pytest.mark.skipif(not mixed_integer_solvers.available("scip"), reason="pyscipopt is not installed"),
]


def settings(**options) -> RefinementSettings:
    return RefinementSettings(**{"sectors": 256} | options)


def w(*force: float) -> np.ndarray:
    return np.array([*force, 0, 0, 0], dtype=float)


# --- hand-derived answers, see test_queries ------------------------------------------------------------


@pytest.mark.parametrize(
    ("grasp", "direction", "base", "value"),
    [
        (pinch(), (0, 1, 0), None, 1.0),
        (pinch(), (0, np.sqrt(0.5), np.sqrt(0.5)), None, 1.0),
        (bell(), (0, 1, 0), None, 0.2 / 0.09),
        (table(), (1, 0, 0), (0, 0, -10), 4.0),
    ],
)
def test_maxima(grasp: Grasp, direction, base, value: float) -> None:
    answer, _ = maximum(grasp, w(*direction), base=base and w(*base), settings=settings())
    assert answer.verdict is Verdict.HOLDS
    assert answer.witness.valid
    assert answer.certificate is None
    assert answer.lower <= value * (1 + 1e-9)
    assert answer.upper >= value * (1 - 1e-6)
    assert answer.gap <= 1e-3


def test_verdicts() -> None:
    for grasp, force, verdict in (
        (pinch(), (0, 0.99, 0), Verdict.HOLDS),
        (pinch(), (0, 1.01, 0), Verdict.SLIPS),
        (pinch().with_preload(None), (0, 0.01, 0), Verdict.SLIPS),
        (nest(), (0, 0, -100), Verdict.HOLDS),
        (nest(), (0, 0, 1), Verdict.SLIPS),
    ):
        assert check(grasp, w(*force), settings=settings()).answer.verdict is verdict
    assert maximum(pinch(), w(1, 0, 0), settings=settings()).answer.unbounded
    assert maximum(nest(), w(0, 0, 1), settings=settings()).answer.verdict is Verdict.SLIPS
    least, _ = torques(pinch(), w(0, 1, 0), settings=settings())
    assert least.upper == pytest.approx(0.1, rel=1e-3)
    assert torques(nest(), w(0, 0, 1), settings=settings()).answer.verdict is Verdict.SLIPS


# --- engine and Algorithm 1 -----------------------------------------------------------------------------

SAMPLE = [(bell(0.02), (0.5, 1, 0), 0.0), (bell(0.02), (-1, 0.2, 0.1), 0.0), (bell(), (0.3, 1, 0), 0.04)]
SAMPLE += [(pinch(offset=0.004), (0, 1, 0.3), 0.0), (pinch(), (0, 1, 0), 0.05)]


def random_case(seed: int):
    """A grasp that resists, and the force it resists."""
    s = solved(seed, 3)
    return s.grasp, s.wrench, 0.0


@pytest.mark.parametrize("case", [*SAMPLE, *(random_case(seed) for seed in (2, 11))])
def test_the_engine_agrees(case) -> None:
    grasp, direction, eta = case
    d = np.resize(np.r_[direction, 0, 0, 0], 6) / np.linalg.norm(direction)
    a, _ = maximum(grasp, d, limits=GraspLimits(eta=eta), settings=settings(sectors=2048))
    b = queries.maximum(grasp, d, limits=GraspLimits(eta=eta))
    for answer in (a, b):
        assert (answer.verdict, answer.stop) == (Verdict.HOLDS, Stop.COMPLETE)
        assert answer.witness.valid
        assert 0 < answer.lower <= answer.upper
        assert answer.unbounded or answer.gap <= 1e-3
    assert a.unbounded == b.unbounded
    assert b.lower <= a.upper * (1 + 1e-6)
    assert a.lower <= b.upper * (1 + 1e-6)


# --- refinement -----------------------------------------------------------------------------------------


def test_printed_refinement_ends_at_the_finest_sectors() -> None:
    """As printed: no early stop; the last step's active sectors are all at 360 / 64 degrees."""
    answer, steps = check(bell(), w(0, 2.0, 0), settings=settings(sectors=64, as_printed=True))
    assert answer.verdict is Verdict.HOLDS
    last = steps[-1]
    assert last.finished
    assert last.width <= 2 * np.pi / 64 * (1 + 1e-9)
    assert len(steps) >= 5


def test_full_resolution_agrees_with_refinement() -> None:
    full, steps = maximum(bell(), w(0, 1, 0), settings=settings(sectors=32, full=True))
    fine, _ = maximum(bell(), w(0, 1, 0), settings=settings(sectors=32, as_printed=True))
    assert len(steps) == 1
    assert full.upper == pytest.approx(fine.upper, rel=1e-6)


@pytest.mark.slow
def test_bounds_are_monotone_under_refinement() -> None:
    """A child's bound is never better than its parent's; coarse sectors resist more, never less."""
    _, steps = maximum(bell(), w(0.2, 1, 0), settings=settings(sectors=32, as_printed=True))
    bounds = [s.bound for s in steps]
    assert all(b >= a - 1e-6 for a, b in itertools.pairwise(bounds))
    by_resolution = [maximum(bell(), w(0, 1, 0), settings=settings(sectors=n)).answer.upper for n in (4, 8, 16)]
    assert all(b <= a + 1e-6 for a, b in itertools.pairwise(by_resolution))


@hypothesis_settings(max_examples=12, deadline=None, derandomize=True)
@given(st.integers(0, 10_000), st.sampled_from([2, 3]), st.sampled_from([0.0, 0.05]))
def test_a_relaxation_contains_every_exact_solution(seed: int, m: int, eta: float) -> None:
    """A disturbance that a constructed exact solution resists is never said to slip, at any resolution."""
    s = solved(seed, m, eta)
    assume(s.wrench.any())
    coarse, fine = (
        check(s.grasp, s.wrench, limits=GraspLimits(eta=eta), settings=settings(sectors=n)).answer for n in (4, 32)
    )
    # coarse sectors may have solutions of their own with no exact one near
    found = (Verdict.HOLDS, Stop.COMPLETE), (Verdict.UNDECIDED, Stop.RESOLUTION)
    assert (coarse.verdict, coarse.stop) in found
    assert (fine.verdict, fine.stop) == found[0]


# --- three values: a limit is never "slips" -------------------------------------------------------------


def test_a_time_out_is_undecided() -> None:
    answer, _ = check(bell(), w(0, 2.0, 0), settings=settings(timeout=1e-6))
    assert (answer.verdict, answer.stop) == (Verdict.UNDECIDED, Stop.TIME)
    best, _ = maximum(bell(), w(0, 1, 0), settings=settings(timeout=1e-6))
    assert (best.verdict, best.stop, best.upper) == (Verdict.UNDECIDED, Stop.TIME, np.inf)


@pytest.mark.parametrize("status", [SolverStatus.FAILED, SolverStatus.INTERRUPTED, SolverStatus.TIME])
def test_whatever_the_solver_does_nothing_slips_without_infeasible(
    monkeypatch: pytest.MonkeyPatch, status: SolverStatus
) -> None:
    monkeypatch.setattr(mixed_integer_solvers, "solve", lambda *a, **k: SolverResult(status, None, -np.inf, 0))
    asked = {"settings": settings()}
    for answer, _ in (
        check(bell(), w(0, 9, 0), **asked),
        maximum(bell(), w(0, 1, 0), **asked),
        torques(bell(), w(0, 1, 0), **asked),
    ):
        assert answer.verdict is Verdict.UNDECIDED
        assert answer.stop is not Stop.COMPLETE


def test_a_relaxation_without_an_exact_solution_is_undecided() -> None:
    """With four sectors 2.5 N on the bell looks feasible, and no exact solution exists: neither verdict."""
    answer, _ = check(bell(), w(0, 2.4, 0), settings=settings(sectors=4))
    assert (answer.verdict, answer.stop) == (Verdict.UNDECIDED, Stop.RESOLUTION)


def test_a_witness_beyond_the_motion_cap_lifts_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bound holds within the cap; an exact state that moves farther refutes it."""
    monkeypatch.setattr(friction_relaxation, "MOTION_BOUND", 1.0)
    answer, steps = maximum(load_grasp("fig1"), w(1, 0, 0), settings=settings(sectors=16))
    assert answer.witness.valid
    within = answer.posed.problem.direction_scale / max(step.bound for step in steps)
    assert 1.03 * within < answer.lower <= answer.upper


def test_ctrl_c_leaves_the_bounds_so_far() -> None:
    def interrupt(progress) -> None:
        raise KeyboardInterrupt

    answer, steps = maximum(bell(), w(0, 1, 0), settings=settings(), on_progress=interrupt)
    assert answer.stop is Stop.INTERRUPTED
    assert len(steps) == 1
    assert answer.upper >= 2.2222 - 1e-6


def test_progress_reports_every_step() -> None:
    seen = []
    _, steps = maximum(bell(), w(0, 1, 0), settings=settings(), on_progress=seen.append)
    assert [p.step.number for p in seen] == [s.number for s in steps][: len(seen)]
    assert all(p.lower <= p.upper for p in seen)


@pytest.mark.skipif(not mixed_integer_solvers.available("gurobi"), reason="gurobipy is not installed")
@pytest.mark.parametrize(
    ("grasp", "direction", "unbounded"), [(bell(0.02), (0.5, 1, 0), True), (pinch(offset=0.004), (0, 1, 0.3), False)]
)
def test_gurobi_agrees_with_scip(grasp: Grasp, direction: tuple[float, ...], unbounded: bool) -> None:
    a, _ = maximum(grasp, w(*direction), settings=settings(sectors=128))
    b, _ = maximum(grasp, w(*direction), settings=settings(sectors=128, solver="gurobi"))
    assert a.unbounded == b.unbounded == unbounded
    for answer in (a, b):
        assert (answer.verdict, answer.stop) == (Verdict.HOLDS, Stop.COMPLETE)
    assert a.lower <= b.upper * (1 + 1e-6)
    assert b.lower <= a.upper * (1 + 1e-6)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("sectors", 100, "sectors: is 100; 4, 8, 16"),
        ("sectors", 2, "sectors: is 2; 4, 8, 16"),
        ("gap", 0.0, "gap: is 0; a positive number"),
        ("timeout", -1.0, "timeout: is -1 s; a positive number"),
        ("solver", "cplex", "solver: is 'cplex'; one of scip, gurobi"),
    ],
)
def test_settings_are_checked(field: str, value: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RefinementSettings(**{field: value})  # type: ignore[arg-type]
