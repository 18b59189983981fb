"""The questions of the agreement study: a thousand grasps of 3 to 10 contacts, each with a direction of load.

    python -m benchmarks.agreement_grasps --hands FOLDER --shared ../shared          # what is in it, and is found
    python -m benchmarks.agreement_grasps --make --hands FOLDER --shared ../shared   # choose seeds and numbers

    bundled       the repository's grasps, along the six axes of the object each
    random        `benchmarks.grasps`, and the next seeds of the same kind, up to ten contacts
    random, laws  the same kind again, each finger with a law of its joints: it rubs, a tendon bends two of its joints,
                  or its motor can be driven back and rubs
    barrett, allegro          `benchmarks.grasps`, each along its pull and one axis
    closed barrett, sah, allegro, shadow, adroit   `benchmarks.closed_grasps`, each along its pull and one axis

Seeds are the first ones whose commands some forces inside the friction cones balance. Questions come in one fixed
shuffled order whether hands are there or not, so that what is asked is a fair sample wherever it ends: first each
grasp at least once, then closed hands along their axes.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks import closed_grasps
from benchmarks.closed_grasps import NAMES, ClosedHands
from benchmarks.grasps import Case, cases, presses, random_case
from benchmarks.grasps import index as published
from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.model.mechanism import Mechanism
from handfast.readers.grasp_file import load_grasp

INDEX = Path(__file__).parent / "grasps" / "agreement.json"
SIZES = range(3, 11)  # contacts
MORE = {3: 28, 4: 28, 5: 28, 6: 28, 7: 28, 8: 28, 9: 30, 10: 30}  # random grasps beside the published ones
LAWFUL = 8  # random grasps with joint laws for each number of contacts
KINDS = ("rubs", "tendon", "driven back")  # of laws of a finger
LAWS_FROM = 100_000  # random seeds of grasps with laws begin here
SEED = 19


@dataclass(frozen=True, eq=False)
class Question:
    """What is asked: `made` gives its grasp and direction (6,), unless a hand or object is `missing`."""

    name: str
    family: str
    made: Callable[[], tuple[Grasp, Array]]
    missing: str = ""


def axes() -> dict[str, Array]:
    """Forces along the six directions of the object's axes."""
    return {f"{s}{a}": np.eye(6)[k] * (1 if s == "+" else -1) for k, a in enumerate("xyz") for s in "+-"}


def questions(folders: ClosedHands) -> list[Question]:
    """All of them, in their order."""
    found = [*_published(), *_more(), *_closed(folders)]
    more = [*_closed(folders, along=axes())]
    drawn, later = np.random.default_rng(SEED).permutation(len(found)), np.random.default_rng(SEED)
    return [found[k] for k in drawn] + [more[k] for k in later.permutation(len(more))]


def _given(grasp: Grasp, direction: Array) -> Callable[[], tuple[Grasp, Array]]:
    return lambda: (grasp, direction)


def _published() -> Iterator[Question]:
    """Bundled grasps and the published sets; draws as the study's first questions were drawn."""
    along = axes()
    for name in bundled.names("grasps"):
        for axis, direction in along.items():
            yield Question(f"{name} {axis}", "bundled", _given(load_grasp(name), direction))
    draw = np.random.default_rng(SEED)
    for case in cases(("random", "barrett", "allegro")):
        yield Question(case.name, case.family, _given(case.grasp, case.direction))
        if case.family != "random":
            axis = str(draw.choice(list(along)))
            yield Question(f"{case.name} {axis}", case.family, _given(case.grasp, along[axis]))


def _more() -> Iterator[Question]:
    for kind, family in (("random", "random"), ("lawful", "random, laws")):
        for m, seeds in _index()[kind].items():
            for seed in seeds:
                case = lawful_case(int(m), seed) if kind == "lawful" else random_case(int(m), seed)
                yield Question(case.name, family, _given(case.grasp, case.direction))


def _closed(folders: ClosedHands, along: dict[str, Array] | None = None) -> Iterator[Question]:
    """Closed hands along their pull, or along one of these directions each."""
    draw = np.random.default_rng(SEED)
    for name, chosen in _index()["closed"].items():
        for number in chosen:
            axis = "" if along is None else str(draw.choice(list(along)))
            label = f"closed {name} {number} {axis}".rstrip()
            made = _closing(folders, name, number, None if along is None else along[axis])
            yield Question(label, f"closed {name}", made, folders.missing(name, number))


