"""`handfast label` put to the test: how fast, how much memory, and what kill -9 and broken rows do to a table.

    python -m benchmarks.label rate     # CPU time of a label at four contacts, and where it goes
    python -m benchmarks.label killed   # the run killed again and again: is the table the same?
    python -m benchmarks.label cluster  # the same with Dask workers on loopback, workers and run killed
    python -m benchmarks.label broken   # a thousand rows, of which ten are broken in ten ways
    python -m benchmarks.label memory   # a hundred thousand rows: peak memory of the run and of its workers

Each writes its part of results/label.json. Times are CPU times of the process, which other work on the machine hardly
changes; rates of runs are wall time. `killed`, `cluster` and `broken` ask little of each grasp (two directions), as
they are about rows, not about questions.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import random
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import cases, random_case
from benchmarks.machine import describe
from handfast.core.transforms import matrix_quaternion
from handfast.datasets.labels.label_columns import LABEL_COLUMNS
from handfast.datasets.labels.label_dataset import label_dataset
from handfast.datasets.labels.label_files import load_labels
from handfast.datasets.labels.labeller import Labelling, label
from handfast.datasets.scene_source import SceneSource
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import file_dict, from_dict
from handfast.readers.load_hand import load_hand

RESULTS = Path(__file__).parent / "results" / "label.json"
COURSE = {c.name for c in LABEL_COLUMNS if c.course}
LITTLE = ("--directions", "2", "--part", "4")
PORT = 18_786


def entry(seed: int) -> dict[str, Any]:
    """A random grasp of three contacts that knows its object's mass, as a grasp file."""
    return file_dict(random_case(3, seed).grasp.about(mass=0.2, center_of_mass=(0, 0, 0)))


def lines(count: int) -> list[str]:
    return [json.dumps(entry(seed)) for seed in range(count)]


def table(path: Path) -> list[dict[str, Any]]:
    """Rows in order, without what may differ from run to run."""
    rows = sorted(load_labels(path), key=lambda row: row["row"])
    return [{key: value for key, value in row.items() if key not in COURSE} for row in rows]


def command(dataset: Path, output: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "handfast.cli", "label", str(dataset), "-o", str(output), *LITTLE, *more]


def finished(run: list[str], rng: random.Random, kills: int, also: Any = None) -> int:
    """A run that is killed after a while, again and again, then left in peace: how often it was killed.

    Args:
        also: called with each kill, for more to be killed.
    """
    done, until = 0, 1.0
    while True:
        process = subprocess.Popen(run, stdout=subprocess.DEVNULL)
        end = time.monotonic() + rng.uniform(2.0, 2.0 + 2.0 * until) if done < kills else float("inf")
        while process.poll() is None and time.monotonic() < end:
            time.sleep(0.05)
        if process.poll() is not None:
            assert process.returncode == 0, f"status {process.returncode}"
            return done
        process.send_signal(signal.SIGKILL)
        process.wait()
        if also:
            also()
        done, until = done + 1, until + 0.5


def killed(args: argparse.Namespace) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        data, whole, torn = (
            Path(folder) / name for name in ("data.jsonl", f"whole{args.ending}", f"torn{args.ending}")
        )
        data.write_text("\n".join(lines(args.rows)) + "\n")
        subprocess.run(command(data, whole, "--jobs", "1"), check=True, stdout=subprocess.DEVNULL)
        kills = finished(command(data, torn, "--jobs", "2", "--resume"), random.Random(args.seed), args.kills)
        same = table(whole) == table(torn)
        return {"rows": args.rows, "kills": kills, "same table": same, "ending": args.ending}


