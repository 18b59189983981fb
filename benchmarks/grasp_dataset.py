"""A dataset of our own: Barrett and Allegro grasps from seeds, as `plan` closes them, and their labels.

    python -m benchmarks.grasp_dataset --allegro HAND.urdf [--each 4200] [--out dataset] [--jobs N]
    python -m benchmarks.grasp_dataset --sample 1000 [--out dataset]   # the table that is bundled
    python -m benchmarks.grasp_dataset --summary [--out dataset]       # of what is there: results/grasp_dataset.json

For each hand and each of twelve bundled objects: the palm before a random place of the surface, pushed up, stepped
back, and the fingers closed, as `plan` does it, but without its search for a preload that holds: the motors of the
fingers that touch squeeze with one command, drawn between 0.03 and 0.5 N m (log-uniform), friction is drawn between 0.3
and 0.9 and the mass between 50 g and 1 kg, so that some hold and some do not. What overlaps by more than 1 mm, or
touches with one finger, is left out. Attempt k of a seed is the same whoever makes it.

Everything goes on where it was ended: postures are written a block of attempts at a time, and labels by
`handfast label --resume`. 24 times 4200 are 100,800 grasps. With `--rounds` all hands and objects come once in a round,
so that what is done when a run is ended has its share of each. `--draws` asks each closed hand with several commands,
masses and frictions, as a closing costs about as much as a label; `--most-contacts` leaves out what takes longest.
"""

from __future__ import annotations

import argparse
import gzip
import json
import math
import resource
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.core.errors import InputError
from handfast.core.parallel import Died, WorkerPool, default_jobs
from handfast.core.transforms import matrix_quaternion
from handfast.datasets.labels.label_columns import WRENCHES, wrench_column
from handfast.datasets.labels.label_dataset import label_dataset
from handfast.datasets.labels.label_files import load_labels, write_durably
from handfast.datasets.labels.labeller import Labelling
from handfast.datasets.scene_source import SceneSource
from handfast.geometry.contacts import grasp_of
from handfast.planning.candidates import palm_poses
from handfast.planning.candidates.palm_poses import STANDARD
from handfast.planning.evaluation.attempt import PENETRATION, Attempts, Placed, Runner, squeezing
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.loads import Loads

OBJECTS = ("ball", "block", "bottle", "can", "dumbbell", "egg", "mallet", "mug", "pear", "ring", "torch", "wedge")
BLOCK = 50  # attempts that are made, and written, at a time
ROUND = 1_000_000  # blocks between the first ones of two rounds
RESULTS = Path(__file__).parent / "results" / "grasp_dataset.json"
BUNDLED = Path(__file__).parents[1] / "src" / "handfast" / "data" / "labels" / "barrett-allegro.jsonl.gz"
KEYS = ("joints", "object_position", "object_quaternion", "preload", "mass", "friction")
DIGITS = 4  # of the bundled numbers
KEPT = (
    *("name", "contact_positions", "contact_normals", "contact_links", "preload", "mass", "center", "verdict"),
    *("verdicts", "weight_factor", "worst_force", "largest_command", "largest_command_lower", "held_by", "open"),
    *map(wrench_column, WRENCHES),
)


def runner(hand: str, thing: str) -> Runner:
    model, body = load_hand(hand), load_body(thing, mass=1.0)
    return Runner(Attempts(model, body, Loads.gravity(body)))


