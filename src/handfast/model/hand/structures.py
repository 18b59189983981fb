"""Hands from finger structures: strings such as URR, and the eleven hands of the synthesis paper's Table 1.

The paper gives the joints of each hand, not its dimensions. The dimensions here are nominal, about those
of a person's hand and of none of the eleven: what such a hand can be asked is whether a structure works,
not whether a product does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.core.transforms import transform
from handfast.model.hand.hand import Coupling, Hand, Joint, Link, direct_mechanism
from handfast.model.shape import Shape

FINGER_NAMES = ("little", "ring", "middle", "index", "thumb")
PHALANGES = {2: ("proximal", "distal"), 3: ("proximal", "middle", "distal")}
ALONG_X = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])  # a shape's z along the link's x


@dataclass(frozen=True)
class Dimensions:
    """Nominal dimensions [m] and ranges [rad].

    Attributes:
        palm: length from the wrist to the knuckles, width between the outermost knuckles, thickness.
        finger, thumb: lengths of the proximal, middle and distal phalanx. With two phalanges the first
            one is as long as the first two together.
        metacarpal: from the thumb's root hinge, where it has one, to its next joint.
        thumb_root: the thumb's root in the palm frame.
        opposition: how far a thumb without root hinge is turned from sideways (0) to palmar (pi/2).
        radius, tip: of the phalanges and of the spheres at their ends.
        abduction, knuckle, flexion, root, cup: ranges of the first axis of a universal joint, of the
            first flexion, of every other flexion, of a thumb's root hinge and of another finger's.
    """

    palm: tuple[float, float, float] = (0.095, 0.072, 0.022)
    finger: tuple[float, float, float] = (0.045, 0.030, 0.027)
    thumb: tuple[float, float, float] = (0.045, 0.034, 0.030)
    metacarpal: float = 0.012
    thumb_root: tuple[float, float, float] = (0.012, 0.030, 0.030)
    opposition: float = 1.3
    radius: float = 0.008
    tip: float = 0.010
    abduction: tuple[float, float] = (-0.35, 0.35)
    knuckle: tuple[float, float] = (-0.1, 1.55)
    flexion: tuple[float, float] = (0.0, 1.6)
    root: tuple[float, float] = (0.0, 1.6)
    cup: tuple[float, float] = (0.0, 0.35)


@dataclass(frozen=True)
class Design:
    """One row of Table 1.

    Attributes:
        title: as printed, with the table's reference.
        dof: the table's column DOF.
        fingers: structure of each finger, see `hand_from_structure`.
        couplings: (joint, driver) with equal angles beside those in the structures.
        note: where the reading of the table needs a reason.
    """

    title: str
    dof: int
    fingers: Mapping[str, str]
    couplings: tuple[tuple[str, str], ...] = ()
    note: str = ""


def _four(structure: str, thumb: str) -> dict[str, str]:
    return dict.fromkeys(("ring", "middle", "index"), structure) | {"thumb": thumb}


def _five(structure: str, thumb: str) -> dict[str, str]:
    return {"little": structure} | _four(structure, thumb)


# Synthesis paper, Table 1. Its underlining, which marks coupled joints, is not in the text that we have:
# the couplings below are the ones with which the degrees of freedom sum to the column DOF, two distal
# joints first. Where one column stands for several fingers they share a structure.
TABLE_1: dict[str, Design] = {
    "dist": Design("DIST hand (Caffaz and Cannata 1998)", 16, _four("URR", "URR")),
    "robonaut": Design(
        "Robonaut hand (Lovchik and Diftler 1999)",
        12,
        {"little": "R(RRR)", "ring": "R(RRR)", "middle": "U(RR)", "index": "U(RR)", "thumb": "UR"},
        (("little_base", "ring_base"),),
        "12 = 3 for little and ring + 3 + 3 + 3: one cupping hinge of the palm carries both of them",
    ),
    "lms": Design("LMS hand (Gazeau et al. 2001)", 16, _four("URR", "URR")),
    "ultralight": Design(
        "Ultralight Anthropomorphic hand (Schulz et al. 2001)",
        10,
        _five("R(RR)", "(URR)"),
        (),
        "10 = 4 x 2 + 2: the thumb's three parallel axes are coupled, nothing else sums to 10",
    ),
    "gifu-2": Design("GIFU II hand (Kawasaki et al. 2002)", 16, _five("U(RR)", "URR")),
    "shadow": Design("Shadow Robot hand (Shadow Robot Company 2003)", 18, _five("U(RR)", "UUR") | {"little": "RU(RR)"}),
    "dlr-2": Design("DLR II hand (Butterfass et al. 2004)", 13, _four("U(RR)", "RU(RR)")),
    "ubh-3": Design("UBH 3 hand (Lotti et al. 2004)", 20, _five("URR", "URR")),
    "ma-1": Design("MA-I hand (Suarez and Grosch 2005)", 16, _four("URR", "URR")),
    "sa": Design("SA hand (Schunk)", 13, _four("U(RR)", "RU(RR)")),
    "twendy-one": Design("Twendy-One hand (Iwata and Sugano 2009)", 13, _four("U(RR)", "RUR")),
}


def table_1_hand(name: str, dimensions: Dimensions | None = None) -> Hand:
    """A hand of Table 1 by its key in `TABLE_1`, with nominal dimensions."""
    if name not in TABLE_1:
        raise unknown_name("hand", name, TABLE_1)
    design = TABLE_1[name]
    return hand_from_structure(name, design.fingers, dimensions, couplings=design.couplings)


def hand_from_structure(
    name: str,
    fingers: Mapping[str, str],
    dimensions: Dimensions | None = None,
    *,
    couplings: tuple[tuple[str, str], ...] = (),
) -> Hand:
    """A hand whose fingers have the given structures, palm at the root.

    A structure lists the joints from the palm to the tip, R revolute and U universal (abduction, then
    flexion); joints in brackets are coupled, equal angles, and of a U only the flexion: "U(RR)". A leading
    R before a U, or of four joints, is a hinge at the root: it brings a thumb into opposition and cups
    the palm under any other finger. The other joints flex one phalanx each, two or three in all.

    Palm frame: origin at the wrist, z towards the fingers, x out of the palm, y towards the thumb. Link
    frames: x along the link, z palmar; abduction about z, flexion about -y. Joints are named
    `<finger>_base`, `<finger>_abduction`, `<finger>_proximal`, ...; links `<finger>_base`,
    `<finger>_proximal`, ...; a second U of the same finger has `<finger>_middle_abduction`.

    Args:
        fingers: structure by name: little, ring, middle, index, thumb; those left out do not exist.
        dimensions: nominal ones by default.
        couplings: (joint, driver) with equal angles beside those in brackets.

    Raises:
        InputError: an unknown finger or a structure that is not understood.
    """
    size = dimensions or Dimensions()
    for finger in fingers:
        if finger not in FINGER_NAMES:
            raise unknown_name("finger", finger, FINGER_NAMES, field="fingers")
    made = _HandParts([Link("palm", -1, np.eye(4), (), (_palm(size),))])
    across = [f for f in FINGER_NAMES if f in fingers and f != "thumb"]
    spread = np.linspace(-size.palm[1] / 2, size.palm[1] / 2, len(across)) if len(across) > 1 else np.zeros(1)
    for finger, y in zip(across, spread, strict=False):
        _finger(made, finger, fingers[finger], float(y), size)
    if "thumb" in fingers:
        _finger(made, "thumb", fingers["thumb"], 0.0, size)
    names = [j.name for j in made.joints]
    for joint, driver in couplings:
        for other in (joint, driver):
            if other not in names:
                raise unknown_name("joint", other, names, field="couplings")
        made.couplings.append(Coupling(names.index(joint), names.index(driver), 1.0))
    mechanism = direct_mechanism(names, tuple(made.couplings))
    closing = np.array([0.0 if n.endswith("abduction") else 1.0 for n in names])
    return Hand(name, tuple(made.links), tuple(made.joints), mechanism, tuple(made.couplings), closing, False)


@dataclass
class _HandParts:
    """What has been built so far."""

    links: list[Link]
    joints: list[Joint] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)

    def add(self, name: str, parent: int, pose: Array, joints: list[Joint], shapes: tuple[Shape, ...]) -> int:
        """A link after its parent; returns its index."""
        first = len(self.joints)
        self.joints += joints
        self.links.append(Link(name, parent, pose, tuple(range(first, len(self.joints))), shapes))
        return len(self.links) - 1


def _parsed(finger: str, structure: str) -> tuple[list[tuple[str, int]], bool]:
    """(letter, number of its bracket or -1) of each joint, and whether the first is a hinge at the root."""
    joints: list[tuple[str, int]] = []
    bracket, inside = -1, False
    for letter in structure:
        if letter == "(" and not inside:
            bracket, inside = bracket + 1, True
        elif letter == ")" and inside:
            inside = False
        elif letter in "RU":
            joints.append((letter, bracket if inside else -1))
        else:
            inside = True
            break
    letters = "".join(j[0] for j in joints)
    hinge = letters.startswith("RU") or len(letters) == 4
    if inside or len(letters) - hinge not in PHALANGES or (len(letters) == 4 and letters[0] == "U"):
        problem = f"is '{structure}'; R and U, coupled ones in brackets, for two or three phalanges: U(RR), RU(RR)"
        raise InputError(problem, field=f"fingers.{finger}")
    return joints, hinge


def _finger(made: _HandParts, finger: str, structure: str, y: float, size: Dimensions) -> None:
    joints, hinge = _parsed(finger, structure)
    parent, pose, lengths = 0, _root(finger, y, size, hinge), list(size.thumb if finger == "thumb" else size.finger)
    if hinge:
        thumb = finger == "thumb"
        axis = [0, 0, -1] if thumb else [0, -1, 0]
        root = _joint(f"{finger}_base", axis, size.root if thumb else size.cup)
        long = size.metacarpal if thumb else size.palm[0] - size.thumb_root[2]
        parent = made.add(f"{finger}_base", 0, pose, [root], (_bone(long, size),))
        pose = transform((long, 0, 0))
    flexing = joints[hinge:]
    if len(flexing) == 2:
        lengths = [lengths[0] + lengths[1], lengths[2]]
    drivers: dict[int, int] = {}
    for k, ((letter, bracket), part) in enumerate(zip(flexing, PHALANGES[len(flexing)], strict=True)):
        made_of = []
        if letter == "U":
            named = f"{finger}_abduction" if k == 0 else f"{finger}_{part}_abduction"
            made_of.append(_joint(named, [0, 0, 1], size.abduction))
        made_of.append(_joint(f"{finger}_{part}", [0, -1, 0], size.flexion if k else size.knuckle))
        shapes: tuple[Shape, ...] = (_bone(lengths[k], size),)
        if part == "distal":
            tip = transform((lengths[k] - size.tip, 0, 0))
            shapes = (_bone(lengths[k] - size.tip, size), Shape("sphere", size.tip, tip, name=f"{finger}_tip"))
        parent = made.add(f"{finger}_{part}", parent, pose, made_of, shapes)
        pose = transform((lengths[k], 0, 0))
        if bracket >= 0:
            driver = drivers.setdefault(bracket, len(made.joints) - 1)
            if driver != len(made.joints) - 1:
                made.couplings.append(Coupling(len(made.joints) - 1, driver, 1.0))


def _root(finger: str, y: float, size: Dimensions, hinge: bool) -> Array:
    """(4, 4) first link of a finger in the palm frame, its joints at zero."""
    if finger == "thumb":
        a = 0.0 if hinge else size.opposition
        along = np.array([np.sin(a), np.cos(a), 0.0])
        return transform(size.thumb_root, np.column_stack([along, np.cross([0, 0, 1], along), [0, 0, 1]]))
    z = size.thumb_root[2] if hinge else size.palm[0]  # a cupping hinge is as far up as the thumb's root
    return transform((0, y, z), np.column_stack([[0, 0, 1], [0, -1, 0], [1, 0, 0]]))


def _joint(name: str, axis: Any, limits: tuple[float, float]) -> Joint:
    return Joint(name, "revolute", np.array(axis, dtype=float), np.zeros(3), *limits)


def _bone(length: float, size: Dimensions) -> Shape:
    return Shape("capsule", (size.radius, length), transform((length / 2, 0, 0), ALONG_X))


def _palm(size: Dimensions) -> Shape:
    long, wide, thick = size.palm
    edges = (thick, wide + 2 * size.radius, long)
    return Shape("box", edges, transform((-thick / 2, 0, long / 2)), name="palm")
