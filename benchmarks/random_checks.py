"""Ten thousand random checks: every HOLDS witnessed, every SLIPS replayed, how many stay open, none contradicted.

    python -m benchmarks.random_checks [--checks 10000] [--peer gurobi] [--sample 200] [--peer-limit 10]

Grasps of 3 to 6 contacts from `grasps.random_case` with seeds of their own (no case chosen by its answer, and
not those of the published set). The disturbance is a pull along the case's direction of 10^u newtons, u uniform
between -1 and 1, which straddles what most of them resist. A HOLDS counts as witnessed if `stability/problem/model`
finds residuals below 1e-9, a SLIPS as replayed if `verify` accepts its certificate. The sample is asked again of
Algorithm 1 (2048 sectors); it is contradicted where both answer and differ. Results are written every 500
checks to results/random_checks.json.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.grasps import random_case
from benchmarks.machine import describe
from handfast.core.answer import Verdict
from handfast.model.grasp import Grasp
from handfast.papers import algorithm1
from handfast.proofs.checker import verify
from handfast.stability.answers import CheckAnswer
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check

RESULTS = Path(__file__).parent / "results" / "random_checks.json"
SIZES = (3, 4, 5, 6)
FIRST_SEED = 100_000
WITNESSED = 1e-9


def question(k: int) -> tuple[Any, np.ndarray]:
    """The k-th grasp and disturbance."""
    case = random_case(SIZES[k % len(SIZES)], FIRST_SEED + k)
    magnitude = 10 ** np.random.default_rng([FIRST_SEED, k]).uniform(-1, 1)
    return case.grasp, magnitude * case.direction


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--checks", type=int, default=10_000)
    parser.add_argument("--limit", type=float, default=20.0, help="[s] per check")
    parser.add_argument("--peer", default="gurobi", choices=("gurobi", "scip"))
    parser.add_argument("--sample", type=int, default=200)
    parser.add_argument("--sample-alone", action="store_true", help="ask only the sample, add it to what was written")
    parser.add_argument("--peer-limit", type=float, default=10.0, help="[s] per check of the sample")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()

    counts: Counter[str] = Counter()
    odd: list[dict[str, Any]] = []  # whatever is not witnessed, not replayed or open
    residuals, nodes, seconds, replays, leaves = [], [], [], [], []
    started, peers = 0, Counter()

    def save() -> None:
        data = {
            "machine": describe(),
            "checks": started,
            "sizes": SIZES,
            "first seed": FIRST_SEED,
            "counts": dict(counts),
            "worst residual": max(residuals, default=None),
            "median residual": float(np.median(residuals)) if residuals else None,
            "nodes": {"median": float(np.median(nodes)), "mean": float(np.mean(nodes)), "worst": int(max(nodes))},
            "seconds": {"median": float(np.median(seconds)), "worst": float(max(seconds))},
            "replay seconds": {"median": float(np.median(replays)), "worst": float(max(replays))} if replays else None,
            "leaves": {"median": float(np.median(leaves)), "worst": int(max(leaves))} if leaves else None,
            "odd": odd,
            "peer": {"solver": args.peer, "limit": args.peer_limit, "counts": dict(peers)},
        }
        args.out.write_text(json.dumps(data, indent=1) + "\n")

    def compare(answer: CheckAnswer, grasp: Grasp, w: np.ndarray) -> None:
        settings = algorithm1.RefinementSettings(solver=args.peer, timeout=args.peer_limit)
        other = algorithm1.check(grasp, w, settings=settings).answer
        both = Verdict.UNDECIDED not in (answer.verdict, other.verdict)
        peers["open"] += other.verdict is Verdict.UNDECIDED
        peers["agrees"] += both and other.verdict is answer.verdict
        peers["contradicts"] += both and other.verdict is not answer.verdict

    every = max(args.checks // max(args.sample, 1), 1)
    if args.sample_alone:
        for k in range(0, args.checks, every):
            grasp, w = question(k)
            compare(check(grasp, w, settings=Settings(timeout=args.limit)), grasp, w)
        peer = {"solver": args.peer, "limit": args.peer_limit, "counts": dict(peers)}
        args.out.write_text(json.dumps(json.loads(args.out.read_text()) | {"peer": peer}, indent=1) + "\n")
        print(dict(peers))
        return
    for k in range(args.checks):
        grasp, w = question(k)
        answer = check(grasp, w, settings=Settings(timeout=args.limit))
        started += 1
        counts[str(answer.verdict)] += 1
        nodes.append(answer.nodes)
        seconds.append(answer.seconds)
        fine = answer.verdict is not Verdict.UNDECIDED
        if answer.verdict is Verdict.HOLDS:
            residuals.append(answer.witness.residuals.worst)
            fine = residuals[-1] <= WITNESSED
            counts["witnessed"] += fine
        elif answer.verdict is Verdict.SLIPS:
            certificate = answer.certificate
            clock = time.perf_counter()
            proof = verify(certificate) if certificate else None
            fine = proof is not None and proof.ok
            counts["replayed"] += fine
            if proof:
                replays.append(time.perf_counter() - clock)
                leaves.append(proof.leaves)
        if not fine:
            odd.append({"k": k, "verdict": answer.verdict, "stop": answer.stop, "nodes": answer.nodes})
        if args.sample and k % every == 0:
            compare(answer, grasp, w)
        if started % 500 == 0:
            save()
            print(started, dict(counts), dict(peers), flush=True)
    save()


if __name__ == "__main__":
    main()
