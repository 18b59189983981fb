"""The branch and prune engine on toys whose answers are known."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from fractions import Fraction as F
from itertools import islice, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core import branch
from handfast.core.branch import BranchAndPrune, BranchState, Discarded, Final, Order, Split, Unfinished
from handfast.core.errors import InputError

STEADY = settings(max_examples=25, deadline=None, derandomize=True)
ORDERS = st.sampled_from(list(Order))
WORKERS = st.sampled_from([1, 2])


# --- toys: exact interval arithmetic on fractions ---------------------------------------------------


def times(a, b):
    ends = [x * y for x, y in product(a, b)]
    return min(ends), max(ends)


def plus(a, b):
    return a[0] + b[0], a[1] + b[1]


def square(a):
    low, high = sorted(x * x for x in a)
    return (F(0) if a[0] <= 0 <= a[1] else low), high


@dataclass(frozen=True)
class Boxes:
    """Boxes of intervals with fractions as ends: halved across the longest side down to `width`."""

    root: tuple
    width: F = F(1, 64)
    shallowest: F = F(0)  # boxes narrower than this are given up instead of split

    def empty(self, box) -> bool:
        raise NotImplementedError

    def volume(self, box) -> F:
        out = F(1)
        for low, high in box:
            out *= high - low
        return out

    def examine(self, box):
        if self.empty(box):
            return Discarded("no zero in the enclosure")
        sides = [high - low for low, high in box]
        if max(sides) <= self.width:
            return Final(box)
        if max(sides) <= self.shallowest:
            return Unfinished(box)
        k = sides.index(max(sides))
        low, high = box[k]
        middle = (low + high) / 2
        return Split([(*box[:k], half, *box[k + 1 :]) for half in ((low, middle), (middle, high))])

    def share(self, box) -> float:
        return float(self.volume(box) / self.volume(self.root))

    def encode(self, box):
        return [[str(low), str(high)] for low, high in box]

    def decode(self, data):
        return tuple((F(low), F(high)) for low, high in data)


@dataclass(frozen=True)
class Roots(Boxes):
    """The real roots of the polynomial prod (x - r)."""

    zeros: tuple[F, ...] = ()

    def empty(self, box) -> bool:
        value = (F(1), F(1))
        for r in self.zeros:
            value = times(value, (box[0][0] - r, box[0][1] - r))
        return not value[0] <= 0 <= value[1]


@dataclass(frozen=True)
class Crossing(Boxes):
    """Where the circle x^2 + y^2 = 2 meets the parabola y = x^2: at (-1, 1) and (1, 1)."""

    def empty(self, box) -> bool:
        x, y = box
        circle, parabola = plus(square(x), square(y)), plus(y, times((F(-1), F(-1)), square(x)))
        return not (circle[0] <= 2 <= circle[1] and parabola[0] <= 0 <= parabola[1])


def roots(zeros, **more) -> Roots:
    return Roots(((F(-4), F(4)),), zeros=tuple(zeros), **more)


def search(toy: Boxes, order: Order = Order.DEPTH, workers: int = 1) -> BranchAndPrune:
    return BranchAndPrune(toy, [toy.root], order=order, workers=workers)


def holds(box, point) -> bool:
    return all(low <= x <= high for (low, high), x in zip(box, point, strict=True))


def last(run: BranchAndPrune) -> BranchState:
    for _ in run:
        pass
    return run.state


def lost(run: BranchAndPrune, points) -> list:
    """The points that lie in no final, unfinished or pending region."""
    kept = [*run.state.finals, *run.state.unfinished, *run.pending]
    return [p for p in points if not any(holds(box, p) for box in kept)]


FRACTIONS = st.fractions(-4, 4, max_denominator=97)
ZEROS = st.lists(FRACTIONS, min_size=1, max_size=4, unique=True)


# --- answers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", Order)
@pytest.mark.parametrize("workers", [1, 2])
def test_all_roots_of_a_polynomial(order, workers):
    toy = roots([F(-3), F(1, 3), F(2)])
    state = last(search(toy, order, workers))
    assert state.pending == 0
    assert not state.unfinished
    for zero in toy.zeros:
        assert any(holds(box, (zero,)) for box in state.finals)
    assert all(any(box[0][0] <= z <= box[0][1] for z in toy.zeros) for box in state.finals)  # tight enough here
    assert state.discarded == pytest.approx(1 - sum(map(toy.share, state.finals)), abs=1e-12)


@pytest.mark.parametrize("order", Order)
def test_circle_and_parabola(order):
    toy = Crossing(((F(-3), F(3)), (F(-2), F(2))))
    state = last(search(toy, order))
    for x in (-1, 1):
        assert any(holds(box, (x, 1)) for box in state.finals)
    near = F(1, 8)
    assert all(any(abs(box[0][0] - x) < near for x in (-1, 1)) and abs(box[1][0] - 1) < near for box in state.finals)


def test_nothing_is_proved_to_be_nothing():
    state = last(search(roots([F(5)])))
    assert not [*state.finals, *state.unfinished]
    assert state.pending == 0
    assert state.discarded == pytest.approx(1, abs=1e-12)
    assert state.outcome == Discarded("no zero in the enclosure")


def test_what_is_given_up_is_kept_apart():
    toy = roots([F(1, 3)], width=F(0), shallowest=F(1, 8))
    state = last(search(toy))
    assert not state.finals
    assert any(holds(box, (F(1, 3),)) for box in state.unfinished)


# --- the guarantee -------------------------------------------------------------------------------------


@given(ZEROS, ORDERS, WORKERS)
@STEADY
def test_no_planted_solution_is_lost_at_any_step(zeros, order, workers):
    run = search(roots(zeros), order, workers)
    points = [(z,) for z in zeros]
    assert not lost(run, points)
    for state in run:
        assert not lost(run, points)
        assert state.pending == len(run.pending)
    assert not run.pending


def test_the_check_sees_a_domain_that_loses_a_solution():
    class Careless(Roots):
        def examine(self, box):
            out = super().examine(box)
            return Split(out.children[:1]) if isinstance(out, Split) else out

    run = search(Careless(((F(-4), F(4)),), zeros=(F(3),)))
    last(run)
    assert lost(run, [(F(3),)]) == [(F(3),)]
    assert run.state.discarded == pytest.approx(1)


@given(ZEROS, ORDERS)
@STEADY
def test_the_results_do_not_depend_on_the_workers(zeros, order):
    one, two, three = (last(search(roots(zeros), order, workers)) for workers in (1, 2, 3))
    for other in (two, three):
        assert sorted(one.finals) == sorted(other.finals)
        assert (one.steps, one.nodes, one.depth) == (other.steps, other.nodes, other.depth)


# --- interruptions --------------------------------------------------------------------------------------


def trail(run: BranchAndPrune, steps: int | None = None) -> list:
    return [(state.region, state.steps, state.pending, len(state.finals)) for state in islice(run, steps)]


@given(ZEROS, ORDERS, WORKERS, st.integers(0, 60))
@STEADY
def test_a_resumed_checkpoint_takes_the_same_steps(zeros, order, workers, stop):
    toy = roots(zeros)
    whole = trail(search(toy, order, workers))
    first = search(toy, order, workers)
    begun = trail(first, stop)
    text = json.dumps(first.save())
    second = BranchAndPrune.restored(toy, json.loads(text), workers=workers)
    assert json.dumps(second.save()) == text
    assert begun + trail(second) == whole
    assert begun + trail(first) == whole  # the one that was stopped can go on as well


class Broken(Roots):
    """Fails the first time it sees each region."""

    def examine(self, box):
        if box not in SEEN:
            SEEN.add(box)
            raise KeyboardInterrupt
        return super().examine(box)


SEEN: set = set()


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_examination_is_repeated(workers):
    toy = Broken(((F(-4), F(4)),), zeros=(F(1, 3), F(2)))
    SEEN.clear()
    run, interrupted = search(toy, workers=workers), 0
    while True:
        try:
            last(run)
            break
        except KeyboardInterrupt:
            interrupted += 1
            assert not lost(run, [(F(1, 3),), (F(2),)])
    whole = last(search(roots(toy.zeros), workers=workers))
    assert interrupted > 10
    assert list(run.state.finals) == list(whole.finals)
    assert run.state.steps == whole.steps


@pytest.mark.parametrize("order", Order)
def test_ctrl_c_between_any_two_instructions_loses_and_repeats_nothing(order):
    """KeyboardInterrupt is raised before the n-th bytecode of the engine, for every n, in one search."""
    toy = roots([F(1, 3), F(2)], width=F(1, 8))
    whole = last(search(toy, order))
    run, left = search(toy, order), 0

    def trace(frame, event, _):
        nonlocal left
        if frame.f_code.co_filename != branch.__file__:
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            left -= 1
            if left == 0:
                raise KeyboardInterrupt
        return trace

    sys._getframe().f_trace_opcodes = True  # Python 3.12 looks when the tracing begins whether any frame asks for it
    interrupted, n = 0, 1
    while run.state.pending:
        left = n
        sys.settrace(trace)
        try:
            for _ in run:
                pass
        except KeyboardInterrupt:
            interrupted, n = interrupted + 1, n + 1
        finally:
            sys.settrace(None)
        assert not lost(run, [(F(1, 3),), (F(2),)])
    assert interrupted > 400
    assert list(run.state.finals) == list(whole.finals)
    assert (run.state.steps, run.state.nodes, run.state.depth) == (whole.steps, whole.nodes, whole.depth)
    assert run.state.discarded == pytest.approx(whole.discarded, abs=1e-12)


def test_states_stay_as_they_were():
    run = search(roots([F(-3), F(1, 3), F(2)]))
    states = [(state, list(state.finals), state.pending) for state in run]
    assert all(list(state.finals) == finals and state.pending == pending for state, finals, pending in states)
    view = run.state.finals
    copy = list(view)
    assert [view[0], view[-1], *view[1:3]] == [copy[0], copy[-1], *copy[1:3]]
    with pytest.raises(IndexError):
        states[0][0].finals[0]


def test_an_abandoned_loop_may_not_go_on():
    run = search(roots([F(1, 3)]))
    first, second = iter(run), iter(run)
    next(first)
    next(second)
    with pytest.raises(RuntimeError, match="another loop"):
        next(first)


# --- orders and counts -----------------------------------------------------------------------------------


class Tree:
    """A fixed tree of names; leaves are finals, "c" is cut away without a word."""

    def __init__(self):
        self.children = {"": ["a", "b", "c"], "a": ["aa", "ab"], "b": ["ba"], "c": [], "ba": ["baa", "bab"]}

    def examine(self, name):
        if name in self.children:
            return Split(self.children[name], nodes=10)
        return Final(name, nodes=2)

    def share(self, name):
        return 3.0 ** -len(name)

    def encode(self, name):
        return name

    decode = encode


@pytest.mark.parametrize(
    "order, expected",
    [
        (Order.DEPTH, ["", "a", "aa", "ab", "b", "ba", "baa", "bab", "c"]),
        (Order.BREADTH, ["", "a", "b", "c", "ba", "aa", "ab", "baa", "bab"]),  # a single child is no deeper
    ],
)
def test_orders(order, expected):
    run = BranchAndPrune(Tree(), [""], order=order)
    assert [state.region for state in run] == expected
    assert run.state.nodes == 5 * 10 + 4 * 2
    assert run.state.depth == 2  # "b" goes on as "ba"
    assert set(run.state.finals) == {"aa", "ab", "baa", "bab"}
    assert run.state.discarded == pytest.approx(1 - 2 / 9 - 2 / 27)  # "c", and what splits left out


def test_misuse_is_refused():
    with pytest.raises(ValueError, match="at least 1"):
        BranchAndPrune(Tree(), [""], workers=0)

    class Wrong(Tree):
        def examine(self, name):
            return name

    with pytest.raises(TypeError, match="returned str, which is no outcome"):
        last(BranchAndPrune(Wrong(), [""]))


@pytest.mark.parametrize(
    "change, message",
    [
        ({"schema": "handfast/search/2"}, "schema: input should be 'handfast/search/1'"),
        ({"order": "random"}, "order: input should be 'depth' or 'breadth'"),
        ({"queue": [[0, 0]]}, r"queue\[0\]\[2\]: is missing"),
        ({"queue": [[7, 0, "a"]]}, "queue: holds a serial number twice or out of 0 to 3"),
        ({"queue": [[1, 0, "a"], [1, 0, "b"]]}, "queue: holds a serial number twice"),
        ({"extra": 1}, "extra: is not a known field"),
    ],
)
def test_a_damaged_checkpoint_is_refused(change, message):
    run = BranchAndPrune(Tree(), [""])
    trail(run, 1)
    data = run.save()
    assert BranchAndPrune.restored(Tree(), data).pending == ["a", "b", "c"]
    with pytest.raises(InputError, match=message):
        BranchAndPrune.restored(Tree(), data | change)
