"""The planner on hands that nobody prepared: what `plan` finds within two minutes, or why it finds nothing.

Every hand is loaded as its file stands, with no option but the link that it begins at where the file is a whole scene.
Masses of the six YCB objects as in real_hands.py, friction 0.5, the planner's defaults and a fixed seed: ten distinct
grasps are asked for that hold the weight from all six sides. Each grasp that is found is written to a file, read again,
and checked under every load it was planned for; `contradicted` counts those that do not hold then.

The hands are other people's and are not in the repository: `--hands` is a folder that has MuJoCo Menagerie
(github.com/google-deepmind/mujoco_menagerie) as `menagerie`, the assets of gymnasium-robotics as `gymnasium` and
dex-urdf (github.com/dexsuite/dex-urdf) as `dex-urdf`; `--shared` has Barrett and Allegro hands and the objects. A hand
that is not there or cannot be read is a row with the reason.

Times on a busy machine mean little: processor seconds over the cores are what a free one would take.

    python -m benchmarks.plan_hands --hands FOLDER --shared ../shared --results benchmarks/results/plan_hands.json

Resumable: pairs that were planned for already are not done again, those that were refused are.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.machine import describe
from benchmarks.plan_ycb import processor
from benchmarks.real_hands import FRICTION, MASSES
from handfast import Verdict, check, load_body, load_hand
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.hand import Hand
from handfast.planning.plan_grasps import plan
from handfast.planning.results.plan import Plan
from handfast.readers.grasp_file import load_grasp, save_grasp

HERE = Path(__file__).parent
HANDS = {
    "shadow": "menagerie/shadow_hand/right_hand.xml",
    "shadow-gym": "gymnasium/hand/reach.xml",
    "shadow-urdf": "dex-urdf/robots/hands/shadow_hand/shadow_hand_right.urdf",
    "adroit": "gymnasium/adroit_hand/adroit_relocate.xml#forearm",
    "allegro": "shared/hands/allegro_hand/allegro_hand_right.urdf",
    "barrett": "shared/hands/barrett_hand/bhand_model.urdf",
    "leap": "dex-urdf/robots/hands/leap_hand/leap_hand_right.urdf",
    "inspire": "dex-urdf/robots/hands/inspire_hand/inspire_hand_right.urdf",
    "ability": "dex-urdf/robots/hands/ability_hand/ability_hand_right.urdf",
    "svh": "dex-urdf/robots/hands/schunk_hand/schunk_svh_hand_right.urdf",
    "dclaw": "dex-urdf/robots/hands/dclaw_gripper/dclaw_gripper.urdf",
    "franka": "menagerie/franka_emika_panda/hand.xml",
    "2f85": "menagerie/robotiq_2f85/2f85.xml",
    "xarm7": "menagerie/ufactory_xarm7/hand.xml",
    "parallel-gripper": "parallel-gripper",
}
COUNT = 10
SEED = 0
TIMEOUT = 120.0  # [s] wall time for a pair
NAMED = 3  # overlaps of a reason


def located(source: str, hands: Path, shared: Path) -> str:
    """Where a hand's file is; a bundled name as it is."""
    if "/" not in source:
        return source
    first, rest = source.split("/", 1)
    return str(shared / rest if first == "shared" else hands / source)


def contradicted(planned: Plan, folder: Path) -> int:
    """How many grasps do not hold one of their loads by what their own file says."""
    wrong = 0
    for g in planned.grasps:
        path = folder / f"{g.index}.grasp.json"
        save_grasp(g.grasp, path)
        again = load_grasp(path)
        wrong += any(check(again, w).verdict is not Verdict.HOLDS for w in planned.loads.wrenches)
    return wrong