def postures_of(made: Runner, thing: str, number: int, draws: int, most: int) -> list[dict[str, Any]]:
    """What an attempt leads to: grasps that differ in commands, mass and friction; of `most` contacts at most."""
    asked = made.asked
    rng = np.random.default_rng([OBJECTS.index(thing), number])
    start = palm_poses.draw(rng, asked.hand, asked.palm, made.surface, STANDARD)
    back = rng.exponential(STANDARD.back)
    placed = made.placed(start, back)
    if not isinstance(placed, Placed):
        return []
    closed, pose, _ = placed
    fingers = {asked.palm.anatomy.finger(asked.hand.link(c.link)) for c in closed.contacts}
    deep = made.clearance.overlaps(closed.q, pose)
    if len(fingers) < 2 or max(deep.inside, closed.penetration, deep.itself) > PENETRATION:
        return []
    grasp = grasp_of(asked.hand, closed.q, closed.contacts, pose)
    squeezed = squeezing(grasp, {j for j, why in closed.stopped.items() if why.endswith("touches")})
    if not squeezed or grasp.m > most:
        return []
    place = {
        "joints": closed.q,
        "object_position": pose[:3, 3],
        "object_quaternion": matrix_quaternion(pose[:3, :3]),
    }
    out = []
    for draw in range(draws):
        again = np.random.default_rng([OBJECTS.index(thing), number, draw]) if draw else rng
        command = float(np.exp(again.uniform(np.log(0.03), np.log(0.5))))
        drawn = {
            "preload": np.array([command if name in squeezed else 0.0 for name in asked.hand.mechanism.actuators]),
            "mass": float(np.exp(again.uniform(np.log(0.05), np.log(1.0)))),
            "friction": float(again.uniform(0.3, 0.9)),
            "name": f"{thing} {number}" + (f" {draw}" if draw else ""),
        }
        out.append(place | drawn)
    return out


_made: dict[tuple[str, str], Runner] = {}


def block(asked: tuple[str, str, int, int], number: int) -> list[dict[str, Any]]:
    """The grasps of one block of attempts; asked: hand, object, draws, most contacts."""
    hand, thing, draws, most = asked
    if (hand, thing) not in _made:
        _made[hand, thing] = runner(hand, thing)
    attempts = range(number * BLOCK, (number + 1) * BLOCK)
    return [p for k in attempts for p in postures_of(_made[hand, thing], thing, k, draws, most)]


def postures(hand: str, thing: str, target: Path, start: int, args: argparse.Namespace) -> None:
    """The first `--each` grasps by number of attempt, from block `start` on, in a table of postures; blocks that are
    there are kept."""
    if target.exists():
        return
    folder = target.with_suffix(".blocks")
    folder.mkdir(parents=True, exist_ok=True)
    have = {int(f.stem): json.loads(f.read_text()) for f in folder.glob("*.json")}
    made, spent = 0, cpu()
    end = start
    while (missing := args.each - sum(len(have[k]) for k in range(start, end))) > 0:
        rows_a_block = max(sum(map(len, have.values())) / len(have), 1.0) if have else args.draws * BLOCK / 2
        more = range(end, end + max(args.jobs, math.ceil(missing / rows_a_block)))
        with WorkerPool((hand, thing, args.draws, args.most_contacts), args.jobs) as workers:
            ahead = [k for k in more if k not in have]
            for k, rows in workers.run(block, ahead):
                if isinstance(rows, Died):
                    raise InputError(rows.reason, source=f"{hand} {thing} {k}")
                have[k] = json.loads(json.dumps(rows, default=np.ndarray.tolist))
                write_durably(folder / f"{k}.json", [json.dumps(have[k]).encode()])
                made += len(rows)
        end = more.stop
    rows = [row for k in range(start, end) for row in have[k]][: args.each]
    part = target.with_suffix(".part.npz")
    np.savez_compressed(part, name=[r["name"] for r in rows], **{key: np.array([r[key] for r in rows]) for key in KEYS})
    part.replace(target)
    noted(target, "postures", {"attempts": (end - start) * BLOCK, "made": made, "cpu": cpu() - spent})
    print(f"{target.stem}: {len(rows)} grasps of {(end - start) * BLOCK} attempts", flush=True)


def labelled(hand: str, thing: str, table: Path, args: argparse.Namespace) -> None:
    scene, spent = SceneSource.of(hand, thing), cpu()
    how = {"labelling": Labelling(nodes=args.nodes), "scene": scene, "jobs": args.jobs, "resume": True}
    summary = label_dataset(table, table.with_suffix(args.ending), **how)
    if summary.fresh:
        peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
        course = {"fresh": summary.fresh, "cpu": cpu() - spent, "wall": summary.wall, "peak MiB": peak}
        noted(table, "labels", course)
    print(f"{table.stem}: {dict(summary.verdicts)}, {summary.broken} broken, {summary.rate:.2f} a second", flush=True)


