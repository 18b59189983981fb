"""Rows about the commands of a path: what each says of any unknowns, written down anew from the maps of the grasp."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq

from handfast.core.arrays import Array
from handfast.proofs import path_commands
from handfast.proofs.fields import BadFile, Fields, rational
from handfast.proofs.kinds import CONE_WIDENING
from handfast.proofs.path_commands import (
    CLOSED,
    LOCKED,
    MAX_PATH_LEAVES,
    MOVED,
    OPEN,
    STATE_REACH,
    PathBound,
    PathCommands,
    PathLeaf,
    PathRow,
    leaf_bound,
    read_bound,
    read_sought,
)
from handfast.proofs.question import read_question
from handfast.proofs.states import State
from handfast.proofs.tolerance import MIN_FORCE_SCALE, drives
from tests.support.refused import refused
from tests.support.small_grasp import small_grasp

LOAD = np.array([1.0, 2, 3, 4, 5, 6])


def small(sums: bool, more: bool = False) -> PathCommands:
    """Of pull, a tendon, and push, in its negative sense; "back" carries 1/2.

    more: the other contact is a soft finger, too, that joints move along its normal; also 2 turn = 8 roll.
    """
    grasp = small_grasp() | {"preload": {"push": -0.75, "pull": 3, "back": 0.5}}
    if more:
        grasp["contacts"][1] |= {"torsion": 0.375, "normal": [0, 1, 0]}
        grasp["mechanism"]["couplings"].append({"turn": 2, "roll": -8})
    asked = {"goal": "check", "wrench": LOAD.tolist(), "force_limit": 8, "torque_limits": {"push": 2}}
    return PathCommands(read_question({"grasp": grasp} | asked, "q"), np.array([1.0, -1, 0]), sums)


def said(row: PathRow, z: Array) -> float:
    """By how much more than its right side."""
    return float(sum(int(v.p) / int(v.q) * z[k] for k, v in row.terms.items()) - int(row.right.p) / int(row.right.q))


def parts(of: PathCommands, z: Array, x: int) -> tuple[Array, ...]:
    """Of state x: the motion (r, q), forces of `GraspData.rows`, and motions of these."""
    g = of.question.grasp
    own = z[of.at(x, 0) : of.at(x + 1, 0)]
    v, phi = own[: 6 + g.l], np.append(own[6 + g.l :], 0.0)
    return v, phi, g.rows[0] @ v


def of_state(of: PathCommands, z: Array, x: int) -> list[tuple[float, bool]]:
    """All rows of a state, and which are equalities, in their order."""
    g = of.question.grasp
    v, phi, d = parts(of, z, x)
    actuators, joints = g.parts[2], g.parts[4]
    given = phi.copy()
    given[actuators.start + 2] = 0.5  # backdrivable
    share = z[of.share(x)] if x else 1.0
    missed = g.rows[0].T @ given + np.r_[share * LOAD, g.torque]
    q, f, reaction = v[6:], phi[actuators], phi[joints]
    tied = [3 * q[1] - q[2], 2 * q[0] - 8 * q[2]][: len(g.A)]
    out = [(y, True) for y in [*missed[:6], *-missed[6:], *tied]]
    for i in range(2):
        c = phi[3 * i : 3 * i + 3]
        gap = d[3 * i] + c[0]
        twist = phi[6 + np.flatnonzero(g.soft == i)]
        out += [(c[0], False), (gap, False), *((y, True) for y in [*c, *twist]), (gap, True), (8 - c[0], False)]
    laws = [reaction[0] + 0.25, 0.25 - reaction[0], reaction[1], -reaction[1], -q[2], -reaction[2]]
    pulled = 2 * q[0] - q[1], f[0]
    return out + [(y, False) for y in [*laws, *pulled, f[1] + 2, 2 - f[1]]]


def of_commands(of: PathCommands, z: Array) -> list[tuple[float, bool]]:
    motors = of.question.grasp.parts[2]
    (f0, m0), (f1, m1), (f2, m2) = ((p[1][motors], p[2][motors]) for p in (parts(of, z, x) for x in range(3)))
    cost = [z[of.effort(k)] if of.sums else z[of.measure] for k in (1, 2)]
    share = z[of.share(1)], z[of.share(2)]
    out = [(m1[0] - m0[0], True)]  # the tendon closed as far as at the end; where it moves, forces are no less
    out += [(y, False) for y in (f0[0] - f1[0], f2[0] - f1[0], m0[0] - m2[0], f1[0], cost[0] - f1[0])]
    out += [(share[0], False), (1 - share[0], False), (m0[1] - m2[1], True)]
    for f, m in ((f0, m0), (f1, m1), (f2, m2)):
        out += [(-m[1], False), (-m[1], True)]
        if f is not f2:
            out.append((f2[1] - f[1], False))
        if f is f1:
            out.append((m1[1] - m0[1], False))
    out += [(y, False) for y in (-f2[1], cost[1] + f2[1], share[1], 1 - share[1])]
    if of.sums:
        out += [(z[of.measure] - cost[0] - cost[1], True), (cost[0], False), (cost[1], False)]
    return [*out, (z[of.measure], False)]


@pytest.mark.parametrize("more", [False, True])
@pytest.mark.parametrize("sums", [False, True])
def test_what_every_row_says_of_any_unknowns(sums: bool, more: bool) -> None:
    of = small(sums, more)
    z = np.random.default_rng(0).integers(-8, 9, of.n).astype(float)
    rows = of.rows
    wanted = [*(row for x in range(3) for row in of_state(of, z, x)), *of_commands(of, z)]
    assert [row.equal for row in rows] == [equal for _, equal in wanted]
    np.testing.assert_allclose([said(row, z) for row in rows], [y for y, _ in wanted], rtol=1e-14, atol=1e-13)
    held = [row.condition for row in rows if row.condition]
    contacts = [(x * 2 + i, OPEN) for x in range(3) for i in (0, 1) for _ in range(4 - i * (not more))]
    assert [c for c in held if c[0] < 6 and c[1] == OPEN] == contacts
    assert [c for c in held if c[0] < 6 and c[1] == CLOSED] == [(k, CLOSED) for k in range(6)]
    assert [c for c in held if c[0] >= 6] == [(6, MOVED)] * 5 + [
        *((7, c) for c in (LOCKED, MOVED, LOCKED, MOVED, MOVED, LOCKED, MOVED, MOVED))
    ]


@pytest.mark.parametrize("more", [False, True])
def test_what_a_tangent_says(more: bool) -> None:
    """Friction (-0.6, 0.8) 5 and 2 of torsion, times 12 over the lever, along (3, 4, 12): 13 mu c_n and no more.

    Nor less, by which rounding of a length would make it say too much.
    """
    of = small(False, more)
    for x, i in ((0, 0), (1, 0), (2, 1)):
        z = np.zeros(of.n)
        z[of.at(x, 2, 3 * i) : of.at(x, 2, 3 * i) + 3] = 8.0, -3.0, 4.0
        z[of.at(x, 3)], z[of.at(x, 3, i * more)] = 5.0, 2.0
        soft = i == 0 or more
        row = of.tangent(x, i, np.array([3.0, 4, 12] if soft else [3.0, 4]))
        wanted = (0.5, 0.75)[i] * (13 if soft else 5) * 8 - 7 - 24 * soft
        assert not row.equal
        assert wanted < said(row, z) < wanted + 1e-9


def test_by_how_much_rows_may_be_missed() -> None:
    """1e-5 of the load, times twice the size of the contacts in torques, and the units of joints; springs, too.

    The load's force is sqrt 14 N, its torque about the contacts' middle (4, 5, 6) - (1/4, -1/8, 1/8) x (1, 2, 3).
    """
    of, size = small(False, True), np.sqrt(3 / 32)
    scale = np.linalg.norm(np.array([4, 5, 6]) - np.cross([0.25, -0.125, 0.125], [1, 2, 3])) / size
    assert of.scale == pytest.approx(scale, rel=1e-14)
    some = 1e-5 * scale
    state = [some] * 3 + [2 * size * some] * 3 + [size * some, some, size * some] + [0.0] * 2  # turns, slides, turns
    state += [0.0, some, *[0.0] * 4, some, 0.0] * 2  # c_n, gap; open; closed; the limit
    assert [row.slack for row in of.rows[: len(state)]] == pytest.approx(state, rel=1e-12)
    assert sum(row.slack for row in of.rows) == pytest.approx(3 * sum(state), rel=1e-12)


LAWS = {  # of a joint with friction 1/4 [N m]: rows (motion, reaction, right side, is it an equality?)
    "": [(0, 1, -0.25, False), (0, -1, -0.25, False)],
    "lower": [(1, 0, 0, False), (0, 1, -0.25, False)],
    "upper": [(-1, 0, 0, False), (0, -1, -0.25, False)],
    "both": [(1, 0, 0, True)],
}


@pytest.mark.parametrize("stop", LAWS)
def test_what_rows_say_of_a_stop(stop: str) -> None:
    of = small(False)
    stops = np.array([("", "lower", "upper", "both").index(stop), 0, 0])
    of = replace(of, question=replace(of.question, grasp=replace(of.question.grasp, stop=stops)))
    columns = of.at(1, 1), of.at(1, 6)
    rows = [
        (*(int(row.terms.get(c, 0)) for c in columns), float(row.right.p) / float(row.right.q), row.equal)
        for row in of._of_joint(1, 0)
    ]
    assert sorted(rows) == sorted((q, r, right, equal) for q, r, right, equal in LAWS[stop])


def test_what_comes_after_a_backdrivable_motor_has_its_rows() -> None:
    """Of "push" here: its limit on both sides, and that it stands still where nobody seeks its command."""
    grasp = small_grasp() | {"preload": {}}
    grasp["mechanism"]["actuators"].reverse()  # back, push, pull
    asked = {"goal": "check", "wrench": LOAD.tolist(), "torque_limits": {"push": 2}}
    of = PathCommands(read_question({"grasp": grasp} | asked, "q"), np.zeros(3), False)
    effort, tendon, roll = of.at(0, 4, 1), of.at(0, 4, 2), of.at(0, 1, 2)
    own = [({int(c): float(v.p) / float(v.q) for c, v in row.terms.items()}, row.equal) for row in of.rows]
    assert own.count(({effort: 1.0}, False)) == own.count(({effort: -1.0}, False)) == 1
    assert ({roll: 0.5}, True) in own
    assert [row.right for row in of.rows if row.terms == {roll: fmpq(1, 2)}] == [0]
    assert ({tendon: 1.0}, False) in own
    assert (of.cost(np.ones(3)), len(of.units), of.units[-1]) == (0, of.n, 0)  # of no command at all


@pytest.mark.parametrize(("sums", "more"), [(False, False), (True, False), (False, True)])
def test_what_counts_as_much_as_a_force_of_one_newton(sums: bool, more: bool) -> None:
    """By hand: contacts sqrt(3/32) from their middle, which is as far from the origin; joints sqrt(5/16), with the soft
    finger's turning, sqrt 2 and sqrt(1/8).

    While "pull" is held, turn by 1 moves slide by 2. The couplings move slide with roll, by a third, and turn by 4 with
    both. What is passed on so far counts for forces: of "push" half of roll, of "back" 4 times as much.
    """
    of, size = small(sums, more), np.sqrt(3 / 32)
    joints = np.array([np.sqrt(5 / 16), np.sqrt(2), np.sqrt(1 / 8)])
    together = np.sqrt(1 + 1 / 9 + 4 + 1 / 16 + 1 / 144) if more else np.sqrt(1 / 9 + 1 / 16 + 1 / 144)  # for roll by 1
    far = np.array([2 * np.sqrt(2), 3 * together if more else np.sqrt(2), together])
    tied = [max(far[1] / 3, far[2]), far[0] / 2][: 1 + more]
    motors = np.array([np.sqrt(2), 2 * together, together / 4])
    state = [*[2.0] * 3, *[1 / size] * 3, *1 / joints, *[1.0] * (7 + more), *motors, *tied, *far]
    sought = motors[:2]
    wanted = [*state * 3, 1, 1, *sought, sought.sum() if sums else sought.max()]
    np.testing.assert_allclose(of.units, wanted, rtol=1e-14)
    n = len(wanted)
    assert (of.n, of.measure, of.parts, of.cost(np.array([3.0, -4, 9]))) == (n, n - 1, 8, 7.0 if sums else 4.0)
    assert of.words == f"+pull, -push ({'sum' if sums else 'max'})"


ROWS = [  # of the measure and an unknown x that is a force: 2 m - x >= 0, x >= 3 or missed by 1/2, x <= 1, m <= 4
    PathRow({73: fmpq(2), 9: fmpq(-1)}, fmpq(0), False),
    PathRow({9: fmpq(1)}, fmpq(3), False, None, 0.5),
    PathRow({9: fmpq(-1)}, fmpq(-1), True),
    PathRow({73: fmpq(-1)}, fmpq(-4), False),
]


@pytest.mark.parametrize(
    ("multipliers", "bound"),
    [
        ([1, 1, 0, 0], 1.25),
        ([4, 4, 0, 0], 1.25),
        ([0, 1, 1, 0], np.inf),  # 3 - 1/2 > 1
        ([0, 0, 0, 1], 0),  # of the measure from above
        ([0, 2, 2, 0.25], 0),  # 6 - 2 - 1 - 1 of less than none of it
        ([1, 3, 2, 0], 2.75),  # (9 - 2 - 3/2) / 2
        ([1, 1, 1, 0], 0),  # x is left over, with a reach of a million times the load
        ([1, 0, 0, 0], 0),
        ([1, 1e305, 0, 0], 0),  # more than floats hold
        ([0.25, 0.25, 0, 0.5], np.inf),  # 3/4 - 2 - 1/8 is below 0: nothing
    ],
)
def test_what_multipliers_show_by_hand(multipliers: list[float], bound: float) -> None:
    of = small(False)
    found = of.shown(ROWS, multipliers)
    wanted = 0.0 if multipliers[3] == 0.5 else bound
    assert found == pytest.approx(wanted, rel=1e-9)
    assert found <= wanted


def test_a_bound_is_not_rounded_up() -> None:
    of = small(False)
    assert of.shown([PathRow({of.measure: fmpq(1)}, fmpq(3), False)], [1.0]) < 3
    assert of.shown([PathRow({of.measure: fmpq(3)}, fmpq(1), False)], [1.0]) < 1 / 3


def test_what_is_left_over_counts_by_its_unit() -> None:
    """m - x / 10^9 >= 3, where x is a motion of "turn", of which sqrt(16/5) is as much as 1 N: times a million."""
    of = small(False)
    row = PathRow({of.measure: fmpq(1), of.at(0, 1): fmpq(-1, 10**9)}, fmpq(3), False)
    assert of.shown([row], [1.0]) == pytest.approx(3 - np.sqrt(16 / 5) * 1e-9 * of.reach, rel=1e-9)


def test_a_bound_reaches_far_beyond_all_that_acts() -> None:
    """The load, what commands, limits and given torques press with, and torques of joints that move no contact."""
    of = small(False)
    most = 0.5 * 24 / np.sqrt(5 / 16)  # [N] of the backdrivable motor's 0.5 N m, where the tendon turns "turn"
    assert drives(of.question) == pytest.approx(most)
    assert of.reach == of.scale * STATE_REACH
    assert of.scale > most
    heavy = replace(of, question=replace(of.question, wrench=2 * of.question.wrench))
    assert heavy.reach == STATE_REACH * heavy.scale
    light = replace(of, question=replace(of.question, wrench=1e-3 * of.question.wrench))
    assert light.reach == pytest.approx(most * STATE_REACH)
    idle = replace(light.question.grasp, moves=light.question.grasp.moves & False, torque=np.array([0.0, 7e3, 0]))
    far = replace(light, question=replace(light.question, grasp=idle))
    assert far.reach == pytest.approx(7e3 * STATE_REACH)


def test_how_far_states_go_in_units() -> None:
    """Motions of all together, forces of each: an actuator's and a joint's over their arms."""
    of = small(False)
    none = np.zeros
    state = State(none(6), none(3), none(6), none(3), none(1), none(3), none(2))
    arm, unit = of.units[of.at(0, 4, 1)], of.units[of.at(0, 1)]
    for more, size in (
        ({}, 0.0),
        ({"q": np.array([3.0, 0, 0])}, 6 / unit),
        ({"c": np.array([0, 0, -5.0, 0, 0, 0])}, 5.0),
        ({"f": np.array([0, 2.0, 0])}, 2 / arm),
        ({"coupling": np.array([2.0])}, 2 / of.units[of.at(0, 5)]),
        ({"reaction": np.array([0, 0, 4.0])}, 4 / of.units[of.at(0, 6, 2)]),
    ):
        x = replace(state, **more)
        assert of.size_of([x, replace(x, q=-x.q)]) == pytest.approx(size)


@pytest.mark.parametrize(("y", "terms", "slack"), [(1e-300, True, 0.0), (1e-300, False, 2e-30), (5e-324, True, 0.0)])
def test_multipliers_of_any_size_prove_nothing_more(y: float, terms: bool, slack: float) -> None:
    """0 >= 1e-30 but for a motion that is left over, or what may be missed: both are more, and 0 in floats."""
    of = small(False)
    of = replace(of, question=replace(of.question, wrench=1e-30 * of.question.wrench))
    row = PathRow({of.at(0, 1): fmpq(1)} if terms else {}, fmpq(1, 10**30), False, slack=slack)
    assert [of.shown([row], [x]) for x in (y, 1.0)] == [0, 0]
    assert of.shown([PathRow({}, fmpq(1, 10**30), False, slack=5e-31)], [y]) == np.inf


def test_rows_and_tangents_that_a_leaf_may_have() -> None:
    of = small(False)
    every = of.rows
    held = next(k for k, row in enumerate(every) if row.condition == (1, CLOSED))
    free = next(k for k, row in enumerate(every) if row.condition is None and not row.equal)
    last = len(every) - 1
    case = {0: OPEN, 1: CLOSED}
    for rows, tangents in (
        (((last, 1.0), (0, -1.0), (held, -1.0), (free, 0.0)), ()),  # equalities have any sign
        ((), ((0, 0, (1.0, 0, 0), 1.0), (2, 1, (1.0, 0), 0.0))),
    ):
        assert leaf_bound(of, every, case, PathLeaf(rows, tangents)) == 0
    tangent = "has a tangent of no contact, or with a negative multiplier"
    for rows, tangents, problem in (
        (((len(every), 1.0),), (), f"has row {len(every)}; there are {len(every)}"),
        (((-1, 1.0),), (), f"has row -1; there are {len(every)}"),
        (((held - 1, 1.0),), (), f"row {held - 1} does not hold in its case"),  # of the open contact
        (((free, -1e-300),), (), f"row {free} has a negative multiplier"),
        ((), ((-1, 0, (1.0, 0, 0), 1.0),), tangent),
        ((), ((3, 0, (1.0, 0, 0), 1.0),), tangent),
        ((), ((0, -1, (1.0, 0, 0), 1.0),), tangent),
        ((), ((0, 2, (1.0, 0), 1.0),), tangent),
        ((), ((0, 0, (1.0, 0), 1.0),), tangent),
        ((), ((0, 1, (1.0, 0, 0), 1.0),), tangent),
        ((), ((0, 0, (1.0, 0, 0), -1.0),), tangent),
    ):
        with refused(problem, "there"):
            leaf_bound(of, every, case, PathLeaf(rows, tangents), "there")


NOTHING, TREE = PathLeaf((), ()), ("parent", "part", "case")


@pytest.mark.parametrize(
    ("parent", "part", "case", "problem", "field"),
    [
        ((0,), (0,), (0,), "begins with no root", "bound.parent"),
        ((-1, -1, 0), (0, 0, 0), (0, 0, 1), "node 1 is no case of an earlier one", "bound"),
        ((-1, 1, 0), (0, 0, 0), (0, 0, 1), "node 1 is no case of an earlier one", "bound"),
        ((-1, 0, 0), (0, -1, -1), (0, 0, 1), "node 1 is no case of an earlier one", "bound"),
        ((-1, 0, 0), (0, 8, 8), (0, 0, 1), "node 1 is no case of an earlier one", "bound"),
        ((-1, 0, 0), (0, 0, 0), (0, 0, 2), "node 2 is no case of an earlier one", "bound"),
        ((-1, 0, 0, 1, 1), (0, 7, 7, 7, 7), (0, 0, 1, 0, 1), "node 3 is no case of an earlier one", "bound"),
        ((-1, 0, 0), (0, 0, 1), (0, 0, 1), "node 0 does not have both cases of one part", "bound"),
        ((-1, 0, 0), (0, 0, 0), (0, 1, 1), "node 0 does not have both cases of one part", "bound"),
        ((-1, 0), (0, 0), (0, 0), "node 0 does not have both cases of one part", "bound"),
        ((-1, 0, 0, 0), (0, 0, 0, 0), (0, 0, 1, 1), "node 0 does not have both cases of one part", "bound"),
    ],
)
def test_trees_that_leave_out_a_case(parent, part, case, problem: str, field: str) -> None:
    for leaves in (1, 2, 3):
        with refused(problem, field):
            PathBound(parent, part, case, (NOTHING,) * leaves).lower(small(False))


def test_a_tree_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its nodes decide 1, 1, 2 and 2 parts."""
    bound = PathBound((-1, 0, 0, 2, 2), (0, 7, 7, 6, 6), (0, 1, 0, 0, 1), (NOTHING,) * 3)
    monkeypatch.setattr(path_commands, "MAX_PATH_CASES", 6)
    assert bound.lower(small(False)) == 0
    monkeypatch.setattr(path_commands, "MAX_PATH_CASES", 5)
    with refused("decides more than 5 parts in all", "bound"):
        bound.lower(small(False))


