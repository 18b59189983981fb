"""Forces of contacts by their motions: derivatives, and how much these change."""

from dataclasses import replace

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.grasp import StartData
from handfast.proofs.states import ContactMode as Kind
from handfast.proofs.states import (
    Laws,
    Modes,
    Part,
    Problem,
    Rows,
    State,
    _contact,
    acting,
    came_from,
    choices,
    read_state,
)
from tests.support.every_law import every_law
from tests.support.exact_states import problem

NONE = np.zeros(0, dtype=np.int64)


def drawn(rng, soft, sin):
    """A sliding contact, its modes and motions (5,) of which it presses."""
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], float(rng.uniform(0.1, 2)), torsion=0.01 * soft)])
    p = replace(problem(grasp, [0, 0, -1.0]), sin=sin, cos=float(np.sqrt(1 - sin**2)))
    modes = Modes(np.array([3]), np.zeros(1, dtype=bool), NONE, NONE)
    d = rng.normal(size=5) * 10 ** rng.uniform(-3, 3)
    d[0] = -abs(d[0]) * 10 ** rng.uniform(0, 2) - sin * np.linalg.norm(d[1:])
    d[3 + soft :] = 0.0
    return p, modes, d[: 4 + soft]


@pytest.mark.parametrize(("soft", "sin"), [(False, 0.0), (True, 0.0), (False, 0.05), (False, 0.5)])
def test_derivatives_change_by_no_more_than_is_said(soft, sin):
    rng = np.random.default_rng(7)
    nearest = 0.0
    for _ in range(400):
        p, modes, d = drawn(rng, soft, sin)
        laws = Laws.of(p, modes, d, np.zeros(len(d)))
        reach = float(laws.speed[0]) * 10 ** rng.uniform(-6, np.log10(0.45))
        step = rng.normal(size=len(d))
        step[3 + soft :] = 0.0
        step *= reach / np.linalg.norm(step)
        changed = np.abs(Laws.of(p, modes, d + step, np.zeros(len(d))).K - laws.K).max()
        bound = float(laws.change(p, np.array([reach]))[0])
        size = float(np.abs(laws.K).max())
        assert changed <= bound + 1e-12 * size
        nearest = max(nearest, changed / bound)
    assert nearest > 0.1  # it is no mere large number


@pytest.mark.parametrize(("soft", "sin"), [(False, 0.0), (True, 0.0), (False, 0.05)])
def test_derivatives_are_those_of_the_forces(soft, sin):
    rng = np.random.default_rng(8)
    for _ in range(50):
        p, modes, d = drawn(rng, soft, sin)
        laws, h = Laws.of(p, modes, d, np.zeros(len(d))), 1e-6 * float(np.abs(d).max())
        for k in range(3 + soft):
            ends = [Laws.of(p, modes, d + sign * h * np.eye(len(d))[k], np.zeros(len(d))).force[0] for sign in (1, -1)]
            slope = (ends[0] - ends[1]) / (2 * h)
            np.testing.assert_allclose(laws.K[0][:, k], slope, atol=1e-3 * max(1.0, float(np.abs(laws.K).max())))


@pytest.mark.parametrize(("friction", "carried"), [([0.15, 0.2], 0.5), ([0.3, 0.4], 1.0), ([0.6, 0.8], 1.0)])
def test_a_contact_that_leans_keeps_the_ratio_of_its_printed_force_within_its_friction(
    friction: list[float], carried: float
) -> None:
    """0.5 at most: 2 N of normal force carry 0.6 and 0.8 N, from motions (-2, 5, 0) where nothing else counts."""
    p = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)]), [0, 0, -1.0])
    modes = Modes(np.array([Kind.LEANS]), np.zeros(1, dtype=bool), NONE, NONE)
    laws = Laws.of(p, modes, np.array([-2.0, 5, 0, 0]), np.array([1.0, *friction, 0]))
    np.testing.assert_allclose(laws.force, [[2, 0.6 * carried, 0.8 * carried, 0]], rtol=1e-11)
    assert np.hypot(*laws.lean[0, :2]) < 0.5
    np.testing.assert_allclose(laws.K[0, :, 0], [-1, -0.3 * carried, -0.4 * carried, 0], rtol=1e-11)
    assert not laws.K[0, :, 1:].any()


