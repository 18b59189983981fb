"""Grasps of real hands for the agreement study: 3 to 10 contacts, closed as `plan` closes a hand, some with joint laws.

An attempt is a number: an object, a start of the palm, a push, closing, friction. Even numbers leave out what the
hand's file says of its joints beside their motors (`Hand.with_laws`), odd ones keep it: friction, springs, stops. Each
finger that was stopped squeezes with its innermost motor, seven in ten, or with all that a touch stopped; the other
motors stand. Kept are the first numbers whose commands some forces inside the friction cones balance, as in
`benchmarks.grasps`, few of a hand's with the same number of contacts (`CHOSEN`). No number was chosen by its
answer.

SA and Barrett hands are bundled. The others are other people's and are not in the repository: `--hands` is the folder
of `benchmarks.plan_hands`, `--shared` has the Allegro hand and the YCB objects. What is not there is left out.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from benchmarks.grasps import LEAST, Case, bodies, pressing, pull
from benchmarks.plan_hands import HANDS as FILES
from benchmarks.plan_hands import located
from handfast.core.errors import InputError
from handfast.geometry.contacts import grasp_of
from handfast.model.body import Body
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD, Palm, palm_of
from handfast.planning.evaluation.attempt import PENETRATION, Attempts, Placed, Runner, squeezing
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.loads import Loads

NAMES = {"barrett": "barrett-bh8-280", "sah": "schunk-sah"} | {n: FILES[n] for n in ("allegro", "shadow", "adroit")}
COMMANDS = {"barrett": 1.0, "sah": 1.0, "allegro": 0.3, "shadow": 0.3, "adroit": 0.3}  # [N m] the largest of a motor
# how many grasps of a hand, and which share of them may have the same number of contacts
CHOSEN = {"barrett": (150, 0.25), "sah": (60, 0.6), "allegro": (130, 0.25), "shadow": (110, 0.25), "adroit": (70, 0.25)}
OWN = ("jar", "flask", "slab", "ball", "rod", "can", "brick", "cube", "egg")  # of `benchmarks.grasps.bodies`
YCB = ("banana", "cracker_box", "hammer", "master_chef_can", "mustard_bottle", "tomato_soup_can")
THINGS = OWN + YCB
FEWEST, MOST = 3, 10  # contacts
INNERMOST = 0.7  # of the fingers that squeeze with one motor


@dataclass(frozen=True, eq=False)
class ClosedHands:
    """Where other people's hands and objects are: folders, which need not exist."""

    hands: Path
    shared: Path

    @cached_property
    def things(self) -> dict[str, Body]:
        return {b.name: b for b in bodies(self.shared)}

    @cached_property
    def _known(self) -> dict[str, tuple[Hand, Palm] | None]:
        return {}

    @cached_property
    def _runners(self) -> dict[tuple[str, str], Runner]:
        return {}

    def hand(self, name: str) -> tuple[Hand, Palm] | None:
        """A hand and its palm; None if its file is not there."""
        if name not in self._known:
            file = located(NAMES[name], self.hands, self.shared)
            there = "/" not in file or Path(file.split("#")[0]).is_file()
            hand = load_hand(file) if there else None
            self._known[name] = None if hand is None else (hand, palm_of(hand))
        return self._known[name]

    def missing(self, name: str, number: int) -> str:
        """What is needed for a grasp and not there, '' if nothing."""
        thing = drawn(name, number)[1]
        if self.hand(name) is None:
            return f"hand {name}"
        return "" if thing in self.things else f"object {thing}"

    def case(self, name: str, number: int) -> Case | None:
        """The grasp of a number, None if it leads to none; what it needs must be there."""
        rng, thing = drawn(name, number)
        known = self.hand(name)
        assert known is not None
        hand, _ = known
        if (name, thing) not in self._runners:
            body = replace(self.things[thing], mass=1.0)  # no mass is asked for, but loads of attempts have one
            self._runners[name, thing] = Runner(Attempts(hand, body, Loads.gravity(body)))
        grasp = closed(self._runners[name, thing], name, number, rng)
        return None if grasp is None else Case(f"closed {name} {number}", name, *grasp)


