"""Exact states: planted right and wrong ones for each equation and law, and families over twenty orders."""

from collections.abc import Iterator
from dataclasses import fields, replace
from decimal import Decimal, localcontext
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import ctx

from benchmarks.exact_states import FAMILIES, drawn
from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs import existence, states
from handfast.proofs.balls import Balls, refined
from handfast.proofs.existence import (
    MODE_TRIES,
    REQUIRED_SLACK,
    Proved,
    _inside,
    exactly,
    inequalities,
    nearby,
    polished,
    prove,
    row_name,
    slacks,
)
from handfast.proofs.grasp import StartData
from handfast.proofs.near import Near
from handfast.proofs.newton import BITS, Box, NotShown, System
from handfast.proofs.question import read_question
from handfast.proofs.states import ContactMode as Contact_
from handfast.proofs.states import Modes, Part, Problem, State, choices, modes_of
from handfast.proofs.tolerance import EPS, MIN_FORCE_SCALE, TOO_SMALL, load_scale
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.studies.questions import check, maximum
from tests.support.every_law import every_law
from tests.support.exact_states import data, moved, problem
from tests.support.law_grasps import DOWN, jaw

HALF = 0.5  # of the largest magnitude


def nothing(done):
    """Is a state refused, exactly and with the slack?"""
    assert not done.exact
    assert not done.tolerant


def held(grasp, load, **options):
    """Problem and state of a check that holds."""
    answer = check(grasp, load, **options)
    assert answer.witness is not None
    limits = options.pop("limits", GraspLimits())
    most = np.inf if limits.force_limit is None else limits.force_limit
    asked = {"eta": limits.eta, "limits": limits.torque_limits, "force_limit": most} | options
    return problem(grasp, load, **asked), answer.witness.state


def of_family(family, k=0):
    """Grasp, load and options of the first random grasp of a family that resists anything, at half of its maximum."""
    place = FAMILIES.index(family) + len(FAMILIES) * k
    _, grasp, direction, options = drawn(place, 4_200_000)
    most = maximum(grasp, direction, **options)
    load = options.get("base", np.zeros(6)) + HALF * most.lower * direction
    rest = {key: value for key, value in options.items() if key != "base"}
    if not most.lower > 0 or check(grasp, load, **rest).witness is None:
        return of_family(family, k + 1)
    return grasp, load, rest


@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "no dissipation"])
def test_half_of_the_largest_load_holds_exactly(family):
    p, x = held(*(got := of_family(family))[:2], **got[2])
    done = prove(p, x)
    assert done.exact, done.reason
    assert done.residual < EPS
    assert done.radius < 1e-6 * max(p.scale, np.abs(x.c).max())


def test_the_lower_bound_of_a_maximum_is_proved_with_the_magnitude_among_the_unknowns():
    grasp = load_grasp(bundled.resolve("grasps", "fig9"))
    along = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    most = maximum(grasp, along)
    p = replace(problem(grasp, np.zeros(6)), along=along, magnitude=most.lower)
    done = prove(p, most.witness.state)
    assert done.exact, done.reason
    first, last = done.magnitude
    assert last - first < 1e-6 * most.lower
    assert abs(first - most.lower) < 1e-6 * most.lower
    below, better = nearby(p, most.witness.state, most.upper - most.lower)
    assert most.lower - below.magnitude <= (most.upper - most.lower) / 10 + 1e-9
    assert prove(below, better).exact


# --- planted: one number of a proved state is moved ---------------------------------------------------


def squeezed() -> tuple[Problem, State]:
    """A jaw that squeezes with 5 N, 1 N down: by hand, 5 N at both contacts, 0.5 N of friction each."""
    return held(jaw(None, {"hinge": 0.5}), [0.0, 0, -1, 0, 0, 0])


def test_the_squeeze_is_the_one_by_hand():
    p, x = squeezed()
    assert prove(p, x).exact
    assert x.c[0] == pytest.approx(5.0)
    assert x.c[3] == pytest.approx(5.0)
    assert np.hypot(x.c[1], x.c[2]) + np.hypot(x.c[4], x.c[5]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("name", "i", "words"),
    [
        ("c", 0, "contact 0: the force of the state that is proved"),
        ("c", 1, "contact"),
        ("f", 0, "actuator 'hinge': the force of the state"),
    ],
)
def test_forces_are_those_of_the_state_that_is_proved(name, i, words):
    p, x = squeezed()
    assert prove(p, moved(x, name, i, 1e-9)).exact
    wrong = prove(p, moved(x, name, i, 1e-3))
    nothing(wrong)
    assert words in wrong.reason


@pytest.mark.parametrize(
    "load", [[0, 0, -1 - 1e-4], [1e-4, 0, -1], [0, 1e-4, -1], [0, 0, -1, 1e-5], [0, 0, -1, 0, 1e-5]]
)
def test_another_load_is_refused(load):
    p, x = squeezed()
    wrench = np.concatenate([load, np.zeros(6 - len(load))])
    done = prove(replace(p, wrench=wrench), x)
    assert not done.exact
    assert not done.tolerant


@pytest.mark.parametrize("by", [1e-4, -1e-4])
def test_another_command_is_refused(by):
    p, x = squeezed()
    done = prove(replace(p, grasp=p.grasp.with_command(p.grasp.command + by)), x)
    nothing(done)
    assert "is not proved to carry its command" in done.reason or "from the printed one" in done.reason


def test_a_limit_is_kept():
    p, x = squeezed()
    assert prove(replace(p, torque_limit=np.array([0.5])), x).exact
    done = prove(replace(p, torque_limit=np.array([0.5 - 1e-9])), x)
    nothing(done)
    assert prove(replace(p, force_limit=5.1), x).exact
    done = prove(replace(p, force_limit=4.9), x)
    nothing(done)
    assert "keep the force limit" in done.reason


def altered(x: State, **arrays) -> State:
    return replace(x, **{name: np.array(value, dtype=float) for name, value in arrays.items()})


def test_a_contact_that_pulls_is_refused():
    grasp = Grasp([Contact([0, 0, 0.01], [0, 0, -1], 0.5), Contact([0, 0, -0.01], [0, 0, 1], 0.5)])
    p = problem(grasp, [0, 0, -1.0])
    zeros = {f.name: np.zeros(0) for f in fields(State)} | {"torsion": np.zeros(2)}
    right = State(**zeros | {"r": np.array([0, 0, -1.0, 0, 0, 0]), "c": np.array([0, 0, 0, 1.0, 0, 0])})
    done = prove(p, right)
    assert done.tolerant or done.exact, done.reason
    pulls = altered(right, r=[0, 0, 1.0, 0, 0, 0], c=[-1.0, 0, 0, 0, 0, 0])
    done = prove(p, pulls)
    nothing(done)


def sliding(mu: float = 0.5) -> tuple[Problem, State]:
    """A body on three contacts below it that is pushed sideways beyond friction into a wall: by hand all slide."""
    floor = [Contact([x, y, 0], [0, 0, 1], mu) for x, y in ((0.05, 0.0), (-0.03, 0.04), (-0.03, -0.04))]
    walls = [Contact([0.06, y, 0.01], [-1, 0, 0], mu) for y in (0.02, -0.02)]
    return held(Grasp([*floor, *walls]), [8.0, 0.3, -9.0, 0, 0, 0])


def test_friction_in_the_wrong_sense_is_refused():
    p, x = sliding()
    assert prove(p, x).exact
    d = (p.grasp.rows[0] @ x.motion)[: 3 * p.grasp.m].reshape(-1, 3)
    c = x.c.reshape(-1, 3)
    slides = np.flatnonzero((c[:, 0] > 1e-6) & (np.linalg.norm(d[:, 1:], axis=1) > 1e-6))
    assert len(slides)
    for turn in (-1.0, 1 - 1e-4):
        wrong = c.copy()
        wrong[slides[0], 1:] *= turn
        done = prove(p, altered(x, c=wrong.ravel()))
        assert not done.exact
        assert f"contact {slides[0]}" in done.reason
    # in balance with the load, too: less friction than the law demands is no state
    load = p.wrench.copy()
    wrong = c.copy()
    wrong[slides[0], 1:] *= 0.9
    load[:6] -= p.grasp.G @ (wrong - c).ravel()
    done = prove(replace(p, wrench=load), altered(x, c=wrong.ravel()))
    nothing(done)


def test_torsion_belongs_to_soft_fingers_and_has_the_sense_that_the_turning_gives():
    grasp, load, options = of_family("soft fingers", 1)
    p, x = held(grasp, load, **options)
    assert prove(p, x).exact
    soft = p.grasp.soft[np.argmax(np.abs(x.torsion[p.grasp.soft]))]
    assert x.torsion[soft] != 0
    done = prove(p, altered(x, torsion=np.where(np.arange(p.grasp.m) == soft, -x.torsion, x.torsion)))
    assert not done.exact
    assert not done.tolerant


def test_a_coupling_ties_its_joints():
    grasp, load, options = of_family("coupling")
    p, x = held(grasp, load, **options)
    assert prove(p, x).exact
    A = p.grasp.A.copy()
    A[0, -1] *= 2.0
    other = replace(p.grasp, A=A)
    done = prove(replace(p, grasp=other), x)
    nothing(done)


def test_nothing_moves_into_a_stop():
    grasp = jaw(None, {"hinge": 0.5})
    p, x = held(grasp, [0.0, 0, -1, 0, 0, 0])
    assert abs(x.q[0]) > 0
    stopped = replace(p.grasp, stop=np.array([2 if x.q[0] > 0 else 1]))
    done = prove(replace(p, grasp=stopped), x)
    nothing(done)
    free = replace(p.grasp, stop=np.array([1 if x.q[0] > 0 else 2]))
    assert prove(replace(p, grasp=free), x).exact


