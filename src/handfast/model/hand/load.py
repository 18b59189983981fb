"""One door for hands: bundled names, URDF, MJCF and GraspIt! files."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from handfast.core.errors import InputError, unknown_name
from handfast.model.hand.graspit import read_graspit
from handfast.model.hand.hand import Hand
from handfast.model.hand.mjcf import read_mjcf
from handfast.model.hand.urdf import parse_xml, read_urdf

# What a description file cannot say: which joints close (each one not named here stays 0), and whether
# coupled joints have a breakaway clutch. Spreads and abductions do not close.
FINGERS = ("ring", "middle", "index", "thumb")
BUNDLED: dict[str, tuple[str, dict[str, int], bool]] = {
    "barrett-bh8-280": (
        "barrett-bh8-280.urdf",
        {f"finger_{k}_{part}": 1 for k in (1, 2, 3) for part in ("prox", "dist")},
        True,
    ),
    "schunk-sah": (
        "schunk-sah.urdf",
        {f"{f}_{part}": 1 for f in FINGERS for part in ("proximal", "middle", "distal")},
        False,
    ),
    "parallel-gripper": ("parallel-gripper.xml", {"left_slide": 1, "right_slide": 1}, False),
}


def bundled_hands() -> tuple[str, ...]:
    """Names that `load_hand` takes instead of a path."""
    return tuple(BUNDLED)


def load_hand(source: str | Path) -> Hand:
    """A hand from a URDF, MJCF or GraspIt! file, or a bundled one by name.

    Only collision shapes are read (URDF `collision`; MJCF geoms that can collide), and a mesh counts as
    its convex hull: split a non-convex link into several meshes to keep its hollows. A link without
    collision shapes keeps `shapes == ()`. Coupled joints (URDF `mimic`, MJCF joint equalities) become
    couplings. `Hand.closing` is guessed from the limits for a file and stated for a bundled hand.

    Raises:
        InputError: no such file or name (the bundled ones are listed), not a hand file, a missing mesh,
            a joint or transmission that is not understood. One line, naming the file.
    """
    if str(source) in BUNDLED:
        name = str(source)
        file, closing, breakaway = BUNDLED[name]
        hand = _read(Path(str(files("handfast") / "data" / "hands" / file)))
        hand = hand.with_closing(dict.fromkeys(hand.joint_names, 0) | closing)
        return replace(hand, name=name, breakaway=breakaway, source=name)
    path = Path(source)
    if not os.path.isfile(path):  # False, too, for what can be no name
        if path.suffix:
            raise InputError("no such file", source=str(path))
        raise unknown_name("hand", str(source), BUNDLED)
    return _read(path)


def _read(path: Path) -> Hand:
    root = parse_xml(path)
    try:
        if root.tag == "robot" and root.find("chain") is not None:  # a URDF file has none
            return read_graspit(root, path)
        if root.tag == "robot":
            return read_urdf(root, path)
        if root.tag == "mujoco":
            return read_mjcf(root, path)
    except InputError as fault:
        raise fault.at(str(path)) from None
    except UnicodeDecodeError:  # mujoco reads bytes, whatever encoding the file declares
        raise InputError("has names that are not in UTF-8", source=str(path)) from None
    raise InputError(f"has root element <{root.tag}>; <robot> or <mujoco> is needed", source=str(path))
