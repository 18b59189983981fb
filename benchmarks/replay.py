"""What checking a certificate costs beside the search that made it: processor time, parts of it, size on disk.

    python -m benchmarks.replay [--count 8] [--sizes 3 4 5 6 8] [--published FOLDER] [--out results/replay.json]

Maxima of fresh random grasps with seeds that nothing was tuned on (`no_cap.question`: plain, base load, torque and
force limits, uncertain normals, a coupling, a prismatic joint; then joints that rub, `joint_friction`); largest forces
along the axes of dense grasps of 8 to 12 contacts (`dense`; FOLDER has published ones) and of bundled grasps. Each is
searched without replay, and its certificate is checked by `handfast.proofs`, once with everything that depends on the
grasp made anew, once again with that kept. Times are of the processor, the quickest of three, one thread. Every part
that may be slow is timed on its own: reading the file, the tree, the rows, the leaves, what is done in rational
arithmetic.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.dense import published, pulls
from benchmarks.grasps import cases
from benchmarks.joint_friction import drawn, rubbing
from benchmarks.machine import describe
from benchmarks.no_cap import question
from handfast.proofs import checker, equations, leaves
from handfast.proofs.certificate import Certificate, file_to_dict, read_certificate_file
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

BUNDLED = Path(str(files("handfast") / "data" / "grasps"))
RESULTS = Path(__file__).parent / "results" / "replay.json"
SETTINGS = Settings(verify=False, jobs=1, timeout=20.0)
FIRST_SEED, LAWS_SEED = 8_200_000, 3_150_000
PARTS = {"tree": (checker, "leaf_cases"), "rows": (checker, "checked_rows"), "rational": (leaves, "exact_margin")}


def timed(run: Callable[[], Any], times: int = 3) -> tuple[Any, float]:
    """A result, and its processor time [ms], the least of some."""
    seconds = []
    for _ in range(times):
        start = time.process_time()
        found = run()
        seconds.append(1e3 * (time.process_time() - start))
    return found, min(seconds)


def parts(certificate: Certificate) -> dict[str, float]:
    """Processor time [ms] of the parts of one check."""
    spent = dict.fromkeys(PARTS, 0.0)
    originals = {name: getattr(*place) for name, place in PARTS.items()}

    def watched(name: str) -> Callable[..., Any]:
        def run(*args: Any) -> Any:
            start = time.process_time()
            found = originals[name](*args)
            spent[name] += 1e3 * (time.process_time() - start)
            return found

        return run

    try:
        for name, (module, function) in PARTS.items():
            setattr(module, function, watched(name))
        checker.verify(certificate)
    finally:
        for name, (module, function) in PARTS.items():
            setattr(module, function, originals[name])
    return spent


def anew(certificate: Certificate) -> checker.Checked:
    """Checked with nothing kept of the grasp."""
    equations._made.cache_clear()
    for name in ("exact_table", "exact_rows"):
        certificate.question.grasp.__dict__.pop(name, None)
    return checker.verify(certificate)


def row(kind: str, ask: Callable[[], Any]) -> dict[str, Any] | None:
    """Figures of one maximum; None if it has no certificate."""
    answer, search = timed(ask)
    certificate = answer.certificate
    if certificate is None:
        return None
    written = file_to_dict(certificate, answer.posed.to_json())
    found, fresh = timed(lambda: anew(certificate))
    return {
        "kind": kind,
        "contacts": certificate.question.grasp.m,
        "leaves": found.leaves,
        "search": search,
        "fresh": fresh,
        "kept": timed(lambda: checker.verify(certificate))[1],
        "reading": timed(lambda: read_certificate_file(written, ""))[1],
        "parts": parts(certificate),
        "proved": found.ok,
        "cap": found.cap,
        "bytes": len(json.dumps(written)),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians over certificates of more than a leaf."""
    many = [r for r in rows if r["leaves"] > 1]

    def median(of: Callable[[dict[str, Any]], float]) -> float | None:
        return round(statistics.median(map(of, many)), 3) if many else None

    return {
        "certificates": len(rows),
        "of more than a leaf": len(many),
        "fresh / search, all": round(statistics.median(r["fresh"] / r["search"] for r in rows), 3) if rows else None,
        "fresh / search": median(lambda r: r["fresh"] / r["search"]),
        "kept / search": median(lambda r: r["kept"] / r["search"]),
        "bytes": median(lambda r: r["bytes"]),
        "proved": sum(r["proved"] for r in rows),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=7, help="grasps of each size")
    parser.add_argument("--sizes", type=int, nargs="+", default=[3, 4, 5, 6, 8])
    parser.add_argument("--laws", type=int, default=4, help="grasps with joints that rub, of 3 and 4 contacts each")
    parser.add_argument("--published", type=Path, metavar="FOLDER", help="of `handfast import`: dense grasps, too")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    rows: dict[str, list[dict[str, Any]]] = {}
    for m in options.sizes:
        for k in range(options.count):
            kind, g, d, more = question(k, FIRST_SEED + 100 * m, (m,))
            found = row(kind, lambda g=g, d=d, more=more: maximum(g, d, settings=SETTINGS, **more))
            rows.setdefault(f"{m} contacts", []).extend([found] if found else [])
    for m in (3, 4):
        for seed in range(options.laws):
            g, d, friction = drawn(m, LAWS_SEED + seed)
            g = rubbing(g, friction, 2, np.random.default_rng(seed))
            found = row("joint friction", lambda g=g, d=d: maximum(g, d, settings=SETTINGS))
            rows.setdefault("joints that rub", []).extend([found] if found else [])
    dense = [(c.name, c.grasp) for c in cases(("power",)) if 8 <= c.grasp.m <= 12][: options.count]
    dense += published(options.published)[: options.count] if options.published else []
    bundled = [(file.stem, load_grasp(file)) for file in sorted(BUNDLED.glob("*.json"))]
    for kind, grasps in (("dense", dense), ("bundled", bundled)):
        for name, g in grasps:
            for d in pulls(g):
                found = row(name, lambda g=g, d=d: maximum(g, d, settings=SETTINGS))
                rows.setdefault(kind, []).extend([found] if found else [])
    table = {name: summary(found) for name, found in rows.items()}
    options.out.write_text(json.dumps({"machine": describe(), "summary": table, "rows": rows}, indent=1) + "\n")
    for name, figures in table.items():
        print(name, figures)


if __name__ == "__main__":
    main()
