"""Hands to show: every kind of joint and of pair, written here; and one with as many joints as one likes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handfast.core.transforms import transform
from handfast.model.hand import Hand
from handfast.model.hand.hand import Coupling, Joint, Link, coupling_rows, guess_closing
from handfast.model.mechanism import Mechanism
from handfast.model.shape import Shape

MJCF = """<mujoco model="wristed"><compiler angle="radian"/><worldbody>
  <body name="arm"><geom type="box" size=".03 .03 .02"/>
    <body name="wrist" pos="0 0 .05" quat=".9 .1 0 .3">
      <joint name="lift" type="slide" axis="0 0 1" range="-.01 .02" ref=".005"/>
      <joint name="turn" type="hinge" axis="1 2 0" pos=".01 0 -.02" range="-.5 .5" ref=".2"/>
      <inertial pos="0 0 0" mass=".25" diaginertia="1e-3 1e-3 1e-3"/>
      <geom type="box" size=".04 .02 .01"/>
      <body name="left" pos=".03 0 .02"><joint name="l1" type="hinge" axis="0 -1 0" range="0 1.5"/>
        <geom type="box" pos="0 0 .025" size=".008 .008 .02" mass=".1"/>
        <body name="left_tip" pos="0 0 .05"><joint name="l2" type="hinge" axis="0 -1 0" range="-.1 1.4"/>
          <geom type="sphere" size=".01" pos="0 0 .02"/></body></body>
      <body name="right" pos="-.03 0 .02"><joint name="r1" type="hinge" axis="0 1 0" range="0 1.5"/>
        <geom type="box" pos="0 0 .025" size=".008 .008 .02" mass=".1"/>
        <body name="right_tip" pos="0 0 .05"><geom type="sphere" size=".01" pos="0 0 .02"/></body></body>
    </body>
    <body name="tower" pos="0 0 .05"><geom type="sphere" size=".02"/></body>
  </body></worldbody>
  <equality><joint joint1="l2" joint2="l1" polycoef=".1 .5 0 0 0"/></equality></mujoco>"""


def write_wristed(folder: Path) -> Path:
    """A wrist of a slide and a hinge with references, two fingers, a rigid coupling with an offset.

    The tower stands on the arm and inside the wrist, 10 mm and more whatever the joints do.
    """
    path = folder / "wristed.xml"
    path.write_text(MJCF)
    return path


def many_jointed(fingers: int = 6, each: int = 4) -> Hand:
    """Fingers of boxes around a palm, with joints about random axes through random points."""
    rng = np.random.default_rng(5)
    links = [Link("palm", -1, np.eye(4), (), (Shape("box", (0.08, 0.08, 0.02)),))]
    joints: list[Joint] = []
    for f in range(fingers):
        parent, angle = 0, 2 * np.pi * f / fingers
        at = np.array([0.05 * np.cos(angle), 0.05 * np.sin(angle), 0.02])
        for k in range(each):
            limits = (-0.1, 1.2) if k else (-0.3, 0.3)
            joints.append(
                Joint(f"j{f}{k}", "revolute", rng.normal(size=3), 0.01 * rng.normal(size=3), *limits, 0.1 * k)
            )
            shape = Shape("box", (0.01, 0.01, 0.03), transform([0, 0, 0.015]))
            links.append(Link(f"f{f}_{k}", parent, transform(at), (len(joints) - 1,), (shape,)))
            parent, at = len(links) - 1, np.array([0.0, 0.0, 0.035])
    l = len(joints)
    couplings = tuple(Coupling(each * (f + 1) - 1, each * (f + 1) - 2, 0.8, 0.05) for f in range(fingers))
    driven = [j for j in range(l) if j % each != each - 1]
    R = np.eye(l)[driven]
    names = tuple(joints[j].name for j in driven)
    mechanism = Mechanism(names, R, coupling_rows(couplings, l), (False,) * len(driven))
    closing = guess_closing(tuple(joints), couplings)
    return Hand("many", tuple(links), tuple(joints), mechanism, couplings, closing, breakaway=False)