def test_a_contact_that_leans_without_a_force_has_no_friction() -> None:
    """Its ratio is 0 over 0, or over less."""
    g, modes = (
        Grasp([Contact([0, 0, 0], [1, 0, 0], 0.3)]),
        Modes(np.array([Kind.LEANS]), np.zeros(1, dtype=bool), NONE, NONE),
    )
    p = problem(g, [1.0, 0, 0, 0, 0, 0], mdp=False)
    for normal in (0.0, -1e-9):
        phi = np.zeros(len(p.grasp.rows[0]))
        phi[0] = normal
        laws = Laws.of(p, modes, np.full(len(phi), -1.0), phi)
        assert laws.lean.tolist() == [[0.0] * 3]
        assert laws.force[0, 1:].tolist() == [0.0] * 3


def test_forces_are_rounded_by_all_that_they_are_sums_of() -> None:
    """16 roundings of a gap of 0.5, of d_n = -9, of 0.6 of d_t = (3, -4), and of forces that add up to 7."""
    p = replace(every_law((0.5, 0.0, 0.0)), cos=0.8, sin=0.6)
    modes = modes_of((Kind.SLIDES, Kind.OPEN, Kind.OPEN), (False,) * 3, (Part.LOCKED,) * 2, (Part.FREE,) * 4)
    d = np.zeros(17)
    d[:3] = [-9.0, 3.0, -4.0]
    laws = replace(Laws.of(p, modes, d, np.zeros(17)), force=np.array([[4.0, -1.0, 2.0, 0.0]]))
    np.testing.assert_allclose(laws.rounding(p, d), 16 * 2.0**-53 * (0.5 + 9 + 0.6 * 7 + 7), rtol=1e-9)
    both = replace(laws, rows=p.grasp.contact_rows[:2], force=np.vstack([laws.force, np.zeros(4)]))  # the other: 0
    np.testing.assert_allclose(both.rounding(p, d), [laws.rounding(p, d)[0], 0.0], rtol=1e-9)


@pytest.mark.parametrize(("kind", "friction"), [(Kind.RUBS, 0.0), (Kind.SLIDES, 0.5)])
def test_a_slip_takes_pressure_from_a_tilted_contact(kind: int, friction: float) -> None:
    """c_n = -(0.5 - 0.8 x 10 + 0.6 x 5), less by 0.6 for each m that it slips along (3, 4); friction mu c_n of it."""
    p = replace(every_law((0.5, 0.0, 0.0)), cos=0.8, sin=0.6)
    modes = modes_of((kind, Kind.OPEN, Kind.OPEN), (False,) * 3, (Part.LOCKED,) * 2, (Part.FREE,) * 4)
    d = np.zeros(17)
    d[:3] = [-10.0, 3.0, 4.0]
    laws = Laws.of(p, modes, d, np.zeros(17))
    along = np.array([0.6, 0.8])
    np.testing.assert_allclose(laws.force, [[4.5, *-friction * 4.5 * along, 0]], rtol=1e-14)
    by = np.array([-0.8, *-0.6 * along])
    np.testing.assert_allclose(laws.K[0, 0], [*by, 0], rtol=1e-14)
    across = 4.5 / 5 * np.array([[0.0, 0.64, -0.48], [0, -0.48, 0.36]])  # of a direction that turns
    np.testing.assert_allclose(laws.K[0, 1:3, :3], -friction * (along[:, None] * by + across), atol=1e-14)


