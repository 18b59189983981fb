"""States that hold only to 1e-9 of the load: what must not pass for one, beside a proof that the load slips."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from flint import fmpq

from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.proofs.equations import RightSide, equations_of
from handfast.proofs.existence import Proved, prove
from handfast.proofs.fields import exact
from handfast.proofs.grasp import GraspData, StartData
from handfast.proofs.near import (
    Near,
    _Curve,
    _norm,
    _projected,
    _weights,
    along,
    bernstein,
    controls_of,
    least_norm,
    near,
    nodes,
    product,
)
from handfast.proofs.question import read_question
from handfast.proofs.states import ContactMode as Kind
from handfast.proofs.states import Part, Problem, State
from handfast.proofs.tolerance import EPS, motion_size
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.objective import ANY_STATE
from handfast.stability.problem.scaled_problem import build

FRICTION = 0.5


def off(found: Near) -> float:
    """[N] how far forces or motions at the contacts are from the floats."""
    return max(found.forces, found.changed)


def between(
    mu: float, joints: list[GraspJoint], mechanism: Mechanism, preload: dict[str, float] | None = None
) -> Grasp:
    """Two opposite contacts on the x axis."""
    contacts = [Contact([-0.01, 0, 0], [1, 0, 0], mu), Contact([0.01, 0, 0], [-1, 0, 0], mu)]
    return Grasp(contacts, joints, mechanism, preload or {})


def slide(name: str, axis: list[float], *contacts: int, **law: object) -> GraspJoint:
    return GraspJoint(name, axis, [0, 0, 0], contacts, "prismatic", **law)  # type: ignore[arg-type]


def asked(
    grasp: Grasp, load: list[float], state: dict[str, Array | list[float]], **limits: float
) -> tuple[Problem, State]:
    """What a state has to solve, and the state; forces at contacts in the object frame as (m, 3)."""
    q = read_question(BoundProblem(build(grasp, np.array(load), limits=GraspLimits(**limits)), ANY_STATE).to_json(), "")  # type: ignore[arg-type]
    g = q.grasp
    c = np.concatenate([g.frames[i].T @ f for i, f in enumerate(np.asarray(state["forces"], dtype=float))])
    at = {name: np.asarray(state.get(name, np.zeros(n)), dtype=float) for name, n in sizes(g).items()}
    return Problem.of(q, g.command, q.wrench), State(c=c, **at)


def judged(grasp: Grasp, load: list[float], state: dict[str, Array | list[float]], **limits: float) -> Proved:
    """What is proved of it."""
    return prove(*asked(grasp, load, state, **limits))


def sizes(g: GraspData) -> dict[str, int]:
    return {"r": 6, "q": g.l, "f": g.a, "coupling": len(g.A), "reaction": g.l, "torsion": g.m}


def test_a_load_is_not_small_beside_commands() -> None:
    """No force of two contacts without friction acts along y; 2e9 N squeeze along x, and 1 N is missing."""
    joints = [slide("a", [1, 0, 0], 0), slide("b", [-1, 0, 0], 1)]
    P = 2e9
    grasp = between(0.0, joints, Mechanism.direct(["a", "b"]), {"a": P, "b": P})
    squeezed = {"q": [P, P], "forces": [[P, 0, 0], [-P, 0, 0]], "f": [P, P]}
    found = judged(grasp, [0, 1, 0, 0, 0, 0], squeezed)
    assert (found.exact, found.tolerant) == (False, False)
    assert found.residual == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("coefficient", [1.0, 1e-12, 1e12])
def test_a_coupling_holds_in_every_unit(coefficient: float) -> None:
    """A coupling holds the finger, so that nothing squeezes: r = 2, q = 4 would press with 2 N on both sides."""
    mechanism = Mechanism((), np.zeros((0, 1)), np.array([[coefficient]]), ())
    grasp = between(FRICTION, [slide("b", [1, 0, 0], 0)], mechanism)
    pressed = {
        "r": [2, 0, 0, 0, 0, 0],
        "q": [4],
        "forces": [[2, -0.5, 0], [-2, -0.5, 0]],
        "coupling": [2 / coefficient],
    }
    for sign in (1, -1):
        found = judged(grasp, [0, 1, 0, 0, 0, 0], pressed | {"coupling": [sign * 2 / coefficient]})
        assert (found.exact, found.tolerant) == (False, False)


@pytest.mark.parametrize("arm", [1e-3, 1e-11, 1e-15])
def test_a_locked_actuator_holds_all_that_it_drives(arm: float) -> None:
    """One of its joints is at both of its stops, so the other cannot move, however short the arm of the first is."""
    stuck = GraspJoint("j1", [0, 0, 1], [0.01, arm, 0], (1,), "revolute", stop="both")
    grasp = between(
        FRICTION,
        [stuck, slide("j2", [1, 0, 0], 0)],
        Mechanism(("m",), np.array([[1.0, 1.0]]), np.zeros((0, 2)), (False,)),
    )
    for force in (2.0, -2.0):
        pressed = {"r": [2, 0, 0, 0, 0, 0], "q": [0, 4], "forces": [[2, -0.5, 0], [-2, -0.5, 0]], "f": [force]}
        for reaction in (2 * arm - force, -2 * arm - force):
            found = judged(grasp, [0, 1, 0, 0, 0, 0], pressed | {"reaction": [reaction, 0.0]})
            assert (found.exact, found.tolerant) == (False, False)


def test_what_is_missed_adds_up() -> None:
    """A limit of 1 N under 1 N + 1.8e-9 N: 0.9e-9 above the limit, and as much missing, is none of both."""
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], [])
    for load, pressed, holds in (
        (1 + 1.8e-9, 1 + 0.9e-9, False),
        (1 + 0.9e-9, 1 + 0.9e-9, True),  # the state at the limit is near, and misses 0.9e-9
        (1 + 0.9e-9, 1 + 3e-9, True),  # so is the one that the load asks for
        (1 + 0.9e-9, 1 + 2e-6, False),  # which is not the one that is printed
        (1 + 0.9e-9, 1.0, True),
        (1 + 1.8e-9, 1.0, False),
        (1.0, 1.0, True),
    ):
        state = {"r": [-pressed, 0, 0, 0, 0, 0], "forces": [[pressed, 0, 0]]}
        found = judged(grasp, [-load, 0, 0, 0, 0, 0], state, force_limit=1.0)
        assert (found.exact or found.tolerant) is holds, (load, pressed)


def test_a_direction_outside_the_cone_by_more_than_the_tolerance() -> None:
    """One contact, 1.7e-9 of the load outside its cone: half of it in (5) and half in (1) is too much."""
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], FRICTION)], [])
    for out, holds in ((1.7e-9, False), (0.4e-9, True)):
        load = [FRICTION + out, 0, -1.0, 0, 0, 0]
        n, t = 1.0, FRICTION + out / 2
        state = {"r": [1e-6, 0, -n, 0, 0, 0], "forces": [[-t, 0, n]]}
        found = judged(grasp, load, state)
        assert found.exact is False
        assert found.tolerant is holds


def test_what_keeps_more_than_is_asked_makes_up_for_nothing() -> None:
    """Well inside its cone, with forces that are 1 % too large."""
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 10.0)], [])
    found = judged(grasp, [-1, 0, 0, 0, 0, 0], {"r": [-1.01, 0, 0, 0, 0, 0], "forces": [[1.01, 0, 0]]})
    assert (found.exact, found.tolerant) == (False, False)
    assert found.residual == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("far", [2.0**30, 2.0**50, 2.0**60])
def test_no_sum_is_still_because_its_parts_are_large(far: float) -> None:
    """Two fingers that move alike, q_a = q_b, squeeze nothing; each moves far, and one by 4 more than the other."""
    joints = [slide("a", [1, 0, 0], 0), slide("b", [1, 0, 0], 1)]
    grasp = between(FRICTION, joints, Mechanism((), np.zeros((0, 2)), np.array([[1.0, -1.0]]), ()))
    for force in (2.0, -2.0):
        pressed = {"r": [far, 0, 0, 0, 0, 0], "q": [far + 2, far - 2], "coupling": [force]}
        found = judged(grasp, [0, 1, 0, 0, 0, 0], pressed | {"forces": [[2, -0.5, 0], [-2, -0.5, 0]]})
        assert (found.exact, found.tolerant) == (False, False)


@pytest.mark.parametrize("mu", [2.0, 1e4, 1e10])
def test_an_open_contact_carries_no_friction(mu: float) -> None:
    """The upper contact is 1 N away: what presses there is within the tolerance, mu times as much friction is not."""
    contacts = [Contact([0, 0, 0], [0, 0, 1], 0.0), Contact([0, 0, 0], [0, 0, -1], mu)]
    aside = 1.6e-9 if mu == 2.0 else 1e-6
    n = aside / mu
    state = {"r": [0, 0, -(1 + n), 0, 0, 0], "forces": [[0, 0, 1 + n], [-aside, 0, -n]]}
    found = judged(Grasp(contacts, []), [aside, 0, -1, 0, 0, 0], state)
    assert (found.exact, found.tolerant) == (False, False)


def pressed_by(slip: float, load: float = 0.3) -> bool:
    """A finger presses with 1 N on a block on the ground; the object slips; does that hold to the tolerance?"""
    contacts = [Contact([0, 0, 0.01], [0, 0, -1], FRICTION), Contact([0, 0, -0.01], [0, 0, 1], FRICTION)]
    grasp = Grasp(contacts, [slide("a", [0, 0, -1], 0)], Mechanism.direct(["a"]), {"a": 1.0})
    forces = [[-load / 2, 0, -1], [-load / 2, 0, 1]]
    state = {"r": [slip, 0, -1, 0, 0, 0], "q": [2.0], "f": [1.0], "forces": forces}
    return near(*asked(grasp, [load, 0, 0, 0, 0, 0], state)).shown


def test_a_slip_within_the_tolerance_counts_as_sticking() -> None:
    """Friction of 0.15 N is inside the cone, against a slip of more it would be 0.5 N."""
    for slip, holds in ((0.9e-9, True), (-0.9e-9, True), (1.2e-9, False), (-1.2e-9, False), (1e-6, False)):
        assert pressed_by(0.3 * slip) is holds, slip


def test_a_contact_may_be_open_but_for_the_tolerance() -> None:
    """It does not press where it is 1e-9 of the load, or less, inside of the object."""
    grasp = Grasp([Contact([0, 0, 0], [0, 0, 1], 0.0), Contact([0.01, 0, 0], [-1, 0, 0], 0.0)], [])
    for inside, holds in ((0.9e-9, True), (2.5e-9, False), (1e-6, False)):
        state = {"r": [inside, 0, -1, 0, 0, 0], "forces": [[0, 0, 1], [0, 0, 0]]}
        assert near(*asked(grasp, [0, 0, -1, 0, 0, 0], state)).shown is holds, inside


def test_proofs_that_a_load_slips_give_way_by_as_much() -> None:
    """Multipliers of motions cost EPS times the load, contact by contact as a vector, with the turning."""
    contacts = [Contact([0, 0, 0.01], [0, 0, -1], 0.5, torsion=0.005), Contact([0, 0, -0.01], [0, 0, 1], 0.5)]
    grasp = Grasp(contacts, [slide("a", [0, 0, -1], 0)], Mechanism.direct(["a"]), {"a": 1.0})
    q = read_question(BoundProblem(build(grasp, np.array([7.0, 0, 0, 0, 0, 0])), ANY_STATE).to_json(), "")
    equations = equations_of(q)
    side = RightSide.of(q, None, len(equations.E))
    none = np.zeros((1, len(equations.E)))
    z = np.array([[2.0, 0, 0, 0, 3.0, 4.0, 100.0, 50.0, 1.5]])  # contacts, actuator, work, the turning of the first
    assert z.shape[1] == len(equations.Z)
    z = z[:, equations.of_contacts]
    slack, growth = side.costs(equations, none, none, z, np.zeros_like(z))
    assert slack == pytest.approx(EPS * 7.0 * (2.5 + 5.0), rel=1e-6)
    assert slack >= EPS * 7.0 * (2.5 + 5.0)
    assert growth == 0
    wider, _ = side.costs(equations, none, none, z, np.ones_like(z))
    assert wider == pytest.approx(EPS * 7.0 * (np.sqrt(3**2 + 1 + 1 + 2.5**2) + np.sqrt(1 + 4**2 + 5**2)), rel=1e-6)


def test_a_load_that_the_direction_cancels_grants_nothing() -> None:
    """Fingers without friction at 3e-10 of opposite press with 1 N: 3e-10 N along z are missing; no load is there."""
    tilted = {"position": [0, -0.05, 0], "normal": [0, 1, 3e-10], "friction": 0.0}
    contacts = [tilted, {"position": [0, 0.05, 0], "normal": [0, -1, 0], "friction": 0.0}]
    joints = [
        {"name": n, "type": "prismatic", "axis": [0, s, 0], "origin": [0, 0, 0], "moves": [i]}
        for i, (n, s) in enumerate((("a", 1), ("b", -1)))
    ]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts, "joints": joints, "preload": {"a": 1.0, "b": 1.0}}
    load = np.array([1e-3, 0, 0, 0, 0, 0])
    asked = {"grasp": grasp, "goal": "largest", "wrench": load.tolist(), "direction": (-load).tolist()}
    q = read_question(asked, "")
    none = np.zeros(2)
    x = State(np.zeros(6), np.ones(2), np.array([1.0, 0, 0, 1.0, 0, 0]), np.ones(2), np.zeros(0), none, none)
    found = prove(Problem.of(q, q.grasp.command, q.wrench, q.direction, 1.0), x)
    assert (found.exact, found.tolerant) == (False, False)
    alone = read_question({"grasp": grasp, "goal": "check", "wrench": [0.0] * 6}, "")
    assert prove(Problem.of(alone, alone.grasp.command, alone.wrench), x).tolerant  # 1e-9 of the commands, then


def test_a_coupling_may_not_turn_an_actuator_back() -> None:
    """q = (1e-12, -1) is tied to (-1/2, -1/2): what moved in its sense has moved against it."""
    joints = [slide("a", [1, 0, 0], 0), slide("b", [-1, 0, 0], 1)]
    mechanism = Mechanism(("a",), np.array([[1.0, 0.0]]), np.array([[1.0, -1.0]]), (False,))
    for command in (1.0, -1.0):
        grasp = between(FRICTION, joints, mechanism, {"a": command})
        state = {"q": [command * 1e-12, -command], "forces": [[0, 0, 0], [0, 0, 0]], "f": [command]}
        found = near(*asked(grasp, [0, 1, 0, 0, 0, 0], state))
        assert (found.missed, found.where) == (np.inf, "the sense of actuator 'a'")
        p, x = asked(grasp, [0, 1, 0, 0, 0, 0], state)
        good = replace(x, q=command * np.array([2.0, -1.0]))
        for found in (
            on_a_curve(p, x, good, p.wrench),
            on_a_curve(p, good, x, p.wrench),
        ):  # from or to 1/2, in its sense
            assert (found.missed, found.where) == (np.inf, "the sense of actuator 'a'")


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize(
    "ends", [[[3, 0], [0, 4]], [[1, 0], [-1, 1]], [[1, 0], [5, 1], [-3, 2]], [[2, 0], [-1, 0], [0.25, 0]]]
)
def test_the_length_of_a_curve_is_as_near_as_is_said(ends: list[list[float]], scale: float) -> None:
    a = scale * np.array(ends, dtype=float)[:, None]
    length, off = _norm(a, least_norm(a))
    powers = bernstein(len(a) - 1, np.linspace(0, 1, 101))
    apart = np.abs(powers @ length[:, 0] - np.linalg.norm(powers @ a[:, 0], axis=1)).max()
    assert apart <= off[0] * (1 + 1e-12)
    assert off[0] < 10 * scale


@pytest.mark.parametrize(("sense", "reaction"), [(1.0, -0.5), (-1.0, 0.5)])
def test_a_coupling_may_not_turn_a_joint_with_friction_back(sense: float, reaction: float) -> None:
    """As above: friction of -1/2 N, as the joint closed, is no law once it has opened; and the other way round."""
    joints = [slide("a", [1, 0, 0], 0, friction=0.5), slide("b", [-1, 0, 0], 1)]
    mechanism = Mechanism((), np.zeros((0, 2)), np.array([[1.0, -1.0]]), ())
    grasp = between(FRICTION, joints, mechanism)
    state = {"q": [sense * 1e-12, -sense], "forces": [[0, 0, 0], [0, 0, 0]], "reaction": [reaction, 0.0]}
    found = near(*asked(grasp, [0, 1, 0, 0, 0, 0], state))
    assert (found.missed, found.where) == (np.inf, "the sense of joint 'a'")
    p, x = asked(grasp, [0, 1, 0, 0, 0, 0], state)
    good = replace(x, q=sense * np.array([2.0, -1.0]))
    for found in (on_a_curve(p, x, good, p.wrench), on_a_curve(p, good, x, p.wrench)):
        assert (found.missed, found.where) == (np.inf, "the sense of joint 'a'")
    moved = near(*asked(grasp, [0, 1, 0, 0, 0, 0], state | {"q": [2 * sense, -sense]}))  # to 1/2, in its sense
    assert moved.missed < np.inf
    assert moved.modes.joint[0] == (Part.MOVES if sense > 0 else Part.OPENS)


D = 1e-10
GIVES_WAY = pytest.mark.parametrize(
    ("motion", "force", "mode", "changed", "limits"),
    [
        ([-1, 0, 0], [1, 0.2, 0], "STICKS", 0, {}),
        ([-1, 0, D], [1, 0.2, 0], "STICKS", D, {}),  # (3) gives way by the motion across
        ([-1 + D, 0, 0], [1, 0.2, 0], "STICKS", D, {}),
        ([-1, 0, 0], [1, 0.5 + D, 0], "STICKS", D, {}),  # outside of the cone by so much
        (
            [-1, 0, 0],
            [1, 0.2, 0],
            "STICKS",
            1.5 * D,
            {"force_limit": 1 - D},
        ),  # c_n is less, and c_t by friction of that
        ([-1 - D, 0, 0], [1, 0.2, 0], "STICKS", 2 * D, {"force_limit": 1 - D}),  # it may press by D less, or by D more
        ([-1, 1, 0], [1, -0.5, 0], "SLIDES", 0, {}),
        ([-1, 1, 0], [1, -0.5, D], "SLIDES", 2 * D, {}),  # 1 N of motion is turned as the friction is
        ([-1, 4, 0], [1, -0.5 + D, 0], "SLIDES", D, {}),  # too little friction
        ([-1, 2, 0], [1, -0.5 + 0.1 * D, D], "SLIDES", (2 * np.hypot(0.1, 1) + 0.2 * 2) / 0.5 * D, {}),  # both
        ([-1 - D, 1, 0], [1, -0.5, 0], "SLIDES", 2 * D, {"force_limit": 1 - D}),
        ([-1 + D, 3, 4], [1, -0.3, -0.4], "SLIDES", D, {}),
        ([-1, 1, 0], [1, -0.5, 0], "SLIDES", 1.5 * D, {"force_limit": 1 - D}),
        ([1, 0, 0], [D, 0, 0], "OPEN", D, {}),
        ([1, 5, 0], [0, D, 0], "OPEN", D, {}),
        ([-D, 5, 0], [0, 0, 0], "OPEN", D, {}),
    ],
)


@pytest.mark.parametrize("F", [1.0, 1e-6, 1e6])
@GIVES_WAY
def test_how_far_a_contact_gives_way_by_hand(motion, force, mode: str, changed: float, limits, F: float) -> None:
    """One contact at the origin with friction 1/2, balanced by the load, of F; a part in 1e10 is off."""
    p, x = asked(
        Grasp([Contact([0, 0, 0], [1, 0, 0], FRICTION)], []),
        [F * (-f + (0.5 if mode == "OPEN" else 0)) for f in force] + [0, 0, 0],
        {"r": [*F * np.array(motion), 0, 0, 0], "forces": [F * np.array(force)]},
        **{name: F * limit for name, limit in limits.items()},
    )
    found = near(p, x)
    assert found.modes.contact[0] == getattr(Kind, mode)
    assert off(found) == pytest.approx(changed * F, rel=1e-4, abs=1e-4 * D * F)


def test_the_nearest_points_are_so_by_the_units_of_joints() -> None:
    """q1 + q2 = 1 from (0, 0, 5) and from (17, 1, 0), where q1 moves contacts by a quarter of what q2 does."""
    rows, units, at = (exact(np.array(x)) for x in ([[1.0, 1, 0]], [2.0, 0.5, 4], [1.0]))
    q = _projected(exact(np.array([[0.0, 0, 5], [17, 1, 0]])), rows, units, at)
    assert q is not None
    assert q.tolist() == [[fmpq(16, 17), fmpq(1, 17), 5], [fmpq(1), fmpq(0), 0]]
    twice = np.concatenate([rows, rows])
    assert _projected(q, twice, units, exact(np.array([1.0, 1]))) is q
    assert _projected(q, twice, units, exact(np.array([1.0, 2]))) is None


def test_a_tendon_that_was_slack_may_slacken_less() -> None:
    """By 0.2 of 0.5, with a finger that touches nothing, beside a contact that carries the load."""
    contacts = [Contact([0, 0, 0], [1, 0, 0], 0.0), Contact([0, 0, 0], [0, 1, 0], 0.0)]
    grasp = Grasp(contacts, [slide("b", [1, 0, 0], 0)], Mechanism(("t",), np.eye(1), np.zeros((0, 1)), (True,)))
    state = {"r": [0, -1, 0, 0, 0, 0], "q": [-0.2], "forces": [[0, 0, 0], [0, 1, 0]]}
    p, x = asked(grasp, [0, -1, 0, 0, 0, 0], state)
    found = near(replace(p, grasp=p.grasp.with_start(StartData(np.zeros(2), np.zeros(1), np.array([0.5])))), x)
    assert (found.shown, found.modes.actuator.tolist()) == (True, [Part.MOVES])


def test_a_curve_of_motions_is_no_curve_of_lengths() -> None:
    """A slip from (3, 0) to (0, 4) is 2.5 N long half way, not 3.5 N, and 0.6 of it counts where normals may turn."""
    grasp, pressed = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], []), [0.8 * 10 - 0.6 * slip for slip in (3, 4)]
    made = [
        asked(grasp, [-c, 0, 0, 0, 0, 0], {"r": [-10, *slip, 0, 0, 0], "forces": [[c, 0, 0]]})
        for c, slip in zip(pressed, ([3, 0], [0, 4]), strict=True)
    ]
    (p, x), (q, y) = ((replace(p, cos=0.8, sin=0.6), x) for p, x in made)
    assert near(p, x).shown
    assert near(q, y).shown
    found = on_a_curve(q, x, y, p.wrench)
    assert (found.shown, found.where) == (False, "the law of contact 0")
    assert found.missed * q.granted > 0.6 * (3.5 - 2.5)


@pytest.mark.parametrize(("end", "changed"), [(1 + D, 1.5), (-D, 2.0)])
def test_a_force_is_within_its_limits_all_along_a_curve(end: float, changed: float) -> None:
    """From 1/2 N to one that is D beyond 1 N: with friction of half of it that is 1.5 D. Below 0 no cone is left."""
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], FRICTION)], [])
    made = [
        asked(grasp, [-c, 0, 0, 0, 0, 0], {"r": [-c, 0, 0, 0, 0, 0], "forces": [[c, 0, 0]]}, force_limit=1.0)
        for c in (0.5, end)
    ]
    for (p, x), (q, y) in (made, made[::-1]):
        tables = {f.name: np.stack([getattr(z, f.name) for z in (x, y)]) for f in fields(State)}
        found = along(replace(p, along=q.wrench - p.wrench), np.array([0.0, 1.0]), tables, 0.5)
        assert off(found) == pytest.approx(changed * D, rel=1e-4)


def test_what_a_joint_is_off_counts_at_any_end_of_a_curve() -> None:
    """A locked motor carries 1 N, or D more than the contact there."""
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], [slide("b", [1, 0, 0], 0)], Mechanism.direct(["b"]))
    state = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]]}
    (p, x), (_, y) = (asked(grasp, [-1, 0, 0, 0, 0, 0], state | {"f": [f]}) for f in (1.0, 1 + D))
    for found in (on_a_curve(p, x, y, p.wrench), on_a_curve(p, y, x, p.wrench)):
        assert (found.where, found.missed) == ("(2) of joint 'b'", pytest.approx(D, rel=1e-5))


@pytest.mark.parametrize(("part", "where"), [(0, "(1), forces"), (5, "(1), torques")])
@pytest.mark.parametrize("place", [[0, 0, 0], [0.3, -0.2, 0.5]])
def test_what_is_off_of_the_load_counts_at_any_end_of_a_curve(part: int, where: str, place: list[float]) -> None:
    """Of one end a part in 1e10 of 2 N, or of that at the contacts' distance from their middle, wherever that is."""
    h = 2.0**-7
    contacts = [Contact(np.add(place, [0, y, 0]), [1, 0, 0], 0.0) for y in (h, -h)]

    def load(force: Array, torque: Array) -> Array:
        return np.r_[force, torque + np.cross(place, force)]

    push, axis = np.array([-2.0, 0, 0]), np.array([0, 0, 1.0])
    whole = load(push, 0 * axis)
    p, x = asked(Grasp(contacts, []), whole.tolist(), {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]] * 2})
    other = load(push, 2 * D * h * axis) if part else load(push * (1 - D), 0 * axis)
    for found in (on_a_curve(p, x, x, other), on_a_curve(replace(p, wrench=other), x, x, p.wrench)):
        assert (found.where, found.missed) == (where, pytest.approx(D, rel=1e-4))


