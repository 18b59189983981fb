"""Planned grasps in the dynamics engine: what share of them it holds and lifts, of six hands on two objects each.

    python -m benchmarks.plan_simulated [--shared ../shared] [--count 10] [--simulate] [--seconds 600]

`plan` looks for grasps that hold 1.5 times the weight from all six sides, with its defaults and a fixed seed. Each
grasp is written to a file, read again, and put under the weight itself, from each side, in `simulate_bodies`: hand and
object as the files that the grasp names have them. A grasp is held if all six end in HOLDS, refused if the engine has
no model of it; else the endings of its loads say what became of it. `--shared` has the Allegro and the Barrett hand as
URDF; without it these are rows that say so.

Each grasp is also exported as a scene that closes the hand, squeezes and lifts (`export --layout mujoco`). The scene is
run: it is lifted if the object ends 0.1 m higher, within a tenth, and is still there 5 s later.

With `--simulate` the plans keep what the engine holds, and what is asked again is whether the files say the same.

Writes results/plan_simulated.json as it goes on; pairs that are there with as many grasps are not done again.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

from benchmarks.machine import describe
from handfast import Loads, load_body, load_grasp, load_hand
from handfast.core.errors import InputError
from handfast.datasets.published.mujoco_scene import HEIGHT, TIMES, play, scene_text
from handfast.planning.plan_grasps import plan
from handfast.planning.results.folder import PlanFolder
from handfast.simulation.result import Ending
from handfast.simulation.simulate import simulate_bodies

RESULTS = Path(__file__).parent / "results" / "plan_simulated.json"
HANDS = {
    "barrett-bh8-280": ("can", "bottle"),
    "schunk-sah": ("can", "mallet"),
    "parallel-gripper": ("egg", "block"),
    "tendon-hand": ("ball", "egg"),
    "shared/hands/allegro_hand/allegro_hand_right.urdf": ("can", "ball"),
    "shared/hands/barrett_hand/bhand_model.urdf": ("can", "mug"),
}
SAFETY, SEED = 1.5, 0
TIMEOUT = 900.0  # [s] for a plan: enough on a machine that does other things, too
SETTLING, KEPT = 0.5, 5.5  # [s] after the lift
HELD, REFUSED = "held", "refused"


def simulated(path: Path, loads: Loads) -> dict[str, str]:
    """How the engine ends under each load, or why it has no model of a grasp."""
    grasp, endings = load_grasp(path), {}
    for name, wrench in loads.by_name.items():
        try:
            endings[name] = str(simulate_bodies(grasp, wrench).ending)
        except InputError as fault:
            endings[name] = f"{REFUSED}: {fault}"
    return endings


def lifted(path: Path) -> bool:
    """Whether the scene of a grasp lifts its object and keeps it for `KEPT`."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(scene_text(load_grasp(path)))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    floor, high = float(data.qpos[2]), []
    for later in (SETTLING, KEPT):
        play(model, data, TIMES["lifted"] + later)
        high.append(float(data.qpos[2]) - floor)
    return all(abs(h - HEIGHT) < HEIGHT / 10 for h in high)


def became(endings: dict[str, str]) -> str:
    """Of a grasp: held, refused, or the ending that was not HOLDS."""
    others = sorted({e.partition(":")[0] for e in endings.values()} - {str(Ending.HOLDS)})
    return others[0] if others else HELD


def row(hand_file: str, thing: str, count: int, simulate: bool) -> dict[str, Any]:
    """One hand on one object."""
    hand, body = load_hand(hand_file), load_body(thing)
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        journal = PlanFolder(Path(folder), hand_file, thing)
        how = {"count": count, "seed": SEED, "timeout": TIMEOUT, "safety": SAFETY, "simulate": simulate}
        planned = plan(hand, body, jobs=1, journal=journal, **how)
        planning = time.process_time() - begin
        loads, grasps = Loads.gravity(body), []
        for g in planned.grasps:
            file = Path(folder) / f"{planned.number(g):03d}.grasp.json"
            endings = simulated(file, loads)
            measured = g.quality.to_json() if g.quality else {}
            about = {"start": g.index, "became": became(endings), "lifted": lifted(file), "endings": endings}
            grasps.append(about | measured)
    told = {"count": count, "starts": planned.tried, "stop": str(planned.stop), "processor_seconds": round(planning, 1)}
    counted = {"became": dict(Counter(g["became"] for g in grasps)), "lifted": sum(g["lifted"] for g in grasps)}
    return told | counted | {"grasps": grasps}


def summary(rows: dict[str, Any]) -> dict[str, Any]:
    """All rows together."""
    counts: Counter[str] = Counter()
    for r in rows.values():
        counts.update(r.get("became", {}))
    total = sum(counts.values())
    up = {key: r["lifted"] for key, r in rows.items() if "lifted" in r}  # rows of before the scenes have none
    scenes = sum(len(rows[key]["grasps"]) for key in up)
    shares = {"share": round(counts[HELD] / total, 3)} if total else {}
    shares |= {"lifted_share": round(sum(up.values()) / scenes, 3)} if scenes else {}
    return {"grasps": total, **counts, "scenes": scenes, "lifted": sum(up.values()), **shares}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="where hands/ with the URDF files is")
    parser.add_argument("--count", type=int, default=10, help="grasps of each pair")
    parser.add_argument("--simulate", action="store_true", help="plan with `simulate`: rows of their own")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin no pair after this")
    parser.add_argument("--output", type=Path, default=RESULTS, help="the file of the results")
    asked, begun = parser.parse_args(), time.monotonic()
    data = json.loads(asked.output.read_text()) if asked.output.exists() else {}
    part = data.setdefault("with simulate" if asked.simulate else "plain", {"rows": {}})
    rows = part["rows"]
    for name, things in HANDS.items():
        file = str(asked.shared.resolve() / name.removeprefix("shared/")) if name.startswith("shared/") else name
        for thing in things:
            key = f"{Path(name).stem} {thing}"
            if rows.get(key, {}).get("count", 0) >= asked.count or time.monotonic() - begun > asked.seconds:
                continue
            try:
                rows[key] = row(file, thing, asked.count, asked.simulate)
            except InputError as fault:
                rows[key] = {"fault": str(fault)}
            part["all"] = summary(rows)
            data |= {"machine": describe(), "safety": SAFETY}
            asked.output.write_text(json.dumps(data, indent=1) + "\n")
            print(key, rows[key].get("became", rows[key]), flush=True)
    print(part.get("all"))


if __name__ == "__main__":
    main()