def test_a_bound_is_of_a_load_and_has_all_leaves_of_its_tree() -> None:
    of = small(False)
    bound = PathBound((-1, 0, 0), (0, 7, 7), (0, 1, 0), (NOTHING, NOTHING))
    assert bound.lower(of) == 0
    with refused("has 1 leaves; its tree has 2", "bound"):
        replace(bound, leaves=(NOTHING,)).lower(of)
    with refused("has row 999; there are 128", "bound.leaves[1]"):
        replace(bound, leaves=(NOTHING, PathLeaf(((999, 1.0),), ()))).lower(of)
    unloaded = replace(of, question=replace(of.question, wrench=np.zeros(6)))
    uncertain = replace(of, question=replace(of.question, eta=0.1))
    for other in (unloaded, uncertain):
        assert not other.known
        with refused("is of no load, or of uncertain normals, for which no bound is proved", "bound"):
            bound.lower(other)


def test_a_bound_is_read_as_it_was_written() -> None:
    leaves = (PathLeaf(((3, 0.5), (1, -2.0)), ((1, 0, (1.0, 0.0, 2.0), 0.25),)), NOTHING)
    bound = PathBound((-1, 0, 0), (0, 7, 7), (0, 1, 0), leaves)
    again = read_bound(Fields(bound.to_json(), "bound"))
    assert (again.parent, again.part, again.case) == (bound.parent, bound.part, bound.case)
    assert [(leaf.rows, leaf.tangents) for leaf in again.leaves] == [(leaf.rows, leaf.tangents) for leaf in leaves]
    assert read_bound(Fields({"leaves": []} | {name: [-1] for name in TREE})).parent == (-1,)
    for change, problem, field in (
        ({"part": [0, 7]}, "has no tree", "bound"),
        ({"case": [0, 1]}, "has no tree", "bound"),
        ({name: [] for name in TREE}, "has no tree", "bound"),
        ({"leaves": [{"rows": [[0.5, 1]], "tangents": []}]}, "has a number that is not whole", "bound.leaves[0].rows"),
        ({"part": [0, 7, 7.5]}, "has a number that is not whole", "bound.part"),
        ({"more": 1}, "is not a known field; leave it out", "bound.more"),
        ({"leaves": [{"tangents": [], "more": 1}]}, "is not a known field; leave it out", "bound.leaves[0].more"),
        ({"leaves": [{"tangents": [[0.5, 0, [1, 0], 1]]}]}, None, "bound.leaves[0].tangents[0].state"),
        ({"leaves": [{"tangents": [[0, 0, [1, 0]]]}]}, "is missing", "bound.leaves[0].tangents[0].y"),
        ({"leaves": [{"tangents": [3]}]}, "is no object", "bound.leaves[0].tangents[0]"),
    ):
        with pytest.raises(BadFile) as fault:
            read_bound(Fields(bound.to_json() | change, "bound"))
        assert fault.value.field == field
        assert problem is None or fault.value.problem == problem