def test_a_torque_that_is_missing_does_work_as_the_object_turns() -> None:
    """Of 2 h D, D = 1e-10, about the normals of contacts at h and -h, where it turns by 8000 N / h: 4e-7 of (2 N)^2."""
    h = 2.0**-7
    contacts = [Contact([0, y, 0], [1, 0, 0], 0.0) for y in (h, -h)]
    state = {"r": [-1, 0, 0, 8000 / h, 0, 0], "forces": [[1, 0, 0]] * 2}
    found = near(*asked(Grasp(contacts, []), [-2, 0, 0, 2 * h * D, 0, 0], state))
    assert (found.where, found.missed) == ("the work of what (1) and (2) miss", pytest.approx(4e-10, rel=1e-5))


def test_friction_that_does_not_oppose_the_slip_is_none_by_the_principle_alone() -> None:
    """The same state without the dissipation principle, which leaves friction its cone, and with it."""
    state = {"r": [-1, 1, 0, 0, 0, 0], "forces": [[1, 0.1, 0]]}
    p, x = asked(Grasp([Contact([0, 0, 0], [1, 0, 0], FRICTION)], []), [-1, -0.1, 0, 0, 0, 0], state)
    assert not near(p, x).shown
    found = near(replace(p, mdp=False), x)
    assert (found.shown, found.modes.contact[0]) == (True, Kind.RUBS)


