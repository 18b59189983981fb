"""How long a new process takes to its first answer: `handfast check` without and with compiled code.

    python -m benchmarks.start [CHECKOUT ...] [--cold 3] [--warm 9] [--install]

Each checkout (this one alone by default) is copied, without what it has compiled, for each of `--cold` rounds: both
kernels are compiled, the first command follows, `--warm` others, and as many imports. With --install it is installed by
pip instead, so that the first command finds what the wheel carries. Checkouts take turns, so that other work on the
machine hits all alike; ratios are to the first. Writes results/start.json and prints a Markdown table.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.machine import describe, revision

RESULTS = Path(__file__).parent / "results" / "start.json"
HERE = Path(__file__).parents[1]
COMMAND = "from handfast.cli import main; main()"
COMPILE = (
    "from handfast.stability.search.machine import LIBRARY; LIBRARY.machine_code(); "
    "from handfast.synthesis.search.library import LIBRARY; LIBRARY.machine_code()"
)
QUESTION = ["check", "fig7", "--wrench", "0", "0", "-1", "0", "0", "0"]


def run(source: Path, code: str, *arguments: str) -> tuple[float, float]:
    """Seconds and processor time of a process."""
    env = os.environ | {"PYTHONPATH": str(source), "XDG_CACHE_HOME": str(source / "cache")}
    before, clock = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run([sys.executable, "-c", code, *arguments], env=env, stdout=subprocess.DEVNULL, check=True)
    seconds, after = time.perf_counter() - clock, resource.getrusage(resource.RUSAGE_CHILDREN)
    return seconds, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def put(checkout: Path, folder: Path, install: bool) -> None:
    """The package into a folder, as pip installs it or as its sources stand."""
    if install:
        pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-compile", "--target", str(folder)]
        subprocess.run([*pip, str(checkout.resolve())], check=True)
    else:
        shutil.copytree(checkout / "src", folder, ignore=shutil.ignore_patterns("__pycache__"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkouts", nargs="*", type=Path, default=[HERE])
    parser.add_argument("--cold", type=int, default=3)
    parser.add_argument("--warm", type=int, default=9)
    parser.add_argument("--install", action="store_true", help="install by pip in place of copying the sources")
    given = parser.parse_args()
    names = [revision(checkout) for checkout in given.checkouts]
    measured = (*([] if given.install else ["compile"]), "first", "check", "import")
    times: dict[str, list[list[tuple[float, float]]]] = {k: [[] for _ in names] for k in measured}
    for turn in range(given.cold):
        with tempfile.TemporaryDirectory() as folder:
            copies = [Path(folder) / str(k) for k in range(len(names))]
            order = list(range(len(names)))[:: 1 if turn % 2 else -1]
            for k in order:
                put(given.checkouts[k], copies[k], given.install)
                if not given.install:
                    times["compile"][k].append(run(copies[k], COMPILE))
                times["first"][k].append(run(copies[k], COMMAND, *QUESTION))
            for _ in range(given.warm):
                for k in order:
                    times["check"][k].append(run(copies[k], COMMAND, *QUESTION))
                    times["import"][k].append(run(copies[k], "import handfast"))
    rows = [
        {"what": what, "checkout": names[k], "seconds": [t[0] for t in some[k]], "processor": [t[1] for t in some[k]]}
        for what, some in times.items()
        for k in range(len(names))
    ]
    RESULTS.write_text(json.dumps({"machine": describe(), "installed": given.install, "rows": rows}, indent=1) + "\n")
    print("| | checkout | seconds, median | worst | processor time | ratio |\n|---|---|---:|---:|---:|---:|")
    for what, some in times.items():
        for k, name in enumerate(names):
            seconds, processor = ([t[i] for t in some[k]] for i in (0, 1))
            ratio = statistics.median(t[1] / u[1] for t, u in zip(some[k], some[0], strict=True))
            print(
                f"| {what} | {name} | {statistics.median(seconds):.2f} | {max(seconds):.2f} | "
                f"{statistics.median(processor):.2f} | {ratio:.2f} |"
            )


if __name__ == "__main__":
    main()