@pytest.mark.parametrize("reaction", [0.05, -0.2, 0.0])
def test_friction_of_a_joint_that_moves_is_all_that_it_can_take(reaction):
    p, x = held(jaw(None, {"hinge": 0.5}, friction=0.1), DOWN)
    assert prove(p, x).exact
    assert x.reaction[0] == pytest.approx(-0.1 * np.sign(x.q[0]))
    done = prove(p, altered(x, reaction=[reaction], f=x.f - (reaction - x.reaction)))
    nothing(done)


def test_a_tendon_does_not_push():
    mechanism = Mechanism(("tendon",), np.eye(1), np.zeros((0, 1)), (True,))
    p, x = held(jaw(mechanism, {"tendon": 0.5}), DOWN)
    assert prove(p, x).exact
    wrong = prove(replace(p, grasp=p.grasp.with_command(np.zeros(1))), altered(x, c=-x.c, f=-x.f, r=-x.r, q=-x.q))
    nothing(wrong)
    # its own load turned with it: all is balanced, but the tendon and the contacts push and pull the wrong way
    wrong = prove(
        replace(p, grasp=p.grasp.with_command(np.zeros(1)), wrench=-p.wrench),
        altered(x, c=-x.c, f=-x.f, r=-x.r, q=-x.q),
    )
    nothing(wrong)


# --- families -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("exponent", range(-16, 0))
def test_a_squeeze_without_friction_does_not_carry_a_load_across(exponent):
    angle = 10.0**exponent
    normals = [[np.cos(angle), np.sin(angle), 0], [-np.cos(angle), np.sin(angle), 0]]
    grasp = Grasp([Contact([-0.02, 0, 0], normals[0], 0.0), Contact([0.02, 0, 0], normals[1], 0.0)])
    across = np.sin(angle)
    for load, force in (([0, 1.0, 0], 1e12), ([0, 0, 1.0], 1e12), ([0, 1.0, 0], 0.5 / across)):
        x = State(
            r=np.array([0, -force / across, 0, 0, 0, 0]),
            c=np.array([force, 0, 0, force, 0, 0]),
            torsion=np.zeros(2),
            **{name: np.zeros(0) for name in ("q", "f", "coupling", "reaction")},
        )
        done = prove(problem(grasp, load), x)
        nothing(done)
    # down into the groove it is a state, however narrow: N = 1 / (2 sin angle), r_y = -N / sin angle
    force = 0.5 / across
    x = altered(x, r=[0, -force / across, 0, 0, 0, 0], c=[force, 0, 0, force, 0, 0])
    done = prove(problem(grasp, [0, -1.0, 0]), x)
    assert done.exact, done.reason


def pivot(offset: float) -> tuple[Grasp, np.ndarray]:
    """A body on three contacts, pushed against two fingers on swivels whose axes pass their tips at an offset."""
    floor = [Contact([x, y, 0], [0, 0, 1], 0.0) for x, y in ((0.0, 0.0), (-0.03, 0.04), (-0.03, -0.04))]
    tips = [Contact([0.02, y, 0.0], [-1, 0, 0], 0.5) for y in (0.0, 0.01)]
    swivels = [GraspJoint("a", [0, 0, 1], [0.02, offset, 0], (3,)), GraspJoint("b", [0, 0, 1], [0.05, 0.01, 0], (4,))]
    motor = Mechanism(("b",), np.array([[0.0, 1.0]]), np.zeros((0, 2)), (False,))
    return Grasp([*floor, *tips], swivels, motor), np.array([1.0, 0, -3.0, 0, -0.06, -0.005])


@pytest.mark.parametrize("exponent", range(-20, 1))
def test_a_swivel_through_a_fingertip_passes_on_nothing(exponent):
    """By hand: 0.5 N at each tip, which the free swivel cannot have at any offset but 0."""
    offset = 10.0**exponent
    here, load = pivot(0.0)
    p, x = held(here, load)
    assert x.c[9] == pytest.approx(0.5)
    x = altered(x, q=[0.0, x.q[1]])  # at offset 0 it may turn at will
    assert prove(p, x).exact
    there = problem(pivot(offset)[0], load)
    done = prove(there, x)
    assert not done.exact
    missed = 0.5 * offset
    unit = EPS * load_scale(there.grasp, there.load) * there.grasp.size
    assert done.tolerant == (missed <= unit)


@pytest.mark.parametrize("exponent", range(-11, 12, 2))
def test_no_length_and_no_force_is_absolute(exponent):
    """Fig. 9 in other units of length and force has the same proofs."""
    grasp = load_grasp(bundled.resolve("grasps", "fig9"))
    load = np.array([0.0, 0.0, -0.5, 0.0, 0.0, 0.0])
    p, x = held(grasp, load)
    assert prove(p, x).exact
    a = 10.0**exponent
    for length, force in ((a, 1.0), (1.0, a), (a, a), (a, 1 / a)):
        g, unit = p.grasp, force * length
        scaled = replace(g, positions=length * g.positions, origins=length * g.origins, command=unit * g.command)
        wrench = force * np.concatenate([load[:3], length * load[3:]])
        turned = np.concatenate([[1.0, 1, 1], np.full(3, 1 / length)])
        other = altered(
            x, r=force * turned * x.r, q=force / length * x.q, c=force * x.c, f=unit * x.f, coupling=unit * x.coupling
        )
        done = prove(replace(p, grasp=scaled, wrench=wrench), other)
        assert done.exact, (length, force, done.reason)
        assert scaled.size == pytest.approx(length * g.size)
        np.testing.assert_allclose(scaled.joint_arms, length * g.joint_arms, rtol=1e-9)
        modes = MODE_TRIES if force == 1.0 else 2  # all that are tried otherwise, or the likeliest
        wrong = prove(replace(p, grasp=scaled, wrench=1.001 * wrench), other, tries=modes)
        nothing(wrong)


def test_large_motions_beside_small_forces_are_proved_with_more_digits():
    """A tendon that lets a wedge in: motions of 1e9 N beside 1 N."""
    angle = 1e-9
    normals = [[np.cos(angle), np.sin(angle), 0], [-np.cos(angle), np.sin(angle), 0]]
    grasp = Grasp([Contact([-0.02, 0, 0], normals[0], 0.0), Contact([0.02, 0, 0], normals[1], 0.0)])
    force = 0.5 / np.sin(angle)
    zeros = {name: np.zeros(0) for name in ("q", "f", "coupling", "reaction")}
    x = State(r=np.array([0, -force / angle, 0, 0, 0, 0]), c=np.array([force, 0, 0] * 2), torsion=np.zeros(2), **zeros)
    p, better = polished(problem(grasp, [0, -1.0, 0]), x)
    done = prove(p, better)
    assert done.exact, done.reason
    assert data(grasp).size == pytest.approx(0.02)


@pytest.mark.parametrize("family", [name for name in FAMILIES if name != "no dissipation"])
def test_boxes_in_floating_point_contain_the_solution_in_many_digits(family):
    p, x = held(*(got := of_family(family))[:2], **got[2])
    options = choices(p, x)
    modes = modes_of(p.grasp, {name: kinds[0] for name, kinds in options.items()})
    system = System.of(p, modes, x, False)
    wide, narrow = system.box(), refined(system)
    units = p.grasp.row_units
    for a, a_off, b, b_off, unit in (
        (wide.d, wide.d_off, narrow.d, narrow.d_off, units),
        (wide.phi, wide.phi_off, narrow.phi, narrow.phi_off, 1 / units),
    ):
        assert (np.abs(a - b) <= a_off + b_off).all()
        assert (b_off <= a_off * (1 + 1e-9) + 4e-16 * np.abs(b)).all()
        assert (a_off / unit).max() < 1e-3 * max(p.scale, np.abs(x.c).max())


@pytest.mark.parametrize("family", ["eta", "force limit", "coupling", "joint laws", "soft fingers"])
def test_boxes_about_floats_that_are_off_contain_the_solution(family: str) -> None:
    """What is off is that of all motions: the farthest of the solution is 1 / 1.2 of the way to the face of its box."""
    p, x = held(*(got := of_family(family))[:2], **got[2])
    modes, rng, nearest = likeliest(p, x), np.random.default_rng(0), []
    there = System.of(p, modes, x, False).box()
    for size in (1e-4, 1e-6, 1e-8):
        for _ in range(3):
            motion = x.motion + size * np.abs(x.motion).max() * rng.choice([-1, 0, 1], size=len(x.motion))
            try:
                box = System.of(p, modes, State.of(p.grasp, motion, x.forces(p.grasp)), False).box()
            except NotShown:
                continue
            for name in ("v", "d", "phi"):
                off = getattr(box, f"{name}_off") + getattr(there, f"{name}_off")
                away = np.abs(getattr(box, name) - getattr(there, name))
                assert (away <= off).all(), (name, size)
                nearest.append(np.max(away / np.where(off > 0, off, 1.0)))
    assert max(nearest) > 0.8