def test_an_object_that_turns_about_its_contact_does_no_work_there() -> None:
    """A part in 1e10 of the load is missing at a contact that stays where it is."""
    place, turn = np.array([0.3, -0.2, 0.5]), np.array([1e6, 0, 0])
    load = np.r_[-1.0, 0, 0, np.cross(place, [-1.0, 0, 0])]
    state = {"r": [*(-np.cross(turn, place) - [1 + D, 0, 0]), *turn], "forces": [[1 + D, 0, 0]]}
    found = near(*asked(Grasp([Contact(place, [1, 0, 0], 0.0)], []), load.tolist(), state))
    assert (found.where, found.missed) == ("(1), forces", pytest.approx(D, rel=1e-4))


def test_what_is_missing_at_a_joint_does_work() -> None:
    """A motor of 1 + 1e-10 N at a contact of 1 N moves 4000 with the object: 4e-7 of the square of the load."""
    grasp = Grasp(
        [Contact([0, 0, 0], [1, 0, 0], 0.0)], [slide("b", [1, 0, 0], 0)], Mechanism.direct(["b"]), {"b": 1 + D}
    )
    state = {"r": [3999, 0, 0, 0, 0, 0], "q": [4000], "f": [1 + D], "forces": [[1, 0, 0]]}
    found = near(*asked(grasp, [-1, 0, 0, 0, 0, 0], state))
    assert (found.where, found.missed) == ("the work of what (1) and (2) miss", pytest.approx(4e-10, rel=1e-5))