@contextlib.contextmanager
def dask(workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and workers on loopback, each worker with a nanny that begins it again."""
    run = [sys.executable, "-m"]
    address = f"tcp://127.0.0.1:{PORT}"
    how = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    scheduler = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(PORT), "--no-dashboard"]
    worker = ["distributed.cli.dask_worker", address, "--nthreads", "1", "--no-dashboard"]
    began = [subprocess.Popen([*run, *scheduler], **how)]  # type: ignore[call-overload]
    time.sleep(5)
    began += [subprocess.Popen([*run, *worker], **how) for _ in range(workers)]  # type: ignore[call-overload]
    time.sleep(5)
    try:
        yield address, began[1:]
    finally:
        for process in reversed(began):
            process.terminate()
        for process in began:
            process.wait()


def workers_of(nanny: int) -> list[int]:
    """The worker process of a nanny; not the process that cleans up behind it."""
    import psutil  # distributed has it

    with contextlib.suppress(psutil.Error):
        below = psutil.Process(nanny).children(recursive=True)
        return [p.pid for p in below if "resource_tracker" not in " ".join(p.cmdline())]
    return []


def cluster(args: argparse.Namespace) -> dict[str, Any]:
    """Workers are killed while the run goes on, and the run is killed as well."""
    rng, lost = random.Random(args.seed), 0
    with tempfile.TemporaryDirectory() as folder, dask(2) as (address, nannies):
        data, whole, torn = (
            Path(folder) / name for name in ("data.jsonl", f"whole{args.ending}", f"torn{args.ending}")
        )
        data.write_text("\n".join(lines(args.rows)) + "\n")
        begin = time.monotonic()
        subprocess.run(command(data, whole, "--scheduler", address), check=True, stdout=subprocess.DEVNULL)
        seconds = time.monotonic() - begin

        def kill_worker() -> None:
            nonlocal lost
            for pid in workers_of(rng.choice(nannies).pid):
                with contextlib.suppress(OSError):
                    os.kill(pid, signal.SIGKILL)
                    lost += 1

        run = command(data, torn, "--scheduler", address, "--resume")
        kills = finished(run, rng, args.kills, kill_worker)
        torn.unlink()
        process = subprocess.Popen(run, stdout=subprocess.DEVNULL)  # and workers alone, while the run goes on
        for _ in range(args.kills):
            time.sleep(rng.uniform(3, 5))
            if process.poll() is None:
                kill_worker()
        assert process.wait() == 0
        same = table(whole) == table(torn)
        done = {"rows": args.rows, "runs killed": kills, "workers killed": lost, "same table": same}
        return done | {"undisturbed seconds": seconds, "ending": args.ending}


def broken_lines() -> dict[str, str]:
    """Ten ways in which a row can be broken."""
    good = entry(0)
    first = good["contacts"][0]

    def with_contact(**changed: Any) -> str:
        return json.dumps(good | {"contacts": [first | changed, *good["contacts"][1:]]})

    many = [first | {"position": [0.001 * k, 0, 0]} for k in range(90)]
    return {
        "cut short": json.dumps(good)[:200],
        "empty": "",
        "NaN": json.dumps(good).replace(repr(first["friction"]), "NaN", 1),
        "negative friction": with_contact(friction=-0.5),
        "normal of length 0": with_contact(normal=[0, 0, 0]),
        "normal of length 2": with_contact(normal=[0, 0, 2]),
        "no contacts": json.dumps(good | {"contacts": []}),
        "unknown field": json.dumps(good | {"colour": "red"}),
        "joint moves contact 99": json.dumps(
            good | {"joints": [good["joints"][0] | {"moves": [99]}, *good["joints"][1:]]}
        ),
        "too many contacts": json.dumps(good | {"contacts": many, "joints": [], "mechanism": None, "preload": {}}),
    }


def broken(args: argparse.Namespace) -> dict[str, Any]:
    rng, kinds = random.Random(args.seed), broken_lines()
    rows = lines(args.rows - len(kinds))
    places = dict(zip(sorted(rng.sample(range(args.rows), len(kinds))), kinds.items(), strict=True))
    for place, (_, text) in places.items():
        rows.insert(place, text)
    with tempfile.TemporaryDirectory() as folder:
        data, out = Path(folder) / "data.jsonl", Path(folder) / f"labels{args.ending}"
        data.write_text("\n".join(rows) + "\n")
        begin = time.monotonic()
        label_dataset(data, out, labelling=Labelling(directions=2), jobs=2)
        seconds = time.monotonic() - begin
        found = {row["row"]: row["reason"] for row in load_labels(out) if row["status"] == "broken"}
    reported = [{"row": p, "kind": kind, "reason": found.get(p)} for p, (kind, _) in places.items()]
    right = found.keys() == places.keys()
    return {"rows": args.rows, "broken": len(found), "exactly those": right, "seconds": seconds, "reported": reported}


def rate(args: argparse.Namespace) -> dict[str, Any]:
    """CPU time of a label, with and without the replay of proofs, and of what comes before the questions."""
    families = ("random", "barrett", "allegro")
    grasps = [c.grasp.about(mass=0.2, center_of_mass=(0, 0, 0)) for c in cases(families) if c.contacts == 4]
    plain, out = Labelling(), {}
    label(grasps[0], plain)
    times = [cpu(lambda g=g: label(g, plain)) for g in grasps]
    out["label"] = spread_of(times) | {"a second and core": 1 / float(np.mean(times))}
    replayed = [cpu(lambda g=g: label(g, Labelling(replay=True))) for g in grasps[: args.replayed]]
    out["label, proofs replayed"] = spread_of(replayed)
    out["replayed over plain"] = sum(replayed) / sum(times[: args.replayed])
    texts = [json.dumps(file_dict(g)) for g in grasps]
    out["grasp file"] = spread_of([cpu(lambda t=t: from_dict(json.loads(t))) for t in texts])
    scene = SceneSource.of("barrett-bh8-280", "can")
    hand, q = load_configuration("barrett-can").applied(scene.scene().hand)
    from handfast.geometry.contacts import contact_grasp

    pose, compiled = load_configuration("barrett-can").pose, scene.scene()
    touch = [cpu(lambda: contact_grasp(hand, q, compiled.body, pose, scene=compiled)) for _ in range(50)]
    out["contacts from meshes"] = spread_of(touch)
    return out | {"grasps": len(grasps)}


def cpu(work: Any) -> float:
    begin = time.process_time()
    work()
    return time.process_time() - begin


def spread_of(seconds: list[float]) -> dict[str, float]:
    return {
        f"{name} ms": 1e3 * float(f(seconds)) for name, f in (("median", np.median), ("mean", np.mean), ("most", max))
    }


def memory(args: argparse.Namespace) -> dict[str, Any]:
    """A table of postures of which few are labelled and most touch nothing: rows, not questions, fill memory."""
    rng, placed = np.random.default_rng(args.seed), load_configuration("barrett-can")
    hand, q = placed.applied(load_hand("barrett-bh8-280"))
    far = rng.uniform(size=args.rows) > args.labelled / args.rows
    position = placed.pose[:3, 3] + np.where(far, 1.0, 0.0)[:, None] + rng.normal(0, 1e-4, (args.rows, 3))
    quaternion = np.tile(matrix_quaternion(placed.pose[:3, :3]), (args.rows, 1))
    preload = [placed.preload.get(name, 0.0) for name in hand.mechanism.actuators] if placed.preload else []
    with tempfile.TemporaryDirectory() as folder:
        data, out = Path(folder) / "data.npz", Path(folder) / f"labels{args.ending}"
        parts = {"joints": np.tile(q, (args.rows, 1)), "object_position": position, "object_quaternion": quaternion}
        np.savez(data, **parts, preload=np.tile(preload, (args.rows, 1)), mass=np.full(args.rows, 0.2))
        del parts, position, quaternion
        run = [sys.executable, "-m", "benchmarks.label", "one", "--data", str(data), "--out", str(out)]
        said = subprocess.run(run, check=True, capture_output=True, text=True).stdout
        return {"rows": args.rows} | json.loads(said) | {"bytes of the table": out.stat().st_size}


def one(args: argparse.Namespace) -> None:
    """A run by itself, for `memory`: prints its peak memory and that of its workers."""
    scene = SceneSource.of("barrett-bh8-280", "can")
    how = {"labelling": Labelling(directions=2), "scene": scene, "jobs": 2}
    summary = label_dataset(args.data, args.out, **how)
    peak = {
        who: resource.getrusage(getattr(resource, f"RUSAGE_{who}")).ru_maxrss / 1024 for who in ("SELF", "CHILDREN")
    }
    done = {"labelled": summary.labelled, "broken": summary.broken, "seconds": summary.wall}
    print(json.dumps(done | {"peak MiB, run": peak["SELF"], "peak MiB, worker": peak["CHILDREN"]}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("rate", "killed", "cluster", "broken", "memory", "one"))
    parser.add_argument("--rows", type=int)
    parser.add_argument("--kills", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--replayed", type=int, default=3, help="labels of `rate` with proofs replayed")
    parser.add_argument("--labelled", type=int, default=300, help="rows of `memory` that touch the object")
    parser.add_argument("--ending", default=".parquet", choices=(".parquet", ".jsonl"))
    parser.add_argument("--data", type=Path)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    if args.what == "one":
        one(args)
        return
    rows = {"killed": 200, "cluster": 200, "broken": 1000, "memory": 100_000}
    args.rows = args.rows or rows.get(args.what, 0)
    found = {"machine": describe()} | globals()[args.what](args)
    before = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    RESULTS.write_text(json.dumps(before | {args.what: found}, indent=1) + "\n")
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
