"""Soft fingers: torsional friction in one ellipsoid with friction, by hand, at its limits, and against itself."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.soft_fingers import random_grasp, random_load, random_turn, turned
from handfast import verify
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.papers import algorithm1
from handfast.proofs import checker
from handfast.readers.grasp_file import from_dict, load_grasp, save_grasp, to_dict
from handfast.stability.problem import judge, model
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.model import state_of
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.batch import check_many, max_many
from handfast.stability.studies.margin_search import margin
from handfast.stability.studies.prepared import prepare
from handfast.stability.studies.questions import check, maximum, torques
from tests.support.slow_cases import slow_after
from tests.support.soft_fingers import MU, SQUEEZE, TORSION, coin, spindle

LARGEST_TORQUE, LARGEST_FORCE = 2 * TORSION * SQUEEZE, 2 * MU * SQUEEZE  # of the coin, by hand
FINE = Settings(gap=1e-6)


def three_fingers() -> Grasp:
    """Two soft fingers and a point, whose resistance grows as the object moves on without end."""

    def unit(*x: float) -> np.ndarray:
        return np.array(x) / np.linalg.norm(x)

    contacts = [
        Contact([-0.019, -0.011, -0.021], unit(0.724, 0.4, 0.562), 0.421, torsion=0.009),
        Contact([0.01, -0.005, 0.016], unit(-0.571, 0.395, -0.719), 0.396, torsion=0.009),
        Contact([-0.009, 0.028, 0.002], unit(0.203, -0.974, -0.102), 0.451),
    ]
    joints = [
        GraspJoint("a", unit(-0.104, -0.742, 0.662), [-0.044, -0.011, -0.033], (0,)),
        GraspJoint("b", unit(0.595, -0.405, -0.695), [0.052, -0.009, 0.027], (1,)),
        GraspJoint("c", unit(0.585, 0.037, 0.81), [0.0, 0.062, -0.01], (2,)),
    ]
    return Grasp(contacts, joints, preload={"a": 0.047, "b": 0.016, "c": 0.039})


def test_a_maximum_is_that_of_its_state() -> None:
    """Newton's method leaves the magnitude where it was: the state did not have the commands that were said, but for
    1e-9 of them, and its own file was refused."""
    grasp = three_fingers()
    found = maximum(grasp, [0.462, -0.844, -0.272, 0.003, 0.005, -0.007], settings=Settings(gap=1e-3, jobs=1))
    assert found.verify().ok
    assert found.witness is not None
    assert found.witness.grasp.command == pytest.approx(grasp.command, rel=1e-14, abs=0)


# --- a coin between two fingers, by hand ---------------------------------------------------------------


@pytest.mark.parametrize("half", slow_after(1, [0.02, 1e-3]))
@pytest.mark.parametrize(
    ("direction", "largest"),
    [
        ([0, 0, 0, 0, 0, 1], LARGEST_TORQUE),
        ([0, 0, 0, 0, 0, -1], LARGEST_TORQUE),
        ([0.6, -0.8, 0, 0, 0, 0], LARGEST_FORCE),
        ([LARGEST_FORCE, 0, 0, 0, 0, LARGEST_TORQUE], 2**-0.5),
        ([0, 3.0, 0, 0, 0, -0.08], 1 / np.hypot(0.3, 1.0)),
    ],
)
def test_coin(half: float, direction: list[float], largest: float) -> None:
    """Friction alone, torsion alone, and both in the ellipsoid."""
    answer = maximum(coin(half=half), direction, settings=FINE)
    assert answer.verified
    assert answer.lower <= largest * (1 + 1e-6)
    assert answer.upper >= largest * (1 - 1e-6)
    assert answer.upper - answer.lower < 2e-5 * largest
    assert answer.witness.residuals.worst < 1e-9


@pytest.mark.parametrize(("share", "verdict"), [(0.999, Verdict.HOLDS), (1.001, Verdict.SLIPS)])
def test_coin_checked(share: float, verdict: Verdict) -> None:
    load = share * 2**-0.5 * np.array([0, LARGEST_FORCE, 0, 0, 0, LARGEST_TORQUE])
    answer = check(coin(), load)
    assert answer.verdict is verdict
    assert answer.verified
    if verdict is Verdict.HOLDS:
        w = answer.witness
        down, up = w.state.torsion  # about normals that point at each other
        assert up - down == pytest.approx(-load[5], abs=1e-9)
        assert np.abs(w.state.torsion).max() <= TORSION * SQUEEZE
        assert w.to_json()["contacts"][0]["torsion"] == w.state.torsion[0]


def test_off_the_axis_the_line_between_the_fingers_holds_what_is_left() -> None:
    """A force along y at distance a along x: force and torque F (1, a) in the ellipsoid."""
    a = 0.01
    answer = maximum(coin(half=0.02), [0, 1, 0, 0, 0, a], settings=FINE)
    assert answer.lower == pytest.approx(1 / np.hypot(1 / LARGEST_FORCE, a / LARGEST_TORQUE), rel=1e-4)


def test_energy() -> None:
    """A turning coin: friction takes mu_tau c_n per radian at each finger; the state is one of sliding."""
    g = coin()
    turn, N = 3.0, SQUEEZE
    c = np.array([N, 0, 0, N, 0, 0])
    torsion = np.array([1.0, -1.0]) * TORSION * N  # about the normals, against the turning of the object about +z
    state = state_of([0, 0, -N, 0, 0, turn], [2 * N], c, [N], [], torsion=torsion)
    load = np.array([0, 0, 0, 0, 0, LARGEST_TORQUE])
    assert judge.residuals(g, load, state).worst < 1e-12
    e = model.energy(g, load, state)
    assert e.friction == pytest.approx([TORSION * N * turn] * 2)
    assert e.maximum == pytest.approx(e.friction)
    assert e.residual == pytest.approx(0, abs=1e-12)
    wrong = replace(state, torsion=-torsion)
    # relative to the load's 0.08 N m at the coin's half thickness; 5 N of torsion at a lever of 8 mm, turned along with
    # the motion instead of against it, which is slower than the load: 2 * 5 N times 3 * 8 mm
    scale, lever = LARGEST_TORQUE / 1e-3, TORSION / MU
    assert judge.residuals(g, -load, wrong).dissipation == pytest.approx(2 * MU * N * turn * lever / scale**2)
    beyond = judge.residuals(g, load * 1.1, replace(state, torsion=1.1 * torsion))
    assert beyond.cone == pytest.approx(0.1 * MU * N / (1.1 * scale))  # a tenth more than 5 N
    assert model.energy(g, -load, wrong).created > 0.1


def test_point_contacts_carry_no_torsion() -> None:
    g = coin(torsion=0.0)
    c = np.array([SQUEEZE, 0, 0, SQUEEZE, 0, 0])
    twisted = state_of(np.zeros(6), [0.0], c, [SQUEEZE], [], torsion=[1e-3, 0.0])
    assert judge.residuals(g, np.zeros(6), twisted).cone > 1e-3
    with pytest.raises(InputError, match="cannot be balanced by any forces at these 2 contacts"):
        check(g, [0, 0, 0, 0, 0, 1e-3])


def test_no_torsion_is_the_limit() -> None:
    """The less torsional friction, the less torque; along a force nothing changes."""
    found = [maximum(coin(t), [0, 0, 0, 0, 0, 1]).lower for t in (4e-3, 4e-4, 4e-5)]
    assert found == pytest.approx([2 * SQUEEZE * t for t in (4e-3, 4e-4, 4e-5)], rel=1e-3)
    assert maximum(coin(0.0), [1, 0, 0, 0, 0, 0]).lower == pytest.approx(LARGEST_FORCE, rel=1e-3)


@pytest.mark.parametrize("friction", [0.0, 0.01, 0.03, 0.5])
def test_a_joint_that_turns_about_the_normal(friction: float) -> None:
    """It passes on no more than its own dry friction, and no more than the contact's torsion."""
    largest = TORSION * SQUEEZE + min(friction, TORSION * SQUEEZE)
    answer = maximum(spindle(friction), [0, 0, 0, 0, 0, 1])
    assert answer.lower == pytest.approx(largest, rel=2e-3)
    assert answer.upper >= largest * (1 - 1e-9)


