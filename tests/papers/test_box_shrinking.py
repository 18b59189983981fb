"""The solver of the synthesis paper: nothing is lost, and nothing is discarded without a proof."""

from __future__ import annotations

import json
import sys
from fractions import Fraction as F

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from handfast.core.branch import BranchAndPrune, Discarded, Order, Split
from handfast.core.errors import InputError
from handfast.model.region import Cap
from handfast.papers.box_shrinking import (
    Emptiness,
    Over,
    PaperSolver,
    ShrinkingSettings,
    SystemBox,
    bisect,
)
from handfast.papers.canonical_equations import canonical, point
from handfast.papers.canonical_system import Canonical
from handfast.papers.linear_programs import LinearProgram, polytopes
from handfast.readers.load_hand import load_hand
from tests.support.exact_programs import exact_below, finger, gripper, touching, wall
from tests.support.planted import bump, plant

STEADY = settings(max_examples=40, deadline=None, derandomize=True)
SEEDS = st.integers(0, 2**32 - 1)
QUICK = ShrinkingSettings(over=Over.ORIGINAL, significant=0.4, sigma=0.2)


# --- shrinking ---------------------------------------------------------------------------------------------


def around(x: np.ndarray, root: SystemBox, rng, size: float) -> SystemBox:
    """A random sub-box of a size (relative) that holds a point, sometimes on its edge."""
    low = np.maximum(root.lower, x - rng.uniform(0, 1, len(x)) * size * root.sides)
    high = np.minimum(root.upper, x + rng.uniform(0, 1, len(x)) * size * root.sides)
    edge = rng.random(len(x)) < 0.1
    low = np.where(edge & (rng.random(len(x)) < 0.5), x, low)
    return SystemBox(np.minimum(low, x), np.maximum(high, x))


@pytest.mark.parametrize("over", Over)
def test_shrinking_never_loses_a_planted_solution(over):
    for seed, size in enumerate([1.0, 3e-3]):
        system, x = gripper(seed)
        solver = PaperSolver(system, ShrinkingSettings(over=over, narrow=1e-6))
        rng = np.random.default_rng(seed)
        box = around(x, solver.root, rng, size)
        after = solver.shrink(box)
        assert isinstance(after, SystemBox)
        assert after.holds(x)
        assert (after.lower >= box.lower).all()
        assert (after.upper <= box.upper).all()
        if size < 1:
            assert after.sides[: solver.width].sum() < 0.98 * box.sides[: solver.width].sum()
        if over is Over.ALL:
            break  # more programs of the same kind


def test_shrinking_keeps_the_solution_of_a_whole_hand():
    rng = np.random.default_rng(2)
    tip = Cap(np.array([0.02, 0, 0]), 0.013, np.array([0.14, 0, 0.99]), np.pi / 3)
    planted = plant(load_hand("schunk-sah"), [("index_distal", tip, bump(rng, (1, 1)))], rng)
    system = canonical(planted.task, unit=0.001)
    x = system.expanded.lift(point(system, planted.q, planted.pose, planted.parameters))
    solver = PaperSolver(system, ShrinkingSettings(over=Over.ORIGINAL, narrow=1e-6))
    after = solver.shrink(around(x, solver.root, rng, 0.01))
    assert isinstance(after, SystemBox)
    assert after.holds(x)
    assert solver.statistics.unproved <= 0.05 * solver.statistics.programs


