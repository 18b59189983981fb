"""A published set audited: what passes its own test, what holds here, and which measure tells one from the other.

    python -m benchmarks.dataset_audit bundled [--allegro HAND.urdf] [--count 1000]
    python -m benchmarks.dataset_audit published --bench ../DexGraspBench [--count 200] [--hand right_hand.xml]
    python -m benchmarks.dataset_audit paths --bench ../DexGraspBench         # of what was audited: loads on paths
    python -m benchmarks.dataset_audit friction --files dataset/*.npy --hand right_hand.xml --objects meshdata
    python -m benchmarks.dataset_audit summary                                # counts and areas anew from what is there
    python -m benchmarks.dataset_audit tables                                 # those of docs/dataset-audit.md

`bundled`: the repository's own thousand grasps, made again from their seeds; those of the Allegro hand need its URDF.
Their test is a simulation of the contacts (`simulate`) under the weight from six sides, ended by the first failure. It
is passed as DexGraspBench has it: moved by less than 5 cm and 15 degrees, slow or at rest at the end.

`published`: files of DexGraspBench's layout, of a user's copy with the hand's meshes, put to the project's own test
(`bench_protocol.py`). Contacts, joints and commands here are those that the simulated hand has after its squeeze.

`friction`: files of any layout, without commands, as DexGraspNet's, which were validated at friction 3. Of the imported
grasps: do *some* forces at the contacts balance the weight from six sides, at which coefficients? No hand holds what
none balance.

Of each grasp of the first two: does it hold all six loads here, at several coefficients of friction, with the laws of
joints that the hand's file has and without, how many times as much does it resist in the worst of the six, and all
classical measures. Writes results/dataset_audit.json as it goes
on, and goes on where it was stopped. `docs/make_audit_picture.py` draws it.
"""

from __future__ import annotations

import argparse
import gzip
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.audit_summary import MEASURES, OURS, summary
from benchmarks.audit_tables import tables
from benchmarks.bench_protocol import FAR, FRICTION, MASS, PUSH, TURNED, GraspBench, Settled, recorded
from benchmarks.grasp_dataset import BUNDLED, postures_of, runner
from benchmarks.machine import describe
from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.datasets.dataset_rows import GraspChanges, PosedRow
from handfast.datasets.published.importing import Importer, Treatment, imported
from handfast.datasets.published.mapping_file import mapping_for
from handfast.datasets.published.published_file import sources
from handfast.datasets.scene_source import SceneSource
from handfast.geometry.contact_patch import reduced_contacts
from handfast.geometry.contacts import grasp_of
from handfast.measures.conic_program import smallest_forces
from handfast.measures.measuring import measure_columns
from handfast.measures.wrench_scale import WrenchScale
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.hand import Hand
from handfast.model.servo import servo_commands
from handfast.proofs.constants import MAX_GRASP_SIZE
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.simulation.result import Ending
from handfast.simulation.simulate import simulate
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.batch import max_many
from handfast.stability.studies.questions import check

RESULTS = Path(__file__).parent / "results" / "dataset_audit.json"
FRICTIONS = (0.3, 0.6, 1.0, 3.0, 10.0)  # Dexonomy's hard test, DexGraspBench, GraspQP, DexGraspNet, GenDexGrasp
LIMIT = Settings(nodes=6000, timeout=12.0, gap=1e-2, verify=False)
BRIEF = Settings(nodes=1000, timeout=4.0, verify=False)  # for frictions other than the grasp's own
ON_PATH = Settings(timeout=8.0, gap=1e-2, verify=False)
STEP = 5  # grasps between two times of writing
FAST = 4.0  # [s of the twin] over which the load of a simulation grows
SIDES = np.repeat(np.eye(3), 2, axis=0) * np.tile([-1.0, 1.0], 3)[:, None]  # −x, +x, −y, ...
DIGITS = 4
SHADOW = "assets/hand/shadow/right_hand.xml"
GRASPS = "output/example_shadow/graspdata"


# --- what is asked of each grasp ------------------------------------------------------------------


