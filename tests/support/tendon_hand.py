"""A hand written for tests, as the Shadow's fingers are: each has one tendon over its two outer joints.

Two fingers of three joints face each other across y. The tendon turns `middle` and `distal` together and leaves their
difference free; friction of the joints and the stop of `distal` at 0, where a finger is straight, hold it.
"""

from __future__ import annotations

import math
from pathlib import Path

import mujoco

from handfast.model.hand.hand import Hand
from handfast.readers.load_hand import load_hand

FRICTION = 0.01  # [N m] of every joint
FINGER = """
    <body name="{name}_proximal" pos="0 {y} 0.02" euler="0 0 {turn}">
      <joint name="{name}_proximal" range="-0.3 1.4"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.04" size="0.006"/>
      <body name="{name}_middle" pos="0 0 0.04">
        <joint name="{name}_middle" range="0 1.5"/>
        <geom type="capsule" fromto="0 0 0 0 0 0.03" size="0.006"/>
        <body name="{name}_distal" pos="0 0 0.03">
          <joint name="{name}_distal" range="0 1.5"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.02" size="0.006"/>
        </body>
      </body>
    </body>"""
TENDON = """
    <fixed name="{name}_both"><joint joint="{name}_middle" coef="1"/><joint joint="{name}_distal" coef="1"/></fixed>"""
MOTORS = """
    <position name="{name}_base" joint="{name}_proximal" kp="1"/>
    <position name="{name}_pull" tendon="{name}_both" kp="1"/>"""
FINGERS = {"left": (-0.03, 0.0), "right": (0.03, math.pi)}


def tendon_mjcf(friction: float = FRICTION, more: str = "") -> str:
    """The model; `more` stands beside the fixed tendons."""
    bodies = "".join(FINGER.format(name=n, y=y, turn=turn) for n, (y, turn) in FINGERS.items())
    tendons, motors = ("".join(text.format(name=n) for n in FINGERS) for text in (TENDON, MOTORS))
    return f"""<mujoco model="tendon-hand"><compiler angle="radian"/>
  <default>
    <joint type="hinge" axis="-1 0 0" frictionloss="{friction}" damping="0.1" armature="0.001"/>
  </default>
  <worldbody><body name="palm"><geom type="box" size="0.02 0.04 0.01"/>{bodies}
  </body></worldbody>
  <tendon>{tendons}{more}</tendon><actuator>{motors}</actuator></mujoco>"""


def tendon_hand(friction: float = FRICTION, more: str = "") -> Hand:
    """The hand, from memory."""
    return load_hand(mujoco.MjModel.from_xml_string(tendon_mjcf(friction, more))).with_closing(
        {f"{n}_{part}": 1 for n in FINGERS for part in ("proximal", "middle", "distal")}
    )


def write_tendon_hand(folder: Path, friction: float = FRICTION) -> Path:
    """The same as a file."""
    path = folder / "tendon-hand.xml"
    path.write_text(tendon_mjcf(friction))
    return path
