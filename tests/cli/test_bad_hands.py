"""Hands that no honest program writes: one line says what is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from handfast import load_hand
from handfast.core.errors import InputError
from handfast.model.hand import Coupling


def written(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
URDF = """<robot name="two"><link name="palm"/><link name="one"/><link name="two"><collision><geometry>
  <mesh filename="a.obj"/></geometry></collision></link>
  <joint name="a" type="revolute"><parent link="palm"/><child link="one"/><origin xyz="0 0 0.1"/>
    <axis xyz="0 1 0"/><limit lower="-0.2" upper="1.5"/></joint>
  <joint name="b" type="revolute"><parent link="one"/><child link="two"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="1.6"/><mimic joint="a" multiplier="1"/></joint></robot>"""

HANDS = [
    ('<robot name="two">', '<?xml version="1.0" encoding="klingon"?><robot name="two">', "has an encoding that cannot"),
    ('<robot name="two">', '<?xml version="1.0" encoding="utf-16"?><robot name="two">', "is not XML|has an encoding"),
    ('joint="a" mult', 'joint="b" mult', "b: follows itself"),
    ('upper="1.5"/>', 'upper="1.5"/><mimic joint="b"/>', "a: follows itself"),
    ('<axis xyz="0 1 0"/><limit', '<axis xyz="0 1e308 0"/><limit', r"[ab]\.axis: has length 1e\+308"),
    ('<axis xyz="0 1 0"/><limit', '<axis xyz="1e308 1e308 1e308"/><limit', r"[ab]\.axis: has length 1\.73e"),
    ('xyz="0 0 0.1"', 'xyz="0 0 1e999"', "3 finite numbers"),
    ('upper="1.5"', 'upper="inf"', "a finite number is needed"),
    ('multiplier="1"', 'multiplier="nan"', "a finite number is needed"),
    ('filename="a.obj"', 'filename="a.obj" scale="1e-14 1e-14 1e-14"', "smaller than 1e-09 m"),
    ('filename="a.obj"', 'filename="a.obj" scale="1 1 0"', "is flat"),
    ('filename="a.obj"', 'filename="a.obj" scale="1e300 1 1"', r"has a vertex at 1e\+300 m"),
]


@pytest.mark.parametrize("old, new, fault", HANDS)
def test_urdf_that_describes_no_hand(tmp_path: Path, old: str, new: str, fault: str) -> None:
    written(tmp_path / "a.obj", TETRAHEDRON)
    assert load_hand(written(tmp_path / "good.urdf", URDF)).l == 2
    text = URDF.replace(old, new)
    assert text != URDF
    path = written(tmp_path / "bad.urdf", text)
    with pytest.raises(InputError, match=fault) as raised:
        load_hand(path)
    assert str(raised.value).startswith(str(path))
    assert "\n" not in str(raised.value)


MJCF = """<mujoco model="m"><asset><mesh name="t" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset><worldbody>
  <body name="palm">
  <body name="p" pos="0.1 0 0"><joint name="a" axis="0 1 0" range="0 1"/><geom type="mesh" mesh="t"/>
  <body name="d"><joint name="b" axis="0 1 0" range="0 1"/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body></body>
  </body></worldbody><equality><joint joint1="b" joint2="a" polycoef="0 1 0 0 0"/></equality></mujoco>"""

MJCF_HANDS = [
    ('axis="0 1 0" range="0 1"/><geom type="mesh"', 'axis="0 1e308 0" range="0 1"/><geom type="mesh"', "axis"),
    ('pos="0.1 0 0"', 'pos="inf 0 0"', "p.pose: contains NaN or infinity"),
    ('pos="0.1 0 0"', 'pos="0.1 0 0" quat="1 1.7e308 0 0"', "quaternion: is .*; a unit quaternion"),
    ('pos="0.1 0 0"', 'pos="nan 0 0"', "p.pose: contains NaN or infinity"),
    ("0 0 1 0 0 0 1 0 0 0 1", "0 0 1 0 0 0 1 0 1 1 0", "volume|flat|coplanar"),
    ('size="0.1 0.1 0.1"', 'size="0.1 0.1 1e200"', "sizes are|inertia"),
    ('size="0.1 0.1 0.1"', 'size="0.1 0.1 1e-14"', "sizes are|inertia"),
    ('<body name="palm">', '<body name="palm"><geom type="box" size="0.1 0.1 1e308"/>', "sizes are"),
    ('joint1="b" joint2="a"', 'joint1="b" joint2="b"', "repeated|follows"),
    ("</equality>", '<joint joint1="a" joint2="b" polycoef="0 1 0 0 0"/></equality>', "follows itself"),
    ("</equality>", '<joint joint1="b" polycoef="0 1 0 0 0"/></equality>', "tied to two joints"),
    ('polycoef="0 1 ', 'polycoef="0 inf ', "NaN or infinity"),
    ('polycoef="0 1 ', 'polycoef="1e308 1e308 ', "ratio 1e"),
    ('<mujoco model="m">', '<?xml version="1.0" encoding="klingon"?><mujoco model="m">', "has an encoding"),
]


@pytest.mark.parametrize("old, new, fault", MJCF_HANDS)
def test_mjcf_that_describes_no_hand(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], old: str, new: str, fault: str
) -> None:
    monkeypatch.chdir(tmp_path)  # where mujoco would keep a log
    assert load_hand(written(tmp_path / "good.xml", MJCF)).l == 2
    assert old in MJCF
    path = written(tmp_path / "bad.xml", MJCF.replace(old, new, 1))
    with pytest.raises(InputError, match=fault) as raised:
        load_hand(path)
    assert "\n" not in str(raised.value)
    assert capfd.readouterr().err == ""
    assert not list(tmp_path.glob("*.TXT"))


def test_names_that_are_not_utf8(tmp_path: Path) -> None:
    text = '<?xml version="1.0" encoding="latin-1"?>' + MJCF.replace('name="a"', 'name="ä"').replace('"a"', '"ä"')
    path = written(tmp_path / "bad.xml", text.encode("latin-1"))
    with pytest.raises(InputError, match="UTF-8"):
        load_hand(path)


def test_couplings_that_lead_nowhere() -> None:
    hand = load_hand("schunk-sah")
    first = hand.couplings[2]
    for coupling, fault in [
        (Coupling(first.driver, first.joint, 1.0), "follows itself"),
        (Coupling(first.joint, 0, 1.0), "index_distal: is tied to two joints at once"),
        (Coupling(0, 0, 1.0), "follows itself"),
        (Coupling(0, 1, np.inf), "at most 1e"),
        (Coupling(0, 1, 1.0, np.nan), "at most 1e"),
    ]:
        with pytest.raises(InputError, match=fault):
            replace(hand, couplings=(*hand.couplings, coupling))
