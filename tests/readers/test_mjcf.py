"""Signs and references in MJCF files: couplings as mujoco itself keeps them, tendons as mujoco itself pulls them."""

from __future__ import annotations

import itertools
import logging
import sys
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.limited import limited
from handfast.model.hand import Hand
from handfast.pictures.hand_facts import stated_masses
from handfast.readers.load_hand import load_hand


def write(folder: Path, rest: str = "", *, ref: tuple[float, float] = (0.0, 0.0), kind: str = "hinge") -> Path:
    """A palm with joint "a" and beyond it joint "b", whose values at the reference pose are `ref`."""
    path = folder / "hand.xml"
    path.write_text(f"""<mujoco model="m"><compiler angle="radian"/><worldbody>
      <body name="palm"><geom type="box" size=".03 .03 .01"/>
        <body name="p" pos=".03 0 0"><joint name="a" type="{kind}" axis="0 -1 0" range="-3 3" ref="{ref[0]}"/>
          <geom type="capsule" fromto="0 0 0 .05 0 0" size=".008"/>
          <body name="d" pos=".05 0 0"><joint name="b" type="{kind}" axis="0 -1 0" range="-3 3" ref="{ref[1]}"/>
            <geom type="sphere" size=".01"/></body></body></body>
      </worldbody>{rest}</mujoco>""")
    return path


def violation(path: Path, hand: Hand, q: np.ndarray) -> float:
    """[rad, m] by which mujoco finds the one equality violated."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    for joint, value in zip(hand.joints, q, strict=True):
        data.qpos[model.jnt_qposadr[model.joint(joint.name).id]] = value
    mujoco.mj_forward(model, data)
    rows = data.efc_pos[data.efc_type[: data.nefc] == mujoco.mjtConstraint.mjCNSTR_EQUALITY]
    assert rows.shape == (1,)
    return float(abs(rows[0]))


@pytest.mark.parametrize("kind", ["hinge", "slide"])
@pytest.mark.parametrize("ref", list(itertools.product((0.0, 0.3, -0.4), (0.0, 0.1))))
@pytest.mark.parametrize(("joint", "driver"), ["ab", "ba"])
def test_couplings_count_from_the_reference_pose(
    tmp_path: Path, joint: str, driver: str, ref: tuple[float, float], kind: str
) -> None:
    """mujoco: q - ref = 0.05 + 0.5 (q' - ref'), for the joint and the one that leads it."""
    tied = f'<equality><joint joint1="{joint}" joint2="{driver}" polycoef="0.05 0.5 0 0 0"/></equality>'
    path = write(tmp_path, tied, ref=ref, kind=kind)
    hand = load_hand(path)
    at = dict(zip("ab", ref, strict=True))
    for value in (-0.7, 0.0, 0.4):
        q = hand.configuration({driver: value})
        assert hand.values(q)[joint] == pytest.approx(at[joint] + 0.05 + 0.5 * (value - at[driver]), abs=1e-12)
        assert violation(path, hand, q) < 1e-9
        q[hand.joint(joint)] += 0.01
        assert violation(path, hand, q) == pytest.approx(0.01, abs=1e-9)
    assert hand.mechanism.actuators == (driver,)


@pytest.mark.parametrize("ref", [0.0, 0.3])
def test_an_equality_of_one_joint_holds_it_beside_its_reference(tmp_path: Path, ref: float) -> None:
    path = write(tmp_path, '<equality><joint joint1="a" polycoef="0.05 0 0 0 0"/></equality>', ref=(ref, 0.0))
    hand = load_hand(path)
    q = hand.configuration({})
    assert hand.values(q) == {"a": pytest.approx(ref + 0.05), "b": 0.0}
    assert violation(path, hand, q) < 1e-9
    np.testing.assert_array_equal(hand.mechanism.A, [[1.0, 0.0]])
    assert (hand.couplings[0].driver, hand.couplings[0].ratio) == (-1, 0.0)


@pytest.mark.parametrize(
    ("more", "tied", "ratio", "offset"),
    [
        ("", 'tendon1="s" tendon2="t" polycoef="0.06 0.5 0 0 0"', 4 / 3, -0.04),  # 2 a = 0.06 + 0.5 (3 b)
        ("", 'tendon1="t" tendon2="s" polycoef="0.06 -0.5 0 0 0"', -3.0, 0.06),  # 3 b = 0.06 - 0.5 (2 a)
        ('<joint joint="b" coef="-1"/>', 'tendon1="s" polycoef="0.06 0 0 0 0"', 2.0, -0.06),  # 2 a - b = 0.06
    ],
)
def test_an_equality_of_tendons_ties_the_joints_they_run_over(
    tmp_path: Path, more: str, tied: str, ratio: float, offset: float
) -> None:
    runs = f"""<fixed name="s"><joint joint="a" coef="2"/>{more}</fixed>
      <fixed name="t"><joint joint="b" coef="3"/></fixed>"""
    path = write(tmp_path, f"<tendon>{runs}</tendon><equality><tendon {tied}/></equality>")
    hand = load_hand(path)
    (coupling,) = hand.couplings
    leads = hand.joint_names[coupling.driver]
    assert (coupling.ratio, coupling.offset) == pytest.approx((ratio, offset))
    for value in (-0.7, 0.4):
        q = hand.configuration({leads: value})
        assert q[coupling.joint] == pytest.approx(ratio * value + offset)
        assert violation(path, hand, q) < 1e-9


def test_an_equality_that_is_switched_off_couples_nothing(tmp_path: Path) -> None:
    off = '<equality><joint joint1="b" joint2="a" polycoef="0 1 0 0 0" active="false"/></equality>'
    assert load_hand(write(tmp_path, off)).couplings == ()


WRAPS = '<tendon><fixed name="t"><joint joint="a" coef="0.01"/><joint joint="b" coef="-0.006"/></fixed></tendon>'


def driven(folder: Path, actuator: str, tendon: str = WRAPS) -> Path:
    return write(folder, f"{tendon}<actuator>{actuator}</actuator>")


def torques(path: Path, control: float) -> np.ndarray:
    """(2,) torques of the joints that mujoco makes of a control."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.ctrl[:] = control
    mujoco.mj_forward(model, data)
    return np.array(data.qfrc_actuator)


