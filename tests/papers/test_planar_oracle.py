"""The planar oracle: cases derived by hand, arrangements in special position, and every mode tried one by one."""

from __future__ import annotations

from collections import Counter
from itertools import product

import numpy as np
import pytest
from flint import fmpq
from scipy.optimize import linprog

from handfast import InputError, Verdict, check, load_grasp
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.papers.arrangement import faces
from handfast.papers.planar_oracle import (
    PlanarContact,
    PlanarGrasp,
    PlanarState,
    planar_check,
    planar_least_motion,
    planar_ranges,
)
from handfast.papers.rational_simplex import RationalProgram
from handfast.proofs.fields import rational, rounded

UP, DOWN, RIGHT, LEFT = (0.0, 1.0), (0.0, -1.0), (1.0, 0.0), (-1.0, 0.0)


def grasp_of(*contacts: tuple[tuple[float, float], tuple[float, float], float]) -> PlanarGrasp:
    return PlanarGrasp([PlanarContact(p, n, mu) for p, n, mu in contacts])


TABLE = grasp_of(((-1, 0), UP, 0.5), ((1, 0), UP, 0.5))  # two points of a table; the object lies on them
JAWS = grasp_of(((-1, 0), RIGHT, 0.5), ((1, 0), LEFT, 0.5))  # two immobile jaws


def test_block_on_a_table() -> None:
    """Friction alone holds sideways: mu times the weight; a torque tips about one of the two points, 1 m away."""
    assert planar_ranges(TABLE, [1, 0, 0], [0, -4, 0]).shown == [(0.0, 2.0)]
    assert planar_ranges(TABLE, [0, 0, 1], [0, -4, 0]).shown == [(0.0, 4.0)]
    assert planar_ranges(TABLE, [0, 1, 0], [0, -4, 0]).shown == [(0.0, 4.0)]  # lifted off, the load is 0 at last
    assert planar_ranges(TABLE, [0, -1, 0], [0, -4, 0]).unbounded


def test_jaws_without_preload_hold_nothing_across() -> None:
    """Motion presses one immobile jaw only, whose friction then holds mu of the push, but no torque."""
    assert planar_check(JAWS, [0, 1, 0]) is None
    assert planar_ranges(JAWS, [0, 1, 0], [4, 0, 0]).shown == [(0.0, 0.0)]  # 1 m beside it, friction turns the object
    assert planar_ranges(JAWS, [0, 1, 1], [4, 0, 0]).shown == [(0.0, 2.0)]  # through the contact at (1, 0)
    assert planar_check(JAWS, [0, 1, 0.0001]) is None


def test_funnel() -> None:
    """Normals that lean inwards by 3-4-5: what pushes in is carried by both contacts, what pulls out by none."""
    funnel = grasp_of(((-1, 0), (0.6, 0.8), 0.25), ((1, 0), (-0.6, 0.8), 0.25))
    assert planar_ranges(funnel, [0, -1, 0]).unbounded
    assert planar_check(funnel, [0, 1, 0]) is None


def test_range_with_a_hole() -> None:
    """Held for small and for large magnitudes, not between: s in [0, 3/11] and in [1, 2].

    Motions: d_A = -v_y, d_B = v_y - turn, d_C = v_x; t_A = v_x, t_B = -v_x, t_C = v_y + turn. Equilibrium:

        x        -ct_A + ct_B - c_C = 2 s - 2
        torque    c_B - ct_C = 2 + 2 s
        y + turn  c_A - 2 ct_C = s - 1

    C open: c_A = s - 1, so s >= 1; c_B = 2 + 2 s; friction of A and B has to give 2 s - 2 and gives at most
    c_A / 2 + c_B / 4 = s, so s <= 2. C closed, so v_x < 0 and A and B slide: for s < 1, ct_C = (c_A + 1 - s) / 2 > 0
    opposes v_y + turn <= 0, so with turn = v_y + c_B there is v_y < 0 and A is open. Then c_B = 2.5 + 1.5 s,
    c_C = 1.375 - 2.375 s, and ct_C = (1 - s) / 2 <= c_C / 2 gives s <= 3/11.
    """
    grasp = grasp_of(((0, 0), DOWN, 0.5), ((-1, 0), UP, 0.25), ((1, 0), RIGHT, 0.5))
    found = planar_ranges(grasp, [2, -1, 2], [-2, -3, 2])
    assert found.ranges == ((0, fmpq(3, 11)), (1, 2))
    assert all(found.holds(s) for s in (0.0, 0.27, 1.0, 2.0))
    assert not any(found.holds(s) for s in (0.28, 0.99, 2.01))