# --- all questions ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_every_question_answers_alike() -> None:
    g, load = coin(), np.array([0, 0, 0, 0, 0, 0.05])
    assert check_many(g, [load, 2 * load]).verdict.tolist() == ["holds", "slips"]
    found = max_many(g, [[0, 0, 0, 0, 0, 1.0]])
    assert found.lower[0] == pytest.approx(LARGEST_TORQUE, rel=2e-3)
    ready = prepare(g)
    assert [ready.check(k * load).verdict for k in (1, 2)] == ready.check([load, 2 * load]).verdict.tolist()
    assert ready.check(load).verdict == "holds"
    assert torques(g, load).upper == pytest.approx(0.05 / (2 * TORSION), rel=2e-3)  # N of the slide
    assert maximum(g, [0, 0, 0, 0, 0, 1], interval=True).interval.holes == ()
    assert not margin(g, 0.5 * load).fragile
    assert margin(g, 0.99 * np.array([0, 0, 0, 0, 0, LARGEST_TORQUE])).fragile


def test_a_soft_finger_in_a_sum_of_commands() -> None:
    g = coin()
    answer = torques(g, [0, 0, 0, 0, 0, 0.05], objective="sum")
    assert answer.upper == pytest.approx(0.05 / (2 * TORSION), rel=2e-3)


