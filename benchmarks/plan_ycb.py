"""The planner on real hands and real objects: twenty distinct grasps per pair that hold the weight from six sides.

Two hands (Barrett BH8-280, Allegro right) times six YCB objects, masses as in real_hands.py, friction 0.5, the
planner's defaults and a fixed seed. The Barrett URDF has no mimic joints: its distal joints are motors of their own
as it stands, and the two spread joints, which one motor turns, are coupled here. Every grasp that was kept is placed
and measured again in a scene of its own: overlaps of hand and object and of two links, contacts.

`one_side` asks the same starts for the weight with gravity along -z alone: how much six directions ask.

Times on a busy machine mean little: processor seconds over the cores are what a free one would take.

    python -m benchmarks.plan_ycb --shared ../shared --results benchmarks/results/plan_ycb.json

Resumable: pairs that the results hold already are not done again.
"""

from __future__ import annotations

import argparse
import json
import resource
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from benchmarks.real_hands import FRICTION, MASSES
from handfast import find_contacts, load_body, load_hand
from handfast.geometry.collision import always_meeting
from handfast.geometry.scene import Scene
from handfast.model.body import Body
from handfast.model.hand import Coupling, Hand
from handfast.model.hand.hand import coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.planning.plan_grasps import plan
from handfast.planning.results.plan import Plan
from handfast.planning.search import RejectionReason
from handfast.stability.problem.loads import Loads

HERE = Path(__file__).parent
HANDS = {
    "barrett": "hands/barrett_hand/bhand_model.urdf",
    "allegro": "hands/allegro_hand/allegro_hand_right.urdf",
}
COUNT = 20
SEED = 0
TIMEOUT = 1800.0  # [s] wall time for a pair
SPREADS = ("finger_1_prox_joint", "finger_2_prox_joint")


def hand_named(shared: Path, name: str) -> Hand:
    """The hand; the Barrett's spreads tied together, and no closing joints."""
    hand = load_hand(shared / HANDS[name])
    if name != "barrett":
        return hand
    first, second = (hand.joint(j) for j in SPREADS)
    couplings = (Coupling(second, first, -1.0),)
    kept = [i for i, n in enumerate(hand.mechanism.actuators) if n != SPREADS[1]]
    mechanism = Mechanism(
        tuple(hand.mechanism.actuators[i] for i in kept),
        hand.mechanism.R[kept],
        coupling_rows(couplings, hand.l),
        (False,) * len(kept),
    )
    return replace(hand, couplings=couplings, mechanism=mechanism).with_closing(dict.fromkeys(SPREADS, 0))


def measured(hand: Hand, body: Body, planned: Plan) -> list[dict[str, Any]]:
    """Every kept grasp, looked at again."""
    scene = Scene(hand, body)
    watched = np.array([pair not in always_meeting(scene) for pair in scene.self_pairs])
    rows = []
    for g in planned.grasps:
        links, between = scene.clearances(g.q, g.pose)
        contacts = find_contacts(hand, g.q, body, g.pose, scene=scene)
        rows.append(
            {
                "attempt": g.index,
                "contacts": len(contacts),
                "links": sorted({c.link for c in contacts}),
                "preload": {n: round(v, 5) for n, v in g.grasp.preload.items()},
                "penetration_mm": round(1e3 * max(0.0, -links.min(), *(c.depth for c in contacts)), 5),
                "self_penetration_mm": round(1e3 * max(0.0, -between[watched].min(initial=0.0)), 5),
                "worst_residual": max(a.witness.residuals.worst for a in g.answer.checks if a.witness),
            }
        )
    return rows


