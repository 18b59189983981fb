"""Files that claim what is not so, each made by somebody who wanted it proved; and numbers that hide a fault."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handfast
from handfast.core.answer import Stop, Verdict
from handfast.core.errors import InputError
from handfast.model.body import weight
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.grasp_file import load_grasp
from handfast.model.mechanism import Mechanism
from handfast.stability import model
from handfast.stability.certify import checker
from handfast.stability.certify.certificate import TURN, Columns, Question, Row
from handfast.stability.model import State
from handfast.stability.queries import check, maximum, torques
from handfast.stability.verification import Verified
from handfast.stability.witness import Witness
from tests.stability.test_limit import cup
from tests.support.certificates import empty

Y = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])


def forged(answer: Any, path: Path, change: Any) -> handfast.stability.verification.Verified:
    """What `verify` says of a saved answer after a change of its JSON."""
    answer.save(path)
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))
    return handfast.verify(path)


def pinch() -> Grasp:
    """Two contacts on the x axis and no joints."""
    return Grasp([Contact([x, 0.0, 0.0], [-np.sign(x), 0.0, 0.0], 0.5) for x in (0.03, -0.03)])


@pytest.mark.parametrize("torque", [2e-11, 1e-12, 1e-17, 1e-30])
def test_what_a_witness_may_miss_proves_no_slip(torque: float) -> None:
    """A torque about the contacts' line is balanced by nothing; where it is only rounding, nothing follows."""
    load = np.array([0.0, 0.0, -1.0, torque, 0.0, 0.0])
    squeezed = Grasp(
        pinch().contacts,
        [GraspJoint("jaw", [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], (0,), "prismatic")],
        preload={"jaw": 10.0},
    )
    held = check(squeezed, load)
    assert held.verdict is Verdict.HOLDS
    slips = check(squeezed, 100 * load)
    assert slips.verdict is Verdict.SLIPS
    c = slips.certificate
    root = {name: getattr(c, name)[:1] for name in ("parent", "part", "state", "left", "right")}
    none = {name: getattr(c, name)[:0] for name in ("kind", "index", "a", "b", "multiplier")}
    leaf = replace(c, question=held.question, leaves=np.array([0]), start=np.array([0, 0]), **root, **none)
    assert not checker.verify(leaf).ok


