"""What there is to say about a hand: what its file states, and what is guessed from it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.libraries import quiet
from handfast.core.limited import limited
from handfast.core.schema import written
from handfast.core.transforms import rigid, transform
from handfast.geometry.collision import Pair, always_meeting
from handfast.geometry.guess_regions import regions_of
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegions
from handfast.model.shape import Shape
from handfast.planning.candidates.palm_poses import Palm, palm_of
from handfast.readers.xml_file import read_robot_xml

BODY_DISTANCE = 10.0  # [m] from the hand, where a body that nobody asked about is


@dataclass(frozen=True, eq=False)
class HandFacts:
    """A hand and what is known or guessed about it.

    Attributes:
        hand: the hand.
        regions: given, bundled or guessed; None if there are none to guess.
        given: the regions were not guessed.
        palm: guessed from the closing senses; None if that is impossible.
        missing: sentences about what could not be guessed, and why.
        finger: (n_links) the finger that each link is part of; "palm" if it carries several, or none.
        neighbours: pairs of links, by index, that are not checked against each other because they are joined.
        as_one: pairs that no joint moves against each other.
        excluded: pairs that are not checked for another reason: the hand's file leaves them out.
        overlapping: pairs that overlap in all of a hundred configurations.
        depths: (k,) [m] how deep these are in each other in the middle of the joints' ranges.
        masses: [kg] by link name, where the file states them.
    """

    hand: Hand
    regions: HandRegions | None
    given: bool
    palm: Palm | None
    missing: tuple[str, ...]
    finger: tuple[str, ...]
    neighbours: tuple[Pair, ...]
    as_one: tuple[Pair, ...]
    excluded: tuple[Pair, ...]
    overlapping: tuple[Pair, ...]
    depths: tuple[float, ...]
    masses: dict[str, float]

    @property
    def fingers(self) -> tuple[str, ...]:
        """Names of the fingers, in the order of their links."""
        return tuple(dict.fromkeys(f for f in self.finger if f != "palm"))

    def named(self, pair: Pair) -> tuple[str, str]:
        """The names of two links."""
        return self.hand.link_names[pair[0]], self.hand.link_names[pair[1]]


@dataclass(frozen=True, eq=False)
class ShownHand:
    """A hand as it is to be seen.

    Attributes:
        facts: the hand and what is known about it.
        q: (l,) its configuration.
        body: an object, or None.
        pose: (4, 4) of the object in the hand's base frame.
    """

    facts: HandFacts
    q: Array
    body: Body | None
    pose: Array


def facts_of(hand: Hand, regions: HandRegions | None = None) -> HandFacts:
    """Look at a hand.

    Args:
        regions: the hand's own; by default the bundled ones of a bundled hand, else guessed ones.

    Raises:
        InputError: regions of links that the hand does not have; a shape that cannot be collided.
    """
    missing = []
    given = regions is not None or hand.source in bundled.names("hand_regions")
    if regions is not None:
        regions.refuse_strangers(hand)
    else:
        try:
            regions = regions_of(hand)
        except InputError as fault:
            missing.append(f"No regions are guessed: {fault.at(hand.name)}.")
    palm = None
    try:
        palm = palm_of(hand)
    except InputError as fault:
        missing.append(f"The palm is not guessed: {fault.at(hand.name)}.")
    scene = Scene(hand, _nothing())
    overlapping = always_meeting(scene)
    neighbours, as_one, excluded = _unchecked(hand, scene.self_pairs)
    return HandFacts(
        hand,
        regions,
        given,
        palm,
        tuple(missing),
        _fingers(hand, regions),
        neighbours,
        as_one,
        excluded,
        overlapping,
        _depths(scene, overlapping),
        stated_masses(hand),
    )


def shown_hand(
    facts: HandFacts, body: Body | None = None, *, q: Array | None = None, pose: Array | None = None
) -> ShownHand:
    """A hand with what is not given filled in, and `InputError`, as in `handfast.pictures.hand_page.report_hand`."""
    hand = facts.hand
    values = hand.configuration() if q is None else np.asarray(q, dtype=float)
    if values.shape != (hand.l,) or not np.isfinite(values).all():
        raise InputError(f"has shape {values.shape}; {hand.l} finite numbers are needed", field="q")
    if pose is None:
        pose = np.eye(4)
        if body is not None and facts.palm is not None:
            pose[:3, 3] = facts.palm.center - body.center_of_mass
    return ShownHand(facts, values, body, rigid(pose))


def _nothing() -> Body:
    """A small ball far from the hand: a scene has an object."""
    return Body.of([Shape("sphere", [1e-3], transform([0.0, 0.0, BODY_DISTANCE]))], name="nothing")


def _fingers(hand: Hand, regions: HandRegions | None) -> tuple[str, ...]:
    """For each link the finger whose tips, and no other's, are at its end; "palm" for all others."""
    reached: list[set[str]] = [set() for _ in hand.links]
    for r in regions or ():
        link = hand.link(r.link)
        while r.role != "palm" and link >= 0:
            reached[link].add(r.finger)
            link = hand.links[link].parent
    for i, above in enumerate(part.parent for part in hand.links):  # beyond a tip: nails, frames for sensors
        if not reached[i] and above >= 0 and len(reached[above]) == 1:
            reached[i] = reached[above]
    fixed = [not hand.moved_by(i) for i in range(len(hand.links))]
    return tuple(next(iter(r)) if len(r) == 1 and not f else "palm" for r, f in zip(reached, fixed, strict=True))