def test_sticking_carries_what_sliding_either_way_does_not() -> None:
    """A cell of lower dimension: the load lies inside the friction cone, where the contact must not slide."""
    one = grasp_of(((0, -1), UP, 0.5))
    state = planar_check(one, [0.25, -1, 0.25])  # through the contact: torque -y f_x = 0.25 about the origin
    assert state is not None
    _, T = one.contacts[0].rows
    assert sum(t * x for t, x in zip(T, state.motion, strict=True)) == 0
    assert state.forces == ((fmpq(1), fmpq(1, 4)),)
    assert planar_check(one, [0.51, -1, 0.51]) is None


def test_opposite_contacts_on_one_line_do_not_wedge() -> None:
    """A coin between two points of immobile jaws: no motion presses both, however much friction there is."""
    assert planar_check(grasp_of(((-1, 0), RIGHT, 9.0), ((1, 0), LEFT, 9.0)), [0, 1, 0]) is None


def test_offset_contacts_wedge() -> None:
    """A turn about the middle presses both contacts by half of it, and both frictions oppose it; backwards none."""
    wedge = grasp_of(((-1, 0.5), RIGHT, 0.5), ((1, -0.5), LEFT, 0.5))
    state = planar_check(wedge, [0, 0, 1])
    assert state is not None
    assert state.forces == ((fmpq(1, 2), fmpq(1, 4)),) * 2
    assert planar_ranges(wedge, [0, 0, 1]).unbounded
    assert planar_check(wedge, [0, 0, -1]) is None


def test_load_that_rounded_numbers_miss() -> None:
    """Two contacts resist a fan of loads in a plane; a load beside it is within reach of a tolerance only."""
    load = [0.0, -1.0, 1e-12]
    one = grasp_of(((0, -1), UP, 0.0))
    assert planar_check(one, load) is None
    assert planar_check(one, load, within=[1e-9] * 3) is not None
    assert planar_check(one, [0.0, -1.0, 1e-6], within=[1e-9] * 3) is None


def test_least_motion() -> None:
    """Normals 0.002 off opposite: what pulls across has to be wedged by motions some hundred times the forces.

    Both jaws lean outwards by the slope e, so that N_l + N_r = (0, -2 e, 0) and a motion v_y = -v presses both by e v:
    friction mu e v and springs e^2 v each carry 2 e v (mu + e).
    """
    e, mu = 0.001, 0.5
    jaws = grasp_of(((-1, 0), (1.0, e), mu), ((1, 0), (-1.0, e), mu))
    state = planar_least_motion(jaws, [0, -1, 0])
    assert state is not None
    assert rounded(state.motion[1]) == pytest.approx(-1 / (2 * e * (mu + e)), rel=1e-9)
    assert planar_least_motion(jaws, [0, 1, 0]) is None
    nearer = planar_least_motion(jaws, [0, -1, 0], along=[0, 1, 0])  # s = 1 takes the load away
    assert nearer is not None
    assert nearer.motion == (0, 0, 0)
    gentle = planar_least_motion(TABLE, [0, -4, 0])
    assert gentle is not None
    assert gentle.motion == (0, -2, 0)


def test_nothing_asked_is_resisted() -> None:
    assert planar_check(TABLE, [0, 0, 0]) is not None
    assert planar_ranges(TABLE, [0, 1, 0]).shown == [(0.0, 0.0)]


# --- arrangements ---------------------------------------------------------------------------------


def rows(*vectors: tuple[int, int, int]) -> list[list[fmpq]]:
    return [[fmpq(v) for v in vector] for vector in vectors]