def verdict(grasp: Grasp, load: Array, settings: Settings = LIMIT) -> Verdict:
    """What `check` says; SLIPS as well where it refuses the load, as no forces at so few contacts balance it."""
    if np.linalg.matrix_rank(grasp.G, tol=1e-9) < np.linalg.matrix_rank(np.c_[grasp.G, load], tol=1e-9):
        return Verdict.SLIPS
    return check(grasp, load, settings=settings).verdict


def held(grasp: Grasp, loads: Array, settings: Settings = LIMIT) -> str:
    """Does it hold all loads (n, 6)? "holds", "slips" or "undecided"."""
    unsure = False
    for load in loads:
        said = verdict(grasp, load, settings)
        if said is Verdict.SLIPS:
            return "slips"
        unsure |= said is not Verdict.HOLDS
        if unsure and settings is BRIEF:
            break
    return "undecided" if unsure else "holds"


def held_on_path(grasp: Grasp, loads: Array) -> str:
    """The same with the load after the commands; "no squeeze" where the commands alone have no state."""
    unsure = False
    for load in loads:
        answer = check(grasp, load, loading="preload-first", settings=ON_PATH)
        if answer.verdict is Verdict.SLIPS:
            assert isinstance(answer.path, LoadPath)
            return "no squeeze" if answer.path.reached is None else "slips"
        unsure |= answer.verdict is not Verdict.HOLDS
    return "undecided" if unsure else "holds"


def asked(grasp: Grasp, loads: Array, least: Array) -> dict[str, Any]:
    """Verdicts at each friction; at its own all measures, and the margin: the least of the multiples that hold."""
    loads = loads[np.argsort(least)]  # the first that slips decides
    at = {f"{mu:g}": held(grasp.with_friction(mu), loads, BRIEF) for mu in FRICTIONS}
    found = measure_columns(grasp, only=list(MEASURES))
    values = {OURS: float(least.min())} | {k: v for k, v in found.items() if k in MEASURES and v is not None}
    own = {"own": held(grasp, loads), "preload alone": held(grasp, np.zeros((1, 6)))}
    return {"contacts": grasp.m, "here": own | at, "measures": {k: short(v) for k, v in values.items()}}


def without_laws(grasp: Grasp, loads: Array) -> dict[str, str]:
    """Verdicts where joints neither rub nor stand at stops, nor have springs."""
    joints = [replace(j, friction=0.0, torque=0.0, stop="") for j in grasp.joints]
    bare = Grasp(grasp.contacts, joints, grasp.mechanism, grasp.preload, grasp.name)
    return {"own": held(bare, loads), "preload alone": held(bare, np.zeros((1, 6)))}


def largest(grasp: Grasp, loads: Array) -> Array:
    """(n,) so many times each load is resisted; 0 where none is, or no forces balance it."""
    most = max_many(grasp, loads, settings=LIMIT, jobs=1)
    found = np.nan_to_num(np.asarray(most.lower, dtype=float), nan=0.0)
    for k in np.flatnonzero((found < 1) & (most.stop != Stop.COMPLETE)):  # a search that ended before its first state
        found[k] = 1.0 if verdict(grasp, loads[k]) is Verdict.HOLDS else found[k]
    return found


def short(x: float) -> float | None:
    return float(f"{float(x):.{DIGITS}g}") if np.isfinite(x) else None


def passes_bench(grasp: Grasp, loads: Array) -> tuple[bool | None, list[str]]:
    """The test at contact level: passed (None if not decided), and how each simulation ended."""
    endings: list[str] = []
    unsure = False
    for load in loads:
        found = simulate(grasp, load, ramp=FAST)
        endings.append(str(found.ending))
        moved = np.linalg.norm(found.shift[-1]) >= FAR or np.degrees(np.linalg.norm(found.turn[-1])) >= TURNED
        if found.ending is Ending.SLIPS or moved:
            return False, endings
        unsure |= found.ending in (Ending.UNDECIDED, Ending.ILL_POSED)
    return None if unsure else True, endings