def test_a_tree_has_so_many_cases_at_most() -> None:
    assert len(read_bound(Fields({"leaves": []} | dict.fromkeys(TREE, [0] * 2 * MAX_PATH_LEAVES))).part) == 200_000
    with refused("has no tree", "bound"):
        read_bound(Fields({"leaves": []} | dict.fromkeys(TREE, [0] * (2 * MAX_PATH_LEAVES + 1)), "bound"))


def test_a_bound_is_the_least_of_those_of_its_leaves() -> None:
    """push was locked: nothing; it moved: its command is its effort in state 2, and no less than in the last state."""
    of = small(False)
    command = {k: row for k, row in enumerate(of.rows) if row.condition == (7, MOVED)}
    last = len(of.rows) - 1
    zero = PathLeaf(((last, 1.0), (min(command), 1.0)), ())
    tree = PathBound((-1, 0, 0), (0, 7, 7), (0, MOVED, LOCKED), (zero, NOTHING))
    assert tree.lower(of) == 0  # its row holds where push moved
    with refused(f"row {min(command)} does not hold in its case", "bound.leaves[1]"):
        replace(tree, leaves=(NOTHING, zero)).lower(of)


def test_of_two_leaves_the_weaker_one_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    of = small(False)
    bounds = {1: 0.5, 0: 3.0}
    monkeypatch.setattr("handfast.proofs.path_commands.leaf_bound", lambda _of, _rows, case, *_: bounds[case[7]])
    for cases in ((0, 1), (1, 0)):
        assert PathBound((-1, 0, 0), (0, 7, 7), (0, *cases), (NOTHING, NOTHING)).lower(of) == 0.5


