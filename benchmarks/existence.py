"""Ten thousand certified configurations, checked again by the independent checker, and a thousand planted wrong ones.

    python -m benchmarks.existence [--solutions 10000] [--wrong 1000]

The configurations are what random starts find (seed 1, block by block), spread evenly over the tasks that have any.
Every one must be accepted. Then proofs are spoilt in the ways of `SPOILT`, each so that it is known to be wrong
without asking the checker; none may be accepted. Written after every task to results/existence.json; tasks that
are there are not repeated.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from benchmarks.tasks import Others, load_text, origin, tasks
from handfast.model.region import Bezier, Region
from handfast.proofs.configurations import Existence
from handfast.synthesis.search.starts import Starts
from handfast.synthesis.solution import Solution, verify_existence
from handfast.synthesis.task import PoseBounds, Task
from handfast.synthesis.task_problem import TaskProblem

RESULTS = Path(__file__).parent / "results" / "existence.json"
SEED = 1
BARREN = 12  # blocks of starts without a configuration before a task is left out
OFF = 1e-4  # [m] a contact open by this is beyond the reach of boxes of 1e-5
Wrong = tuple[Task, Existence]


def proofs(task: Task, count: int) -> list[Existence]:
    """Of the first configurations that random starts find; [] if there are none."""
    problem = TaskProblem.of(task)
    starts = Starts(problem, SEED)
    found: list[Existence] = []
    while len(found) < count and (found or starts.block < BARREN):
        found += [c.existence(problem) for c in starts.run(count - len(found))]
    return found


def open_by(task: Task, proof: Existence) -> float:
    """[m] the largest distance of the two contact points at the floats, in plain floating point."""
    s = Solution.of(task, proof)
    links, worst = task.hand.link_poses(s.q), 0.0
    for pair, spot, point, normal in zip(task.contact_pairs, proof.contacts, s.points, s.normals, strict=True):
        T = links[task.hand.link(pair.link)]
        if ball := pair.hand.ball:
            here = T[:3, :3] @ ball.center + T[:3, 3] + ball.sign * ball.radius * normal
        else:
            here = T[:3, :3] @ pair.hand.at(*spot.hand) + T[:3, 3]
        worst = max(worst, float(np.linalg.norm(here - point)))
    return worst


# --- ways to be wrong -------------------------------------------------------------------------------


def with_coordinate(proof: Existence, label: str, value: float) -> Existence:
    kind, *at = label.split(":")
    if kind == "joint":
        return replace(proof, joints=dict(proof.joints) | {at[0]: value})
    if kind in ("position", "quaternion"):
        array = getattr(proof, kind).copy()
        array[int(at[0])] = value
        return replace(proof, **{kind: array})
    k, contacts = int(at[0]), list(proof.contacts)
    side = "object" if at[1] in "st" else "hand"
    pair = list(getattr(contacts[k], side))
    pair["stuv".index(at[1]) % 2] = value
    contacts[k] = replace(contacts[k], **{side: tuple(pair)})
    return replace(proof, contacts=tuple(contacts))


def moved(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong | None:
    """A coordinate is another one, so that a contact is open."""
    label = str(rng.choice(list(proof.coordinates)))
    by = float(rng.choice([-1, 1]) * rng.uniform(0.01, 0.1))
    wrong = with_coordinate(proof, label, proof.coordinates[label] + by)
    return (task, wrong) if open_by(task, wrong) > OFF else None


def moved_out_of_its_box(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong | None:
    """A dependent coordinate is off by a hundred radii: the solution, alone nearby, is outside."""
    i = int(rng.integers(len(proof.dependent)))
    label = proof.dependent[i]
    return task, with_coordinate(proof, label, proof.coordinates[label] + 100 * float(proof.radii[i]))


def turned(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong | None:
    """A component of the quaternion has the other sign."""
    i = int(rng.integers(4))
    wrong = with_coordinate(proof, f"quaternion:{i}", -float(proof.quaternion[i]))
    return (task, wrong) if open_by(task, wrong) > OFF else None


def limit(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong | None:
    """A joint is beyond a limit by 1e-4."""
    q, joints = Solution.of(task, proof).q, list(task.hand.joints)
    free = [j for j in task.moving if joints[j].lower < joints[j].upper]
    j = int(rng.choice(free))
    low, high = joints[j].lower, joints[j].upper
    ends = {"upper": float(q[j]) - 1e-4} if rng.random() < 0.5 else {"lower": float(q[j]) + 1e-4}
    if not (low < ends.get("upper", high) and ends.get("lower", low) < high):
        return None
    joints[j] = replace(joints[j], **ends)
    return replace(task, hand=replace(task.hand, joints=tuple(joints))), proof


def position(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong:
    """The object is beyond a bound of its position by 1e-4."""
    bounds, i = task.pose.position.copy(), int(rng.integers(3))
    bounds[i] = [proof.position[i] + 1e-4, proof.position[i] + 1.0]
    return replace(task, pose=PoseBounds(bounds, task.pose.axes)), proof


def axis(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong | None:
    """A component of an axis of the object is beyond a bound by 1e-3."""
    R, axes = Solution.of(task, proof).pose[:3, :3], task.pose.axes.copy()
    k, i = (int(x) for x in rng.integers(3, size=2))
    if R[i, k] > 0.9:
        return None
    axes[k, i] = [R[i, k] + 1e-3, 1.0]
    return replace(task, pose=PoseBounds(task.pose.position, axes)), proof


def with_touch(task: Task, k: int, **changes: Any) -> Task:
    pairs = list(task.contact_pairs)
    pairs[k] = replace(pairs[k], **changes)
    return replace(task, contact_pairs=tuple(pairs))


def normal(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong:
    """A region's outward normal is the other one."""
    k = int(rng.integers(len(task.contact_pairs)))
    side = str(rng.choice(["hand", "object"]))
    region = getattr(task.contact_pairs[k], side)
    return with_touch(task, k, **{side: replace(region, flip=not region.flip)}), proof