def drawn(name: str, number: int) -> tuple[np.random.Generator, str]:
    """The generator of a number, and its object."""
    rng = np.random.default_rng([list(NAMES).index(name), number])
    return rng, THINGS[int(rng.integers(len(THINGS)))]


def closed(run: Runner, name: str, number: int, rng: np.random.Generator) -> tuple[Grasp, np.ndarray] | None:
    """A grasp and the pull (6,) that is asked of it: out of the hand, within a cone."""
    hand, palm, body = run.asked.hand, run.asked.palm, run.asked.body
    start = palm_poses.draw(rng, hand, palm, run.surface, STANDARD)
    placed = run.placed(start, rng.exponential(STANDARD.back))
    if not isinstance(placed, Placed):
        return None
    found, pose, _ = placed
    deep = run.clearance.overlaps(found.q, pose)
    if len(found.contacts) < FEWEST or max(deep.inside, found.penetration, deep.itself) > PENETRATION:
        return None
    bare = number % 2 == 0
    lawful = hand.with_laws("none" if bare else "all")
    try:
        lock = behind_tendons(hand) if bare else ()
        grasp = grasp_of(lawful, found.q, found.contacts, pose, lock=lock, name=f"{name} on {body.name}")
    except InputError:
        return None
    grasp = grasp.with_friction(float(np.round(rng.uniform(0.4, 0.8), 2)))
    if not FEWEST <= grasp.m <= MOST or np.linalg.matrix_rank(grasp.G, tol=1e-6) < 6:
        return None
    stopped = {j for j, why in found.stopped.items() if why.endswith("touches")}
    chosen = motors(hand, palm, grasp, squeezing(grasp, stopped), rng)
    if len(chosen) < 2:
        return None
    grasp = grasp.with_preload(dict.fromkeys(chosen, COMMANDS[name]))
    commands = pressing(grasp, LEAST)
    if commands is None:
        return None
    outward = pose[:3, :3].T @ palm.axis
    return grasp.with_preload(np.round(commands, 4)), pull(rng, grasp, outward)


def behind_tendons(hand: Hand) -> tuple[str, ...]:
    """Of joints that one motor drives together all but the first: without stops nothing fixes their difference."""
    rows = [np.flatnonzero(row) for row in hand.mechanism.R]
    return tuple(hand.joint_names[j] for row in rows if not hand.mechanism.A[:, row].any() for j in row[1:])


def motors(hand: Hand, palm: Palm, grasp: Grasp, able: tuple[str, ...], rng: np.random.Generator) -> tuple[str, ...]:
    """Those that squeeze, of all that could: of each finger the innermost, or all."""
    fingers: dict[int, list[str]] = {}
    names = [j.name for j in grasp.joints]
    for motor in able:
        row = grasp.mechanism.R[grasp.mechanism.actuators.index(motor)]
        joint = hand.joint(names[int(np.flatnonzero(row)[0])])
        link = next(k for k in range(len(hand.links)) if joint in hand.moved_by(k))
        fingers.setdefault(palm.anatomy.finger(link), []).append(motor)
    return tuple(m for some in fingers.values() for m in (some[:1] if rng.random() < INNERMOST else some))


def numbers(name: str, folders: ClosedHands) -> Iterator[int]:
    """The numbers of a hand's grasps, in the order in which they are found."""
    taken: Counter[int] = Counter()
    count, share = CHOSEN[name]
    for number in range(100_000):
        if taken.total() == count:
            return
        case = folders.case(name, number)
        if case is not None and taken[case.contacts] < share * count:
            taken[case.contacts] += 1
            yield number


def add_folders(parser: argparse.ArgumentParser) -> None:
    """Options that say where other people's hands and objects are."""
    shared = Path(__file__).parents[2] / "shared"
    parser.add_argument("--hands", type=Path, default=Path("hands"), help="folder of menagerie/ and gymnasium/")
    parser.add_argument("--shared", type=Path, default=shared, help="folder with hands/ and objects/")