# --- the repository's own set ---------------------------------------------------------------------


class BundledSet:
    """The bundled thousand, made again from seeds."""

    def __init__(self, allegro: str) -> None:
        self.hands = {"barrett": "barrett-bh8-280"} | ({"allegro": allegro} if allegro else {})
        lines = gzip.decompress(BUNDLED.read_bytes()).splitlines()
        self.rows = [row for row in map(json.loads, lines) if row["hand"] in self.hands]
        self.made: dict[tuple[str, str], tuple[Any, SceneSource]] = {}

    def grasp(self, row: dict[str, Any]) -> Grasp:
        """A row's grasp; `InputError` if what is made is not what the row says."""
        hand, thing = self.hands[row["hand"]], row["object"]
        if (hand, thing) not in self.made:
            self.made[hand, thing] = runner(hand, thing), SceneSource.of(hand, thing)
        run, scene = self.made[hand, thing]
        number, draw, *_ = [*map(int, row["name"].split()[1:]), 0]
        all_draws = postures_of(run, thing, number, draw + 1, MAX_GRASP_SIZE)
        if not all_draws:
            raise InputError("is not made again from its seed", source=row["name"])
        found = all_draws[draw]
        placed = (found[k] for k in ("joints", "object_position", "object_quaternion"))
        posed = PosedRow(*placed, preload=found["preload"], mass=found["mass"], friction=found["friction"])
        grasp = scene.grasp(posed, row["name"], GraspChanges())
        stored = np.array(row["contact_positions"])
        if grasp.positions.shape != stored.shape or np.abs(grasp.positions - stored).max() > 1e-4:
            raise InputError("has other contacts than its row: another version of the hand?", source=row["name"])
        return grasp

    def audit(self, row: dict[str, Any]) -> dict[str, Any]:
        grasp = self.grasp(row)
        loads = np.array([grasp.gravity_wrench(side) for side in SIDES])
        least = largest(grasp, loads)
        passed, endings = passes_bench(grasp, loads[np.argsort(least)])  # the first failure ends it: weakest first
        found = {"passes": {"own": passed}, "endings": endings, "friction": row["friction"]}
        return found | {"without laws": without_laws(grasp, loads)} | asked(grasp, loads, least)


# --- a published set --------------------------------------------------------------------------------