@pytest.mark.parametrize(
    ("planes", "counts"),
    [
        (rows((1, 0, 0), (0, 1, 0), (0, 0, 1)), (6, 12, 8)),
        (rows((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1)), (12, 24, 14)),  # general position: 4 * 3 + 2 cells
        (rows((1, 0, 0), (0, 1, 0), (0, 0, 1), (-2, 0, 0)), (6, 12, 8)),  # one plane twice
        (rows((1, 0, 0), (0, 1, 0), (1, 1, 0), (0, 0, 1)), (8, 18, 12)),  # three share a line
    ],
)
def test_numbers_of_faces(planes: list[list[fmpq]], counts: tuple[int, int, int]) -> None:
    found = Counter(f.dimension for f in faces(planes))
    assert (found[1], found[2], found[3]) == counts


def test_planes_that_share_a_line_are_cut_by_more() -> None:
    found = list(faces(rows((1, 0, 0), (0, 1, 0))))
    assert {tuple(f.signs) for f in found if f.dimension == 3} == set(product((-1, 1), repeat=2))
    assert all(f.rays for f in found)


def random_grasp(rng: np.random.Generator, m: int, special: bool) -> PlanarGrasp:
    """With numbers of a coarse grid if special: planes coincide, share lines, contacts lie at one place."""
    contacts = []
    for _ in range(m):
        if special:
            normals = (UP, DOWN, LEFT, RIGHT, (0.6, 0.8), (-0.8, 0.6))
            n, mu = normals[rng.integers(len(normals))], float(rng.choice([0.0, 0.25, 0.5]))
            contacts.append(PlanarContact(rng.integers(-1, 2, 2), n, mu))
        else:
            angle = rng.uniform(0, 2 * np.pi)
            contacts.append(PlanarContact(rng.normal(size=2), [np.cos(angle), np.sin(angle)], rng.uniform(0.1, 1)))
    return PlanarGrasp(contacts)


@pytest.mark.parametrize("special", [False, True])
def test_every_motion_lies_on_a_face(special: bool) -> None:
    """Signs of random motions, and of motions in planes, on lines, are all among the faces; Euler's formula holds."""
    rng = np.random.default_rng(3)
    for m in (1, 2, 4):
        table = [row for c in random_grasp(rng, m, special).contacts for row in c.rows]
        found = list(faces(table))
        signs = {tuple(f.signs) for f in found}
        count = Counter(f.dimension for f in found)
        assert count[1] - count[2] + count[3] == 2
        for x in rng.integers(-3, 4, size=(200, 3)):
            values = [sum(a * int(b) for a, b in zip(row, x, strict=True)) for row in table]
            if any(x):
                assert tuple((v > 0) - (v < 0) for v in values) in signs


# --- against every mode, one by one ---------------------------------------------------------------


def each_mode(grasp: PlanarGrasp, along: np.ndarray, base: np.ndarray) -> list[tuple[float, float]]:
    """The resisted ranges from 4^m floating-point programs: every contact open, stuck, or sliding either way."""
    m, found = len(grasp.contacts), []
    numbers = [[np.array([rounded(v) for v in row]) for row in c.rows] for c in grasp.contacts]
    for modes in product(("open", "stick", "left", "right"), repeat=m):
        balance, equal, least = np.zeros((3, 4 + m)), [], []
        balance[:, -1] = along
        for i, (mode, (N, T)) in enumerate(zip(modes, numbers, strict=True)):
            mu, force = grasp.contacts[i].friction, np.eye(1, 4 + m, 3 + i)[0]
            n, t = np.r_[N, np.zeros(m + 1)], np.r_[T, np.zeros(m + 1)]
            least.append(n if mode == "open" else -n)
            if mode == "open":
                equal.append(force)
                continue
            balance[:, :3] -= np.outer(N, N)
            balance[:, 3 + i] = T
            side = 1.0 if mode == "left" else -1.0
            if mode == "stick":
                equal.append(t)
                least += [-mu * n - force, -mu * n + force]
            else:
                least.append(side * t)
                equal.append(force - side * mu * n)  # c_t = -side mu c_n, c_n = -n x
        ends = []
        for sign in (1.0, -1.0):
            r = linprog(
                np.r_[np.zeros(3 + m), sign], -np.array(least), np.zeros(len(least)), np.vstack([balance, *equal]),
                np.r_[-base, np.zeros(m)], bounds=[(None, None)] * (3 + m) + [(0, None)],
            )  # fmt: skip
            if r.status != 2:
                ends.append(float("inf") if r.status == 3 else r.x[-1])
        if len(ends) == 2:
            found.append((ends[0], ends[1]))
    joined: list[tuple[float, float]] = []
    for low, high in sorted(found):
        if joined and low <= joined[-1][1] + 1e-7:
            joined[-1] = (joined[-1][0], max(joined[-1][1], high))
        else:
            joined.append((low, high))
    return joined


