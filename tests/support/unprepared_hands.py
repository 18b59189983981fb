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
