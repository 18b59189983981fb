"""Hands: loaders, kinematics against mujoco and finite differences, couplings, bundled hands."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handfast.core.errors import InputError
from handfast.model.hand import Hand
from handfast.model.hand.hand import Joint, Link
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape
from handfast.readers.load_hand import BUNDLED, load_hand
from tests.support.places import ROOT, SHARED

SHARED = SHARED / "hands"
BARRETT = SHARED / "barrett_hand" / "bhand_model.urdf"
ALLEGRO = SHARED / "allegro_hand" / "allegro_hand_right.urdf"
DATA = ROOT / "src" / "handfast" / "data" / "hands"

JOINTED = set(BUNDLED) - {"step-ground"}  # ground has no joints

URDF = """<robot name="two">
  <link name="base"/>
  <link name="palm"><collision><origin xyz="0 0 0.01"/>
    <geometry><box size="0.1 0.1 0.02"/></geometry></collision></link>
  <link name="proximal">{solid}</link>
  <link name="distal"><collision>
    <geometry><capsule radius="0.01" length="0.04"/></geometry></collision></link>
  <joint name="mount" type="fixed"><parent link="base"/><child link="palm"/><origin xyz="0 0 0.1"/></joint>
  <joint name="a" type="{kind}"><parent link="palm"/><child link="proximal"/>
    <origin xyz="0.05 0 0.02" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/><limit lower="-0.2" upper="1.5"/></joint>
  <joint name="b" type="revolute"><parent link="proximal"/><child link="distal"/>
    <origin xyz="0.06 0 0"/><axis xyz="0 1 0"/><limit lower="0" upper="1.6"/>{mimic}</joint>