def test_a_small_bound_is_one() -> None:
    of = small(False)
    found = of.shown([PathRow({of.measure: fmpq(1)}, fmpq(1, 2), False)], [1.0])
    assert found == pytest.approx(0.5, rel=1e-12)


def test_a_load_is_known_that_has_one_part() -> None:
    """Along one axis; one that is no larger than what counts as a force is not."""
    of = small(False)
    size = MIN_FORCE_SCALE
    for wrench, known in (([0, 0, 1.0, 0, 0, 0], True), ([0, 0, size, 0, 0, 0], False), ([0] * 6, False)):
        g = replace(of.question.grasp, R=np.zeros_like(of.question.grasp.R))
        other = replace(of, question=replace(of.question, grasp=g, wrench=np.array(wrench, dtype=float)))
        assert other.known == known


@pytest.mark.parametrize("command", [1.0, -1.0, 2.0])
def test_a_command_may_not_be_left_out(command: float) -> None:
    q = small(False).question
    other = replace(q, grasp=q.grasp.with_command(np.array([0.0, command, 0.5])))
    with refused("leaves out 'push', which is commanded; what is not sought is locked", "sought.senses"):
        read_sought(Fields({"senses": {"pull": 1}, "objective": "max"}, "sought"), other)
    none = replace(q, grasp=q.grasp.with_command(np.array([0.0, 0.0, 0.5])))
    assert read_sought(Fields({"senses": {"pull": 1}, "objective": "max"}, "sought"), none).senses.tolist() == [1, 0, 0]