@pytest.mark.parametrize("eta", [0.0, 0.2])
def test_derivatives_in_balls_are_those_in_floats(eta: float) -> None:
    """Contacts that slide and turn, one at its limit: what Newton's test rests on, entry by entry."""
    places, soft = [[0.05, 0, 0.01], [-0.04, 0.02, 0], [0, -0.05, -0.02], [0.01, 0.03, 0.05]], eta == 0
    contacts = []
    for k, place in enumerate(places):
        n = -np.array(place) + 0.01 * np.arange(3)
        contacts.append({"position": place, "normal": (n / np.linalg.norm(n)).tolist(), "friction": 0.3 + 0.1 * k})
        contacts[-1] |= {"torsion": 0.002} if soft and k < 2 else {}
    joint = {"name": "a", "axis": [0, 0, 1], "origin": [0.1, 0, 0], "moves": [0, 2]}
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts, "joints": [joint]}
    asked = {"grasp": grasp, "goal": "check", "wrench": [1.0, 0, 0, 0, 0, 0], "eta": eta, "force_limit": 2.0}
    q = read_question(asked, "")
    p, g = Problem.of(q, q.grasp.command, q.wrench, np.array([0.5, -1, 2, 0.1, 0, 0.3]), 0.25), q.grasp
    modes = Modes(
        np.full(4, states.ContactMode.SLIDES), np.arange(4) == 0, np.full(1, Part.LOCKED), np.full(1, Part.FREE)
    )
    none = np.zeros(1)
    x = State(np.array([0.3, -0.2, 0.5, 2.0, -3.0, 1.0]), none, np.ones(12), none, np.zeros(0), none, np.zeros(4))
    system = System.of(p, modes, x, True)
    with ctx.workprec(BITS):
        balls = Balls(system)
        derivative = balls.derivative(balls.at(balls.start)[2])
    assert derivative.nrows() == len(system.value) == 6 + g.l + 1 + 1  # balance, the locked joint, the limit
    floats = [[float(y.mid()) for y in row] for row in derivative.table()]
    np.testing.assert_allclose(floats, system.A, rtol=1e-10, atol=1e-10 * np.abs(system.A).max())
    assert system.linear.tolist() == [False] * 7 + [True, False]  # all contacts slide: nothing else is linear
    still = replace(modes, contact=np.full(4, states.ContactMode.STICKS))
    system = System.of(p, still, x, True)
    exact = np.array(system.exact, dtype=object).astype(float)
    np.testing.assert_allclose(exact[:, :-1], system.A, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(exact[:, -1], system.value, rtol=1e-12, atol=1e-12)


def likeliest(p: Problem, x: State) -> Modes:
    return modes_of(p.grasp, {name: kinds[0] for name, kinds in choices(p, x).items()})


def boxes(p: Problem, x: State, modes: list[Modes]) -> Iterator[tuple[Modes, Box, Box]]:
    """Modes, boxes of three sizes about x, and 200 points in each, most of them near its faces."""
    g, none, rng = p.grasp, np.zeros(len(p.grasp.rows[0])), np.random.default_rng(5)
    d, phi = g.rows[0] @ x.motion, x.forces(g)
    for wide in (1e-6, 1e-3, 0.3):
        d_off, phi_off = wide * (np.abs(d) + p.scale * g.row_units), wide * (np.abs(phi) + p.scale)
        d_off[-1] = phi_off[-1] = 0.0
        away = rng.choice([-0.999, -0.5, 0.999], size=(2, 200, len(d)))
        for tried in modes:
            given = ~states.Rows.of(p, tried).unknown
            given[: g.parts[2].start] = False  # forces of contacts follow from motions
            own_off = np.where(given, 0.0, phi_off)
            points = Box(x.motion, none, d + away[0] * d_off, none, phi + away[1] * own_off, none)
            yield tried, Box(x.motion, none, d, d_off, phi, own_off), points


@pytest.mark.parametrize("family", FAMILIES)
def test_inequalities_are_kept_by_as_much_all_over_a_box(family):
    """At any point of a box they are kept by no less than is said of the box; all kinds of modes, whatever they are."""
    p, x = held(*(got := of_family(family))[:2], **got[2])
    g = p.grasp
    p = replace(p, torque_limit=np.abs(x.f) + 1.0, force_limit=np.abs(x.c).max() + 1.0)
    modes = likeliest(p, x)
    every = [replace(modes, contact=np.full(g.m, k), joint=np.full(g.l, k)) for k in range(6)]
    for tried, box, points in boxes(p, x, every):
        both = zip(slacks(p, tried, box), slacks(p, tried, points), strict=True)
        for (name, what, least, applies), (_, _, values, _) in both:
            assert (least <= values)[..., applies].all(), (name, what)


def started(eta: float) -> tuple[Problem, State]:
    """A step before which two joints left their stops, a tendon went slack, one contact pressed and two were open.

    The state solves nothing. One contact is a soft finger where normals are certain.
    """
    contacts = [
        Contact([-0.01, 0, 0], [1, 0, 0], 0.5, torsion=0.0 if eta else 0.002),
        Contact([0.01, 0, 0], [-1, 0, 0], 0.5),
        Contact([0, 0.01, 0], [0, -1, 0], 0.3),
    ]
    joints = [
        GraspJoint("low", [0, -1, 0], [0.01, 0, -0.1], (1,), stop="lower", friction=0.1),
        GraspJoint("high", [0, 0, 1], [-0.08, 0, 0], (0,), stop="upper", friction=0.05),
        GraspJoint("last", [1, 0, 0], [0, 0.01, -0.05], (2,)),
    ]
    mechanism = Mechanism(("motor", "tendon"), np.array([[1.0, 1, 0], [0, 0, 1]]), np.zeros((0, 3)), (False, True))
    p = problem(Grasp(contacts, joints, mechanism, {"motor": 0.3}), [0.2, 0, -1.0], eta=eta, force_limit=3.0)
    start = StartData(np.array([0.3, -0.7, 0.2]), np.array([4.0, 6.0, 0.0]), np.array([0.0, 5.0]))
    p = replace(p, grasp=p.grasp.with_start(start), torque_limit=np.array([0.5, np.inf]))
    rng = np.random.default_rng(6)
    forces, reaction, torsion = rng.normal(size=9), np.array([0.15, -0.2, 0.0]), np.array([0.0 if eta else 1e-3, 0, 0])
    at = State(rng.normal(size=6), rng.normal(size=3), forces, np.array([0.4, 0.1]), np.zeros(0), reaction, torsion)
    return p, at


@pytest.mark.parametrize("eta", [0.0, 0.2])
def test_inequalities_of_a_step_from_a_state_are_kept_by_as_much_all_over_a_box(eta: float) -> None:
    """As above, but each inequality at the points is written down anew, with what was there before the step."""
    p, x = started(eta)
    g, ends = p.grasp, states.reaction_ends(p.grasp)
    _, _, of_actuators, _, of_joints = g.parts
    kinds = [Part.RESTS, Part.LOW, Part.HIGH, Part.MOVES, Part.OPENS, Part.FREE, Part.BACK]
    every = [
        Modes(np.full(g.m, k), np.zeros(g.m, dtype=bool), np.full(g.a, a), np.full(g.l, j))
        for k in range(6)
        for a in (Part.MOVES, Part.RESTS)
        for j in kinds
    ]
    arm_a, arm_j = g.row_units[of_actuators], g.row_units[of_joints]
    seen, wrong = set(), set()
    for tried, box, points in boxes(p, x, every):
        d, c = points.d[:, g.contact_rows], points.phi[:, g.contact_rows]
        f, t = points.phi[:, of_actuators], points.d[:, of_actuators]
        rho, q = points.phi[:, of_joints], points.d[:, of_joints]
        slides, rubs = (np.sqrt((y[..., 1:] ** 2).sum(axis=-1)) for y in (d, c))
        true = {
            "to be open": np.array([0.3, -0.7, 0.2]) + np.cos(eta) * d[..., 0] + np.sin(eta) * slides,
            "to press": c[..., 0],
            "to be inside its friction cone": g.mu * c[..., 0] - rubs,
            "to keep the force limit": 3.0 - c[..., 0],
            "to carry its command": (f - [0.3, 0.0]) * arm_a,
            "to move in its sense": (t + np.array([0.0, 5.0])) / arm_a,
            "to keep its limit": ([0.5, np.inf] - np.abs(f)) * arm_a,
            "to carry its reaction": np.minimum(rho - ends[0], ends[1] - rho) * arm_j,
            "to close": q / arm_j,
            "to open": -q / arm_j,
            "to stay off its stop": (np.array([4.0, 6.0, np.inf]) + [1, -1, 0] * q) / arm_j,
            "to lean on its stop": ([1, -1, 0] * rho - [0.1, 0.05, 0.0]) * arm_j,
        }
        for _, fault, least, applies in slacks(p, tried, box):
            what = fault.removeprefix("is not proved ")
            if what == "to stay off its stop":
                assert applies.tolist() == [tried.joint[0] != Part.BACK] * 2 + [False]
            some = applies & (g.stops_left != 0) if what == "to lean on its stop" else applies
            seen |= {what} if some.any() else set()
            wrong |= {what} if (least > true[what] + 1e-12)[:, some].any() else set()
    assert seen == set(true)
    assert not wrong


decimal = np.vectorize(Decimal, otypes=[object])


@pytest.mark.parametrize("eta", [0.0, 0.2])
@pytest.mark.parametrize(
    "what", ["open", "friction", "limit", "command", "sense", "torque", "reaction", "stop", "leans"]
)
def test_what_is_only_kept_by_rounding_is_not_kept(what: str, eta: float) -> None:
    """At 300 points a few roundings from where an inequality ends, against 60 digits; in a step, without radii."""
    p, _ = started(eta)
    g, rng = p.grasp, np.random.default_rng(7)
    _, _, actuators, _, joints = g.parts
    n, (normal, across) = len(g.rows[0]), (g.contact_rows[:, 0], g.contact_rows[:, 1:])
    d, phi = rng.normal(size=(2, 300, n)) * 10.0 ** rng.integers(-2, 3, size=(2, 300, n))
    d[..., -1] = phi[..., -1] = 0.0
    arm_a, arm_j, ends = g.row_units[actuators], g.row_units[joints], states.reaction_ends(g)
    side, way = np.array([1.0, -1.0, 0.0]), np.abs(g.stops_left)
    slides, rubs = (np.sqrt((x[:, across] ** 2).sum(axis=-1)) for x in (d, phi))

    def near(x: Array) -> Array:
        steps = rng.integers(-6, 7, size=(300, len(x.T))) * rng.choice([1, 20], size=(300, 1))
        return x * (1 + steps * 2.0**-53)

    if what == "open":
        d[:, normal] = near(-(g.gaps + p.sin * slides) / p.cos)
    elif what in ("friction", "limit"):
        phi[:, normal] = near(rubs / g.mu if what == "friction" else np.full(3, p.force_limit))
    elif what in ("command", "torque"):
        phi[:, actuators] = near(p.command if what == "command" else np.array([0.5, 1.0]))
    elif what == "sense":
        d[:, actuators] = near(-g.slack)
    elif what in ("reaction", "leans"):
        phi[:, joints] = near(np.where(side > 0, *(ends if what == "reaction" else (g.friction, -g.friction))))
    else:
        d[:, joints] = near(-side * way)
    D, C, T, F = (
        decimal(x) for x in (d[:, g.contact_rows], phi[:, g.contact_rows], d[:, actuators], phi[:, actuators])
    )
    rho, q = decimal(phi[:, joints]), decimal(d[:, joints])
    with localcontext(prec=60):
        slides, rubs = (np.vectorize(Decimal.sqrt, otypes=[object])((x[..., 1:] ** 2).sum(axis=-1)) for x in (D, C))
        fault, true = {
            "open": ("be open", decimal(g.gaps) + decimal(p.cos) * D[..., 0] + decimal(p.sin) * slides),
            "friction": ("be inside its friction cone", decimal(g.mu) * C[..., 0] - rubs),
            "limit": ("keep the force limit", decimal(p.force_limit) - C[..., 0]),
            "command": ("carry its command", (F - decimal(p.command)) * decimal(arm_a)),
            "sense": ("move in its sense", (T + decimal(g.slack)) / decimal(arm_a)),
            "torque": ("keep its limit", (decimal(p.limit) - np.abs(F)) * decimal(arm_a)),
            "reaction": (
                "carry its reaction",
                np.minimum(rho - decimal(ends[0]), decimal(ends[1]) - rho) * decimal(arm_j),
            ),
            "stop": ("stay off its stop", (decimal(side) * q + decimal(way)) / decimal(arm_j)),
            "leans": ("lean on its stop", (decimal(side) * rho - decimal(g.friction)) * decimal(arm_j)),
        }[what]
    none = np.zeros(n)
    modes = Modes(*(np.full(k, 0) for k in (g.m, g.m, g.a, g.l)))
    found = slacks(p, modes, Box(np.zeros(6 + g.l), np.zeros(6 + g.l), d, none, phi, none))
    (kept,) = (least >= 0 for _, words, least, _ in found if words == f"is not proved to {fault}")
    assert (true >= 0)[kept].all()
    assert kept.any()
    assert (true < 0).any()


@pytest.mark.parametrize("family", ["soft fingers", "plain", "prismatic"])
def test_a_state_at_the_edge_of_its_modes_is_moved_inside(family):
    """Friction takes all that it may at one contact that sticks, or 1e-9 N more: others can take some of it."""
    p, x = held(*(got := of_family(family))[:2], **got[2])
    modes = likeliest(p, x)
    rubs = np.isin(modes.contact, (states.ContactMode.STICKS, states.ContactMode.RUBS))
    twist = np.divide(x.torsion, p.grasp.lever, out=np.zeros(p.grasp.m), where=p.grasp.lever > 0)
    friction = np.sqrt((x.c.reshape(-1, 3)[:, 1:] ** 2).sum(axis=1) + twist**2)
    i = int(np.flatnonzero(rubs & (friction > 0))[0])
    mu = p.grasp.mu.copy()
    mu[i] = friction[i] / x.c[3 * i]
    edge = replace(p, grasp=replace(p.grasp, mu=mu))

    def kept(y: State) -> float:
        none = np.zeros(len(p.grasp.rows[0]))
        box = Box(y.motion, none, edge.grasp.rows[0] @ y.motion, none, y.forces(edge.grasp), none)
        return float(slacks(edge, modes, box)[2][2][i])

    system = System.of(edge, modes, x, False)
    assert kept(x) < 1e-12
    assert kept(_inside(system)) > 0.5 * REQUIRED_SLACK * p.scale


def test_by_how_much_every_inequality_is_kept_by_hand():
    """All over a box whose radii are 0.1 for motions at contacts, along and across; else a few parts. In a step."""
    p = replace(every_law((1.0, 0, 0), 0.4, 0.25, force_limit=10.0), cos=0.8, sin=0.6)
    d, phi = np.zeros(17), np.zeros(17)
    d_off, phi_off = np.full(17, 0.05), np.full(17, 0.02)
    d[:3], d_off[:3] = (2, 3, 4), (0.1, 0.06, 0.08)
    phi[3:6], phi_off[3:6] = (4, 0.3, 0.4), (0.01, 0.006, 0.008)
    phi[6:9] = 10.0, -3.0, -4.0
    d[9:11], phi[9:11] = (-0.7, 0.5), (-4.0, 0.0)
    d[12:14], phi[12:14] = (0.3, -0.3), (0.3, 0.9)
    d_off[16] = phi_off[16] = 0.0
    kinds = np.array([Contact_.OPEN, Contact_.STICKS, Contact_.SLIDES])
    modes = Modes(
        kinds, np.array([False, False, True]), np.array([Part.RESTS, Part.MOVES]), np.zeros(4, dtype=np.int64)
    )
    modes.joint[:] = Part.RESTS, Part.BACK, Part.FREE, Part.LOCKED
    box = Box(np.zeros(10), np.zeros(10), d, d_off, phi, phi_off)
    found = {(name, fault.removeprefix("is not proved to ")): (x, on) for name, fault, x, on in slacks(p, modes, box)}

    def kept(name, fault, k, value, applies):
        x, on = found.pop((name, fault))
        assert x[k] == pytest.approx(value, abs=1e-12), fault
        assert on.tolist() == [bool(b) for b in applies], fault

    slides = 5 - 0.1
    kept("contact {}", "be open", 0, 1 + 0.8 * (2 - 0.1) + 0.6 * slides, (1, 0, 0))
    kept("contact {}", "press", 1, 4 - 0.01, (0, 1, 1))
    kept("contact {}", "be inside its friction cone", 1, 0.5 * 3.99 - 0.5 - 0.01, (0, 1, 0))
    kept("contact {}", "keep the force limit", 1, 10 - 4 - 0.01, (0, 1, 0))  # the third is at the limit
    kept("actuator {}", "carry its command", 0, (4 - 3 - 0.02) * 4, (1, 1))  # 1 N more, of 4 N at the contacts
    kept("actuator {}", "move in its sense", 1, 0.5 + 0.25 - 0.05, (0, 1))  # it was 0.25 slack
    kept("actuator {}", "keep its limit", 0, (6 - 4 - 0.02) * 4, (1, 0))
    kept("joint {}", "carry its reaction", 0, 0.5 - 0.3 - 0.02, (1, 0, 0, 0))
    kept("joint {}", "close", 0, 0.3 - 0.05, (0, 0, 0, 0))
    kept("joint {}", "open", 1, (0.3 - 0.05) / 0.5, (0, 0, 0, 0))
    kept("joint {}", "stay off its stop", 1, (0.4 - 0.3 - 0.05) / 0.5, (0, 0, 0, 0))
    kept("joint {}", "lean on its stop", 1, (0.9 - 0.5 - 0.02) * 0.5, (0, 1, 0, 0))
    assert not found
    still = replace(
        box, d=np.where(np.arange(17) < 3, [2.0] + [0.0] * 16, d)
    )  # what may not slide opens by nothing more
    gap = next(x for _, fault, x, _ in slacks(p, modes, still) if "open" in fault)
    assert gap[0] == pytest.approx(1 + 0.8 * (2 - 0.1))
    turns = next(x for _, fault, x, _ in slacks(p, modes, box) if "in its sense" in fault)
    assert turns[0] == pytest.approx((0.7 - 0.05) / 4)  # of the motor, which closes backwards
    # forces that are given, by commands, limits and laws, are so exactly
    phi[9], phi[12], phi_off[9], phi_off[12] = -6.0, -0.5, 0.0, 0.0
    modes.joint[:2] = Part.MOVES, Part.OPENS
    again = {fault: (x, on) for _, fault, x, on in slacks(p, modes, box)}
    assert again["is not proved to keep its limit"][0][0] == 0
    assert again["is not proved to carry its reaction"][0][0] == 0
    assert again["is not proved to close"][1].tolist() == [True, False, False, False]
    assert again["is not proved to open"][1].tolist() == [False, True, False, False]
    assert again["is not proved to stay off its stop"][1].tolist() == [False, True, False, False]

    def beyond(box: Box) -> float:
        return float({fault: x for _, fault, x, _ in slacks(p, modes, box)}["is not proved to carry its command"][0])

    phi[9] = -3.0  # its command: given, or the middle of what it may be
    assert beyond(box) == 0
    phi_off[9] = 0.02
    assert beyond(box) == pytest.approx(-0.02 * 4)
    assert beyond(replace(box, carried=np.array([1e-20, 0.0]))) == 4e-20  # more digits tell


ONE_FINGER = [[0, 0, 0], [0, 0.05, 0], [0, -0.05, 0.05]]


def pushed(load: float, **of_hand: Any) -> tuple[Problem, State]:
    """A slide pushes an object along x at three contacts without friction; a load at the first pushes back.

    What is said: the motor carries what is asked of it, the command or 0, and the other contacts are open.
    """
    contacts = [{"position": p, "normal": [1, 0, 0], "friction": 0, "link": "a"} for p in ONE_FINGER]
    slide = {"name": "j", "axis": [1, 0, 0], "origin": [0, 0, 0], "moves": [0, 1, 2], "type": "prismatic"}
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts, "joints": [slide | of_hand.pop("joint", {})]} | of_hand
    q = read_question({"grasp": grasp, "goal": "check", "wrench": [-load, 0, 0, 0, 0, 0]}, "q")
    forces = np.array([load] + [0.0] * 8), q.grasp.command.copy()
    x = State(np.array([-load, 0, 0, 0, 40, -20]), np.zeros(1), *forces, np.zeros(0), np.zeros(1), np.zeros(3))
    return Problem.of(q, q.grasp.command, q.wrench), x


