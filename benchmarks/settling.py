"""Where do grasps end up that slip? A hundred of them followed, and what Handfast says of where they come to rest.

    python -m benchmarks.settling [--shared ../shared] [--count 100]

Three kinds, in turn, each question drawn from a seed of its own and taken if `check` proves that it slips:

    axis       a bundled grasp under a force along one of its object's axes, 1.15 times what it resists;
    displaced  a bundled grasp's hand, opened a little, closed anew on the object, which stands up to 4 mm and
               10 degrees elsewhere, under the same commands; 1.2 times what it resists in a random direction, 1 N if
               that is nothing;
    closed     a Barrett or an Allegro hand from ../shared closed on an object in a random pose
               (`benchmarks/grasps.py`), pulled as there by 1.2 times what it resists, 1 N if that is nothing. Left out
               where there is no ../shared.

Directions in which any size is resisted, or which are not decided in 5 s, make no question.
Writes results/settling.json as it goes on, and goes on where it was stopped.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.agreement_grasps import axes
from benchmarks.grasps import Rig, bodies, pull, rigs
from benchmarks.machine import describe
from handfast.core import bundled
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.geometry.contacts import contact_grasp
from handfast.geometry.scene import Scene
from handfast.model.grasp import Grasp
from handfast.planning.closing import close
from handfast.readers.grasp_file import load_grasp
from handfast.simulation.settling import GraspInScene, settle
from handfast.stability.answers.answer import finite
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import check, maximum

RESULTS = Path(__file__).parent / "results" / "settling.json"
KINDS = ("axis", "displaced", "closed")
LIMIT = Settings(timeout=5.0, gap=1e-2)
STEPS = 1500
OPEN = 0.05  # [rad] by which fingers open before they close anew

Question = tuple[str, str, GraspInScene, Array]  # kind, name, grasp, wrench


def beyond(grasp: Grasp, direction: Array, factor: float) -> Array | None:
    """(6,) a load that the grasp does not resist, by proof; None if none is found."""
    most = maximum(grasp, direction, settings=LIMIT)
    if most.unbounded or not np.isfinite(most.upper):
        return None
    w = (factor * most.upper if most.lower > 0 else 1.0) * direction
    return w if check(grasp, w, settings=LIMIT).verdict is Verdict.SLIPS else None


def by_axis(first: int) -> Iterator[Question | None]:
    """Bundled grasps, axis by axis."""
    names = [n for n in bundled.names("grasps") if (of := load_grasp(n).provenance) and of.hand and of.configuration]
    for name, axis in [(name, axis) for axis in axes() for name in names][first:]:
        grasp = load_grasp(name)
        w = beyond(grasp, axes()[axis], 1.15)
        yield None if w is None else ("axis", f"{name} {axis}", GraspInScene.of(grasp), w)


def displaced(first_seed: int) -> Iterator[Question | None]:
    """Bundled grasps whose object stands elsewhere."""
    from scipy.spatial.transform import Rotation

    names = [n for n in bundled.names("grasps") if n.startswith("barrett") or n.endswith("coupled")]
    for seed in range(first_seed, 2000):
        name = names[seed % len(names)]
        first, rng = GraspInScene.of(load_grasp(name)), np.random.default_rng([1, seed])
        middle = first.pose[:3, :3] @ first.grasp.positions.mean(axis=0) + first.pose[:3, 3]
        turn = Rotation.from_rotvec(np.radians(10) * ball(rng)).as_matrix()
        pose = transform(middle + 4e-3 * ball(rng), np.eye(3)) @ transform([0, 0, 0], turn)
        pose = pose @ transform(-middle) @ first.pose
        hand = first.hand
        start = hand.configuration(hand.values(np.clip(first.q - OPEN * hand.closing, *hand.limits.T)))
        direction = np.r_[ball(rng), 0, 0, 0]
        direction /= np.linalg.norm(direction)
        try:
            q = close(hand, start, first.body, pose, scene=first.scene).q
            grasp = contact_grasp(
                hand, q, first.body, pose, scene=first.scene, friction=float(first.grasp.mu[0]), name=f"{name} {seed}"
            )
            preload = {n: f for n, f in first.grasp.preload.items() if n in grasp.mechanism.actuators}
            grasp = grasp.with_preload(preload)
            w = beyond(grasp, direction, 1.2)
        except InputError:
            yield None
            continue
        yield None if w is None else ("displaced", grasp.name, GraspInScene(grasp, first.scene, q, pose), w)


def closed_anywhere(shared: Path, first_seed: int) -> Iterator[Question | None]:
    """Real hands closed on objects in random poses."""
    if not (shared / "hands").is_dir():
        return
    choices: list[Rig] = [rig for some in rigs(shared).values() for rig in some]
    things = bodies(shared)
    scenes: dict[tuple[int, int], Scene] = {}
    for seed in range(first_seed, 4000):
        rng = np.random.default_rng([2, seed])
        k, thing = seed % len(choices), int(rng.integers(len(things)))
        found = closing(choices[k], things[thing], rng, scenes, (k, thing))
        if found is None:
            yield None
            continue
        placed, direction = found
        w = beyond(placed.grasp, direction, 1.2)
        yield None if w is None else ("closed", f"{placed.grasp.name} {seed}", placed, w)


def closing(
    rig: Rig, body: Any, rng: np.random.Generator, scenes: dict[tuple[int, int], Scene], key: tuple[int, int]
) -> tuple[GraspInScene, Array] | None:
    """A hand closed on an object, and which way it is pulled; None if three fingers or contacts are not enough."""
    from scipy.spatial.transform import Rotation

    turn = Rotation.random(rng=rng)
    hand, start, pose, friction = rig.drawn(body, turn.as_matrix(), rng)
    scene = scenes.setdefault(key, Scene(hand, body))
    try:
        closed = close(hand, start, body, pose, scene=scene)
        touched = {j for j, why in closed.stopped.items() if why.endswith("touches")}
        preload = {a: 0.3 * f for a, f in rig.command.items() if a in touched}
        grasp = contact_grasp(hand, closed.q, body, pose, preload=preload, friction=friction, scene=scene)
    except InputError:
        return None
    if not 3 <= grasp.m <= 8 or len(preload) < 2:
        return None
    return GraspInScene(grasp, scene, closed.q, pose), pull(rng, grasp, turn.inv().apply(rig.outward))


def ball(rng: np.random.Generator) -> Array:
    """(3,) uniform in the unit ball."""
    x = rng.normal(size=3)
    return x / np.linalg.norm(x) * rng.uniform() ** (1 / 3)


def row_of(kind: str, placed: GraspInScene, w: Array) -> dict[str, Any]:
    """What became of a grasp, in numbers."""
    found = settle(placed, w, steps=STEPS, settings=LIMIT)
    most = None if found.most is None else [found.most.lower, finite(found.most.upper)]
    return {
        "kind": kind, "contacts": placed.grasp.m, "rest": str(found.rest),
        "onset": found.onset, "onset_of": found.onset_of,
        "moved": found.moved, "turned": found.turned, "size": placed.grasp.size, "steps": len(found.path),
        "after": found.to_json()["after"], "simulated": found.simulated or None,
        "most": most, "contacts_after": None if found.last is None else found.last.m,
        "seconds": round(found.seconds, 2),
    }  # fmt: skip


def summary(rows: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Counts by kind: how many come to rest, of how many of these Handfast says that they hold."""
    out: dict[str, Any] = {}
    for kind in ("all", *KINDS):
        of = [r for r in rows.values() if kind in ("all", r["kind"])]
        ended = [r for r in of if r["rest"] in ("settles", "rests")]
        sure = [r for r in ended if r["rest"] == "settles"]
        slid = [r for r in ended if r["onset"] is not None]
        sure_slid = [r for r in slid if r["rest"] == "settles"]
        moved = sorted(1e3 * r["moved"] for r in sure_slid)
        out[kind] = {
            "followed": len(of),
            "endings": dict(Counter(r["rest"] for r in of)),
            "at rest": len(ended),
            "at rest, confirmed": len(sure),
            "at rest after a slip": len(slid),
            "at rest after a slip, confirmed": len(sure_slid),
            "confirmed, and the simulation holds": sum(r["simulated"] == "holds" for r in sure),
            "confirmed after a slip, and holds a hundred times the load": sum(
                bool(r["most"]) and r["most"][0] > 100 for r in sure_slid
            ),
            "confirmed after a slip, and holds 5 % more at most": sum(
                bool(r["most"]) and r["most"][1] is not None and r["most"][1] < 1.05 for r in sure_slid
            ),
            "not confirmed, by check": dict(Counter(r["after"] for r in ended if r["rest"] == "rests")),
            "not confirmed, in the simulation": dict(Counter(r["simulated"] for r in ended if r["rest"] == "rests")),
            "moved [mm], confirmed after a slip: least, median, most": [
                round(moved[k], 2) for k in (0, len(moved) // 2, -1)
            ]
            if moved
            else None,
            "seconds, median": round(float(np.median([r["seconds"] for r in of])), 2) if of else None,
        }
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=Path(__file__).parents[2] / "shared")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument(
        "--seconds", type=float, default=np.inf, help="begin no further round of the three kinds after these"
    )
    options = parser.parse_args()
    begun = time.monotonic()
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {"drawn": dict.fromkeys(KINDS, 0), "rows": {}}
    drawn = data["drawn"]
    makers = (by_axis, displaced, partial(closed_anywhere, options.shared))
    sources = {kind: make(drawn[kind]) for kind, make in zip(KINDS, makers, strict=True)}
    while sources and len(data["rows"]) < options.count and time.monotonic() - begun < options.seconds:
        for kind, source in list(sources.items()):
            question = None
            for question in source:
                drawn[kind] += 1
                if question is not None:
                    break
            if question is None:
                del sources[kind]
                continue
            _, name, placed, w = question
            data["rows"][f"{kind}: {name}"] = row_of(kind, placed, w) | {"wrench": w.tolist()}
            data |= {"machine": describe(), "summary": summary(data["rows"])}
            RESULTS.write_text(json.dumps(data, indent=1) + "\n")
            last = data["rows"][f"{kind}: {name}"]
            print(kind, name, last["rest"], last["after"], last["simulated"], last["seconds"], flush=True)
            if len(data["rows"]) >= options.count:
                break
    data["summary"] = summary(data["rows"])
    RESULTS.write_text(json.dumps(data, indent=1) + "\n")
    print(json.dumps(data["summary"], indent=1))


if __name__ == "__main__":
    main()
