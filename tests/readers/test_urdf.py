"""What a URDF file may leave out, every kind of joint and solid, where meshes are looked for, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.hand import Hand
from handfast.readers.load_hand import load_hand
from handfast.readers.xml_file import read_robot_xml

TURN = 2 * np.pi


def joint(inside: str = "", *, name: str = "j", kind: str = "revolute", parent: str = "a", child: str = "b") -> str:
    ends = f"<parent link='{parent}'/><child link='{child}'/>"
    return f"<joint name='{name}' type='{kind}'>{ends}{inside}</joint>"


def written(folder: Path, *parts: str, name: str = " name='robot'") -> Path:
    path = folder / "file.urdf"
    path.write_text(f"<robot{name}>{''.join(parts)}</robot>")
    return path


def hand(folder: Path, *parts: str, links: str = "ab", **options: str) -> Hand:
    return load_hand(written(folder, *(f"<link name='{n}'/>" for n in links), *parts, **options))


LIMIT = "<limit lower='-0.5' upper='1.5'/>"


@pytest.mark.parametrize(
    ("kind", "inside", "moves", "limits"),
    [
        ("revolute", LIMIT, "revolute", (-0.5, 1.5)),
        ("prismatic", LIMIT, "prismatic", (-0.5, 1.5)),
        ("revolute", "<limit upper='1.5'/>", "revolute", (0, 1.5)),
        ("prismatic", "<limit lower='-2'/>", "prismatic", (-2, 0)),
        ("continuous", "", "revolute", (-TURN, TURN)),
        ("continuous", LIMIT, "revolute", (-TURN, TURN)),
    ],
)
def test_joints(tmp_path: Path, kind: str, inside: str, moves: str, limits: tuple[float, float]) -> None:
    read = hand(tmp_path, joint("<axis xyz='0 0 -2'/>" + inside, kind=kind))
    (only,) = read.joints
    assert (only.name, only.type, (only.lower, only.upper), only.ref) == ("j", moves, limits, 0.0)
    np.testing.assert_array_equal(only.axis, [0, 0, -1])
    np.testing.assert_array_equal(only.anchor, np.zeros(3))
    assert read.mechanism.tendon == (False,)
    assert read.mechanism.actuators == ("j",)
    np.testing.assert_array_equal(read.mechanism.R, [[1.0]])
    assert [link.parent for link in read.links] == [-1, 0]
    np.testing.assert_array_equal([link.pose for link in read.links], [np.eye(4)] * 2)


def test_what_is_left_out_has_the_values_of_the_format(tmp_path: Path) -> None:
    """The axis is x, the origin that of the parent, a mimic the same value."""
    tied = joint("<mimic joint='j'/>" + LIMIT, name="k", parent="b", child="c")
    moved = "<origin xyz='1 2 3'/>", f"<origin rpy='0 0 {np.pi / 2}'/>"
    read = hand(tmp_path, joint(moved[0] + LIMIT), tied.replace("<mimic", moved[1] + "<mimic"), links="abc")
    np.testing.assert_array_equal([j.axis for j in read.joints], [[1, 0, 0]] * 2)
    np.testing.assert_array_equal(read.links[1].pose, [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]])
    np.testing.assert_allclose(read.links[2].pose[:3, :3] @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_array_equal(read.links[2].pose[:3, 3], np.zeros(3))
    assert [(c.joint, c.driver, c.ratio, c.offset) for c in read.couplings] == [(1, 0, 1.0, 0.0)]


def test_a_hand_is_named_in_the_file_or_after_it(tmp_path: Path) -> None:
    assert hand(tmp_path, joint(LIMIT)).name == "robot"
    assert hand(tmp_path, joint(LIMIT), name="").name == "file"


def solid(geometry: str, name: str = "", origin: str = "<origin xyz='0.1 0.2 0.3'/>") -> str:
    return f"<collision{name}>{origin}<geometry>{geometry}</geometry></collision>"


def test_solids_stand_where_they_are_put_and_have_names(tmp_path: Path) -> None:
    (tmp_path / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    solids = [
        solid("<box size='1 2 3'/>"),
        solid("<sphere radius='0.5'/>"),
        solid("<cylinder radius='0.5' length='2'/>"),
        solid("<capsule radius='0.5' length='2'/>"),
        solid("<mesh filename='t.obj'/>"),
        solid("<box size='1 2 3'/>", " name='named'", ""),
    ]
    (only,) = load_hand(written(tmp_path, f"<link name='a'>{''.join(solids)}</link>")).links
    assert [s.kind for s in only.shapes] == ["box", "sphere", "cylinder", "capsule", "mesh", "box"]
    assert [tuple(s.size) for s in only.shapes[:4]] == [(1, 2, 3), (0.5,), (0.5, 2), (0.5, 2)]
    assert [s.name for s in only.shapes] == ["a/0", "a/1", "a/2", "a/3", "a/4", "named"]
    np.testing.assert_array_equal([s.pose[:3, 3] for s in only.shapes[:4]], [[0.1, 0.2, 0.3]] * 4)
    np.testing.assert_array_equal(only.shapes[5].pose, np.eye(4))
    assert only.shapes[4].triangles()[0].max() == pytest.approx(1.3)  # not scaled


@pytest.mark.parametrize("place", ["pack/meshes", "other/pack/meshes", "other/meshes"])
@pytest.mark.parametrize("name", ["package://pack/meshes/t.obj", "file://t.obj", "../meshes/t.obj"])
def test_meshes_are_looked_for_in_packages_beside_and_by_path(tmp_path: Path, place: str, name: str) -> None:
    """A package is a folder of its name that holds the file's folder, or stands beside one that does."""
    folder = tmp_path / ("pack" if place == "pack/meshes" else "other") / "urdf"
    folder.mkdir(parents=True)
    where = folder if name.startswith("file") else tmp_path / place
    where.mkdir(parents=True, exist_ok=True)
    (where / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
    link = f"<link name='a'>{solid(f'<mesh filename={name!r}/>')}</link>"
    there = {
        "package": place.split("/")[-2] == "pack",
        "..": place in ("pack/meshes", "other/meshes"),
        "file": True,
    }[next(k for k in ("package", "file", "..") if name.startswith(k))]
    if there:
        assert load_hand(written(folder, link)).links[0].shapes[0].volume == pytest.approx(1 / 6)
    else:
        how = "searched upwards from" if name.startswith("package") else "searched in"
        with pytest.raises(InputError, match=rf"link a: its mesh file '{name}' was not found \({how} {folder}\)$"):
            load_hand(written(folder, link))


LINKS = "<link name='a'/><link name='b'/>"


@pytest.mark.parametrize(
    ("parts", "match"),
    [
        ("<link/>", "a <link> has no name$"),
        (LINKS + joint().replace(" name='j'", ""), "a <joint> has no name$"),
        (LINKS + joint(child="z"), "joint j: has child link 'z', which is not defined$"),
        (LINKS + joint(parent="z"), "joint j: has parent link 'z', which is not defined$"),
        (LINKS + "<joint name='j' type='fixed'><child link='b'/></joint>", "joint j: has parent link '', which is not"),
        (LINKS + "<joint name='j' type='fixed'><parent link='a'/><child/></joint>", "joint j: has child link '',"),
        (LINKS + joint(LIMIT) + joint(LIMIT, name="k"), "joint k: leads to a link that has a parent already$"),
        (LINKS, "has 2 links without a parent; exactly one base link is needed$"),
        (LINKS + joint(LIMIT) + joint(LIMIT, name="k", parent="b", child="a"), "has 0 links without a parent; exactly"),
        (
            "<link name='c'/>" + LINKS + joint(LIMIT) + joint(LIMIT, name="k", parent="b", child="a"),
            "has a loop of links; a tree is needed$",
        ),
        (LINKS + joint(LIMIT, kind=""), "joint j: has type ''; revolute, continuous, prismatic and fixed joints are"),
        (LINKS + joint(LIMIT).replace(" type='revolute'", ""), "joint j: has type ''; revolute, continuous,"),
        (LINKS + joint(), "joint j: has no <limit>; lower and upper are needed$"),
        (LINKS + joint("<limit lower='x'/>"), "joint j: <limit> lower is 'x'; a finite number is needed$"),
        (LINKS + joint("<axis/>" + LIMIT), "joint j: <axis> has no xyz$"),
        (LINKS + joint("<axis xyz='1 0'/>" + LIMIT), "joint j: <axis> xyz is '1 0'; 3 finite numbers are needed$"),
        (LINKS + joint("<axis xyz='1 0 inf'/>" + LIMIT), "joint j: <axis> xyz is '1 0 inf'; 3 finite numbers"),
        (LINKS + joint("<origin rpy='1'/>" + LIMIT), "joint j: <origin> rpy is '1'; 3 finite numbers are needed$"),
        (LINKS + joint("<origin xyz='1'/>" + LIMIT), "joint j: <origin> xyz is '1'; 3 finite numbers are needed$"),
        (LINKS + joint("<mimic/>" + LIMIT), "joint j: mimics joint '', which is not a moving joint of what is read$"),
        (
            "<link name='c'/>" + LINKS + joint(LIMIT)
            + joint("<mimic joint='j' multiplier='?'/>" + LIMIT, name="k", parent="b", child="c"),
            r"joint k: <mimic> multiplier is '\?'; a finite number is needed$",
        ),
        (
            "<link name='c'/>" + LINKS + joint(LIMIT)
            + joint("<mimic joint='j' offset='?'/>" + LIMIT, name="k", parent="b", child="c"),
            r"joint k: <mimic> offset is '\?'; a finite number is needed$",
        ),
        ("<link name='a'><collision/></link>", "link a: has a collision without geometry$"),
        (f"<link name='a'>{solid('<cone/>')}</link>", "link a: has a cone; box, sphere, cylinder,"),
        (f"<link name='a'>{solid('<box/>')}</link>", "link a: <box> has no size$"),
        (f"<link name='a'>{solid('<sphere/>')}</link>", "link a: <sphere> has no radius$"),
        (f"<link name='a'>{solid('<capsule/>')}</link>", "link a: <capsule> has no radius$"),
        (f"<link name='a'>{solid('<mesh/>')}</link>", r"link a: its mesh file '' was not found \(searched in"),
        (
            "<link name='a'>" + solid("<mesh scale='1'/>") + "</link>",
            "link a: <mesh> scale is '1'; 3 finite numbers are needed$",
        ),
    ],
)  # fmt: skip
def test_refusals_name_the_joint_or_the_link(tmp_path: Path, parts: str, match: str) -> None:
    with pytest.raises(InputError, match=rf"file.urdf: {match}") as caught:
        load_hand(written(tmp_path, parts))
    assert "\n" not in str(caught.value)


def test_what_cannot_be_opened_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"^{tmp_path}: cannot be read \(Is a directory\)$"):
        read_robot_xml(tmp_path)


def test_efforts_are_the_strengths_of_motors(tmp_path: Path) -> None:
    """A joint that follows another has no motor; what is 0, or no number, states nothing."""
    one, none, bad = (LIMIT.replace("/>", f" effort='{e}'/>") for e in ("2.5", "0", "much"))
    mimic = "<mimic joint='p'/>"
    found = hand(
        tmp_path,
        joint(one, name="p"),
        joint(none, name="q", parent="b", child="c"),
        joint(bad, name="r", parent="c", child="d"),
        joint(one + mimic, name="s", parent="d", child="e"),
        links="abcde",
    )
    assert found.strengths == {"p": 2.5}
    assert found.mechanism.actuators == ("p", "q", "r")
