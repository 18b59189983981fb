"""Pairs of links that a file says are not checked against each other: MJCF masks and excludes, SRDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.geometry.scene import Scene
from handfast.model.hand import Hand
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

FAR = np.array([[1.0, 0, 0, 9], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def write(folder: Path, masks: str = "1 1 1 1 1 1", rest: str = "") -> Path:
    """Three fingers a, b and c whose tips overlap each other; contype and conaffinity of each."""
    bits = masks.split()
    fingers = "".join(
        f'<body name="{n}" pos="0 0 {0.01 * k}"><joint name="j{n}" axis="0 0 1" range="-1 1"/>'
        f'<geom type="sphere" size=".03" contype="{bits[2 * k]}" conaffinity="{bits[2 * k + 1]}"/></body>'
        for k, n in enumerate("abc")
    )
    path = folder / "hand.xml"
    palm = '<geom type="box" size=".01 .01 .01" pos="0 0 -.5"/>'
    path.write_text(f"""<mujoco model="m"><compiler angle="radian"/><worldbody><body name="palm">{palm}
      {fingers}</body></worldbody>{rest}</mujoco>""")
    return path


def overlaps(hand: Hand) -> set[str]:
    """The pairs that a scene finds inside each other."""
    scene = Scene(hand, load_body("can"))
    _, between = scene.clearances(np.zeros(hand.l), FAR)
    return {
        hand.link_names[i] + hand.link_names[j] for (i, j), d in zip(scene.self_pairs, between, strict=True) if d < 0
    }


@pytest.mark.parametrize(
    ("masks", "found"),
    [
        ("1 1 1 1 1 1", {"ab", "ac", "bc"}),
        ("1 0 1 1 1 0", {"ab", "bc"}),  # a and c: neither's type is among the other's affinities
        ("1 2 2 4 4 1", {"ab", "ac", "bc"}),  # one way is enough
        ("1 2 2 1 4 4", {"ab"}),
        ("0 0 1 1 1 1", {"bc"}),  # a is for the eye
        ("1 0 1 0 1 0", {"ab", "ac", "bc"}),  # checks turned off for all that moves say nothing about any pair
    ],
)
def test_masks(tmp_path: Path, masks: str, found: set[str]) -> None:
    assert overlaps(load_hand(write(tmp_path, masks))) == found


def test_excludes(tmp_path: Path) -> None:
    hand = load_hand(write(tmp_path, rest='<contact><exclude body1="c" body2="a"/></contact>'))
    assert {frozenset(pair) for pair in hand.non_colliding} == {frozenset("ac")}
    assert overlaps(hand) == {"ab", "bc"}
    assert overlaps(hand.with_closing({"ja": 1})) == {"ab", "bc"}
    assert not hand.may_collide("a", "c")
    assert hand.may_collide("a", "b")


def test_contacts_that_are_listed_count_whatever_else_is_said(tmp_path: Path) -> None:
    both = '<contact><exclude body1="a" body2="b"/><pair geom1="ga" geom2="gb"/></contact>'
    path = write(tmp_path, "1 0 1 0 1 0", both)
    text = path.read_text()
    for name in "ab":
        joint = f'<joint name="j{name}" axis="0 0 1" range="-1 1"/><geom'
        text = text.replace(joint, f'{joint} name="g{name}"')
    path.write_text(text)
    assert overlaps(load_hand(path)) == {"ab"}


def robot(folder: Path) -> Path:
    ball = "<collision><geometry><sphere radius='0.03'/></geometry></collision>"
    links = "".join(f"<link name='{n}'>{ball if n != 'palm' else ''}</link>" for n in ("palm", "a", "b", "c"))
    joints = "".join(
        f"<joint name='j{n}' type='revolute'><parent link='palm'/><child link='{n}'/><axis xyz='0 0 1'/>"
        "<limit lower='-1' upper='1'/></joint>"
        for n in "abc"
    )
    path = folder / "hand.urdf"
    path.write_text(f"<robot name='r'>{links}{joints}</robot>")
    return path


SRDF = "<robot name='r'><group name='g'/>{}</robot>"
PAIR = "<disable_collisions link1='a' link2='{}' reason='Never'/>"


def test_an_srdf_file_beside_the_urdf_or_by_name(tmp_path: Path) -> None:
    path = robot(tmp_path)
    assert overlaps(load_hand(path)) == {"ab", "ac", "bc"}
    other = tmp_path / "other.srdf"
    other.write_text(SRDF.format(PAIR.format("c")))
    assert overlaps(load_hand(path, srdf=other)) == {"ab", "bc"}
    (tmp_path / "hand.srdf").write_text(SRDF.format(PAIR.format("b")))
    assert overlaps(load_hand(path)) == {"ac", "bc"}
    assert overlaps(load_hand(path, srdf=other)) == {"ab", "bc"}  # the one that is named counts


@pytest.mark.parametrize(
    ("text", "match"),
    [
        (
            SRDF.format("<disable_collisions link1='a'/>"),
            r"disable_collisions\[0\]: has no link2; two links are needed",
        ),
        (SRDF.format(PAIR.format("a")), r"disable_collisions\[0\]: names a twice; two links are needed"),
        (SRDF.format(PAIR.format("b") + PAIR.format("z")), r"disable_collisions\[1\]: names link 'z', which the hand"),
        ("<mujoco/>", r"has root element <mujoco>; an SRDF file has <robot>"),
        ("<robot>", r"is not XML"),
    ],
)
def test_srdf_files_that_are_refused(tmp_path: Path, text: str, match: str) -> None:
    path = robot(tmp_path)
    (tmp_path / "hand.srdf").write_text(text)
    with pytest.raises(InputError, match=r"hand.srdf: " + match):
        load_hand(path)


def test_a_pair_of_strangers_is_refused(tmp_path: Path) -> None:
    from dataclasses import replace

    with pytest.raises(InputError, match=r"non_colliding: unknown link 'z'; known: palm, a, b, c"):
        replace(load_hand(robot(tmp_path)), non_colliding=frozenset({("a", "z")}))