def test_how_much_derivatives_of_tilted_contacts_change() -> None:
    """Directions of 4 m turn by 1/3 within 1 m; c_n = 0.8 x 10 - 0.6 x 4 = 5.6 N, and the slip is 3 m at least.

    A contact leans, by 0.3 and 0.4 of its normal force; one slides with a friction of 0.5; one sticks.
    """
    p = replace(every_law(), cos=0.8, sin=0.6)
    kinds = Kind.LEANS, Kind.SLIDES, Kind.STICKS
    modes = modes_of(kinds, (False,) * 3, (Part.LOCKED,) * 2, (Part.FREE,) * 4)
    d, phi = np.zeros(17), np.zeros(17)
    d[:9], phi[:3] = [-10, 2.4, 3.2] * 3, [2.0, 0.6, 0.8]
    strong = (1 + 5.6 * (2 / 3 + 1 / 4)) / 3
    due = [0.6 / 3 * 1.7, 0.6 / 3 + 0.5 * (1 / 3 + 0.6 / 3 + strong), 0.0]
    found = Laws.of(p, modes, d, phi).change(p, np.ones(3))
    assert (found >= due).all()
    np.testing.assert_allclose(found, due, rtol=6e-3)


@pytest.mark.parametrize("axis", [1, 2])
def test_a_slow_slip_under_a_large_force_changes_derivatives_most(axis: int) -> None:
    """Across the slip friction is -mu c_n d_t / speed: mu 100 (1 / 0.75 - 1 / 1) from 1 to 0.75 at 100 N."""
    p = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)]), [0, 0, -1.0])
    d, other = -100.0 * np.eye(4)[0] + np.eye(4)[axis], 3 - axis
    modes = Modes(np.array([Kind.SLIDES]), np.zeros(1, dtype=bool), NONE, NONE)
    laws, slower = (Laws.of(p, modes, at, np.zeros(4)) for at in (d, d - 0.25 * np.eye(4)[axis]))
    changed = abs(slower.K - laws.K)[0, other, other]
    assert changed == pytest.approx(0.5 * 100 * (1 / 0.75 - 1))
    assert changed <= laws.change(p, np.array([0.25]))[0] <= 5 * changed


def test_a_direction_that_may_turn_round_is_not_known():
    p, modes, d = drawn(np.random.default_rng(9), False, 0.0)
    laws = Laws.of(p, modes, d, np.zeros(len(d)))
    assert np.isfinite(laws.change(p, 0.49 * laws.speed)).all()
    assert np.isinf(laws.change(p, 0.5 * laws.speed)).all()
    still = Laws.of(p, modes, np.array([-1.0, 0, 0, 0]), np.zeros(4))
    assert np.isinf(still.change(p, np.zeros(1))).all()


def test_a_state_of_a_file_has_its_lengths_and_no_torsion_at_points():
    g = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)]), [0, 0, -1.0]).grasp
    data = {"r": [0.0] * 6, "q": [], "c": [1.0, 0, 0], "f": [], "coupling": []}
    x = read_state(Fields(data), g)
    assert isinstance(x, State)
    assert x.torsion.tolist() == [0.0]
    with pytest.raises(BadFile, match="3 are needed"):
        read_state(Fields(data | {"c": [1.0]}, "witness"), g)
    with pytest.raises(BadFile, match=r"witness.torsion: is not 0 at a point contact"):
        read_state(Fields(data | {"torsion": [-0.1]}, "witness"), g)
    two = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)] * 2), [0, 0, -1.0]).grasp
    with pytest.raises(BadFile, match=r"witness.torsion: is not 0 at a point contact"):
        read_state(Fields(data | {"c": [0.0] * 6, "torsion": [0, 0.1]}, "witness"), two)


