"""Objects from URDF and SDF files and from folders of pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.readers.load_body import load_body

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + "".join(
    f"f {a} {b} {c}\nf {a} {c} {d}\n"
    for a, b, c, d in ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
)


def urdf(folder: Path, inside: str) -> Path:
    path = folder / "thing.urdf"
    path.write_text(f"<robot name='mallet'>{inside}</robot>")
    return path


def sdf(folder: Path, inside: str, more: str = "") -> Path:
    path = folder / "thing.sdf"
    path.write_text(f"<sdf version='1.7'><model name='mallet'>{inside}</model>{more}</sdf>")
    return path


HEAD = """<link name='head'><inertial><origin xyz='0 0 0.1'/><mass value='0.3'/></inertial>
  <visual><geometry><sphere radius='9'/></geometry></visual>
  <collision><origin xyz='0 0 0.1' rpy='0 0 1.5707963267948966'/><geometry><box size='0.1 0.02 0.04'/></geometry>
  </collision></link>"""
GRIP = """<link name='grip'><inertial><mass value='0.1'/></inertial>
  <collision><geometry><cylinder radius='0.01' length='0.2'/></geometry></collision></link>
  <joint name='j' type='fixed'><parent link='head'/><child link='grip'/><origin xyz='0 0 -0.1'/></joint>"""

SDF = """<pose>9 9 9 0 0 0</pose>
  <link name='head'><pose>0 0 0.1 0 0 1.5707963267948966</pose>
    <inertial><mass>0.3</mass></inertial>
    <collision name='c'><geometry><box><size>0.1 0.02 0.04</size></box></geometry>
      <surface><friction><ode><mu>0.8</mu></ode></friction></surface></collision></link>
  <link name='grip'><inertial><pose>0 0 -0.1 0 0 0</pose><mass>0.1</mass></inertial>
    <collision name='c'><pose degrees='true'>0 0 -0.1 0 0 90</pose>
      <geometry><cylinder><radius>0.01</radius><length>0.2</length></cylinder></geometry>
      <surface><friction><ode><mu>0.6</mu></ode></friction></surface></collision></link>
  <joint name='j' type='fixed'><parent>head</parent><child>grip</child></joint>"""


@pytest.mark.parametrize("kind", ["urdf", "sdf"])
def test_links_in_their_places_with_their_masses(tmp_path: Path, kind: str) -> None:
    body = load_body(urdf(tmp_path, HEAD + GRIP) if kind == "urdf" else sdf(tmp_path, SDF))
    assert body.name == "mallet"
    box, grip = body.pieces
    assert (box.kind, box.size, grip.kind, grip.size) == ("box", (0.1, 0.02, 0.04), "cylinder", (0.01, 0.2))
    np.testing.assert_allclose(box.pose, [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(grip.pose[:3, 3], [0, 0, -0.1])
    assert body.mass == pytest.approx(0.4)
    np.testing.assert_allclose(body.center_of_mass, [0, 0, (0.3 * 0.1 - 0.1 * 0.1) / 0.4], atol=1e-12)
    assert body.friction == (0.5 if kind == "urdf" else 0.6)
    again = load_body(tmp_path / f"thing.{kind}", mass=2.0, friction=0.3, center_of_mass=(1, 2, 3), scale=10)
    assert (again.mass, again.friction, again.center_of_mass.tolist()) == (2.0, 0.3, [1, 2, 3])
    assert again.pieces[0].size == pytest.approx((1, 0.2, 0.4))
    np.testing.assert_allclose(again.pieces[1].pose[:3, 3], [0, 0, -1])
    np.testing.assert_allclose(load_body(tmp_path / f"thing.{kind}", scale=10).center_of_mass[2], 0.5)


def test_meshes_are_found_and_placed(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "cube.obj").write_text(CUBE)
    mesh = "<mesh filename='meshes/cube.obj' scale='0.1 0.1 0.1'/>"
    collision = f"<collision><origin xyz='1 0 0'/><geometry>{mesh}</geometry></collision>"
    one = load_body(urdf(tmp_path, f"<link name='l'>{collision}</link>"))
    uri = f"<mesh><uri>model://{tmp_path.name}/meshes/cube.obj</uri><scale>0.1 0.1 0.1</scale></mesh>"
    turned = "<pose rotation_format='quat_xyzw'>1 0 0 0 0 0 1</pose>"
    two = load_body(
        sdf(tmp_path, f"<link name='l'><visual name='v'>{turned}<geometry>{uri}</geometry></visual></link>")
    )
    for body in (one, two):
        np.testing.assert_allclose(np.ptp(body.vertices, axis=0), 0.1)
        np.testing.assert_allclose(body.center_of_mass, [1.05, 0.05, 0.05])
        assert body.mass is None


def test_a_folder_is_an_object_of_pieces(tmp_path: Path) -> None:
    folder = tmp_path / "mug"
    folder.mkdir()
    (folder / "piece_0.obj").write_text(CUBE)
    (folder / "piece_1.obj").write_text(CUBE.replace("v 0", "v 4").replace("v 1", "v 5"))
    (folder / "notes.txt").write_text("made by hand")
    body = load_body(folder, mass=0.2, scale=0.1)
    assert (body.name, body.mass, len(body.pieces)) == ("mug", 0.2, 2)
    assert body.vertices[:, 0].max() == pytest.approx(0.5)
    np.testing.assert_allclose(body.center_of_mass, [0.25, 0.05, 0.05])
    (folder / "whole.obj").write_text(CUBE.replace("v 1 1 1", "v .2 .2 .2"))  # a corner pushed in
    with pytest.raises(InputError, match=r"whole.obj: is not convex; a folder is taken for the convex pieces of one"):
        load_body(folder)


@pytest.mark.parametrize(
    "other", ["<ode><mu>0.8</mu><mu2>0.2</mu2></ode>", "<bullet><friction>0.2</friction></bullet>"]
)
def test_the_smallest_friction_of_all_that_are_given(tmp_path: Path, other: str) -> None:
    assert load_body(sdf(tmp_path, SDF.replace("<ode><mu>0.8</mu></ode>", other))).friction == 0.2


LINK = "<link name='l'><collision>{}</collision></link>"


@pytest.mark.parametrize(
    ("kind", "inside", "match"),
    [
        ("urdf", HEAD + GRIP.replace("fixed", "revolute"), r"joint j: is revolute; an object is one rigid body"),
        ("urdf", "<link name='l'/>", r"has no collision or visual shapes; an object needs at least one solid"),
        ("urdf", LINK.format(""), r"link l: has a collision without geometry"),
        ("urdf", LINK.format("<geometry><plane/></geometry>"), r"link l: has a plane; box, sphere, cylinder, capsule"),
        ("urdf", LINK.format("<geometry><box/></geometry>"), r"link l: <box> has no size"),
        (
            "urdf",
            LINK.format("<geometry><mesh filename='no.obj'/></geometry>"),
            r"its mesh file 'no.obj' was not found",
        ),
        ("urdf", LINK.format("<geometry><mesh scale='1 1 2'/></geometry>"), r"link l: has a mesh of which a part is"),
        (
            "urdf",
            HEAD + GRIP.replace("parent link='head'", "parent link='x'"),
            r"joint j: has parent link 'x',",
        ),
        ("urdf", HEAD + GRIP.partition("<joint")[0], r"has 2 links without a parent; exactly one base"),
        (
            "urdf",
            HEAD + GRIP + GRIP.replace("'grip'", "'b'", 1).replace("head", "b"),
            r"joint j: leads to a link",
        ),
        ("urdf", HEAD + GRIP.replace("'grip'", "'head'"), r"link head: is the name of two links"),
        ("urdf", HEAD.replace("0.3", "-0.3"), r"link head: has a mass of -0.3 kg; 0 or more is needed"),
        ("sdf", SDF.replace("'grip'", "'head'"), r"link head: is the name of two links"),
        ("sdf", SDF.replace("<pose>0 0 0.1", "<pose frame='b'>0 0 0.1"), r"link head: has a pose relative to b"),
        ("sdf", SDF.replace("fixed", "revolute"), r"joint j: is revolute; an object is one rigid body"),
        ("sdf", SDF + "<model name='b'/>", r"is not of one model without others in it; such an SDF file is needed"),
        ("sdf", SDF.replace("0.1 0.02 0.04", "0.1 x"), r"link head: <size> is '0.1 x'; 3 finite numbers are"),
        ("sdf", SDF.replace("<pose>0 0 0.1", "<pose relative_to='b'>0 0 0.1"), r"link head: has a pose relative to b"),
        ("sdf", SDF.replace("0.01</radius>", "-1</radius>"), r"size"),
    ],
)
def test_what_is_refused(tmp_path: Path, kind: str, inside: str, match: str) -> None:
    path = urdf(tmp_path, inside) if kind == "urdf" else sdf(tmp_path, inside)
    with pytest.raises(InputError, match=rf"thing.{kind}: .*{match}") as caught:
        load_body(path)
    assert "\n" not in str(caught.value)


def test_files_and_folders_that_are_no_objects(tmp_path: Path) -> None:
    (tmp_path / "a.sdf").write_text("<world/>")
    with pytest.raises(
        InputError, match=r"a.sdf: has root element <world>; an object is a <robot> \(URDF\) or an <sdf>"
    ):
        load_body(tmp_path / "a.sdf")
    with pytest.raises(InputError, match=r"a.sdf: scale: is 0; metres per unit of the mesh are needed, more than 0"):
        load_body(tmp_path / "a.sdf", scale=0)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"empty: is a folder without meshes; files of convex pieces are needed"):
        load_body(tmp_path / "empty")