@pytest.mark.parametrize("short", [1e-8, 9e-7, -1e-8, -9e-7])
def test_a_motor_carries_its_command_and_not_nearly(short: float) -> None:
    """Of 1 N: under a load that is a millionth less its worm goes on, though a file says that it carries 1 N."""
    p, x = pushed(1.0 - short, preload={"j": 1.0})
    found = prove(p, x)
    assert (found.exact, found.tolerant) == (short < 0, False)


@pytest.mark.parametrize("short", [1e-8, 9e-7, -1e-8, -9e-7])
def test_a_tendon_that_nobody_pulls_pushes_not_even_a_little(short: float) -> None:
    """Beside a spring of 1 N."""
    tendon = {"actuators": [{"name": "T", "joints": {"j": 1.0}, "tendon": True}], "couplings": []}
    p, x = pushed(1.0 - short, joint={"torque": 1.0}, mechanism=tendon)
    found = prove(p, x)
    assert (found.exact, found.tolerant) == (short < 0, False)


@pytest.mark.parametrize(
    ("part", "row", "value", "said", "name"),
    [
        ("phi", 3, 0.5, "contact 1 is not proved to be inside its friction cone: -2.50e-01 N", "contact 1"),
        ("phi", 9, -2.9, "actuator 'motor' is not proved to carry its command: -4.00e-01 N", "actuator 0"),
        ("phi", 9, -6.1, "actuator 'motor' is not proved to keep its limit: -4.00e-01 N", "actuator 0"),
        ("d", 10, -1.0, "actuator 'tendon' is not proved to move in its sense: -7.50e-01 N", "actuator 1"),
        ("phi", 12, 0.6, "joint 'rubs' is not proved to carry its reaction: -1.00e-01 N", "joint 0"),
        ("phi", 13, 0.3, "joint 'stopped' is not proved to lean on its stop: -1.00e-01 N", "joint 1"),
    ],
)
def test_what_is_wrong_is_named(part, row, value, said, name):
    p = every_law((1.0, 0, 0), 0.4, 0.25, force_limit=10.0)
    at = {"d": np.zeros(17), "phi": np.zeros(17)}
    at["phi"][[3, 4, 6, 9, 10, 13]] = 4, 0.5, 2, -4, 0.3, 0.9
    kinds = np.array([Contact_.OPEN, Contact_.STICKS, Contact_.SLIDES])
    joints = np.array([Part.RESTS, Part.BACK, Part.FREE, Part.LOCKED])
    modes = Modes(kinds, np.zeros(3, dtype=bool), np.array([Part.RESTS, Part.MOVES]), joints)

    def box():
        return Box(np.zeros(10), np.zeros(10), at["d"], np.zeros(17), at["phi"], np.zeros(17))

    assert inequalities(p, modes, box()) == pytest.approx(0.2 / 4)  # "stopped" is 0.4 N m beyond its friction, at 2 m
    at[part][row] = value
    with pytest.raises(NotShown) as fault:
        inequalities(p, modes, box())
    assert (str(fault.value), fault.value.part, fault.value.rounding) == (said, name, False)