def test_where_a_step_came_to_by_hand():
    """Contact 0 opens by 0.8 x 10 + 0.6 x |(3, 4)| = 11, whatever rounding leaves of its force; contact 1, that pressed
    with 11.5 N, with 0.5 N. Joints and tendons move away.
    """
    contacts = [Contact([0, 0, 0], [0, 0, 1], 0.5), Contact([1, 0, 0], [0, 0, 1], 0.5)]
    joints = [
        GraspJoint(name, [1, 0, 0], [0, 0, 0], (), "prismatic", stop=stop)
        for name, stop in (("a", "lower"), ("b", "upper"), ("c", "lower"))
    ]
    mechanism = Mechanism(("t", "pulled"), np.array([[3.0, 0, 0], [1, 0, 0]]), np.zeros((0, 3)), (True, True))
    p = problem(Grasp(contacts, joints, mechanism, {"pulled": 1.0}), [0, 0, -1.0])
    none = np.zeros(3)
    p = replace(p, grasp=p.grasp.with_start(StartData(np.array([0, -11.5]), none, none[:2])))
    r, c = np.array([3.0, 4, 10, 0, 0, 0]), np.array([1e-16, 0, 0, 0.5, 0, 0])
    x = State(r, np.array([2.0, -5, 1e-13]), c, np.zeros(2), np.zeros(0), none, none[:2])
    came, room, moved = came_from(replace(p, cos=0.8, sin=0.6), x)
    assert moved == pytest.approx(1e-13)
    np.testing.assert_allclose(came.gaps, [11, -0.5])
    np.testing.assert_allclose(came.stops, [2, 5, 0], atol=0)
    np.testing.assert_allclose(came.slack, [6, 0], atol=0)
    rounding = 8 * 12 * 2.0**-53  # of the largest motion, sqrt(3^2 + 4^2 + 10^2)
    np.testing.assert_allclose(room.stops, 2 * rounding * np.sqrt(125), rtol=1e-4)
    assert rounding * np.sqrt(125) < 1.2e-13
    heavy = replace(p, wrench=np.array([0, 0, -8.0, 0, 0, 0]))  # whatever the load
    np.testing.assert_array_equal(came_from(heavy, x)[1].stops, room.stops)
    left = replace(x, q=np.array([2.0, -5, 1.3e-13]))
    assert came_from(p, left)[0].stops[2] == 1.3e-13
    far = replace(x, r=np.zeros(6), q=np.array([1e12, 0, 0]))  # 8 roundings for each of 12 rows
    _, room, _ = came_from(p, far)
    np.testing.assert_allclose(room.stops[0], 2 * 8 * 12 * 2.0**-53 * 1e12, rtol=1e-4)
    np.testing.assert_allclose(room.slack[0], 2 * 8 * 12 * 2.0**-53 * 3e12, rtol=1e-4)


MODES = [
    (Kind.TOUCHES, Kind.STICKS, Kind.SLIDES),
    (False, False, True),
    (Part.HIGH, Part.RESTS),
    (Part.MOVES, Part.BACK, Part.FREE, Part.LOCKED),
]


def modes_of(contact, full, actuator, joint) -> Modes:
    return Modes(np.array(contact), np.array(full), np.array(actuator), np.array(joint))