def test_what_knows_point_contacts_only_says_so() -> None:
    with pytest.raises(InputError, match=r"contacts\[0\].torsion: is 0.004 m; uncertainty of the normals knows point"):
        check(coin(), np.zeros(6), limits=GraspLimits(eta=0.1))
    with pytest.raises(InputError, match="Algorithm 1 knows point contacts only"):
        algorithm1.check(coin(), np.zeros(6))


@pytest.mark.parametrize("seed", range(12))
def test_random_grasps(seed: int) -> None:
    """What holds has a witness and what slips a proof; a maximum and the checks beside it say the same; so does the
    question turned round and told in other units."""
    rng = np.random.default_rng([77, seed])
    g, direction = random_grasp(rng), random_load(rng)
    if np.linalg.matrix_rank(np.hstack([g.G, g.twist_map])) < 6:
        return
    found = maximum(g, direction)
    assert found.witness is None or found.witness.residuals.worst <= 1e-9
    R = random_turn(rng)
    other = maximum(turned(g, R), np.r_[R @ direction[:3], R @ direction[3:]])
    assert other.lower <= found.upper * (1 + 1e-6)
    assert found.lower <= other.upper * (1 + 1e-6)
    if found.lower > 1e-3 and not found.unbounded:
        assert check(g, 1.01 * found.upper * direction).verdict is not Verdict.HOLDS
    load = random_load(rng)
    answer = check(g, load)
    assert answer.verdict is not Verdict.UNDECIDED
    assert answer.verified
    if answer.verdict is Verdict.SLIPS:
        assert checker.verify(answer.certificate).ok
        weaker = g.with_torsion(0.0)
        if np.linalg.matrix_rank(weaker.G) == 6 and not g.command.any():  # nothing pushes: less friction holds less
            assert check(weaker, load).verdict is not Verdict.HOLDS


# --- files ---------------------------------------------------------------------------------------------


def test_grasp_file(tmp_path: Path) -> None:
    save_grasp(coin(), tmp_path / "coin.json")
    again = load_grasp(tmp_path / "coin.json")
    assert [c.torsion for c in again.contacts] == [TORSION] * 2
    assert "torsion" not in to_dict(coin(0.0))["contacts"][0]
    data = to_dict(coin())
    data["contacts"][1]["torsion"] = -0.1
    with pytest.raises(InputError, match=r"contacts\[1\].torsion"):
        from_dict(data)


@pytest.mark.parametrize(
    ("about", "problem"),
    [
        ({"torsion": float("nan")}, "a coefficient of torsional friction is 0 or more"),
        ({"torsion": 0.1, "friction": 0.0}, "a soft finger needs a friction above 0"),
        ({"torsion": 1e-12}, "their ratio is to be a length of a hand"),
    ],
)
def test_bad_numbers(about: dict[str, float], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        Contact(**({"position": np.zeros(3), "normal": [0, 0, 1], "friction": 0.5} | about))


@pytest.mark.parametrize("share", [0.9, 1.1])
def test_answers_are_verified_and_forged_ones_refused(share: float, tmp_path: Path) -> None:
    answer = check(coin(), [0, 0, 0, 0, 0, share * LARGEST_TORQUE])
    file = tmp_path / "answer.json"
    answer.save(file)
    assert verify(file).ok
    for change in (_more_torsion, _other_state, _harder):
        data = json.loads(file.read_text())
        if change(data):
            forged = tmp_path / "forged.json"
            forged.write_text(json.dumps(data))
            assert not _proved(forged), change.__name__


def _proved(file: Path) -> bool:
    try:
        return verify(file).ok
    except InputError:  # the question is refused
        return False


def _more_torsion(data: dict) -> bool:
    """What slips is asked with a little more torsional friction: its proof does not fit."""
    for contact in data["question"]["grasp"]["contacts"]:
        contact["torsion"] *= 1.2 if data["witness"] is None else 0.8
    return True


def _other_state(data: dict) -> bool:
    if data["witness"] is None:
        return False
    data["witness"]["torsion"][0] *= 0.9
    return True


def _harder(data: dict) -> bool:
    """Point contacts, whose state carries a torsion all the same."""
    if data["witness"] is None:
        return False
    for contact in data["question"]["grasp"]["contacts"]:
        del contact["torsion"]
    return True
