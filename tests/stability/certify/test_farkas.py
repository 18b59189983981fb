"""Proofs about all motions: exact arithmetic agrees, ranks that rounding hides are found, no forgery passes."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest

from benchmarks.grasps import random_case
from handfast.core.answer import Stop, Verdict
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.certify import farkas, leaf_rows, verify
from handfast.stability.certify.certificate import Columns, Question, Row
from handfast.stability.queries import check, maximum
from handfast.stability.settings import Settings
from tests.support.certificates import (
    AS_WRITTEN,
    CASES,
    CLOSED,
    LOCKED,
    MOVES,
    OPEN,
    PULL_Y,
    PULL_Z,
    SLIDE,
    STICK,
    TURN,
    Known,
    empty,
    exact_equations,
    proof,
    prove,
    row,
)
from tests.support.problems import nest, pinch

SEEDS = [(3, 1), (3, 2), (3, 3), (4, 1)]  # contacts, seed
ONE_IN_A_THOUSAND = Settings(gap=1e-3, time_limit=60)


def refused(certificate, match: str) -> None:
    answer = verify.verify(certificate)
    assert not answer.ok
    assert "\n" not in answer.reason
    assert re.search(match, answer.reason), answer.reason


@cache
def bounded(m: int, seed: int):
    """The largest load of a random grasp, with its certificate."""
    case = random_case(m, seed)
    answer = maximum(case.grasp, case.direction, settings=ONE_IN_A_THOUSAND)
    assert answer.stop is Stop.COMPLETE
    return case, answer


@cache
def slips(m: int, seed: int):
    """The certificate that a little more than the largest load is not resisted; None where there is no largest."""
    case, answer = bounded(m, seed)
    if answer.unbounded:
        return None
    return check(case.grasp, 1.01 * answer.upper * case.direction, settings=ONE_IN_A_THOUSAND).certificate


def certificates():
    """Of the engine, for random grasps: one of each kind of question."""
    return [c for key in SEEDS for c in (bounded(*key)[1].certificate, slips(*key)) if c is not None]


# --- in exact arithmetic -----------------------------------------------------------------------------


def exact_margin(c, leaf, cases):
    """y b + v h over its terms, of multipliers near the file's that cancel exactly; None if no such are found.

    Rows and equations are those of `certificates`, all numbers are fractions. Forces of open contacts are 0. Where
    the equations alone contradict each other, the multipliers do not matter.
    """
    q, at = c.question, Columns.of(c.question)
    E, h, Z = exact_equations(q)
    known, m = Known.of(c), q.grasp.m
    zero = {k for i in range(m) if cases[leaf, i, 0] == OPEN for k in range(at.c.start + 3 * i, at.c.start + 3 * i + 3)}
    rows, right, w, free = [], [], [], []
    for r in range(c.start[leaf], c.start[leaf + 1]):
        name = tuple(int(u[r]) for u in (c.kind, c.index, c.a, c.b))
        entries, b = row(c, known, *name, AS_WRITTEN)
        x = {}
        for place, value in entries.items():
            terms = {place: 1} if place < at.n else Z[place - at.n]
            for k, z in terms.items():
                x[k] = x.get(k, Fraction(0)) + Fraction(value) * z
        rows.append(x)
        right.append(Fraction(b))
        w.append(float(c.multiplier[r]))
        free.append(is_equation(q, Row(name[0]), name[1], cases[leaf]))
    count = len(rows)
    rows, right, free = rows + E, right + h, free + [True] * len(E)
    rows = [{k: v for k, v in x.items() if v and k not in zero} for x in rows]
    A = np.array([[float(x.get(k, 0)) for k in range(at.n)] for x in rows])
    b = np.array([float(x) for x in h])
    near = np.linalg.lstsq(A[count:].T, -(np.array(w) @ A[:count]), rcond=1e-10)[0] if count else 0 * b
    found = []
    for y, v in ((w, near), (0 * np.array(w), b - A[count:] @ np.linalg.lstsq(A[count:], b, rcond=1e-10)[0])):
        exact = cancelled(rows, [Fraction(float(x)) for x in [*y, *v]], free, known.scale)
        if exact is None or any(x < 0 and not any_sign for x, any_sign in zip(exact, free, strict=True)):
            continue
        terms = [x * r for x, r in zip(exact, right, strict=True)]
        size = sum(abs(t) for t in terms)
        found.append(sum(terms) / size if size else Fraction(0))
    return next((margin for margin in found if margin > 0), found[0] if found else None)


def is_equation(q, kind, index, case) -> bool:
    """Does this inequality hold with equality in its case, so that its multiplier may have any sign?"""
    contact = case[index, 0] if index < q.grasp.m else -1
    actuator = case[q.grasp.m + index, 0] if index < q.grasp.mechanism.a else -1
    if kind in (Row.GAP_UP, Row.GAP_DOWN):
        return bool(q.eta == 0 and contact in (CLOSED, STICK, SLIDE))
    if kind in (Row.T_UP, Row.T_DOWN):
        return bool(actuator == LOCKED or not q.may_move[index])
    if kind in (Row.E_UP, Row.E_DOWN):
        return bool(actuator == MOVES and not q.is_driven[index])
    return Row.STILL_1_UP <= kind <= Row.STILL_2_DOWN


def cancelled(rows, w, free, scale):
    """Multipliers near w whose sum of rows is exactly 0: what is missing is made up by equations first, then by the
    inequalities that count most. Rows that differ from others by little more than rounding are left as they are, as
    long as the others do. None if the rows do not allow it."""

    def size(x):
        return max((abs(float(v)) * scale[k] for k, v in x.items()), default=0.0)

    order = sorted(range(len(rows)), key=lambda j: (not free[j], -abs(float(w[j])) * size(rows[j])))
    missing = {}
    for y, x in zip(w, rows, strict=True):
        for k, v in x.items():
            missing[k] = missing.get(k, Fraction(0)) + y * v
    basis, out = [], list(w)  # (pivot, row, of which rows it is made): echelon form
    for least in (1e-6, 0.0):
        left = []
        for j in order:
            entries, made = dict(rows[j]), {j: Fraction(1)}
            for pivot, other, parts in basis:
                if entries.get(pivot):
                    factor = entries[pivot] / other[pivot]
                    add(entries, other, -factor)
                    add(made, parts, -factor)
            entries = {k: v for k, v in entries.items() if v}
            if size(entries) <= least * size(rows[j]):
                left.append(j)
                continue
            pivot = max(entries, key=lambda k: abs(float(entries[k])) * scale[k])
            basis.append((pivot, entries, made))
            if missing.get(pivot):
                factor = missing[pivot] / entries[pivot]
                add(missing, entries, -factor)
                for k, v in made.items():
                    out[k] -= factor * v
        if not any(missing.values()):
            return out
        order = left
    return None


def add(x, y, factor) -> None:
    """x += factor * y, as sparse rows."""
    for k, v in y.items():
        x[k] = x.get(k, Fraction(0)) + factor * v


def compare(c, most: int = 15) -> int:
    """Every leaf that the checker accepts is proved in exact arithmetic too; returns how many were compared."""
    cases = verify.leaf_cases(c)
    margins = farkas.proved_margins(c, cases)
    assert (margins > 0).all()
    chosen = np.random.default_rng(0).permutation(len(margins))[:most]
    for leaf in chosen.tolist():
        exact = exact_margin(c, leaf, cases)
        assert exact is not None, f"leaf {leaf}: no multipliers near those of the file cancel"
        assert exact > 0, f"leaf {leaf}"
    return len(chosen)


@pytest.mark.parametrize("name", CASES)
def test_proofs_of_the_prover_are_proofs_in_exact_arithmetic(name: str) -> None:
    assert compare(proof(name)) > 0


@pytest.mark.parametrize(("m", "seed"), SEEDS)
def test_proofs_of_the_engine_are_proofs_in_exact_arithmetic(m: int, seed: int) -> None:
    for c in (bounded(m, seed)[1].certificate, slips(m, seed)):
        if c is not None:
            assert compare(c) > 0


@pytest.mark.parametrize("name", ["smallest preload", "max", "sum", "max of turned"])
def test_where_a_proof_ends(name: str) -> None:
    """The largest range that the multipliers still prove: exact arithmetic agrees on this side and just beyond."""
    c, cases = proof(name), verify.leaf_cases(proof(name))
    good, bad = c.scalar[1], 2 * c.scalar[1]
    for _ in range(50):
        middle = (good + bad) / 2
        good, bad = (middle, bad) if verify.verify(replace(c, scalar=(0.0, middle))).ok else (good, middle)
    leaves = range(len(c.leaves))
    here, beyond = (replace(c, scalar=(0.0, end)) for end in (good, good * (1 + 1e-6)))
    assert min(exact_margin(here, leaf, cases) for leaf in leaves) >= 0
    assert min(exact_margin(beyond, leaf, cases) for leaf in leaves) < 0


# --- ranks --------------------------------------------------------------------------------------------


def two_points(apart: float = 0.0) -> Grasp:
    """Two fixed fingertips on the x axis press on nothing that moves them; the second may be a little off."""
    ends = np.array([[0.03, 0.01, 0.02], [-0.03, 0.01, 0.02 + apart]])
    return Grasp([Contact(p, np.array([-np.sign(p[0]), 0.0, 0.0]), 0.5) for p in ends], name="two points")


@cache
def turning(apart: float = 0.0):
    """Two contacts that stick: the object turns about the line through them, so that 6 rows have rank 5."""
    weight = np.r_[0.0, 0.0, -1.0, 0.0, 0.0, 0.0] + np.r_[np.zeros(3), np.cross([0.0, 0.01, 0.02], [0.0, 0.0, -1.0])]
    return prove(Question(two_points(apart), wrench=weight), eager=False)


def test_lost_ranks_are_found() -> None:
    """Without a preload nothing is held; in the case that both stick the motion about their line is left over."""
    c = turning()
    assert c is not None
    assert verify.verify(c).ok
    cases = verify.leaf_cases(c)
    both = np.flatnonzero((cases[:, :2, 0] == STICK).all(axis=1))
    assert len(both)
    for leaf in both.tolist():
        assert exact_margin(c, leaf, cases) > 0


def sticking(apart: float):
    """Both stick and carry: rows of a case in which ranks are lost, with multipliers for them that cancel."""
    c = turning()
    grasp = two_points(apart)
    return replace(c, question=replace(c.question, grasp=grasp))


@pytest.mark.parametrize("apart", [1e-16, 1e-14, 1e-12, 1e-9])
def test_a_contact_that_is_moved_a_little(apart: float) -> None:
    """Where the line goes through other points the same multipliers may prove it or not, but arithmetics agree."""
    c = sticking(apart)
    cases = verify.leaf_cases(c)
    with np.errstate(all="ignore"):
        margins = farkas.proved_margins(c, cases)
    for leaf in np.flatnonzero(margins > 0).tolist():
        exact = exact_margin(c, leaf, cases)
        assert exact is not None
        assert exact > 0
    found = verify.verify(c)
    assert found.unproved == tuple(np.flatnonzero(~(margins > 0)).tolist())
    assert (found.cap is None and found.ok) == (not found.unproved)  # the others up to some motion, if at all


@pytest.mark.parametrize("shift", [0.0, 1.0, 1e3])
def test_equations_that_contradict_each_other(shift: float) -> None:
    """A tendon pulls two joints alike that lie 20 and 30 mm below a fingertip: a force across would need 2 : 3."""
    tips, contacts, joints = (0.03 + shift, -0.03 + shift), [], []
    for i, x in enumerate(tips):
        contacts.append(Contact([x, 0.0, 0.0], [2.0 * i - 1.0, 0.0, 0.0], 0.5))
        joints += [GraspJoint(f"j{i}{k}", [0.0, 0.0, 1.0], [x, -0.02 - 0.01 * k, 0.0], (i,)) for k in range(2)]
    R = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    grasp = Grasp(contacts, joints, Mechanism(("a", "b"), R, np.zeros((0, 4)), (True, True)), {"a": 0.1, "b": 0.1})
    across = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    answer = check(grasp, across)
    assert (answer.verdict, answer.stop, answer.verified) == (Verdict.SLIPS, Stop.COMPLETE, True)
    assert len(answer.certificate.leaves) == 1
    assert not len(answer.certificate.kind)
    most = maximum(grasp, across)
    assert (most.verdict, most.stop, most.verified) == (Verdict.SLIPS, Stop.COMPLETE, True)
    refused(replace(answer.certificate, question=replace(answer.question, wrench=np.zeros(6))), "is not proved")


def test_two_points_hold_no_weight() -> None:
    """Fixed as they are, they press only if something pushes the object against both: nothing does."""
    answer = check(two_points(), turning().question.wrench)
    assert (answer.verdict, answer.stop, answer.verified) == (Verdict.SLIPS, Stop.COMPLETE, True)
    near = check(two_points(1e-12), turning().question.wrench, settings=Settings(time_limit=5))
    assert near.verdict is not Verdict.HOLDS  # numbers may not suffice to tell


def test_ranks_that_matter_are_not_made_up() -> None:
    """A multiplier of what sticks does not cancel by itself: a force along the line is held."""
    along = Question(two_points(), wrench=np.r_[1.0, 0, 0, 0, 0.02, -0.01])
    assert check(along.grasp, along.wrench).verdict is Verdict.HOLDS
    c = replace(turning(), question=along)
    refused(c, "is not proved")


# --- planted faults -----------------------------------------------------------------------------------


def put(array, i, value):
    out = array.copy()
    out[i] = value
    return out


def without_row(c, r):
    """The certificate without one row."""
    start = c.start - (c.start > r)
    return replace(
        c, start=start, **{k: np.delete(getattr(c, k), r) for k in ("kind", "index", "a", "b", "multiplier")}
    )


def with_row(c, leaf, name, y):
    """The certificate with one row more in a leaf."""
    at = c.start[leaf]
    rows = {k: np.insert(getattr(c, k), at, v) for k, v in zip(("kind", "index", "a", "b"), name, strict=True)}
    start = c.start + (np.arange(len(c.start)) > leaf)
    return replace(c, start=start, multiplier=np.insert(c.multiplier, at, y), **rows)


def agree(c) -> None:
    """The checker's word and exact arithmetic: what is accepted is proved."""
    if verify.verify(c).ok:
        cases = verify.leaf_cases(c)
        margins = [exact_margin(c, leaf, cases) for leaf in range(len(c.leaves))]
        assert all(margin is not None and margin > 0 for margin in margins)