@pytest.mark.parametrize("way", [[1, 0], [0, 1]])
def test_a_contact_without_friction_has_none(way: list[float]) -> None:
    """The tenth of the load that it is said to carry across is missing."""
    across = 0.1 * np.array(way)
    state = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, *across]]}
    p, x = asked(Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], []), [-1, *-across, 0, 0, 0], state)
    assert near(p, x).missed * p.granted == pytest.approx(0.1)


def on_a_curve(p: Problem, a: State, b: State, load: Array) -> Near:
    """From a, which the load balances, to b, which that of the problem does."""
    tables = {f.name: np.stack([getattr(x, f.name) for x in (a, b)]) for f in fields(State)}
    asked = replace(p, wrench=load, along=p.wrench - load)
    return along(asked, np.array([0.0, 1.0]), tables, p.granted)


@GIVES_WAY
def test_a_contact_gives_way_on_a_curve_where_it_does_at_one_end(motion, force, mode, changed, limits) -> None:
    """As above, from or to a state in which nothing is off."""
    right = [np.round(x, 6) for x in (motion, force)]
    states = [{"r": [*r, 0, 0, 0], "forces": [f]} for r, f in ((motion, force), right)]
    loads = [[-y + (0.5 if mode == "OPEN" else 0) for y in f] + [0, 0, 0] for f in (force, right[1])]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], FRICTION)], [])
    (p, x), (q, y) = (asked(grasp, w, at, **limits) for w, at in zip(loads, states, strict=True))
    for found in (on_a_curve(p, y, x, q.wrench), on_a_curve(q, x, y, p.wrench)):
        assert found.modes.contact[0] == getattr(Kind, mode)
        assert off(found) == pytest.approx(changed, rel=1e-4, abs=1e-4 * D)


@pytest.mark.parametrize("way", [[1, 0], [0, 1], [0.6, 0.8]])
def test_a_soft_finger_that_slides_is_not_twisted(way: list[float]) -> None:
    """Across its friction 1/2 it turns by a part in 1e10, which is as much more of the motion: twice that of 1 N."""
    lever = 0.01
    soft = Contact([0, 0, 0], [1, 0, 0], FRICTION, torsion=FRICTION * lever)
    y, z = way
    state = {"r": [-1, y, z, 0, 0, 0], "forces": [[1, -y / 2, -z / 2]], "torsion": [D * lever]}
    found = near(*asked(Grasp([soft], []), [-1, y / 2, z / 2, -D * lever, 0, 0], state))
    assert (found.shown, found.modes.contact[0]) == (True, Kind.SLIDES)
    assert off(found) == pytest.approx(2 * D, abs=1e-4 * D)


@pytest.mark.parametrize("F", [1e-3, 1.0, 1e3])
def test_work_is_missed_relative_to_the_square_of_the_load(F: float) -> None:
    """A part in 1e10 of the load is missing, and the object moves 4000 F along the wall: 4e-7 F^2, of 1e-6 F^2."""
    state = {"r": [-F * (1 + D), 4000 * F, 0, 0, 0, 0], "forces": [[F * (1 + D), 0, 0]]}
    p, x = asked(Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], []), [-F, 0, 0, 0, 0, 0], state)
    found = near(p, x)
    assert (found.where, found.missed) == ("the work of what (1) and (2) miss", pytest.approx(4e-10, rel=1e-5))
    found = near(replace(p, mdp=False), x)
    assert (found.where, found.missed) == ("(1), forces", pytest.approx(D, rel=1e-5))


@pytest.mark.parametrize("place", [[0.0, 0, 0], [0.25, -0.5, 0.125]])
@pytest.mark.parametrize(
    ("axis", "arm", "lever", "where", "missed"),
    [
        ([0, 0, 1.0], 3.0, 0.0, "(2) of joint 'a'", 3.0),
        ([0.6, 0, 0.8], 3.0, 1.0, "(2) of joint 'a'", 1.5 * (3 + 0.6)),  # it turns the soft finger by 0.6
        ([0.6, 0, 0.8], 0.1, 1.0, "(1), torques", 1.5 * (1 + 1)),
    ],
)
def test_what_forces_change_by_counts_with_their_levers(
    axis, arm: float, lever: float, where: str, missed, place
) -> None:
    """Contacts at h and -h along y; the force at one is D = 1e-10 N above its limit, which a locked joint moves.

    Friction of 1/2, with a lever of twisting, changes with it. All are arms in h, which is 1 N at any.
    """
    h, mu, place = 0.01, 0.5 * (lever > 0), np.array(place)
    contacts = [Contact(np.add(place, [0, y, 0]), [1, 0, 0], mu, torsion=mu * lever * h) for y in (h, -h)]
    mechanism = Mechanism(("m",), np.array([[2.0]]), np.zeros((0, 1)), (False,))
    joint = GraspJoint("a", axis, np.add(place, [0, h + arm * h, 0]), (0,))
    turn = np.array([0, 0, D / 2 / h])
    state = {"r": [*([-1 - D / 2, 0, 0] - np.cross(turn, place)), *turn], "forces": [[1 + D, 0, 0], [1, 0, 0]]}
    state["f"] = [axis[2] * arm * h * (1 + D) / 2]
    load = np.array([-2 - D, 0, 0])
    p, x = asked(Grasp(contacts, [joint], mechanism), [*load, *np.add(np.cross(place, load), [0, 0, h * D])], state)
    assert near(p, x).missed < 1e-14
    found = near(replace(p, force_limit=1.0), x)
    assert (found.where, found.missed * p.granted) == (where, pytest.approx(missed * D, rel=1e-5))


@pytest.mark.parametrize(("gap", "motion"), [(-0.4, -0.6), (0.25, -1.25)])
def test_a_contact_presses_from_where_it_was(gap: float, motion: float) -> None:
    """With 1 N, where it pressed with 0.4 N or was 0.25 N away before the step."""
    state = {"r": [motion, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]]}
    p, x = asked(Grasp([Contact([0, 0, 0], [1, 0, 0], FRICTION)], []), [-1, 0, 0, 0, 0, 0], state)
    before = StartData(np.array([gap]), np.zeros(0), np.zeros(0))
    found = near(replace(p, grasp=p.grasp.with_start(before)), x)
    assert found.shown
    assert off(found) < 1e-12


@pytest.mark.parametrize(("other", "slip"), [([1, 0.5 + D, 0], [-1, 0, 0]), ([1, 0.2, 0], [-1, 0, D])])
def test_what_changes_most_is_said(other: list[float], slip: list[float]) -> None:
    """The first of two contacts at one place is a part in 1e10 off, in force or motion; the second is not."""
    first, second = Contact([0, 0, 0], [1, 0, 0], FRICTION), Contact([0, 0, 0], [1, 0, 0], 0.0)
    load = [-other[0] - 1, -other[1], 0, 0, 0, 0]
    state = {"r": [*slip, 0, 0, 0], "forces": [other, [1, 0, 0]]}
    for contacts, forces in (([first, second], state["forces"]), ([second, first], state["forces"][::-1])):
        found = near(*asked(Grasp(contacts, []), load, state | {"forces": forces}))
        assert found.shown
        assert off(found) == pytest.approx(D, abs=1e-4 * D)


def held_back(mechanism: Mechanism | None = None, **law: object) -> Grasp:
    """A finger without a motor under a contact that pushes it along -x; another slide beside it moves nothing."""
    joints = [slide("b", [1, 0, 0], 0, **law), slide("free", [0, 1, 0], friction=0.5)]
    return Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], joints, mechanism or Mechanism.direct([]), {})


def test_one_motion_that_is_off_is_said_of_two() -> None:
    """Along x a part in 1e10 less than the force there, along y as much."""
    contacts = [Contact([0, 0, 0], [1, 0, 0], 0.0), Contact([0, 0, 0], [0, 1, 0], 0.0)]
    state = {"r": [-1 + D, -1, 0, 0, 0, 0], "forces": [[1, 0, 0], [0, 1, 0]]}
    for some in (slice(None), slice(None, None, -1)):
        found = near(*asked(Grasp(contacts[some], []), [-1, -1, 0, 0, 0, 0], state | {"forces": state["forces"][some]}))
        assert off(found) == pytest.approx(D, rel=1e-4)


@pytest.mark.parametrize(("reaction", "missed"), [(0.5, 0.0), (0.5 + D, D), (0.5 + 0.1, 0.1), (-0.5, 1.0)])
def test_friction_of_a_joint_at_rest_is_no_more_than_its_law(reaction: float, missed: float) -> None:
    """It pushes back with the load, and its friction is 0.5 N in either sense."""
    push = abs(reaction)
    mechanism = Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ())
    state = {"r": [-push, 0, 0, 0, 0, 0], "forces": [[push, 0, 0]], "reaction": [reaction, 0.0]}
    found = near(*asked(held_back(mechanism, friction=0.5), [-push, 0, 0, 0, 0, 0], state))
    assert found.missed == pytest.approx(missed / push, rel=1e-5, abs=1e-14)
    assert found.shown == (missed < 1e-9)


def test_a_joint_rests_where_only_another_one_moves() -> None:
    """Both are at an end of their friction."""
    state = {"r": [-0.5, 0, 0, 0, 0, 0], "q": [0, 0.25], "forces": [[0.5, 0, 0]], "reaction": [0.5, -0.5]}
    mechanism = Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ())
    found = near(*asked(held_back(mechanism, friction=0.5), [-0.5, 0, 0, 0, 0, 0], state))
    assert found.modes.joint.tolist() == [Part.RESTS, Part.MOVES]