</robot>"""
BOX = "<collision><geometry><box size='.05 .02 .02'/></geometry></collision>"


def urdf(tmp_path: Path, solid: str = BOX, kind: str = "revolute", mimic: str = "") -> Path:
    path = tmp_path / "two.urdf"
    path.write_text(URDF.format(solid=solid, kind=kind, mimic=mimic))
    return path


def mjcf(tmp_path: Path, rest: str = "", joint: str = 'range="0 1.5"') -> Path:
    path = tmp_path / "hand.xml"
    path.write_text(f"""<mujoco model="m"><compiler angle="radian"/><worldbody>
      <geom type="plane" size="1 1 1"/>
      <body name="palm" pos="0 0 0.3"><geom type="box" size=".03 .03 .01"/>
        <body name="p" pos=".03 0 0"><joint name="a" axis="0 -1 0" {joint}/>
          <geom type="capsule" fromto="0 0 0 .05 0 0" size=".008"/>
          <geom name="look" type="sphere" size=".02" contype="0" conaffinity="0"/>
          <body name="d" pos=".05 0 0"><joint name="b" axis="0 -1 0" range="0 1.2" ref="0.1"/>
            <geom type="ellipsoid" size=".03 .01 .01" pos=".02 0 0"/></body></body></body>
      </worldbody>{rest}</mujoco>""")
    return path


def random_configuration(hand: Hand, seed: int) -> np.ndarray:
    low, high = hand.limits.T
    return np.random.default_rng(seed).uniform(low, high)


def mujoco_poses(model: mujoco.MjModel, hand: Hand, q: np.ndarray) -> dict[str, np.ndarray]:
    data = mujoco.MjData(model)
    for joint, value in zip(hand.joints, q, strict=True):
        data.qpos[model.jnt_qposadr[model.joint(joint.name).id]] = value
    mujoco.mj_kinematics(model, data)
    out = {}
    for b in range(model.nbody):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[b].reshape(3, 3), data.xpos[b]
        out[model.body(b).name] = T
    return out


def mujoco_urdf(path: Path) -> mujoco.MjModel:
    """The same URDF read by mujoco, meshes left out: an independent reading of frames and axes."""
    text = re.sub(r"<!--.*?-->", "", path.read_text(), flags=re.S)
    text = re.sub(r"<(visual|collision|inertial)( [^>]*)?>.*?</\1>", "", text, flags=re.S)
    spec = mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False
    for body in spec.bodies[1:]:
        body.mass, body.inertia, body.explicitinertial = 1.0, [1, 1, 1], True
    return spec.compile()


@pytest.mark.parametrize("name", [*BUNDLED])
@pytest.mark.parametrize("seed", range(5))
def test_forward_kinematics_is_mujocos(name: str, seed: int) -> None:
    hand = load_hand(name)
    file = next(p for p in DATA.iterdir() if p.stem == name)
    model = mujoco.MjModel.from_xml_path(str(file)) if file.suffix == ".xml" else mujoco_urdf(file)
    q = random_configuration(hand, seed)
    theirs = mujoco_poses(model, hand, q)
    ours = hand.link_poses(q)
    checked = 0
    for i, link in enumerate(hand.links):
        if link.name in theirs:
            np.testing.assert_allclose(ours[i], theirs[link.name], atol=1e-9)
            checked += 1
    assert checked >= len(hand.links) - 1


@pytest.mark.skipif(not BARRETT.is_file(), reason="needs ../shared")
@pytest.mark.parametrize("path", [BARRETT, ALLEGRO], ids=["barrett", "allegro"])
def test_forward_kinematics_of_real_files_is_mujocos(path: Path) -> None:
    hand = load_hand(path)
    q = random_configuration(hand, 7)
    theirs, ours = mujoco_poses(mujoco_urdf(path), hand, q), hand.link_poses(q)
    for i, link in enumerate(hand.links[1:], start=1):
        np.testing.assert_allclose(ours[i], theirs[link.name], atol=1e-9)


@given(seed=st.integers(0, 2**31), name=st.sampled_from(sorted(JOINTED)))
@settings(max_examples=40, deadline=None)
def test_jacobian_is_the_derivative_of_a_fixed_point(seed: int, name: str) -> None:
    hand = load_hand(name)
    q = random_configuration(hand, seed)
    rng = np.random.default_rng(seed)
    link = int(rng.integers(len(hand.links)))
    local = np.append(rng.uniform(-0.05, 0.05, 3), 1.0)

    def point(q: np.ndarray) -> np.ndarray:
        return (hand.link_poses(q)[link] @ local)[:3]

    h = 1e-6
    numeric = np.column_stack([(point(q + h * e) - point(q - h * e)) / (2 * h) for e in np.eye(hand.l)])
    np.testing.assert_allclose(hand.jacobian(link, point(q), q), numeric, atol=1e-8)
    still = [j for j in range(hand.l) if j not in hand.moved_by(link)]
    assert not hand.jacobian(link, point(q), q)[:, still].any()


def test_a_bundled_hand_is_as_it_was_whoever_had_it_before() -> None:
    """It is read once; its strengths are a dict."""
    name = next(iter(load_hand("barrett-bh8-280").strengths))
    load_hand("barrett-bh8-280").strengths[name] = 0.0
    assert load_hand("barrett-bh8-280").strengths[name] > 0


def test_positive_is_closing_in_the_bundled_hands() -> None:
    for name in ("barrett-bh8-280", "schunk-sah"):
        hand = load_hand(name)
        q = hand.configuration()
        for j in np.flatnonzero(hand.closing):
            link = next(i for i, x in enumerate(hand.links) if int(j) in x.joints)
            T = hand.link_poses(q)[link]
            forward = T[:3, 3] + 0.05 * T[:3, 0]  # a point further out on the link
            palmar = T[:3, 2]
            assert hand.jacobian(link, forward, q)[:, j] @ palmar == pytest.approx(0.05)


def test_barrett_dimensions() -> None:
    hand = load_hand("barrett-bh8-280")
    poses = hand.link_poses(hand.configuration())
    at = dict(zip(hand.link_names, poses, strict=True))
    np.testing.assert_allclose(at["finger_1_prox"][:3, 3], [0.025, 0.05, 0.0754], atol=1e-12)
    np.testing.assert_allclose(at["finger_3_prox"][:3, 3], [0, -0.05, 0.0754], atol=1e-12)
    reach = at["finger_3_dist"][:3, 3] - at["finger_3_prox"][:3, 3]
    assert np.linalg.norm(reach) == pytest.approx(0.07, abs=1e-6)
    assert np.degrees(np.arctan2(reach[2], -reach[1])) == pytest.approx(2.456, abs=1e-3)
    tip = next(s for s in hand.links[hand.link("finger_3_dist")].shapes if s.kind == "sphere")
    assert tip.size == (0.008,)
    assert np.linalg.norm(tip.pose[:3, 3]) + 0.008 == pytest.approx(0.058, abs=1e-6)
    turned = hand.link_poses(hand.configuration({"finger_1_spread": np.pi}))
    np.testing.assert_allclose(turned[hand.link("finger_1_prox")][:3, 3], [0.025, -0.05, 0.0754], atol=1e-12)
    np.testing.assert_allclose(turned[hand.link("finger_2_prox")][:3, 3], [-0.025, -0.05, 0.0754], atol=1e-12)
    sideways = hand.link_poses(hand.configuration({"finger_1_spread": np.pi / 2}))
    np.testing.assert_allclose(sideways[hand.link("finger_1_prox")][:3, 3], [0.075, 0, 0.0754], atol=1e-12)


@pytest.mark.skipif(not BARRETT.is_file(), reason="needs ../shared")
@pytest.mark.parametrize("seed", range(5))
def test_barrett_moves_as_the_vendors_description(seed: int) -> None:
    ours, theirs = load_hand("barrett-bh8-280"), load_hand(BARRETT)
    spread, *prox = np.random.default_rng(seed).uniform(0, 2.2, 4)
    q = ours.configuration({"finger_1_spread": spread} | {f"finger_{k}_prox": prox[k - 1] for k in (1, 2, 3)})
    values = {"finger_1_prox_joint": -spread, "finger_2_prox_joint": spread}
    values |= {f"finger_{k}_med_joint": -prox[k - 1] for k in (1, 2, 3)}
    values |= {f"finger_{k}_dist_joint": -prox[k - 1] / 3 for k in (1, 2, 3)}
    a, b = ours.link_poses(q), theirs.link_poses(theirs.configuration(values))
    for k in (1, 2, 3):
        T, S = a[ours.link(f"finger_{k}_dist")], b[theirs.link(f"finger_{k}_dist_link")]
        np.testing.assert_allclose(T[:3, 3], S[:3, 3], atol=6e-4)  # their finger 2 is 0.4 mm off finger 1
        np.testing.assert_allclose(T[:3, 0], -S[:3, 0], atol=1e-4)
        np.testing.assert_allclose(T[:3, 2], S[:3, 1], atol=1e-4)


def test_schunk_thumb_follows_the_published_frames() -> None:
    hand = load_hand("schunk-sah")
    for a in (0.0, 0.7, np.pi / 2):
        T = hand.link_poses(hand.configuration({"thumb_base": a}))[hand.link("thumb_base")]
        x, z = np.array([0, 0, 1]), np.array([-np.sin(a), -np.cos(a), 0])
        np.testing.assert_allclose(T[:3, 3], [-0.003, 0.0271, 0], atol=1e-9)
        np.testing.assert_allclose(T[:3, :3], np.column_stack([x, np.cross(z, x), z]), atol=1e-9)
    q = hand.configuration({"index_abduction": 0.2})
    U, y0 = np.array([1, 0, 0]), np.array([0, -0.99937, -0.035485])
    y0 = y0 / np.linalg.norm(y0)
    y = np.cos(0.2) * y0 + np.sin(0.2) * np.cross(U, y0)
    T = hand.link_poses(q)[hand.link("index_proximal")]
    np.testing.assert_allclose(T[:3, 3], [-0.0043, 0.040165, 0.14543], atol=1e-9)
    np.testing.assert_allclose(T[:3, :3], np.column_stack([np.cross(y, U), y, U]), atol=1e-6)
    full = hand.configuration({"index_middle": 0.5})
    assert hand.values(full)["index_distal"] == 0.5
    clipped = hand.values(full)["ring_distal"]  # 0, clipped to the middle joint's limit, then coupled
    assert clipped == pytest.approx(np.radians(4), abs=1e-6)
    assert hand.links[hand.link("ring_knuckle")].shapes == ()


def test_closing_guess_and_override(tmp_path: Path) -> None:
    hand = load_hand(urdf(tmp_path))
    assert hand.closing.tolist() == [1, 1]
    turned = hand.with_closing({"a": 0, "b": -1})
    assert turned.closing.tolist() == [0, -1]
    assert hand.closing.tolist() == [1, 1]
    with pytest.raises(InputError, match=r"unknown joint 'c'; known: a, b"):
        hand.with_closing({"c": 1})
    with pytest.raises(InputError, match=r"closing.a: is 2; -1, 0 or 1"):
        hand.with_closing({"a": 2})
    assert load_hand("barrett-bh8-280").closing.tolist() == [0, 1, 1, 0, 1, 1, 1, 1]


def test_mimic_becomes_a_coupling(tmp_path: Path) -> None:
    hand = load_hand(urdf(tmp_path, mimic='<mimic joint="a" multiplier="0.5" offset="0.1"/>'))
    np.testing.assert_array_equal(hand.mechanism.A, [[-0.5, 1.0]])
    np.testing.assert_array_equal(hand.mechanism.R, [[1.0, 0.0]])
    assert hand.mechanism.actuators == ("a",)
    np.testing.assert_allclose(hand.configuration({"a": 0.4}), [0.4, 0.3])
    np.testing.assert_allclose(hand.configuration({"b": 0.3}), [0.4, 0.3])
    np.testing.assert_allclose(hand.configuration(), [0, 0.1])
    np.testing.assert_allclose(hand.configuration({"a": 0.4, "b": 1.0}), [0.4, 1.0])  # an open clutch


def test_configuration_refuses(tmp_path: Path) -> None:
    hand = load_hand(urdf(tmp_path, mimic='<mimic joint="a" multiplier="2"/>'))
    with pytest.raises(InputError, match=r"unknown joint 'c'; known: a, b"):
        hand.configuration({"c": 0})
    with pytest.raises(InputError, match=r"a: is nan; a finite number"):
        hand.configuration({"a": np.nan})
    with pytest.raises(InputError, match=r"a: is 1.6; the limits are \[-0.2, 1.5\]"):
        hand.configuration({"a": 1.6})
    with pytest.raises(InputError, match=r"b: is 2.8 through its coupling; the limits are \[0, 1.6\]"):
        hand.configuration({"a": 1.4})
    assert hand.configuration({"a": 0.8 + 5e-7})[1] == pytest.approx(1.6, abs=1e-5)


def test_fixed_links_keep_their_names(tmp_path: Path) -> None:
    hand = load_hand(urdf(tmp_path))
    assert hand.link_names == ("base", "palm", "proximal", "distal")
    assert hand.links[1].joints == ()
    assert hand.moved_by(3) == (0, 1)
    assert hand.moved_by(1) == ()
    assert hand.links[0].shapes == ()
    assert [s.kind for link in hand.links for s in link.shapes] == ["box", "box", "capsule"]
    assert hand.source.endswith("two.urdf")


TETRA = "v 0 0 0\nv 10 0 0\nv 0 20 0\nv 0 0 30\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.mark.parametrize("name", ["package://some_hand/meshes/t.obj", "../meshes/t.obj"])
def test_meshes_stand_where_the_origin_puts_them(tmp_path: Path, name: str) -> None:
    package = tmp_path / "some_hand"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    (package / "meshes" / "t.obj").write_text(TETRA)
    solid = (
        f"<collision><origin xyz='0.1 0.2 0.3' rpy='0 0 1.5707963267948966'/>"
        f"<geometry><mesh filename='{name}' scale='0.001 0.001 0.001'/></geometry></collision>"
    )
    shape = load_hand(urdf(package / "urdf", solid)).links[2].shapes[0]
    vertices, _ = shape.triangles()
    expected = np.array([[0.1, 0.2, 0.3], [0.1, 0.21, 0.3], [0.08, 0.2, 0.3], [0.1, 0.2, 0.33]])
    order = [int(np.linalg.norm(vertices - e, axis=1).argmin()) for e in expected]
    np.testing.assert_allclose(vertices[order], expected, atol=1e-12)
    assert shape.volume == pytest.approx(1e-6)


def test_mjcf_meshes_stand_where_the_geom_puts_them(tmp_path: Path) -> None:
    """The compiler moves a mesh into its principal axes; the shape must undo that."""
    (tmp_path / "t.obj").write_text(TETRA)
    asset = '<asset><mesh name="m" file="t.obj" scale="0.001 0.001 0.001"/></asset>'
    path = mjcf(tmp_path, asset)
    geom = '<geom type="mesh" mesh="m" pos="0.1 0.2 0.3" euler="0 0 1.5707963267948966"/>'
    path.write_text(path.read_text().replace('<geom type="ellipsoid"', geom + '<geom type="ellipsoid"'))
    shape = next(s for s in load_hand(path).links[-1].shapes if s.kind == "mesh")
    vertices, _ = shape.triangles()
    expected = np.array([[0.1, 0.2, 0.3], [0.1, 0.21, 0.3], [0.08, 0.2, 0.3], [0.1, 0.2, 0.33]])
    order = [int(np.linalg.norm(vertices - e, axis=1).argmin()) for e in expected]
    np.testing.assert_allclose(vertices[order], expected, atol=1e-8)


def test_bad_files_are_one_clear_line(tmp_path: Path) -> None:
    mesh = "<collision><geometry><mesh filename='package://gone/m.stl'/></geometry></collision>"
    gone = r"two.urdf: link proximal: its mesh file 'package://gone/m.stl' was not found"
    with pytest.raises(InputError, match=gone) as caught:
        load_hand(urdf(tmp_path, mesh))
    assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match=r"joint a: has type 'floating'"):
        load_hand(urdf(tmp_path, kind="floating"))
    with pytest.raises(InputError, match=r"joint b: mimics joint 'z'"):
        load_hand(urdf(tmp_path, mimic='<mimic joint="z"/>'))
    with pytest.raises(InputError, match=r"<box> size is '1 2'; 3 finite numbers"):
        load_hand(urdf(tmp_path, "<collision><geometry><box size='1 2'/></geometry></collision>"))
    with pytest.raises(InputError, match=r"box.size: is \[0.0, 1.0, 1.0\]; sizes are positive"):
        load_hand(urdf(tmp_path, "<collision><geometry><box size='0 1 1'/></geometry></collision>"))
    with pytest.raises(InputError, match=r"unknown hand 'barret'; known: barrett-bh8-280, schunk-sah"):
        load_hand("barret")
    with pytest.raises(InputError, match=r"nothing.urdf: no such file"):
        load_hand(tmp_path / "nothing.urdf")
    xacro = '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="f"/></robot>'
    (tmp_path / "t.urdf.xacro").write_text(xacro)
    with pytest.raises(InputError, match=r"t.urdf.xacro: has xacro macros, which are not read; `xacro t.urdf.xacro >"):
        load_hand(tmp_path / "t.urdf.xacro")
    (tmp_path / "t.urdf").write_text("not xml")
    with pytest.raises(InputError, match=r"t.urdf: is not XML"):
        load_hand(tmp_path / "t.urdf")
    (tmp_path / "t.urdf").write_text("<sdf/>")
    with pytest.raises(InputError, match=r"root element <sdf>; <robot> or <mujoco> is needed"):
        load_hand(tmp_path / "t.urdf")


def test_mjcf_links_shapes_and_default_mechanism(tmp_path: Path) -> None:
    hand = load_hand(mjcf(tmp_path))
    assert hand.link_names == ("world", "palm", "p", "d")  # the palm has a pose of its own
    assert [len(link.shapes) for link in hand.links] == [0, 1, 1, 1]  # `look` cannot collide
    assert hand.mechanism.actuators == ("a", "b")
    capsule = hand.links[2].shapes[0]
    assert capsule.kind == "capsule"
    assert capsule.size == pytest.approx((0.008, 0.05))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hand.xml"))
    q = np.array([0.7, 0.9])  # joint b has a reference that is not zero
    theirs = mujoco_poses(model, hand, q)
    for i, name in enumerate(hand.link_names):
        np.testing.assert_allclose(hand.link_poses(q)[i], theirs[name], atol=1e-9)


def test_mjcf_equality_and_tendons(tmp_path: Path) -> None:
    linear = '<equality><joint joint1="b" joint2="a" polycoef="0.05 0.5 0 0 0"/></equality>'
    hand = load_hand(mjcf(tmp_path, linear))
    np.testing.assert_array_equal(hand.mechanism.A, [[-0.5, 1.0]])
    np.testing.assert_allclose(hand.configuration({"a": 0.4}), [0.4, 0.1 + 0.05 + 0.2])
    wraps = '<joint joint="a" coef="0.01"/><joint joint="b" coef="0.006"/>'
    tendon = f'<tendon><fixed name="t">{wraps}</fixed></tendon>'
    pulls = tendon + '<actuator><motor name="m" tendon="t" ctrlrange="-5 0" ctrllimited="true"/></actuator>'
    hand = load_hand(mjcf(tmp_path, pulls))
    assert hand.mechanism.tendon == (True,)
    np.testing.assert_allclose(hand.mechanism.R, [[-0.01, -0.006]])
    both = tendon + '<actuator><motor name="m" tendon="t" gear="2"/></actuator>'
    hand = load_hand(mjcf(tmp_path, both))
    assert hand.mechanism.tendon == (False,)
    np.testing.assert_allclose(hand.mechanism.R, [[0.02, 0.012]])
    servo = '<actuator><position tendon="t" kp="3" ctrlrange="0 3" ctrllimited="true"/></actuator>'
    assert load_hand(mjcf(tmp_path, tendon + servo)).mechanism.tendon == (False,)


def test_mjcf_refusals(tmp_path: Path) -> None:
    curved = '<equality><joint joint1="b" joint2="a" polycoef="0 1 0.2 0 0"/></equality>'
    with pytest.raises(InputError, match=r"hand.xml: equality 0: has polycoef .*; it must be linear"):
        load_hand(mjcf(tmp_path, curved))
    with pytest.raises(InputError, match=r"joint a: is a ball joint; a hand has hinges and slides on a fixed base"):
        load_hand(mjcf(tmp_path, joint='type="ball"'))
    broken = mjcf(tmp_path, '<asset><mesh name="m" file="gone.stl"/></asset>')
    broken.write_text(
        broken.read_text().replace('<geom type="ellipsoid"', '<geom type="mesh" mesh="m"/><geom type="ellipsoid"', 1)
    )
    with pytest.raises(InputError, match=r"hand.xml: link d: Error opening file '.*gone.stl'") as caught:
        load_hand(broken)
    assert "\n" not in str(caught.value)


def test_parallel_gripper() -> None:
    hand = load_hand("parallel-gripper")
    assert hand.mechanism.actuators == ("grip",)
    np.testing.assert_array_equal(hand.mechanism.A, [[-1, 1]])
    np.testing.assert_allclose(hand.configuration({"left_slide": 0.01}), [0.01, 0.01])
    assert {j.type for j in hand.joints} == {"prismatic"}


@pytest.mark.skipif(not ALLEGRO.is_file(), reason="needs ../shared")
def test_allegro_keeps_its_tips() -> None:
    hand = load_hand(ALLEGRO)
    assert hand.l == 16
    assert hand.links[hand.link("link_3.0_tip")].joints == ()
    assert hand.links[hand.link("link_3.0_tip")].shapes[0].kind == "mesh"
    assert hand.links[hand.link("palm")].shapes == ()


@given(seed=st.integers(0, 2**31))
@settings(max_examples=30, deadline=None)
def test_hull_is_closed_outward_and_contains_its_points(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(20, 3))
    hull = Shape.hull(points)
    assert hull.volume > 0
    assert hull.depth(points).min() > -1e-9
    assert hull.depth(hull.centroid)[0] > 0


def test_slow_libraries_are_imported_late() -> None:
    code = (
        "import sys, handfast.readers.load_hand, handfast.readers.load_body;"
        "import handfast.geometry.contacts, handfast.planning.closing;"
        "handfast.readers.load_hand.load_hand('schunk-sah');"
        "print([m for m in ('mujoco', 'trimesh', 'pydantic', 'coacd') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("places", [((), (0,), (0,)), ((), (0, 0), ())])
def test_a_joint_moves_one_link_once(places: tuple[tuple[int, ...], ...]) -> None:
    """Kinematics and its checker would differ about a joint that two links share."""
    links = tuple(Link(f"link {i}", i - 1, np.eye(4), joints) for i, joints in enumerate(places))
    mechanism = Mechanism(("a",), np.eye(1), np.zeros((0, 1)), (False,))
    with pytest.raises(InputError, match="a: moves two links, or one link twice; once is right"):
        Hand("twins", links, (Joint("a", "revolute", (0, 0, 1), (0, 0, 0), -1.0, 1.0),), mechanism, (), np.ones(1))
