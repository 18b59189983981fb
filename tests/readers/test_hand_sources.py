"""What `load_hand` takes beside a path: models in memory, parts of robots, names of collections, Table 1."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.model.hand.structures import TABLE_1, table_1_hand
from handfast.readers.load_hand import bundled_hands, load_hand

GEOM = '<geom type="box" size=".01 .01 .01"/>'


def scene(rest: str = "", model: str = 'model="two"') -> str:
    """Two hands on arms and a free object."""

    def hand(side: str) -> str:
        finger = f'<body name="{side}_tip" pos=".03 0 0"><joint name="{side}_flex" range="0 1"/>{GEOM}</body>'
        palm = f'<body name="{side}_palm" pos="0 0 .2"><joint name="{side}_wrist" range="-1 1"/>{GEOM}{finger}</body>'
        return f'<body name="{side}_arm" pos="0 .1 0"><joint name="{side}_arm" range="-1 1"/>{GEOM}{palm}</body>'

    free = f'<body name="ball" pos="1 0 0"><freejoint name="ball"/>{GEOM}</body>'
    motors = "".join(f'<motor name="{s}_{j}" joint="{s}_{j}"/>' for s in ("l", "r") for j in ("arm", "flex"))
    return f"""<mujoco {model}><compiler angle="radian"/><worldbody>{hand("l")}{hand("r")}{free}</worldbody>
      <actuator>{motors}</actuator>{rest}</mujoco>"""


def test_a_part_of_a_robot_by_its_root(tmp_path: Path) -> None:
    path = tmp_path / "robots.xml"
    path.write_text(scene())
    for hand in (load_hand(path, root="r_palm"), load_hand(f"{path}#r_palm")):
        assert hand.link_names == ("r_palm", "r_tip")
        assert hand.joint_names == ("r_flex",)
        assert hand.mechanism.actuators == ("r_flex",)
        np.testing.assert_allclose(hand.link_poses(np.zeros(1))[1][:3, 3], [0.03, 0, 0])
        assert hand.source == f"{path}#r_palm"
        assert load_hand(hand.source).link_names == hand.link_names
    with pytest.raises(InputError, match=r"robots.xml: joint ball: is a free joint; .*\(root=LINK reads a part"):
        load_hand(path)
    with pytest.raises(InputError, match=r"robots.xml: root: unknown link 'palm'; known: world, l_arm, l_palm, "):
        load_hand(path, root="palm")
    with pytest.raises(InputError, match=r"asks for root 'r_palm', and root is 'l_palm'; one is needed"):
        load_hand(f"{path}#r_palm", root="l_palm")
    tied = '<equality><joint name="e" joint1="r_flex" joint2="r_arm"/></equality>'
    path.write_text(scene(tied))
    with pytest.raises(InputError, match=r"equality e: ties what is read to what is left out; choose another root"):
        load_hand(path, root="r_palm")
    path.write_text(scene(tied.replace('"r_flex"', '"l_flex"').replace('"r_arm"', '"l_arm"')))
    assert load_hand(path, root="r_palm").couplings == ()


def test_a_part_of_a_urdf(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"

    def joint(name: str, above: str, below: str, more: str = "") -> str:
        ends = f"<parent link='{above}'/><child link='{below}'/><origin xyz='0 0 1'/><limit lower='0' upper='1'/>"
        return f"<joint name='{name}' type='revolute'>{ends}{more}</joint>"

    links = "".join(f"<link name='{n}'/>" for n in ("base", "palm", "tip"))
    path.write_text(f"<robot name='r'>{links}{joint('arm', 'base', 'palm')}{joint('flex', 'palm', 'tip')}</robot>")
    hand = load_hand(path, root="palm")
    assert (hand.link_names, hand.joint_names, hand.mechanism.actuators) == (("palm", "tip"), ("flex",), ("flex",))
    np.testing.assert_allclose(hand.link_poses(np.zeros(1))[1][:3, 3], [0, 0, 1])
    (tmp_path / "arm.srdf").write_text("<robot><disable_collisions link1='base' link2='palm'/></robot>")
    assert load_hand(path, root="palm").non_colliding == frozenset()
    with pytest.raises(InputError, match=r"arm.urdf: root: unknown link 'hand'; known: base, palm, tip"):
        load_hand(path, root="hand")
    mimic = joint("flex", "palm", "tip", "<mimic joint='arm'/>")
    path.write_text(f"<robot name='r'>{links}{joint('arm', 'base', 'palm')}{mimic}</robot>")
    with pytest.raises(
        InputError, match=r"joint flex: mimics joint 'arm', which is not a moving joint of what is read"
    ):
        load_hand(path, root="palm")


def test_models_in_memory() -> None:
    text = scene().replace('<freejoint name="ball"/>', "")
    spec = mujoco.MjSpec.from_string(text)
    for source in (mujoco.MjModel.from_xml_string(text), spec):
        hand = load_hand(source)
        assert (hand.name, hand.source, hand.l) == ("two", "", 6)
        assert load_hand(source, root="l_arm").l == 2
    nameless = mujoco.MjModel.from_xml_string(scene(model=""))
    assert load_hand(nameless, root="l_arm").name == "hand"
    spec.worldbody.add_geom(size=[0, 0, 0])
    with pytest.raises(InputError, match=r"MjSpec: size 0 must be positive in geom"):
        load_hand(spec)
    with pytest.raises(InputError, match=r"source: is of type float; a path, a name, an mujoco.MjModel or"):
        load_hand(3.0)


def test_a_model_without_a_name_is_called_after_its_file(tmp_path: Path) -> None:
    path = tmp_path / "grasper.xml"
    path.write_text(scene(model=""))
    assert load_hand(path, root="l_arm").name == "grasper"


def test_the_hands_of_table_1_have_names() -> None:
    names = [n for n in bundled_hands() if n.startswith("table1:")]
    assert names == [f"table1:{n}" for n in TABLE_1]
    hand = load_hand("table1:robonaut")
    assert (hand.name, hand.source) == ("robonaut", "table1:robonaut")
    assert hand.joint_names == table_1_hand("robonaut").joint_names
    with pytest.raises(InputError, match=r"unknown hand 'table1:claw'; known: barrett-bh8-280, .*table1:sa, "):
        load_hand("table1:claw")
    with pytest.raises(InputError, match=r"table1:sa: is a bundled hand, which has no root or SRDF file to choose"):
        load_hand("table1:sa", root="palm")


# --- collections ------------------------------------------------------------------------------------

ONE = scene().replace('<freejoint name="ball"/>', "")


def put(folder: Path, kind: str = "xml", **files: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / f"{name}.{kind}").write_text(text)
    return folder


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Stand-ins for both packages, which would fetch what is not in their caches, and must not be let."""
    put(
        tmp_path / "packages" / "robot_descriptions",
        "py",
        __init__="",
        _cache="""
from types import SimpleNamespace
REPOSITORIES = {"claws": SimpleNamespace(cache_path="claws-repo")}
def clone_to_cache(name, commit=None):
    raise AssertionError("the network")
""",
        _descriptions="""
from types import SimpleNamespace as D
DESCRIPTIONS = {"claw_mj_description": D(tags={"end_effector"}), "dog_description": D(tags={"quadruped"}),
                "bare_description": D(tags={"end_effector"})}
""",
        claw_mj_description="""
from os import path
from ._cache import clone_to_cache
MJCF_PATH = path.join(clone_to_cache("claws", commit=None), "left.xml")
MJCF_PATH_RIGHT = path.join(clone_to_cache("claws", commit=None), "right.xml")
""",
        bare_description="XACRO_PATH = 'robot.xacro'",
    )
    put(
        tmp_path / "packages" / "mujoco_menagerie",
        "py",
        __init__=f"""
from pathlib import Path
from types import SimpleNamespace as D
def names(): return ["claw"]
def get(name): return D(name=name, default_model="left", entry=lambda e: D(file=e + ".xml"))
class Cache:
    def is_cached(self, robot): return self.model_path(robot).is_dir()
    def model_path(self, robot): return Path({str(tmp_path)!r}) / "cached" / robot.name
""",
    )
    monkeypatch.syspath_prepend(str(tmp_path / "packages"))
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path / "descriptions"))
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    before = set(sys.modules)
    yield tmp_path
    for name in set(sys.modules) - before:
        if name.startswith(("robot_descriptions", "mujoco_menagerie")):
            del sys.modules[name]


