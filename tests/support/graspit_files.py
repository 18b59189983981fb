"""A small GraspIt! robot, its object and a world, written for tests: two fingers on a palm, one motor each."""

from __future__ import annotations

from pathlib import Path

CUBE = "#Inventor V2.1 ascii\nSeparator { Cube { width 20 height 40 depth 60 } }\n"
JOINT = (
    "<joint type='{kind}'><theta>{theta}</theta><d>{d}</d><a>{a}</a><alpha>{alpha}</alpha>"
    "<minValue>{low}</minValue><maxValue>{high}</maxValue></joint>"
)


def joint(theta: str, *, d: str = "0", a: float = 0, alpha: float = 0, low: float = 0, high: float = 90) -> str:
    """A joint, revolute unless it is `d` that names a DOF."""
    kind = "Prismatic" if d.startswith("d") else "Revolute"
    return JOINT.format(kind=kind, theta=theta, d=d, a=a, alpha=alpha, low=low, high=high)


def dof(kind: str = "r", velocity: float = 1) -> str:
    """A degree of freedom."""
    return f"<dof type='{kind}'><defaultVelocity>{velocity}</defaultVelocity></dof>"


def chain(*inside: str, at: str = "", links: tuple[str, ...] = ("Revolute",), rules: tuple[str, ...] = ()) -> str:
    """A chain with its joints and a link of each dynamic joint type; rules: attributes of the first links."""
    said = (*rules, *("" for _ in links[len(rules) :]))
    ends = "".join(
        f"<link dynamicJointType='{kind}' {rule}>link.xml</link>" for kind, rule in zip(links, said, strict=True)
    )
    return f"<chain><transform>{at}</transform>{''.join(inside)}{ends}</chain>"


def body(*inside: str) -> str:
    """A body whose mesh is box.iv."""
    return f"<root>{''.join(inside)}<geometryFile>box.iv</geometryFile></root>"


def write_robot(folder: Path, *parts: str, name: str = "robot.xml") -> Path:
    """A robot file and its bodies, all with one box of 20 x 40 x 60 mm."""
    (folder / "iv").mkdir(parents=True, exist_ok=True)
    (folder / "iv" / "box.iv").write_text(CUBE)
    (folder / "iv" / "palm.xml").write_text(body("<material>plastic</material>"))
    (folder / "iv" / "link.xml").write_text(body("<material>rubber</material>"))
    path = folder / name
    path.write_text(f"<robot type='Hand'><palm>palm.xml</palm>{''.join(parts)}</robot>")
    return path


def write_object(folder: Path, *inside: str, name: str = "block.xml") -> Path:
    """An object file with the same box."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "box.iv").write_text(CUBE)
    path = folder / name
    path.write_text(body(*inside))
    return path


def placed(tag: str, file: str, at: str = "(1 0 0 0)[0 0 0]", dofs: str = "") -> str:
    """A thing in a world."""
    values = f"<dofValues>{dofs}</dofValues>" if dofs else ""
    return (
        f"<{tag}><filename>{file}</filename>{values}<transform><fullTransform>{at}</fullTransform></transform></{tag}>"
    )


def write_world(folder: Path, *parts: str) -> Path:
    """A world file in its own folder beside `models`."""
    (folder / "worlds").mkdir(parents=True, exist_ok=True)
    path = folder / "worlds" / "world.xml"
    path.write_text(f"<world>{''.join(parts)}</world>")
    return path