def test_what_is_missed_by_a_millionth_of_the_forces_may_be_rounding():
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)], [])
    modes = Modes(np.array([Contact_.STICKS]), np.zeros(1, dtype=bool), *(np.zeros(0, dtype=np.int64) for _ in "aj"))
    none = np.zeros(4)
    for missed, rounding in ((0.9e-6, True), (1.1e-6, False)):
        forces = 4.0 * np.array([1.0, 0.5 + missed, 0.0, 0.0])
        with pytest.raises(NotShown) as fault:
            inequalities(problem(grasp, [0, 0, -1.0]), modes, Box(np.zeros(6), np.zeros(6), none, none, forces, none))
        assert fault.value.rounding == rounding


def half_under_way(off: float = 0.0) -> tuple[Problem, State]:
    """A contact on which 1/2 N presses from the start, and 1/2 N as a magnitude; its motion is so much off."""
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], 0.0)], [])
    p = replace(problem(grasp, [0, 0, -0.5]), along=np.array([0, 0, -1.0, 0, 0, 0]), magnitude=0.5)
    none = np.zeros(0)
    r = np.array([0, 0, -1.0 + off, 0, 0, 0])
    return p, State(r, none, np.array([1.0, 0, 0]), none, none, none, np.zeros(1))


@pytest.mark.parametrize("off", [0.0, 1e-10])
def test_between_which_ends_a_magnitude_is(off):
    """Half of the force of 1 N is under way from the start: a magnitude of 1/2; or to 1e-9 of the load."""
    p, x = half_under_way(off)
    done = prove(p, x)
    assert done.exact
    assert done.reason == ""
    assert 0 <= done.residual < 1e-9
    low, high = done.magnitude
    assert low <= 0.5 <= high
    assert high - low < 1e-9
    assert done.reaches(low)
    assert not done.reaches(0.51)


def test_rows_have_names():
    p = every_law()
    names = [row_name(p, k) for k in (0, 5, 9, 10, 11, 12, 15)]
    assert names == [
        "contact 0", "contact 1", "actuator 'motor'", "actuator 'tendon'", "coupling 0", "joint 'rubs'", "joint 'both'",
    ]  # fmt: skip


TRIED = [(0.5, True), (0.5, True), (0.5 - 1e-5, False), (0.5 - 1e-3, False), (0.5 - 1e-2, False)]


@pytest.mark.parametrize(
    ("shown", "lower", "asked", "found"),
    [
        (0.0, 0.0, TRIED, None),  # none is proved: as it was
        (0.5, 0.0, TRIED[:1], 0.5),
        (0.499, 0.0, TRIED[:4], 0.499),
        (0.491, 0.009, [(0.491, True)], 0.491),  # where Newton's method leads
        (0.489, 0.011, TRIED[1:], None),  # by more than a tenth of 0.1
        (0.0, None, [], None),  # it fails
        (0.499, np.inf, TRIED[1:4], 0.499),  # with the magnitude as an unknown
    ],
)
def test_which_magnitudes_are_tried_near_one_that_is_not_shown(monkeypatch, shown, lower, asked, found):
    """As an unknown, after that and without; then less by up to a tenth of 0.1. (magnitude, is it an unknown?)"""
    p, x = half_under_way()
    tried = []

    def solved(p: Problem, y: State) -> tuple[Problem, State]:
        own = p.magnitude - lower if lower and p.along is not None else p.magnitude
        fails = lower is None or (lower == np.inf and p.along is not None)
        return (p, y) if fails else (replace(p, magnitude=own), replace(y))

    def proved(p: Problem, y: State) -> Proved:
        magnitude = -0.5 - p.wrench[2] if p.along is None else p.magnitude
        tried.append((pytest.approx(magnitude, abs=1e-12), p.along is not None))
        return Proved(abs(magnitude - shown) < 1e-9, False, "", 0.0)

    monkeypatch.setattr(existence, "polished", solved)
    monkeypatch.setattr(existence, "prove", proved)
    less, y = nearby(p, x, 0.1, thorough=lower is not None)
    assert asked == tried
    assert (y is x) == (found is None)
    assert less.magnitude == pytest.approx(found or 0.5, abs=1e-12)
    assert less.along is not None
    assert nearby(p, x, 0.1, until=-np.inf)[1] is x
    assert len(tried) == len(asked)