class PublishedSet:
    """Grasps of DexGraspBench's layout, with the hand's MuJoCo model."""

    def __init__(self, bench: Path, model: Path | None) -> None:
        self.bench, self.model = bench, model or bench / SHADOW
        self.hand: Hand = load_hand(self.model)
        self.files = sorted((bench / GRASPS).rglob("*.npy"))
        self.second = [n for n in self.hand.joint_names if n.endswith("FJ1")]  # behind a tendon of two joints
        self.kept: dict[tuple[str, float], Body] = {}

    def audit(self, file: Path) -> dict[str, Any]:
        thing, scale, pieces, stages, pose = self.stages(file)
        there: dict[str, bool] = {}
        sides: list[bool] = []
        settled: Settled | None = None
        for mu in (0.3, 0.6, 3.0):
            run = GraspBench(self.model, pieces, scale, (mu, FRICTION[1] * mu / FRICTION[0]))
            outcome = run.run(stages, pose)
            there[f"{mu:g}"] = outcome.passes
            if mu == FRICTION[0]:
                settled, sides = outcome.settled, list(outcome.held)
        found: dict[str, Any] = {"passes": there | {"own": there["0.6"]}, "sides": sides}
        if settled is None or not settled.links:
            return found | {"reason": "nothing touches after the squeeze, or too deep before it"}
        body = self.body(str(thing), scale)
        loads = np.array([self.push(settled, side) for side in SIDES])
        free, locked = (self.grasp(settled, body, lock) for lock in ([], self.second))
        tendons = {"own": held(free, loads), "preload alone": held(free, np.zeros((1, 6)))}
        each = [str(verdict(locked, load)) for load in loads]
        found |= {"tendons free": tendons, "without laws": without_laws(locked, loads), "sides here": each}
        return found | asked(locked, loads, largest(locked, loads))

    def stages(self, file: Path) -> tuple[Path, float, list[Path], tuple[Array, Array, Array], Array]:
        """Folder, scale and pieces of the object, the hand's three stages, and the object's pose."""
        data = recorded(file)
        thing, scale = self.bench / str(data["obj_path"]), float(data["obj_scale"])
        first, second, last = (
            np.asarray(data[k], dtype=float) for k in ("pregrasp_qpos", "grasp_qpos", "squeeze_qpos")
        )
        pieces = sorted((thing / "urdf" / "meshes").glob("*.obj"))
        return thing, scale, pieces, (first, second, last), np.asarray(data["obj_pose"], dtype=float)

    def paths(self, file: Path) -> dict[str, Any]:
        """First the squeeze, then the load: verdicts on paths, without and with the test's torsional friction."""
        thing, scale, pieces, stages, pose = self.stages(file)
        settled = GraspBench(self.model, pieces, scale, FRICTION).squeezed(stages, pose)
        assert settled is not None
        grasp = self.grasp(settled, self.body(str(thing), scale), self.second)
        soft, loads = grasp.with_torsion(FRICTION[1]), np.array([self.push(settled, side) for side in SIDES])
        found: dict[str, Any] = {"squeeze": short(settled.squeeze), "within": settled.within}
        found["torsional, preload alone"] = held(soft, np.zeros((1, 6)))
        return found | {"path": held_on_path(grasp, loads), "torsional, path": held_on_path(soft, loads)}

    def body(self, thing: str, scale: float) -> Body:
        if (thing, scale) not in self.kept:
            self.kept[thing, scale] = load_body(f"{thing}/urdf/meshes", mass=MASS, scale=scale)
        return self.kept[thing, scale]

    @staticmethod
    def push(settled: Settled, side: Array) -> Array:
        """(6,) a push along a direction of the world at the centre of mass, in the object's frame."""
        force = PUSH * settled.turned.T @ side
        return np.r_[force, np.cross(settled.center, force)]

    def grasp(self, settled: Settled, body: Body, lock: list[str]) -> Grasp:
        """What holds the object after the squeeze: contacts that press, servos that close; the others are locked."""
        hand = self.hand
        inside = zip(hand.joint_names, *hand.limits.T, strict=True)  # MuJoCo's joint stops are soft
        q = hand.configuration({n: float(np.clip(settled.joints[n], lo, hi)) for n, lo, hi in inside})
        base = hand.link_poses(q)[hand.link(settled.root)]
        normals = settled.normals / np.linalg.norm(settled.normals, axis=1, keepdims=True)
        rows = zip(settled.positions, normals, settled.links, strict=True)
        contacts = [Contact(p, n, FRICTION[0], link) for p, n, link in rows]
        few = reduced_contacts(contacts, body).contacts
        commands = servo_commands(hand, q, settled.targets, settled.gains, largest=settled.largest or None)
        grasp = grasp_of(hand, q, list(few), base @ settled.object_pose, lock=lock)
        names = grasp.mechanism.actuators
        return grasp.with_preload({n: f for n, f in commands.items() if f > 0 and n in names})


# --- a set without commands ---------------------------------------------------------------------------


def balanced(grasp: Grasp) -> bool:
    """Do some forces inside the friction cones balance a weight of 1 N from each of six sides?"""
    G = WrenchScale.of(grasp).grasp_map(grasp)  # torques are about the centre of mass
    return all(np.isfinite(smallest_forces(grasp, G, np.r_[side, np.zeros(3)])) for side in SIDES)


def frictions(files: list[Path], model: Path, objects: list[Path], count: int) -> dict[str, Any]:
    """Counts by coefficient, over the imported grasps."""
    hand = load_hand(model)
    found = spread(list(sources(files)), count)
    name, mapping = mapping_for(found[0].layout, hand)
    rows = list(imported(Importer(hand, mapping, Treatment(), str(model), tuple(objects), mass=MASS), found))
    grasps = [r.grasp for r in rows if r.grasp is not None]
    counts = {f"{mu:g}": sum(balanced(g.with_friction(mu)) for g in grasps) for mu in FRICTIONS}
    return {"layout": found[0].layout, "mapping": name, "grasps": len(rows), "imported": len(grasps)} | {
        "balanced": counts
    }