def region(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong:
    """The object's region is a millimetre further along its normal."""
    k = int(rng.integers(len(task.contact_pairs)))
    here = task.contact_pairs[k].object
    along = here.outward(*proof.contacts[k].object) * 1e-3
    if isinstance(here, Bezier):
        further: Region = replace(here, points=here.points + along)
    else:
        further = replace(here, center=here.center + along)
    return with_touch(task, k, object=further), proof


def cone(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong | None:
    """The hand's cap ends before the contact."""
    s = Solution.of(task, proof)
    cones = [k for k in range(len(task.contact_pairs)) if f"contact:{k}:cone" in s.slacks]
    if not cones:
        return None
    k = int(rng.choice(cones))
    cap = task.contact_pairs[k].hand
    ends = cap.half_angle - s.slacks[f"contact:{k}:cone"] - 1e-3
    return (with_touch(task, k, hand=replace(cap, half_angle=ends)), proof) if ends > 0 else None


def label(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong:
    """A dependent coordinate is named twice, unknown or left out."""
    labels, i = list(proof.dependent), int(rng.integers(len(proof.dependent)))
    how = int(rng.integers(3))
    if how == 0:
        labels[i] = labels[i - 1]
    elif how == 1:
        labels[i] = str(rng.choice(["joint:none", "contact:9:s", "position:3", ""]))
    else:
        return task, replace(proof, dependent=tuple(labels[:i] + labels[i + 1 :]), radii=np.delete(proof.radii, i))
    return task, replace(proof, dependent=tuple(labels))


def small(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong:
    """Boxes smaller than the rounding of their middles."""
    return task, replace(proof, radii=proof.radii * 1e-13)


def large(task: Task, proof: Existence, rng: np.random.Generator) -> Wrong:
    """Boxes of 2 units each way: beyond every patch, so not strictly inside."""
    return task, replace(proof, radii=np.full(len(proof.radii), 2.0))


SPOILT: dict[str, Callable[[Task, Existence, np.random.Generator], Wrong | None]] = {
    "a coordinate moved, a contact open": moved,
    "a dependent coordinate moved by 100 radii": moved_out_of_its_box,
    "a sign in the quaternion": turned,
    "beyond a joint limit": limit,
    "beyond a bound of the position": position,
    "beyond a bound of an axis": axis,
    "a normal flipped": normal,
    "a region moved by 1 mm": region,
    "outside of a hand cap": cone,
    "a label twice, unknown, missing": label,
    "boxes below the rounding": small,
    "boxes beyond the regions": large,
}
OTHER = "the proof of another task"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--solutions", type=int, default=10_000)
    parser.add_argument("--wrong", type=int, default=1_000)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    data = json.loads(args.out.read_text()) if args.out.exists() else {}
    rows: dict[str, Any] = data.get("tasks", {})
    everything = tasks()
    some = {name: proofs(task, 20) for name, task in everything.items()}
    fruitful = [name for name, found in some.items() if found]

    def save(**more: Any) -> None:
        seconds = [r["ms"] for r in rows.values() if "ms" in r]
        accepted, refused = (sum(r[k] for r in rows.values()) for k in ("accepted", "refused"))
        totals = {"configurations": accepted + refused, "accepted": accepted, "refused": refused}
        ms = {k: max(s[k] for s in seconds) for k in ("median", "95 %", "worst")} if seconds else None
        kept = {"wrong": data["wrong"]} if "wrong" in data else {}
        head = {"machine": describe(), "load": load_text(rows.values()), **totals, "largest ms of a task": ms}
        args.out.write_text(json.dumps(head | {"tasks": rows} | kept | more, indent=1) + "\n")

    for i, name in enumerate(fruitful):
        count = args.solutions * (i + 1) // len(fruitful) - args.solutions * i // len(fruitful)
        if name in rows:
            continue
        task, times, counts, faults, others = everything[name], [], Counter[bool](), [], Others()
        for k, proof in enumerate(proofs(task, count)):
            clock = time.perf_counter()
            report = verify_existence(task, proof)
            times.append(1e3 * (time.perf_counter() - clock))
            counts[report.ok] += 1
            if not report.ok:
                faults.append({"k": k, "reason": report.reason})
        ms = {"median": float(np.median(times)), "95 %": float(np.percentile(times, 95)), "worst": max(times)}
        found = {"accepted": counts[True], "refused": counts[False], "faults": faults}
        rows[name] = found | {"ms": ms, "busy": others.busy()}
        save()
        print(name, dict(counts), ms, flush=True)

    rng = np.random.default_rng(SEED)
    tried, accepted, kinds = Counter[str](), Counter[str](), [*SPOILT, OTHER]
    while sum(tried.values()) < args.wrong:
        kind = kinds[sum(tried.values()) % len(kinds)]
        name = fruitful[int(rng.integers(len(fruitful)))]
        proof = some[name][int(rng.integers(len(some[name])))]
        if kind == OTHER:
            name = str(rng.choice([n for n in fruitful if origin(n) != origin(name)]))
            spoilt: Wrong | None = everything[name], proof
        else:
            spoilt = SPOILT[kind](everything[name], proof, rng)
        if spoilt is None:
            continue
        tried[kind] += 1
        accepted[kind] += verify_existence(*spoilt).ok
    wrong = {kind: {"planted": tried[kind], "accepted": accepted[kind]} for kind in kinds}
    save(wrong=wrong | {"all": {"planted": sum(tried.values()), "accepted": sum(accepted.values())}})
    print(json.dumps(wrong, indent=1))


if __name__ == "__main__":
    main()
