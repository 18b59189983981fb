"""Every row that is legal in a case holds for exact states of the model in that case; what rows say, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handfast.proofs.cases import HALF_TURN
from handfast.proofs.equations import equations_of
from handfast.proofs.grasp import StartData
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    CLOSED,
    CONE_WIDENING,
    FREE,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN_DIRECTIONS,
    UNDECIDED,
)
from handfast.proofs.question import CHECK, LARGEST_GOAL, SMALLEST_PRELOAD, TORQUES, Question
from handfast.proofs.rows import (
    MAX_CHORD_SECTOR,
    OF_ACTUATOR,
    OF_CONTACT,
    Columns,
    LeafRows,
    Row,
    bounds,
    different,
    directions,
    equalities,
    known,
    legal,
    row_values,
    zeros,
)
from handfast.proofs.tolerance import EPS, load_scale
from tests.support.proof_states import case_of, contact, drawn, pinch, question

FAMILIES = {
    "check": {"goal": CHECK},
    "check with eta": {"goal": CHECK, "eta": 0.3},
    "soft fingers": {"goal": CHECK, "soft": True},
    "smallest preload": {"goal": SMALLEST_PRELOAD},
    "largest": {"goal": LARGEST_GOAL},
    "torques": {"goal": TORQUES},
    "sum of torques": {"goal": TORQUES, "sums": True, "eta": 0.1},
}
SOFT = {row for row in Row if Row.ENERGY < row < Row.S_DOWN}
COMMANDED, DRIVEN = SOFT | {Row.S_UP, Row.S_DOWN}, SOFT | {Row.ENERGY}
MISSING = {  # what holds nowhere in a family
    "check": COMMANDED | {Row.BOUND_DOWN},
    "check with eta": COMMANDED | {Row.BOUND_DOWN},
    "soft fingers": {Row.S_UP, Row.S_DOWN, Row.BOUND_DOWN, Row.CHORD, Row.C_LEFT, Row.C_RIGHT},
    "smallest preload": COMMANDED | {Row.ENERGY},  # there are springs
    "largest": COMMANDED | {Row.ENERGY},
    "torques": DRIVEN,
    "sum of torques": DRIVEN | {Row.E_DOWN, Row.S_DOWN},
}


def every_row(q, cases, rng, references):
    """Rows of all kinds about everything, with directions at the ends of the case's sectors and elsewhere."""
    made = []
    n = Columns.of(q).n
    for kind in Row:
        count = q.grasp.m if OF_CONTACT[kind] else q.actuators if OF_ACTUATOR[kind] else n
        count = len(references) if kind == Row.ENERGY else count
        for index in range(count):
            state = cases[0, index] if OF_CONTACT[kind] else np.zeros(3, dtype=int)
            own = [
                (state[1], state[2]),
                (state[1] - TURN_DIRECTIONS, state[2] - TURN_DIRECTIONS),
                (state[2] - HALF_TURN, state[1] + HALF_TURN),
            ]
            a, b = np.sort(rng.integers(-TURN_DIRECTIONS, TURN_DIRECTIONS, size=2))
            if kind in (Row.SOFT_CHORD, Row.C_SIDE, Row.D_SIDE):
                own = [(state[1] >> k, side) for k in range(4) for side in (-1, 0, 1, 2, 3)]
            made += [(kind, index, *ends) for ends in (*own, (a, b), (a, a + HALF_TURN // 2))]
    kind, index, a, b = np.array(made, dtype=np.int64).T
    return LeafRows(kind, index, a, b, np.zeros(len(kind), dtype=np.int64), references)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.slow
def test_every_legal_row_holds_for_exact_states(family):
    rng, counts = np.random.default_rng(len(family)), dict.fromkeys(Row, 0)
    for _ in range(75):
        state = drawn(rng, **FAMILIES[family])
        q, at = state.question, Columns.of(state.question)
        top = 1.0 if state.scalar is None else state.scalar[1]
        scalar = np.array([[top], [top], [top * 0.5]])
        references = np.hstack([np.abs(rng.normal(size=(3, q.grasp.m))), scalar])
        references[0, :-1] = state.x[at.c][0::3]
        cases = case_of(state, rng)[None]
        rows = every_row(q, cases, rng, references)
        assert known(q, rows).all()
        fine = legal(q, state.scalar, rows, cases)
        rows = LeafRows(*(x[fine] for x in (rows.kind, rows.index, rows.a, rows.b, rows.leaf)), references)
        value, right = row_values(q, state.scalar, rows)
        z = np.concatenate([state.x, state.motions])
        excess, size = value @ z - right, np.abs(value) @ np.abs(z) + np.abs(right)
        wrong = np.flatnonzero(excess < -1e-11 * size - 1e-13)
        assert not len(wrong), [(Row(rows.kind[k]).name, rows.index[k], rows.a[k], rows.b[k]) for k in wrong[:3]]
        zero = equalities(q, rows, cases)
        assert (np.abs(excess[zero]) <= 1e-11 * size[zero] + 1e-13).all()
        assert np.abs(z[: at.n][zeros(q, cases)[0]]).max(initial=0.0) <= 1e-12
        for kind in Row:
            counts[kind] += int((rows.kind == kind).sum())
        # (1) and (2), the coupling and the locked actuator hold for it as well
        e = equations_of(q)
        h = np.zeros(len(e.E))
        h[:6], h[6 : 6 + q.joints] = -q.load.w_a, q.load.g_a
        assert np.abs(e.E @ state.x - h).max() <= 1e-9
        assert np.abs(e.Z @ state.x - state.motions).max() <= 1e-9
    assert {kind for kind in Row if not counts[kind]} == MISSING[family]


def alone(q, kind, index=0, a=0, b=0, references=((),), scalar=None):
    """One row's numbers."""
    some = LeafRows(*(np.array([x]) for x in (int(kind), index, a, b, 0)), np.array(references, dtype=float))
    value, right = row_values(q, scalar, some)
    return value[0], right[0]


QUARTER = TURN_DIRECTIONS // 4


@pytest.mark.parametrize("contact_index", [0, 1])
def test_coefficients_of_a_contact_by_hand(contact_index: int) -> None:
    """mu 0.5, eta 30 degrees; U_0 = (1, 0), U_quarter = (0, 1), 1 + U.U = 1; columns c at 6, d at n = 12."""
    q = pinch([0, 0, -1, 0, 0, 0], eta=np.pi / 6)
    at = Columns.of(q)
    assert (at.c.start, at.n) == (6, 12)
    c, d, sin, cos = 6 + 3 * contact_index, 12 + 3 * contact_index, 0.5, np.sqrt(0.75)
    expected = {
        Row.CN_UP: {c: 1},
        Row.CN_DOWN: {c: -1},
        Row.GAP_UP: {c: 1, d: cos, d + 1: -sin, d + 2: -sin},
        Row.GAP_DOWN: {c: -1, d: -cos, d + 1: sin},
        Row.DN_UP: {d: cos, d + 1: -sin, d + 2: -sin},
        Row.TANGENT: {c: 0.5, c + 1: -1},
        Row.CHORD: {c: -0.25, c + 1: 0.5, c + 2: 0.5},
        Row.C_LEFT: {c + 2: 1},
        Row.C_RIGHT: {c + 1: 1},
        Row.D_LEFT: {d + 2: -1},
        Row.D_RIGHT: {d + 1: -1},
        Row.STILL_1_UP: {d + 1: 1},
        Row.STILL_1_DOWN: {d + 1: -1},
        Row.STILL_2_UP: {d + 2: 1},
        Row.STILL_2_DOWN: {d + 2: -1},
    }
    about = [(kind, 0, QUARTER, entries) for kind, entries in expected.items()]
    about += [(Row.GAP_DOWN, QUARTER, 0, {c: -1, d: -cos, d + 2: sin}), (Row.C_LEFT, QUARTER, 0, {c + 1: -1})]
    half = np.sqrt(0.5)  # of an eighth of a turn: 1 + U.U = 1 + half
    about += [
        (Row.GAP_UP, 0, QUARTER // 2, {c: 1, d: cos, d + 1: -sin, d + 2: -sin * (np.sqrt(2) - 1)}),
        (Row.C_RIGHT, 0, 0, {c + 2: -1}),
        (Row.D_LEFT, QUARTER, 0, {d + 1: 1}),
        (Row.D_RIGHT, 0, 0, {d + 2: 1}),
        (Row.CHORD, 0, QUARTER // 2, {c: -(1 + half) / 4, c + 1: (1 + half) / 2, c + 2: half / 2}),
    ]
    for kind, left, right_end, entries in about:
        value, right = alone(q, kind, contact_index, left, right_end)
        wanted = np.zeros(len(value))
        wanted[list(entries)] = list(entries.values())
        assert value == pytest.approx(wanted, abs=2e-12), kind.name
        assert right == 0
    tangent, chord = (alone(q, kind, contact_index, 0, QUARTER)[0] for kind in (Row.TANGENT, Row.CHORD))
    open_up, down = (alone(q, kind, contact_index, 0, 0)[0][d + 1] for kind in (Row.GAP_UP, Row.GAP_DOWN))
    assert (open_up, down) == (-np.sin(np.pi / 6) * (1 + CONE_WIDENING), np.sin(np.pi / 6) * (1 - CONE_WIDENING))
    gives_way = tangent[c], chord[c]
    assert gives_way == (0.5 * (1 + CONE_WIDENING), -0.5 * (0.5 - CONE_WIDENING))


def test_sectors_of_half_a_turn_have_sides_but_no_chord():
    q = pinch([0, 0, -1, 0, 0, 0], eta=0.1)
    for width, fine in ((MAX_CHORD_SECTOR - 1, True), (MAX_CHORD_SECTOR, False), (HALF_TURN - 1, False)):
        cases = np.array([[[SLIDE, 7, 7 + 10], [OPEN, 7, 7 + 10]]])
        for kind, index in ((Row.CHORD, 0), (Row.GAP_UP, 0), (Row.DN_UP, 1)):
            some = LeafRows(*(np.array([x]) for x in (int(kind), index, 0, width, 0)), np.zeros((0, 3)))
            assert legal(q, None, some, cases)[0] == fine, (kind, width)


ILLEGAL = [
    (Row.CN_DOWN, (UNDECIDED, 0, 0)),
    (Row.CN_DOWN, (CLOSED, 0, 0)),
    (Row.GAP_UP, (UNDECIDED, 0, 0)),
    (Row.GAP_UP, (SLIDE, 90, 120)),
    (Row.GAP_DOWN, (OPEN, 10, 20)),
    (Row.GAP_DOWN, (UNDECIDED, 0, 0)),
    (Row.DN_UP, (STICK, 10, 20)),
    (Row.DN_UP, (OPEN, 0, 0)),
    (Row.CHORD, (STICK, 10, 20)),
    (Row.CHORD, (CLOSED, 10, 20)),
    (Row.CHORD, (SLIDE, 90, 120)),
    (Row.C_LEFT, (OPEN, 10, 20)),
    (Row.C_LEFT, (SLIDE, -10, 20)),
    (Row.C_RIGHT, (CLOSED, 0, 0)),
    (Row.C_RIGHT, (SLIDE, 90, 120)),
    (Row.D_LEFT, (UNDECIDED, 0, 0)),
    (Row.D_LEFT, (CLOSED, -10, 20)),
    (Row.D_RIGHT, (OPEN, 90, 120)),
    (Row.STILL_1_UP, (SLIDE, 10, 20)),
    (Row.STILL_1_DOWN, (CLOSED, 10, 20)),
    (Row.STILL_2_UP, (OPEN, 10, 20)),
    (Row.STILL_2_DOWN, (UNDECIDED, 0, 0)),
    (Row.SOFT_TANGENT, (STICK, 10, 20)),
    (Row.SOFT_CHORD, (SLIDE, 8, 0)),
    (Row.C_SIDE, (SLIDE, 8, 0)),
    (Row.D_SIDE, (SLIDE, 8, 0)),
    (Row.TURN_UP, (STICK, 10, 20)),
    (Row.TURN_DOWN, (STICK, 0, 0)),
    (Row.ENERGY, (CLOSED, 0, 0)),
]


@pytest.mark.parametrize(("kind", "state"), ILLEGAL)
def test_rows_of_a_contact_that_do_not_hold(kind, state):
    """a = 0, b = 100, contacts that are no soft fingers, without the dissipation principle for the energy."""
    q = pinch([0, 0, -1, 0, 0, 0], eta=0.1) if kind != Row.ENERGY else pinch([0, 0, -1, 0, 0, 0], mdp=False)
    some = LeafRows(*(np.array([x]) for x in (int(kind), 0, 0, 100, 0)), np.ones((1, 3)))
    assert not legal(q, None, some, np.array([[state, (UNDECIDED, 0, 0)]]))[0]


def driven_question(goal=TORQUES, **more):
    joints = [{"name": n, "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]} for n in ("a", "b", "free", "tendon")]
    actuators = [{"name": n, "joints": {n: 1.0}, "tendon": n == "tendon"} for n in ("a", "b", "free", "tendon")]
    rest = {"joints": joints, "mechanism": {"actuators": actuators}, "preload": {"a": -1.0, "b": 2.0}}
    return pinch([0, 0, -1, 0, 0, 0], goal=goal, **rest, **more)


def test_rows_of_actuators_hold_where_they_may():
    """Of a check a, b are commanded, the free one is locked; of torques a alone is driven, b locked."""
    expected = {
        CHECK: {
            Row.T_UP: "aaaa aaaa aaaa",
            Row.T_DOWN: "--a- aaaa --a-",
            Row.E_UP: "aa-a aa-a aa-a",
            Row.E_DOWN: "---- ---- aa-a",
            Row.S_UP: "---- ---- ----",
        },
        TORQUES: {
            Row.T_UP: "aaaa aaaa aaaa",
            Row.T_DOWN: "-aa- aaaa -aa-",
            Row.E_UP: "---a ---a a--a",
            Row.E_DOWN: "---- ---- ---a",
            Row.S_UP: "---- ---- a---",
        },
    }
    for goal, table in expected.items():
        q = driven_question(goal, **({"driven": ["a"]} if goal == TORQUES else {}))
        for kind, text in table.items():
            for state, word in zip((0, LOCKED, MOVES), text.split(), strict=True):
                cases = np.zeros((1, 6, 3), dtype=np.int64)
                cases[0, 2:, 0] = state
                index = np.arange(4)
                some = LeafRows(np.full(4, int(kind)), index, 0 * index, 0 * index, 0 * index, np.zeros((0, 3)))
                scalar = (0.0, 5.0) if goal == TORQUES else None
                assert "".join("a" if x else "-" for x in legal(q, scalar, some, cases)) == word, (goal, kind, state)


@pytest.mark.parametrize("objective", ["max", "sum"])
def test_rows_of_a_command_on_one_side_hold_there_alone(objective):
    """HIGH: t = 0, f >= T; LOW: t = 0, f <= 0; BELOW: f <= T; ABOVE: f >= 0; of the sum no f >= T."""
    q = driven_question(TORQUES, driven=["a"], objective=objective)
    kinds = Row.T_UP, Row.T_DOWN, Row.E_UP, Row.E_DOWN, Row.S_UP, Row.S_DOWN
    high = "aa---a" if objective == "max" else "aa----"
    expected = {FREE: "a-----", HIGH: high, LOW: "aa-a--", BELOW: "a---a-", ABOVE: "a-a---", MOVES: "a-a-a-"}
    for state, word in expected.items():
        cases = np.zeros((1, 6, 3), dtype=np.int64)
        cases[0, 2:, 0] = state
        none = np.zeros(len(kinds), dtype=np.int64)
        some = LeafRows(np.array(kinds), none, none, none, none, np.zeros((0, 3)))
        assert "".join("a" if x else "-" for x in legal(q, (0.0, 5.0), some, cases)) == word, state
        assert zeros(q, cases)[0, Columns.of(q).q][0] == (state in (HIGH, LOW))


def test_actuators_by_hand():
    """f of a is mirrored: f >= 1; with the scalar: f >= lambda. T - f, and e - f of the sum."""
    at = Columns.of(q := driven_question(CHECK))
    f = at.f.start
    value, right = alone(q, Row.E_UP, 0)
    assert (value[f], right) == (1, 1)
    assert np.abs(value).sum() == 1
    value, right = alone(q, Row.E_DOWN, 1)
    assert (value[f + 1], right) == (-1, -2)
    assert alone(q, Row.T_UP, 2)[0][at.n + 6 + 2] == 1
    assert alone(q, Row.T_DOWN, 2)[0][at.n + 6 + 2] == -1
    q = driven_question(TORQUES, driven=["a"])
    at = Columns.of(q)
    value, right = alone(q, Row.S_UP, 0, scalar=(0.0, 1.0))
    assert (value[at.f.start], value[at.scalar.start], right) == (-1, 1, 0)
    value, right = alone(q, Row.S_DOWN, 0, scalar=(0.0, 1.0))
    assert (value[at.f.start], value[at.scalar.start], right) == (1, -1, 0)
    assert np.abs(value).sum() == 2
    q = driven_question(TORQUES, driven=["a"], objective="sum")
    at = Columns.of(q)
    value, right = alone(q, Row.S_UP, 0, scalar=(0.0, 1.0))
    assert (value[at.f.start], value[at.e.start], value[at.scalar.start]) == (-1, 1, 0)


@pytest.mark.parametrize("index", [0, 1])
def test_each_actuator_has_its_own_force_and_the_scalar_is_of_all(index: int) -> None:
    """a is commanded by -1, mirrored, b by 2: with the scalar f is compared with so many times it."""
    direction, scalar = {"direction": [0, 0, 1, 0, 0, 0]}, (0.0, 1.0)
    preload = replace(driven_question(LARGEST_GOAL, **direction), goal=SMALLEST_PRELOAD)
    command = (1.0, 2.0)[index]
    for q, kind, of_f, of_scalar, of_e in (
        (preload, Row.E_UP, 1, -command, 0),
        (preload, Row.E_DOWN, -1, command, 0),
        (driven_question(TORQUES, driven=["a", "b"]), Row.S_UP, -1, 1, 0),
        (driven_question(TORQUES, driven=["a", "b"]), Row.S_DOWN, 1, -1, 0),
        (driven_question(TORQUES, driven=["a", "b"], objective="sum"), Row.S_UP, -1, 0, 1),
    ):
        at = Columns.of(q)
        value, right = alone(q, kind, index, scalar=scalar)
        wanted = np.zeros(len(value))
        wanted[at.f.start + index], wanted[at.scalar] = of_f, of_scalar
        if of_e:
            wanted[at.e.start + index] = of_e
        assert (value.tolist(), right) == (wanted.tolist(), 0), kind


def test_bounds_by_hand():
    q = driven_question(TORQUES, driven=["a"], objective="sum", torque_limits={"b": 3.0}, force_limit=7.0)
    at, (lo, hi) = Columns.of(q), bounds(q, (0.5, 2.0))
    assert lo[at.c].tolist() == [0, -np.inf, -np.inf] * 2
    assert hi[at.c].tolist() == [7, np.inf, np.inf] * 2
    assert lo[at.f].tolist() == [-np.inf, -3, -np.inf, -np.inf]
    assert hi[at.f].tolist() == [np.inf, 3, np.inf, np.inf]
    assert (lo[at.scalar][0], hi[at.scalar][0]) == (0.5, 2.0)
    assert lo[at.e].tolist() == [0] * 4
    assert hi[at.e].tolist() == [2, np.inf, np.inf, np.inf]
    for part in (at.r, at.q, at.coupling):
        assert np.isinf(lo[part]).all()
        assert np.isinf(hi[part]).all()
    value, right = alone(q, Row.BOUND_DOWN, at.c.start, scalar=(0.5, 2.0))
    assert (value[at.c.start], right) == (-1, -7)
    value, right = alone(q, Row.BOUND_UP, at.scalar.start, scalar=(0.5, 2.0))
    assert (value[at.scalar.start], right) == (1, 0.5)


def test_energy_by_hand():
    """w . r + f_c . t + g . q - 2 x . c_n >= -|x|^2, each rounded to say no more."""
    q = driven_question(CHECK)
    at = Columns.of(q)
    value, right = alone(q, Row.ENERGY, 0, references=[[2.0, 3.0, 0.0]])
    assert value[at.r].tolist() == [0, 0, -1, 0, 0, 0]
    assert not value[at.q].any()
    slip = (1 + q.grasp.mu) * EPS * load_scale(q.grasp, q.wrench)  # (3) may give way by so much
    assert value[at.c][0::3] == pytest.approx(slip - [4, 6], rel=1e-14)
    assert (slip > 0).all()
    assert right == pytest.approx(-13, rel=1e-15)
    assert right < -13
    t = value[at.n + 6 : at.n + 10]
    assert t == pytest.approx([1, 2, 0, 0], rel=1e-15)
    assert (t >= [1, 2, 0, 0]).all()


def test_energy_holds_for_checks_and_for_preloads_that_are_no_larger_than_said():
    none = np.zeros((1, 6, 3), dtype=np.int64)
    direction = {"direction": [0, 0, 1, 0, 0, 0]}

    def fine(q, scalar, top):
        one = np.zeros(1, np.int64)
        return bool(legal(q, scalar, LeafRows(one + 24, one, one, one, one, np.array([[1.0, 1.0, top]])), none)[0])

    assert fine(driven_question(CHECK), None, 0.0)
    assert not fine(driven_question(CHECK, mdp=False), None, 0.0)
    assert not fine(driven_question(LARGEST_GOAL, **direction), (0.0, 1.0), 1.0)
    assert not fine(driven_question(TORQUES, driven=["a"]), (0.0, 1.0), 1.0)
    joints = [{"name": "a", "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]}]
    preload = pinch([0] * 6, goal=SMALLEST_PRELOAD, joints=joints, preload={"a": 1.0}, **direction)
    none = np.zeros((1, 3, 3), dtype=np.int64)
    assert fine(preload, (0.0, 1.0), 1.0)
    assert not fine(preload, (0.0, 1.0), 0.999)
    assert not fine(preload, (0.0, np.inf), 1.0)
    energy, zero = np.full(2, Row.ENERGY), np.zeros(2, np.int64)
    two = LeafRows(energy, np.arange(2), zero, zero, zero, np.array([[1.0, 1.0, 0.999], [1.0, 1.0, 1.0]]))
    assert legal(preload, (0.0, 1.0), two, none).tolist() == [False, True]  # each by its own reference
    locked = pinch([0] * 6, goal=SMALLEST_PRELOAD, joints=[joints[0] | {"friction": 0.1}], **direction)
    none = np.zeros((1, 2 + locked.actuators, 3), dtype=np.int64)
    assert fine(locked, (0.0, np.inf), 0.0)  # friction takes, however large it is
    none = np.zeros((1, 3, 3), dtype=np.int64)
    two = [*joints, joints[0] | {"name": "b"}]  # of which one is commanded
    half = pinch([0] * 6, goal=SMALLEST_PRELOAD, joints=two, preload={"a": 1.0}, **direction)
    none = np.zeros((1, 4, 3), dtype=np.int64)
    assert fine(half, (0.0, 1.0), 1.0)
    assert not fine(half, (0.0, 1.0), 0.999)
    none = np.zeros((1, 3, 3), dtype=np.int64)
    sprung = pinch(
        [0] * 6, goal=SMALLEST_PRELOAD, joints=[joints[0] | {"torque": 0.1}], preload={"a": 1.0}, **direction
    )
    assert not fine(sprung, (0.0, 1.0), 1.0)


def test_kinds_and_indices_that_are_none():
    q = driven_question(CHECK)
    n = Columns.of(q).n
    good = [(Row.CN_UP, 1), (Row.T_UP, 3), (Row.BOUND_UP, n - 1), (Row.ENERGY, 0), (Row.TURN_DOWN, 1), (Row.S_DOWN, 3)]
    bad = [(Row.CN_UP, 2), (Row.T_UP, 4), (Row.BOUND_UP, n), (Row.ENERGY, 1), (Row.TURN_DOWN, 2), (22, 0), (23, 0)]
    bad += [(Row.S_DOWN, 4), (32, 0), (33, 0), (-1, 0), (2**31 - 1, 0), (Row.CN_UP, -1), (Row.ENERGY, -1)]
    for wanted, rows in ((True, good), (False, bad)):
        for kind, index in rows:
            some = LeafRows(*(np.array([x], dtype=np.int64) for x in (kind, index, 0, 0, 0)), np.ones((1, 3)))
            assert known(q, some)[0] == wanted, (kind, index)


def test_directions_turn_by_quarters_exactly():
    k = np.arange(0, TURN_DIRECTIONS, TURN_DIRECTIONS // 4 + 12345)
    U = directions(k)
    assert np.array_equal(directions(k + QUARTER), np.column_stack([-U[:, 1], U[:, 0]]))
    assert np.array_equal(directions(k + HALF_TURN), -U)
    assert np.array_equal(directions(k - TURN_DIRECTIONS), U)
    assert directions(np.array([0]))[0].tolist() == [1, 0]
    assert (
        pytest.approx(
            np.column_stack([np.cos(k * 2 * np.pi / TURN_DIRECTIONS), np.sin(k * 2 * np.pi / TURN_DIRECTIONS)]),
            abs=1e-15,
        )
        == U
    )


def test_unknowns_that_are_zero():
    q = question(
        [contact([0, 0, 1], [0, 0, -1], torsion=0.01), contact([0, 0, -1], [0, 0, 1])],
        [0, 0, 0, 0, 0, 1],
        joints=[{"name": n, "axis": [1, 0, 0], "origin": [0, 1, 0], "moves": [0]} for n in "abc"],
        mechanism={"actuators": [{"name": "a", "joints": {"a": 2.0}}, {"name": "b", "joints": {"b": 1.0, "c": 1.0}}]},
        preload={"a": 1.0},
    )
    at = Columns.of(q)
    cases = np.zeros((3, 4, 3), dtype=np.int64)
    cases[1, 0, 0], cases[2, 2, 0] = OPEN, LOCKED
    wanted = [[], [*range(at.c.start, at.c.start + 3), at.twist.start], [at.q.start]]
    assert [np.flatnonzero(row).tolist() for row in zeros(q, cases)] == wanted


def test_rows_that_are_the_same_stand_once() -> None:
    rng = np.random.default_rng(3)
    table = rng.choice([-(2**31), -1, 0, 1, 7, 2**31 - 1], size=(4, 3000))
    kind, index = np.abs(table[0]) % 31, np.abs(table[1]) % 5
    rows = LeafRows(kind, index, table[2], table[3], np.arange(3000), np.zeros((0, 2)))
    once, which = different(rows)
    every = set(zip(kind.tolist(), index.tolist(), *table[2:].tolist(), strict=True))
    assert len(once.kind) == len(once.leaf) == len(every)
    for name in ("kind", "index", "a", "b"):
        assert (getattr(once, name)[which] == getattr(rows, name)).all()


def letters(found: np.ndarray) -> str:
    return "".join("a" if x else "-" for x in found)


def test_rows_of_contacts_that_are_equalities() -> None:
    """What does not move does neither way; the gap of a closed contact is closed, where normals are certain."""
    fixed = {Row.STILL_1_UP, Row.STILL_1_DOWN, Row.STILL_2_UP, Row.STILL_2_DOWN, Row.TURN_UP, Row.TURN_DOWN}
    some, none = np.array([k for k in Row if OF_CONTACT[k]]), np.zeros(sum(OF_CONTACT), dtype=np.int64)
    for eta in (0.0, 0.1):
        q = pinch([0, 0, -1, 0, 0, 0], eta=eta)
        for state in (UNDECIDED, OPEN, CLOSED, STICK, SLIDE):
            rows = LeafRows(some, none + 1, none, none, none, np.zeros((0, 3)))
            found = equalities(q, rows, np.array([[[CLOSED - 1, 0, 0], [state, 0, 0]]]))  # of contact 1
            closed = {Row.GAP_UP, Row.GAP_DOWN} if eta == 0 and state >= CLOSED else set()
            assert {Row(k) for k in some[found]} == fixed | closed, (eta, state)


def test_rows_of_actuators_that_are_equalities() -> None:
    """Of a check a, b are commanded, the free one is locked; of torques a alone is driven, b locked."""
    still, moving = "aaaa", {CHECK: "--a-", TORQUES: "-aa-"}
    for goal, driven in ((CHECK, "aaaa"), (TORQUES, "-aaa")):
        q, index = driven_question(goal, **({"driven": ["a"]} if goal == TORQUES else {})), np.arange(4)
        for state in (FREE, LOCKED, MOVES, HIGH, LOW, BELOW, ABOVE):
            cases = np.zeros((2, 6, 3), dtype=np.int64)
            cases[1, 2:, 0] = state
            for kind in (k for k in Row if OF_ACTUATOR[k]):
                rows = LeafRows(np.full(4, int(kind)), index, 0 * index, 0 * index, 0 * index + 1, np.zeros((0, 3)))
                wanted = "----"
                if kind in (Row.T_UP, Row.T_DOWN):
                    wanted = still if state in (LOCKED, HIGH, LOW) else moving[goal]
                elif kind in (Row.E_UP, Row.E_DOWN) and state == MOVES:
                    wanted = driven
                assert letters(equalities(q, rows, cases)) == wanted, (goal, state, kind)
    index = np.arange(Columns.of(q).n)
    for kind in (Row.BOUND_UP, Row.BOUND_DOWN):
        rows = LeafRows(0 * index + kind, index, 0 * index, 0 * index, 0 * index, np.zeros((0, 3)))
        assert not equalities(q, rows, cases).any()


def test_a_step_begins_with_gaps_and_slack() -> None:
    """Contact 0 is 0.5 away, contact 1 at its place; the tendon that nobody commands has slack 0.25."""
    q = driven_question(CHECK, eta=np.arccos(0.8))
    start = StartData(np.array([0.5, 0.0]), np.zeros(q.grasp.l), np.array([0, 0, 0, 0.25]))
    step = replace(q, grasp=q.grasp.with_start(start))
    at, tendon = Columns.of(step), list(step.grasp.actuators).index("tendon")
    for kind, right in ((Row.GAP_UP, -0.5), (Row.DN_UP, -0.5), (Row.GAP_DOWN, 0.5), (Row.CN_UP, 0.0)):
        assert alone(step, kind, 0)[1] == right
        assert alone(step, kind, 1)[1] == 0
    for kind, right in ((Row.T_UP, -0.25), (Row.T_DOWN, 0.25)):
        assert alone(step, kind, tendon)[1] == right
        assert alone(step, kind, 0)[1] == 0
    # a spring takes c_n^2 + gap c_n, over cos(eta) = 0.8
    plain, sprung = (alone(x, Row.ENERGY, references=[[2.0, 3.0, 0.0]])[0][at.c][0::3] for x in (q, step))
    np.testing.assert_allclose(sprung - plain, [-0.625, 0.0], atol=1e-12)
    assert (sprung - plain >= [-0.625, 0.0]).all()
    cases = np.zeros((1, 6, 3), dtype=np.int64)
    cases[0, 2:, 0] = LOCKED
    locked = zeros(q, cases)[0, at.q]
    assert letters(locked) == "aaaa"
    assert letters(zeros(step, cases)[0, at.q]) == "aaa-"  # t = -slack


def beside_a_soft_finger(other: float = 0.0) -> Question:
    """Contact 0 is a point or a soft finger, contact 1 a soft finger; mu 0.5."""
    places = [contact([0, 0, 1], [0, 0, -1], torsion=other), contact([0, 0, -1], [0, 0, 1], torsion=0.01)]
    joints = [{"name": n, "axis": [1, 0, 0], "origin": [0, 1, 0], "moves": [0]} for n in "ab"]
    return question(places, [0, 0, 0, 0, 0, 1], joints=joints, preload={"a": 1.0})


def test_rows_of_soft_fingers_hold_where_they_may() -> None:
    """Of patch 9, which is made of 18 and 19; the point contact has none."""
    about = [(Row.SOFT_TANGENT, 5, 7), (Row.SOFT_CHORD, 9, 0), (Row.SOFT_CHORD, 10, 0), (Row.SOFT_CHORD, 18, 0)]
    about += [(kind, 9, b) for kind in (Row.C_SIDE, Row.D_SIDE) for b in (-1, 0, 2, 3)]
    about += [(Row.TURN_UP, 0, 0), (Row.TURN_DOWN, 0, 0)]
    kind, a, b = np.array(about, dtype=np.int64).T
    expected = {
        (UNDECIDED, 0, 0): "a--- ---- ---- --",
        (OPEN, 0, 0): "a--- ---- ---- --",
        (CLOSED, 9, 0): "a--- ---- ---- --",
        (STICK, 0, 0): "a--- ---- ---- aa",
        (SLIDE, 9, 0): "aa-- -aa- -aa- --",
        (SLIDE, 18, 0): "aa-a -aa- -aa- --",
        (SLIDE, 8, 0): "a--- ---- ---- --",
    }
    q = beside_a_soft_finger()
    for state, word in expected.items():
        cases = np.zeros((1, 2 + q.actuators, 3), dtype=np.int64)
        cases[0, :2] = state
        for index in (0, 1):
            rows = LeafRows(kind, 0 * kind + index, a, b, 0 * kind, np.zeros((0, 3)))
            wanted = word.replace(" ", "") if index else "-" * len(kind)
            assert letters(legal(q, None, rows, cases)) == wanted, (state, index)


@pytest.mark.parametrize("before", [0, 1])
def test_coefficients_of_a_soft_finger_by_hand(before: int) -> None:
    """Patch 8 is the octant of x, y, z > 0: middle (1, 1, 1) / sqrt(3), its sides are across z, x and y."""
    q = beside_a_soft_finger(0.01 * before)
    at, h = Columns.of(q), 1 / np.sqrt(3)
    force = [at.c.start + 3, at.c.start + 4, at.c.start + 5, at.twist.start + before]
    motion = [at.n + 4, at.n + 5, at.n + 6 + q.actuators + 1 + before]
    gives = CONE_WIDENING
    expected = [
        (Row.SOFT_TANGENT, 0, 0, [0.5 * (1 + gives), -1, 0, 0], [0, 0, 0]),
        (Row.SOFT_TANGENT, QUARTER, 0, [0.5 * (1 + gives), 0, -1, 0], [0, 0, 0]),
        (Row.SOFT_TANGENT, QUARTER, QUARTER, [0.5 * (1 + gives), 0, 0, -1], [0, 0, 0]),
        (Row.SOFT_TANGENT, 0, HALF_TURN, [0.5 * (1 + gives), 1, 0, 0], [0, 0, 0]),
        (Row.SOFT_CHORD, 8, 0, [-0.5 * (h - gives), h, h, h], [0, 0, 0]),
        (Row.C_SIDE, 8, 0, [0.5 * gives, 0, 0, 1], [0, 0, 0]),
        (Row.C_SIDE, 8, 2, [0.5 * gives, 0, 1, 0], [0, 0, 0]),
        (Row.D_SIDE, 8, 0, [0, 0, 0, 0], [0, 0, -1]),
        (Row.D_SIDE, 8, 1, [0, 0, 0, 0], [-1, 0, 0]),
        (Row.D_SIDE, 8, 2, [0, 0, 0, 0], [0, -1, 0]),
        (Row.TURN_UP, 0, 0, [0, 0, 0, 0], [0, 0, 1]),
        (Row.TURN_DOWN, 0, 0, [0, 0, 0, 0], [0, 0, -1]),
    ]
    for kind, a, b, of_force, of_motion in expected:
        value, right = alone(q, kind, 1, a, b)
        wanted = np.zeros(len(value))
        wanted[force], wanted[motion] = of_force, of_motion
        np.testing.assert_allclose(value, wanted, rtol=1e-14, atol=1e-15, err_msg=kind.name)
        assert right == 0
    kinds, left, side = (np.array([row[k] for row in expected], dtype=np.int64) for k in range(3))
    one = np.ones(len(expected), dtype=np.int64)
    every = row_values(q, None, LeafRows(kinds, one, left, side, one, np.zeros((0, 3))))[0]
    np.testing.assert_array_equal(every, [alone(q, k, 1, i, j)[0] for k, i, j, *_ in expected])  # each its own


@pytest.mark.parametrize("turned", [0, TURN_DIRECTIONS])
def test_rows_of_a_contact_hold_where_they_may(turned: int) -> None:
    """a = 0, b = 100. Of sectors within these, that begin before them, and that end behind them."""
    kinds = np.arange(int(Row.STILL_2_DOWN) + 1)
    expected = {  # C_N up and down, gap up and down, d_n; tangent and chord; sides of c_t and d_t; what is still
        (UNDECIDED, 0, 0): "a---- a- ---- ----",
        (OPEN, 0, 0): "aa--- a- ---- ----",
        (OPEN, 10, 20): "aaa-a a- --aa ----",
        (CLOSED, 0, 0): "a--a- a- ---- ----",
        (CLOSED, 10, 20): "a-aa- a- aaaa ----",
        (STICK, 0, 0): "a-aa- a- --aa aaaa",
        (STICK, 10, 20): "a-aa- a- aaaa aaaa",
        (SLIDE, 10, 20): "a-aa- aa aaaa ----",
        (SLIDE, 0, 100): "a-aa- aa aaaa ----",
        (SLIDE, -1, 100): "a--a- a- -a-a ----",
        (SLIDE, 0, 101): "a--a- a- a-a- ----",
    }
    for eta, certain in ((0.1, False), (0.0, True)):
        q = pinch([0, 0, -1, 0, 0, 0], eta=eta)
        for (state, left, right), word in expected.items():
            cases = np.array([[[UNDECIDED, 0, 0], [state, left + turned, right + turned]]])
            zero = 0 * kinds
            rows = LeafRows(kinds, zero + 1, zero, zero + 100, zero, np.zeros((0, 3)))
            wanted = list(word.replace(" ", ""))
            if certain:  # g is not needed
                wanted[Row.GAP_UP] = "a"
                wanted[Row.DN_UP] = "a" if state == OPEN else "-"
            assert letters(legal(q, None, rows, cases)) == "".join(wanted), (state, left, eta)


def test_bounds_hold_where_there_are_some() -> None:
    q = driven_question(TORQUES, driven=["a"], objective="sum", torque_limits={"b": 3.0}, force_limit=7.0)
    cases, scalar = np.zeros((1, q.grasp.m + q.actuators, 3), dtype=np.int64), (0.5, 2.0)
    index = np.arange(Columns.of(q).n)
    for kind, bound in zip((Row.BOUND_UP, Row.BOUND_DOWN), bounds(q, scalar), strict=True):
        rows = LeafRows(0 * index + kind, index, 0 * index, 0 * index, 0 * index, np.zeros((0, 3)))
        assert legal(q, scalar, rows, cases).tolist() == np.isfinite(bound).tolist()


def test_given_torques_work_in_the_balance_of_energy() -> None:
    """If there are any; the work of all of them is one motion."""
    joints = [{"name": n, "axis": [0, 0, 1], "origin": [0, 1, 0], "moves": [0]} for n in "ab"]
    for torque in (0.0, 0.5):
        q = pinch([0, 0, -4, 0, 0, 0], joints=[joints[0], joints[1] | {"torque": torque}], preload={"a": 1.0})
        at = Columns.of(q)
        value, _ = alone(q, Row.ENERGY, references=[[0.0, 0.0, 0.0]])
        assert value[at.n + 6 + q.actuators] == (torque != 0)
        assert value[at.c.start] == pytest.approx(4 * EPS * 1.5, rel=1e-5)  # of 4 N, motion and friction may be missed


def test_rows_together_say_what_each_says_alone() -> None:
    q = driven_question(CHECK, eta=0.1, torque_limits={"b": 3.0})
    kinds = [k for k in Row if k <= Row.ENERGY and k != Row.S_UP]
    rng = np.random.default_rng(2)
    kind, index = rng.permutation(2 * kinds), rng.integers(0, 2, 2 * len(kinds))
    a, b = rng.integers(0, QUARTER, (2, len(kind)))
    references = np.ones((2, 3)) * [[1.0], [2.0]]
    value, right = row_values(q, None, LeafRows(kind, index, a, b, 0 * kind, references))
    for k, about in enumerate(zip(kind, index, a, b, strict=True)):
        one, its = alone(q, *about, references=references)
        assert (value[k].tolist(), right[k]) == (one.tolist(), its)
