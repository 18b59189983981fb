"""Closed loops: a four-bar linkage against its closed form, and against mujoco's own constraints."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.geometry.contacts import grasp_of
from handfast.model.grasp import Contact
from handfast.model.hand import Hand
from handfast.model.hand.coupling import coupled
from handfast.readers.load_hand import load_hand
from handfast.synthesis.task import Task
from tests.support.four_bar import FourBar

UPRIGHT = np.pi / 2


@pytest.fixture(scope="module")
def linkage(tmp_path_factory: pytest.TempPathFactory) -> Hand:
    return load_hand(FourBar().write(tmp_path_factory.mktemp("linkage")))


@pytest.mark.parametrize("angle", [0.3, 1.0, UPRIGHT, 2.2, 3.0, 4.2])
def test_a_four_bar_stands_where_its_circles_meet(linkage: Hand, angle: float) -> None:
    q = linkage.configuration({"crank": angle - UPRIGHT})
    assert linkage.values(q) == pytest.approx(FourBar().joints(angle), abs=1e-9)


def test_a_crank_that_cannot_turn_further_is_at_its_end_soon(tmp_path: Path) -> None:
    """There coupler and rocker are in line, 70 mm from pin to pin: cos = (40^2 + 50^2 - 70^2) / (2 * 40 * 50)."""
    bar = FourBar(crank=0.04, coupler=0.03, rocker=0.04, ground=0.05)
    hand, asked = load_hand(bar.write(tmp_path)), []
    closure = hand._closure
    counting = replace(closure, gaps=lambda q: asked.append(q) or closure.gaps(q))
    q = counting.closed(np.array([3.0, 0.0, 0.0]), as_far_as_possible=True)
    assert q[0] == pytest.approx(np.arccos(-0.2) - UPRIGHT, abs=5e-5)  # pins are let pass within 1e-6 m
    assert bar.joints(q[0] + UPRIGHT)["rocker"] == pytest.approx(q[2], abs=0.02)
    assert len(asked) < 300  # 1,312 where Newton's steps are not ended as soon as they lead away


def test_the_joint_with_the_motor_leads(linkage: Hand, tmp_path: Path) -> None:
    assert [linkage.joint_names[j] for j in linkage.dependent] == ["coupler", "rocker"]
    assert linkage.mechanism.actuators == ("m",)
    path = FourBar().write(tmp_path, motor='<motor name="m" joint="rocker"/>')
    path.write_text(path.read_text().replace('<joint name="rocker"/>', '<joint name="rocker" range="-.1 .1"/>'))
    other = load_hand(path)  # whose senses are found within limits: beyond them the linkage cannot be closed
    assert [other.joint_names[j] for j in other.dependent] == ["crank", "coupler"]
    bare = load_hand(FourBar().write(tmp_path, motor=""))
    assert bare.mechanism.actuators == ("crank",)


def test_motion_to_first_order_is_that_of_mujocos_constraint(tmp_path: Path) -> None:
    path = FourBar().write(tmp_path)
    hand, model = load_hand(path), mujoco.MjModel.from_xml_path(str(path))
    data, q = mujoco.MjData(model), hand.configuration({"crank": 0.4})
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    rows = data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    assert np.abs(data.efc_pos[rows]).max() < 1e-12
    theirs = data.efc_J.reshape(data.nefc, model.nv)[rows]
    A = hand.mechanism_at(q).A
    assert A.shape == (2, 3)
    np.testing.assert_array_equal(A[:, list(hand.dependent)], np.eye(2))
    free = np.linalg.svd(theirs)[2][-1]  # the one motion that it leaves
    np.testing.assert_allclose(A @ free, 0, atol=1e-12)
    assert hand.mechanism.A.shape == (0, 3)  # elsewhere it is another


def test_a_grasp_feels_the_linkage_at_its_configuration(linkage: Hand) -> None:
    """The contact's motion per motor motion, with the passive joints following, is that of the closed form."""
    q, step = linkage.configuration({"crank": 0.4}), 1e-6
    link = linkage.link("coupler")
    local = linkage.links[link].shapes[-1].pose[:3, 3]

    def at(crank: float) -> np.ndarray:
        pose = linkage.link_poses(linkage.configuration({"crank": crank}))[link]
        return pose[:3, :3] @ local + pose[:3, 3]

    contact = Contact(at(0.4), np.array([1.0, 0, 0]), 0.5, "coupler")
    grasp = grasp_of(linkage, q, [contact], np.eye(4))
    assert [j.name for j in grasp.joints] == ["crank", "coupler", "rocker"]
    motion = np.linalg.svd(grasp.mechanism.A)[2][-1]
    motion = motion / motion[0]
    moved = contact.frame @ (grasp.J @ motion)
    np.testing.assert_allclose(moved, (at(0.4 + step) - at(0.4 - step)) / (2 * step), atol=1e-7)
    direct = grasp_of(linkage, q, [contact], np.eye(4), mechanism="direct")
    assert (direct.mechanism.a, len(direct.mechanism.A)) == (3, 2)