def test_which_rows_are_held_unknown_and_given():
    """Rows 0 to 8 of contacts, then motor, tendon, coupling, four joints, and none; in a step."""
    p = every_law((0.5, -2.0, 0.0), 0.4, 0.25)
    rows = Rows.of(replace(p, cos=0.8, sin=0.6), modes_of(*MODES))
    held, unknown = [0, 4, 5, 9, 10, 11, 13, 15], [4, 5, 10, 11, 13, 15]
    assert (np.flatnonzero(rows.held).tolist(), np.flatnonzero(rows.unknown).tolist()) == (held, unknown)
    assert dict(zip(np.flatnonzero(rows.given).tolist(), rows.given[rows.given != 0], strict=True)) == {
        9: 6.0,
        12: -0.5,
    }
    # what had come away goes back: a gap of 0.5 along 0.8 of its motion, a tendon and a stop
    assert {k: rows.at[k] for k in np.flatnonzero(rows.at)} == {0: -0.625, 10: -0.25, 13: -0.4}
    assert float(rows.exact[10]) == -0.25
    others = [(Kind.OPEN, Kind.RUBS, Kind.LEANS), MODES[1], (Part.LOWEST, Part.MOVES)]
    rows = Rows.of(p, modes_of(*others, (Part.OPENS, Part.LOW, Part.FREE, Part.LOCKED)))
    assert (np.flatnonzero(rows.held).tolist(), np.flatnonzero(rows.unknown).tolist()) == (
        [9, 11, 13, 15],
        [4, 5, 11, 15],
    )
    assert dict(zip(np.flatnonzero(rows.given).tolist(), rows.given[rows.given != 0], strict=True)) == {
        9: -6.0, 12: 0.5, 13: -0.5,
    }  # fmt: skip
    assert not rows.at.any()
    rows = Rows.of(p, modes_of(*others[:2], (Part.LOW, Part.LOCKED), (Part.HIGH, Part.RESTS, Part.FREE, Part.LOCKED)))
    assert (rows.given[9], rows.given[12], rows.held[9], rows.unknown[9]) == (-3.0, 0.5, True, False)
    assert (rows.held[10], rows.unknown[10], rows.at[10]) == (True, True, 0.0)  # locked, and not drawn back
    drawn = Rows.of(every_law(slack=1.0), modes_of(*others[:2], (Part.RESTS, Part.LOW), MODES[3]))
    assert (drawn.unknown[9], drawn.given[9], drawn.at[10]) == (True, 0.0, -1.0)  # the command is not added to it
    assert np.flatnonzero(Rows.of(every_law(), modes_of(*MODES)).at).tolist() == []


def test_modes_in_words():
    g = every_law().grasp
    assert modes_of(*MODES).words(g) == {
        "contact 0": "touches", "contact 1": "sticks", "contact 2": "slides", "motor": "high", "tendon": "rests",
        "reaction of rubs": "moves", "reaction of stopped": "back", "reaction of both": "locked",
    }  # fmt: skip
    assert modes_of(*MODES).closed.tolist() == [False, True, True]


