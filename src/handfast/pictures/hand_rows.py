"""What is known and guessed about a hand as rows of text, for the tables of pages and of the screen."""

from __future__ import annotations

import numpy as np

from handfast.core import bundled
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Hand
from handfast.model.region import Bezier, Cap
from handfast.pictures.hand_facts import HandFacts, ShownHand
from handfast.pictures.words import along, body_text, hand_joint_text, hand_laws_text, hand_text, listed, num

Rows = list[list[str]]


def value_text(hand: Hand, joint: int, value: float) -> str:
    """A joint's value: '45°' or '12.5 mm'."""
    turns = hand.joints[joint].type == "revolute"
    return f"{num(float(np.degrees(value)), 3)}°" if turns else f"{num(1e3 * value, 3)} mm"


def range_text(hand: Hand, joint: int) -> str:
    """A joint's limits: '0° to 90°'."""
    j = hand.joints[joint]
    return f"{value_text(hand, joint, j.lower)} to {value_text(hand, joint, j.upper)}"


def si_range_text(hand: Hand, joint: int) -> str:
    """A joint's limits [rad or m]: '0 to 1.571 rad'."""
    j = hand.joints[joint]
    return f"{num(j.lower)} to {num(j.upper)} {'rad' if j.type == 'revolute' else 'm'}"


def closes_text(hand: Hand, joint: int) -> str:
    """The sense in which a joint closes the hand: '+', '−', 'no'."""
    return {1: "+", -1: "−", 0: "no"}[int(hand.closing[joint])]


def follows_text(hand: Hand, joint: int) -> str:
    """What a joint follows: '0.333 × finger_1_prox + 0.1', 'a loop'; '' if nothing."""
    if joint in hand.dependent:
        return "a loop"
    driver, ratio, offset = drivers(hand)[joint]
    if driver == joint:
        return ""
    if driver < 0:
        return f"fixed at {num(offset)}"
    shift = f" {'−' if offset < 0 else '+'} {num(abs(offset))}" if abs(offset) > 1e-12 else ""
    return ("" if ratio == 1 else f"{num(ratio)} × ") + hand.joint_names[driver] + shift


def driven_by(hand: Hand, joint: int) -> str:
    """The actuators that pull at a joint, or what it follows."""
    names = [n for n, row in zip(hand.mechanism.actuators, hand.mechanism.R, strict=True) if row[joint]]
    follows = follows_text(hand, joint)
    return ", ".join([*names, *([f"follows {follows}"] if follows else [])]) or "nothing"


def joint_rows(facts: HandFacts) -> Rows:
    """Per joint: name, type, limits, limits in SI units, what it has besides its motor, closing sense, actuators or
    driver, the links' finger."""
    hand, rows = facts.hand, []
    carrier = {j: i for i, link in enumerate(hand.links) for j in link.joints}
    for j, joint in enumerate(hand.joints):
        limits = [range_text(hand, j), si_range_text(hand, j)]
        finger = facts.finger[carrier[j]] if j in carrier else "–"
        about = [hand_joint_text(hand, j), closes_text(hand, j), driven_by(hand, j), finger]
        rows.append([joint.name, joint.type, *limits, *about])
    return rows


def actuator_rows(facts: HandFacts) -> Rows:
    """Per actuator: name, what it moves, kind, its command's unit, what its file states to be the most."""
    hand, mech, rows = facts.hand, facts.hand.mechanism, []
    for name, row, tendon, free in zip(mech.actuators, mech.R, mech.tendon, mech.backdrivable, strict=True):
        kind = "tendon, pulls only" if tendon else "motor, backdrivable" if free else "motor"
        moves = [(j.name, r, j.type) for j, r in zip(hand.joints, row, strict=True) if r]
        text = " + ".join(n if r == 1 else f"{num(float(r))} × {n}" for n, r, _ in moves)
        turns = not tendon and any(kind == "revolute" for _, _, kind in moves)
        most = num(hand.strengths[name]) if name in hand.strengths else "–"
        rows.append([name, text, kind, "N·m" if turns else "N", most])
    return rows


def strengths_text(facts: HandFacts) -> str:
    """What the hand's file states of its motors' strength: '5 N·m each', 'not stated'."""
    stated: dict[str, list[str]] = {}
    for name, _, _, unit, most in actuator_rows(facts):
        stated.setdefault("not stated" if most == "–" else f"{most} {unit}", []).append(name)
    if set(stated) == {"not stated"}:
        return "not stated in its file"
    said = [f"{most}: {listed(names)}" for most, names in stated.items()]
    each = f"{min(stated)} each" if len(said) == 1 else "; ".join(said)
    return f"{each}, by its file; a limit only with --torque-limit hand"