@pytest.mark.parametrize("F", [1.0, 1e-6, 1e6])
@pytest.mark.parametrize(("sense", "mode"), [(1.0, Part.OPENS), (-1.0, Part.MOVES)])
def test_friction_of_a_joint_that_moves_is_that_of_its_sense(sense: float, mode: int, F: float) -> None:
    """The load pushes the finger 0.3 F back against its friction of 0.5 F: what is off of that is missing in (2).

    Also on the way there, from where it is at rest.
    """
    mechanism = Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ())
    joints = [slide("b", [sense, 0, 0], 0, friction=0.5 * F), slide("free", [0, 1, 0], friction=0.5)]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], joints, mechanism)
    for off in (0.0, D):
        state = {"r": [-0.8 * F, 0, 0, 0, 0, 0], "q": [-0.3 * F * sense, 0], "forces": [[0.5 * F, 0, 0]]}
        state["reaction"] = [F * sense * (0.5 + off), 0.0]
        p, x = asked(grasp, [-0.5 * F, 0, 0, 0, 0, 0], state)
        begun = replace(
            x, r=np.array([-0.5 * F, 0, 0, 0, 0, 0]), q=np.zeros(2), reaction=np.round(x.reaction / F, 6) * F
        )
        for found in (near(p, x), on_a_curve(p, begun, x, p.wrench)):
            assert found.modes.joint[0] == mode
            assert found.missed == pytest.approx(off / 0.5, rel=1e-5, abs=1e-14)


@pytest.mark.parametrize(
    ("stop", "sense", "friction"), [("lower", 1.0, 0.0), ("upper", -1.0, 0.0), ("upper", -1.0, 0.25)]
)
def test_a_joint_is_held_where_its_stop_is(stop: str, sense: float, friction: float) -> None:
    """The finger had moved 0.4 away from it, and is back there but for a part in 1e12, as another one at rest is."""
    joints = [slide("b", [sense, 0, 0], 0, stop=stop, friction=friction), slide("free", [0, 1, 0], friction=0.5)]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], joints, Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ()))
    back = {"q": [sense * (-0.4 + 1e-12), 1e-12], "reaction": [sense, 0.0]}
    p, x = asked(grasp, [-1, 0, 0, 0, 0, 0], {"r": [-1.4, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]]} | back)
    p = replace(p, grasp=p.grasp.with_start(StartData(np.zeros(1), np.array([0.4, 0.0]), np.zeros(0))))
    found = near(p, x)
    assert found.shown, found
    assert found.modes.joint.tolist() == [Part.BACK, Part.RESTS]
    assert off(found) == pytest.approx(1e-12, rel=1e-3)
    beyond = near(p, replace(x, q=np.array([-0.5 * sense, 0.0]), r=np.array([-1.5, 0, 0, 0, 0, 0])))
    assert not beyond.shown
    assert friction or (beyond.missed, beyond.where) == (np.inf, "the stop of joint 'b'")


def test_a_joint_that_leaves_its_stop_on_a_curve_is_not_held_there() -> None:
    """It had come 0.4 away: of a curve one end is back at the stop, one is where it was."""
    joints = [slide("b", [1, 0, 0], 0, stop="lower"), slide("free", [0, 1, 0], friction=0.5)]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], joints, Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ()))
    back = {"q": [-0.4, 0.0], "reaction": [1.0, 0.0]}
    p, x = asked(grasp, [-1, 0, 0, 0, 0, 0], {"r": [-1.4, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]]} | back)
    p = replace(p, grasp=p.grasp.with_start(StartData(np.zeros(1), np.array([0.4, 0.0]), np.zeros(0))))
    away = replace(x, q=np.zeros(2), r=np.array([-1.0, 0, 0, 0, 0, 0]))
    assert on_a_curve(p, x, x, p.wrench).modes.joint[0] == Part.BACK
    for found in (on_a_curve(p, x, away, p.wrench), on_a_curve(p, away, x, p.wrench)):
        assert found.modes.joint[0] == Part.FREE
        assert not found.shown


@pytest.mark.parametrize(
    ("load", "force", "where", "missed"),
    [
        ([-1.25, 0, 0, 0, 0, 0], 1.0, "(1), forces", 0.25),
        ([-1, 0, 0, 0, 0.25, 0], 1.0, "(1), torques", 0.25),
        ([-1, 0, 0, 0.25, 0, 0], 1.0, "(1), torques", 0.25),
        ([-1, 0, 0, 0, 0, 0], 1.25, "(2) of joint 'b'", 0.25),
    ],
)
def test_what_is_missed_is_rounded_up(load: list[float], force: float, where: str, missed: float) -> None:
    """By 1e-9 of it, which is more than sums are off; 1 N m is as much as 1 N at contacts 1 m from their middle."""
    contacts = [Contact([0, 0, z], [1, 0, 0], 0.0) for z in (1.0, -1.0)]
    joints = [GraspJoint("b", [1, 0, 0], [0, 0, 0], (0, 1), "prismatic")]
    grasp = Grasp(contacts, joints, Mechanism.direct(["b"]))
    state = {"r": [-0.5, 0, 0, 0, 0, 0], "forces": [[0.5, 0, 0]] * 2, "f": [force]}
    p, x = asked(grasp, load, state)
    found = near(p, x)
    assert found.where == where
    share = found.missed * p.granted / missed
    assert 1 + 0.9e-9 < share < 1 + 1.1e-9
    assert found.motion == pytest.approx(motion_size(p.grasp, x.motion))
    assert found.motion > 0


def test_a_command_is_within_the_limit_of_its_motor() -> None:
    """A finger at rest carries 1 N, all that its motor may, where 5e-10 N more are commanded: 1e-9 grants no such."""
    mechanism = Mechanism(("m",), np.array([[1.0, 0.0]]), np.zeros((0, 2)), (False,))
    state = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]], "f": [1.0]}
    p, x = asked(held_back(mechanism), [-1, 0, 0, 0, 0, 0], state)
    for command, limit, shown in ((1 + 5e-10, np.inf, True), (1 + 5e-10, 1.0, False), (1.0, 1.0, True)):
        own = replace(p, grasp=p.grasp.with_command(np.array([command])), torque_limit=np.array([limit]))
        found = near(own, x)
        assert found.shown == shown, (command, limit)
        assert shown or (found.missed, found.where) == (np.inf, "the limit of actuator 'm'")
    moves = replace(x, q=np.array([0.5, 0.0]), r=np.array([-0.5, 0, 0, 0, 0, 0]))
    for limit, shown in ((2.0, True), (1.0, False)):  # as one that moves
        own = replace(p, grasp=p.grasp.with_command(np.array([1 + 5e-10])), torque_limit=np.array([limit]))
        found = near(own, moves)
        assert found.modes.actuator.tolist() == [Part.MOVES]
        assert shown == found.shown
        assert shown or (found.missed, found.where) == (np.inf, "the limit of actuator 'm'")
    # what nobody commands is locked, and carries in either sense
    push = near(p, x)
    assert push.shown
    assert push.modes.actuator.tolist() == [Part.LOCKED]
    back = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]], "f": [-1.0]}
    other = Mechanism(("m",), np.array([[-1.0, 0.0]]), np.zeros((0, 2)), (False,))
    assert near(*asked(held_back(other), [-1, 0, 0, 0, 0, 0], back)).shown


def test_a_contact_opens_as_it_slides_where_its_normal_is_not_known() -> None:
    """By -0.8 x 3.7 + 0.6 x 5 = 0.04, but not by -0.8 x 3.8 + 3; the other presses by 3.2 less 0.6 times its slip."""
    contacts = [Contact([0, 0, 0], [1, 0, 0], 0.5), Contact([0, 0, 0], [0, 0, -1], 0.0)]
    for closer, shown in ((3.7, True), (3.8, False)):
        pressed = 0.8 * 4 - 0.6 * np.hypot(closer, 3)
        state = {"r": [-closer, 3, 4, 0, 0, 0], "forces": [[0, 0, 0], [0, 0, -pressed]]}
        p, x = asked(Grasp(contacts, []), [0, 0, pressed, 0, 0, 0], state)
        found = near(replace(p, cos=0.8, sin=0.6), x)
        assert found.shown == shown
        assert shown or found.where == "the law of contact 0"
        twisted = near(p, replace(x, torsion=np.array([0.1, 0.0])))
        assert (twisted.missed, twisted.where) == (np.inf, "torsion of a point contact")


def test_what_is_not_known_of_a_length_counts_with_the_largest_force() -> None:
    """It slides from y to z while c_n grows from 1 to 3 N. |d_t|^2 has the controls 1, 0, 1, and 1, 1, 1 stands for it.

    |d_t| >= 1 / sqrt 2 =: s is off by 1 / (1 + s) at most. In mu N, c_t |d_t| + mu c_n d_t has the controls 0, 2, 0 and
    3 times that along d_t, across it 0, 1, 0.
    """
    ends = [((-1, 1, 0), (1, -0.5, 0)), ((-3, 0, 1), (3, 0, -1.5))]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.5)], [])
    (p, x), (q, y) = (asked(grasp, [1, 0, 0, 0, 0, 0], {"r": [*d, 0, 0, 0], "forces": [c]}) for d, c in ends)
    s = 0.5**0.5
    for found in (on_a_curve(p, x, y, p.wrench), on_a_curve(q, y, x, q.wrench)):
        assert found.modes.contact[0] == Kind.SLIDES
        assert off(found) == pytest.approx(0.5 * np.hypot(2 + 3 / (1 + s), 1) / s, rel=1e-6)


def test_products_of_curves_are_those_of_their_points() -> None:
    """(1 + t^2) (3 t^3 - t), cubic controls each: the product's control values by hand."""
    a, b = np.array([[1], [1], [4 / 3], [2]]), np.array([[0], [-1 / 3], [-2 / 3], [2]])
    by_hand = np.array([0, -1 / 6, -1 / 3, -2 / 5, -4 / 15, 2 / 3, 4])[:, None]
    _weights.cache_clear()  # not what another test has made
    assert product(a, b) == pytest.approx(by_hand, abs=1e-15)
    assert product(a, b).shape == by_hand.shape
    assert nodes(2) == pytest.approx([0, 0.5, 1])