def _closing(
    folders: ClosedHands, name: str, number: int, direction: Array | None
) -> Callable[[], tuple[Grasp, Array]]:
    def made() -> tuple[Grasp, Array]:
        case = folders.case(name, number)
        if case is None:
            raise InputError("is no grasp any more: another version of the hand?", source=f"closed {name} {number}")
        return case.grasp, case.direction if direction is None else direction

    return made


def lawful_case(m: int, seed: int) -> Case:
    """A random grasp whose fingers have laws of joints: friction is a share of the finger's command."""
    case = random_case(m, LAWS_FROM + seed)
    grasp, rng = case.grasp, np.random.default_rng([m, seed, len(KINDS)])
    joints = list(grasp.joints)
    names = [j.name for j in joints]
    rows: dict[str, Array] = {}
    tendons, driven_back = set(), set()
    for motor, command in grasp.preload.items():
        finger = [names.index(n) for n in names if n.rsplit("_", 1)[0] == motor.rsplit("_", 1)[0]]
        for j in finger:
            rows[names[j]] = np.eye(len(joints))[j]
        kind = str(rng.choice(KINDS))
        if kind == "tendon":  # over two joints, the second of which takes the difference
            first, second = finger[:2]
            rows[motor] = rows[motor] + rng.uniform(0.5, 1.0) * rows.pop(names[second])
            stop = "upper" if rng.random() < 0.5 else ""
            joints[second] = replace(joints[second], friction=command * float(rng.uniform(0.3, 1.0)), stop=stop)
            tendons.add(motor)
            continue
        first = names.index(motor)
        joints[first] = replace(joints[first], friction=command * float(rng.uniform(0.1, 0.4)))
        if kind == "driven back":
            driven_back.add(motor)
    mechanism = Mechanism(
        tuple(rows), np.array(list(rows.values())), np.zeros((0, len(joints))), tuple(n in tendons for n in rows),
        tuple(n in driven_back for n in rows),
    )  # fmt: skip
    name = f"lawful {m} {seed}"
    lawful = Grasp(grasp.contacts, joints, mechanism, dict(grasp.preload), name)
    return Case(name, "random, laws", lawful, case.direction)


def _first(m: int, count: int, made: Callable[[int, int], Case], known: set[int]) -> list[int]:
    """The first seeds beside those that are known whose commands press."""
    found = (seed for seed in range(10_000) if seed not in known and presses(made(m, seed).grasp))
    return [next(found) for _ in range(count)]


def make(folders: ClosedHands) -> None:
    """Choose seeds and numbers, and write them."""
    have = published()["random"]
    data = {
        "random": {m: _first(m, n, random_case, set(have.get(str(m), ()))) for m, n in MORE.items()},
        "lawful": {m: _first(m, LAWFUL, lawful_case, set()) for m in SIZES},
        "closed": {name: list(closed_grasps.numbers(name, folders)) for name in NAMES},
    }
    INDEX.write_text(json.dumps(data, separators=(",", ":")).replace("],", "],\n") + "\n", encoding="utf-8")


def _index() -> dict[str, dict[str, list[int]]]:
    found: dict[str, dict[str, list[int]]] = json.loads(INDEX.read_text("utf-8"))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    closed_grasps.add_folders(parser)
    parser.add_argument("--make", action="store_true", help="choose seeds and numbers, and write them")
    args = parser.parse_args()
    folders = ClosedHands(args.hands, args.shared)
    if args.make:
        make(folders)
    count: Counter[tuple[str, int]] = Counter()
    absent: Counter[str] = Counter()
    grasps = set()
    for question in questions(folders):
        if question.missing:
            absent[question.missing] += 1
            continue
        grasp, _ = question.made()
        count[question.family, grasp.m] += 1
        grasps.add(" ".join(question.name.split()[:3]) if question.name.startswith("closed") else grasp.name)
    print("| family | " + " | ".join(map(str, SIZES)) + " |\n|---|" + "---:|" * len(SIZES))
    for family in sorted({f for f, _ in count}):
        print(f"| {family} | " + " | ".join(str(count[family, m] or "") for m in SIZES) + " |")
    print(f"{count.total()} questions of {len(grasps)} grasps")
    for lacks, n in absent.items():
        print(f"left out: {n} for want of {lacks}")


if __name__ == "__main__":
    main()
