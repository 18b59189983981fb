"""SCIP: ordered sets natively, tried in several orders, and as binaries where its LP solver gives up.

With native SOS1 and SOS2 constraints SCIP is fast, but a node whose LP runs into numerical trouble has
no integer variable to branch on and ends the solve with an error: one solve in seven, on coplanar grasps
one in four. Another order of the variables usually gets through; sectors chosen by binaries and indicators
always did, slowly, and come last. "Infeasible" counts when two attempts say so: it was seen to be wrong.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
from pyscipopt import SCIP_EVENTTYPE, Eventhdlr, Model, quicksum

from handfast.core.libraries import silent
from handfast.papers.mixed_integer import INF, MixedIntegerProgram, SolverResult, SolverStatus

STATUS = {
    "optimal": SolverStatus.OPTIMAL,
    "infeasible": SolverStatus.INFEASIBLE,
    "unbounded": SolverStatus.UNBOUNDED,
    "timelimit": SolverStatus.TIME,
    "userinterrupt": SolverStatus.INTERRUPTED,
}
# permutations of the variables with native sets (None: binaries), and the nodes after which the next is tried:
# a native solve can also branch on rounding errors without end, and another order settles it in a few nodes
LADDER = ((0, 5_000), (1, 20_000), (2, 20_000), (None, 100_000), (0, None))
FAILED_RESULT = SolverResult(SolverStatus.FAILED, None, -INF, 0)


def solve(program: MixedIntegerProgram, timeout: float) -> SolverResult:
    """Minimise the program; see `mixed_integer_solvers.solve`."""
    deadline = time.monotonic() + timeout
    claims = 0
    for order, nodes in LADDER:
        result = attempt(program, deadline - time.monotonic(), order=order, nodes=nodes)
        claims += result.status is SolverStatus.INFEASIBLE
        # a point can be checked against the program; a claim that there is none is only repeated
        if result.status not in (SolverStatus.FAILED, SolverStatus.INFEASIBLE) or claims == 2:
            return result
    return FAILED_RESULT


def attempt(
    program: MixedIntegerProgram, timeout: float, *, order: int | None, nodes: int | None = None
) -> SolverResult:
    """One solve, with native ordered sets in some order of variables, or with binaries (None).

    FAILED if SCIP's LP solver gives up, or after that many nodes.
    """
    if timeout <= 0:
        return SolverResult(SolverStatus.TIME, None, -INF, 0)
    with _ctrl_c() as pressed:
        try:
            result = _solve(program, timeout, order, nodes, pressed)
        except Exception as error:  # SCIP reports a failed LP as a bare Exception
            if type(error) is not Exception:
                raise
            result = FAILED_RESULT
    return replace(result, status=SolverStatus.INTERRUPTED) if pressed else result


def _solve(
    program: MixedIntegerProgram, timeout: float, order: int | None, nodes: int | None, pressed: list[bool]
) -> SolverResult:
    model = Model()
    model.hideOutput()
    model.setParam("misc/catchctrlc", False)
    if nodes is not None:
        model.setParam("limits/nodes", nodes)
    native = order is not None
    if order:
        model.setParam("randomization/permutevars", True)
        model.setParam("randomization/permutationseed", order)
    model.includeEventhdlr(_InterruptHandler(pressed), "ctrl-c", "ends the solve when Ctrl-C was pressed")
    if timeout < INF:
        model.setParam("limits/time", timeout)
    xs = [
        model.addVar(lb=None if lo == -INF else lo, ub=None if hi == INF else hi)
        for lo, hi in zip(program.lower, program.upper, strict=True)
    ]
    for index, value, lo, hi in program.rows:
        total = quicksum(v * xs[i] for i, v in zip(index, value, strict=True))
        if lo == hi:
            model.addCons(total == lo)
            continue
        if hi < INF:
            model.addCons(total <= hi)
        if lo > -INF:
            model.addCons(total >= lo)
    for members in program.sos1:
        _sos1(model, [xs[i] for i in members], native)
    for members in program.sos2:
        _sos2(model, [xs[i] for i in members], native)
    model.setObjective(quicksum(v * xs[i] for i, v in program.cost.items()), "minimize")
    with silent(2):  # SCIP's LP solver writes remarks on tolerances straight to standard error
        model.optimize()

    name = model.getStatus()
    if name == "inforunbd":
        # presolving could not tell: without an objective there is nothing to be unbounded
        if program.cost:
            bare = MixedIntegerProgram(program.lower, program.upper, {}, program.rows, program.sos1, program.sos2)
            again = _solve(bare, timeout, order, nodes, pressed)
            unbounded = again.status is SolverStatus.OPTIMAL
            return SolverResult(SolverStatus.UNBOUNDED if unbounded else again.status, again.x, -INF, again.nodes)
        name = "infeasible"
    status = STATUS.get(name, SolverStatus.FAILED)
    x = None
    if model.getNSols() > 0:
        best = model.getBestSol()
        x = np.array([model.getSolVal(best, v) for v in xs])
    bound = model.getDualbound() if status is not SolverStatus.FAILED else -INF
    if abs(bound) >= model.infinity():
        bound = -INF if bound < 0 else INF
    return SolverResult(status, x, float(bound), int(model.getNTotalNodes()))


def _sos1(model: Model, members: list[Any], native: bool) -> None:
    """At most one of the members is not zero."""
    if native:
        model.addConsSOS1(members, list(range(1, len(members) + 1)))
        return
    chosen = [model.addVar(vtype="B") for _ in members]
    model.addCons(quicksum(chosen) <= 1)
    for x, on in zip(members, chosen, strict=True):
        _zero_unless(model, x, [on])


def _sos2(model: Model, members: list[Any], native: bool) -> None:
    """At most two of the members are not zero, and they are neighbours."""
    if native:
        model.addConsSOS2(members, list(range(1, len(members) + 1)))
        return
    pair = [model.addVar(vtype="B") for _ in members[1:]]
    model.addCons(quicksum(pair) == 1)
    for k, x in enumerate(members):
        _zero_unless(model, x, pair[max(k - 1, 0) : k + 1])


def _zero_unless(model: Model, x: Any, binaries: list[Any]) -> None:
    off = model.addVar(vtype="B")
    model.addCons(off + quicksum(binaries) == 1)
    model.addConsIndicator(x <= 0, binvar=off)


class _InterruptHandler(Eventhdlr):
    """Looks at every solved node whether Ctrl-C was pressed.

    SCIP can catch the signal itself, but forgets it where its LP solver fails, and prints about it.
    """

    def __init__(self, pressed: list[bool]) -> None:
        self.pressed = pressed

    def eventinit(self) -> None:
        self.model.catchEvent(SCIP_EVENTTYPE.NODESOLVED, self)

    def eventexit(self) -> None:
        self.model.dropEvent(SCIP_EVENTTYPE.NODESOLVED, self)

    def eventexec(self, event: Any) -> None:
        if self.pressed:
            self.model.interruptSolve()


@contextmanager
def _ctrl_c() -> Iterator[list[bool]]:
    """A list that fills when Ctrl-C is pressed; elsewhere than in the main thread, or where it is ignored, never."""
    pressed: list[bool] = []
    main = threading.current_thread() is threading.main_thread()
    if not main or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield pressed
        return
    before = signal.signal(signal.SIGINT, lambda *_: pressed.append(True))
    try:
        yield pressed
    finally:
        signal.signal(signal.SIGINT, before)
