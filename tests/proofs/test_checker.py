"""What the checker accepts: proofs by hand, at any scale; what slack and caps say; planted faults."""

from __future__ import annotations

import time
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from handfast.proofs import checker
from handfast.proofs.certificate import Certificate
from handfast.proofs.checker import checked_rows, verify
from handfast.proofs.fields import Array, Integers
from handfast.proofs.kinds import CLOSED, OPEN, Row
from handfast.proofs.leaves import Late, LeafSystems
from handfast.proofs.question import LARGEST_GOAL, read_question
from handfast.proofs.rows import Columns
from handfast.proofs.tolerance import ENOUGH_CAP, MIN_FORCE_SCALE, TOO_SMALL
from tests.support.proof_certificates import LEAVES, NODES, proof, walls
from tests.support.proof_states import contact, pinch, question

SCALES = [10.0**k for k in range(-11, 12, 2)]


def test_proof_by_hand():
    found = verify(proof())
    assert found.ok
    assert found.reason == ""
    assert found.leaves == 3
    assert found.cap is None
    assert found.unproved == ()
    # 1 N of the load alone counts, less 1e-9 of it in each of the balances that its multipliers meet
    assert 1 - 1e-7 < found.margin < 1


@pytest.mark.parametrize("scale", SCALES)
def test_lengths_and_forces_of_any_size(scale):
    own = (walls(size=scale), walls(force=scale), walls(scale, 1 / scale), walls(scale, at=(9 * scale, 0, scale)))
    for q, unscaled in zip(own, (walls(), walls(), walls(), walls(at=(9, 0, 1))), strict=True):
        found = verify(proof(q))
        assert found.ok
        assert found.cap is None
        assert found.margin == pytest.approx(verify(proof(unscaled)).margin, rel=1e-6)
        assert not verify(proof(q, leaves=[*LEAVES[:2], LEAVES[2][:3]])).ok


@pytest.mark.parametrize("bad", range(3))
def test_of_the_leaves_that_are_looked_at_alone_something_is_said(bad):
    c = proof()
    y = c.multiplier.astype(float)
    y[c.start[bad] : c.start[bad + 1]] = 0.0
    wrong, others = replace(c, multiplier=y), np.flatnonzero(np.arange(3) != bad)
    found = verify(wrong, among=others)
    assert found.ok
    assert found.margin == verify(c, among=others).margin
    for among in ([bad], [bad, others[1]], None):
        found = verify(wrong, among=None if among is None else np.array(among))
        assert not found.ok
        assert found.unproved == (bad,)
    assert verify(wrong, among=np.zeros(0, np.int64)).ok
    y[c.start[bad]] = -1.0
    wrong = replace(c, multiplier=y)
    assert "is negative" in verify(wrong).reason
    assert f"leaf {bad} (node {c.leaves[bad]}), row 0" in verify(wrong, among=np.array([bad])).reason


@pytest.mark.parametrize("tilt", [-1e-6, -1e-8, -1e-10, -1e-12, -1e-14, -1e-16])
def test_walls_that_are_not_quite_parallel_have_a_cap_below_the_motion_that_holds(tilt):
    """c_n = 1 N at both holds 1 N: -r_x = 1 and r_x + tilt r_y = 1 where the object moves along y by -2 / tilt."""
    found = verify(proof(walls(tilt=tilt)))
    assert found.ok
    assert found.cap is not None
    assert found.capped == (2,)
    for among, capped in (([0, 1], ()), ([2], (2,))):
        assert verify(proof(walls(tilt=tilt)), among=np.array(among)).capped == capped
    assert min(0.05 / -tilt, 1e12) < found.cap < 2 / -tilt
    scaled = verify(proof(walls(size=1e9, tilt=tilt))), verify(proof(walls(force=1e-9, tilt=tilt)))
    assert [x.cap for x in scaled] == pytest.approx([found.cap, 1e-9 * found.cap], rel=0.1)


@pytest.mark.parametrize("tilt", [-1e-3, -1e-5])
def test_walls_that_are_not_parallel_at_all(tilt):
    """What holds with a motion of 2e3 N is not refuted with a useful cap."""
    found = verify(proof(walls(tilt=tilt)))
    assert not found.ok or found.cap < 2 / -tilt


