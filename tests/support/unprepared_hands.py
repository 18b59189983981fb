"""Small hands as a stranger would bring them, written as MJCF: a wrist, jaws of either sense, links that overlap."""

from __future__ import annotations

from pathlib import Path

FINGER = """
    <body name="{name}_base" pos="{x} 0.01 0.09">
     <joint name="{name}_side" axis="0 1 0" range="-20 20"/>
     <geom type="sphere" size="0.008"/>
     <body name="{name}_middle" pos="0 0 0.005">
      <joint name="{name}_bend" axis="-1 0 0" range="-10 90"/>
      <geom type="capsule" size="0.008" fromto="0 0 0 0 0 0.03"/>
      <body name="{name}_tip" pos="0 0 0.035">
       <joint name="{name}_curl" axis="-1 0 0" range="0 90"/>
       <geom type="capsule" size="0.008" fromto="0 0 0 0 0 0.02"/>
      </body>
     </body>
    </body>"""

THUMB = """
    <body name="thumb_base" pos="0 0.015 0.02" euler="-60 0 0">
     <joint name="thumb_bend" axis="1 0 0" range="0 70"/>
     <geom type="capsule" size="0.008" fromto="0 0 0 0 0 0.035"/>
     <body name="thumb_tip" pos="0 0 0.045">
      <joint name="thumb_curl" axis="1 0 0" range="0 70"/>
      <geom type="capsule" size="0.008" fromto="0 0 0 0 0 0.025"/>
     </body>
    </body>"""

JAW = """
    <body name="{name}" pos="{x} 0 0.05">
     <joint name="{name}_slide" type="slide" axis="{sign} 0 0" range="{range}"/>
     <geom type="box" size="0.004 0.012 0.03" pos="0 0 0.03"/>
    </body>"""


def _motors(names: list[str]) -> str:
    return "".join(f'<motor name="{n}" joint="{n}"/>' for n in names)


def wristed(folder: Path) -> Path:
    """A forearm, a wrist of two joints, two fingers of three joints and a thumb; the palm faces +y."""
    fingers = "".join(FINGER.format(name=n, x=x) for n, x in (("index", -0.02), ("ring", 0.02)))
    names = ["wrist_turn", "wrist_bend"]
    names += [f"{f}_{j}" for f in ("index", "ring") for j in ("side", "bend", "curl")] + ["thumb_bend", "thumb_curl"]
    return _written(
        folder / "wristed.xml",
        f"""<body name="forearm"><geom type="cylinder" size="0.03 0.1" pos="0 0 -0.12"/>
   <body name="wrist"><joint name="wrist_turn" axis="0 1 0" range="-30 10"/><geom type="sphere" size="0.01"/>
   <body name="palm" pos="0 0 0.01"><joint name="wrist_bend" axis="1 0 0" range="-40 20"/>
    <geom type="box" size="0.035 0.01 0.045" pos="0 0 0.045"/>{fingers}{THUMB}
   </body></body></body>""",
        _motors(names),
    )


def jaws(folder: Path, *, grows: bool) -> Path:
    """Two jaws on slides that are open at 0 and grow as they close, or the other way round."""
    inwards = [(-0.04, "right", 1), (0.04, "left", -1)] if grows else [(0.0, "right", -1), (0.0, "left", 1)]
    bodies = "".join(JAW.format(name=n, x=x, sign=s, range="0 0.038") for x, n, s in inwards)
    tied = '<equality><joint joint1="left_slide" joint2="right_slide"/></equality>'
    return _written(
        folder / f"jaws_{'grow' if grows else 'fall'}.xml",
        f'<body name="base"><geom type="box" size="0.05 0.03 0.02" pos="0 0 0.01"/>{bodies}</body>',
        _motors(["right_slide"]),
        tied,
    )


def overlapping(folder: Path) -> Path:
    """The jaws that grow, with racks that are 4 mm in each other until the jaws are nearly closed."""
    text = jaws(folder, grows=True).read_text("utf-8")
    for name, x, y in (("right", 0.04, 0.002), ("left", -0.04, -0.002)):
        rack = f'<geom type="box" size="0.03 0.004 0.004" pos="{x} {y} -0.01"/>'
        start = text.index("<geom", text.index(f'<body name="{name}"'))
        text = text[:start] + rack + text[start:]
    path = folder / "overlapping.xml"
    path.write_text(text, encoding="utf-8")
    return path


def _written(path: Path, bodies: str, motors: str, more: str = "") -> Path:
    text = f"""<mujoco model="{path.stem}"><compiler angle="degree"/>
 <worldbody>{bodies}</worldbody>
 {more}<actuator>{motors}</actuator>
</mujoco>
"""
    path.write_text(text, encoding="utf-8")
    return path


SIDE = """
    <body name="{n}_crank" pos="{x} 0 .03"><joint name="{n}_crank" axis="0 {s} 0" range="0 50"/>
     <geom type="capsule" size=".003" fromto="0 .006 0 {out} .006 .04"/>
     <body name="{n}_coupler" pos="{out} 0 .04"><joint name="{n}_coupler" axis="0 {s} 0" range="-90 0"/>
      <geom type="capsule" size=".002" fromto="0 .006 0 0 .006 .01"/></body></body>
    <body name="{n}_rod" pos="{x} 0 .015"><joint name="{n}_rod" axis="0 {s} 0" range="-15 50"/>
     <geom type="capsule" size=".003" fromto="0 -.006 0 {out} -.006 .04"/>
     <body name="{n}_jaw" pos="{out} 0 .04"><joint name="{n}_jaw" axis="0 {s} 0" range="-50 50"/>
      <geom type="box" size=".004 .01 .03" pos="0 0 .06"/></body></body>"""


def adaptive(folder: Path) -> Path:
    """Two jaws of which each hangs on a rod and, by a coupler that no motor moves, on a crank.

    With the coupler where it rests, at the end of its range, crank and rod are parallel in the open gripper.
    """
    sides = "".join(SIDE.format(n=n, x=-0.02 * s, s=s, out=-0.03 * s) for n, s in (("left", 1), ("right", -1)))
    pins = "".join(f'<connect body1="{n}_jaw" body2="{n}_coupler" anchor="0 0 0.025"/>' for n in ("left", "right"))
    return _written(
        folder / "adaptive.xml",
        f'<body name="base"><geom type="box" size=".03 .02 .008"/>{sides}</body>',
        _motors(["left_crank"]),
        f'<equality>{pins}<joint joint1="right_crank" joint2="left_crank"/></equality>',
    )


def angled(folder: Path) -> Path:
    """Two jaws on slides whose brackets stand far out and whose pads, the smaller part, are at their ends."""
    text = jaws(folder, grows=False).read_text("utf-8")
    for name, side in (("right", -1), ("left", 1)):
        start = text.index("<geom", text.index(f'<body name="{name}"'))
        end = text.index("/>", start) + 2
        bracket = f'<geom type="box" size="0.01 0.012 0.02" pos="{0.02 * side} 0 0.02"/>'
        pad = f'<geom type="box" size="0.014 0.012 0.005" pos="{0.014 * side} 0 0.045"/>'
        text = text[:start] + bracket + pad + text[end:]
    path = folder / "angled.xml"
    path.write_text(text, encoding="utf-8")
    return path