@pytest.mark.slow
@pytest.mark.parametrize("special", [False, True])
def test_every_mode_one_by_one_says_the_same(special: bool) -> None:
    rng = np.random.default_rng(7)
    kinds: Counter[str] = Counter()
    for k in range(14):
        grasp = random_grasp(rng, 2 + k % 2, special)
        along, base = (rng.integers(-2, 3, 3).astype(float) if special else rng.normal(size=3) for _ in range(2))
        if k % 2 and not special:  # three contacts pressed on, which most of them resist; two resist a thin fan only
            base = -np.sum([rng.uniform(1, 2) * np.array([rounded(v) for v in c.rows[0]]) for c in grasp.contacts], 0)
        exact = planar_ranges(grasp, along, base)
        shown = [(lo, float("inf") if hi is None else hi) for lo, hi in exact.shown]
        modes = each_mode(grasp, along, base)
        assert np.shape(shown) == np.shape(modes)
        assert np.allclose(shown, modes, atol=1e-6)
        kinds["none" if not shown else "unbounded" if exact.unbounded else "bounded"] += 1
        if exact.state is not None and exact.maximum is not None:
            load = [rational(b) + exact.maximum * rational(a) for a, b in zip(along, base, strict=True)]
            assert exact.state.solves(grasp, load)
    assert min(kinds.values()) >= 2
    assert len(kinds) == 3


def test_whatever_some_motion_resists_is_resisted() -> None:
    """Loads made from random motions on faces of every dimension, of which rounding knows nothing."""
    rng = np.random.default_rng(11)
    for k in range(14):
        grasp = random_grasp(rng, 4, special=k % 2 == 0)
        chosen = list(faces([row for c in grasp.contacts for row in c.rows]))
        face = chosen[rng.integers(len(chosen))]
        motion = [sum(fmpq(int(rng.integers(1, 4)) * r[a], max(map(abs, r))) for r in face.rays) for a in range(3)]
        motion = [fmpq(round(float(rounded(v)) * 64), 64) for v in motion]
        load, forces = [fmpq(0)] * 3, []
        for c in grasp.contacts:
            N, T = c.rows
            dn, dt = (sum((a * b for a, b in zip(row, motion, strict=True)), fmpq(0)) for row in (N, T))
            cn = max(-dn, fmpq(0))
            share = fmpq(-1 if dt > 0 else 1) if dt != 0 else fmpq(int(rng.integers(-2, 3)), 2)
            forces.append((cn, share * rational(c.friction) * cn))
            load = [w - cn * n - forces[-1][1] * t for w, n, t in zip(load, N, T, strict=True)]
        assert PlanarState(tuple(motion), tuple(forces)).solves(grasp, load)
        size = max(abs(rounded(v)) for v in load) or 1.0
        assert planar_check(grasp, [rounded(v) for v in load], within=[1e-12 * size] * 3) is not None


# --- the spatial grasp -----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_spatial_grasp_resists_the_same(seed: int) -> None:
    """Motions out of the plane do no work, so nothing that friction loads moves out of it: just inside and outside."""
    rng = np.random.default_rng([5, seed])
    exact, k = None, 0
    while exact is None or not exact.maximum:  # bounded, and not by 0
        grasp, along, base = random_grasp(rng, 3, special=False), rng.normal(size=3), rng.normal(size=3)
        exact, k = planar_ranges(grasp, along, base), k + 1
        assert k < 40
    ends = [rounded(v) for v in (*exact.ranges[-1],) if v]
    for s in [v for end in ends for v in (0.999 * end, 1.001 * end)]:
        answer = check(grasp.spatial(), grasp.spatial_load(base + s * along))
        assert answer.verdict is (Verdict.HOLDS if exact.holds(s) else Verdict.SLIPS)


# --- linear programs, states, input -----------------------------------------------------------------