@pytest.mark.parametrize("liar", ["zeros", "noise", "nan", "nothing", "mirrored"])
def test_a_solver_that_lies_loses_no_solution(liar, monkeypatch):
    """Whatever multipliers come, right ones included, of another variable or of the other sign."""
    system, x = gripper(1)
    solver = PaperSolver(system, ShrinkingSettings(over=Over.ORIGINAL))
    rng = np.random.default_rng(0)
    honest = LinearProgram.multipliers

    def answer(self, column, sign):
        rows = self._solver.getNumRow()
        match liar:
            case "zeros":
                return [np.zeros(rows)]
            case "noise":
                return [rng.normal(size=rows) * 10.0 ** rng.integers(-6, 6)]
            case "nan":
                return [np.full(rows, np.nan), np.full(rows, np.inf)]
            case "nothing":
                return []
        return [-y for y in honest(self, column, -sign)]

    monkeypatch.setattr(LinearProgram, "multipliers", answer)
    box = around(x, solver.root, rng, 0.1)
    after = solver.shrink(box)
    assert isinstance(after, SystemBox)
    assert after.holds(x)
    if liar in ("nan", "nothing"):
        np.testing.assert_array_equal(after.lower[: system.n_v], box.lower[: system.n_v])
        np.testing.assert_array_equal(after.upper[: system.n_v], box.upper[: system.n_v])


def test_the_halves_of_a_box_are_the_box():
    box = SystemBox(np.array([0.0, -1.0, 5.0]), np.array([1.0, 2.0, 50.0]), share=0.5)
    first, second = bisect(box, 2)
    np.testing.assert_array_equal(first.lower, box.lower)
    np.testing.assert_array_equal(second.upper, box.upper)
    np.testing.assert_array_equal(first.upper, [1.0, 0.5, 50.0])  # the third side is not asked for
    np.testing.assert_array_equal(second.lower, [0.0, 0.5, 5.0])
    assert first.share == second.share == 0.25


# --- searches ----------------------------------------------------------------------------------------------


def run(search: BranchAndPrune[SystemBox], steps: int = 10**6) -> list[Discarded]:
    """The discarded boxes of a search of so many steps at most."""
    out = []
    for _, state in zip(range(steps), search, strict=False):
        if isinstance(state.outcome, Discarded):
            out.append(state.outcome)
    return out


def proved(system: Canonical, why: Emptiness, slack: float) -> bool:
    """Is the box empty, by rational arithmetic alone?"""
    rows = polytopes(system.expanded, why.start.lower, why.start.upper, slack)
    bound = exact_below(rows, why.multipliers, why.box.lower, why.box.upper, why.column, why.sign)
    if why.column is None:
        return bound > 0
    return bound > F(float(why.box.upper[why.column] if why.sign > 0 else -why.box.lower[why.column]))


@pytest.mark.parametrize("order", [Order.DEPTH, Order.BREADTH])
def test_the_only_solution_of_a_finger_is_found(order):
    height = 0.15
    system = finger(height)
    x = touching(system, height)
    found = PaperSolver(system, QUICK).search(order)
    discarded = run(found)
    state = found.state
    assert state.pending == 0
    assert not state.unfinished
    assert len(state.finals) >= 1
    assert all(box.sides[: system.n_v].max() <= QUICK.sigma for box in state.finals)
    assert any(box.holds(x) for box in state.finals)
    angle = system.names.index("cos[a]")
    assert all(box.lower[angle] - 0.2 <= x[angle] <= box.upper[angle] + 0.2 for box in state.finals)
    assert all(proved(system, out.evidence, QUICK.slack) for out in discarded)
    assert state.discarded == pytest.approx(1 - sum(box.share for box in state.finals), abs=1e-12)


def test_a_wall_that_is_too_narrow_is_discarded_with_proofs():
    """Half of it between the two places where the tip would touch: the relaxation of the root holds it."""
    system = wall(0.08)
    found = PaperSolver(system, QUICK).search()
    discarded = run(found)
    assert not found.state.finals
    assert found.state.pending == 0
    assert found.state.discarded == pytest.approx(1, abs=1e-12)
    assert len(discarded) == found.state.nodes - 1 > 1  # all but the root, which is split
    assert all(proved(system, out.evidence, QUICK.slack) for out in discarded)


def test_both_places_on_a_wider_wall_are_found():
    system = wall(0.12)
    found = PaperSolver(system, QUICK).search()
    run(found)
    y = system.names.index("o[0].y")
    centers = sorted((box.lower[y] + box.upper[y]) / 2 for box in found.state.finals)
    assert centers == pytest.approx([-1.129, 1.129], abs=0.01)  # in units of 0.1 m
    assert found.state.pending == 0