def test_a_row_dropped() -> None:
    """Where the others do not prove the leaf it is refused, and sometimes they do."""
    c = proof("check")
    answers = []
    for r in range(0, len(c.kind), 5):
        other = without_row(c, r)
        agree(other)
        answers.append(verify.verify(other).ok)
    assert not all(answers)


def test_a_leaf_without_rows() -> None:
    c, cases = proof("check"), verify.leaf_cases(proof("check"))
    for leaf in range(len(c.leaves)):
        other = c
        for _ in range(c.start[leaf + 1] - c.start[leaf]):
            other = without_row(other, c.start[leaf])
        margin = exact_margin(other, leaf, cases)
        assert not verify.verify(other).ok or (margin is not None and margin > 0)


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.01, 1e6, 1e150, 1e300])
def test_a_multiplier_changed(factor: float) -> None:
    """The checker makes multipliers exact: it may find others, and then they are a proof."""
    c = proof("check")
    for r in range(0, len(c.kind), 17):
        agree(replace(c, multiplier=put(c.multiplier, r, factor * c.multiplier[r])))


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (np.nan, r"the multiplier is negative or not finite"),
        (np.inf, r"the multiplier is negative or not finite"),
        (-1e-300, r"the multiplier is negative or not finite"),
    ],
)
def test_absurd_multipliers(value: float, reason: str) -> None:
    c = proof("check")
    refused(replace(c, multiplier=put(c.multiplier, 3, value)), reason)
    refused(replace(c, multiplier=np.full_like(c.multiplier, value)), reason)