def test_robot_descriptions(packages: Path) -> None:
    missing = r"claw_mj_description: is not in the cache of robot_descriptions; run python -m robot_descriptions pull"
    with pytest.raises(InputError, match=missing):
        load_hand("claw_mj_description")
    put(packages / "descriptions" / "claws-repo", left=ONE, right=ONE.replace('"two"', '"right"'))
    assert load_hand("claw_mj_description").name == "two"
    assert load_hand("claw_mj_description:MJCF_PATH_RIGHT#r_palm").name == "right"
    with pytest.raises(InputError, match=r"unknown path 'MJCF_PATH_UP'; known: MJCF_PATH, MJCF_PATH_RIGHT"):
        load_hand("claw_mj_description:MJCF_PATH_UP")
    with pytest.raises(InputError, match=r"bare_description: gives neither a URDF nor an MJCF file"):
        load_hand("bare_description")
    with pytest.raises(InputError, match=r"unknown description 'cat_description'; known: bare_.*, claw_mj_description"):
        load_hand("cat_description")


def test_the_menagerie_in_its_packages_cache(packages: Path) -> None:
    with pytest.raises(InputError, match=r"menagerie:claw: is not in the cache of mujoco-menagerie; run python -c "):
        load_hand("menagerie:claw")
    put(packages / "cached" / "claw", left=ONE, right=ONE.replace('"two"', '"right"'))
    assert load_hand("menagerie:claw").name == "two"
    assert load_hand("menagerie:claw/right#r_palm").name == "right"
    with pytest.raises(InputError, match=r"menagerie:claw/up: unknown model 'up'; known: left, right"):
        load_hand("menagerie:claw/up")
    with pytest.raises(InputError, match=r"menagerie:dog: unknown robot 'dog'; known: claw"):
        load_hand("menagerie:dog")


def test_the_menagerie_in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))
    put(tmp_path / "claw", left=ONE, scene_left="<mujoco/>")
    assert load_hand("menagerie:claw").name == "two"
    put(tmp_path / "claw", right=ONE)
    with pytest.raises(InputError, match=r"has several models; say which: menagerie:claw/left, menagerie:claw/right"):
        load_hand("menagerie:claw")
    with pytest.raises(InputError, match=r"menagerie:dog: MENAGERIE_ROOT=.*: unknown robot 'dog'; known: claw"):
        load_hand("menagerie:dog")


def test_collections_that_are_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setattr("handfast.readers.named_models.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"menagerie:claw: needs the package mujoco-menagerie; pip install 'handfast"):
        load_hand("menagerie:claw")
    with pytest.raises(InputError, match=r"claw_description: needs the package robot_descriptions; pip install"):
        load_hand("claw_description")