def cpu() -> float:
    """[s] of the processor that this process and workers that ended have had."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def noted(table: Path, what: str, course: dict[str, float]) -> None:
    """What a table cost, beside it; a run that was killed leaves no note of its own."""
    write_durably(table.with_suffix(f".{what}.json"), [json.dumps(course).encode() + b"\n"])


def summed(folder: Path, args: argparse.Namespace) -> dict[str, Any]:
    """Figures of all tables of labels that are there."""
    out: dict[str, Any] = {"machine": describe(), "draws of each closing": args.draws}
    out |= {"most contacts": args.most_contacts, "node limit of a question": args.nodes}
    for hand in ("barrett", "allegro"):
        tables = sorted(t for t in folder.glob(f"*/{hand}-*.npz") if t.with_suffix(args.ending).exists())
        counts: dict[str, Counter[Any]] = {key: Counter() for key in ("verdict", "contacts", "stop", "reason")}
        opened = some_open = nodes = 0
        for table in tables:
            for row in load_labels(table.with_suffix(args.ending)):
                for key, count in counts.items():
                    count[row[key]] += 1
                if row["status"] == "labelled":
                    opened, some_open, nodes = opened + row["open"], some_open + bool(row["open"]), nodes + row["nodes"]
        known = counts["reason"].pop(None, 0)
        found = {"tables": len(tables), "grasps": sum(counts["verdict"].values()), "labelled": known}
        found |= {
            ("contacts" if key == "contacts" else f"{key}s"): {str(k): n for k, n in sorted(count.items(), key=str)}
            for key, count in counts.items()
        }
        found |= {"open questions": opened, "labels with an open question": some_open, "nodes": nodes}
        labels, made = ([json.loads(f.read_text()) for f in notes(tables, what)] for what in ("labels", "postures"))
        found["processor ms of a label"] = 1e3 * mean(labels, "cpu", "fresh")
        found["processor ms of a posture"] = 1e3 * mean(made, "cpu", "made")
        found["attempts"] = sum(note["attempts"] for note in made)
        found["labels a second, two processes of a shared machine"] = mean(labels, "fresh", "wall")
        found["peak MiB of a process"] = max((note["peak MiB"] for note in labels), default=0.0)
        out[hand] = found
    return out


def notes(tables: list[Path], what: str) -> list[Path]:
    return [note for table in tables if (note := table.with_suffix(f".{what}.json")).exists()]


def mean(notes: list[dict[str, float]], of: str, by: str) -> float:
    return sum(note[of] for note in notes) / max(sum(note[by] for note in notes), 1e-9)


def sample(folder: Path, count: int) -> None:
    """Rows of the tables of the first round in turn, rounded, as the bundled table."""
    named = (f for ending in (".parquet", ".jsonl") for f in (folder / "0").glob(f"*-*{ending}"))
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
    parser.add_argument("--rounds", type=int, default=1, help="in each of which there are as many")
    parser.add_argument("--draws", type=int, default=1, help="of command, mass and friction for each closed hand")
    parser.add_argument("--most-contacts", type=int, default=99)
    parser.add_argument("--nodes", type=float, help="of each question of a label")
    parser.add_argument("--jobs", type=int, default=default_jobs())
    parser.add_argument("--out", type=Path, default=Path("dataset"))
    parser.add_argument("--ending", default=".parquet", choices=(".parquet", ".jsonl"))
    parser.add_argument("--sample", type=int, default=0, help="only write the bundled table, of so many rows")
    parser.add_argument("--summary", action="store_true", help="only write the figures of what is there")
    args = parser.parse_args()
    if args.sample:
        sample(args.out, args.sample)
        return
    if not args.summary:
        for number in range(args.rounds):
            (args.out / str(number)).mkdir(parents=True, exist_ok=True)
            for name, hand in (("barrett", args.barrett), ("allegro", args.allegro)):
                for thing in args.objects if hand else ():
                    table = args.out / str(number) / f"{name}-{thing}.npz"
                    postures(hand, thing, table, number * ROUND, args)
                    labelled(hand, thing, table, args)
    RESULTS.write_text(json.dumps(summed(args.out, args), indent=1) + "\n")


if __name__ == "__main__":
    main()
