"""A dataset of our own: Barrett and Allegro grasps from seeds, as `plan` closes them, and their labels.

    python -m benchmarks.grasp_dataset --allegro HAND.urdf [--each 4200] [--out dataset] [--jobs N]
    python -m benchmarks.grasp_dataset --sample 1000 [--out dataset]   # the table that is bundled

For each hand and each of twelve bundled objects: the palm before a random place of the surface, pushed up, stepped
back, and the fingers closed, as `plan` does it, but without its search for a preload that holds: the motors of the
fingers that touch squeeze with one command, drawn between 0.03 and 0.5 N m (log-uniform), friction is drawn between 0.3
and 0.9 and the mass between 50 g and 1 kg, so that some hold and some do not. What overlaps by more than 1 mm, or
touches with one finger, is left out. Attempt k of a seed is the same whoever makes it.

Everything goes on where it was ended: postures are written a block of attempts at a time, and labels by
`handfast label --resume`. 24 times 4200 are 100,800 grasps.
"""

from __future__ import annotations

import argparse
import gzip
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.core.parallel import default_jobs
from handfast.core.transforms import matrix_quaternion
from handfast.core.workers import Died, ProcessWorkers
from handfast.geometry.contacts import grasp_of
from handfast.label.label_columns import WRENCHES, wrench_column
from handfast.label.label_dataset import label_dataset
from handfast.label.label_files import load_labels, write_durably
from handfast.label.scene_source import SceneSource
from handfast.model.body import load_body
from handfast.model.hand.load import load_hand
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD, palm_of
from handfast.planning.evaluation.attempt import PENETRATION, Attempts, Placed, Runner, squeezing
from handfast.stability.loads import Loads

OBJECTS = ("ball", "block", "bottle", "can", "dumbbell", "egg", "mallet", "mug", "pear", "ring", "torch", "wedge")
BLOCK = 50  # attempts that are made, and written, at a time
BUNDLED = Path(__file__).parents[1] / "src" / "handfast" / "data" / "labels" / "barrett-allegro.jsonl.gz"
KEYS = ("joints", "object_position", "object_quaternion", "preload", "mass", "friction")
DIGITS = 4  # of the bundled numbers
KEPT = (
    *("name", "contact_positions", "contact_normals", "contact_links", "preload", "mass", "center", "verdict"),
    *("verdicts", "weight_factor", "worst_force", "largest_command", "largest_command_lower", "open"),
    *map(wrench_column, WRENCHES),
)


def runner(hand: str, thing: str) -> Runner:
    model, body = load_hand(hand), load_body(thing, mass=1.0)
    return Runner(Attempts(model, body, palm_of(model), Loads.gravity(body), seed=0))


def posture(made: Runner, thing: str, number: int) -> dict[str, Any] | None:
    """What an attempt leads to; None if to no grasp."""
    asked = made.asked
    rng = np.random.default_rng([OBJECTS.index(thing), number])
    start = palm_poses.draw(rng, asked.hand, asked.palm, made.surface, STANDARD)
    back, command = rng.exponential(STANDARD.back), float(np.exp(rng.uniform(np.log(0.03), np.log(0.5))))
    mass, friction = float(np.exp(rng.uniform(np.log(0.05), np.log(1.0)))), float(rng.uniform(0.3, 0.9))
    placed = made.placed(start, back)
    if not isinstance(placed, Placed):
        return None
    closed, pose = placed
    fingers = {asked.palm.anatomy.finger(asked.hand.link(c.link)) for c in closed.contacts}
    deep = made.clearance.overlaps(closed.q, pose)
    if len(fingers) < 2 or max(deep.inside, closed.penetration, deep.itself) > PENETRATION:
        return None
    grasp = grasp_of(asked.hand, closed.q, closed.contacts, pose)
    squeezed = squeezing(grasp, {j for j, why in closed.stopped.items() if why.endswith("touches")})
    if not squeezed:
        return None
    return {
        "joints": closed.q,
        "object_position": pose[:3, 3],
        "object_quaternion": matrix_quaternion(pose[:3, :3]),
        "preload": np.array([command if name in squeezed else 0.0 for name in asked.hand.mechanism.actuators]),
        "mass": mass,
        "friction": friction,
        "name": f"{thing} {number}",
    }


_made: dict[tuple[str, str], Runner] = {}


