"""Two versions of the labels against each other, grasp by grasp: processor time, and what they say of each.

    git worktree add ../before REVISION
    python -m benchmarks.label_versions ../before . [--allegro HAND.urdf] [--each 14] [--published FOLDER]

Grasps are those of the published set with 3 to 5 contacts, with a mass, and the first ones of `grasp_dataset` of each
hand and object, with as many contacts as they have. Each version labels them in a process of its own, one after the
other, so that other work on the machine hits both alike. With --published, grasps of an imported set (`handfast import
... -o FOLDER`) in place of these: every fourth, from the fourth on, which come without commands. Ratios are of single
grasps; what differs is counted: bounds that contradict each other, verdicts, numbers that are open in one version
only. Adds to results/label.json.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe, revision

RESULTS = Path(__file__).parent / "results" / "label.json"
SAME = 1e-6  # relative: a lower bound that is as much above the other's upper bound contradicts it
ALIKE = 1e-9  # relative difference of measures that rounding makes
CLOSED = 2e-3  # relative distance of bounds that no limit kept apart


def answer() -> None:
    """The process of one version: a grasp file per line in, its label and processor time [s] out."""
    from handfast.readers.grasp_file import from_dict

    try:
        from handfast.datasets.labels.labeller import Labelling, label
    except ModuleNotFoundError:  # a version before the package had this name
        package = importlib.import_module("handfast.label.labeller")
        Labelling, label = package.Labelling, package.label  # type: ignore[misc]

    first = True
    for line in sys.stdin:
        grasp = from_dict(json.loads(line))
        if first:
            label(grasp, Labelling(directions=2))  # load the machine code
            first = False
        begin = time.process_time()
        said = label(grasp, Labelling())
        print(json.dumps(said | {"cpu": time.process_time() - begin}), flush=True)


def texts(allegro: str, each: int) -> Iterator[tuple[str, str]]:
    """Families and grasp files."""
    from benchmarks.grasp_dataset import OBJECTS, block
    from benchmarks.grasps import cases
    from handfast.datasets.dataset_rows import GraspChanges, PosedRow
    from handfast.datasets.scene_source import SceneSource
    from handfast.readers.grasp_file import file_dict

    for case in cases(("random", "barrett", "allegro")):
        if case.contacts <= 5:
            yield "published set", json.dumps(file_dict(case.grasp.about(mass=0.2, center_of_mass=(0, 0, 0))))
    for hand in ("barrett-bh8-280", allegro):
        for thing in OBJECTS if hand else ():
            scene = SceneSource.of(hand, thing)
            for row in block((hand, thing, 1, 99), 0)[:each]:
                named = {"position": row["object_position"], "quaternion": row["object_quaternion"]}
                named |= {key: row[key] for key in ("joints", "preload", "mass", "friction")}
                yield "dataset", json.dumps(file_dict(scene.grasp(PosedRow(**named), row["name"], GraspChanges())))


def imported(folder: Path) -> Iterator[tuple[str, str]]:
    """Those of a set that was imported."""
    for file in sorted(folder.glob("*.grasp.json"))[3::4]:
        yield "imported", json.dumps(json.loads(file.read_text()))


def started(checkout: Path) -> subprocess.Popen[str]:
    path = os.pathsep.join(map(str, (checkout / "src", Path(__file__).resolve().parents[1])))
    command = [sys.executable, str(Path(__file__).resolve()), "--answer"]
    env = os.environ | {"PYTHONPATH": path}
    return subprocess.Popen(command, env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def compared(a: dict[str, Any], b: dict[str, Any]) -> Counter[str]:
    """What two labels of one grasp say alike and otherwise."""
    from handfast.datasets.labels.label_columns import MEASURES

    out: Counter[str] = Counter()
    for x, y in zip(a["verdicts"] or (), b["verdicts"] or (), strict=True):
        out["verdicts that are equal" if x == y else f"verdicts {x} before, {y} after"] += 1
    if a["held_by"] is not None:
        x, y = a["held_by"], b["held_by"]
        out[f"held by {x} in both" if x == y else f"held by {x} before, {y} after"] += 1
    same_hardest = a["hardest"] == b["hardest"]  # of equals another one may be
    out["other hardest directions"] += not same_hardest
    for key in a:
        if f"{key}_upper" in a:
            bounds = [(v[key] or 0.0, np.inf if v[f"{key}_upper"] is None else v[f"{key}_upper"]) for v in (a, b)]
        elif f"{key}_lower" in a and same_hardest:
            none = [np.inf if v[key] is None else 0.0 for v in (a, b)]  # a lower bound that is not shown is empty
            lowers = [n if v[f"{key}_lower"] is None else v[f"{key}_lower"] for v, n in zip((a, b), none, strict=True)]
            bounds = [(low, np.inf if v[key] is None else v[key]) for v, low in zip((a, b), lowers, strict=True)]
        else:
            continue
        (lower, upper), (other_lower, other_upper) = bounds
        out["pairs of bounds"] += 1
        apart = max(lower - other_upper, other_lower - upper) > SAME * max(min(upper, other_upper), 1e-3)
        out["pairs of bounds that contradict each other"] += bool(apart)
        first, then = (u == low or (low > 0 and (u == np.inf or u - low <= CLOSED * u)) for low, u in bounds)
        out["pairs of bounds closed before only"] += first and not then
        out["pairs of bounds closed after only"] += then and not first
    for column in MEASURES:
        x, y = a[column.name], b[column.name]
        same = x == y or (x is not None and y is not None and abs(x - y) <= ALIKE * max(abs(x), abs(y), 1e-9))
        out["measures that are equal" if same else "measures that differ"] += 1
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkouts", nargs="*", type=Path, help="before, after")
    parser.add_argument("--allegro", default="", help="URDF of the vendor; without it there is the Barrett hand alone")
    parser.add_argument("--each", type=int, default=14, help="dataset grasps of each hand and object")
    parser.add_argument("--published", type=Path, metavar="FOLDER", help="an imported set")
    parser.add_argument("--answer", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.answer:
        answer()
        return
    before, after = (started(checkout.resolve()) for checkout in args.checkouts)
    counts: Counter[str] = Counter()
    times: dict[str, list[tuple[float, float]]] = {}
    chosen = imported(args.published) if args.published else texts(args.allegro, args.each)
    for number, (family, text) in enumerate(chosen):
        said = {}
        for process in (before, after) if number % 2 else (after, before):
            assert process.stdin
            assert process.stdout
            process.stdin.write(text + "\n")
            process.stdin.flush()
            said[process.pid] = json.loads(process.stdout.readline())
        a, b = said[before.pid], said[after.pid]
        counts += compared(a, b)
        times.setdefault(f"{family}, {a['contacts']} contacts", []).append((a["cpu"], b["cpu"]))
    for process in (before, after):
        process.communicate()
    found: dict[str, Any] = {"machine": describe(), "before": revision(args.checkouts[0])}
    found |= {"grasps": sum(map(len, times.values())), "compared": dict(sorted(counts.items())), "times": {}}
    for name, pairs in sorted(times.items()):
        t = 1e3 * np.array(pairs)
        found["times"][name] = {
            "grasps": len(t),
            "before: median ms": float(np.median(t[:, 0])),
            "after: median ms": float(np.median(t[:, 1])),
            "before: mean ms": float(t[:, 0].mean()),
            "after: mean ms": float(t[:, 1].mean()),
            "median of ratios": float(np.median(t[:, 1] / t[:, 0])),
        }
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    name = "versions, imported" if args.published else "versions"
    RESULTS.write_text(json.dumps(known | {name: found}, indent=1) + "\n")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