@pytest.mark.parametrize("state", [OPEN, CLOSED, STICK, SLIDE])
def test_the_case_of_a_leaf_changed(state: int) -> None:
    """A leaf's rows do not hold in another case, or the tree has a gap."""
    c = proof("nest")
    for leaf in range(len(c.leaves)):
        node = c.leaves[leaf]
        if c.state[node] != state:
            refused(replace(c, state=put(c.state, node, state)), "needs|no sector|does not hold|not a full turn")


@pytest.mark.parametrize("side", ["a", "b"])
def test_rows_of_other_sectors(side: str) -> None:
    """The chord of a narrower sector, or the end of another, need not hold."""
    c = proof("nest")
    chords = np.flatnonzero(c.kind == Row.CHORD)
    assert len(chords)
    step = 1 if side == "a" else -1
    for r in chords.tolist():
        refused(replace(c, **{side: put(getattr(c, side), r, getattr(c, side)[r] + step)}), "does not hold in this")
        turned = {k: put(getattr(c, k), r, getattr(c, k)[r] + TURN // 3) for k in ("a", "b")}
        refused(replace(c, **turned), "CHORD .*does not hold in this case")


def test_bounds_of_what_has_none() -> None:
    """Motions, forces of actuators without a limit, and tangential forces have no bound to cite."""
    c = proof("check")
    at = Columns.of(c.question)
    lo, hi = leaf_rows.bounds(c.question, c.scalar)
    for column in range(at.n):
        for kind, end in ((Row.BOUND_UP, lo), (Row.BOUND_DOWN, hi)):
            other = with_row(c, 0, (kind, column, 0, 0), 1e-9)
            if not np.isfinite(end[column]):
                refused(other, f"{kind.name} {column} .*does not hold in this case")
    assert not np.isfinite(np.r_[lo[at.r], hi[at.r], lo[at.q], hi[at.q], lo[at.f], hi[at.f]]).any()
    assert not np.isfinite(hi[at.c]).any()
    assert (lo[at.c][0::3] == 0).all()


@pytest.mark.parametrize(
    ("name", "scalar"),
    [
        ("smallest preload", (0.0, 1.001)),
        ("smallest preload", (0.0, np.inf)),
        ("largest", (0.79, 3.0)),
        ("max", (0.0, 0.101)),
        ("sum", (0.0, 0.101)),
        ("max of turned", (0.0, 0.101)),
    ],
)
def test_ranges_wider_than_what_is_true(name: str, scalar: tuple[float, float]) -> None:
    """The pinch resists 1 N with 0.1 N m: no multipliers whatever prove more."""
    refused(replace(proof(name), scalar=scalar), "is not proved|BOUND_DOWN .*does not hold in this case")


def test_a_range_without_end_needs_a_proof_without_end() -> None:
    """The nest cannot pull, at any preload; a proof that uses the end of its range does not reach farther."""
    q = replace(CASES["smallest preload"][0], direction=PULL_Z, grasp=nest(0.0).with_preload(None))
    c = prove(Question(q.grasp, "smallest preload", direction=PULL_Z), (0.0, np.inf))
    assert c is not None
    assert verify.verify(c).ok
    c = proof("smallest preload")
    assert (c.kind == Row.BOUND_DOWN).any()
    refused(replace(c, scalar=(c.scalar[0], np.inf)), "does not hold|is not proved")


def moved(grasp: Grasp, by: float) -> Grasp:
    """With its first contact elsewhere."""
    first, *others = grasp.contacts
    there = first.position + by * np.array([0.0, 1.0, 0.0])
    return Grasp([replace(first, position=there), *others], grasp.joints, preload=grasp.preload, name=grasp.name)


@pytest.mark.parametrize(
    "change",
    [
        lambda q: replace(q, grasp=q.grasp.with_friction(0.56)),
        lambda q: replace(q, grasp=q.grasp.with_preload({"left": 0.12, "right": 0.12})),
        lambda q: replace(q, wrench=0.999 * PULL_Y),
        lambda q: replace(q, wrench=-q.wrench),
        lambda q: replace(q, grasp=moved(q.grasp, 0.03)),
    ],
)
def test_the_question_changed_afterwards(change) -> None:
    refused(replace(proof("check"), question=change(proof("check").question)), "is not proved")


# --- attacks ------------------------------------------------------------------------------------------


def holding(m: int, seed: int):
    """A question that is answered by a witness, and certificates that more is not resisted."""
    case, answer = bounded(m, seed)
    if answer.unbounded or answer.lower == 0:
        return None
    load = 0.999 * answer.lower
    held = check(case.grasp, load * case.direction, settings=ONE_IN_A_THOUSAND)
    if held.verdict is not Verdict.HOLDS:  # what is resisted need not be an interval
        return None
    assert held.witness.valid
    return case, load, held.question


@pytest.mark.parametrize(("m", "seed"), SEEDS)
def test_what_holds_is_not_refuted(m: int, seed: int) -> None:
    """Certificates of slightly larger loads, with the load that holds put into them, and multipliers shaken."""
    found = holding(m, seed)
    if found is None:
        pytest.skip("resists everything, or nothing")
    case, _, question = found
    rng = np.random.default_rng(seed)
    accepted = []
    for factor in (1.003, 1.01, 1.1, 2.0):
        c = check(
            case.grasp, factor * bounded(m, seed)[1].upper * case.direction, settings=ONE_IN_A_THOUSAND
        ).certificate
        if c is None:
            continue
        forged = replace(c, question=question)
        tries = [
            forged,
            *(replace(forged, multiplier=shaken(c.multiplier, rng, by)) for by in (1e-12, 1e-6, 1e-3, 0.1)),
        ]
        accepted += [verify.verify(other).ok for other in tries]
    assert accepted
    assert not any(accepted)


@pytest.mark.parametrize(("m", "seed"), SEEDS)
def test_a_maximum_is_not_lowered(m: int, seed: int) -> None:
    """The range of the smallest preload stretched to the load that holds: no multipliers near prove it."""
    found = holding(m, seed)
    if found is None:
        pytest.skip("resists everything, or nothing")
    _, load, _ = found
    c = bounded(m, seed)[1].certificate
    rng = np.random.default_rng(seed)
    wider = replace(c, scalar=(c.scalar[0], 1 / load))
    for other in (wider, *(replace(wider, multiplier=shaken(c.multiplier, rng, by)) for by in (1e-9, 1e-4, 0.1))):
        refused(other, "is not proved")
    refused(replace(c, scalar=(c.scalar[0], np.inf)), "is not proved|does not hold")


def shaken(y, rng, by):
    """Multipliers changed by a share each, at random."""
    return np.abs(y * (1 + by * rng.normal(size=len(y))))


def test_random_multipliers_refute_nothing() -> None:
    """Of every row that a case allows, in a state that is true: the pinch holds half of what it can."""
    rng = np.random.default_rng(0)
    question = Question(pinch(), wrench=0.5 * PULL_Y)
    base = replace(proof("check"), question=question)
    for _ in range(50):
        y = rng.exponential(size=len(base.multiplier)) ** rng.integers(1, 8)
        refused(replace(base, multiplier=y), "is not proved")
    refused(empty(question), "is not proved")


def test_the_sample_has_bounds() -> None:
    assert len(certificates()) >= 6
    kinds = {kind for c in certificates() for kind in c.kind.tolist()}
    assert {Row.CHORD, Row.GAP_UP, Row.STILL_1_UP, Row.TANGENT, Row.CN_UP, Row.BOUND_DOWN} <= kinds
    assert any((verify.leaf_cases(c)[:, c.question.grasp.m :, 0] == MOVES).any() for c in certificates())