SENSE = "is no sense of a command that can be sought; 1 or -1 is"


@pytest.mark.parametrize(
    ("senses", "more", "problem", "field"),
    [
        ({"pull": 1, "push": 2}, {}, SENSE, "sought.senses.push"),
        ({"pull": 1, "push": 0}, {}, SENSE, "sought.senses.push"),
        ({"pull": 1, "push": 1, "back": 1}, {}, SENSE, "sought.senses.back"),
        ({"pull": -1, "push": 1}, {}, SENSE, "sought.senses.pull"),
        ({"pull": 1}, {}, "leaves out 'push', which is commanded; what is not sought is locked", "sought.senses"),
        ({"pull": 1, "push": 1}, {"objective": "least"}, None, "sought.objective"),
        ({"pull": 1, "push": 1}, {"more": 1}, "is not a known field; leave it out", "sought.more"),
        ({"pull": 1, "push": 1, "pu": 1}, {}, "has unknown actuator 'pu'; known are pull, push, back", "sought.senses"),
    ],
)
def test_what_may_not_be_sought(senses, more, problem: str | None, field: str) -> None:
    with pytest.raises(BadFile) as fault:
        read_sought(Fields({"senses": senses, "objective": "max"} | more, "sought"), small(False).question)
    assert fault.value.field == field
    assert problem is None or fault.value.problem == problem