@pytest.mark.parametrize(("torque", "ok"), [(1e-6, True), (1e-8, True), (0.9e-9, False), (1e-12, False), (0.0, False)])
def test_loads_that_miss_what_holds_by_rounding_are_not_refuted(torque, ok):
    """Two contacts, 1 m off their middle, hold no torque about their line; 1e-9 of 1 N is allowed for."""
    assert verify(Certificate.of_root(pinch([1, 0, 0, torque, 0, 0]), None)).ok == ok


@pytest.mark.parametrize(("last", "ok"), [(0.9e9, True), (1.1e9, False), (np.inf, False)])
def test_what_may_be_missed_grows_with_the_load_to_the_end_of_the_range(last: float, ok: bool) -> None:
    """Neither contact holds the 1 N m about their line; of a load of 1 N times the scalar 1e-9 may be missed."""
    q = pinch([0, 0, 0, 1, 0, 0], goal=LARGEST_GOAL, direction=[1, 0, 0, 0, 0, 0])
    assert verify(Certificate.of_root(q, (1.0, last))).ok == ok


@pytest.mark.parametrize("arm", [10.0**k for k in (-3, -6, -8, -10, -13, -17)])
def test_pivots_that_pass_a_contact_by_rounding_refute_nothing(arm):
    """A free joint whose axis is near the contact that carries 1 N: its torque may be off by 1e-9 N m."""
    joints = [{"name": "swivel", "axis": [0, 0, 1], "origin": [arm, 0, 1], "moves": [0]}]
    contacts = [contact([0, 0, 1], [0, 0, -1], 1.0), contact([0, 0, -1], [0, 0, 1], 0.0)]
    q = question(contacts, [0, 1, 0, -1, 0, 0], joints=joints, mechanism={"actuators": []})
    assert verify(Certificate.of_root(q, None)).ok == (arm > 5e-9)