def test_a_direction_of_sliding_that_is_not_known_is_met_once_by_each_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three contacts that press by as good as nothing, and a load that none of them carries: all modes are tried."""
    contacts = [Contact([0.1 * k, 0, 0], [0, 0, 1], 0.5) for k in range(3)]
    p = problem(Grasp(contacts), [0, 0, 1.0, 0, 0, 0])
    tried, of = [], System.of

    def noted(p: Problem, modes: Modes, *rest: object) -> System:
        tried.append(modes.contact.tolist())
        return of(p, modes, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(System, "of", noted)
    x = State.of(p.grasp, np.array([0, 0, -1e-12, 0, 0, 0]), np.zeros(len(p.grasp.rows[0])))
    assert not prove(p, x).exact
    assert len(tried) > 6
    for k in range(3):
        assert sum(contact[k] == Contact_.SLIDES for contact in tried) == 1


# --- what is shown of a state where it is not proved exactly -------------------------------------------


MODES = Modes(*(np.zeros(k, dtype=np.int64) for k in (1, 1, 0, 0)))
SHOWN, MISSED, WORSE = (
    Near(missed, where, MODES, 2e-7, 3e-7, 2.5e-7, 4.0)
    for missed, where in ((0.5e-9, "(1)"), (2e-9, "(2)"), (3e-9, "(3)"))
)
EXACT = Proved(True, False, "", 0.0, 2e-7, 1.0, 0.5, (0.4, 0.6), MODES)
OPEN = Proved(False, False, "no", 0.75)


def decided(
    monkeypatch: pytest.MonkeyPatch, unknown: Proved, given: Proved, rough: Near, nearer: Near, p: Problem, **how: float
) -> tuple[Proved, list[str]]:
    """What `prove` makes of what is found with the magnitude as an unknown, and without; and what it asked."""
    asked, reach = [], how.get("within", 1e-6)  # of 1 N

    def attempts(p: Problem, x: State, tries: int, within: float, free: bool = False) -> Proved:
        assert within == pytest.approx(reach)
        asked.append(f"{'free' if free else 'fixed'} {tries}")
        return unknown if free else given

    def near(p: Problem, x: State) -> Near:
        asked.append("near")
        return rough

    def after_newton(p: Problem, x: State, modes: Modes) -> Near:
        asked.append("nearer")
        return nearer

    monkeypatch.setattr(existence, "_attempts", attempts)
    monkeypatch.setattr(existence, "near", near)
    monkeypatch.setattr(existence, "_nearer", after_newton)
    return prove(p, half_under_way()[1], **how), asked  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("free", "fixed", "how", "done", "asked"),
    [
        (EXACT, OPEN, {}, EXACT, ["free 16"]),
        (EXACT, OPEN, {"least": 0.4, "within": 3e-7, "tries": 3}, EXACT, ["free 3"]),
        (OPEN, EXACT, {"tries": 2}, EXACT, ["free 2", "fixed 2"]),
        (
            EXACT,
            replace(EXACT, magnitude=None),
            {"least": 0.41},
            replace(EXACT, magnitude=None),
            ["free 16", "fixed 16"],
        ),
        (EXACT, OPEN, {"least": 0.41}, None, ["free 16", "fixed 16", "near"]),
        (EXACT, OPEN, {"least": 0.41, "within": 2.9e-7}, EXACT, ["free 16", "fixed 16", "near"]),
        (OPEN, OPEN, {}, None, ["free 16", "fixed 16", "near"]),
    ],
)
def test_what_is_not_shown_as_asked_may_hold_to_the_tolerance(
    monkeypatch: pytest.MonkeyPatch, free: Proved, fixed: Proved, how: dict, done: Proved | None, asked: list[str]
) -> None:
    p, _ = half_under_way()
    tolerant = Proved(False, True, free.reason, 0.5e-9, 3e-7, 4.0, 0.0, (0.5, 0.5), MODES)
    assert decided(monkeypatch, free, fixed, SHOWN, WORSE, p, **how) == (done or tolerant, asked)


@pytest.mark.parametrize(("rough", "nearer"), [(MISSED, WORSE), (WORSE, MISSED)])
def test_what_misses_too_much_is_exact_or_nothing(monkeypatch: pytest.MonkeyPatch, rough: Near, nearer: Near) -> None:
    p, _ = half_under_way()
    found, asked = decided(monkeypatch, EXACT, OPEN, rough, nearer, p, least=0.41)
    assert (found, asked) == (EXACT, ["free 16", "fixed 16", "near", "nearer"])
    found, asked = decided(monkeypatch, OPEN, OPEN, rough, nearer, p)
    assert found == Proved(False, False, "no; (2) is missed by 2.0e-09 of the load", 2e-9)
    assert asked == ["free 16", "fixed 16", "near", "nearer"]
    found, _ = decided(monkeypatch, OPEN, OPEN, rough, SHOWN, p)
    assert (found.tolerant, found.residual) == (True, 0.5e-9)


def test_what_is_shown_farther_away_is_not_what_is_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    p, _ = half_under_way()
    far = "the motion of the state that is proved is 3.0e-07 N from the printed one"
    for within, shown in ((3e-7, True), (2.9e-7, False)):
        found, _ = decided(monkeypatch, OPEN, OPEN, SHOWN, WORSE, p, within=within)
        assert (found.tolerant, found.exact) == (shown, False)
        assert found.reason == ("no" if shown else f"no; {far}")


def idle(motion: float, along: float = 0.0) -> tuple[Problem, State]:
    """1 N presses, the object slides without friction; a joint that moves nothing, and is locked, moves."""
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], 0.0)], [GraspJoint("idle", [0, 1, 0], [0, 0, 0], (), "prismatic")])
    p, none = problem(grasp, [0, 0, -1.0]), np.zeros(0)
    r, c = np.array([along, 0, -1.0, 0, 0, 0]), np.array([1.0, 0, 0])
    return p, State(r, np.array([motion]), c, np.zeros(p.grasp.a), none, np.zeros(1), np.zeros(1))


@pytest.mark.parametrize(
    ("along", "motion", "shown"),
    [(0.0, 0.9e-6, True), (0.0, 1.1e-6, False), (0.0, -8000.0, False), (1e3, 0.9e-3, True), (1e3, -1.1e-3, False)],
)
def test_motions_that_are_printed_are_those_of_an_exact_state(along: float, motion: float, shown: bool) -> None:
    """To a millionth of 1 N, or of the largest motion."""
    done = prove(*idle(motion, along))
    assert (done.exact, done.tolerant) == (shown, False)
    assert shown == (f"the motion of the state that is proved is {abs(motion):.1e} N from" not in done.reason)


def test_an_exact_state_that_moves_otherwise() -> None:
    p, x = idle(-8000.0)
    at, y = exactly(p, x)
    assert (at.magnitude, y.q.tolist(), y.r.tolist()) == (0.0, [0.0], x.r.tolist())
    assert prove(at, y).exact
    off = altered(x, c=1.1 * x.c)  # other forces
    assert exactly(p, off) == (p, off)


@pytest.mark.parametrize(
    ("forces", "changed", "apart", "kind"),
    [
        (0.9e-6, 1.9e-6, 1.9e-6, ""),
        (1.1e-6, 0.0, 0.0, "force"),  # a millionth of 1 N, however far it moves
        (0.0, 2.1e-6, 0.0, "motion"),  # of 2 N
        (0.0, 0.0, 2.1e-6, "motion"),
    ],
)
def test_forces_and_motions_count_each_beside_their_own(
    forces: float, changed: float, apart: float, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    p, x = half_under_way()
    monkeypatch.setattr(existence, "_attempts", lambda *_, **__: OPEN)
    rough = replace(SHOWN, forces=forces, changed=changed, apart=apart)
    monkeypatch.setattr(existence, "near", lambda p, x: rough)
    done = prove(p, altered(x, r=2 * x.r))
    assert done.tolerant == (kind == "")
    assert (f"the {kind} of the state that is proved is" in done.reason) == bool(kind)
    assert existence._farther(p, x, np.inf, 0.0, 1e9, 1e9) == ""
    assert existence._farther(p, x, 0.5e-6, 0.0, 0.4e-6, 0.9e-6) == ""  # along a path, less at the contacts alone


def test_a_joint_close_by_its_contact_is_where_it_is_told() -> None:
    """It passes 1 mm beside the contact and presses with 1 N there: at 1000 rad of the finger, and nowhere else."""
    grasp = Grasp(
        [Contact([x, 0, 0], [-2 * x, 0, 0], 0.5) for x in (-0.5, 0.5)],
        [GraspJoint("j", [0, 0, 1], [-0.5, 1e-3, 0], (0,), torque=1e-3)],
        Mechanism((), np.zeros((0, 1)), np.zeros((0, 1)), ()),
    )
    p, x = held(grasp, [0, 0, -0.2])
    assert abs(x.q[0]) > 100
    assert prove(p, x).exact
    for by, shown in ((1e-7, True), (1e-5, False)):
        assert prove(p, altered(x, q=x.q * (1 + by))).exact == shown


@pytest.mark.parametrize("away", [0.0, 1.0, 10.0])
def test_motions_that_are_printed_count_alike_wherever_the_origin_is(away: float) -> None:
    """A contact on which 1 N presses: its motion may be a millionth of that off."""
    contacts = [Contact([away + x, 0, 0], [0, 0, 1], 0.5) for x in (-1e-3, 1e-3)]
    p, x = held(Grasp(contacts, []), [0, 0, -2.0, 0, 2.0 * away, 0])
    assert p.grasp.told_units[:6] == pytest.approx([1, 1, np.sqrt(2), 1, 1, np.sqrt(2)], abs=0.5)
    for by, shown in ((0.5, True), (3.0, False)):
        moved = altered(x, r=x.r + np.array([0, 0, by * existence._told(p, x), 0, 0, 0]))
        assert (prove(p, moved).exact or prove(p, moved).tolerant) == shown


def test_with_one_try_the_magnitude_is_not_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it could be an unknown in the next modes, all of them would say otherwise."""
    _, asked = decided(monkeypatch, OPEN, EXACT, SHOWN, WORSE, half_under_way()[0], tries=1)
    assert asked == ["free 1", "near"]


def test_without_a_magnitude_none_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    p = replace(half_under_way()[0], along=None)
    found, asked = decided(monkeypatch, OPEN, OPEN, SHOWN, WORSE, p)
    assert (found.tolerant, found.magnitude, asked) == (True, None, ["fixed 16", "near"])