def run(hand: Hand, body: Body, timeout: float, **others: Any) -> dict[str, Any]:
    """One pair; `others` are options of `plan`."""
    before = processor()
    planned = plan(hand, body, count=COUNT, seed=SEED, timeout=timeout, **others)
    used = processor() - before
    with tempfile.TemporaryDirectory() as folder:
        wrong = contradicted(planned, Path(folder))
    overlaps = {
        str(reason): [
            {"links": list(pair), "starts": count, "deepest_mm": round(1e3 * depth, 2)}
            for pair, (count, depth) in sorted(some.overlaps.items(), key=lambda item: -item[1][0])[:NAMED]
        ]
        for reason, some in planned.tally.rejected.items()
        if some.overlaps
    }
    return {
        "found": len(planned.grasps),
        "contradicted": wrong,
        "stop": str(planned.stop),
        "starts": planned.tried,
        "timeout": timeout,
        "seconds": round(planned.seconds, 1),
        "processor_seconds": round(used, 1),
        "approach": [round(x, 3) for x in planned.asked.palm.axis.tolist()],
        "closing": {n: int(s) for n, s in zip(hand.joint_names, hand.closing, strict=True) if s},
        "contacts": sorted(g.grasp.m for g in planned.grasps),
        "rejected": {str(reason): some.count for reason, some in planned.tally.rejected.items()},
        "overlaps": overlaps,
        "diagnosis": planned.diagnosis,
    }


def row(pair: str, options: argparse.Namespace) -> dict[str, Any]:
    """One pair, or why there is none."""
    name, thing = pair.split("_", 1)
    try:
        hand = load_hand(located(options.also.get(name) or HANDS[name], options.hands, options.shared))
        hand = hand.with_laws(options.joint_laws)
        body = load_body(options.shared / "objects" / "ycb" / f"{thing}.obj", mass=MASSES[thing], friction=FRICTION)
        more = {"attempts": options.starts, "jobs": options.jobs}
        return {"pair": pair, "joint_laws": options.joint_laws} | run(hand, body, options.timeout, **more)
    except InputError as fault:
        return {"pair": pair, "refused": fault.problem}


def table(rows: list[dict[str, Any]]) -> str:
    """The summary in Markdown."""
    lines = ["| pair | found | contradicted | starts | processor s | most were rejected as |", "|" + " --- |" * 6]
    for r in rows:
        pair = r["pair"].replace("_", " ")
        if "refused" in r:
            lines.append(f"| {pair} | - | - | - | - | {r['refused']} |")
            continue
        reasons = sorted(r["rejected"].items(), key=lambda item: -item[1])[:2]
        why = "; ".join(f"{count} {reason}" for reason, count in reasons)
        cells = [pair, r["found"], r["contradicted"], r["starts"], r["processor_seconds"], why]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hands", type=Path, required=True, help="folder of the hands, see above")
    parser.add_argument("--shared", type=Path, default=HERE.parents[1] / "shared")
    parser.add_argument("--results", type=Path, default=HERE / "results" / "plan_hands.json")
    parser.add_argument("--only", default="", metavar="TEXT", help="pairs whose name contains this")
    parser.add_argument("--timeout", type=float, default=TIMEOUT, metavar="S", help="of a pair")
    parser.add_argument("--joint-laws", default="stops,springs", help="all, none, or some of stops,friction,springs")
    parser.add_argument("--starts", type=int, default=100_000, metavar="N", help="of a pair, at most")
    parser.add_argument("--jobs", type=int, default=None, metavar="N", help="processes; one a core")
    parser.add_argument("--also", nargs=2, action="append", default=[], metavar=("NAME", "PATH"), help="one more hand")
    parser.add_argument("--again", action="store_true", help="do pairs again that the results hold already")
    options = parser.parse_args()
    if not options.hands.is_dir():
        print(f"{options.hands}: no such folder; give --hands", file=sys.stderr)
        return 2
    options.also = dict(options.also)
    data: dict[str, Any] = {"rows": []}
    if options.results.exists():
        data = json.loads(options.results.read_text("utf-8"))
    rows = {r["pair"]: r for r in data["rows"]}
    pairs = [f"{hand}_{thing}" for hand in (*HANDS, *options.also) for thing in MASSES]
    for pair in (p for p in pairs if options.only in p):
        if "found" in rows.get(pair, {}) and not options.again:
            continue
        rows[pair] = r = row(pair, options)
        said = r.get("refused") or f"{r['found']} of {r['starts']} starts in {r['seconds']} s"
        print(f"{pair}: {said}", file=sys.stderr, flush=True)
        known = [rows[p] for p in pairs if p in rows] + [r for p, r in rows.items() if p not in pairs]
        asked = {"count": COUNT, "seed": SEED, "friction": FRICTION, "timeout": options.timeout}
        data = asked | {"machine": describe(), "rows": known}
        options.results.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    print(table(data["rows"]))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