def test_the_exact_check_refuses_spoiled_evidence():
    system = finger(0.3)
    (out,) = run(PaperSolver(system, QUICK).search())
    why = out.evidence
    assert proved(system, why, QUICK.slack)
    spoiled = [
        Emptiness(why.box, why.start, y, why.column, why.sign, why.margin)
        for y in (0 * why.multipliers, -why.multipliers, np.roll(why.multipliers, 1))
    ]
    assert not any(proved(system, s, QUICK.slack) for s in spoiled)


@pytest.mark.slow
def test_to_the_letter_all_sides_of_x_are_shrunk_and_split():
    system = finger(0.15)
    found = PaperSolver(system, ShrinkingSettings(sigma=0.5, significant=0.5)).search()
    for state in found:
        if state.finals:
            break
    (box,) = found.state.finals
    assert box.sides.max() <= 0.5
    assert box.holds(touching(system, 0.15))


@pytest.mark.slow
def test_a_resumed_search_finds_the_same():
    system = wall(0.12)
    first, parts = PaperSolver(system, QUICK).search(), []
    for stop in (1, 3, 3):  # in the root's passes and after the bisection
        run(first, stop)
        text = json.dumps(first.save())
        first = BranchAndPrune.restored(PaperSolver(system, QUICK), json.loads(text))
        parts.append(first.state.steps)
    run(first)
    whole = PaperSolver(system, QUICK).search()
    run(whole)
    assert first.save() == whole.save()
    assert parts == [1, 4, 7]
    assert whole.state.steps > 7


def test_statistics():
    system = finger(0.15)
    found = PaperSolver(system, QUICK).search()
    run(found, 3)
    s = found.domain.statistics
    assert s.passes == 3
    assert s.boxes == found.state.nodes
    assert s.programs > 3 * system.n_v / 2
    assert 0.3 < s.program_share < 1
    assert s.boxes_per_second == s.boxes / s.seconds


# --- bad input ---------------------------------------------------------------------------------------------


def test_a_missing_solver_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "highspy", None)
    with pytest.raises(InputError, match=r"solver: needs the package highspy: pip install 'handfast\[reference\]'"):
        PaperSolver(finger(0.15))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"sigma": 0.0}, "sigma: is 0; it must be positive"),
        ({"seconds": -1.0}, "seconds: is -1; it must be positive"),
        ({"significant": 1.0}, r"significant: is 1; it lies in \(0, 1\)"),
        ({"sigma": float("nan")}, "sigma: is nan"),
    ],
)
def test_settings_are_checked(change, message):
    with pytest.raises(InputError, match=message):
        ShrinkingSettings(**change)


def test_a_pass_ends_with_the_time():
    """The box is to be gone on with, as it is; no program is solved after the end."""
    solver = PaperSolver(finger(0.15), QUICK, end=0.0)
    out = solver.examine(solver.root)
    assert isinstance(out, Split)
    (left,) = out.children
    assert (left.lower == solver.root.lower).all()
    assert (left.upper == solver.root.upper).all()
    assert solver.statistics.programs == 0


def test_saved_boxes_are_checked():
    solver = PaperSolver(finger(0.15), QUICK)
    good = solver.encode(solver.root)
    assert solver.decode(json.loads(json.dumps(good))).holds(solver.root.lower)
    n = solver.system.expanded.n
    with pytest.raises(InputError, match=f"box: has 3 lower and {n} upper ends; {n} are needed"):
        solver.decode(good | {"lower": [0.0, 0.0, 0.0]})
    with pytest.raises(InputError, match="box: has a lower end above the upper one"):
        solver.decode(good | {"lower": good["upper"], "upper": good["lower"]})
    with pytest.raises(InputError, match="share: is missing"):
        solver.decode({"lower": [], "upper": []})