OPEN, TOUCHES, STICKS, SLIDES, RUBS, LEANS = range(6)
ONE = {"mu": 0.5, "before": 0.0, "d": [-1.0, 0.0, 0.0, 0.0], "phi": [1.0, 0.1, 0.0, 0.0]}
LAWS = {
    "open": ({"d": [2.0, 0, 0, 0], "phi": [0, 0, 0, 0]}, {}, [OPEN, TOUCHES]),
    "just shut": ({"d": [0.0, 0, 0, 0], "phi": [0, 0, 0, 0]}, {}, [TOUCHES, OPEN, STICKS, SLIDES]),
    "shut by little": ({"d": [-5e-10, 0, 0, 0], "phi": [0, 0, 0, 0]}, {}, [TOUCHES, STICKS, SLIDES, OPEN]),
    "slides by little": ({"d": [-5e-10, 3, 4, 0], "phi": [0, 0, 0, 0]}, {}, [TOUCHES, SLIDES, OPEN, STICKS]),
    "came back": ({"before": 2.0, "d": [-2.0, 0, 0, 0], "phi": [0, 0, 0, 0]}, {}, [TOUCHES, OPEN, STICKS, SLIDES]),
    "slid open": ({"d": [-4.0, 3, 4, 0], "phi": [0, 0, 0, 0]}, {"cos": 0.8, "sin": 0.6}, [OPEN, TOUCHES]),
    "slid to": ({"d": [-3.75, 5, 0, 0], "phi": [0] * 4}, {"cos": 0.8, "sin": 0.6}, [TOUCHES, OPEN, STICKS, SLIDES]),
    "sticks": ({}, {}, [STICKS, SLIDES]),
    "at its edge": ({"phi": [1.0, 0.5, 0, 0]}, {}, [STICKS, SLIDES]),
    "slides": ({"d": [-1, 3, 4, 0], "phi": [1, -0.3, -0.4, 0]}, {}, [SLIDES, STICKS]),
    "slid": ({"d": [-1, 3e-10, 4e-10, 0], "phi": [1, -0.3, -0.4, 0]}, {}, [SLIDES, STICKS]),
    "slid aside": ({"d": [-1, 4e-10, -3e-10, 0], "phi": [1, -0.3, -0.4, 0]}, {}, [STICKS, SLIDES]),
    "too little": ({"d": [-1, 3, 4, 0], "phi": [1, -0.1, 0, 0]}, {}, [SLIDES]),
    "too little of much": ({"d": [-1, 3, 4, 0], "phi": [4, -0.6, -0.8, 0]}, {}, [SLIDES]),
    "turns": ({"d": [-1, 0, 0, 5], "phi": [1, 0, 0, -0.5]}, {}, [SLIDES, STICKS]),
    "full": ({"phi": [8.0, 0, 0, 0]}, {}, [(STICKS, True), (SLIDES, True), STICKS, SLIDES]),
    "smooth": ({"mu": 0.0, "phi": [1.0, 0, 0, 0]}, {}, [SLIDES]),
    "smooth and tilted": ({"mu": 0.0, "phi": [1.0, 0, 0, 0]}, {"sin": 0.6}, [STICKS, SLIDES]),
    "rubs": ({}, {"mdp": False}, [RUBS]),
    "rubs and tilted": ({}, {"mdp": False, "sin": 0.6}, [STICKS, RUBS]),
    "leans": ({"phi": [1.0, 0.3, 0.4, 0]}, {"mdp": False}, [LEANS, RUBS]),
    "leans much": ({"phi": [4.0, 1.2, 1.6, 0]}, {"mdp": False}, [LEANS, RUBS]),
    "leans little": ({"phi": [4.0, 0.6, 0.8, 0]}, {"mdp": False}, [RUBS]),
    "leans and tilted": ({"phi": [1.0, 0.3, 0.4, 0]}, {"mdp": False, "sin": 0.6}, [STICKS, LEANS, RUBS]),
    "rubs smoothly": ({"mu": 0.0, "phi": [1.0, 0, 0, 0]}, {"mdp": False}, [RUBS]),
}  # fmt: skip


@pytest.mark.parametrize(("one", "law", "wanted"), LAWS.values(), ids=LAWS)
def test_modes_that_a_contact_may_have_the_likeliest_first(one, law, wanted):
    """A part in 1e9 of 1 N counts as nothing; normal forces go up to 8 N."""
    p = replace(problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)]), [0, 0, -1.0]), force_limit=8.0, **law)
    found = _contact(p, **(ONE | one), none_d=1e-9, none_f=1e-9)
    assert found == [(int(k[0]), True) if isinstance(k, tuple) else (int(k), False) for k in wanted]


JUST = {
    "no force": ({"d": [2, 0, 0, 0], "phi": [0.25, 0, 0, 0]}, {}, [OPEN, TOUCHES]),
    "shut": ({"d": [0.25, 0, 0, 0], "phi": [0] * 4}, {}, [TOUCHES, OPEN, STICKS, SLIDES]),
    "no slip": ({"d": [-0.25, 0.25, 0, 0], "phi": [0] * 4}, {}, [TOUCHES, STICKS, SLIDES, OPEN]),
    "no slip under force": ({"d": [-1, 0.25, 0, 0], "phi": [1, 0, 0, 0]}, {}, [STICKS, SLIDES]),
    "friction that is due": ({"d": [-1, 3, 4, 0], "phi": [1, 0.25, 0, 0]}, {}, [SLIDES, STICKS]),
    "leans": ({"phi": [1, 0.25, 0, 0]}, {"mdp": False}, [LEANS, RUBS]),
    "full": ({"phi": [7.75, 0, 0, 0]}, {}, [(STICKS, True), (SLIDES, True), STICKS, SLIDES]),
}


