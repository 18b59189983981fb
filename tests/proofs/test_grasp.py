"""Grasps as proofs read them: maps by hand, against the model and exactly; sizes; every fault of a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import fmpq

from handfast.core import bundled
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.proofs.fields import BadFile, Fields
from handfast.proofs.grasp import (
    LENGTH_ROUNDING,
    MAX_GRASP_SIZE,
    STOP_SIDES,
    UNIT_TOLERANCE,
    GraspData,
    StartData,
    read_grasp,
    read_start,
)
from handfast.readers.grasp_file import load_grasp, to_dict
from tests.support.law_grasps import random_law_grasp
from tests.support.problems import bell, nest, pinch, solved
from tests.support.refused import refused
from tests.support.small_grasp import small_grasp

ULP = 2.0**-53


def softened(grasp: Grasp, rng: np.random.Generator) -> Grasp:
    """Some of the contacts as soft fingers."""
    contacts = [replace(c, friction=0.4, torsion=rng.choice([0.0, 0.003, 0.02])) for c in grasp.contacts]
    return Grasp(contacts, grasp.joints, grasp.mechanism, grasp.command, grasp.name)


def random_soft(seed: int) -> Grasp:
    rng = np.random.default_rng(seed)
    return softened(random_law_grasp(rng), rng)


SOURCES: dict[str, Callable[[], Grasp]] = {
    **{name: (lambda name=name: load_grasp(name)) for name in bundled.names("grasps")},  # type: ignore[misc]
    "pinch": pinch,
    "nest": nest,
    "bell": bell,
    "solved": lambda: solved(3).grasp,
    **{f"random {seed}": (lambda seed=seed: random_soft(seed)) for seed in range(12)},  # type: ignore[misc]
}


@pytest.fixture(params=SOURCES)
def pair(request: pytest.FixtureRequest) -> tuple[Grasp, GraspData]:
    """A grasp of the model, and what proofs read from its file."""
    grasp = SOURCES[request.param]()
    return grasp, read_grasp(to_dict(grasp), "grasp")


@pytest.fixture
def small() -> GraspData:
    return read_grasp(small_grasp(), "g")


def altered(path: str, value: Any) -> dict[str, Any]:
    """The small grasp with another value at "contacts.0.normal"; `...` takes the field away."""
    data = small_grasp()
    *way, last = [int(x) if x.isdigit() else x for x in path.split(".")]
    at: Any = data
    for step in way:
        at = at[step]
    if value is ...:
        del at[last]
    else:
        at[last] = value
    return data


# --- by hand


def test_constants() -> None:
    assert (MAX_GRASP_SIZE, UNIT_TOLERANCE, LENGTH_ROUNDING) == (249, 1e-3, 1e-14)
    assert STOP_SIDES == ("", "lower", "upper", "both")


def test_what_is_read(small: GraspData) -> None:
    assert (small.m, small.l, small.a) == (2, 3, 3)
    assert small.positions.tolist() == [[0.5, 0, 0], [0, -0.25, 0.25]]
    assert small.frames[0].T.tolist() == [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    assert small.frames[1].T.tolist() == [[-1, 0, 0], [0, 0, -1], [0, -1, 0]]
    assert small.mu.tolist() == [0.5, 0.75]
    assert small.lever.tolist() == [0.5, 0]  # 0.25 / 0.5
    assert small.soft.tolist() == [0]
    assert small.links == ("tip", "")
    assert small.joints == ("turn", "slide", "roll")
    assert small.axes.tolist() == [[0, 0, 1], [0, 1, 0], [1, 0, 0]]
    assert small.origins.tolist() == [[0.5, -0.25, 0], [9, 9, 9], [0, 0, 0]]
    assert small.revolute.tolist() == [True, False, True]
    assert small.moves.tolist() == [[True, True, False], [False, True, True]]
    assert small.friction.tolist() == [0.25, 0, 0]
    assert small.torque.tolist() == [0, 0, -0.5]
    assert small.stop.tolist() == [0, 0, 2]
    assert small.actuators == ("pull", "push", "back")
    assert small.R.tolist() == [[2, -1, 0], [0, 0, 0.5], [0, 0, -4]]
    assert small.A.tolist() == [[0, 3, -1]]
    assert small.tendon.tolist() == [True, False, False]
    assert small.backdrivable.tolist() == [False, False, True]
    assert small.command.tolist() == [3, -0.75, 0]


@pytest.mark.parametrize(
    ("normal", "t1", "t2"),
    [
        # e is the axis that the normal is least along, t1 = n x e normalised, t2 = n x t1
        ([0.6, 0, 0.8], [-0.8, 0, 0.6], [0, -1, 0]),  # e = y: (0.6 x + 0.8 z) x y = 0.6 z - 0.8 x
        ([0, 0.6, -0.8], [0, -0.8, -0.6], [-1, 0, 0]),  # e = x: (0.6 y - 0.8 z) x x = -0.6 z - 0.8 y
        ([0.8, -0.6, 0], [-0.6, -0.8, 0], [0, 0, -1]),  # e = z: 0.8 (x x z) - 0.6 (y x z) = -0.8 y - 0.6 x
    ],
)
def test_frames_of_contacts(normal: list[float], t1: list[float], t2: list[float]) -> None:
    g = read_grasp(altered("contacts.0.normal", normal), "g")
    np.testing.assert_allclose(g.frames[0].T, [normal, t1, t2], atol=1e-15)


def test_tangents_are_of_unit_length_where_none_is_an_axis() -> None:
    n = np.array([2.0, 3.0, 6.0]) / 7.0  # e = x, n x x = (0, 6, -3) / 7 of length sqrt(45) / 7
    g = read_grasp(altered("contacts.0.normal", n.tolist()), "g")
    np.testing.assert_allclose(g.frames[0].T @ g.frames[0], np.eye(3), atol=1e-15)
    np.testing.assert_allclose(g.frames[0][:, 1], np.array([0, 6, -3]) / np.sqrt(45), atol=1e-15)


def test_maps_by_hand(small: GraspData) -> None:
    # contact 0: x/2 x z = -y/2, x/2 x y = z/2, x/2 x -x = 0; contact 1, p = (-y + z)/4: p x -x = (-y - z)/4,
    # p x -z = x/4, p x -y = x/4
    columns = [
        [0, 0, 1, 0, -0.5, 0],
        [0, 1, 0, 0, 0, 0.5],
        [-1, 0, 0, 0, 0, 0],
        [-1, 0, 0, 0, -0.25, -0.25],
        [0, 0, -1, 0.25, 0, 0],
        [0, -1, 0, 0.25, 0, 0],
    ]
    # turn: z x y/4 = -x/4, along t2 of contact 0. slide: y, along t1 of contact 0 and against t2 of contact 1.
    # roll: x x (-y + z)/4 = (-z - y)/4, along t1 and t2 of contact 1
    speeds = [[0, 0, 0], [0, 1, 0], [0.25, 0, 0], [0, 0, 0], [0, 0, 0.25], [0, -1, 0.25]]
    twist, turned = [0, 0, 0, 0, 0, 0.5], [0.5, 0, 0]  # the lever times z; turn is about z, a slide turns nothing
    assert small.G.T.tolist() == columns
    assert small.J.tolist() == speeds
    assert small.twist_map.T.tolist() == [twist]
    assert small.twist_jacobian.tolist() == [turned]
    signs = -1.0
    motion = np.vstack(
        [np.hstack([columns, signs * np.array(speeds)]), np.hstack([twist, signs * np.array(turned)])[None]]
    )
    own = np.hstack([np.zeros((7, 6)), [[2, -1, 0], [0, 0, 0.5], [0, 0, -4], [0, 3, -1], *np.eye(3)]])
    rows, sizes = (table[:-1] for table in small.rows)
    assert not any(table[-1].any() for table in small.rows)  # for what a contact has not
    assert rows.tolist() == np.vstack([motion, own]).tolist()
    assert small.exact_rows[: len(motion)] == [[fmpq(int(64 * x), 64) for x in row] for row in motion]
    assert small.exact_rows[:-1] == [[fmpq(int(64 * x), 64) for x in row] for row in rows]
    assert not any(small.exact_rows[-1])
    # sums of absolute values differ from these where a difference is behind them: p - origin of turn is
    # (1/2 + 1/2, 1/4, 0), z x that (1/4, 1, 0) with plus signs
    expected = np.abs(np.vstack([motion, own]))
    expected[1, 6], expected[2, 6] = 1.0, 0.25
    assert sizes.tolist() == expected.tolist()
    one, two, three, four, five = small.parts
    assert [(p.start, p.stop) for p in small.parts] == [(0, 6), (6, 7), (7, 10), (10, 11), (11, 14)]
    assert rows[two, :6].tolist() == [twist]
    assert rows[three, 6:].tolist() == small.R.tolist()
    assert rows[four, 6:].tolist() == small.A.tolist()
    assert rows[five, 6:].tolist() == np.eye(3).tolist()
    assert len(rows[one]) == 6


def test_sums_of_absolute_values_by_hand() -> None:
    # p = (1, 2, 3), n = (0.6, 0, 0.8), t1 = (-0.8, 0, 0.6), t2 = (0, -1, 0): p x n with plus signs is
    # (2 0.8 + 3 0, 3 0.6 + 1 0.8, 1 0 + 2 0.6) = (1.6, 2.6, 1.2)
    data = altered("contacts.0.normal", [0.6, 0, 0.8])
    data["contacts"][0]["position"] = [1, -2, 3]
    # the joint turns about (0, 0.6, 0.8) through (-1, 1, 2): arm with plus signs (2, 3, 5); axis x arm
    # (0.6 5 + 0.8 3, 0.8 2, 0.6 2) = (5.4, 1.6, 1.2), along n: 0.6 5.4 + 0.8 1.2 = 4.2
    data["joints"][0] |= {"axis": [0, 0.6, 0.8], "origin": [-1, 1, 2]}
    G, J, twist, turned = read_grasp(data, "g").sizes
    np.testing.assert_allclose(G[:, 0], [0.6, 0, 0.8, 1.6, 2.6, 1.2], rtol=1e-14)
    np.testing.assert_allclose(J[:3, 0], [4.2, 0.8 * 5.4 + 0.6 * 1.2, 1.6], rtol=1e-14)
    np.testing.assert_allclose(twist[:, 0], [0, 0, 0, 0.3, 0, 0.4], rtol=1e-14)
    np.testing.assert_allclose(turned[0], [0.5 * 0.64, 0, 0], rtol=1e-14)


# --- against the model, and exactly


def test_the_model_has_the_same(pair: tuple[Grasp, GraspData]) -> None:
    grasp, g = pair
    for mine, its, size in zip(
        (g.G, g.J, g.twist_map, g.twist_jacobian),
        (grasp.G, grasp.J, grasp.twist_map, grasp.twist_jacobian),
        g.sizes,
        strict=True,
    ):
        assert mine.shape == its.shape
        assert (np.abs(mine - its) <= 8 * ULP * size).all()
    assert np.array_equal(g.frames, [c.frame for c in grasp.contacts])
    assert np.array_equal(g.lever[g.soft], grasp.levers)
    assert np.array_equal(g.soft, grasp.soft)
    mech = grasp.mechanism
    for own, of_model in [
        (g.positions, grasp.positions),
        (g.mu, grasp.mu),
        (g.R, mech.R),
        (g.A, mech.A),
        (g.tendon, mech.tendon),
        (g.backdrivable, mech.backdrivable),
        (g.command, grasp.command),
        (g.friction, grasp.joint_friction),
        (g.torque, grasp.given_torques),
        (g.moves, [[i in joint.moves for joint in grasp.joints] for i in range(grasp.m)]),
    ]:
        assert np.array_equal(own, np.reshape(of_model, own.shape))
    assert g.actuators == mech.actuators
    assert g.joints == tuple(joint.name for joint in grasp.joints)
    assert [STOP_SIDES[k] for k in g.stop] == [joint.stop for joint in grasp.joints]
    assert g.has_laws == grasp.has_laws
    assert g.size == pytest.approx(grasp.size, rel=1e-14)


def exact_motion(grasp: Grasp) -> list[list[Fraction]]:
    """(3) written anew: what each unit of (r, q) does to object and finger at each contact, then to soft fingers."""

    def exact(v: Any) -> list[Fraction]:
        return [Fraction(float(x)) for x in v]

    def turned(w: list[Fraction], arm: list[Fraction]) -> list[Fraction]:
        (a, b, c), (x, y, z) = w, arm
        return [b * z - c * y, c * x - a * z, a * y - b * x]

    def along(v: list[Fraction], n: list[Fraction]) -> Fraction:
        return v[0] * n[0] + v[1] * n[1] + v[2] * n[2]

    unit = [exact(row) for row in np.eye(3)]
    none = exact(np.zeros(3))
    rows, turning = [], []
    for i, contact in enumerate(grasp.contacts):
        p = exact(contact.position)
        object_moves = [*unit, *(turned(w, p) for w in unit)]
        object_turns = [none, none, none, *unit]
        finger_moves, finger_turns = [], []
        for joint in grasp.joints:
            axis, arm = exact(joint.axis), [x - y for x, y in zip(p, exact(joint.origin), strict=True)]
            there, revolute = i in joint.moves, joint.type == "revolute"
            finger_moves.append(none if not there else turned(axis, arm) if revolute else axis)
            finger_turns.append(axis if there and revolute else none)
        for n in exact(contact.frame[:, 0]), exact(contact.frame[:, 1]), exact(contact.frame[:, 2]):
            rows.append([along(v, n) for v in object_moves] + [-along(v, n) for v in finger_moves])
        if contact.torsion > 0:
            lever, n = Fraction(contact.torsion / contact.friction), exact(contact.frame[:, 0])
            turns = [along(v, n) for v in object_turns] + [-along(v, n) for v in finger_turns]
            turning.append([lever * x for x in turns])
    return rows + turning


def test_exact_motion_is_the_formula(pair: tuple[Grasp, GraspData]) -> None:
    grasp, g = pair
    expected = [[fmpq(x.numerator, x.denominator) for x in row] for row in exact_motion(grasp)]
    assert g.exact_rows[: len(expected)] == expected


def test_sizes_bound_the_rounding(pair: tuple[Grasp, GraspData]) -> None:
    _, g = pair
    rows, sizes = g.rows
    assert rows.shape == sizes.shape == (len(g.exact_rows), 6 + g.l)
    for row, size, exact in zip(rows, sizes, g.exact_rows, strict=True):
        for x, s, true in zip(row, size, exact, strict=True):
            bound = fmpq(*float(s).as_integer_ratio())
            off = abs(fmpq(*float(x).as_integer_ratio()) - true)
            assert off <= fmpq(8, 2**53) * bound
            assert abs(true) <= bound * (1 + fmpq(8, 2**53))


def test_sizes_are_0_only_where_the_exact_entries_are() -> None:
    """A normal with a part of 1e-170 at an arm of 1e-200: its torque is 1e-370, which is 0 in floats."""
    contact = {"position": [0, 1e-200, 0], "normal": [1e-170, 0, 1], "friction": 0.5}
    data = {"schema": "handfast/grasp/1", "name": "tiny", "contacts": [contact], "joints": []}
    g = read_grasp(data, "g")
    exact = np.array([[bool(x) for x in row] for row in g.exact_rows])
    rows, sizes = g.rows
    assert not rows[0, 5]
    assert exact[0, 5]
    assert ((sizes > 0) >= exact).all()
    assert not sizes[0, 1]  # nothing of it is along y


@pytest.mark.parametrize("seed", range(6))
def test_a_frame_that_is_moved_and_turned_changes_no_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    grasp = random_soft(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    shift = rng.normal(size=3)
    moved = Grasp(
        [replace(c, position=turn @ c.position + shift, normal=turn @ c.normal) for c in grasp.contacts],
        [replace(j, axis=turn @ j.axis, origin=turn @ j.origin + shift) for j in grasp.joints],
        grasp.mechanism,
        grasp.command,
    )
    a, b = (read_grasp(to_dict(x), "g") for x in (grasp, moved))
    for name in ("size", "joint_arms", "joint_units", "actuator_arms"):
        np.testing.assert_allclose(getattr(b, name), getattr(a, name), rtol=1e-12)
    np.testing.assert_allclose(b.centroid, turn @ a.centroid + shift, rtol=1e-12)
    v, w, q = rng.normal(size=3), rng.normal(size=3), rng.normal(size=a.l)
    there = turn @ v - np.cross(turn @ w, shift)  # the velocity of the moved origin's place
    before = a.rows[0] @ np.r_[v, w, q]
    after = b.rows[0] @ np.r_[there, turn @ w, q]
    for x in (before, after):  # tangents are chosen by the frame: their lengths count
        x[: 3 * a.m].reshape(-1, 3)[:, 1] = np.linalg.norm(x[: 3 * a.m].reshape(-1, 3)[:, 1:], axis=1)
        x[: 3 * a.m].reshape(-1, 3)[:, 2] = 0
    np.testing.assert_allclose(after, before, atol=1e-12)


# --- sizes


def test_sizes_by_hand(small: GraspData) -> None:
    assert small.centroid.tolist() == [0.25, -0.125, 0.125]
    assert small.size == pytest.approx(np.sqrt(0.09375), rel=1e-15)  # (1/4, 1/8, -1/8) to contact 0
    assert small.joint_units.tolist() == [small.size, 1.0, small.size]
    # columns of J, and how far the soft finger turns times its lever: (1/4, 1/2), (1, -1), (1/4, 1/4)
    turn = np.sqrt(5 / 16)
    np.testing.assert_allclose(small.joint_arms, [turn, np.sqrt(2), np.sqrt(0.125)], rtol=1e-15)
    # pull: the less of 0.56 / 2 and sqrt(2) / 1; push: 0.3536 / 0.5; back: 0.3536 / 4
    np.testing.assert_allclose(small.actuator_arms, [turn / 2, np.sqrt(0.5), np.sqrt(0.125) / 4], rtol=1e-15)


def test_units_of_rows_by_hand(small: GraspData) -> None:
    """How much each moves where r, turns over the size, and joints over their arms are 1."""
    size, turn, push, slide = np.sqrt(0.09375), np.sqrt(16 / 5), 0.5 / np.sqrt(0.125), np.sqrt(0.5)
    np.testing.assert_allclose(small.column_units, [1, 1, 1, *[1 / size] * 3, turn, slide, np.sqrt(8)])
    # along t1 of contact 0: y, 1/2 about z, and the slide; pull: 2 of turn and 1 of slide; push: 1/2 of roll
    wanted = {1: np.sqrt(1 + 0.25 / 0.09375 + 0.5), 7: np.hypot(2 * turn, slide), 8: push, 11: turn, 14: 1}
    np.testing.assert_allclose(small.row_units[[*wanted]], [*wanted.values()])
    assert small.contact_rows.tolist() == [[0, 1, 2, 6], [3, 4, 5, 14]]  # the last is none


@pytest.mark.parametrize(("most", "data", "problem"), [
    (3, small_grasp(), ""),
    (2, small_grasp(), "has 2 contacts and 3 joints; 1 to 2 are possible"),
    (2, small_grasp() | {"joints": [], "mechanism": None, "preload": {}}, ""),
    (1, small_grasp() | {"joints": [], "mechanism": None, "preload": {}}, "has 2 contacts and 0 joints; 1 to 1 are"),
])  # fmt: skip
def test_as_many_as_possible(most: int, data: dict[str, Any], problem: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("handfast.proofs.grasp.MAX_GRASP_SIZE", most)
    if problem:
        with pytest.raises(BadFile, match=problem):
            read_grasp(data, "g")
    else:
        assert read_grasp(data, "g").m == 2


def single(position: list[float], *joints: dict[str, Any], **contact: Any) -> GraspData:
    """One contact with the normal x, and joints that move it."""
    return read_grasp(
        {
            "schema": "handfast/grasp/1",
            "contacts": [{"position": position, "normal": [1, 0, 0], "friction": 0.5} | contact],
            "joints": [{"name": f"j{k}", "moves": [0], "axis": [0, 0, 1]} | j for k, j in enumerate(joints)],
        },
        "g",
    )


def test_size_without_a_distance_of_contacts() -> None:
    turn = {"origin": [0, 4, 0]}
    assert single([3, 0, 0], turn).size == 5  # to the joint that turns it
    assert single([3, 0, 0], turn, {"origin": [3, 7, 0]}).size == 7
    assert single([3, 0, 0], turn | {"type": "prismatic"}).size == 3  # to the origin, the largest coordinate
    assert single([3, 0, 0], turn | {"moves": []}).size == 3
    assert single([1, -3, 2]).size == 3
    assert single([0, 0, 0]).size == 1
    assert single([0, 0, 0], {"origin": [0, 0, 0]}).size == 1


@pytest.mark.parametrize(("apart", "expected"), [(2.0**-46, 2.0**-46), (2.0**-47, 1 + 2.0**-46)])
def test_what_rounding_leaves_of_a_distance_is_none(apart: float, expected: float) -> None:
    """Contacts at x = 1 and x = 1 + 2 apart: 1.4e-14 of the largest coordinate is a length, 0.7e-14 is none."""
    data = small_grasp() | {"joints": [], "mechanism": None, "preload": {}}
    for contact, x in zip(data["contacts"], (1.0, 1 + 2 * apart), strict=True):
        contact["position"] = [x, 0, 0]
    assert read_grasp(data, "g").size == expected


def test_arms_of_joints_that_move_no_contact() -> None:
    through = {"origin": [3, 0, 0], "axis": [1, 0, 0]}  # the axis goes through the contact, along the normal
    assert single([3, 0, 0], through).joint_arms.tolist() == [3.0]  # its unit, the size
    assert single([3, 0, 0], through | {"moves": []}, {"origin": [0, 4, 0]}).joint_arms.tolist() == [5.0, 5.0]
    soft = single([3, 0, 0], through, torsion=0.125)  # a soft finger with the lever 1/4 is turned
    assert soft.joint_arms.tolist() == [0.25]
    assert single([3, 0, 0], through, through | {"moves": []}, torsion=0.125).joint_arms.tolist() == [0.25, 3.0]
    away = {"origin": [3, 2, 0], "axis": [0, 0, 1], "type": "prismatic", "moves": []}
    assert single([3, 0, 0], away).joint_arms.tolist() == [1.0]


@pytest.mark.parametrize(("arm", "expected"), [(2.0**-45, 2.0**-45), (2.0**-46, 1.0)])
def test_the_arm_of_a_joint_near_the_contact(arm: float, expected: float) -> None:
    """x = 1, axis z through x = 1 - arm: the sum of absolute values is 2 - arm, so that 2e-14 is the least arm.

    Below, the joint has its unit: the size, 1, from the contact to the other joint.
    """
    g = single([1, 0, 0], {"origin": [1 - arm, 0, 0]}, {"origin": [1, 1, 0]})
    assert np.abs(g.J[:, 0]).max() == arm
    assert g.sizes[1][:, 0].max() == 2 - arm
    assert g.size == 1
    assert g.joint_arms[0] == expected


def test_arms_of_actuators_without_any() -> None:
    assert single([0, 0, 0]).actuator_arms.tolist() == []
    data = small_grasp()
    data["mechanism"]["actuators"] = []
    data["preload"] = {}
    g = read_grasp(data, "g")
    assert (g.a, g.R.shape, g.actuator_arms.tolist()) == (0, (0, 3), [])


# --- laws, commands


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("joints.0.friction", 0.1),
        ("joints.1.torque", -0.1),
        ("joints.2.stop", "lower"),
        ("mechanism.actuators.1.backdrivable", True),
        (None, None),
    ],
)
def test_laws(path: str | None, value: Any) -> None:
    data = small_grasp()
    for name, joint in [("friction", 0), ("torque", 2), ("stop", 2)]:
        del data["joints"][joint][name]
    del data["mechanism"]["actuators"][2]
    if path:
        part, index, name = (path.replace("mechanism.", "")).split(".")
        (data["joints"] if part == "joints" else data["mechanism"]["actuators"])[int(index)][name] = value
    assert read_grasp(data, "g").has_laws == (path is not None)


def test_stops() -> None:
    data = small_grasp()
    for joint, stop in zip(data["joints"], ("lower", "both", "upper"), strict=True):
        joint["stop"] = stop
    g = read_grasp(data, "g")
    lower, upper = g.stops
    assert g.stop_side.tolist() == [1, 0, -1]
    assert lower.tolist() == [True, True, False]
    assert upper.tolist() == [False, True, True]
    assert not np.any(read_grasp(altered("joints.2.stop", ""), "g").stops)


def test_commands_by_name(small: GraspData) -> None:
    assert small.commands({"push": -2.0, "pull": 0.0}, "f").tolist() == [0, -2, 0]
    assert small.commands({}, "f").tolist() == [0, 0, 0]
    with refused("has unknown actuator 'x'; known are pull, push, back", "f"):
        small.commands({"x": 1.0}, "f")
    with refused("is -0.1; a tendon can only pull", "f.pull"):
        small.commands({"pull": -0.1}, "f")


def test_other_commands_keep_what_was_worked_out(small: GraspData) -> None:
    rows, exact = small.rows, small.exact_rows
    small.independent_rows[b""] = None
    other = small.with_command(np.array([1.0, 2.0, 3.0]))
    assert other.command.tolist() == [1, 2, 3]
    assert small.command.tolist() == [3, -0.75, 0]
    assert other.rows is rows
    assert other.exact_rows is exact
    assert other.same_but_commands(small)
    assert other.independent_rows == {b"": None}
    assert replace(small).independent_rows == {}


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("contacts.1.friction", 0.7),
        ("contacts.1.link", "x"),
        ("contacts.0.torsion", 0.26),
        ("joints.0.name", "turn"),
        ("joints.2.type", "prismatic"),
        ("joints.0.friction", 0.26),
        ("joints.2.stop", "lower"),
        ("joints.0.moves", [1]),
        ("mechanism.actuators.0.tendon", False),
        ("mechanism.actuators.0.name", "draw"),
        ("mechanism.couplings", []),
        ("name", "another"),
        ("mass", 7),
        ("contacts.0.depth", 3),
    ],
)
def test_the_same_but_commands(path: str, value: Any, small: GraspData) -> None:
    data = altered(path, value)
    data["preload"] = {}
    alike = path in ("name", "mass", "contacts.0.depth", "joints.0.name")  # the last has the name it had
    assert read_grasp(data, "g").same_but_commands(small) == alike


# --- what files leave out


def test_defaults() -> None:
    g = single([0, 0, 2], {"origin": [1, 0, 0]})
    assert g.links == ("",)
    assert g.lever.tolist() == [0]
    assert g.revolute.tolist() == [True]
    assert (g.friction.tolist(), g.torque.tolist(), g.stop.tolist()) == ([0], [0], [0])
    assert g.actuators == ("j0",)  # a motor for each joint
    assert (g.R.tolist(), g.A.shape) == ([[1]], (0, 1))
    assert (g.tendon.tolist(), g.backdrivable.tolist(), g.command.tolist()) == ([False], [False], [0])
    fixture = read_grasp(
        {"schema": "handfast/grasp/1", "contacts": [{"position": [0, 0, 0], "normal": [1, 0, 0], "friction": 0}]}, "g"
    )
    assert (fixture.l, fixture.a, fixture.J.shape, fixture.R.shape) == (0, 0, (3, 0), (0, 0))
    none = small_grasp() | {"joints": [], "mechanism": {"actuators": []}, "preload": {}}
    assert read_grasp(none, "g").R.shape == (0, 0)
    assert read_grasp(altered("mechanism", None) | {"preload": {}}, "g").R.tolist() == np.eye(3).tolist()


def test_numbers_at_their_bounds() -> None:
    for ratio in (1.01e-7, 0.99e7):
        assert read_grasp(altered("contacts.0.torsion", 0.5 * ratio), "g").lever[0] == ratio
    for ratio in (0.99e-7, 1.01e7):
        with pytest.raises(BadFile, match="their ratio is a length of a hand"):
            read_grasp(altered("contacts.0.torsion", 0.5 * ratio), "g")
    assert read_grasp(altered("mechanism.actuators.1.joints", {"roll": -1e-50}), "g").R[1, 2] == -1e-50
    assert read_grasp(altered("contacts.0.torsion", 0), "g").soft.tolist() == []
    assert read_grasp(altered("contacts.1.friction", 0), "g").mu[1] == 0
    assert read_grasp(altered("joints.0.moves", [0, 1.0, 0]), "g").moves[:, 0].tolist() == [True, True]
    assert read_grasp(altered("joints.0.moves", []), "g").moves[:, 0].tolist() == [False, False]


@pytest.mark.parametrize(
    ("length", "kept"),
    # a normal that is a unit vector but for its last digit stays as it is, others are normalised
    [(1.0, True), (1 + 2.0**-52, True), (1 - 2.0**-52, True), (1 + 2.0**-51, False), (1.0009, False), (0.9991, False)],
)
def test_unit_vectors(length: float, kept: bool) -> None:
    data = altered("contacts.0.normal", [0, 0, length])
    data["joints"][0]["axis"] = [0, length, 0]
    g = read_grasp(data, "g")
    assert g.frames[0, 2, 0] == (length if kept else 1.0)
    assert g.axes[0, 1] == (length if kept else 1.0)


@pytest.mark.parametrize("count", [249, 250])
def test_at_most_so_many(count: int) -> None:
    data = small_grasp() | {"joints": [], "mechanism": None, "preload": {}}
    many = [data["contacts"][1]] * count
    joints = [small_grasp()["joints"][1] | {"name": f"j{k}", "moves": [0]} for k in range(count)]
    motors = [{"name": f"a{k}", "joints": {"j0": 1}} for k in range(count)]
    if count == 249:
        assert read_grasp(data | {"contacts": many, "joints": joints[:1]}, "g").m == 249
        tied = {"actuators": motors, "couplings": [{"j0": 1}] * count}
        g = read_grasp(data | {"joints": joints, "mechanism": tied}, "g")
        assert (g.l, g.a, len(g.A)) == (249, 249, 249)
        return
    with refused("has 250 contacts and 0 joints; 1 to 249 are possible", "g"):
        read_grasp(data | {"contacts": many}, "g")
    with refused("has 2 contacts and 250 joints; 1 to 249 are possible", "g"):
        read_grasp(data | {"joints": joints}, "g")
    with refused("has 250 actuators and 0 couplings; at most 249 are possible", "g.mechanism"):
        read_grasp(data | {"joints": joints[:1], "mechanism": {"actuators": motors}}, "g")
    with refused("has 0 actuators and 250 couplings; at most 249 are possible", "g.mechanism"):
        couplings = [{"j0": 1}] * count
        read_grasp(data | {"joints": joints[:1], "mechanism": {"actuators": [], "couplings": couplings}}, "g")


# --- faults


@pytest.mark.parametrize(
    ("path", "value", "field", "problem"),
    [
        ("schema", "handfast/grasp/2", "schema", "is 'handfast/grasp/2'; 'handfast/grasp/1' is needed"),
        ("schema", ..., "schema", "is missing"),
        ("colour", 1, "colour", "is not a known field; leave it out"),
        ("contacts", ..., "contacts", "is missing"),
        ("contacts", 3, "contacts", "is no list"),
        ("contacts", [], "", "has 0 contacts and 3 joints; 1 to 249 are possible"),
        ("contacts.1", 3, "contacts[1]", "is no object"),
        ("contacts.1.x", 3, "contacts[1].x", "is not a known field; leave it out"),
        ("contacts.1.position", ..., "contacts[1].position", "is missing"),
        ("contacts.1.position", [1, 2], "contacts[1].position", "has 2 numbers; 3 are needed"),
        ("contacts.1.normal", ..., "contacts[1].normal", "is missing"),
        ("contacts.1.normal", [1, 0], "contacts[1].normal", "has 2 numbers; 3 are needed"),
        ("contacts.1.normal", [0, 0, 1.0011], "contacts[1].normal", "has length 1.0011; a unit vector is needed"),
        ("contacts.1.normal", [0, 0, -0.9989], "contacts[1].normal", "has length 0.9989; a unit vector is needed"),
        ("contacts.1.normal", [0, 0, 0], "contacts[1].normal", "has length 0; a unit vector is needed"),
        ("contacts.1.normal", [1, 1, 1], "contacts[1].normal", "has length 1.73205; a unit vector is needed"),
        ("contacts.1.friction", ..., "contacts[1].friction", "is missing"),
        ("contacts.1.friction", -0.1, "contacts[1].friction", "is -0.1; 0 or more is needed"),
        ("contacts.0.torsion", -0.1, "contacts[0].torsion", "is -0.1; 0 or more is needed"),
        ("contacts.0.friction", 0, "contacts[0].torsion", "is 0.25 where friction is 0; a soft finger needs both"),
        (
            "contacts.0.torsion",
            4e-8,
            "contacts[0].torsion",
            "is 4e-08 beside a friction of 0.5; their ratio is a length of a hand",
        ),
        (
            "contacts.0.friction",
            5e-324,
            "contacts[0].torsion",
            "is 0.25 beside a friction of 4.94066e-324; their ratio is a length of a hand",
        ),
        (
            "mechanism.actuators.2.tendon",
            True,
            "mechanism.actuators[2].backdrivable",
            "is true of a tendon; leave tendon out, its command is all it pulls with",
        ),
        ("contacts.0.link", 3, "contacts[0].link", "is 3; a text is needed"),
        ("joints", 3, "joints", "is no list"),
        ("joints.1", [], "joints[1]", "is no object"),
        ("joints.1.x", 0, "joints[1].x", "is not a known field; leave it out"),
        ("joints.1.name", ..., "joints[1].name", "is missing"),
        ("joints.1.name", 7, "joints[1].name", "is 7; a text is needed"),
        ("joints.1.name", "roll", "joints", "'roll' is there twice"),
        ("joints.1.axis", ..., "joints[1].axis", "is missing"),
        ("joints.1.axis", [0, 2, 0], "joints[1].axis", "has length 2; a unit vector is needed"),
        ("joints.1.origin", ..., "joints[1].origin", "is missing"),
        ("joints.1.origin", [0, 2], "joints[1].origin", "has 2 numbers; 3 are needed"),
        ("joints.1.moves", ..., "joints[1].moves", "is missing"),
        ("joints.1.moves", [2], "joints[1].moves", "has a contact that is none; they are 0 to 1"),
        ("joints.1.moves", [0, -1], "joints[1].moves", "has a contact that is none; they are 0 to 1"),
        ("joints.1.moves", [0.5], "joints[1].moves", "has a contact that is none; they are 0 to 1"),
        ("joints.1.moves", [True], "joints[1].moves", "has True where a number is needed"),
        ("joints.1.type", "ball", "joints[1].type", "is 'ball'; 'revolute' or 'prismatic' is needed"),
        ("joints.1.friction", -1, "joints[1].friction", "is -1; 0 or more is needed"),
        ("joints.1.torque", "1", "joints[1].torque", "is '1'; a finite number is needed"),
        ("joints.1.stop", "top", "joints[1].stop", "is 'top'; '' or 'lower' or 'upper' or 'both' is needed"),
        ("mechanism", 3, "mechanism", "is no object"),
        ("mechanism.x", 3, "mechanism.x", "is not a known field; leave it out"),
        ("mechanism.actuators", ..., "mechanism.actuators", "is missing"),
        ("mechanism.actuators", 3, "mechanism.actuators", "is no list"),
        ("mechanism.actuators.1.x", 0, "mechanism.actuators[1].x", "is not a known field; leave it out"),
        ("mechanism.actuators.1.name", ..., "mechanism.actuators[1].name", "is missing"),
        ("mechanism.actuators.1.name", "pull", "mechanism.actuators", "'pull' is there twice"),
        ("mechanism.actuators.1.joints", ..., "mechanism.actuators[1].joints", "is missing"),
        ("mechanism.actuators.1.joints", [1], "mechanism.actuators[1].joints", "is no object of numbers by name"),
        (
            "mechanism.actuators.1.joints",
            {"x": 1},
            "mechanism.actuators[1].joints",
            "has unknown joint 'x'; known are turn, slide, roll",
        ),
        ("mechanism.actuators.1.joints", {}, "mechanism.actuators[1].joints", "moves no joint"),
        ("mechanism.actuators.1.joints", {"roll": 9e-51}, "mechanism.actuators[1].joints", "moves no joint"),
        (
            "mechanism.actuators.1.joints",
            {"roll": "1"},
            "mechanism.actuators[1].joints.roll",
            "is '1'; a finite number is needed",
        ),
        ("mechanism.actuators.1.tendon", 1, "mechanism.actuators[1].tendon", "is 1; true or false is needed"),
        (
            "mechanism.actuators.1.backdrivable",
            1,
            "mechanism.actuators[1].backdrivable",
            "is 1; true or false is needed",
        ),
        ("mechanism.couplings", 3, "mechanism.couplings", "is no list"),
        ("mechanism.couplings", "roll", "mechanism.couplings", "is no list"),
        ("mechanism.couplings", [{"roll": 0}], "mechanism.couplings[0]", "moves no joint"),
        (
            "mechanism.couplings",
            [{"roll": 1}, {"x": 1}],
            "mechanism.couplings[1]",
            "has unknown joint 'x'; known are turn, slide, roll",
        ),
        ("preload", [1], "preload", "is no object of numbers by name"),
        ("preload", {"x": 1}, "preload", "has unknown actuator 'x'; known are pull, push, back"),
        ("preload", {"pull": -1}, "preload.pull", "is -1; a tendon can only pull"),
        ("preload", {"pull": None}, "preload.pull", "is None; a finite number is needed"),
    ],
)
def test_faults(path: str, value: Any, field: str, problem: str) -> None:
    with refused(problem, f"g.{field}" if field else "g"):
        read_grasp(altered(path, value), "g")


def test_of_several_names_twice_the_first_is_told() -> None:
    data = altered("joints.1.name", "turn")
    data["joints"] += [data["joints"][2] | {"name": name} for name in ("roll", "turn")]
    with refused("'turn' is there twice", "g.joints"):
        read_grasp(data, "g")


@pytest.mark.parametrize("data", [None, [], 3])
def test_what_is_no_grasp(data: Any) -> None:
    with refused("is no object", "g"):
        read_grasp(data, "g")


def test_a_step_says_where_it_starts(small: GraspData) -> None:
    """Of the actuators pull is a tendon; the roll has an upper stop. Slack counts where nobody commands."""
    start: dict[str, Any] = {"gaps": [-0.5, 0.25], "stops": [0.0, 0, 2], "slack": [3.0, 4, 5]}
    step = read_start(Fields({"from": start}, "s"), small)
    assert step.gaps.tolist() == [-0.5, 0.25]
    assert step.same_but_commands(small)
    assert step.stops_left.tolist() == [0, 0, -2]
    assert step.slack.tolist() == [0, 0, 0]
    assert step.with_command(np.zeros(3)).slack.tolist() == [3, 0, 0]
    assert small.slack.tolist() == [0, 0, 0]
    assert small.with_start(None).start is None
    for name, bad, problem in (
        ("gaps", [0.0], "has 1 numbers; 2 are needed"),
        ("stops", [0.0, 0.0, -1e-9], "has a negative number; 0 or more is needed"),
        ("slack", [0.0, -1.0, 0.0], "has a negative number; 0 or more is needed"),
        ("stops", [0.0, 0.0], "has 2 numbers; 3 are needed"),
        ("slack", [0.0] * 4, "has 4 numbers; 3 are needed"),
    ):
        with refused(problem, f"s.from.{name}"):
            read_start(Fields({"from": start | {name: bad}}, "s"), small)
    with refused("is not a known field; leave it out", "s.from.more"):
        read_start(Fields({"from": start | {"more": 1}}, "s"), small)


def test_a_step_starts_from_its_own_numbers_whatever_was_worked_out_before() -> None:
    hinge = GraspJoint("hinge", [0, 0, 1], [0, 0.1, 0], (0,), stop="upper")
    rest = read_grasp(to_dict(Grasp([Contact([0.02, 0, 0], [-1, 0, 0], 0.5)], [hinge])), "grasp")
    assert [rest.gaps[0], rest.stops_left[0], rest.stops[1][0]] == [0.0, 0.0, True]
    rows = rest.rows
    step = rest.with_start(StartData(np.array([-0.5]), np.array([0.25]), np.array([0.0])))
    assert [step.gaps[0], step.stops_left[0], step.stops[1][0]] == [-0.5, -0.25, False]
    assert step.rows is rows