def _unchecked(hand: Hand, checked: list[Pair]) -> tuple[tuple[Pair, ...], tuple[Pair, ...], tuple[Pair, ...]]:
    """Pairs of links with shapes that a scene does not check: joined ones, those that move as one, and others."""
    solid = [i for i, link in enumerate(hand.links) if link.shapes]
    moved = {i: hand.moved_by(i) for i in solid}
    rigid = set(moved.values())

    def joined(inner: tuple[int, ...], outer: tuple[int, ...]) -> bool:
        """Whether the joints of `outer` are those of `inner` and then some, without a solid part between."""
        between = [outer[:k] for k in range(len(inner) + 1, len(outer))]
        return len(outer) > len(inner) and outer[: len(inner)] == inner and not rigid & set(between)

    kinds: tuple[list[Pair], list[Pair], list[Pair]] = ([], [], [])
    known = {frozenset(p) for p in checked}
    for k, i in enumerate(solid):
        for j in solid[k + 1 :]:
            if frozenset((i, j)) in known:
                continue
            a, b = moved[i], moved[j]
            kinds[1 if a == b else 0 if joined(a, b) or joined(b, a) else 2].append((i, j))
    return tuple(kinds[0]), tuple(kinds[1]), tuple(kinds[2])


def _depths(scene: Scene, pairs: tuple[Pair, ...]) -> tuple[float, ...]:
    """[m] how deep pairs of links are in each other in the middle of the joints' ranges."""
    if not pairs:
        return ()
    deepest = dict.fromkeys(pairs, 0.0)
    for m in scene.self_collisions(scene.hand.limits.mean(axis=1), 0.0):
        if (m.first, m.second) in deepest:
            deepest[m.first, m.second] = max(deepest[m.first, m.second], -m.distance)
    return tuple(deepest.values())


def to_json(shown: ShownHand) -> dict[str, Any]:
    """All of it as JSON: SI units, links and joints by name."""
    facts, hand, palm = shown.facts, shown.facts.hand, shown.facts.palm
    follow, mech = drivers(hand), hand.mechanism
    joints = [
        {
            "name": joint.name,
            "type": joint.type,
            "lower": joint.lower,
            "upper": joint.upper,
            "value": float(shown.q[j]),
            "closing": int(hand.closing[j]),
            **written(joint.law),
            "follows": None
            if follow[j][0] == j
            else {
                "driver": hand.joint_names[follow[j][0]] if follow[j][0] >= 0 else None,
                "ratio": follow[j][1],
                "offset": follow[j][2],
            },
        }
        for j, joint in enumerate(hand.joints)
    ]
    actuators = [
        {
            "name": name,
            "moves": {j: float(r) for j, r in zip(hand.joint_names, row, strict=True) if r},
            "tendon": tendon,
            "backdrivable": free,
            "strength": hand.strengths.get(name),
        }
        for name, row, tendon, free in zip(mech.actuators, mech.R, mech.tendon, mech.backdrivable, strict=True)
    ]
    tendons = [
        {"name": t.name, "length": {j: float(r) for j, r in zip(hand.joint_names, t.row, strict=True) if r}}
        | written(t.law)
        for t in hand.tendons
    ]
    links = [
        {
            "name": link.name,
            "parent": hand.link_names[link.parent] if link.parent >= 0 else None,
            "joints": [hand.joint_names[j] for j in link.joints],
            "finger": facts.finger[i],
            "shapes": len(link.shapes),
            "mass": facts.masses.get(link.name),
        }
        for i, link in enumerate(hand.links)
    ]
    regions = [{"name": r.name, "finger": r.finger, "role": r.role, "link": r.link} for r in facts.regions or ()]
    return {
        "schema": "handfast/hand-facts/1",
        "hand": hand.name,
        "source": hand.source,
        "links": links,
        "joints": joints,
        "actuators": actuators,
        "tendons": tendons,
        "breakaway": hand.breakaway,
        "fingers": list(facts.fingers),
        "regions": regions,
        "guessed": not facts.given,
        "palm": palm and {"center": palm.center.tolist(), "approach": palm.axis.tolist()},
        "not_checked": {
            "overlapping": [list(facts.named(p)) for p in facts.overlapping],
            "excluded": [list(facts.named(p)) for p in facts.excluded],
            "joined": [list(facts.named(p)) for p in facts.neighbours],
            "as_one": [list(facts.named(p)) for p in facts.as_one],
        },
        "missing": list(facts.missing),
    }


# --- masses: grasp stability does not need them, so `Hand` has none ---


def stated_masses(hand: Hand) -> dict[str, float]:
    """Masses [kg] by link, of the links for which the file behind `hand.source` states one; {} without a file.

    URDF: `inertial`. MJCF: `inertial`, or the masses of all geoms of the body; one that would follow from a density
    alone is not counted as stated.
    """
    if not os.path.isfile(hand.source):
        return {}
    try:
        root = read_robot_xml(Path(hand.source))
        found = limited(_of_mjcf, hand.source) if root.tag == "mujoco" else _of_urdf(root)
    except (InputError, ValueError):  # a hand that was read by other means: there is nothing to add
        return {}
    return {name: m for name, m in found.items() if name in hand.link_names and np.isfinite(m) and m >= 0}


def _of_urdf(root: Element) -> dict[str, float]:
    values = {e.get("name", ""): e.find("inertial/mass") for e in root.findall("link")}
    return {name: float(m.get("value", "nan")) for name, m in values.items() if m is not None}


def _of_mjcf(path: str) -> dict[str, float]:
    import mujoco  # slow to import

    try:
        with quiet():
            spec = mujoco.MjSpec.from_file(path)
    except (RuntimeError, mujoco.FatalError):  # as where there is no more memory
        return {}
    found = {}
    for body in spec.bodies:
        of_geoms = [g.mass for g in body.geoms]
        if body.explicitinertial:
            found[body.name] = float(body.mass)
        elif of_geoms and not np.isnan(of_geoms).any():
            found[body.name] = float(np.sum(of_geoms))
    return found