@pytest.mark.parametrize(("one", "law", "wanted"), JUST.values(), ids=JUST)
def test_what_is_as_large_as_what_counts_as_nothing_is_nothing(one, law, wanted):
    """0.25 m or N."""
    p = replace(problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)]), [0, 0, -1.0]), force_limit=8.0, **law)
    found = _contact(p, **(ONE | one), none_d=0.25, none_f=0.25)
    assert found == [(int(k[0]), True) if isinstance(k, tuple) else (int(k), False) for k in wanted]


LOW, HIGH, LOWEST, MOVES, OPENS = Part.LOW, Part.HIGH, Part.LOWEST, Part.MOVES, Part.OPENS
RESTS, LOCKED, FREE, BACK = Part.RESTS, Part.LOCKED, Part.FREE, Part.BACK
PARTS = {  # motion and force
    "moves": ("actuator 0", -0.5, -3.0, [MOVES, LOW, RESTS]),
    "rests": ("actuator 0", 0.0, -4.0, [RESTS, LOW, MOVES]),
    "rests, as good as": ("actuator 0", -1e-6, -4.0, [RESTS, LOW, MOVES]),
    "moves, as good as": ("actuator 0", -0.5, -3.000001, [MOVES, LOW, RESTS]),
    "at its command": ("actuator 0", 0.0, -3.0, [LOW, RESTS, MOVES]),
    "at its limit": ("actuator 0", 0.0, -6.0, [LOWEST, RESTS, LOW, MOVES]),
    "pushed the other way": ("actuator 0", 0.0, 6.0, [LOW, MOVES, RESTS]),
    "slack": ("actuator 1", -0.2, 0.0, [MOVES, LOW, RESTS]),
    "taut": ("actuator 1", -0.25, 2.0, [RESTS, LOW, MOVES]),
    "closes": ("joint 0", 0.5, -0.5, [MOVES, RESTS, LOW]),
    "opens": ("joint 0", -0.5, 0.5, [OPENS, RESTS, HIGH]),
    "rests inside": ("joint 0", 0.0, 0.1, [RESTS]),
    "at its lower end": ("joint 0", 0.0, -0.5, [LOW, RESTS]),
    "at its upper end": ("joint 0", 0.0, 0.5, [HIGH, RESTS]),
    "moves inside": ("joint 0", 0.5, 0.1, [RESTS]),
    "off its stop": ("joint 1", -0.3, -0.5, [RESTS, LOW, BACK]),
    "at its stop": ("joint 1", -0.4, 0.9, [BACK, OPENS, RESTS, HIGH]),
    "has no law": ("joint 2", 0.5, 0.0, [FREE]),
    "between stops": ("joint 3", 0.0, 3.0, [LOCKED]),
}


@pytest.mark.parametrize(("part", "motion", "force", "wanted"), PARTS.values(), ids=PARTS)
def test_modes_that_a_part_may_have_the_likeliest_first(part, motion, force, wanted):
    p = every_law((0.0, 0.0, 0.0), 0.4, 0.25)
    name, k = part.split()
    q, f, reaction = np.zeros(4), np.zeros(2), np.zeros(4)
    if name == "joint":
        q[int(k)], reaction[int(k)] = motion, force
    else:
        q[(0, 2)[int(k)]], f[int(k)] = motion / (4, 1)[int(k)], force
    x = State(np.zeros(6), q, np.zeros(9), f, np.zeros(1), reaction, np.zeros(3))
    assert choices(p, x)[part] == [(int(kind), False) for kind in wanted]


def test_a_joint_without_friction_is_free_or_back_at_its_stop() -> None:
    p = every_law(stop=0.25)
    p = replace(p, grasp=replace(p.grasp, friction=np.zeros(4)))
    for motion, wanted in ((-0.25, [BACK, FREE]), (0.25, [FREE, BACK]), (-0.125, [FREE, BACK])):
        q, nothing = np.array([0, motion, 0, 0]), np.zeros(4)
        x = State(np.zeros(6), q, np.zeros(9), np.zeros(2), np.zeros(1), nothing, np.zeros(3))
        assert choices(p, x)["joint 1"] == [(int(kind), False) for kind in wanted]