def test_positions_that_no_assembly_reaches(tmp_path: Path) -> None:
    bar = FourBar(0.04, 0.035, 0.035, 0.05)
    hand = load_hand(bar.write(tmp_path))
    stretched = np.arccos((0.04**2 + 0.05**2 - 0.07**2) / (2 * 0.04 * 0.05))  # coupler and rocker in line
    with pytest.raises(InputError, match=r"^loop pin: cannot be closed at crank = 0.3; its ends stay .* mm apart$"):
        hand.configuration({"crank": 0.3})
    far = coupled(hand, np.array([0.3, 0.0, 0.0]))
    assert far[0] == pytest.approx(stretched - UPRIGHT, abs=1e-3)
    along = np.arctan2(-0.04 * np.sin(stretched), 0.05 - 0.04 * np.cos(stretched))
    upright = [np.arctan2(*(end - start)[::-1]) for start, end in _rods(bar)]
    turned = stretched - UPRIGHT
    singular = np.array([turned, along - upright[0] - turned, along + np.pi - upright[1]])
    with pytest.raises(InputError, match=r"loop pin: is in a singular position: the motion of coupler, rocker is not"):
        hand.mechanism_at(singular)


def _rods(bar: FourBar) -> list[tuple[np.ndarray, np.ndarray]]:
    """Start and end (2,) of coupler and rocker while the crank stands upright."""
    b, c = bar.pins(UPRIGHT)
    return [(b, c), (np.array([bar.ground, 0.0]), c)]


def test_a_value_for_a_joint_that_follows_has_to_be_its_own(linkage: Hand) -> None:
    right = linkage.values(linkage.configuration({"crank": 0.4}))
    off = right | {"rocker": right["rocker"] + 1e-3}  # as a simulator leaves it
    assert linkage.values(linkage.configuration(off)) == pytest.approx(right, abs=1e-9)
    with pytest.raises(InputError, match=r"rocker: is 1, but the loop that it is in puts it at 0.19\d*; leave it out"):
        linkage.configuration({"crank": 0.4, "rocker": 1.0})


def test_limits_of_a_joint_that_follows(tmp_path: Path) -> None:
    path = FourBar().write(tmp_path)
    path.write_text(path.read_text().replace('<joint name="rocker"/>', '<joint name="rocker" range="-.1 .1"/>'))
    hand = load_hand(path)
    with pytest.raises(InputError, match=r"rocker: is .* through its loop; the limits are \[-0.1, 0.1\]"):
        hand.configuration({"crank": 1.0})
    q = coupled(hand, np.array([[1.0, 0.0, 0.0], [0.1, 0.0, 0.0]]))
    assert q[0, 2] == pytest.approx(0.1, abs=1e-5)
    assert q[1, 0] == 0.1


def test_ends_that_never_meet_are_refused(tmp_path: Path) -> None:
    apart = '<connect name="pin" site1="end" site2="pivot"/>'  # 4 mm out of the plane
    with pytest.raises(InputError, match=r"four-bar.xml: loop pin: cannot be closed; its ends stay 4 mm apart"):
        load_hand(FourBar().write(tmp_path, pin=apart))


@pytest.mark.parametrize("pair", ['body1="crank" body2="palm"', 'body1="palm" body2="crank"'])
def test_a_weld_holds_what_it_welds(tmp_path: Path, pair: str) -> None:
    hand = load_hand(FourBar().write(tmp_path, pin=f"<weld {pair}/>"))
    assert hand.dependent == (0,)
    assert hand.values(hand.configuration({"rocker": 0.3})) == pytest.approx(
        {"crank": 0.0, "coupler": 0.0, "rocker": 0.3}
    )
    np.testing.assert_allclose(hand.mechanism_at(hand.configuration()).A, [[1, 0, 0]], atol=1e-12)
    with pytest.raises(InputError, match=r"crank: is 0.2, but the loop that it is in puts it at"):
        hand.configuration({"crank": 0.2})


def test_a_tree_has_no_loops() -> None:
    hand = load_hand("parallel-gripper")
    q = hand.configuration()
    assert hand.dependent == ()
    assert hand.closed(q) is q
    assert hand.mechanism_at(q) is hand.mechanism


def test_a_joint_of_a_loop_that_nothing_moves_is_idle(tmp_path: Path, linkage: Hand) -> None:
    """Four bars with a fifth joint between: the motor leaves one of the two degrees of freedom free."""
    assert linkage.idle == ()
    path = FourBar().write(tmp_path)
    middle = '<body name="mid"><joint name="mid" range="-1 0"/><geom type="sphere" size=".003"/>'
    text = path.read_text().replace('<body name="rocker"', f'{middle}</body><body name="rocker"')
    path.write_text(
        text.replace('<joint name="coupler"/>', '<joint name="coupler"/><joint name="bent" pos=".01 0 0"/>')
    )
    hand = load_hand(path)
    assert [hand.joint_names[j] for j in hand.dependent] == ["bent", "rocker"]
    assert [hand.joint_names[j] for j in hand.idle] == ["coupler"]  # `mid` is in no loop
    assert hand.closing[hand.joint("coupler")] == 0


def test_synthesis_refuses_a_loop(linkage: Hand) -> None:
    with pytest.raises(InputError, match=r"four-bar.xml: closes a loop \(pin\); synthesis knows hands whose links are"):
        Task.of(linkage, ())