def test_control_values_are_those_of_a_polynomial() -> None:
    """t^2 and 2 t (1 - t) from their values at 0, 1/2 and 1; lengths of curves beside others are as near as alone."""
    values = np.array([[0, 0], [0.25, 0.5], [1, 0]])
    controls_of.cache_clear()
    assert controls_of(2) @ values == pytest.approx(np.array([[0, 0], [0, 1], [1, 0]]), abs=1e-15)
    a = np.array([[1, 0], [5, 1], [-3, 2]], dtype=float)[:, None]
    small, straight = 1e-3 * a, np.array([[1, 0], [2, 0], [3, 0]], dtype=float)[:, None]
    bent = np.array([[3, 0], [2, 2], [1, 3]], dtype=float)[:, None]
    together = np.concatenate([a, small, straight, bent], axis=1)
    length, off = _norm(together, least_norm(together))
    for k, one in enumerate((a, small, straight, bent)):
        alone, apart = _norm(one, least_norm(one))
        assert length[:, k] == pytest.approx(alone[:, 0])
        assert off[k] == pytest.approx(apart[0], abs=1e-14)


@pytest.mark.parametrize(
    ("command", "limit", "good", "bad", "missed"),
    [
        (0.0, 1.0, (0, 1), (0, 1 + D), D),  # locked, beyond its limit
        (0.0, 1.0, (0, -1), (0, -1 - D), D),
        (1.0, np.inf, (0, 1.5), (0, 1 - D), D),  # at rest: it carries at least its command
        (-1.0, np.inf, (0, -1.5), (0, -1 + D), D),
        (1.0, np.inf, (0.5, 1), (0.25, 1 + D), D),  # it moves: its command
        (1.0, np.inf, (0, 1), (0.5, 1 + D), D),  # from where it was at rest
        (1.0, np.inf, (0.5, 1), (-0.25, 1), 0.5),  # it may not move back: held at 0, 0.5 from where the contact is
    ],
)
@pytest.mark.parametrize("F", [1.0, 1e-6, 1e6])
def test_a_motor_gives_way_on_a_curve_where_it_does_at_one_end(command, limit, good, bad, missed, F: float) -> None:
    """(motion, force) at the ends, of F; the contact presses as the motor does, by a gear that halves its motion."""
    side = -1.0 if good[1] < 0 else 1.0
    motor = Mechanism(("b",), np.array([[2.0]]), np.zeros((0, 1)), (False,))
    contact = Contact([0, 0, 0], [side, 0, 0], 0.0)
    grasp = Grasp([contact], [slide("b", [1, 0, 0], 0)], motor, {"b": F * command / 2})
    made = [
        asked(
            grasp,
            [-F * f, 0, 0, 0, 0, 0],
            {"r": [F * (q - f), 0, 0, 0, 0, 0], "q": [F * q], "f": [F * f / 2], "forces": [[F * f, 0, 0]]},
            torque_limits={"b": F * limit / 2} if limit < np.inf else {},
        )
        for q, f in (good, bad)
    ]
    for (p, x), (_, y) in (made, made[::-1]):
        found = on_a_curve(p, y, x, -2 * np.r_[y.f, np.zeros(5)])
        assert found.missed * p.granted == pytest.approx(missed * F, rel=1e-4)


def test_friction_at_rest_is_off_on_a_curve_where_it_is_at_one_end() -> None:
    """From 0.3 N to D more than the 0.5 N that it takes."""
    grasp = held_back(Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ()), friction=0.5)
    made = [
        asked(grasp, [-f, 0, 0, 0, 0, 0], {"r": [-f, 0, 0, 0, 0, 0], "forces": [[f, 0, 0]], "reaction": [f, 0.0]})
        for f in (0.3, 0.5 + D)
    ]
    for (p, x), (q, y) in (made, made[::-1]):
        assert on_a_curve(p, y, x, q.wrench).missed * p.granted == pytest.approx(D, rel=1e-4)


@pytest.mark.parametrize(("stop", "sense"), [("lower", 1.0), ("upper", -1.0)])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("push", [0.3, 0.6])
def test_friction_of_a_joint_away_from_its_stop_is_its_own(stop: str, sense: float, side: float, push: float) -> None:
    """It had left it by 2 N, and rests there: it takes 0.5 N in either sense, as without a stop."""
    joints = [slide("b", [side, 0, 0], 0, stop=stop, friction=0.5), slide("free", [0, 1, 0], friction=0.5)]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], joints, Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ()))
    state = {"r": [-push, 0, 0, 0, 0, 0], "forces": [[push, 0, 0]], "reaction": [side * push, 0.0]}
    p, x = asked(grasp, [-push, 0, 0, 0, 0, 0], state)
    p = replace(p, grasp=p.grasp.with_start(StartData(np.zeros(1), np.array([2.0, 0.0]), np.zeros(0))))
    found = near(p, x)
    assert found.modes.joint.tolist() == [Part.RESTS, Part.RESTS]
    assert found.missed * p.granted == pytest.approx(max(push - 0.5, 0.0), rel=1e-6, abs=1e-12)
    assert sense * p.grasp.stops_left[0] == 2


@pytest.mark.parametrize("F", [1.0, 2.0**-20, 2.0**20])
@pytest.mark.parametrize(
    ("ends", "roundings"),
    [
        ([([-1, 0, 0], [1, 0.5, 0])] * 2, 4 * (0.5 + 0.5)),  # at the edge of its cone: of c_t and mu c_n
        ([([-1, 0, 0], [1, 0.25, 0]), ([-1, 0, 0], [1, 0.5, 0])], 4 * (0.5 + 0.5)),
        # sliding: 32 of (c_t + mu c_n) |d_t|, and 16 of c_t mu c_n over c_t times |d_t|, over the least c_t
        ([([-1, 4, 0], [1, -0.5, 0])] * 2, (32 * 1 * 4 + 16 * 0.5 * 4) / 0.5),
        ([([-1, 4, 0], [1, -0.5, 0]), ([-2, 8, 0], [2, -1, 0])], (32 * 2 * 8 + 16 * 1 / 0.5 * 8) / 0.5),
    ],
)
def test_what_rounding_may_hide_is_allowed_for(ends, roundings: float, F: float) -> None:
    """Numbers that floats hold, so that nothing is off: no more is changed than that, and no less."""
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.5)], [])
    (p, x), (q, y) = (
        asked(
            grasp,
            [-F * f for f in force] + [0] * 3,
            {"r": [*F * np.array(d), 0, 0, 0], "forces": [F * np.array(force)]},
        )
        for d, force in ends
    )
    for found in (on_a_curve(p, y, x, q.wrench), on_a_curve(q, x, y, p.wrench)):
        assert off(found) == pytest.approx(roundings * 2.0**-53 * F * (1 + 1e-9), rel=1e-11, abs=0)


def test_each_contact_changes_as_if_it_were_alone() -> None:
    """Five at one place, from one state to another: with and without friction, sliding, open, and a little off."""
    ends = [np.array([-1.0, 0.25, -2, 0, 0, 0]), np.array([-2.0, 0.5, -1, 0, 0, 0])]
    normals, mu = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0], [-1, 0, 0]], [0.5, 0.25, 0.0, 4.0, 0.5]
    forces = [
        [[1, -0.1, 0.5 + D], [0, 0, 0], [0, 0, 2], [1 + D, 0.5, 3.9], [0, 0, 0]],
        [[2, -0.4, 0.9], [0, D, 0], [0.5 * D, D, 1 - D], [2, 0.25, 0], [-D, 0, D]],
    ]

    def curve(some: list[int]) -> _Curve:
        grasp = Grasp([Contact([0, 0, 0], normals[k], mu[k]) for k in some], [])
        made = [
            asked(grasp, [1, 0, 0, 0, 0, 0], {"r": r, "forces": np.array(f, dtype=float)[some]}, force_limit=1.75)
            for r, f in zip(ends, forces, strict=True)
        ]
        p = replace(made[0][0], cos=0.8, sin=0.6)
        tables = {f.name: np.stack([getattr(x, f.name) for _, x in made]) for f in fields(State)}
        with np.errstate(all="ignore"):
            return _Curve(p, np.zeros(2), tables, 1.0)

    together = curve([*range(5)])
    for k in range(5):
        alone = curve([k])
        assert together.contact[k] == alone.contact[0]
        assert together.c_off[k] == pytest.approx(alone.c_off[0], rel=1e-12, abs=0)
        assert together.slip[k] == pytest.approx(alone.slip[0], rel=1e-12, abs=0)


def test_what_is_locked_is_not_back_at_its_stop() -> None:
    """The stop is 0.4 away, where a locked motor cannot be."""
    grasp = Grasp(
        [Contact([0, 0, 0], [1, 0, 0], 0.0)], [slide("b", [1, 0, 0], 0, stop="lower")], Mechanism.direct(["b"])
    )
    state = {"r": [-1.4, 0, 0, 0, 0, 0], "q": [-0.4], "forces": [[1, 0, 0]], "reaction": [1.0]}
    p, x = asked(grasp, [-1, 0, 0, 0, 0, 0], state)
    found = near(replace(p, grasp=p.grasp.with_start(StartData(np.zeros(1), np.array([0.4]), np.zeros(1)))), x)
    assert (found.missed, found.where) == (np.inf, "what stops and tendons hold")


