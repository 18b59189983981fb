"""Regions chosen automatically: how many tasks are proposed and certified, and how many are free of collision.

    python -m benchmarks.propose [--count 5] [--hands NAME ...] [--objects NAME ...] [--kinds pinch tripod power]

Three hands, two of them bundled, with four bundled objects and, if ../shared is there, two YCB objects: pinch and
tripod unless asked otherwise. `tried` are the candidates put to synthesis, `found` those certified, at most as many
as asked for are kept; `clear` by the quick look of `propose`, `free` by `geometry.collision` with its defaults.
Results: benchmarks/results/propose.json, written after every case; a case that is there already is not run again.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from benchmarks.machine import describe
from handfast.geometry.collision import Collisions
from handfast.geometry.guess_regions import regions_of
from handfast.geometry.scene import Scene
from handfast.planning.evaluation.evaluator import requests
from handfast.planning.propose_tasks import Proposals, propose
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

RESULTS = Path(__file__).parent / "results" / "propose.json"
SHARED = Path(__file__).parents[2] / "shared"
HANDS = {
    "schunk-sah": "schunk-sah",
    "barrett-bh8-280": "barrett-bh8-280",
    "allegro": str(SHARED / "hands" / "allegro_hand" / "allegro_hand_right.urdf"),
}
YCB = ("tomato_soup_can", "mustard_bottle")
OBJECTS = {name: name for name in ("flask", "jar", "slab", "teapot")}
OBJECTS |= {name: str(SHARED / "objects" / "ycb" / f"{name}.obj") for name in YCB}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5)
    parser.add_argument("--hands", nargs="*", default=list(HANDS))
    parser.add_argument("--objects", nargs="*", default=list(OBJECTS))
    parser.add_argument("--kinds", nargs="*", default=["pinch", "tripod"])
    asked = parser.parse_args()
    known = json.loads(RESULTS.read_text("utf-8"))["rows"] if RESULTS.exists() else []
    done = {(r["hand"], r["object"], r["kind"]) for r in known}
    for name in asked.hands:
        if name == "allegro" and not SHARED.is_dir():
            continue
        hand = load_hand(HANDS[name])
        regions = regions_of(hand)
        for thing in asked.objects:
            if thing in YCB and not SHARED.is_dir():
                continue
            body = load_body(OBJECTS[thing])
            for kind in asked.kinds:
                if (name, thing, kind) in done:
                    continue
                found = propose(hand, regions, body, kind, count=asked.count)
                row = {"hand": name, "object": thing, "kind": kind} | measured(found, Collisions(Scene(hand, body)))
                known.append(row)
                print({k: v for k, v in row.items() if k != "dropped"}, flush=True)
                RESULTS.write_text(json.dumps({"machine": describe(), "rows": known}, indent=1) + "\n", "utf-8")


def measured(found: Proposals, collisions: Collisions) -> dict[str, Any]:
    """What a benchmark row says of proposals."""
    free = 0
    for proposal in found.proposals:
        (solution,) = proposal.answer.solutions
        free += collisions.clearances(solution.q, solution.pose, requests(solution)).free()
    dropped = found.to_json()["dropped"]
    kept = len(found.proposals)
    behind = sum(d["count"] for d in dropped if d["reason"] == "certified, but behind the best")
    return {
        "tried": found.tried,
        "found": kept + behind,
        "kept": kept,
        "clear": sum(p.clear for p in found.proposals),
        "free": free,
        "seconds": round(found.seconds, 1),
        "dropped": dropped,
    }


if __name__ == "__main__":
    main()
