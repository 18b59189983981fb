"""Published grasps imported, contacts included: how long it takes, and what the treatment does to them.

The set is DexGraspBench's example: 400 Shadow grasps by BODex, five objects at four scales. Neither it nor the hand is
here: clone the project with its submodule mujoco_menagerie, and give its folder. Other sets of a known layout do as
well, with `--files`, `--hand` and `--objects`. Everything is timed as `handfast import` does it, from the files to the
written folder; each grasp is then measured anew in a scene of its own: penetration, contacts.

Times on a busy machine mean little: processor seconds over the cores are what a free one would take.

    python -m benchmarks.import_published --bench ../DexGraspBench --results benchmarks/results/import_published.json
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast import load_body, load_configuration, load_grasp, load_hand
from handfast.core.parallel import default_jobs
from handfast.datasets.published.import_folder import write_folder
from handfast.datasets.published.importing import Importer, Treatment, imported
from handfast.datasets.published.mapping_file import mapping_for
from handfast.datasets.published.published_file import Source, sources
from handfast.geometry.scene import Scene

HAND = "assets/hand/shadow/right_hand.xml"
GRASPS = "output/example_shadow/graspdata"
LENGTHS = ("penetration_before", "object_moved", "surface_moved")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--bench", type=Path, help="a clone of DexGraspBench")
    parser.add_argument("--files", type=Path, nargs="*", help="files of another set")
    parser.add_argument("--hand", type=Path, help="the hand's model")
    parser.add_argument("--objects", type=Path, nargs="*", default=[], help="folders of meshes")
    parser.add_argument("--count", type=int, default=400)
    parser.add_argument("--jobs", type=int, default=default_jobs())
    parser.add_argument("--name", default="DexGraspBench's example: Shadow, BODex")
    parser.add_argument("--results", type=Path, required=True)
    options = parser.parse_args()
    if not options.bench and not (options.files and options.hand):
        parser.error("give --bench FOLDER, or --files and --hand")
    files = options.files or sorted((options.bench / GRASPS).rglob("*.npy"))
    results = json.loads(options.results.read_text()) if options.results.exists() else {}
    found = measured(files, options.hand or options.bench / HAND, tuple(options.objects), options.count, options.jobs)
    results[options.name] = found
    options.results.write_text(json.dumps({**results, "machine": describe()}, indent=1) + "\n")
    print(json.dumps(found, indent=1))


def measured(files: list[Path], model: Path, objects: tuple[Path, ...], count: int, jobs: int) -> dict[str, Any]:
    """The figures of one import."""
    with tempfile.TemporaryDirectory() as folder:
        path, start, spent = Path(folder), time.monotonic(), processor()
        hand = load_hand(model)
        found: list[Source] = list(sources(files))
        chosen = [found[i] for i in np.linspace(0, len(found) - 1, min(count, len(found))).astype(int)]
        name, mapping = mapping_for(chosen[0].layout, hand)
        rows = list(imported(Importer(hand, mapping, Treatment(), str(model), objects, mass=0.1), chosen, jobs))
        write_folder(path, rows, {"mass": 0.1}, None)
        seconds, spent = time.monotonic() - start, processor() - spent
        good = [r.said for r in rows if not r.reason]
        deepest, contacts = again(path, model)
    return {
        "layout": chosen[0].layout,
        "mapping": name,
        "grasps": len(rows),
        "imported": len(good),
        "left_out": Counter(r.reason.split("; ")[0] for r in rows if r.reason),
        "jobs": jobs,
        "seconds": round(seconds, 1),
        "processor_seconds": round(spent, 1),
        "load_of_the_machine": round(os.getloadavg()[0], 1),  # how many processes wanted its cores in the last minute
        "deepest_penetration_left_mm": round(1e3 * deepest, 4),
        "contacts_in_files": spread(contacts),
        "contacts_before": spread([s["contacts_before"] for s in good]),
        "reduction_error": spread([s["reduction_error"] for s in good]),
        **{f"{key}_mm": spread([1e3 * s[key] for s in good]) for key in LENGTHS},
        "object_turned_degrees": spread(np.degrees([s["object_turned"] for s in good])),
        "fingers_closed": sum(len(s.get("gaps_closed", {})) for s in good),
        "fingers_left_open": sum(len(s.get("gaps_left", {})) for s in good),
    }


def again(path: Path, model: Path) -> tuple[float, list[int]]:
    """The deepest penetration [m] of what was written, each grasp in a scene of its own, and the files' contacts."""
    hand, deepest, contacts, scenes = load_hand(model), 0.0, [], {}
    for file in sorted(path.glob("*.configuration.json")):
        placed = load_configuration(file)
        if placed.object not in scenes:
            scenes = {placed.object: Scene(hand, load_body(str(placed.object)))}
        q = placed.applied(hand)[1]
        deepest = max(deepest, -float(scenes[placed.object].distance(q, placed.pose).min()))
        contacts.append(load_grasp(str(file).replace("configuration", "grasp")).m)
    return deepest, contacts


def spread(values: Any) -> dict[str, float]:
    """Median, 90 % and most."""
    v = np.asarray(values, dtype=float)
    if not len(v):
        return {}
    return {
        "median": round(float(np.median(v)), 4),
        "p90": round(float(np.quantile(v, 0.9)), 4),
        "most": round(float(v.max()), 4),
    }


def processor() -> float:
    """[s] of this process and those it started."""
    return sum(
        u.ru_utime + u.ru_stime
        for u in (resource.getrusage(w) for w in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


if __name__ == "__main__":
    main()