def region_rows(facts: HandFacts) -> Rows:
    """Per region: name, finger, role, link, surface, distance from the link's shapes."""
    rows = []
    for r in facts.regions or ():
        surface = "patch" if isinstance(r.region, Bezier) else r.region.kind.replace("_", " ")
        if isinstance(r.region, Cap):
            surface = (
                f"cap, radius {num(1e3 * r.region.radius, 3)} mm, ±{num(float(np.degrees(r.region.half_angle)), 3)}°"
            )
        error = f"{1e3 * r.error:.2f} mm" if r.error else "0"
        rows.append([r.name, r.finger, r.role, r.link, surface, error])
    return rows


def pair_rows(facts: HandFacts) -> Rows:
    """Pairs of links that are not checked against each other, and why; the faults of the model first."""
    names = facts.named
    rows = [
        [*names(pair), f"always overlap, {1e3 * depth:.1f} mm in mid-range"]
        for pair, depth in zip(facts.overlapping, facts.depths, strict=True)
    ]
    rows += [[*names(pair), "left out by the hand's file"] for pair in facts.excluded]
    rows += [[*names(pair), "joined"] for pair in facts.neighbours]
    return rows + [[*names(pair), "move as one"] for pair in facts.as_one]


def link_rows(facts: HandFacts) -> Rows:
    """Per link: name, parent, joints, finger, shapes, mass."""
    hand, rows = facts.hand, []
    for i, link in enumerate(hand.links):
        kinds = [s.kind for s in link.shapes]
        shapes = ", ".join(f"{kinds.count(k)} {k}" if kinds.count(k) > 1 else k for k in dict.fromkeys(kinds))
        joints = ", ".join(hand.joint_names[j] for j in link.joints) or "fixed"
        above = hand.link_names[link.parent] if link.parent >= 0 else "–"
        mass = f"{num(1e3 * facts.masses[link.name], 3)} g" if link.name in facts.masses else "–"
        rows.append([link.name, above, joints if link.parent >= 0 or link.joints else "base", facts.finger[i]])
        rows[-1] += [shapes or "none", mass]
    return rows


def counts(facts: HandFacts) -> str:
    """What there is of each kind: '22 links, 16 joints, 16 actuators, no couplings, 4 fingers'."""
    n = len(facts.fingers)
    return f"{hand_text(facts.hand)}, {n or 'no'} finger{'s' * (n != 1)}"


def overview(facts: HandFacts) -> list[tuple[str, str]]:
    """Names and values for a table at the top."""
    hand, palm = facts.hand, facts.palm
    how = "as stated" if hand.source in bundled.names("hands") else "guessed unless stated in a configuration"
    senses = f"{int(np.count_nonzero(hand.closing))} of {hand.l} joints close, {how}"
    rows = [("source", hand.source or "built in memory"), ("fingers", ", ".join(facts.fingers) or "none found")]
    if facts.regions is not None:
        rows.append(
            ("regions", f"{len(facts.regions.regions)}, {'given' if facts.given else 'guessed from the shapes'}")
        )
    rows.append(("closing senses", senses))
    if palm is not None:
        rows.append(("palm", f"guessed: it approaches along {along(palm.axis.round(6))} of the base frame"))
    if hand.couplings:
        way = "a stopped driver lets them go on (a clutch)" if hand.breakaway else "rigid"
        rows.append(("couplings", f"{len(hand.couplings)}, {way}"))
    rows.append(("joint laws", hand_laws_text(hand)))
    if hand.mechanism.a:
        rows.append(("motors at most", strengths_text(facts)))
    bare = [link.name for link in hand.links if not link.shapes]
    if bare:
        rows.append(("links without shapes", _listed(bare)))
    if facts.overlapping:
        rows.append(("always overlap", _listed([" and ".join(facts.named(p)) for p in facts.overlapping])))
    if facts.masses:
        unknown = [link.name for link in hand.links if link.shapes and link.name not in facts.masses]
        rest = f", without {_listed(unknown)}" if unknown else ""
        rows.append(("mass", f"{num(sum(facts.masses.values()), 3)} kg{rest}"))
    return rows


def object_facts(shown: ShownHand) -> list[tuple[str, str]]:
    """Names and values about the object; [] if there is none."""
    body = shown.body
    if body is None:
        return []
    at = ", ".join(num(1e3 * float(x), 4) for x in shown.pose[:3, 3].round(9))
    return [
        ("object", f"{body.name}: {body_text(body)}"),
        ("object's origin", f"at ({at}) mm in the hand's base frame"),
    ]


def _listed(names: list[str], most: int = 6) -> str:
    """At most a few names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
