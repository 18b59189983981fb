"""The solver door: known optima on every solver that is installed, and no trust in what comes back."""

from __future__ import annotations

import signal

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.papers import mixed_integer_solvers
from handfast.papers.mixed_integer import INF, MixedIntegerProgram, SolverResult, SolverStatus

scip = pytest.importorskip("handfast.papers.scip", reason="pyscipopt is not installed", exc_type=ImportError)

pytestmark = pytest.mark.optional
needs_gurobi = pytest.mark.skipif(not mixed_integer_solvers.available("gurobi"), reason="gurobipy is not installed")
solvers = pytest.mark.parametrize(
    "solver",
    [
        "scip",
        pytest.param(
            "gurobi",
            marks=pytest.mark.skipif(not mixed_integer_solvers.available("gurobi"), reason="gurobipy is not installed"),
        ),
    ],
)


def sos_program(kind: str) -> MixedIntegerProgram:
    """Largest x0 + 2 x1 + 3 x2 with all in [0, 1] and the set: 3 (SOS1: only x2), 5 (SOS2: x1 and x2)."""
    P = MixedIntegerProgram()
    x = P.variables(3, 0.0, 1.0)
    P.cost = {0: -1.0, 1: -2.0, 2: -3.0}
    (P.sos1 if kind == "sos1" else P.sos2).append(x.tolist())
    return P


@solvers
@pytest.mark.parametrize(("kind", "best"), [("sos1", 3.0), ("sos2", 5.0)])
def test_ordered_sets(solver: mixed_integer_solvers.Solver, kind: str, best: float) -> None:
    result = mixed_integer_solvers.solve(sos_program(kind), solver)
    assert result.status is SolverStatus.OPTIMAL
    assert result.bound == pytest.approx(-best)


@pytest.mark.parametrize(("kind", "best"), [("sos1", 3.0), ("sos2", 5.0)])
def test_scip_without_native_sets_agrees(kind: str, best: float) -> None:
    assert scip.attempt(sos_program(kind), INF, order=None).bound == pytest.approx(-best)


@solvers
def test_infeasible_and_unbounded_are_told_apart(solver: mixed_integer_solvers.Solver) -> None:
    P = MixedIntegerProgram()
    x = P.variables(2, 0.0)
    P.row([(x, [1.0, 1.0])], -INF, -1.0)
    P.cost = {0: -1.0}
    assert mixed_integer_solvers.solve(P, solver).status is SolverStatus.INFEASIBLE
    Q = MixedIntegerProgram()
    Q.variables(1, 0.0)
    Q.cost = {0: -1.0}
    assert mixed_integer_solvers.solve(Q, solver).status is SolverStatus.UNBOUNDED


@solvers
def test_no_time_is_a_time_out_not_an_answer(solver: mixed_integer_solvers.Solver) -> None:
    result = mixed_integer_solvers.solve(sos_program("sos2"), solver, timeout=0.0)
    assert result.status is SolverStatus.TIME
    assert result.x is None


def test_a_wrong_point_is_a_failure_whatever_the_solver_says(monkeypatch: pytest.MonkeyPatch) -> None:
    lie = SolverResult(SolverStatus.OPTIMAL, np.array([1.0, 0.0, 1.0]), -4.0, 1)
    monkeypatch.setattr(scip, "solve", lambda program, timeout: lie)
    assert mixed_integer_solvers.solve(sos_program("sos2"), "scip").status is SolverStatus.FAILED


@pytest.mark.parametrize(
    ("x", "violated"),
    [([0.0, 0.5, 0.5], False), ([0.5, 0.0, 0.5], True), ([0.0, 0.0, 1.5], True), ([0.0, 0.0, -0.1], True)],
)
def test_violation_finds_planted_faults(x: list[float], violated: bool) -> None:
    assert (sos_program("sos2").violation(np.array(x)) > 1e-3) == violated


def test_rows_are_judged_relative_to_their_terms() -> None:
    P = MixedIntegerProgram()
    x = P.variables(2)
    P.row([(x, [1e6, -1e6])], 0.0, 0.0)
    assert P.violation(np.array([1.0, 1.0 + 1e-9])) == pytest.approx(1e-9, rel=1e-3)
    assert P.violation(np.array([1.0, 1.1])) > 0.05


def test_scip_confirms_infeasible_with_a_second_attempt(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = scip._solve

    def wrong(
        program: MixedIntegerProgram, timeout: float, order: int | None, nodes: int | None, pressed: list
    ) -> SolverResult:
        return (
            SolverResult(SolverStatus.INFEASIBLE, None, INF, 1)
            if order == 0
            else honest(program, timeout, order, nodes, pressed)
        )

    monkeypatch.setattr(scip, "_solve", wrong)
    assert mixed_integer_solvers.solve(sos_program("sos2"), "scip").bound == pytest.approx(-5.0)


def test_scip_falls_back_when_its_lp_solver_gives_up(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = scip._solve

    def broken(
        program: MixedIntegerProgram, timeout: float, order: int | None, nodes: int | None, pressed: list
    ) -> SolverResult:
        if order is not None:
            raise Exception("SCIP: error in LP solver!")
        return honest(program, timeout, order, nodes, pressed)

    monkeypatch.setattr(scip, "_solve", broken)
    assert mixed_integer_solvers.solve(sos_program("sos1"), "scip").bound == pytest.approx(-3.0)


def test_scip_remembers_ctrl_c_even_where_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal during a solve that ends in an error must not be lost: no second attempt, status interrupted."""
    calls = []

    def interrupted(
        program: MixedIntegerProgram, timeout: float, order: int | None, nodes: int | None, pressed: list
    ) -> SolverResult:
        calls.append(order)
        signal.raise_signal(signal.SIGINT)
        raise Exception("SCIP: error in LP solver!")

    monkeypatch.setattr(scip, "_solve", interrupted)
    assert mixed_integer_solvers.solve(sos_program("sos1"), "scip").status is SolverStatus.INTERRUPTED
    assert calls == [0]


def test_unknown_or_missing_solver_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="solver: is 'glpk'; one of scip, gurobi is needed"):
        mixed_integer_solvers.solve(sos_program("sos1"), "glpk")  # type: ignore[arg-type]
    monkeypatch.setattr(mixed_integer_solvers, "available", lambda solver: False)
    for solver in mixed_integer_solvers.SOLVERS:
        said = rf"solver: '{solver}' is not installed; Algorithm 1 on it needs pip install 'handfast\[reference\]'"
        with pytest.raises(InputError, match=said):
            mixed_integer_solvers.solve(sos_program("sos1"), solver)


@needs_gurobi
def test_a_licence_that_is_too_small_is_said() -> None:
    """The wheel's own licence ends at 2,000 variables; with a full one this program simply solves."""
    P = MixedIntegerProgram()
    x = P.variables(3000, 0.0, 1.0)
    P.row([(x, np.ones(3000))], 1.0, INF)
    P.cost = {0: 1.0}
    try:
        status, said = mixed_integer_solvers.solve(P, "gurobi").status, ""
    except InputError as error:
        status, said = None, str(error)
    assert status is SolverStatus.OPTIMAL or "licence does not admit this program (3000 variables, 1 rows)" in said
