"""One door for hands: bundled names, URDF, MJCF and GraspIt! files, collections of robots, mujoco models in memory."""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from handfast.core import bundled
from handfast.core.errors import InputError, nearest
from handfast.model.hand.anatomy import with_guessed_senses
from handfast.model.hand.hand import Hand
from handfast.model.hand.structures import TABLE_1, table_1_hand
from handfast.readers import registry
from handfast.readers.mjcf import hand_of_model, hand_of_spec
from handfast.readers.named_models import EXTRA, collected
from handfast.readers.urdf import read_srdf
from handfast.readers.xml_file import read_robot_xml

# What a description file cannot say: which joints close (each one not named here stays 0), and whether
# coupled joints have a breakaway clutch. Spreads and abductions do not close.
FOUR_FINGERS = ("ring", "middle", "index", "thumb")
BUNDLED: dict[str, tuple[str, dict[str, int], bool]] = {
    "barrett-bh8-280": (
        "barrett-bh8-280.urdf",
        {f"finger_{k}_{part}": 1 for k in (1, 2, 3) for part in ("prox", "dist")},
        True,
    ),
    "schunk-sah": (
        "schunk-sah.urdf",
        {f"{f}_{part}": 1 for f in FOUR_FINGERS for part in ("proximal", "middle", "distal")},
        False,
    ),
    "parallel-gripper": ("parallel-gripper.xml", {"left_slide": 1, "right_slide": 1}, False),
    "tendon-hand": ("tendon-hand.xml", {f"{f}_{k}": 1 for f in ("thumb", "left", "right") for k in (1, 2)}, False),
    "milling-fixture": ("milling-fixture.xml", dict.fromkeys(("strap_1", "strap_2", "screw"), 1), False),
    "step-ground": ("step-ground.xml", {}, False),
}


TABLE_1_PREFIX = "table1:"  # of the hands of the synthesis paper's Table 1, which are built and not read


def bundled_hands() -> tuple[str, ...]:
    """Names that `load_hand` takes instead of a path."""
    return (*BUNDLED, *(TABLE_1_PREFIX + name for name in TABLE_1))


def load_hand(source: Any, *, root: str | None = None, srdf: str | Path | None = None) -> Hand:
    """A hand from a URDF, MJCF or GraspIt! file, by name, or from a mujoco model in memory.

    Only collision shapes are read (URDF `collision`; MJCF geoms that can collide), and a mesh counts as
    its convex hull: split a non-convex link into several meshes to keep its hollows. A link without
    collision shapes keeps `shapes == ()`. Coupled joints (URDF `mimic`, MJCF joint equalities) become
    couplings, pins (MJCF connect and weld) loops. `Hand.closing` is guessed from limits and geometry for a file and
    stated for a bundled hand.

    Args:
        source: a path; a bundled name (`bundled_hands`); `menagerie:robot/model` and `..._description`, of
            collections that are installed (see `named_models`); an `mujoco.MjModel` or `mujoco.MjSpec`. A path or a
            name of a collection may end in `#link`, which is the root.
        root: name of a link: only what hangs on it is read, in its frame: the hand without the arm that carries it,
            the left hand of a robot with two.
        srdf: a file whose `disable_collisions` say which links are not checked against each other; for a URDF the one
            of the same name beside it unless given.

    Raises:
        InputError: no such file or name (the bundled ones are listed), not a hand file, a missing mesh,
            a joint or transmission that is not understood. One line, naming the file.
    """
    if not isinstance(source, (str, Path)):
        hand = with_guessed_senses(_in_memory(source, root))
        return _with_srdf(hand, Path(srdf), strict=root is None) if srdf else hand
    if str(source) in bundled_hands():
        if root or srdf:
            raise InputError("is a bundled hand, which has no root or SRDF file to choose", source=str(source))
        hand = _bundled(str(source))
        return replace(hand, strengths=dict(hand.strengths))  # the one part of a hand that can be changed
    name, path = str(source), Path(source)
    if "#" in name and not os.path.isfile(path):
        name, _, link = name.rpartition("#")
        if root not in (None, link):
            raise InputError(f"asks for root '{link}', and root is '{root}'; one is needed", source=str(source))
        root, path = link, Path(name)
    path = collected(name) or path
    if not os.path.isfile(path):  # False, too, for what can be no name
        if path.suffix:
            raise InputError("no such file", source=str(path))
        known = bundled_hands()
        if name in bundled.names("objects"):
            raise InputError("is an object, and a hand is needed; HAND comes before OBJECT", source=name)
        others = f"others are files, or menagerie:ROBOT and ROBOT_description of collections ({EXTRA})"
        raise InputError(f"unknown hand '{name}'; known: {', '.join(known)}; {others}{nearest(name, known)}")
    hand = _read(path, root)
    if root:
        hand = replace(hand, source=f"{path}#{root}")
    beside = path.with_suffix(".srdf")
    if srdf is None and path.suffix.lower() == ".urdf" and os.path.isfile(beside):
        srdf = beside
    return _with_srdf(hand, Path(srdf), strict=root is None) if srdf else hand


@cache  # our own files, which stay as they are
def _bundled(name: str) -> Hand:
    if name.startswith(TABLE_1_PREFIX):
        return replace(table_1_hand(name.removeprefix(TABLE_1_PREFIX)), source=name)
    file, closing, breakaway = BUNDLED[name]
    hand = _read(Path(str(files("handfast") / "data" / "hands" / file)), guess=False)
    hand = hand.with_closing(dict.fromkeys(hand.joint_names, 0) | closing)
    return replace(hand, name=name, breakaway=breakaway, source=name)


def _in_memory(model: Any, root: str | None) -> Hand:
    """Of an `MjModel` or `MjSpec`, told apart without importing mujoco, which is slow and here already if it is one."""
    kind = type(model).__name__
    if kind == "MjModel":
        return hand_of_model(model, root)
    if kind == "MjSpec":
        return hand_of_spec(model, root)
    right = "a path, a name, an mujoco.MjModel or an mujoco.MjSpec is needed"
    raise InputError(f"is of type {kind}; {right}", field="source")


def _with_srdf(hand: Hand, srdf: Path, strict: bool) -> Hand:
    return replace(hand, non_colliding=hand.non_colliding | read_srdf(srdf, hand, strict=strict))


def _read(path: Path, base: str | None = None, *, guess: bool = True) -> Hand:
    """The hand in a file; closing senses that the file does not state are guessed."""
    root = read_robot_xml(path)
    kind = registry.hand_format(root)
    try:
        if not kind:
            raise InputError(f"has root element <{root.tag}>; <robot> or <mujoco> is needed")
        hand: Hand = registry.reader(registry.HAND_READERS, kind)(root, path, base)
    except InputError as fault:
        raise fault.at(str(path)) from None
    except UnicodeDecodeError:  # mujoco reads bytes, whatever encoding the file declares
        raise InputError("has names that are not in UTF-8", source=str(path)) from None
    return with_guessed_senses(hand) if guess and kind not in registry.STATES_SENSES else hand