def test_pressure_is_turned_where_normals_are_uncertain() -> None:
    """c_n + 0.8 d_n is off by D: the motion by D / 0.8."""
    p, x = asked(
        Grasp([Contact([0, 0, 0], [1, 0, 0], FRICTION)], []),
        [-1, 0, 0, 0, 0, 0],
        {"r": [-(1 + D) / 0.8, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]]},
    )
    assert off(near(replace(p, cos=0.8, sin=0.6), x)) == pytest.approx(1.25 * D, rel=1e-4)


def test_what_is_missed_has_the_name_of_its_part() -> None:
    """The second of two motors moves, D off its command; joints, contacts and motors by their names or numbers."""
    contacts = [Contact([0, y, 0], [1, 0, 0], 0.0) for y in (0.01, -0.01)]
    joints = [slide("a", [1, 0, 0], 0), slide("b", [1, 0, 0], 1)]
    geared = Mechanism(("a", "b"), 2 * np.eye(2), np.zeros((0, 2)), (False, False))
    grasp = Grasp(contacts, joints, geared, {"a": 0.5, "b": 0.5})
    state = {"r": [-1, 0, 0, 0, 0, 0], "q": [0, 0.5], "f": [0.5, (1 + D) / 2], "forces": [[1, 0, 0]] * 2}
    p, x = asked(grasp, [-2, 0, 0, 0, 0, 0], state)
    tables = {f.name: np.stack([getattr(x, f.name)] * 2) for f in fields(State)}
    with np.errstate(all="ignore"):
        curve = _Curve(p, np.zeros(2), tables, p.granted)
    assert curve.faults["actuator 'b', which moves, off its command"] == pytest.approx(D / p.granted, rel=1e-5)
    names = ["actuator '{}', which moves, off its command", "the limit of actuator '{}'", "the sense of actuator '{}'"]
    names += ["the reaction of joint '{}' off its law", "the stop of joint '{}'", "the sense of joint '{}'"]
    due = {name.format(own) for name in names for own in "ab"} | {f"the law of contact {k}" for k in (0, 1)}
    assert set(curve.faults) <= due
    assert len({name.replace("'b'", "'a'") for name in curve.faults}) == 7
    assert curve.actuator.tolist() == [Part.RESTS, Part.MOVES]


def test_a_reaction_off_its_law_is_a_force_at_the_joint_s_lever() -> None:
    """Of the second of two free joints, 2 m from what it moves: 0.5 N m."""
    contacts = [Contact([0, 0, 0], [1, 0, 0], 0.0) for _ in "ab"]
    joints = [GraspJoint(name, [0, 0, 1], [0, -2, 0], (k,)) for k, name in enumerate("ab")]
    grasp = Grasp(contacts, joints, Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ()))
    state = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]] * 2, "reaction": [0.0, 0.5]}
    p, x = asked(grasp, [-2, 0, 0, 0, 0, 0], state)
    tables = {f.name: np.stack([getattr(x, f.name)] * 2) for f in fields(State)}
    with np.errstate(all="ignore"):
        curve = _Curve(p, np.zeros(2), tables, p.granted)
    assert p.grasp.joint_arms.tolist() == [2, 2]
    assert curve.faults["the reaction of joint 'b' off its law"] * p.granted == pytest.approx(0.25)


@pytest.mark.parametrize(("missed", "shown"), [(0.0, True), (EPS * (1 - 2e-6), True), (EPS, False), (np.nan, False)])
def test_a_little_less_than_the_tolerance_is_shown(missed: float, shown: bool) -> None:
    assert Near(missed, "", SimpleNamespace(), 0.0, 0.0, 0.0).shown == shown  # type: ignore[arg-type]


def test_work_at_a_joint_counts_at_any_end_of_a_curve() -> None:
    """As above: a motor of 1 + 1e-10 N, from where it has not moved to 4000 m, or back."""
    grasp = Grasp(
        [Contact([0, 0, 0], [1, 0, 0], 0.0)], [slide("b", [1, 0, 0], 0)], Mechanism.direct(["b"]), {"b": 1 + D}
    )
    state = {"r": [3999, 0, 0, 0, 0, 0], "q": [4000], "f": [1 + D], "forces": [[1, 0, 0]]}
    p, x = asked(grasp, [-1, 0, 0, 0, 0, 0], state)
    begun = replace(x, r=np.array([-1.0, 0, 0, 0, 0, 0]), q=np.zeros(1))
    for found in (on_a_curve(p, x, begun, p.wrench), on_a_curve(p, begun, x, p.wrench)):
        assert (found.where, found.missed) == ("the work of what (1) and (2) miss", pytest.approx(4e-10, rel=1e-5))


def test_a_stop_carries_beyond_friction_all_along_a_curve() -> None:
    """It is back at the stop; at one end its reaction of 0.1 N is one that friction of 0.25 N takes alone."""
    joints = [slide("b", [1, 0, 0], 0, stop="lower", friction=0.25), slide("free", [0, 1, 0], friction=0.5)]
    grasp = Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], joints, Mechanism((), np.zeros((0, 2)), np.zeros((0, 2)), ()))
    start = StartData(np.zeros(1), np.array([0.4, 0.0]), np.zeros(0))
    states = []
    for push in (1.0, 0.1):
        state = {"r": [-0.4 - push, 0, 0, 0, 0, 0], "forces": [[push, 0, 0]], "q": [-0.4, 0], "reaction": [push, 0]}
        p, x = asked(grasp, [-push, 0, 0, 0, 0, 0], state)
        states.append((replace(p, grasp=p.grasp.with_start(start)), x))
    (p, x), (q, y) = states
    assert near(p, x).modes.joint[0] == Part.BACK
    for found in (on_a_curve(p, y, x, q.wrench), on_a_curve(q, x, y, p.wrench)):
        assert found.modes.joint[0] == Part.RESTS
        assert not found.shown


@pytest.mark.parametrize("mdp", [True, False])
def test_an_open_soft_finger_carries_nothing(mdp: bool) -> None:
    """It is 1 m away, beside a contact that carries the load."""
    contacts = [Contact([0, 0, 0], [1, 0, 0], 0.5, torsion=0.01), Contact([0, 0, 0], [0, 0, 1], 0.0)]
    state = {"r": [1, 0, -1, 0, 0, 0], "forces": [[0, 0, 0], [0, 0, 1]]}
    p, x = asked(Grasp(contacts, []), [0, 0, -1, 0, 0, 0], state)
    found = near(replace(p, mdp=mdp), x)
    assert found.shown
    assert found.modes.contact[0] == Kind.OPEN


def test_friction_of_one_is_friction() -> None:
    state = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0.5, 0]]}
    assert near(*asked(Grasp([Contact([0, 0, 0], [1, 0, 0], 1.0)], []), [-1, -0.5, 0, 0, 0, 0], state)).shown


def test_a_motor_and_friction_at_one_joint_are_off_together() -> None:
    """Each D beyond what it may: 0.5 N and 0.5 N."""
    mechanism = Mechanism(("m",), np.array([[1.0, 0.0]]), np.zeros((0, 2)), (False,))
    grasp, off = held_back(mechanism, friction=0.5), 0.5 + D
    state = {"r": [-2 * off, 0, 0, 0, 0, 0], "forces": [[2 * off, 0, 0]], "f": [off], "reaction": [off, 0.0]}
    p, x = asked(grasp, [-2 * off, 0, 0, 0, 0, 0], state, torque_limits={"m": 0.5})
    found = near(p, x)
    assert (found.where, found.missed * p.granted) == ("(2) of joint 'b'", pytest.approx(2 * D, rel=1e-4))


def test_work_that_is_missed_is_rounded_up() -> None:
    """0.25 N times 4e6 m, of (1.25 N)^2; a thousandth of it counts as much as forces do."""
    state = {"r": [-1, 4e6, 0, 0, 0, 0], "forces": [[1, 0, 0]]}
    found = near(*asked(Grasp([Contact([0, 0, 0], [1, 0, 0], 0.0)], []), [-1.25, 0, 0, 0, 0, 0], state))
    assert found.where == "the work of what (1) and (2) miss"
    share = found.missed * 1.25**2 / (0.25 * np.hypot(1, 4e6) * 1e-3)
    assert 1 + 0.9e-9 < share < 1 + 1.1e-9


def test_no_number_is_no_small_fault() -> None:
    curve = SimpleNamespace(F=2.0, faults={})
    _Curve._fault(curve, "a {}", np.array([1.0, 3.0]), ("p", "q"))
    _Curve._fault(curve, "a {}", np.array([0.0, 2.0]), ("p", "q"))
    _Curve._fault(curve, "b {}", np.array([1.0, np.nan, 3.0]))
    assert curve.faults == {"a q": 1.5, "b 1": np.inf}


def test_least_lengths_of_vectors_beside_others_are_those_alone() -> None:
    a = np.array([[[3.0, 4], [1, 0], [1, 0], [2, 0], [5, 0]], [[3, 4], [0, 1], [-1, 0], [7, 0], [1, 0]]])
    assert least_norm(a) == pytest.approx([5, np.sqrt(0.5), 0, 2, 1])