# --- results ---------------------------------------------------------------------------------------


def save(data: dict[str, Any]) -> None:
    part = RESULTS.with_suffix(".part")
    part.write_text(json.dumps(data, separators=(",", ":")).replace('{"name"', '\n{"name"') + "\n")
    part.replace(RESULTS)


def collect(name: str, items: list[tuple[str, Any]], audit: Callable[[Any], dict[str, Any]]) -> None:
    """Audit what is not in the results yet."""
    data: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    rows = {r["name"]: r for r in data.get(name, {}).get("rows", [])}
    items = [items[i] for i in np.random.default_rng(0).permutation(len(items))]  # what is done is a fair sample
    for k, (label, item) in enumerate(items):
        if label not in rows:
            try:
                rows[label] = {"name": label} | audit(item)
            except InputError as fault:
                rows[label] = {"name": label, "passes": {"own": None}, "reason": str(fault)}
        if (k + 1) % STEP == 0 or k + 1 == len(items):
            whole = list(rows.values())
            data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
            save(data | {"machine": describe(), name: {"summary": summary(whole), "rows": whole}})
            print(f"{k + 1} of {len(items)}", flush=True)


def spread(items: list[Any], count: int) -> list[Any]:
    return [items[i] for i in np.linspace(0, len(items) - 1, min(count, len(items))).astype(int)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("bundled", "published", "paths", "friction", "summary", "tables"))
    parser.add_argument("--allegro", default="", help="URDF of the vendor, for the bundled grasps of that hand")
    parser.add_argument("--bench", type=Path, help="a clone of DexGraspBench, with grasps and objects")
    parser.add_argument("--hand", type=Path, help="its hand's model, if the clone lacks the meshes")
    parser.add_argument("--files", type=Path, nargs="*", default=[], help="of `friction`")
    parser.add_argument("--objects", type=Path, nargs="*", default=[], help="of `friction`: folders of meshes")
    parser.add_argument("--name", default="DexGraspNet", help="of the set of `friction`, in the results")
    parser.add_argument("--count", type=int, default=1000, help="grasps, spread evenly over the set")
    args = parser.parse_args()
    if args.what == "bundled":
        own = BundledSet(args.allegro)
        rows = spread(own.rows, args.count)
        collect("bundled", [(f"{r['hand']} {r['name']}", r) for r in rows], own.audit)
    elif args.what == "published":
        if not args.bench:
            parser.error("give --bench FOLDER")
        there = PublishedSet(args.bench, args.hand)
        files = spread(there.files, args.count)
        collect("DexGraspBench", [(str(f.relative_to(args.bench / GRASPS)), f) for f in files], there.audit)
    data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if args.what == "paths":
        if not args.bench:
            parser.error("give --bench FOLDER")
        there = PublishedSet(args.bench, args.hand)
        rows = [r for r in data["DexGraspBench"]["rows"] if "measures" in r and "path" not in r.get("paths", {})]
        for row in rows[: args.count]:
            row["paths"] = there.paths(args.bench / GRASPS / row["name"])
            save(data)
    if args.what == "friction":
        if not (args.files and args.hand):
            parser.error("give --files and --hand")
        data["friction"] = data.get("friction", {}) | {
            args.name: frictions(args.files, args.hand, args.objects, args.count)
        }
        save(data)
        print(json.dumps(data["friction"], indent=1), flush=True)
    if args.what == "tables":
        print(*tables(data).values(), sep="\n\n")
        return
    for name, found in data.items():
        if "rows" in found:
            found["summary"] = summary(found["rows"])
            print(name, json.dumps(found["summary"], indent=1))
    save(data)


if __name__ == "__main__":
    main()