def block(hand: str, thing: str, number: int) -> list[dict[str, Any]]:
    """The grasps of one block of attempts."""
    if (hand, thing) not in _made:
        _made[hand, thing] = runner(hand, thing)
    attempts = range(number * BLOCK, (number + 1) * BLOCK)
    return [p for k in attempts if (p := posture(_made[hand, thing], thing, k))]


def postures(hand: str, thing: str, each: int, target: Path, jobs: int) -> None:
    """The first `each` grasps by number of attempt, in a table of postures; blocks that are there are kept."""
    if target.exists():
        return
    folder = target.with_suffix(".blocks")
    folder.mkdir(parents=True, exist_ok=True)
    have = {int(f.stem): json.loads(f.read_text()) for f in folder.glob("*.json")}
    with ProcessWorkers(jobs) as workers:
        first = 0
        while sum(len(have[k]) for k in range(first) if k in have) < each:
            ahead = [k for k in range(first, first + 4 * jobs) if k not in have]
            for k, rows in workers.run(partial(block, hand, thing), ahead):
                if isinstance(rows, Died):
                    raise InputError(rows.reason, source=f"{hand} {thing} {k}")
                have[k] = json.loads(json.dumps(rows, default=np.ndarray.tolist))
                write_durably(folder / f"{k}.json", [json.dumps(have[k]).encode()])
            first += 4 * jobs
    rows = [row for k in sorted(have) if k < first for row in have[k]][:each]
    part = target.with_suffix(".part.npz")
    np.savez_compressed(part, name=[r["name"] for r in rows], **{key: np.array([r[key] for r in rows]) for key in KEYS})
    part.replace(target)
    print(f"{target.stem}: {len(rows)} grasps of {first * BLOCK} attempts", flush=True)


def labelled(hand: str, thing: str, table: Path, jobs: int, ending: str) -> None:
    scene = SceneSource.of(hand, thing)
    summary = label_dataset(table, table.with_suffix(ending), scene=scene, jobs=jobs, resume=True)
    print(f"{table.stem}: {dict(summary.verdicts)}, {summary.broken} broken, {summary.rate:.2f} a second", flush=True)


def sample(folder: Path, count: int) -> None:
    """Rows of all tables in turn, rounded, as the bundled table."""
    named = (f for ending in (".parquet", ".jsonl") for f in folder.glob(f"*-*{ending}"))
    tables = sorted(f for f in named if f.with_suffix(".npz").exists())
    lines = []
    for k, table in enumerate(tables):
        share = count // len(tables) + (k < count % len(tables))
        good = [row for row in load_labels(table) if row["status"] == "labelled"]
        for row in good[:share]:
            hand, _, thing = table.stem.partition("-")
            kept = {"hand": hand, "object": thing} | {key: rounded(row[key]) for key in KEPT}
            kept["friction"] = rounded(row["contact_frictions"][0])
            lines.append(json.dumps(kept, separators=(",", ":")) + "\n")
    BUNDLED.parent.mkdir(exist_ok=True)
    BUNDLED.write_bytes(gzip.compress("".join(lines).encode(), 9, mtime=0))
    print(f"{BUNDLED.name}: {len(lines)} grasps, {BUNDLED.stat().st_size} bytes")


def rounded(value: Any) -> Any:
    if isinstance(value, list):
        return [rounded(v) for v in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--barrett", default="barrett-bh8-280")
    parser.add_argument("--allegro", default="", help="URDF of the vendor, or a name that `load_hand` takes")
    parser.add_argument("--objects", nargs="+", default=OBJECTS)
    parser.add_argument("--each", type=int, default=4200, help="grasps of each hand and object")
    parser.add_argument("--jobs", type=int, default=default_jobs())
    parser.add_argument("--out", type=Path, default=Path("dataset"))
    parser.add_argument("--ending", default=".parquet", choices=(".parquet", ".jsonl"))
    parser.add_argument("--sample", type=int, default=0, help="only write the bundled table, of so many rows")
    args = parser.parse_args()
    if args.sample:
        sample(args.out, args.sample)
        return
    args.out.mkdir(parents=True, exist_ok=True)
    for name, hand in (("barrett", args.barrett), ("allegro", args.allegro)):
        for thing in args.objects if hand else ():
            table = args.out / f"{name}-{thing}.npz"
            postures(hand, thing, args.each, table, args.jobs)
            labelled(hand, thing, table, args.jobs, args.ending)


if __name__ == "__main__":
    main()