def facing(tilt: float) -> tuple[Question, np.ndarray]:
    """Two jaws without friction that press with 10 N each, and no load; to balance along y matters by 1 / tilt."""
    contacts = [Contact([0.03, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.0), Contact([-0.03, 0.0, 0.0], [1.0, tilt, 0.0], 0.0)]
    joints = [
        GraspJoint(n, c.normal, np.zeros(3), (i,), "prismatic")
        for i, (n, c) in enumerate(zip("ab", contacts, strict=True))
    ]
    squeezed = Grasp(contacts, joints, preload={"a": 10.0, "b": 10.0})
    return Question(squeezed), squeezed.G.T[:, 1] / tilt


@pytest.mark.parametrize("sign", [-1, 1])
def test_rounding_of_normals_proves_no_slip(sign: int) -> None:
    """Forces without friction meet one equation in a special position: what it is missed by counts 1e17 times."""
    question, large = facing(1e-17)
    held = check(question.grasp, question.wrench)
    assert (held.verdict, held.witness.residuals.worst < 1e-9) == (Verdict.HOLDS, True)
    names, y = [(Row.E_UP, 0, 0, 0)], [1.0]
    for i, (_, *along) in enumerate(sign * large.reshape(-1, 3)):
        for axis, push in enumerate(along):
            names.append((Row.TANGENT, i, (axis + (0 if push > 0 else 2)) * TURN // 4, 0))
            y.append(abs(push))
    assert not checker.verify(empty(question, None, names, y)).ok


def test_nothing_is_no_magnitude(tmp_path: Path) -> None:
    """HOLDS at 0, with the state in which nothing acts and nothing moves."""
    answer = maximum(load_grasp("fig1").with_preload({}), Y)
    assert answer.verdict is Verdict.SLIPS

    def change(data: dict[str, Any]) -> None:
        g = answer.question.grasp
        none = {"r": [0.0] * 6, "q": [0.0] * g.l, "c": [0.0] * 3 * g.m, "f": [0.0] * g.mechanism.a, "coupling": []}
        data["witness"] = none | {"wrench": [0.0] * 6, "command": dict.fromkeys(g.mechanism.actuators, 0.0)}
        data["certificate"] = None
        data["answer"] |= {"verdict": "holds", "lower": 0.0, "upper": None, "gap": None, "certified": False}

    assert "HOLDS without a magnitude that is resisted" in forged(answer, tmp_path / "a.json", change).reason


@pytest.mark.parametrize(
    "limit",
    [
        {},
        {"value": "less"},
        {"object_motion": [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]},
        {"motion": "the object turns about the moon"},
        {"slides": [99]},
        {"moon": 1},
    ],
)
@pytest.mark.parametrize("preload", [False, True])
def test_a_limit_is_followed_again(limit: dict[str, Any], preload: bool, tmp_path: Path) -> None:
    """Of a weight in a cup, and of a finger that presses into one."""
    twist, down = np.eye(6)[5], -np.eye(6)[2]
    if preload:
        finger = Contact([0.0, 0.0, 0.03], [0.0, 0.0, -1.0], 0.0)
        joint = GraspJoint("push", [0.0, 0.0, -1.0], [0.0, 0.0, 0.0], (4,), "prismatic")
        answer = maximum(Grasp([*cup(1.1, 0.04, 0.25, 4), finger], [joint], preload={"push": 2.0}), twist)
    else:
        answer = maximum(Grasp(cup(1.2, 0.05, 0.3)), twist, base=5 * down)
    assert answer.attained is False
    assert forged(answer, tmp_path / "as it is.json", lambda data: None).ok

    def change(data: dict[str, Any]) -> None:
        values = {k: 0.99999 * data["answer"]["lower"] if v == "less" else v for k, v in limit.items()}
        data["answer"]["limit"] = data["answer"]["limit"] | values if limit else {}

    said = forged(answer, tmp_path / "a.json", change)
    assert not said.ok
    assert "limit" in said.reason


def test_no_limit_where_the_maximum_is_attained(tmp_path: Path) -> None:
    answer = maximum(load_grasp("fig1"), Y)
    assert answer.attained is True

    def change(data: dict[str, Any]) -> None:
        data["answer"] |= {"attained": False, "limit": {"value": data["answer"]["lower"]}}

    assert "limit" in forged(answer, tmp_path / "a.json", change).reason


def test_couplings_that_depend_on_each_other_hide_no_torque() -> None:
    """A coupling stated twice: its multipliers may be as large as anyone likes, and cancel."""
    joints = [GraspJoint(f"j{k}", [0.0, 0.0, 1.0], [0.03, -0.02 * (k + 1), 0.0], (0,)) for k in range(2)]
    A = np.array([[1.0, -0.5], [1.0, -0.5]])
    grasp = Grasp(pinch().contacts, joints, Mechanism(("j1",), np.array([[0.0, 1.0]]), A, (False,)), {"j1": 0.1})
    c = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    for size in (0.0, 1.0, 1e15):
        state = State(np.zeros(6), np.zeros(2), c, np.array([0.1]), np.array([size, -size]))
        assert model.residuals(grasp, np.zeros(6), state).joint_balance > 0.1


def test_what_is_no_number_is_no_residual() -> None:
    """Squares of the motion overflow where tiny forces are scaled up."""
    state = State([0, 0, 1e10, 0, 0, 0], [], 1e-158 * np.array([1.0, 0, 0.5, 1.0, 0, 0.5]), [], [])
    with np.errstate(all="ignore"):
        worst = model.residuals(pinch(), np.array([0, 0, -1e-158, 0, 0, 0]), state).worst
    assert not worst <= 1e-9


def test_names_fake_no_lines(tmp_path: Path) -> None:
    contacts = pinch().contacts
    with pytest.raises(InputError, match=r"name: is 'a.*; a name is one line of printable characters"):
        Grasp(contacts, name="a\nPROVED")
    with pytest.raises(InputError, match=r"joints\[0\]\.name: is"):
        Grasp(contacts, [GraspJoint("\x1b[8m", [0, 0, 1], [0, 0, 0], (0,))])
    answer = check(load_grasp("fig1"), [0, 3, 0, 0, 0, 0])
    with pytest.raises(InputError, match="without control characters"):
        forged(answer, tmp_path / "a.json", lambda data: data["question"]["grasp"].update(name="a\nPROVED"))


# --- beyond the end of a search ---------------------------------------------------------------------------


@pytest.mark.parametrize("mu", [4e-4, 5e-5])
def test_commands_however_large(mu: float) -> None:
    """A jaw that squeezes with F resists 2 mu F: 1 N takes F = 1 / (2 mu), which is beyond a thousand newtons."""
    jaw = GraspJoint("jaw", [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], (0,), "prismatic")
    contacts = [Contact(c.position, c.normal, mu) for c in pinch().contacts]
    answer = torques(Grasp(contacts, [jaw], preload={"jaw": 1.0}), [0.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert (answer.verdict, answer.stop, answer.verified) == (Verdict.HOLDS, Stop.COMPLETE, True)
    assert answer.lower <= 0.5 / mu * (1 + 1e-9)
    assert answer.upper == pytest.approx(0.5 / mu, rel=2e-3)


@pytest.mark.parametrize("word", ["1e101", "1e300"])
def test_loads_whose_squares_overflow(word: str) -> None:
    with pytest.raises(InputError, match=r"wrench: has .*; numbers up to 1e\+100 are possible"):
        check(pinch(), [float(word), 0, 0, 0, 0, 0])


def test_a_direction_that_is_next_to_nothing() -> None:
    with pytest.raises(InputError, match="direction: is zero, or next to it"):
        maximum(pinch(), [0, 1e-200, 0, 0, 0, 0])


def test_gravity_has_a_direction_and_no_size() -> None:
    usual = weight(1.0, [0.0, 0.0, 0.01], [0.0, -1.0, 0.0])
    np.testing.assert_allclose(weight(1.0, [0.0, 0.0, 0.01], [0.0, -1e200, 0.0]), usual, rtol=1e-12)


def witnessed(answer: Any, path: Path, witness: Witness) -> Verified:
    """What `verify` says of a SLIPS whose file claims HOLDS with this witness."""

    def change(data: dict[str, Any]) -> None:
        s = witness.state
        data["certificate"] = None
        data["witness"] = {
            "wrench": witness.wrench.tolist(),
            "command": dict.fromkeys(witness.grasp.mechanism.actuators, 0.0),
            **{name: getattr(s, name).tolist() for name in ("r", "q", "c", "f", "coupling")},
        }
        data["answer"].update({"verdict": "holds", "certified": False, "motion_cap": None} | witness.to_json())

    return forged(answer, path, change)


@pytest.mark.parametrize("size", [1e3, 1e15, 1e17, 1e30])
def test_forces_that_cancel_hide_no_torque(tmp_path: Path, size: float) -> None:
    """A locked motor and a coupling on q1 + q2 carry equal torques at both joints; the push makes 0.05 and 0.10 N m."""
    finger = Grasp(
        [Contact([0.03, 0.0, 0.0], [-1.0, 0.0, 0.0], 0.5)],
        [GraspJoint(name, [0.0, 0.0, 1.0], [0.03, -y, 0.0], (0,)) for name, y in (("a", 0.05), ("b", 0.1))],
        Mechanism(("m",), np.ones((1, 2)), np.ones((1, 2)), (False,)),
    )
    push = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    slips = check(finger, push)
    assert slips.verdict is Verdict.SLIPS
    state = State(push, np.zeros(2), np.array([1.0, 0.0, 0.0]), np.array([size]), np.array([-size]))
    assert not witnessed(slips, tmp_path / "r.json", Witness(finger, push, state, 0.0, True)).ok


def test_motions_that_cancel_make_no_motion(tmp_path: Path) -> None:
    """Two equal slides and a locked motor on their sum: the jaw stands still, however far they move against each other.

    Their columns of J are the same number, but its products with q are rounded, and so may be their sum.
    """
    e = 1 - 2.0**-53
    jaw = Grasp(
        [Contact([x, 0.0, 0.0], [-np.sign(x), 0.0, 0.0], 0.5) for x in (-0.03, 0.03)],
        [GraspJoint(name, [-e, 0.0, 0.0], [0.0, 0.0, 0.0], (1,), "prismatic") for name in "ab"],
        Mechanism(("m",), np.ones((1, 2)), np.zeros((0, 2)), (False,)),
    )
    across = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    slips = check(jaw, across)
    assert slips.verdict is Verdict.SLIPS
    for k, size in enumerate(np.geomspace(1e20, 1e30, 11) * 1.2345):
        q = np.array([size, -size])
        moved = float((jaw.J @ q)[3]) or 1e11  # what rounding makes of nothing
        q, moved = q * np.sign(moved), abs(moved)
        r = np.array([-moved / 2, 0.0, 0.0, 0.0, 0.0, 0.0])
        c = np.array([moved / 2, 0.0, 0.0, moved / 2, 0.0, 0.0])
        state = State(r, q, c, (jaw.J.T @ c)[:1], np.zeros(0))
        residuals = model.residuals(jaw, across, state)
        assert residuals.normal > 0.1
        assert not witnessed(slips, tmp_path / f"{k}.json", Witness(jaw, across, state, 0.0, True)).ok


@pytest.mark.parametrize("torque", [1e-12, 1e-15, 1e-20])
def test_what_a_witness_may_miss_bounds_no_magnitude(torque: float) -> None:
    """10 N of a jaw hold 10 N across; a torque about the contacts' line that is only rounding bounds nothing."""
    jaw = GraspJoint("jaw", [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], (0,), "prismatic")
    squeezed = Grasp(pinch().contacts, [jaw], preload={"jaw": 10.0})
    most = maximum(squeezed, np.array([0.0, 0.0, -1.0, torque, 0.0, 0.0]), force_limit=100.0)
    assert most.lower == pytest.approx(10.0, rel=2e-3)
    c = most.certificate
    assert checker.verify(c).ok
    scalar = Columns.of(c.question).scalar.start
    root = {name: getattr(c, name)[:1] for name in ("parent", "part", "state", "left", "right")}
    row = {"kind": int(Row.BOUND_UP), "index": scalar, "a": 0, "b": 0}
    leaf = replace(
        c,
        scalar=(2e-6, c.scalar[1]),
        leaves=np.array([0]),
        start=np.array([0, 1]),
        multiplier=np.array([1.0]),
        references=np.zeros((0, squeezed.m + 1)),
        **{name: np.array([value]) for name, value in row.items()},
        **root,
    )
    assert not checker.verify(leaf).ok
