"""Two jaws on slides with springs, friction and stops in their file, around a cube: forces known by hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from handfast.geometry.contacts import contact_grasp
from handfast.model.grasp import Grasp
from handfast.readers.configuration_file import load_configuration
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

JAWS = """<mujoco model="jaws"><worldbody><body name="palm"><geom type="box" size=".05 .05 .005" pos="0 0 -.1"/>
<body name="left" pos="-.03 0 0">
 <joint name="left" type="slide" axis="1 0 0" range="-.02 .05" frictionloss=".3" stiffness="50" springref=".03"/>
 <geom type="box" size=".005 .01 .01" pos="-.005 0 0"/></body>
<body name="right" pos=".03 0 0">
 <joint name="right" type="slide" axis="1 0 0" range="-.05 .02" frictionloss=".4" stiffness="40" springref="-.05"/>
 <geom type="box" size=".005 .01 .01" pos=".005 0 0"/></body></body></worldbody>{more}
<actuator><motor name="pull_left" joint="left"/><motor name="pull_right" joint="right"/></actuator></mujoco>"""
CUBE = """<robot name="cube"><link name="cube"><collision><geometry><box size=".02 .02 .02"/></geometry></collision>
</link></robot>"""


def sprung_jaws(folder: Path, more: str = "", left: str = "left", **made: Any) -> Grasp:
    """Both jaws 20 mm in, friction 0.5, 2 N on each: springs of 50 N/m and 40 N/m press with 0.5 N and 1.2 N besides.

    Args:
        folder: for the files.
        more: elements of the hand's file.
        left: name of the left jaw and its joint.
        made: arguments of `contact_grasp`.
    """
    (folder / "jaws.xml").write_text(JAWS.format(more=more).replace("left", left))
    (folder / "cube.urdf").write_text(CUBE)
    placed = {
        "schema": "handfast/configuration/1",
        "joints": {left: 0.02, "right": -0.02},
        "closing": {left: 1, "right": -1},
    }
    (folder / "placed.json").write_text(json.dumps(placed))
    configuration = load_configuration(folder / "placed.json")
    hand, q = configuration.applied(load_hand(str(folder / "jaws.xml")))
    preload = {f"pull_{left}": 2.0, "pull_right": 2.0}
    grasp = contact_grasp(hand, q, load_body(str(folder / "cube.urdf")), np.eye(4), preload=preload, **made)
    assert grasp.provenance is not None
    return grasp.about(provenance=grasp.provenance.with_configuration(folder / "placed.json"))