def test_the_largest_force_that_acts_is_the_load_s_or_one_of_a_contact() -> None:
    p = every_law()
    c = np.array([1.0, 0, 0, 30, -40, 0, 0, 0, 2])
    x = State(np.zeros(6), np.zeros(4), c, np.zeros(2), np.zeros(1), np.zeros(4), np.zeros(3))
    assert acting(p, x) == 50.0
    assert acting(p, replace(x, c=c / 1e3)) == p.scale


def test_what_counts_as_nothing_at_a_joint_is_of_the_largest_force_and_its_lever() -> None:
    """A part in 1e9 of 50 N, and of what that is at the joint; of a large motion its rounding, 8 for each row."""
    p = every_law(stop=0.25)
    unit, rows = float(p.grasp.row_units[13]), len(p.grasp.rows[0])
    assert unit not in (0.0, 1.0)

    def likeliest(p: Problem, motion: float, force: float) -> list[int]:
        q, c, reaction = np.zeros(4), np.zeros(9), np.zeros(4)
        q[1], reaction[1], c[3:5] = motion, force, (30.0, 40.0)
        x = State(np.zeros(6), q, c, np.zeros(2), np.zeros(1), reaction, np.zeros(3))
        return [kind for kind, _ in choices(p, x)["joint 1"]]

    for share, back in ((0.99, True), (1.01, False)):
        assert (likeliest(p, -0.25 + share * 50e-9 * unit, 0.0)[0] == BACK) == back
        assert (LOW in likeliest(p, -0.25, -0.5 + share * 50e-9 / unit)) == back
        far = every_law(stop=1e9)
        assert (likeliest(far, -1e9 + share * 8 * rows * 2.0**-53 * 1e9, 0.0)[0] == BACK) == back


def test_torques_about_normals_are_levers_times_rows() -> None:
    """A torsion of 5 mm over a friction of 0.5."""
    contacts = [Contact([0, 0, 0], [0, 0, 1], 0.5), Contact([0, 0, 0], [0, 0, 1], 0.5, torsion=0.005)]
    g = problem(Grasp(contacts), [0, 0, -1.0]).grasp
    forces = np.array([1.0, 2, 3, 4, 5, 6, 7, 0])
    x = State.of(g, np.zeros(6), forces)
    np.testing.assert_allclose(x.torsion, [0, 0.07], rtol=1e-15)
    np.testing.assert_allclose(x.forces(g), forces, rtol=1e-15)


def test_nothing_is_granted_where_base_and_direction_cancel() -> None:
    p, up = every_law(), np.array([0, 0, 2.0, 0, 0, 0])
    assert p.granted == p.scale
    for base, magnitude, granted in ((-up, 1.0, False), (-up, 0.5, True), (0 * up, 0.0, True), (0 * up, 1.0, True)):
        other = replace(p, wrench=base, along=up, magnitude=magnitude)
        assert other.granted == (other.scale if granted else 0.0)
        assert other.scale > 0


@pytest.mark.parametrize(("limit", "force", "kind"), [(6, 6, HIGH), (0.5, 0.5, HIGH), (6, -6, LOWEST), (6, 5, None)])
def test_a_motor_that_nobody_commands_is_at_a_limit_or_locked(limit: float, force: float, kind: int | None) -> None:
    p = every_law()
    p = replace(p, grasp=p.grasp.with_command(np.zeros(2)), torque_limit=np.array([limit, np.inf]))
    x = State(np.zeros(6), np.zeros(4), np.zeros(9), np.array([force, 0]), np.zeros(1), np.zeros(4), np.zeros(3))
    assert [k for k, _ in choices(p, x)["actuator 0"]] == [*([] if kind is None else [kind]), LOCKED]