def test_nothing_may_be_missed_of_a_load_that_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Base and direction cancel."""
    p = replace(half_under_way()[0], magnitude=-0.5)
    assert not p.granted
    two = problem(Grasp([Contact([x, 0, 0], [0, 0, 1], 0.0) for x in (-4.0, 4.0)]), [0, 0, -0.5, 0, 0, 5e-324])
    tiny = replace(two, along=p.along, magnitude=-0.5)  # whose size is 0, as floats have it
    assert (tiny.load.any(), tiny.granted) == (True, 0)
    assert decided(monkeypatch, OPEN, OPEN, SHOWN, SHOWN, p) == (OPEN, ["free 16", "fixed 16"])


@pytest.mark.parametrize(("size", "judged"), [(1.01e-30, True), (0.99e-30, False)])
def test_nothing_is_proved_of_grasps_that_are_too_small(size: float, judged: bool) -> None:
    p = problem(Grasp([Contact([x, 0, 0], [-x / size, 0, 0], 0.5) for x in (-size, size)], []), [0, 0, 1])
    none = np.zeros(0)
    done = prove(p, State(np.zeros(6), none, np.zeros(6), none, none, none, np.zeros(2)))
    assert (done.exact, done.tolerant, done.reason != TOO_SMALL) == (False, False, judged)


def test_friction_of_which_the_square_is_0_counts() -> None:
    """1e-170 N across one contact with 1 N and a friction of 1e-200: it holds to 1e-9 of the load, not exactly."""
    g = data(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)], []))
    g = replace(g, mu=np.array([1e-200]))
    none = np.zeros(0)
    for across, exact in ((1e-170, False), (0.0, True)):
        x = State(np.array([0, 0, -1.0, 0, 0, 0]), none, np.array([1.0, 0, across]), none, none, none, np.zeros(1))
        done = prove(Problem(g, np.array([across, 0, -1.0, 0, 0, 0])), x)
        assert (done.exact, done.exact or done.tolerant) == (exact, True)


def test_nothing_is_proved_of_forces_that_are_too_small() -> None:
    p, x = half_under_way()
    for size, shown in ((MIN_FORCE_SCALE, True), (0.99 * MIN_FORCE_SCALE, False)):
        less = replace(p, wrench=size * np.array([0, 0, -1.0, 0, 0, 0]), along=None)
        done = prove(less, altered(x, r=size * x.r, c=size * x.c))
        assert (done.exact or done.tolerant) == shown
        if not shown:
            assert done == Proved(False, False, TOO_SMALL, np.inf)


@pytest.mark.parametrize(
    ("by", "leads"), [(0.9e-6, True), (-0.9e-6, True), (1.1e-6, False), (-1.1e-6, False), (None, False)]
)
def test_newtons_method_may_lead_elsewhere(monkeypatch: pytest.MonkeyPatch, by: float | None, leads: bool) -> None:
    """A millionth of the force of 1 N is not elsewhere. None: it fails."""
    p, x = half_under_way()

    def solved(s: System) -> tuple[Array, Array, float]:
        if by is None:
            raise NotShown("no")
        return 2 * x.motion, x.forces(p.grasp) + np.array([by, 0, 0, 0]), 0.5

    def asked(its: Problem, y: State) -> Near:
        assert its is p
        assert y.motion.tolist() == (2 * x.motion).tolist()
        assert y.c[0] == 1 + (by or 0)
        return SHOWN

    monkeypatch.setattr(existence, "solution", solved)
    monkeypatch.setattr(existence, "near", asked)
    found = existence._nearer(p, x, likeliest(p, x))
    assert found.missed == (SHOWN.missed if leads else np.inf)
    assert not leads or found.forces == pytest.approx(SHOWN.forces + abs(by or 0))
    assert not leads or (found.changed, found.apart) == pytest.approx((SHOWN.changed + 1.0, SHOWN.apart + 1.0))
    if not leads:
        assert (found.missed, found.where, found.shown) == (np.inf, "all", False)
    at, better = polished(p, x)
    assert (at is p, better is x) == (by is None, by is None)
    if by is not None:
        assert (at.magnitude, better.c[0]) == (0.5, 1 + by)


def of_one_contact(force: float, motion: float, *, off: float = 0.0) -> tuple[Problem, State, Box]:
    """A state of 2 N, and a box about a force and a motion with radii of forces and half as large ones of motions."""
    p = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)], []), [0, 0, -2.0])
    none = np.zeros(0)
    x = State(np.array([0, 0, -2.0, 0, 0, 0]), none, np.array([2.0, 0, 0]), none, none, none, np.zeros(1))
    d, phi, radii = np.array([motion, 0, 0, 0]), np.array([force, 0, 0, 0]), np.array([off, 0, 0, 0])
    return p, x, Box(x.motion, np.zeros(6), d, radii / 2, phi, radii)


@pytest.mark.parametrize(
    ("force", "motion", "off", "radius"),
    [(2.0, -2.0, 0.0, 0.0), (2.0 + 1e-6, -2.0, 5e-7, 1.5e-6), (2.0 - 1e-6, -2.25, 5e-7, 0.25 + 2.5e-7)],
)
def test_how_far_a_box_is_from_a_state(force: float, motion: float, off: float, radius: float) -> None:
    asked = of_one_contact(force, motion, off=off)
    assert existence._radius(*asked, radius) == pytest.approx(radius, abs=1e-15)
    if radius > 0.1:
        why = r"^contact 0: the motion of the state that is proved is 2\.5e-01 N from the printed one$"
        with pytest.raises(NotShown, match=why) as fault:
            existence._radius(*asked, radius * (1 - 1e-9))
        assert fault.value.rounding


@pytest.mark.parametrize(
    ("force", "off", "far"), [(2 + 1.9e-6, 0, ""), (2 - 2.1e-6, 0, "2.1e-06"), (2, 2.1e-6, "2.1e-06")]
)
def test_forces_that_are_proved_are_those_that_are_printed(force: float, off: float, far: str) -> None:
    """To a millionth of 2 N."""
    asked = of_one_contact(force, -2.0, off=off)
    if not far:
        assert existence._radius(*asked, np.inf) > 0
        return
    with pytest.raises(NotShown) as fault:
        existence._radius(*asked, np.inf)
    assert str(fault.value) == f"contact 0: the force of the state that is proved is {far} N from the printed one"
    assert fault.value.rounding


def test_torsions_have_the_names_of_their_contacts() -> None:
    contacts = [Contact([0.1 * k, 0, 0], [0, 0, 1], 0.5, torsion=0.01 * k) for k in range(3)]
    p = problem(Grasp(contacts), [0, 0, -1.0])
    assert [row_name(p, k) for k in (8, 9, 10)] == ["contact 2", "torsion of contact 1", "torsion of contact 2"]


@pytest.mark.parametrize("tries", [1, 2, 5])
def test_so_many_modes_are_tried(monkeypatch: pytest.MonkeyPatch, tries: int) -> None:
    """Three contacts that press by as good as nothing, and a load that none of them carries."""
    contacts = [Contact([0.1 * k, 0, 0], [0, 0, 1], 0.5) for k in range(3)]
    p, tried = problem(Grasp(contacts), [0, 0, 1.0, 0, 0, 0]), []

    def noted(s: System, x: State, within: float, residual: float) -> Proved:
        tried.append(s.modes.contact.tolist())
        raise NotShown(f"no {len(tried)}")

    monkeypatch.setattr(existence, "_tried", noted)
    x = State.of(p.grasp, np.array([0, 0, -1e-12, 0, 0, 0]), np.zeros(len(p.grasp.rows[0])))
    found = existence._attempts(p, x, tries, np.inf)
    assert len(tried) == len({tuple(modes) for modes in tried}) == tries
    assert (found.exact, found.tolerant, found.reason) == (False, False, "no 1")  # of the likeliest
    assert np.isfinite(found.residual)


@pytest.mark.parametrize("off", [0.0, 0.125])
def test_the_ends_of_a_magnitude_are_rounded_outwards(off: float) -> None:
    p, x = half_under_way()
    s = System.of(p, likeliest(p, x), x, True)
    box = replace(s.box(), magnitude=0.5, magnitude_off=off)
    done = existence._shown(s, x, box, 1e-6, 0.75)
    low, high = done.magnitude
    assert low < 0.5 - off
    assert 0.5 + off < high
    assert high - low == pytest.approx(2 * off, abs=1e-14)
    assert (done.exact, done.tolerant, done.reason, done.residual) == (True, False, "", 0.75)
    assert done.modes is s.modes
    assert done.radius < 1e-9
    assert done.motion == pytest.approx(1)
    assert done.margin == pytest.approx(1)  # 1 N presses
    wide = existence._shown(s, x, replace(box, v_off=np.array([0, 0, 0.25, 0, 0, 0])), np.inf, 0.75)
    assert wide.motion == pytest.approx(1.25)
    fixed = replace(p, along=None, wrench=p.load)
    assert existence._shown(System.of(fixed, s.modes, x, False), x, box, 1e-6, 0.0).magnitude is None


def test_a_magnitude_is_polished_with_the_state() -> None:
    """1 N presses where 1/2 N and a magnitude of 0.4 are to be balanced: both give way."""
    p, x = half_under_way()
    at, better = polished(replace(p, magnitude=0.4), x)
    assert 0.4 < at.magnitude < 0.5
    assert better.c[0] == pytest.approx(0.5 + at.magnitude)
    assert better.r[2] == pytest.approx(-better.c[0])


# --- which modes are tried, and with what ---------------------------------------------------------------


def test_modes_are_tried_by_how_many_parts_are_not_at_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two contacts with three modes each the second is at fault: it is changed first, the other costs twice that."""
    p, x = half_under_way()
    options = {f"contact {k}": [(i, False) for i in range(3)] for k in (0, 1)}
    tried = []

    def fails(s: SimpleNamespace, x: State, within: float, residual: float) -> Proved:
        tried.append((s.modes, residual))
        raise NotShown("no", "contact 1")

    monkeypatch.setattr(existence, "choices", lambda p, x: options)
    monkeypatch.setattr(existence, "modes_of", lambda g, kinds: tuple(mode for mode, _ in kinds.values()))
    made = SimpleNamespace(of=lambda p, modes, x, free: SimpleNamespace(modes=modes, residual=3.0 - sum(modes)))
    monkeypatch.setattr(existence, "System", made)
    monkeypatch.setattr(existence, "_tried", fails)
    assert existence._attempts(p, x, 20, np.inf).residual == -1.0
    modes = [(0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0), (1, 2), (2, 1), (2, 2)]
    assert tried == [(mode, 3.0 - max(map(sum, modes[: k + 1]))) for k, mode in enumerate(modes)]