def run(shared: Path, hand_name: str, thing: str) -> dict[str, Any]:
    """One pair."""
    hand = hand_named(shared, hand_name)
    body = load_body(shared / "objects" / "ycb" / f"{thing}.obj", mass=MASSES[thing], friction=FRICTION)
    before = processor()
    planned = plan(hand, body, count=COUNT, seed=SEED, timeout=TIMEOUT)
    used = processor() - before
    rows = measured(hand, body, planned)
    return {
        "pair": f"{hand_name}_{thing}",
        "found": len(planned.grasps),
        "stop": str(planned.stop),
        "seconds": round(planned.seconds, 1),
        "processor_seconds": round(used, 1),
        "tried": planned.tried,
        "fates": planned.to_json()["fates"],
        "penetration_mm": max((r["penetration_mm"] for r in rows), default=None),
        "self_penetration_mm": max((r["self_penetration_mm"] for r in rows), default=None),
        "contacts": sorted(r["contacts"] for r in rows),
        "without_preload": sum(not r["preload"] for r in rows),
        "grasps": rows,
    }


def one_side(shared: Path, record: dict[str, Any]) -> dict[str, Any]:
    """How many of a pair's starts hold the weight along -z alone, and all six ways."""
    hand_name, thing = record["pair"].split("_", 1)
    hand = hand_named(shared, hand_name)
    body = load_body(shared / "objects" / "ycb" / f"{thing}.obj", mass=MASSES[thing], friction=FRICTION)
    tried = record["tried"]
    planned = plan(
        hand, body, count=tried, attempts=tried, seed=SEED, timeout=TIMEOUT, loads=Loads.gravity(body, ["-z"])
    )
    holding = planned.tally.passed + planned.tally[RejectionReason.ALIKE]
    return {"starts": planned.tried, "one": holding, "six": record["fates"]["kept"] + record["fates"]["alike"]}


def processor() -> float:
    """[s] of the processor that this process and those it waited for have used."""
    return sum(
        u.ru_utime + u.ru_stime for u in map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    )


def table(records: list[dict[str, Any]]) -> str:
    """The summary in Markdown."""
    head = [
        "pair",
        "found",
        "starts",
        "seconds",
        "processor s",
        "contacts",
        "no preload",
        "overlap [mm]",
        "hold -z : six",
    ]
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for r in records:
        contacts = f"{r['contacts'][0]}-{r['contacts'][-1]}" if r["contacts"] else "-"
        overlap = max(r["penetration_mm"] or 0.0, r["self_penetration_mm"] or 0.0)
        sides = f"{r['one_side']['one']} : {r['one_side']['six']}" if "one_side" in r else "-"
        cells = [r["pair"].replace("_", " "), r["found"], r["tried"], r["seconds"], r["processor_seconds"], contacts]
        cells += [r["without_preload"], f"{overlap:.4f}", sides]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shared", type=Path, default=HERE.parents[1] / "shared")
    parser.add_argument("--results", type=Path, default=HERE / "results" / "plan_ycb.json")
    parser.add_argument("--only", default="", metavar="TEXT", help="pairs whose name contains this")
    parser.add_argument("--one-side", action="store_true", help="also ask for the weight along -z alone")
    parser.add_argument("--again", action="store_true", help="do pairs again that the results hold already")
    options = parser.parse_args()
    if not (options.shared / "hands").is_dir():
        print(f"{options.shared}: no folder hands/ in it; give --shared", file=sys.stderr)
        return 2
    data: dict[str, Any] = {"rows": []}
    if options.results.exists():
        data = json.loads(options.results.read_text("utf-8"))
    rows = {r["pair"]: r for r in data["rows"]}
    pairs = [f"{hand}_{thing}" for hand in HANDS for thing in MASSES]
    for pair in pairs:
        if options.only not in pair:
            continue
        if pair not in rows or options.again:
            rows[pair] = run(options.shared, *pair.split("_", 1))
        if options.one_side and "one_side" not in rows[pair]:
            rows[pair]["one_side"] = one_side(options.shared, rows[pair])
        r = rows[pair]
        print(f"{pair}: {r['found']} of {r['tried']} in {r['seconds']} s", file=sys.stderr, flush=True)
        data = {
            "count": COUNT,
            "seed": SEED,
            "friction": FRICTION,
            "machine": describe(),
            "rows": [rows[p] for p in pairs if p in rows],
        }
        options.results.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    print(table([rows[p] for p in pairs if p in rows]))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