@pytest.mark.parametrize("gear", [1.0, -2.0])
@pytest.mark.parametrize("gain", [1.0, -3.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("limit", ["ctrl", "force"])
def test_a_tendon_that_can_have_one_sign_only_pulls(
    tmp_path: Path, limit: str, sign: float, gain: float, gear: float
) -> None:
    """Whatever the signs of range, gain and gear: pulling with a positive force turns the joints as mujoco does."""
    low, high = sorted((0.0, 5.0 * sign))
    limited = f'{limit}range="{low} {high}" {limit}limited="true"'
    path = driven(tmp_path, f'<general name="m" tendon="t" gainprm="{gain}" gear="{gear}" {limited}/>')
    hand = load_hand(path)
    assert hand.mechanism.tendon == (True,)
    control = 2.0 * sign * (np.sign(gain) if limit == "force" else 1.0)  # a force that the limit lets pass
    force = abs(gain * control)
    force = min(force, 5.0) if limit == "force" else force
    np.testing.assert_allclose(hand.mechanism.R[0] * force, torques(path, control), atol=1e-12)
    # of the two signs that R could have, the one that is right: the force on the tendon times its coefficients
    side = sign * (np.sign(gain) if limit == "ctrl" else 1.0)
    np.testing.assert_allclose(hand.mechanism.R, [[0.01 * gear * side, -0.006 * gear * side]], atol=1e-15)


@pytest.mark.parametrize(
    "actuator",
    [
        '<motor tendon="t"/>',
        '<motor tendon="t" ctrlrange="-1 5" ctrllimited="true"/>',
        '<motor tendon="t" ctrlrange="-5 0.5" ctrllimited="true"/>',
        '<motor tendon="t" ctrlrange="-1 5" ctrllimited="true" forcerange="-2 3" forcelimited="true"/>',
        '<position tendon="t" kp="3" ctrlrange="0 3" ctrllimited="true"/>',
        '<motor tendon="t" ctrlrange="0 5" ctrllimited="false"/>',
        '<motor tendon="t" forcerange="0 5" forcelimited="false"/>',
        '<motor joint="a" ctrlrange="0 5" ctrllimited="true"/>',
    ],
)
def test_what_can_push_is_no_tendon(tmp_path: Path, actuator: str) -> None:
    assert load_hand(driven(tmp_path, actuator)).mechanism.tendon == (False,)


def test_a_servo_whose_force_is_limited_to_one_sign_pulls(tmp_path: Path) -> None:
    servo = '<position name="s" tendon="t" kp="3" ctrlrange="-1 3" ctrllimited="true" forcerange="-4 0"/>'
    hand = load_hand(driven(tmp_path, servo))
    assert hand.mechanism.tendon == (True,)
    np.testing.assert_allclose(hand.mechanism.R, [[-0.01, 0.006]])


def test_every_tendon_has_its_own_joints(tmp_path: Path) -> None:
    other = '<tendon><fixed name="u"><joint joint="b" coef="0.02"/></fixed></tendon>'
    hand = load_hand(driven(tmp_path, '<motor tendon="u"/><motor tendon="t"/>', WRAPS + other))
    np.testing.assert_allclose(hand.mechanism.R, [[0, 0.02], [0.01, -0.006]])


def test_motors_are_geared_and_named(tmp_path: Path) -> None:
    motors = '<motor name="m" joint="b" gear="-2.5"/><motor jointinparent="a" gear="3"/>'
    hand = load_hand(driven(tmp_path, motors, ""))
    assert hand.mechanism.actuators == ("m", "actuator_1")
    np.testing.assert_array_equal(hand.mechanism.R, [[0, -2.5], [3, 0]])
    assert hand.mechanism.tendon == (False, False)


@pytest.mark.parametrize(
    ("actuator", "most"),
    [
        ('<motor joint="a" gear="-3" forcerange="-2 1" forcelimited="true"/>', 6.0),
        ('<motor joint="a" gear="3" ctrlrange="-2 5" ctrllimited="true"/>', 15.0),
        (
            '<general joint="a" gainprm="-4" ctrlrange="-2 5" ctrllimited="true" forcerange="-7 7" '
            'forcelimited="true"/>',
            7.0,
        ),
        (
            '<position joint="a" kp="1e6" ctrlrange="-1 1" ctrllimited="true" forcerange="-3 3" forcelimited="true"/>',
            3.0,
        ),
        ('<motor tendon="t" ctrlrange="-9 0" ctrllimited="true"/>', 0.09),
    ],
)
def test_the_strength_of_a_motor_is_what_mujoco_lets_it_give(tmp_path: Path, actuator: str, most: float) -> None:
    path = driven(tmp_path, actuator, WRAPS)
    hand = load_hand(path)
    strength = hand.strengths[hand.mechanism.actuators[0]]
    given = max(abs(torques(path, control)[0]) for control in (-1e9, 1e9))
    assert strength * abs(hand.mechanism.R[0, 0]) == pytest.approx(given)
    assert given == pytest.approx(most)


def test_strengths_that_no_file_states_and_those_of_joints(tmp_path: Path) -> None:
    servo = '<position name="s" joint="a" kp="3" ctrlrange="-1 3" ctrllimited="true"/><motor name="m" joint="b"/>'
    assert load_hand(driven(tmp_path, servo, "")).strengths == {}  # the range is one of positions
    path = driven(tmp_path, '<motor name="m" joint="a" gear="-4" forcerange="-1 1" forcelimited="true"/>', "")
    path.write_text(
        path.read_text().replace('name="a"', 'name="a" actuatorfrcrange="-2 2" actuatorfrclimited="true"', 1)
    )
    assert load_hand(path).strengths == {"m": 0.5}


@pytest.mark.parametrize(
    ("rest", "match"),
    [
        (
            '<tendon><spatial name="t"><site site="x"/><site site="y"/></spatial></tendon>'
            '<actuator><motor name="m" tendon="t"/></actuator>',
            r"actuator m: pulls a spatial tendon; a fixed one is needed",
        ),
        (
            '<actuator><motor name="m" site="x"/></actuator>',
            r"actuator m: acts on a site; joints and fixed tendons are understood",
        ),
        (
            '<equality><joint name="e" joint1="b" joint2="a" polycoef="0 1 0.2 0 0"/></equality>',
            r"equality e: has polycoef \[0.0, 1.0, 0.2, 0.0, 0.0\]; it must be linear",
        ),
        (
            '<equality><joint joint1="b" joint2="a" polycoef="0 1 0 0 -0.1"/></equality>',
            r"equality 0: has polycoef \[0.0, 1.0, 0.0, 0.0, -0.1\]; it must be linear",
        ),
    ],
)
def test_transmissions_and_couplings_that_are_refused(tmp_path: Path, rest: str, match: str) -> None:
    path = write(tmp_path, rest)
    sites = '<site name="x"/><site name="y" pos="0.1 0 0"/><geom type="box"'
    path.write_text(path.read_text().replace('<geom type="box"', sites, 1))
    with pytest.raises(InputError, match=rf"hand.xml: {match}$"):
        load_hand(path)


# --- links, joints and solids -------------------------------------------------------------------------


def world(folder: Path, bodies: str, head: str = "", model: str = ' model="m"') -> Path:
    path = folder / "file.xml"
    path.write_text(
        f'<mujoco{model}><compiler angle="radian"/>{head}<worldbody><geom type="plane" size="1 1 1"/>'
        f"{bodies}</worldbody></mujoco>"
    )
    return path


GEOM = '<geom type="sphere" size="0.01"/>'
TURNED = 'pos="1 2 3" quat="1 0 0 1"'  # by 90 degrees about z


def test_the_only_body_is_the_base_unless_it_has_a_pose_of_its_own(tmp_path: Path) -> None:
    inner = f'<body name="tip" {TURNED}><joint name="j" axis="0 0 2" range="-1 2"/>{GEOM}</body>'
    expected = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    apart = load_hand(world(tmp_path, f'<body name="palm" {TURNED}>{GEOM}{inner}</body>'))
    assert apart.link_names == ("world", "palm", "tip")
    np.testing.assert_allclose(apart.links[1].pose, expected, atol=1e-15)
    hand = load_hand(world(tmp_path, f'<body name="palm">{GEOM}{inner}</body>'))
    assert hand.link_names == ("palm", "tip")
    assert [(link.parent, link.joints) for link in hand.links] == [(-1, ()), (0, (0,))]
    np.testing.assert_array_equal(hand.links[0].pose, np.eye(4))
    np.testing.assert_allclose(hand.links[1].pose, expected, atol=1e-15)
    assert (hand.name, hand.source) == ("m", str(tmp_path / "file.xml"))
    assert hand.mechanism.tendon == (False,)


def test_several_bodies_or_one_that_moves_stand_on_the_world(tmp_path: Path) -> None:
    moving = f'<body {TURNED}><joint range="-1 2"/>{GEOM}</body>'
    for bodies, joints in ((moving, 1), (f"<body>{GEOM}</body><body {TURNED}>{GEOM}</body>", 0), (2 * moving, 2)):
        hand = load_hand(world(tmp_path, bodies, model=""))
        names = ["body_1", "body_2"][: len(hand.links) - 1]
        assert hand.link_names == ("world", *names)
        assert [link.parent for link in hand.links] == [-1, *[0] * len(names)]
        assert hand.links[0].shapes == ()  # floors are no part of a hand
        assert [len(link.shapes) for link in hand.links[1:]] == [1] * len(names)
        np.testing.assert_array_equal(hand.links[-1].pose[:3, 3], [1, 2, 3])
        assert hand.joint_names == ("joint_0", "joint_1")[:joints]


@pytest.mark.parametrize(
    ("compiler", "limits", "said"),
    [
        ("", "0 1.2", "hand.xml: no joint turns more than 1.2 degrees; if its limits are radians"),
        ("", "-60 60", ""),
        ('<compiler angle="radian"/>', "0 0.02", ""),
        ('<compiler angle="degree"/>', "0 1.2", ""),
    ],
)
def test_radians_that_mujoco_takes_for_degrees(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, compiler: str, limits: str, said: str
) -> None:
    path = tmp_path / "hand.xml"
    path.write_text(f"""<mujoco>{compiler}<worldbody><body name="palm">{GEOM}<body name="tip">
      <joint axis="0 1 0" range="{limits}"/>{GEOM}</body></body></worldbody></mujoco>""")
    with caplog.at_level(logging.WARNING, "handfast"):
        load_hand(path)
    assert said in caplog.text
    assert bool(said) is bool(caplog.text)


def test_a_body_may_have_several_joints(tmp_path: Path) -> None:
    joints = '<joint name="s" type="slide" axis="1 0 0" range="-1 2" pos="0 0 4"/><joint name="h" pos="0 0 5"/>'
    inner = f"<body>{GEOM}</body><body>{joints}{GEOM}<body><joint name='k' range='0 1'/>{GEOM}</body></body>"
    hand = load_hand(world(tmp_path, f"<body>{GEOM}{inner}</body>"))
    assert [link.joints for link in hand.links] == [(), (), (0, 1), (2,)]
    assert [link.parent for link in hand.links] == [-1, 0, 0, 2]
    s, h, k = hand.joints
    assert [(j.name, j.type) for j in (s, h, k)] == [("s", "prismatic"), ("h", "revolute"), ("k", "revolute")]
    assert [(j.lower, j.upper) for j in (s, h, k)] == [(-1, 2), (-2 * np.pi, 2 * np.pi), (0, 1)]
    np.testing.assert_array_equal([j.anchor[2] for j in (s, h, k)], [4, 5, 0])
    np.testing.assert_array_equal(s.axis, [1, 0, 0])


def test_solids_have_their_whole_sizes_and_stand_where_they_are_put(tmp_path: Path) -> None:
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    kinds = {
        "box": ("0.1 0.2 0.3", (0.2, 0.4, 0.6)),
        "sphere": ("0.1", (0.1,)),
        "ellipsoid": ("0.1 0.2 0.3", (0.1, 0.2, 0.3)),
        "capsule": ("0.1 0.2", (0.1, 0.4)),
        "cylinder": ("0.1 0.2", (0.1, 0.4)),
    }
    looks = '<geom type="sphere" size="1" contype="0" conaffinity="0"/>'  # between the others
    geoms = [f'<geom type="{kind}" size="{size}" {TURNED}/>' for kind, (size, _) in kinds.items()]
    geoms += ['<geom name="half" type="sphere" size="0.1" contype="0"/>', '<geom type="mesh" mesh="t"/>']
    head = '<asset><mesh name="t" file="t.obj"/></asset>'
    (palm,) = load_hand(world(tmp_path, f'<body name="palm">{looks.join(geoms)}</body>', head)).links
    assert [s.kind for s in palm.shapes] == [*kinds, "sphere", "mesh"]
    assert [s.name for s in palm.shapes] == ["palm/0", "palm/1", "palm/2", "palm/3", "palm/4", "half", "palm/6"]
    for s, (_, size) in zip(palm.shapes, kinds.values(), strict=False):
        assert tuple(s.size) == pytest.approx(size, rel=1e-12)
        expected = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
        np.testing.assert_allclose(s.pose, expected, atol=1e-15)
    assert palm.shapes[-1].volume == pytest.approx(1 / 6)


@pytest.mark.parametrize(
    ("bodies", "match"),
    [
        ("", "has no bodies; a hand is needed"),
        (
            '<body><geom name="g" type="plane" size="1 1 1"/></body>',
            "geom g: is a plane; boxes, spheres, capsules, cylinders, ellipsoids and meshes are understood",
        ),
        (f"<body><freejoint name='f'/>{GEOM}</body>", "joint f: is a free joint; a hand has hinges and"),
        (f"<body><joint type='ball'/>{GEOM}</body>", "joint joint_0: is a ball joint; a hand has hinges and"),
    ],
)
def test_bodies_that_are_refused(tmp_path: Path, bodies: str, match: str) -> None:
    with pytest.raises(InputError, match=rf"file.xml: {match}"):
        load_hand(world(tmp_path, bodies))


def test_the_link_of_a_missing_mesh_is_named(tmp_path: Path) -> None:
    head = '<asset><mesh name="n" file="gone.stl"/></asset>'
    body = f"<body name='palm'>{GEOM}<body name='tip'>{GEOM}<geom type='mesh' mesh='n'/></body></body>"
    with pytest.raises(InputError, match=r"file.xml: link tip: Error opening file '.*gone.stl'"):
        load_hand(world(tmp_path, body, head))
    unnamed = head.replace('name="n" ', "")  # a mesh is called like its file
    with pytest.raises(InputError, match=r"file.xml: link \?: Error opening file '.*gone.stl'"):
        load_hand(world(tmp_path, body.replace("mesh='n'", "mesh='gone'").replace(" name='tip'", ""), unnamed))
    with pytest.raises(InputError, match=r"file.xml: Error opening file '.*gone.stl'"):
        load_hand(world(tmp_path, f"<body name='palm'>{GEOM}</body>", head))


# --- files that ask for more than there is ------------------------------------------------------------------

SMALL = '<body><joint range="0 1"/><geom size=".1"/></body>'
GREEDY = {
    "replicated": f'<replicate count="1000"><replicate count="1000"><replicate count="1000">{SMALL}</replicate>'
    "</replicate></replicate>",
    "flexible": '<flexcomp name="f" type="grid" count="1000 1000 1000" spacing=".1 .1 .1" radius=".01" dim="3"/>',
    "a field": '<body><joint/><geom type="hfield" hfield="h"/></body></worldbody>'
    '<asset><hfield name="h" nrow="60000" ncol="60000" size="1 1 1 1"/></asset><worldbody>',
    "a picture": f'{SMALL}</worldbody><asset><texture name="t" type="2d" builtin="flat" width="60000" height="60000"/>'
    "</asset><worldbody>",
}


@pytest.fixture
def poor(monkeypatch: pytest.MonkeyPatch) -> None:
    """Little memory and time for foreign files, as these want all of it."""
    for module in ("readers.mjcf", "pictures.hand_facts"):
        monkeypatch.setattr(f"handfast.{module}.limited", partial(limited, memory=1 << 27, seconds=1))
    monkeypatch.setattr(
        "handfast.core.limited.CLOCK_FACTOR", 100
    )  # on a busy machine, too, processor time is what ends it


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others have no limit of memory")
@pytest.mark.usefixtures("poor")
@pytest.mark.parametrize("name", GREEDY)
def test_a_small_file_that_asks_for_everything_is_one_line(tmp_path: Path, name: str) -> None:
    file = tmp_path / "hand.xml"
    file.write_text(f"<mujoco><worldbody>{GREEDY[name]}</worldbody></mujoco>")
    with pytest.raises(InputError, match=r"hand\.xml: .*(memory|processor time)") as caught:
        load_hand(file)
    assert "\n" not in str(caught.value)


@pytest.mark.usefixtures("poor")
def test_masses_of_such_a_file_are_not_stated(tmp_path: Path) -> None:
    file = tmp_path / "hand.xml"
    file.write_text(f"<mujoco><worldbody>{SMALL}</worldbody></mujoco>")
    hand = load_hand(file)
    file.write_text(f"<mujoco><worldbody>{GREEDY['replicated']}</worldbody></mujoco>")
    assert stated_masses(hand) == {}


def test_no_hand_has_so_many_parts(tmp_path: Path) -> None:
    file = tmp_path / "hand.xml"
    most = "<mujoco><worldbody><body><joint/>{}</body></worldbody></mujoco>"
    # the world and the body that carries them are links, too
    for part, count, what in ((SMALL, 299, "301 links"), ('<geom size=".1"/>', 3001, "3001 collision shapes")):
        repeated = f'<replicate count="{count}" offset="1 0 0">{part}</replicate>'
        file.write_text(most.format('<geom size=".1"/>' + repeated if "link" in what else repeated))
        with pytest.raises(InputError, match=rf"hand\.xml: has {what}; a hand has at most 300"):
            load_hand(file)
    file.write_text(most.format('<replicate count="3000" offset="1 0 0"><geom size=".1"/></replicate>'))
    assert sum(len(link.shapes) for link in load_hand(file).links) == 3000