@pytest.mark.parametrize(
    ("rounding", "regular", "contradictory", "inside", "shown"),
    [
        (False, True, False, True, ""),
        (True, False, True, True, ""),
        (True, True, True, True, "inside"),
        (True, False, False, True, "inside"),
        (True, True, False, False, "balls"),
    ],
)
def test_more_is_tried_in_modes_that_only_rounding_may_spoil(
    monkeypatch: pytest.MonkeyPatch, rounding: bool, regular: bool, contradictory: bool, inside: bool, shown: str
) -> None:
    p, x = half_under_way()

    def fails() -> Box:
        raise NotShown("no", rounding=rounding)

    def moved(its: SimpleNamespace) -> State:
        if not inside:
            raise NotShown("no state is farther inside of the modes")
        return x

    s = SimpleNamespace(p=p, modes=MODES, sought=True, box=fails, regular=regular, contradictory=contradictory)
    there = SimpleNamespace(box=lambda: "inside")
    monkeypatch.setattr(existence, "_inside", moved)
    monkeypatch.setattr(
        existence, "System", SimpleNamespace(of=lambda *asked: there if asked[1:] == (MODES, x, True) else 0)
    )
    monkeypatch.setattr(existence, "refined", lambda its: "balls" if its is s else "")
    monkeypatch.setattr(existence, "_shown", lambda *said: said)
    if not shown:
        with pytest.raises(NotShown, match=r"^no$"):
            existence._tried(s, x, 0.5, 0.75)  # type: ignore[arg-type]
        return
    assert existence._tried(s, x, 0.5, 0.75) == (there if inside else s, x, shown, 0.5, 0.75)  # type: ignore[arg-type]


# --- in the units of the rows ---------------------------------------------------------------------------


def at_rest(p: Problem) -> tuple[State, Box]:
    """Every contact presses with 2 N, nothing moves; and a box without radii about that."""
    rows, columns = p.grasp.rows[0].shape
    phi = np.zeros(rows)
    phi[p.grasp.contact_rows[:, 0]] = 2.0
    none = np.zeros(rows)
    return State.of(p.grasp, np.zeros(columns), phi), Box(none[:columns], none[:columns], none, none, phi, none)


def test_how_far_a_box_is_counts_at_the_contacts() -> None:
    """The motor is geared by 4: 1/2 rad are 1/8 m there, and 1e-7 N m are 4e-7 N, of 2 N."""
    p = every_law()
    x, box = at_rest(p)
    motor = np.eye(17)[9]
    assert existence._radius(p, x, replace(box, d=0.5 * motor), 0.2) == pytest.approx(0.125)
    assert existence._radius(p, x, replace(box, d_off=0.5 * motor), 0.2) == pytest.approx(0.125)
    assert existence._radius(p, x, replace(box, phi=box.phi + 1e-7 * motor), 0.2) == pytest.approx(4e-7)
    assert existence._radius(p, x, replace(box, phi_off=1e-7 * motor), 0.2) == pytest.approx(4e-7)
    with pytest.raises(NotShown, match=r"^actuator 'motor': the force of the state that is proved is 2\.4e-06 N from"):
        existence._radius(p, x, replace(box, phi=box.phi + 6e-7 * motor), 0.2)


@pytest.mark.parametrize(("by", "leads"), [(4e-7, True), (6e-7, False)])
def test_where_newtons_method_leads_counts_at_the_contacts(
    monkeypatch: pytest.MonkeyPatch, by: float, leads: bool
) -> None:
    """As above: 2 N press, of which it may be 2e-6 N, and the motor is geared by 4."""
    p = replace(every_law(), along=np.eye(6)[2], magnitude=0.5)
    x, box = at_rest(p)

    def solved(s: SimpleNamespace) -> tuple[Array, Array, float]:
        assert s.sought is False
        return box.v, box.phi + by * np.eye(17)[9], 0.0

    made = SimpleNamespace(of=lambda p, modes, x, sought: SimpleNamespace(sought=sought))
    monkeypatch.setattr(existence, "System", made)
    monkeypatch.setattr(existence, "solution", solved)
    monkeypatch.setattr(existence, "near", lambda p, y: SHOWN)
    found = existence._nearer(p, x, MODES)
    assert found.missed == (SHOWN.missed if leads else np.inf)
    assert not leads or (found.forces, found.changed) == pytest.approx((SHOWN.forces + 4 * by, SHOWN.changed))
    assert found.modes is MODES
    assert leads or found.changed == np.inf


def test_what_is_kept_is_relative_to_the_largest_force() -> None:
    """One milligram: 1e-3 N of load, 2e-3 N that press, of which friction keeps a half."""
    p = problem(Grasp([Contact([0, 0, 0], [0, 0, 1], 0.5)], []), [0, 0, -1e-3])
    none = np.zeros(0, dtype=np.int64)
    modes = Modes(np.array([Contact_.STICKS]), np.zeros(1, dtype=bool), none, none)
    _, box = at_rest(p)
    assert inequalities(p, modes, replace(box, phi=1e-3 * box.phi)) == pytest.approx(0.5)


def test_to_whom_inequalities_apply() -> None:
    """No command to a motor that has none, no cone to a contact without friction."""
    contacts = [Contact([0, 0, 0], [0, 0, 1], mu) for mu in (0.5, 0.0)]
    joints = [GraspJoint(name, [1, 0, 0], [0, 0, 0], (0,), "prismatic") for name in "abc"]
    mechanism = Mechanism(("on", "off", "back"), np.eye(3), np.zeros((0, 3)), (False,) * 3, (False, False, True))
    p = problem(Grasp(contacts, joints, mechanism, {"on": 1.0, "back": 1.0}), [0, 0, -1.0])
    modes = Modes(np.full(2, Contact_.STICKS), np.zeros(2, dtype=bool), np.full(3, Part.MOVES), np.full(3, Part.FREE))
    applies = {
        fault.removeprefix("is not proved to "): on.tolist() for _, fault, _, on in slacks(p, modes, at_rest(p)[1])
    }
    assert applies["be inside its friction cone"] == [True, False]
    assert applies["carry its command"] == [True, False, False]


def test_what_joints_keep_counts_at_the_contacts() -> None:
    """The joint "stopped" is 2 m from what it moves. What is not slack is kept without any rounding."""
    p = every_law()
    _, box = at_rest(p)
    d = box.d + 0.25 * np.eye(17)[13] - 0.75 * np.eye(17)[9] + 0.125 * np.eye(17)[0]
    phi = box.phi + 0.25 * np.eye(17)[13] + 0.5 * np.eye(17)[12]
    modes = Modes(np.zeros(3, dtype=int), np.zeros(3, dtype=bool), np.full(2, Part.MOVES), np.full(4, Part.RESTS))
    kept = {
        fault.removeprefix("is not proved to "): x for _, fault, x, _ in slacks(p, modes, replace(box, d=d, phi=phi))
    }
    assert kept["carry its reaction"][:2].tolist() == [0.0, 0.75 * 0.5]  # of "rubs" exactly what is given
    assert kept["be open"][0] == pytest.approx(0.125)
    assert kept["close"][1] == 0.25 * 2
    assert kept["open"][1] == -0.25 * 2
    assert kept["move in its sense"][0] == 0.75 / 4
    assert [row_name(p, k) for k in (3, 4)] == ["contact 1"] * 2


def test_what_is_kept_is_rounded_down() -> None:
    """At 25 points, against 120 digits; in a step, without radii."""
    p = replace(every_law((0.3, -0.7, 0.0), 0.4, 5.1, force_limit=3.0), cos=0.8, sin=0.6)
    g, rng = p.grasp, np.random.default_rng(8)
    _, _, actuators, _, joints = g.parts
    d, phi = rng.normal(size=(2, 25, len(g.rows[0])))
    d *= 10.0 ** rng.integers(-4, 1, size=(25, 1))
    d[..., -1] = phi[..., -1] = 0.0
    (D, C), (T, F) = ([decimal(x[:, g.contact_rows]) for x in (d, phi)], [decimal(x[:, actuators]) for x in (d, phi)])
    (q, rho), side = [decimal(x[:, joints]) for x in (d, phi)], decimal([0.0, 1.0, 0.0, 0.0])
    with localcontext(prec=120):
        slides, rubs = (np.vectorize(Decimal.sqrt, otypes=[object])((x[..., 1:] ** 2).sum(axis=-1)) for x in (D, C))
        true = {
            "be open": decimal(g.gaps) + decimal(p.cos) * D[..., 0] + decimal(p.sin) * slides,
            "be inside its friction cone": decimal(g.mu) * C[..., 0] - rubs,
            "carry its command": (F - decimal(p.command)) * [-1, 1],
            "move in its sense": T * [-1, 1] + decimal(g.slack),
            "stay off its stop": side * q + decimal(np.abs(g.stops_left)),
            "lean on its stop": side * rho - decimal(g.friction),
        }
    units = {"actuator {}": g.row_units[actuators], "joint {}": g.row_units[joints], "contact {}": 1.0}
    none, modes = np.zeros(len(g.rows[0])), Modes(*(np.full(k, 0) for k in (g.m, g.m, g.a, g.l)))
    for name, fault, least, _ in slacks(p, modes, Box(none[: 6 + g.l], none[: 6 + g.l], d, none, phi, none)):
        what = fault.removeprefix("is not proved to ")
        if what in true:
            by = units[name] if what in ("carry its command", "lean on its stop") else 1.0 / units[name]
            with localcontext(prec=120):
                off = true[what] - decimal(least / by)  # by a power of two
            assert (off >= 0).all(), what
            assert (off < 1e-13).all(), what
