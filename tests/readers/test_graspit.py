"""GraspIt! robots, bodies and worlds: kinematics against values worked out by hand, and what is refused."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.shape import Shape
from handfast.readers.configuration_file import load_configuration
from handfast.readers.graspit.graspit_body import MATERIALS, friction_of
from handfast.readers.graspit.graspit_world import load_graspit_world
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from tests.support.graspit_files import body, chain, dof, joint, placed, write_object, write_robot, write_world

BALL = Body.of([Shape("sphere", 0.03)])


def test_a_finger_of_two_joints_in_a_plane_stands_where_trigonometry_says(tmp_path: Path) -> None:
    """Links of 50 and 30 mm turning about z, 10 mm up: x = 50 cos q1 + 30 cos(q1 + q2), y with sines."""
    finger = chain(
        joint("d0", a=50), joint("d0*0.5+30", a=30), at="<translation>0 0 10</translation>", links=("Revolute",) * 2
    )
    hand = load_hand(write_robot(tmp_path, dof(), finger))
    assert hand.joint_names == ("chain0_joint0", "chain0_joint1")
    assert hand.link_names == ("palm", "chain0_link0", "chain0_link1")
    q = hand.configuration({"chain0_joint0": 0.4})
    np.testing.assert_allclose(q, [0.4, 0.2])
    first, second = 0.4, 0.4 + 0.2 + np.pi / 6
    tip = [0.05 * np.cos(first) + 0.03 * np.cos(second), 0.05 * np.sin(first) + 0.03 * np.sin(second), 0.01]
    poses = hand.link_poses(q)
    np.testing.assert_allclose(poses[2][:3, 3], tip, atol=1e-15)
    np.testing.assert_allclose(poses[2][:3, 0], [np.cos(second), np.sin(second), 0], atol=1e-15)
    np.testing.assert_allclose(hand.limits, [[0, np.pi / 2]] * 2)


def test_a_universal_joint_turns_about_both_axes(tmp_path: Path) -> None:
    """About z, then, 20 mm along x and after a twist of 90 degrees, about what was -y; the link is 40 mm further."""
    finger = chain(joint("d0", a=20, alpha=90), joint("d1", a=40), links=("Universal",))
    hand = load_hand(write_robot(tmp_path, dof(), dof(), finger))
    a, b = 0.3, 0.5
    pose = hand.link_poses(np.array([a, b]))[1]
    along = 0.02 + 0.04 * np.cos(b)
    np.testing.assert_allclose(pose[:3, 3], [along * np.cos(a), along * np.sin(a), 0.04 * np.sin(b)], atol=1e-15)
    axes, _ = hand.joint_axes(np.array([a, b]))
    np.testing.assert_allclose(axes, [[0, 0, 1], [np.sin(a), -np.cos(a), 0]], atol=1e-15)


def test_prismatic_joints_are_in_millimetres_and_a_negative_ratio_turns_the_limits(tmp_path: Path) -> None:
    finger = chain(joint("90", d="d0*-10+5", low=0, high=-20), links=("Prismatic",))
    hand = load_hand(write_robot(tmp_path, dof(velocity=-1), finger))
    np.testing.assert_allclose(hand.limits, [[-0.02, 0]])
    np.testing.assert_allclose(hand.link_poses(np.array([-0.01]))[1][:3, 3], [0, 0, -0.005], atol=1e-15)
    np.testing.assert_array_equal(hand.closing, [1])  # a default velocity below 0 times a ratio below 0


def test_joints_of_a_rigid_dof_are_coupled_and_those_of_a_compliant_one_share_its_torque(tmp_path: Path) -> None:
    finger = chain(joint("d0*2"), joint("d0*3"), links=("Revolute",) * 2)
    rigid = load_hand(write_robot(tmp_path, dof(), finger))
    assert [(c.joint, c.driver, c.ratio) for c in rigid.couplings] == [(1, 0, 1.5)]
    np.testing.assert_array_equal(rigid.mechanism.R, [[1, 0]])
    assert not rigid.breakaway
    compliant = load_hand(write_robot(tmp_path, dof("c"), finger))
    assert compliant.couplings == ()
    np.testing.assert_array_equal(compliant.mechanism.R, [[1, 1.5]])
    assert load_hand(write_robot(tmp_path, dof("b"), finger)).breakaway
    assert rigid.mechanism.actuators == compliant.mechanism.actuators == ("d0",)


def test_parts_of_a_transform_are_multiplied_in_their_order(tmp_path: Path) -> None:
    """Nine numbers of a matrix stand column after column: here a quarter turn about z, as in the parts before."""
    turn, move = "<rotation>90 z</rotation>", "<translation>10 0 0</translation>"
    matrix = "<rotationMatrix>0 1 0 -1 0 0 0 0 1</rotationMatrix>"
    full = "<fullTransform>(0.5 0.5 0.5 0.5)[1 2 3]</fullTransform>"
    for parts, wanted in ((turn + move, [0, 0.01, 0]), (move + turn, [0.01, 0, 0]), (matrix + move, [0, 0.01, 0])):
        hand = load_hand(write_robot(tmp_path, dof(), chain(joint("d0"), at=parts)))
        np.testing.assert_allclose(hand.links[1].pose[:3, 3], wanted, atol=1e-15)
    pose = load_hand(write_robot(tmp_path, dof(), chain(joint("d0"), at=full))).links[1].pose
    np.testing.assert_allclose(pose[:3], [[0, 0, 1, 0.001], [1, 0, 0, 0.002], [0, 1, 0, 0.003]], atol=1e-15)


def test_an_offset_after_a_minus_alone_is_passed_over_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING, "handfast"):
        hand = load_hand(write_robot(tmp_path, dof(), chain(joint("d0-90", a=10))))
    assert "'d0-90' is read as GraspIt! reads it, without its offset" in caplog.text
    np.testing.assert_allclose(hand.links[1].pose[:3, 3], [0.01, 0, 0], atol=1e-15)
    hand = load_hand(write_robot(tmp_path, dof(), chain(joint("d0+-90", a=10))))
    np.testing.assert_allclose(hand.links[1].pose[:3, 3], [0, -0.01, 0], atol=1e-15)


def test_what_is_not_read_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "handfast"):
        load_hand(write_robot(tmp_path, dof("b"), chain(joint("d0")), "<virtualContacts>v.xml</virtualContacts>"))
    assert "not read: breakaway torques, virtual contacts" in caplog.text


def test_links_whose_rule_is_off_or_a_pair_do_not_collide(tmp_path: Path) -> None:
    def two(*rules: str) -> str:
        return chain(joint("d0"), joint("d0*2"), links=("Revolute", "Revolute"), rules=rules)

    by_base = "collisionRule='OverlappingPair' targetChain='base'"
    first = two("collisionRule='Off'", by_base)
    second = two("collisionRule='OverlappingPair' targetChain='0' targetLink='1'", "collisionRule='OverlappingPair'")
    third = two("", "collisionRule=' OverlappingPair ' targetLink='0'")
    hand = load_hand(write_robot(tmp_path, dof(), first, second, third))
    solid = {link.name for link in hand.links if link.shapes}
    assert solid == {f"chain{c}_link{k}" for c in range(3) for k in range(2)} - {"chain0_link0"} | {"palm"}
    assert hand.non_colliding == {
        ("palm", "chain0_link1"),
        ("chain0_link1", "chain1_link0"),
        ("chain2_link0", "chain2_link1"),
    }
    assert not hand.may_collide("chain1_link0", "chain0_link1")
    assert hand.may_collide("chain1_link1", "chain0_link1")
    checked = {frozenset((hand.link_names[a], hand.link_names[b])) for a, b in Scene(hand, BALL).self_pairs}
    assert frozenset(("chain0_link1", "chain1_link0")) not in checked
    assert frozenset(("chain0_link1", "chain1_link1")) in checked


FINGER = chain(joint("d0"))


@pytest.mark.parametrize(
    ("parts", "match"),
    [
        ((dof("x"), FINGER), "robot.xml: dof 0: has type 'x'; r, b and c are understood$"),
        ((dof(), chain(joint("2*d0"))), r"joint chain0_joint0.theta: is '2\*d0'; such as d0, d0\*2 or"),
        ((dof(), chain(joint("d1"))), "joint chain0_joint0.theta: is 'd1', and there are 1 DOFs, d0 first$"),
        ((dof(), chain(joint("d0", a=float("nan")))), "joint chain0_joint0.a: is 'nan'; a finite number"),
        (
            (dof(), chain(joint("d0"), links=("Screw",))),
            "link chain0_link0: has dynamicJointType 'Screw'; known: Fixed,",
        ),
        (
            (dof(), chain(joint("d0"), links=("Universal",))),
            "link chain0_link0: is Universal, and its chain has too few",
        ),
        ((dof(), FINGER.replace("link.xml", "no.xml")), "link chain0_link0: its file 'no.xml' was not found in"),
        ((dof(), chain(joint("d0"), at="<rotation>90 w</rotation>")), "chain 0.rotation: is '90 w'; an angle and x,"),
        ((dof(), chain(joint("d0"), at="<shear>1</shear>")), "chain 0.shear: is not a known part of a transform$"),
        (
            (dof(), chain(joint("d0"), rules=("collisionRule='On'",))),
            "link chain0_link0: has collisionRule 'On'; known: Off, OverlappingPair$",
        ),
        (
            (dof(), chain(joint("d0"), rules=("collisionRule='OverlappingPair' targetLink='1'",))),
            "link chain0_link0: overlaps link '1' of chain '0'; a chain and a link, both counted from 0, or",
        ),
        ((dof(), FINGER.replace("Revolute'><theta", "Helical'><theta")), "has type 'Helical'; Revolute and Prismatic"),
    ],
)
def test_robots_that_are_refused(tmp_path: Path, parts: tuple[str, ...], match: str) -> None:
    with pytest.raises(InputError, match=match):
        load_hand(write_robot(tmp_path, *parts))


def test_xml_with_entities_or_too_deep_is_refused(tmp_path: Path) -> None:
    path = write_robot(tmp_path, dof(), FINGER)
    whole = path.read_text()
    path.write_text("<!DOCTYPE r [<!ENTITY a 'aaaa'><!ENTITY b '&a;&a;&a;'>]>" + whole)
    with pytest.raises(InputError, match=r"^[^:]*robot.xml: has a document type \(<!DOCTYPE ...>\), which is not"):
        load_hand(path)
    path.write_text("<robot>" + "<a>" * 600 + "</a>" * 600 + "</robot>")
    with pytest.raises(InputError, match=r"^[^:]*robot.xml: has elements more than 500 deep in each other$"):
        load_hand(path)


def test_a_body_is_in_millimetres_and_grams(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    offset = "<geometryOffset><transform><translation>0 0 100</translation></transform></geometryOffset>"
    path = write_object(tmp_path, "<material>glass</material><mass>200</mass><cog>1 2 3</cog>", offset)
    with caplog.at_level(logging.WARNING, "handfast"):
        block = load_body(path)
    assert "is of glass; its friction depends on the hand (GraspIt!: 0.2 on glass, 0.2 on metal" in caplog.text
    assert (block.mass, block.friction) == (pytest.approx(0.2), 0.5)
    np.testing.assert_allclose(block.center_of_mass, [0.001, 0.002, 0.003])
    np.testing.assert_allclose(
        [block.vertices.min(0), block.vertices.max(0)], [[-0.01, -0.02, 0.07], [0.01, 0.02, 0.13]]
    )
    np.testing.assert_allclose(block.pieces[0].centroid, [0, 0, 0.1], atol=1e-12)
    doubled = load_body(write_object(tmp_path, "<geometryScaling>2</geometryScaling>"), mass=0.3, friction=0.1)
    np.testing.assert_allclose(np.ptp(doubled.vertices, axis=0), [0.04, 0.08, 0.12])
    assert (doubled.mass, doubled.friction) == (0.3, 0.1)


@pytest.mark.parametrize(
    ("inside", "match"),
    [
        ("<material>jelly</material>", "block.xml: material: is 'jelly'; known: frictionless, glass, metal, plastic"),
        ("<geometryScaling>0</geometryScaling>", "geometryScaling: is not positive$"),
        ("<geometryScalingX>2</geometryScalingX>", "geometryScaling: differs along the axes; scale the mesh itself$"),
        ("<cog>1 2</cog>", "cog: is '1 2'; 3 finite numbers are needed$"),
        ("<geometryFile>no.iv</geometryFile>", "geometryFile: is 'no.iv', which was not found in"),
    ],
)
def test_bodies_that_are_refused(tmp_path: Path, inside: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        load_body(write_object(tmp_path, inside))


def test_the_table_of_friction_is_symmetric() -> None:
    assert all(friction_of(a, b) == friction_of(b, a) for a in MATERIALS for b in MATERIALS)
    assert (friction_of("rubber", "glass"), friction_of("stone", "wood"), friction_of("metal", "frictionless")) == (
        1,
        0.6,
        0,
    )


def scene(tmp_path: Path, *more: str, dofs: str = "0.5 0 0", kind: str = "b") -> Path:
    write_robot(tmp_path / "models", dof(kind), chain(joint("d0"), joint("d0*0.5"), links=("Revolute",) * 2))
    write_object(tmp_path / "models", "<material>glass</material>")
    half = np.sqrt(0.5)
    robot = placed("robot", "models/robot.xml", f"({half} 0 0 {half})[100 0 0]", dofs)
    return write_world(tmp_path, robot, placed("graspableBody", "models/block.xml", "(1 0 0 0)[100 30 7]"), *more)


def test_a_world_is_a_hand_an_object_and_a_configuration(tmp_path: Path) -> None:
    """The palm is turned by 90 degrees about z, so that 30 mm along y are 30 mm along its x."""
    hand, block, found = load_graspit_world(scene(tmp_path))
    assert (Path(found.hand or "").name, Path(found.object or "").name) == ("robot.xml", "block.xml")
    np.testing.assert_allclose(found.object_pose.position, [0.03, 0, 0.007], atol=1e-12)
    assert found.joints == {"chain0_joint0": 0.5, "chain0_joint1": 0.25}
    assert found.applied(hand)[1].tolist() == [0.5, 0.25]
    assert block.friction == 0.2  # of glass on plastic, the palm's; 1 on the rubber of the links


def test_a_joint_in_breakaway_has_its_own_value_and_rounding_does_not_pass_a_limit(tmp_path: Path) -> None:
    found = load_configuration(scene(tmp_path, dofs="1.57081 1 0.2 0"))
    assert found.joints == {"chain0_joint0": 0.2, "chain0_joint1": pytest.approx(0.785405)}
    assert load_configuration(scene(tmp_path, dofs="1.57085 0 0")).joints["chain0_joint0"] == np.pi / 2


def test_an_arm_is_no_hand_and_one_of_several_is_chosen(tmp_path: Path) -> None:
    write_robot(tmp_path / "models", dof(), FINGER, name="arm.xml")
    write_object(tmp_path / "models", name="other.xml")
    arm, link = (
        placed("robot", "models/arm.xml"),
        "<connection><parentRobot>1</parentRobot><childRobot>0</childRobot></connection>",
    )
    other = placed("graspableBody", "models/other.xml", "(1 0 0 0)[0 0 9]")
    path = scene(tmp_path, arm, link, other)
    with pytest.raises(InputError, match=r"has 2 objects \(block, other\); choose one: world.xml#block$"):
        load_configuration(path)
    with pytest.raises(InputError, match=r"has 2 objects \(block, block\); leave one in a copy of the world$"):
        load_configuration(scene(tmp_path, placed("graspableBody", "models/block.xml")))
    path = scene(tmp_path, arm, link, other)
    found = load_configuration(f"{path}#other")
    assert (Path(found.hand or "").stem, Path(found.object or "").stem) == ("robot", "other")
    with pytest.raises(InputError, match=r"has no robot or object 'cup'; known: arm, block, other, robot$"):
        load_configuration(f"{path}#cup")


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"dofs": "0.5 0"}, "world.xml: dofValues: has 2 numbers, too few for 1 DOFs$"),
        ({"dofs": "0.5 0 0 1"}, "dofValues: has 4 numbers, too many for 1 DOFs$"),
        ({"dofs": "2 0 0"}, r"dofValues: chain0_joint0 is 2; the limits are \[0, 1.5708\]$"),
        ({"dofs": "0.5", "kind": "c"}, "dofValues: dof 0 is compliant: where its joints stand depends on springs"),
    ],
)
def test_worlds_that_are_refused(tmp_path: Path, options: dict[str, str], match: str) -> None:
    with pytest.raises(InputError, match=match):
        load_configuration(scene(tmp_path, **options))


def test_files_of_another_kind_are_named(tmp_path: Path) -> None:
    path = tmp_path / "some.xml"
    path.write_text(body())
    with pytest.raises(InputError, match=r"some.xml: has root element <root>; <world> is needed$"):
        load_configuration(path)
    path.write_text("<world><robot/></world>")
    with pytest.raises(InputError, match=r"has no object; one is needed$"):
        load_configuration(path)
    with pytest.raises(InputError, match=r"has root element <world>; <root> or <body> is needed$"):
        load_body(path)