PLANTED = {
    "gap in the tree": ({"nodes": [*NODES[:3], NODES[4]], "leaves": LEAVES[::2]}, "contact 1: needs OPEN"),
    "a leaf is missing": ({"leaves": LEAVES[:2]}, "has rows for 2 leaves; the tree has 3"),
    "a leaf too many": ({"leaves": [*LEAVES, LEAVES[0]]}, "has rows for 4 leaves; the tree has 3"),
    "row of another case": (
        {"leaves": [[(Row.GAP_DOWN, 0, 0, 0, 1.0)], *LEAVES[1:]]},
        r"leaf 0 \(node 1\), row 0, GAP_DOWN 0 \[0, 0\]: does not hold in this case",
    ),
    "no such contact": ({"leaves": [[(Row.TANGENT, 2, 0, 0, 1.0)], *LEAVES[1:]]}, r"leaf 0 .*: no such kind, contact"),
    "no such kind": ({"leaves": [[(23, 0, 0, 0, 1.0)], *LEAVES[1:]]}, r"row 0, 23 0 \[0, 0\]: no such kind"),
    "negative": (
        {"leaves": [*LEAVES[:2], [*LEAVES[2][:3], (Row.GAP_DOWN, 1, 0, 0, -0.5)]]},
        r"leaf 2 \(node 4\), row 3, .*: the multiplier is negative or not finite",
    ),
    "nothing contradicts": ({"leaves": [[(Row.TANGENT, 1, 0, 0, 1.0)], *LEAVES[1:]]}, "leaf 0 .* is not proved"),
    "one row is missing": ({"leaves": [*LEAVES[:2], LEAVES[2][:3]]}, r"leaf 2 \(node 4\) is not proved: margin -"),
    "multipliers that do not cancel": (
        {"leaves": [*LEAVES[:2], [*LEAVES[2][:3], (Row.GAP_DOWN, 1, 0, 0, 0.0)]]}, r"leaf 2 \(node 4\) is not proved",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PLANTED)
def test_planted_faults(name):
    changed, why = PLANTED[name]
    found = verify(proof(**changed))
    assert not found.ok
    assert (found.leaves, found.cap) == (len(changed.get("leaves", LEAVES)), None)
    with pytest.raises(ValueError, match=why):
        raise ValueError(found.reason)


def test_multipliers_that_are_no_numbers():
    for value in (np.nan, np.inf):
        found = verify(proof(multiplier=np.array([1] * 9 + [value], dtype=np.float32)))
        assert found.reason.endswith("the multiplier is negative or not finite")
        assert found.margin == -np.inf


@pytest.mark.parametrize("size", [1e-300, 1e-170, 1e-40, 1e40, 1e170, 1e300])
def test_multipliers_of_a_leaf_may_be_of_any_size(size: float) -> None:
    """They are a sum that is more than 0: its size says nothing."""
    found, whole = verify(proof(multiplier=size * np.array(proof().multiplier, dtype=np.float64))), verify(proof())
    assert found.ok
    assert found.margin == pytest.approx(whole.margin, rel=1e-9)


def test_unproved_leaves_are_named():
    wrong = [(Row.TANGENT, 1, 0, 0, 1.0)]
    assert verify(proof(leaves=[wrong, [(Row.TANGENT, 0, 0, 0, 1.0)], LEAVES[2]])).unproved == (0, 1)


def test_states_that_hold_are_not_refuted():
    """A load along x is carried by contact 1 while contact 0 is open: that leaf is not refuted."""
    q = pinch([1, 0, 0, 0, 0, 0])
    assert 0 in verify(proof(q)).unproved
    heavy = [[*LEAVES[0], (Row.CN_UP, 1, 0, 0, 3.0), (Row.GAP_UP, 1, 0, 0, 1.0)], *LEAVES[1:]]
    assert 0 in verify(proof(q, leaves=heavy)).unproved


def test_no_time():
    found = verify(proof(), until=time.monotonic() - 1)
    assert not found.ok
    assert found.reason == "there was no time to check it all"
    assert (found.leaves, found.margin) == (3, -np.inf)


@pytest.mark.parametrize(
    ("quick", "batch", "margins", "wanted", "ok"),
    [
        (False, 3, [0.5, 0.5, 0.5], ["floats 0 1 2"], True),
        (True, 3, [0.5, 0.0, 0.5], ["floats 0 1 2"], False),  # a margin of 0 proves nothing
        (False, 3, [0.5, 0.0, 0.5], ["floats 0 1 2", "exactly 0 1 2"], True),
        (False, 2, [0.5, 0.5, 0.5], ["floats 0 1", "floats 2"], True),
        (True, 2, [0.5, 0.5, 0.5], ["floats 0 1", "floats 2"], True),
        (True, 2, [0.5, np.nan, 0.5], ["floats 0 1"], False),
        (False, 2, [0.5, np.nan, 0.5], ["floats 0 1", "floats 2", "exactly 1"], True),
        (False, 1, [0.0, 0.5, -1.0],
         ["floats 0", "floats 1", "floats 2", "exactly 0", "exactly 2"], True),
    ],
)  # fmt: skip
def test_leaves_are_looked_at_in_batches_and_more_closely_once_all_were(
    monkeypatch: pytest.MonkeyPatch, quick: bool, batch: int, margins: list[float], wanted: list[str], ok: bool
) -> None:
    """All of them, or if it is to be quick up to the first batch with a leaf that is not proved.

    Caps go from batch to batch, the least of them.
    """
    looked: list[str] = []
    given: list[float] = []

    def systems(_: Any, __: Any, some: Integers, ___: Any) -> SimpleNamespace:
        def proved() -> Array:
            looked.append(f"floats {' '.join(map(str, some))}")
            return np.array(margins)[some]

        def more_exactly(before: Array, cap: float, enough: float) -> tuple[Array, Array]:
            assert enough == pytest.approx(ENOUGH_CAP)  # of a load of 1 N
            np.testing.assert_array_equal(before, np.array(margins)[some])
            looked.append(f"exactly {' '.join(map(str, some))}")
            given.append(cap)
            return np.maximum(np.nan_to_num(before), 0.25), np.where(before > 0, np.inf, 40.0 / len(given))

        return SimpleNamespace(proved=proved, more_exactly=more_exactly)

    monkeypatch.setattr(checker, "LEAF_BATCH", batch)
    monkeypatch.setattr(checker, "checked_rows", lambda _, __, some: some)
    monkeypatch.setattr(checker, "LeafSystems", systems)
    found = verify(proof(), quick=quick)
    assert looked == wanted
    failed = tuple(k for k, margin in enumerate(margins) if not margin > 0)
    asked = [x for x in wanted if x.startswith("exactly")]
    assert given == [np.inf, 40][: len(asked)]
    assert found.ok == ok
    assert found.cap == {0: None, 1: 40, 2: 20}[len(asked)]
    assert found.capped == (failed if asked else ())
    assert found.unproved == (() if ok else (1, 2) if batch == 2 else failed)


@pytest.mark.parametrize(("to_the_end", "asked"), [(True, [0, 1, 2]), (False, [0, 1])])
@pytest.mark.parametrize("batch", [1, 2])
@pytest.mark.parametrize("margin", [-1.0, 0.0])
def test_a_leaf_that_is_not_proved_may_end_it(
    monkeypatch: pytest.MonkeyPatch, to_the_end: bool, asked: list[int], batch: int, margin: float
) -> None:
    """Three leaves that floating point does not show, in batches; the second is not proved at all."""
    looked: list[int] = []

    def systems(_: Any, __: Any, some: Integers, ___: Any) -> SimpleNamespace:
        def more_exactly(before: Array, *_: float) -> tuple[Array, Array]:
            looked.extend(some.tolist())
            return np.where(some == 1, margin, 0.25), np.full(len(some), np.inf)

        return SimpleNamespace(proved=lambda: np.full(len(some), -1.0), more_exactly=more_exactly)

    monkeypatch.setattr(checker, "LEAF_BATCH", batch)
    monkeypatch.setattr(checker, "checked_rows", lambda _, __, some: some)
    monkeypatch.setattr(checker, "LeafSystems", systems)
    found = verify(proof(), to_the_end=to_the_end)
    assert looked == asked
    assert not found.ok
    assert found.reason.startswith("leaf 1 ")
    assert found.unproved == ((1,) if to_the_end else (1, 2))


@pytest.mark.parametrize(("scalar", "far"), [(None, 0), ((-3.0, 2.0), -3), ((-3.0, 4.0), 4), ((2.0, np.inf), 2)])
def test_enough_is_of_the_forces_in_play_at_the_far_end_of_the_range(
    scalar: tuple[float, float] | None, far: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[tuple[float, float]] = []

    def more_exactly(_: LeafSystems, margins: Array, cap: float, enough: float) -> tuple[Array, Array]:
        given.append((cap, enough))
        return margins, np.full(len(margins), np.inf)

    monkeypatch.setattr(checker, "in_play", lambda _, magnitude: 10.0 + magnitude)
    monkeypatch.setattr(LeafSystems, "more_exactly", more_exactly)
    goal = {"goal": LARGEST_GOAL, "direction": [1, 0, 0, 0, 0, 0]} if scalar else {}
    verify(Certificate.of_root(pinch([1, 0, 0, 0, 0, 0], **goal), scalar))
    assert given == [(np.inf, (10 + far) * ENOUGH_CAP)]


@pytest.mark.parametrize(("scalar", "far"), [((0.5, 4.0), 4.0), ((0.5, np.inf), 0.5)])
def test_enough_where_states_are_multiples_of_each_other(
    scalar: tuple[float, float], far: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The direction itself, or `far` times what else acts: of a preload of 10 N beside 3 N that is 40 N or 5 N."""
    given: list[float] = []

    def more_exactly(_: LeafSystems, margins: Array, cap: float, enough: float) -> tuple[Array, Array]:
        given.append(enough)
        return margins, np.full(len(margins), np.inf)

    monkeypatch.setattr(checker, "drives", lambda _: 10.0)
    monkeypatch.setattr(LeafSystems, "more_exactly", more_exactly)
    q = pinch([0, 0, 0, 0, 0, 0], goal="smallest preload", direction=[3, 0, 0, 0, 0, 0])
    verify(Certificate.of_root(q, scalar))
    assert given == [pytest.approx(ENOUGH_CAP * max(3, 10 * far))]


@pytest.mark.parametrize("scalar", [(0.0, 0.0), (0.0, 2.0)])
def test_no_commands_at_all_are_no_multiple_of_a_preload(scalar: tuple[float, float]) -> None:
    """An actuator without one is locked, and may have a force of either sign."""
    q = pinch([0, 0, 0, 0, 0, 0], goal="smallest preload", direction=[1, 0, 0, 0, 0, 0])
    assert verify(Certificate.of_root(q, scalar)).reason == "covers no commands at all, with which actuators are locked"


def test_entries_that_vanish_beside_others_prove_nothing() -> None:
    """The motor's force of 10^275 N would hold: its row has 10^-275 for the jaw, and 10^50 for a joint that is tied."""
    slides = [
        {"name": name, "type": "prismatic", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": on}
        for name, on in (("jaw", [0]), ("tied", []))
    ]
    grasp = {"schema": "handfast/grasp/1", "joints": slides}
    grasp["contacts"] = [{"position": [0, 0, 0], "normal": [1, 0, 0], "friction": 0.0}]
    motor = {"name": "m", "joints": {"jaw": 1e-275, "tied": 1e50}}
    grasp["mechanism"] = {"actuators": [motor], "couplings": [{"tied": 1.0}]}
    q = read_question({"grasp": grasp, "goal": "check", "wrench": [-1, 0, 0, 0, 0, 0]}, "")
    assert verify(Certificate.of_root(q, None)).reason == "the grasp has numbers that are too small beside each other"


@pytest.mark.parametrize("late", range(4))
def test_it_ends_before_the_tree_the_equations_and_each_batch(monkeypatch: pytest.MonkeyPatch, late: int) -> None:
    times: list[float] = []

    def in_time(until: float) -> None:
        times.append(until)
        if len(times) > late:
            raise Late

    monkeypatch.setattr(checker, "in_time", in_time)
    monkeypatch.setattr(checker, "LEAF_BATCH", 2)
    assert verify(proof(), np.inf).reason == "there was no time to check it all"
    assert times == [np.inf] * (late + 1)


@pytest.mark.parametrize(("force", "judged"), [(MIN_FORCE_SCALE, True), (MIN_FORCE_SCALE / 2, False), (0.0, True)])
def test_loads_whose_rounding_is_not_bounded_are_not_judged(force: float, judged: bool) -> None:
    """No load at all has the scale 1."""
    found = verify(Certificate.of_root(pinch([force, 0, 0, 0, 0, 0]), None))
    assert not found.ok
    assert (found.reason != TOO_SMALL) == judged


@pytest.mark.parametrize(("size", "judged"), [(1.1e-30, True), (0.9e-30, False)])
def test_grasps_whose_rounding_is_not_bounded_are_not_judged(size: float, judged: bool) -> None:
    assert (verify(proof(walls(size=size / walls().grasp.size))).reason != TOO_SMALL) == judged


def test_sticking_contacts_leave_motions_free():
    """Both walls stick and nothing but the equilibrium is used: a torque about their line is held by neither."""
    q = pinch([0, 0, 0, 1, 0, 0])
    assert verify(Certificate.of_root(q, None)).ok
    split = [NODES[0], (0, 0, OPEN, 0, 0), (0, 0, CLOSED, 0, 0)]
    empty = {"start": [0, 0, 0], "kind": [], "index": [], "a": [], "b": [], "multiplier": []}
    assert verify(proof(q, nodes=split, **empty)).ok
    assert CLOSED == 2


def test_what_pushes_the_scalar_is_the_bound_at_its_first_end_alone():
    q = pinch([0, 0, 0, 0, 0, 0], goal=LARGEST_GOAL, direction=[0, 0, 1, 0, 0, 0])
    at, none, root = Columns.of(q), np.zeros(3, np.int64), np.zeros(1, np.int64)
    kind = np.array([Row.BOUND_UP, Row.BOUND_UP, Row.BOUND_DOWN])
    index = np.array([at.scalar.start, at.c.start, at.scalar.start])
    c = Certificate(q, (1.0, 2.0), root - 1, *[root] * 4, np.array([0, 3]), kind, index, none, none, np.ones(3))
    found = checked_rows(c, np.zeros((1, q.grasp.m + q.actuators, 3), np.int64), np.arange(1))
    assert found.first.tolist() == [True, False, False]
    assert found.right[found.which].tolist() == [1.0, 0.0, -2.0]
