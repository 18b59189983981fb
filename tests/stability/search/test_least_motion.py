"""The witness of least motion: by hand, planted states that move farther, laws, and where it is shown."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handfast import Settings, check, check_many, load_grasp, maximum, prepare, torques, verify
from handfast.cli import main
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp
from handfast.stability.answers.answer import Answer
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.model import state_of
from handfast.stability.problem.objective import ANY_STATE
from handfast.stability.problem.witness import Witness
from handfast.stability.search import least_motion as module
from handfast.stability.search.least_motion import least_motion
from handfast.stability.search.reduced import reduce
from handfast.stability.search.same_modes import ALIKE_MOTION, least_in_same_modes
from tests.support.problems import moved, nest, pinch, solved, table

X, Y, Z = np.eye(3)
NONE: Array = np.zeros(0)
PULL = np.array([0, 2.2, 0, 0, 0, 0])  # [N] on Fig. 1


def same_modes(w: Witness) -> Witness:
    """Of least motion in the modes of a witness."""
    return least_in_same_modes(
        reduce(scaled_problem.build(w.grasp, w.wrench, limits=GraspLimits(eta=w.eta), mdp=w.mdp), ANY_STATE), w
    )


def fixture_state(grasp: Grasp, wrench: Array, r: Array, c: Array) -> Witness:
    """An exact state of a grasp without joints; c: (m, 3)."""
    w = Witness(grasp, wrench, state_of(r, NONE, c.ravel(), NONE, NONE), 0.0, True)
    assert w.valid
    return w


# --- by hand ------------------------------------------------------------------------------------


def test_fig_1_turns_by_a_moderate_angle() -> None:
    """2.2 N along +y. Towards -y a contact with normal n pushes by c_n (sqrt(1 - n_y^2) - n_y) at most (mu = 1).

    That is c_n at the tips, 0.13 c_n at the others, so that some normal force, which is a motion, is at least
    2.2 / (2 + 0.26) = 0.97 N. The contacts move by L at most, so those of two fingers, 0.156 m apart, by 2 L against
    each other, and so do the tips against the others, 0.047 m off the line through the tips: the object turns by no
    more than 2 L / 0.156 across that line and 2 L / 0.047 about it [N/m].
    """
    grasp = load_grasp("fig1")
    w = check(grasp, PULL).witness
    assert w is not None
    assert w.valid
    n_y = np.array([c.normal[1] for c in grasp.contacts])
    share = np.sqrt(1 - n_y**2) - n_y
    np.testing.assert_allclose(share, [0.1, 1, 0.12, 1], atol=0.02)
    L = w.largest_motion
    assert 2.2 / share.sum() <= L < 3.0
    assert np.linalg.norm(w.state.r[3:]) <= np.hypot(2 * L / 0.156, 2 * L / 0.0469)
    assert np.linalg.norm(w.state.r[3:]) < 100


def tilted_block(gap: float) -> Witness:
    """A weight of 1 N over the middle of two corners of a table, each of which carries half of it and gives way by
    0.5 N; the block is turned about them so that the other two corners are lifted by a gap."""
    grasp, turn = table(), (0.5 + gap) / 0.1
    r = np.array([0, 0, -0.5 + 0.05 * turn, 0, -turn, 0])  # z at x is -0.5 + turn (x + 0.05)
    c = np.array([[0.5, 0, 0] if k.position[0] < 0 else [0.0, 0, 0] for k in grasp.contacts])
    return fixture_state(grasp, np.r_[-Z, np.cross([-0.05, 0, 0], -Z)], r, c)


@pytest.mark.parametrize("gap", [0.0, 0.3, 2.0, 1e7])
def test_a_block_that_turns_freely_about_two_corners(gap: float) -> None:
    """The two corners give way by 0.5 N, whatever the others do, which need not move more, nor touch."""
    found = same_modes(tilted_block(gap))
    assert found.valid
    assert found.contact_states == tilted_block(gap).contact_states == ["stick", "stick", "open", "open"]
    assert found.largest_motion == pytest.approx(0.5, rel=2 * ALIKE_MOTION)
    lifted = found.motions[2:, 2]
    assert (lifted > 0.01).all()
    assert (lifted < 0.49).all()
    np.testing.assert_allclose(found.forces, tilted_block(gap).forces, atol=1e-9)


@pytest.mark.parametrize("squeeze", [0.0, 0.05, 0.4 / 3])
def test_corners_do_not_pull_at_each_other(squeeze: float) -> None:
    """Three corners share a weight over their middle, and friction along the edge of two of them may be up to its
    limit, 0.4 / 3: there need be none."""
    grasp = table(0.4, 3)
    middle = np.mean([k.position for k in grasp.contacts], axis=0)
    forces = np.tile(Z / 3, (3, 1))
    forces[0] += squeeze * Y
    forces[1] -= squeeze * Y
    c = np.array([k.frame.T @ f for k, f in zip(grasp.contacts, forces, strict=True)])
    planted = fixture_state(grasp, np.r_[-Z, np.cross(middle, -Z)], np.r_[-Z / 3, np.zeros(3)], c)
    for found in (same_modes(planted), least_motion(planted)):
        assert found.valid
        np.testing.assert_allclose(found.forces, np.tile(Z / 3, (3, 1)), atol=1e-7)
        assert found.largest_motion == pytest.approx(1 / 3, rel=1e-9)


@pytest.mark.parametrize("turn", [0.0, 3.0, -1e6])
@pytest.mark.parametrize("shift", [np.zeros(3), np.array([0.3, -2.0, 1.0])])
def test_a_turn_that_no_contact_feels(turn: float, shift: Array) -> None:
    """A pinch: the object may turn about the line of its two contacts, wherever its origin is; it does not."""
    order = [0, 1]
    grasp = moved(pinch(), np.eye(3), shift, order, 1.0, 1.0)
    w = check(grasp, np.zeros(6)).witness
    assert w is not None
    r = w.state.r + turn * np.r_[-np.cross(X, shift), X]  # v = turn x (p - shift)
    planted = replace(w, state=replace(w.state, r=r))
    assert planted.valid
    found = least_motion(planted)
    assert found.valid
    assert abs(found.state.r[3]) < 1e-3
    np.testing.assert_allclose(found.state.c, w.state.c, atol=1e-6)
    assert found.largest_motion <= w.largest_motion * (1 + 1e-9)


def test_limits_are_kept() -> None:
    """A witness within limits stays so: of the normal force at a nest, and of a motor of Fig. 1."""
    push = np.r_[-Z, np.zeros(3)]
    first = check(nest(), push).witness
    assert first is not None
    most = float(first.state.c[::3].max()) * (1 + 1e-6)
    for answer in (
        check(nest(), push, limits=GraspLimits(force_limit=most)),
        check(load_grasp("fig1"), PULL, limits=GraspLimits(torque_limits={"finger_2_prox": 0.105})),
    ):
        assert answer.verdict is Verdict.HOLDS
        assert verify(answer).ok


# --- laws ---------------------------------------------------------------------------------------

FIXTURES = {"table": table(), "nest": nest(), "one corner": table(0.4, 1)}


@cache
def states() -> list[Witness]:
    """States planted at random, and what checks of fixtures find, which leave more freedom."""
    out = []
    for seed, m, eta in [(s, 3 + s % 4, 0.1 * (s % 2)) for s in range(12)]:
        s = solved(seed, m=m, eta=eta)
        out.append(Witness(s.grasp, s.wrench, s.state, s.eta, True))
    rng = np.random.default_rng(5)
    for grasp in FIXTURES.values():
        for _ in range(4):
            c = np.zeros((grasp.m, 3))
            c[:, 0] = rng.uniform(0.2, 1.0, grasp.m)
            c[:, 1:] = 0.2 * rng.normal(size=(grasp.m, 2)) * c[:, :1]
            found = check(grasp, -grasp.G @ c.ravel()).found
            if found is not None:
                out.append(found)
    return out


@pytest.mark.parametrize("k", range(24))
@pytest.mark.slow
def test_the_motion_never_grows(k: int) -> None:
    """And it stays an exact state of the same question, as it was or better; again changes nothing that counts."""
    every = states()
    assert len(every) == 24
    w = every[k]
    assert w.valid
    for found in (same_modes(w), least_motion(w)):
        assert found.valid
        assert found.largest_motion <= w.largest_motion * (1 + 1e-9)
        assert found.grasp is w.grasp
        assert found.wrench is w.wrench
        assert (found.eta, found.mdp) == (w.eta, w.mdp)
        again = least_motion(found)
        assert again.valid
        assert again.largest_motion <= found.largest_motion * (1 + 1e-9)
    assert same_modes(w).contact_states == w.contact_states


@pytest.mark.parametrize("change", ["rotation", "shift", "far", "order", "length", "force"])
@pytest.mark.parametrize("case", ["fig1", "table", "pinch", "random"])
@pytest.mark.slow
def test_axes_origin_units_and_order_change_nothing(case: str, change: str) -> None:
    grasp, wrench = {
        "fig1": (load_grasp("fig1"), PULL),
        "table": (table(), np.r_[-Z, np.cross([-0.05, 0, 0], -Z)]),
        "pinch": (pinch(), np.array([0, -0.5, 0, 0, 0, 0])),
        "random": (solved(3, m=5).grasp, solved(3, m=5).wrench),
    }[case]
    R, shift, order, length, force = np.eye(3), np.zeros(3), list(range(grasp.m)), 1.0, 1.0
    match change:
        case "rotation":
            R = Rotation.from_rotvec([0.3, -1.0, 0.7]).as_matrix()
        case "shift":
            shift = np.array([0.2, -0.1, 0.4])
        case "far":
            shift = np.array([20.0, -30.0, 10.0])
        case "order":
            order = order[::-1]
        case "length":
            length = 1000.0
        case _:
            force = 0.01
    f = R @ wrench[:3]
    w = force * np.r_[f, length * (R @ wrench[3:] + np.cross(shift, f))]
    found = check(grasp, wrench).found, check(moved(grasp, R, shift, order, length, force), w).found
    assert None not in found
    before, after = (least_motion(x) for x in found if x is not None)
    assert after.largest_motion == pytest.approx(force * before.largest_motion, rel=1e-5)
    turns = (np.linalg.norm(x.state.r[3:]) for x in (before, after))
    first, second = next(turns), next(turns)
    assert second == pytest.approx(force / length * first, rel=1e-2, abs=1e-2 * force / length)


def test_of_what_is_no_state_nothing_better_is_found() -> None:
    w = tilted_block(2.0)
    wrong = replace(w, state=replace(w.state, c=1.01 * w.state.c))
    assert not wrong.valid
    assert least_motion(wrong) is wrong


def test_a_load_that_rounding_takes_out_of_range_keeps_its_state(monkeypatch: pytest.MonkeyPatch) -> None:
    """The load of a maximum is base + s direction, each of which contacts can balance, but for rounding."""

    def refused(*args: object, **options: object) -> None:
        raise InputError("cannot be balanced", field="wrench")

    w = tilted_block(2.0)
    monkeypatch.setattr(scaled_problem, "build", refused)
    assert least_motion(w) is w


# --- where it is shown --------------------------------------------------------------------------


@cache
def shown() -> dict[str, Answer]:
    """Answers about Fig. 1 whose first witness may swing far."""
    grasp = load_grasp("fig1")
    (many,) = check_many(grasp, PULL[None], answers=True).answers or ()
    assert many is not None
    return {
        "check": check(grasp, PULL),
        "many": many,
        "max": maximum(grasp, [0, 1, 0, 0, 0, 0]),
        "torques": torques(grasp, PULL),
    }


@pytest.mark.parametrize("name", ["check", "many", "max", "torques"])
def test_every_answer_shows_it(name: str, tmp_path: Path) -> None:
    answer = shown()[name]
    w = answer.witness
    assert w is not None
    assert answer.found is not None
    assert w.largest_motion <= answer.found.largest_motion * (1 + 1e-9)
    assert np.linalg.norm(w.state.r[3:]) < 1000  # [N/m]; as they are found: up to 1e8
    assert verify(answer).ok
    answer.save(tmp_path / "a.json")
    assert verify(tmp_path / "a.json").ok
    np.testing.assert_array_equal(json.loads((tmp_path / "a.json").read_text())["witness"]["r"], w.state.r)


def test_a_prepared_grasp_shows_it() -> None:
    answer = prepare(load_grasp("fig1")).check(PULL)
    assert answer.verdict == "holds"
    assert answer.witness is not None
    assert answer.verify().ok
    assert np.linalg.norm(answer.witness.state.r[3:]) < 100
    assert answer.witness.residuals.worst <= 1e-9


def test_the_command_line_prints_it(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "fig1", "--wrench", "0", "2.2", "0", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert np.linalg.norm(said["object_motion"][3:]) < 100
    w = check(load_grasp("fig1"), PULL).witness
    assert w is not None
    np.testing.assert_allclose(said["object_motion"], w.state.r, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("share, asked_for_the_verdict", [(0.5 / 2.2, 0), (1.0, 1)])
def test_it_is_sought_when_it_is_read(
    monkeypatch: pytest.MonkeyPatch, share: float, asked_for_the_verdict: int
) -> None:
    """Verdicts alone do not pay for it, unless the state that was found is between two modes, as under all of PULL."""
    asked: list[Witness] = []

    def spy(found: Witness, *limits: object) -> Witness:
        asked.append(found)
        return found

    monkeypatch.setattr(module, "least_motion", spy)
    grasp = load_grasp("fig1")
    check_many(grasp, np.array([PULL, 0.5 * PULL, 0.9 * PULL]), settings=Settings(verify=False))
    assert asked == []
    answer = check(grasp, share * PULL)
    assert answer.verdict is Verdict.HOLDS
    assert asked == [answer.found] * asked_for_the_verdict
    assert answer.witness is answer.witness is answer.found
    assert asked == [answer.found]


def test_what_is_proved_less_well_is_not_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    """A state of less motion that is none: the one that was found stays, with its proof."""

    def wrong(found: Witness, *limits: object) -> Witness:
        return replace(found, state=replace(found.state, c=1.01 * found.state.c))

    monkeypatch.setattr(module, "least_motion", wrong)
    answer = check(load_grasp("fig1"), PULL)
    assert answer.verdict is Verdict.HOLDS
    assert answer.witness is answer.found
    assert answer.verify().ok


def test_a_slipping_contact_has_none() -> None:
    one = Grasp([Contact(np.zeros(3), Z, 0.5)])
    answer = check(one, [0, 0, 1, 0, 0, 0])
    assert answer.verdict is Verdict.SLIPS
    assert answer.witness is None