@pytest.mark.parametrize("sums", [False, True])
def test_what_is_sought_is_read_as_it_was_written(sums: bool) -> None:
    """ "back" is commanded, too, but backdrivable, so that it may be left out."""
    of = small(sums)
    again = read_sought(Fields(of.to_json(), "sought"), of.question)
    assert (again.senses.tolist(), again.sums) == ([1, -1, 0], sums)
    assert again.question is of.question


@pytest.mark.parametrize("size", [1.0, 1e-170, 1e-200, 5e-324, 1e49])
def test_a_tangent_is_a_tangent_however_it_is_scaled(size: float) -> None:
    """along . c_t <= mu c_n |along|, by no more than it is widened; squares of small numbers are 0 in floats."""
    of = small(False)
    for i, along in ((0, [3.0, -4.0, 12.0]), (1, [-1.0, 0.0])):
        scaled = size * np.array(along)
        row = of.tangent(0, i, scaled)
        normal = row.terms.pop(of.at(0, 2, 3 * i))
        mu, exact = rational(of.question.grasp.mu[i]), [rational(x) for x in scaled.tolist()]
        ratio = normal**2 / (mu**2 * sum((x**2 for x in exact), fmpq(0)))
        assert 1 <= ratio <= 1 + 4 * rational(CONE_WIDENING)
        assert sorted(map(str, row.terms.values())) == sorted(str(-x) for x in exact if x)
    assert of.tangent(0, 1, np.zeros(2)).terms == {of.at(0, 2, 3): 0}


def test_rows_that_are_very_many_are_not_made(monkeypatch: pytest.MonkeyPatch) -> None:
    """3 states of 2 contacts, 3 joints, 3 actuators, one coupling: 2 (6 + 3) + 3 (6 + 6 + 2) entries each."""
    of = small(False)
    assert of.entries == 3 * (2 * 9 + 3 * 14)
    bound = PathBound((-1,), (-1,), (-1,), (PathLeaf((), ()),))
    monkeypatch.setattr(path_commands, "MAX_PATH_ENTRIES", 180)
    assert bound.lower(of) == 0
    monkeypatch.setattr(path_commands, "MAX_PATH_ENTRIES", 179)
    with refused("has more than 179 entries in its rows", "bound"):
        bound.lower(of)