def test_simplex_by_hand() -> None:
    """x + y + u = 4, x + 3 y + v = 6: 3 x + 5 y is largest, 14, at (3, 1)."""
    one, zero = fmpq(1), fmpq(0)
    program = RationalProgram.of([[one, one, one, zero], [one, fmpq(3), zero, one]], [fmpq(4), fmpq(6)])
    assert program.feasible
    assert program.maximise([fmpq(3), fmpq(5), zero, zero])
    assert program.x == [3, 1, 0, 0]
    assert not RationalProgram.of([[one, one]], [fmpq(-1)]).feasible
    half = RationalProgram.of([[one, one]], [fmpq(1, 2)])
    assert half.feasible
    assert half.maximise([one, zero])
    assert half.x == [fmpq(1, 2), 0]
    endless = RationalProgram.of([[one, -one], [fmpq(2), fmpq(-2)]], [zero, zero])  # a row that says nothing new
    assert endless.feasible
    assert not endless.maximise([one, zero])


def test_states_that_break_a_law_are_refused() -> None:
    w, zero = [fmpq(0), fmpq(-2), fmpq(0)], fmpq(0)
    still = ((fmpq(1), zero), (fmpq(1), zero))
    assert PlanarState((zero, fmpq(-1), zero), still).solves(TABLE, w)
    assert not PlanarState((zero, fmpq(-2), zero), still).solves(TABLE, w)  # springs press twice as much
    assert not PlanarState((fmpq(1), fmpq(-1), zero), still).solves(TABLE, w)  # slides without friction
    pulled = ((fmpq(1), fmpq(1, 2)), (fmpq(1), fmpq(-1, 2)))
    assert PlanarState((zero, fmpq(-1), zero), pulled).solves(TABLE, w)
    assert not PlanarState((fmpq(1), fmpq(-1), zero), pulled).solves(TABLE, w)  # friction along one of the motions
    beyond = ((fmpq(1), fmpq(3, 4)), (fmpq(1), fmpq(-3, 4)))
    assert not PlanarState((zero, fmpq(-1), zero), beyond).solves(TABLE, w)
    assert not PlanarState((zero, fmpq(-1), zero), still).solves(TABLE, [zero, fmpq(-3), zero])


def test_what_is_not_planar_or_may_move_is_refused() -> None:
    flat = [Contact([0, -1, 0], [0, 1, 0], 0.5)]
    assert len(PlanarGrasp.of(Grasp(flat)).contacts) == 1
    joint = GraspJoint("lift", [0, 1, 0], [0, 0, 0], (0,), "prismatic")
    assert len(PlanarGrasp.of(Grasp(flat, [joint])).contacts) == 1  # locked
    with pytest.raises(InputError, match=r"joints.*may move"):
        PlanarGrasp.of(Grasp(flat, [joint], preload={"lift": 1.0}))
    one, two, no = np.eye(1), np.eye(2), np.zeros((0, 1))
    turns = Mechanism(("lift",), one, no, (False,), (True,))
    pulls = Mechanism(("lift",), one, no, (True,))
    for mechanism in (turns, pulls, Mechanism((), no, no, ())):  # one that turns back, one that may go slack, none
        with pytest.raises(InputError, match=r"joints.*may move"):
            PlanarGrasp.of(Grasp(flat, [joint], mechanism))
    tied = Mechanism(("lift",), two[:1], np.array([[1.0, -1.0]]), (False,))
    also = GraspJoint("lift too", [0, 1, 0], [0, 0, 0], (0,), "prismatic")
    assert len(PlanarGrasp.of(Grasp(flat, [joint, also], tied)).contacts) == 1  # locked by its coupling
    with pytest.raises(InputError, match=r"contacts\[0\].*not in the plane"):
        PlanarGrasp.of(load_grasp("fig1"))
    for position, normal in (([0, -1, 1e-3], [0, 1, 0]), ([0, -1, 0], [0, 0.6, 0.8])):
        with pytest.raises(InputError, match=r"contacts\[1\].*not in the plane"):
            PlanarGrasp.of(Grasp([*flat, Contact(position, normal, 0.5)]))
    with pytest.raises(InputError, match="unit vector"):
        PlanarContact([0, 0], [1, 1], 0.5)
    with pytest.raises(InputError, match="friction"):
        PlanarContact([0, 0], [1, 0], -0.5)
    with pytest.raises(InputError, match="at least one contact"):
        PlanarGrasp([])