@pytest.mark.parametrize("law", ["locked", "commanded", "friction", "coupled"])
@pytest.mark.parametrize("which", [0, 1])
def test_each_of_two_joints_is_held(law: str, which: int) -> None:
    """Motors, friction or couplings hold fingers under contacts at 1 cm along y: one is said to be 1/4 from there.

    The object turns with it, so that both contacts press with 1 N; of a finger that is held one does so by 1/4 less.
    """
    contacts = [Contact([0, y, 0], [1, 0, 0], 0.0) for y in (0.01, -0.01)]
    friction = {"friction": 2.0} if law == "friction" else {}
    joints = [slide(name, [1, 0, 0], k, **friction) for k, name in enumerate("ab")]
    none, two = np.zeros((0, 2)), np.eye(2)
    motors = Mechanism(("a", "b"), two, none, (False, False))
    held = {"friction": Mechanism((), none, none, ()), "coupled": Mechanism((), none, two, ())}.get(law, motors)
    grasp = Grasp(contacts, joints, held, {"a": 0.5, "b": 0.5} if law == "commanded" else {})
    own = {"friction": "reaction", "coupled": "coupling"}.get(law, "f")
    state = {"r": [-1, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]] * 2, own: np.ones(2)}
    p, x = asked(grasp, [-2, 0, 0, 0, 0, 0], state)
    assert near(p, x).shown
    turned = np.array([-1 + 1 / 8, 0, 0, 0, 0, [-12.5, 12.5][which]])
    found = near(p, replace(x, q=two[which] / 4, r=turned))
    assert found.missed * p.granted == pytest.approx(0.25)


# --- beside others as alone ------------------------------------------------------------------------------


def of_contacts(
    motion: list[Array],
    contacts: list[tuple[list[float], float]],
    forces: list[list[Array]],
    sin: float,
    some: list[int],
) -> _Curve:
    """Of some contacts (normal, friction) at the origin; forces (n, t1, t2) of each, control by control."""
    made = Grasp([Contact([0, 0, 0], *contacts[k]) for k in some], [])
    p, x = asked(made, [1, 0, 0, 0, 0, 0], {"r": [0.0] * 6, "forces": np.zeros((len(some), 3))})
    p = replace(p, cos=np.sqrt(1 - sin**2), sin=sin)
    tables = {f.name: np.stack([getattr(x, f.name)] * len(motion)) for f in fields(State)}
    tables["r"] = np.array([[*r, 0, 0, 0] for r in motion], dtype=float)
    tables["c"] = np.array([np.concatenate([forces[k][i] for k in some]) for i in range(len(motion))], dtype=float)
    with np.errstate(all="ignore"):
        return _Curve(p, np.zeros(len(motion)), tables, 1.0)


X, BACKWARD = [1.0, 0, 0], [-1.0, 0, 0]
PRESSES = [1.0, 1.25, 2.0]  # along the curve, as the object comes nearer


def across(*shares: float) -> list[Array]:
    """Forces along t1 beside those that press."""
    return [np.array([n, t, 0.0]) for n, t in zip(PRESSES, shares, strict=True)]


STICKING = [
    (X, 0.5, across(0, 0.85, 0)),  # inside by its squares, but for a little, where its control values are outside
    (X, 4.0, across(3, 2, 8.5)),
    (X, 0.5, across(0.5, 0.625, 1.0)),  # at the edge
    (X, 0.0, across(0, 0, 0)),
    (BACKWARD, 0.5, [np.zeros(3)] * 3),
]


def test_contacts_that_stick_change_as_if_they_were_alone() -> None:
    """Of squares: (0, 0.85, 0) has the controls (0, 0, 0.7225 4 / 6, 0, 0), mu^2 c_n^2 those of (4 + 3.125) / 24."""
    contacts, forces = [(n, mu) for n, mu, _ in STICKING], [f for *_, f in STICKING]
    motion = [np.array([-n, 0, 0]) for n in PRESSES]
    together = of_contacts(motion, contacts, forces, 0.0, [*range(5)])
    assert together.contact.tolist() == [Kind.STICKS] * 4 + [Kind.OPEN]
    over = 0.7225 * 4 / 6 - (4 + 2 * 1.5625 * 2) / 24
    assert together.c_off[:2] == pytest.approx([over / 0.5, 0.5], rel=1e-8)
    assert 0 < together.c_off[2] < 1e-14
    for k in range(5):
        alone = of_contacts(motion, contacts, forces, 0.0, [k])
        assert together.contact[k] == alone.contact[0]
        assert together.c_off[k] == pytest.approx(alone.c_off[0], rel=1e-12, abs=0)
        assert together.slip[k] == pytest.approx(alone.slip[0], rel=1e-12, abs=0)


@pytest.mark.parametrize("sin", [0.0, 0.6])
def test_contacts_that_slide_change_as_if_they_were_alone(sin: float) -> None:
    """Along t1, farther and farther; one pushes a little aside of that, one has its motion along the face alone."""
    t1 = asked(Grasp([Contact([0, 0, 0], X, 0.5)], []), [1.0] + [0] * 5, {"r": [0.0] * 6, "forces": [[0, 0, 0]]})[0]
    _, way, aside = t1.grasp.frames[0].T
    cos = np.sqrt(1 - sin**2)
    size = np.array(PRESSES)
    motion = [s * (np.array([-1.0, 0, 0]) + 0.5 * way) for s in size]
    press = cos - 0.5 * sin

    def slides(mu: float, aside: float = 0.0) -> list[Array]:
        return [s * press * np.array([1.0, -mu, aside]) for s in size]

    contacts = [(X, 0.5), (X, 4.0), (X, 0.5), (BACKWARD, 0.5), (way.tolist(), 0.5), (aside.tolist(), 2.0)]
    forces = [slides(0.5), slides(4.0), slides(0.5, 1e-10), *([np.zeros(3)] * 3 for _ in range(3))]
    together = of_contacts(motion, contacts, forces, sin, [*range(6)])
    assert together.contact.tolist() == [Kind.SLIDES] * 3 + [Kind.OPEN] * 3
    assert (together.slip < 1e-9).all()
    assert (together.slip[:3] >= 8 * 2.0**-53 * sin * 1.0).all()  # of the largest speed
    for k in range(6):
        alone = of_contacts(motion, contacts, forces, sin, [k])
        assert together.contact[k] == alone.contact[0]
        assert together.c_off[k] == pytest.approx(alone.c_off[0], rel=1e-12, abs=0)
        assert together.slip[k] == pytest.approx(alone.slip[0], rel=1e-12, abs=0)


def test_friction_that_hardly_slides_is_turned_at_the_cost_of_its_motion() -> None:
    """It slides by 1e-3 N, at an angle of 1e-7 to its friction, and presses with D more than it may."""
    aside = np.array([-0.5, 0.5e-7])
    p, x = asked(
        Grasp([Contact([0, 0, 0], X, 0.5)], []),
        [-1, 0, 0, 0, 0, 0],
        {"r": [-1 - D, 0, 0, 0, 0, 0], "forces": [[1, 0, 0]]},
    )
    r = np.array([-1.0 - D, *(p.grasp.frames[0] @ [0, 1e-3, 0])[1:], 0, 0, 0])
    at = replace(x, r=r, c=np.array([1 + D, *(aside * (1 + D))]))
    found = near(replace(p, force_limit=1.0), at)
    assert found.modes.contact[0] == Kind.SLIDES
    assert off(found) == pytest.approx(1.5 * D, rel=1e-3)  # friction is clipped with it; of the motion it is less


# --- what is back at its stop -----------------------------------------------------------------------------


@pytest.mark.parametrize("F", [1.0, 2.0**-20, 2.0**20])
@pytest.mark.parametrize("stop", ["lower", "upper"])
@pytest.mark.parametrize("less", [0.5, 0.9, 1.1])
def test_a_stop_carries_beyond_friction_but_for_the_tolerance(stop: str, less: float, F: float) -> None:
    """A joint 2 m from its contact had turned 0.4 F / 2 from its stop and is back, but for a little of that.

    Its reaction is friction and a little less, as at the contact `less` 1e-9 F; then friction alone carries it at rest.
    """
    sense = 1.0 if stop == "lower" else -1.0
    joint = GraspJoint("a", [0, 0, -sense], [0, -2, 0], (0,), stop=stop, friction=0.5 * F)
    grasp = Grasp([Contact([0, 0, 0], X, 0.0)], [joint], Mechanism((), np.zeros((0, 1)), np.zeros((0, 1)), ()))
    p, x = asked(grasp, [-F, 0, 0, 0, 0, 0], {"r": [-F, 0, 0, 0, 0, 0], "forces": [[F, 0, 0]]})
    assert p.grasp.joint_arms.tolist() == [2]
    missed = less * 1e-9 * F
    start = StartData(np.zeros(1), np.array([0.2 * F]), np.zeros(0))
    tables = {f.name: np.stack([getattr(x, f.name)] * 2) for f in fields(State)}
    tables["q"] = np.full((2, 1), -sense * 0.2 * F * (1 - 1e-9))  # by 0.4e-9 F at the contact
    tables["reaction"] = np.full((2, 1), sense * (0.5 * F - 2 * missed))
    with np.errstate(all="ignore"):
        curve = _Curve(replace(p, grasp=p.grasp.with_start(start)), np.zeros(2), tables, F)
    assert curve.joint[0] == (Part.BACK if less < 1 else Part.RESTS)
    assert curve.reaction_off[0] == pytest.approx(2 * missed if less < 1 else 0.0, rel=1e-4)


def test_where_joints_are_held_counts_as_a_change() -> None:
    """Nothing acts, and nothing moves: 8 m of a jaw that is locked are none, and contacts were told so far away."""
    contacts = [Contact([x, 0, 0], [-x, 0, 0], 0.5) for x in (-1.0, 1.0)]
    jaw = GraspJoint("jaw", [1, 0, 0], [0, 0, 0], (0,), "prismatic")
    p, x = asked(Grasp(contacts, [jaw]), [0.0] * 6, {"forces": np.zeros((2, 3)), "q": [8.0]})
    found = near(p, x)
    assert found.shown
    assert off(found) == pytest.approx(8 * np.abs(p.grasp.rows[0][:, 6] / p.grasp.row_units).max())
    assert off(found) > 4
