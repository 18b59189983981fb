"""No contact forces balance the loads: what is shown, how near to the edge, and that nothing possible is lost.

    python -m benchmarks.no_grasp [--part NAME] [--boxes 400] [--tasks 2000] [--print]

- *two*: the bundled tasks of two contacts under weights from six sides: boxes, processor time of search and replay, the
  least distance of the centre of mass from the line through both contacts, proved and met.
- *edges*: tasks made impossible by less and less: bundled tasks of three and four contacts with little friction or
  weak contacts, with a torque or with the centre of mass moved away under contacts of a limited force, those of two
  with the centre of mass near the line, three contacts on a wedge. Bisection between what is shown to be impossible
  with `--boxes` boxes, and a placement at which forces balance all loads. With `--each SECONDS` the bisection goes on
  from what is stored: `--questions` more at each edge, each of so much processor time.
- *held*: tasks cut around contacts that hold: flat and curved regions of 2 mm about contacts of bundled grasps and of
  random ones, loads that forces in the friction cones balance, some on the edge of a cone, half of them with a limit
  of normal forces that one of them reaches. None may be refuted, and no box about the contacts.
- *held_by_motors*: the same within limits of torques: certified configurations of two and three contacts, loads that
  forces within their friction cones balance, limits of torques that these forces just reach. No box about a
  configuration may be discarded, by what the search proposes there, nor by what it proposes with a tenth less torque.
- *motors*: the least force of the gripper's motor that can hold a block between flat jaws, and the least torque of two
  fingers, by bisection: shown to be too small within `--boxes` boxes, against the edge worked out by hand.
- *joined*: tasks of three and four contacts made impossible by limits on commands, or by a block in the way: what
  `grasp` answers within `--seconds`, and which reason shows it; `--at` asks of one limit and one block alone.
- *obstacle*: how far before a block's side a wall is shown to leave no room for a fingertip, edges as above.
- *least_friction*: of two contacts anywhere on an object whose centre of mass is off its middle, and the processor
  time; *surface_held*: contacts on random solids that hold by construction, for which so many may never be refuted.

Writes benchmarks/results/no_grasp.json after every row or part and prints Markdown tables.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.flat_pads import BLOCK, jaws, levers
from benchmarks.machine import describe
from handfast import Loads, Task, load_body, load_grasp, load_hand, load_task, synthesize
from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.transforms import matrix_quaternion
from handfast.geometry.collision import Collisions
from handfast.geometry.scene import Scene, rest_overlaps
from handfast.model.body import Body
from handfast.model.region import Bezier, Cap
from handfast.model.shape import Shape
from handfast.planning.filters.balance import held_by_contacts
from handfast.planning.grasp_for import grasp_for, motors_of
from handfast.planning.joined_search import ContactSetSearch, JoinedSearch
from handfast.planning.no_balance import NO_MOTION, NoBalance
from handfast.planning.question import Allowed, PlanLimits
from handfast.planning.virtual_motions import VirtualMotions
from handfast.proofs.chains import joint_rates
from handfast.proofs.discarded_boxes import Balance, Boxes
from handfast.proofs.fields import Fields
from handfast.proofs.posed_boxes import ContactBoxes
from handfast.proofs.tasks import read_task
from handfast.proofs.unbalanced import Motions, Placements, replay_unbalanced
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import ContactPair

RESULTS = Path(__file__).parent / "results" / "no_grasp.json"


TWO = ("guitar-tuning", "scalpel-upholding", "teapot-lid-lifting")
MORE = (
    "scalpel-handling",
    "scalpel-incision",
    "teapot-service",
    "teapot-transportation",
    "guitar-playing",
    "guitar-holding",
)
HALVINGS = 8
PART = 400  # tasks about contacts that hold with random numbers of their own
MOTORS_PART = 50  # the same within limits of torques
PROPOSED_IN = np.array([0, 1])  # of four boxes about a configuration, those for which motions are sought
HALF = 1e-3  # [m] half the side of a region about a contact
SHARES = (0.0, 0.3, 0.9, 1.0)  # of the friction that a force uses


def stored() -> dict[str, Any]:
    """What was written."""
    return json.loads(RESULTS.read_text("utf-8")) if RESULTS.exists() else {}


def ran(search: NoBalance | ContactSetSearch, options: argparse.Namespace) -> Any:
    """A search after `--boxes`, or after `--each` seconds of processor time."""
    begin = time.process_time()

    def goes_on() -> bool:
        return time.process_time() - begin < options.each if options.each else search.boxes < options.boxes

    while not search.over and goes_on():
        search.step() if isinstance(search, ContactSetSearch) else search.run(1)
    return search


def two(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """The bundled tasks of two contacts."""
    for name in TWO:
        task = load_task(name)
        body = load_body(str(task.object))
        loads, begin = Loads.gravity(body), time.process_time()
        search = ran(NoBalance(task, loads, body.friction, center=np.asarray(body.center_of_mass)), options)
        took, proof = time.process_time() - begin, search.searched.proof
        begin, regions = time.process_time(), read_task(task_to_dict(task)).on_object
        wrenches = {key: np.array(w) for key, w in loads.by_name.items()}
        done = replay_unbalanced(
            regions, wrenches, body.friction, np.inf, body.center_of_mass, Fields(json.loads(json.dumps(proof)))
        )
        low, high = search.placements.root.T
        at = low + (high - low) * np.random.default_rng(0).random((20_000, len(low)))
        a, b = (search.placements.at(at)[0] - body.center_of_mass).swapaxes(0, 1)
        met = np.linalg.norm(np.cross(a, b), axis=1) / np.linalg.norm(b - a, axis=1)
        yield (
            {"task": name, "shown": search.shown, "boxes": search.boxes, "search": took, "proved": done.ok}
            | {"replay": time.process_time() - begin, "line_distance": search.line_distance, "met": float(met.min())}
        )


# --- edges --------------------------------------------------------------------------------------------


def edge(name: str, make: Callable[[float], NoBalance], ends: tuple[float, float]) -> dict[str, Any]:
    """Between the first number, at which it is shown, and the second, where forces balance: how near to each other."""
    shown, possible = ends
    boxes = None
    at_ends = [make(x) for x in ends]
    if not at_ends[0].shown or at_ends[1].balanced is None:
        first, last = at_ends
        return {
            "task": name,
            "shown": None,
            "shown_at_first": first.shown,
            "balanced_at_last": last.balanced is not None,
        }
    boxes, undecided = at_ends[0].boxes, []
    for _ in range(HALVINGS):
        x = (shown + possible) / 2
        search = make(x)
        if search.shown:
            shown, boxes = x, search.boxes
        else:
            undecided += [] if search.balanced is not None else [x]
            possible = x
    balances = ends[1] if undecided else possible
    for _ in range(HALVINGS if undecided else 0):
        x = (undecided[-1] + balances) / 2
        if make(x).balanced is None:
            undecided.append(x)
        else:
            balances = x
    return {"task": name, "ends": ends, "shown": shown, "balanced": balances, "boxes": boxes}


# --- by what the hand and its surroundings do -----------------------------------------------------------

COMMANDS = (1e-4, 1e-3, 1e-2, 1e-1)  # [N m] largest command of any motor
BLOCKS = (0.05, 0.02, 0.01, 0.005)  # [m] half the edges of a cube about the first contact's region


def joined(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Tasks of three and four contacts made impossible by commands, and by a block where a contact is to be: what
    `grasp` answers, whatever shows it.
    """
    for name in ("scalpel-incision", "teapot-service", "guitar-playing", "guitar-holding"):
        if options.named not in name:
            continue
        task = load_task(name)
        body = load_body(str(task.object))
        for limit in options.at[:1] if options.at else COMMANDS:
            how = {"limits": PlanLimits(command_limit=limit)}
            yield asked(f"{name}: commands up to {limit:g}", task, body, options.seconds, **how)
        pair = task.contact_pairs[0]
        regions = read_task(task_to_dict(task)).on_object
        middle = Placements.of(regions[:1], np.zeros((1, 6)), 0.5).at(np.full((1, 2), 0.5))[0][0, 0]
        for half in options.at[1:] if options.at else BLOCKS:
            pose = np.eye(4)
            pose[:3, 3] = middle
            block = Shape("box", [2 * half] * 3, pose)
            there = replace(body, pieces=(*body.pieces, block))
            yield asked(
                f"{name}: block of {2e3 * half:g} mm about the {pair.link}'s region", task, there, options.seconds
            )


def asked(name: str, task: Task, body: Body, seconds: float, **how: Any) -> dict[str, Any]:
    """What `grasp` answers in a time."""
    found = grasp_for(task, body, timeout=seconds, jobs=1, **how)
    none = found.proof_of_none
    by = "" if str(found.verdict) != "none" else ", ".join(none) if none else "no configuration"
    return {"task": name, "verdict": str(found.verdict), "by": by, "seconds": found.seconds}


Make = Callable[[float], Any]  # a search after its time, by the number that is varied


def of_edges(options: argparse.Namespace) -> Iterator[tuple[str, Make, tuple[float, float]]]:
    """Tasks by what makes them impossible: name, the search, and the numbers at which it is most and least."""
    for name in MORE if options.only in (None, "friction") else ():
        yield f"{name}: friction", by_friction(name, options), (0.0, 1.5)
    for name in MORE if options.only in (None, "limit") else ():
        yield f"{name}: force limit over the weight, log2", by_limit(name, options), (-4.0, 8.0)
    for name in MORE if options.only in (None, "loads") else ():
        yield f"{name}: torque, shares of the weight at 0.1 m", by_torque(name, options), (8.0, 0.0)
    for name in MORE if options.only in (None, "moved") else ():
        yield f"{name}: centre of mass moved away [m]", by_moved(name, options), (0.6, 0.0)
    for name in TWO if options.only in (None, "center") else ():
        yield f"{name}: way of the centre of mass to the line", by_center(name, options), (0.0, 1.0)
    for friction in (0.1, 0.2, 0.5, 1.0, 2.0) if options.only in (None, "wedge") else ():
        yield f"three contacts on a wedge [deg], friction {friction:g}", by_angle(friction, options), (85.0, 0.0)


def edges(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Each edge by bisection, or its stored bracket by some questions more."""
    if not options.each:
        for name, make, ends in of_edges(options):
            yield edge(name, make, ends)
        return
    rows = {row["task"]: row for row in stored().get("edges", [])}
    for _ in range(options.questions):  # one at each edge after the other
        for name, make, ends in of_edges(options):
            if options.named not in name:
                continue
            row = narrowed(rows.get(name, {"task": name}), make, ends, options.each)
            rows[name] = row or rows[name]
            if row:
                yield row


CLOSE = 0.01  # a bracket that is no wider, relative, is not worked on


def narrowed(row: dict[str, Any], make: Make, ends: tuple[float, float], each: float) -> dict[str, Any] | None:
    """One question more between what is shown, and what is possible or was not shown in `each` seconds; None if both
    are the same but for `CLOSE`.
    """
    shown = row.get("shown")
    shown = ends[0] if shown is None and row.get("shown_at_first") else shown
    balanced, left = row.get("balanced"), [x for x, seconds in row.get("undecided", []) if seconds >= each]
    others = [ends[1] if balanced is None else balanced, *left]
    if shown is None:
        if left:
            return None  # not even at the first end
        x = ends[0]
    else:
        near = min(others, key=lambda x: abs(x - shown))
        if abs(near - shown) <= CLOSE * max(abs(near), abs(shown)):
            return None
        x = (shown + near) / 2
    begin, search = time.process_time(), make(x)
    took, undecided = time.process_time() - begin, row.get("undecided", [])
    if search.shown:
        row = row | {"shown": x, "boxes": search.boxes, "seconds": took}
    elif getattr(search, "balanced", None) is not None:
        row = row | {"balanced": x}
    else:
        undecided = [*undecided, (x, max(took, each))]
    return row | {"ends": ends, "balanced": row.get("balanced"), "shown": row.get("shown"), "undecided": undecided}


def obstacle(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """A wall so far before the side of a block that a fingertip is to touch; one contact of two."""
    rows = {row["task"]: row for row in stored().get("obstacle", [])}
    name, ends = "wall before a fingertip of 18 mm [mm]", (3.0, 17.0)
    for _ in range(options.questions):
        row = narrowed(
            rows.get(name, {"task": name, "balanced": ends[1]}), by_wall(options), ends, options.each or 60.0
        )
        if not row:
            return
        rows[name] = row
        yield row


def by_wall(options: argparse.Namespace) -> Make:
    """Between round fingertips of the gripper a block of 5 cm, and a wall of 8 by 8 cm before its left side."""
    pairs = []
    for side, link in ((1.0, "left_finger"), (-1.0, "right_finger")):
        tip = Cap((0, 0.005 * side, 0.045), 0.005, (0, -side, 0), 1.0)
        pairs.append(ContactPair(link, tip, region(np.array([0, side * 0.025, 0]), np.array([0, -side, 0.0]), 0.01)))
    task = Task.of(load_hand("parallel-gripper"), tuple(pairs))

    def at(gap: float) -> ContactSetSearch:
        shapes = []
        for size, y in (((0.03, 0.05, 0.03), 0.0), ((0.08, 0.02, 0.08), 0.025 + 1e-3 * gap + 0.01)):
            pose = np.eye(4)
            pose[1, 3] = y
            shapes.append(Shape("box", size, pose))
        body = Body.of(shapes, mass=0.1)
        balance = NoBalance(task, Loads.wrench([0, 0, -0.5, 0, 0, 0]), 0.8, center=np.zeros(3))
        return ran(sets_of(task, body, balance, PlanLimits())[0], options)

    return at


def sets_of(task: Task, body: Body, balance: NoBalance, limits: PlanLimits) -> list[ContactSetSearch]:
    """The joined search, by sets of contacts."""
    scene = Scene(task.hand, body)
    collisions = Collisions(scene, cutoff=1e-3, at_rest=rest_overlaps(scene, at_zero=True))
    return JoinedSearch(task, collisions, Allowed(), balance, motors_of(task, limits)).sets


def by_friction(name: str, options: argparse.Namespace) -> Callable[[float], NoBalance]:
    """Of a bundled task under the object's weight from six sides."""
    task = load_task(name)
    loads = Loads.gravity(load_body(str(task.object)))
    return lambda friction: ran(NoBalance(task, loads, friction, center=np.zeros(3)), options)


def by_limit(name: str, options: argparse.Namespace) -> Callable[[float], NoBalance]:
    """The same with a friction of 0.5, by the largest normal force at a contact: a power of 2 times the weight."""
    task = load_task(name)
    loads = Loads.gravity(load_body(str(task.object)))
    weight = float(np.linalg.norm(loads.wrenches[0, :3]))

    def at(power: float) -> NoBalance:
        search = NoBalance(task, loads, 0.5, center=np.zeros(3), force_limits=2.0**power * weight)
        return ran(search, options)

    return at


STRONG = 4.0  # times the weight: largest normal force at a contact where loads or the centre of mass are varied


def by_torque(name: str, options: argparse.Namespace) -> Callable[[float], NoBalance]:
    """Of a bundled task with a friction of 0.5 and limited forces: the weight along -z, and a torque both ways."""
    task = load_task(name)
    body = load_body(str(task.object))
    weight = body.gravity_wrench([0, 0, -1])
    size = float(np.linalg.norm(weight[:3]))

    def at(share: float) -> NoBalance:
        turn = np.array([0, 0, 0, 0.1 * share * size, 0, 0])
        loads = Loads(("one way", "the other"), np.array([weight + turn, weight - turn]))
        search = NoBalance(task, loads, 0.5, center=np.zeros(3), force_limits=STRONG * size)
        return ran(search, options)

    return at


def by_moved(name: str, options: argparse.Namespace) -> Callable[[float], NoBalance]:
    """The same under the weight from six sides, its centre of mass moved along the object's x axis."""
    task = load_task(name)
    body = load_body(str(task.object))

    def at(way: float) -> NoBalance:
        there = replace(body, center_of_mass=body.center_of_mass + np.array([way, 0, 0]))
        loads = Loads.gravity(there)
        limit = STRONG * float(np.linalg.norm(loads.wrenches[0, :3]))
        search = NoBalance(task, loads, 0.5, center=np.zeros(3), force_limits=limit)
        return ran(search, options)

    return at


def by_center(name: str, options: argparse.Namespace) -> Callable[[float], NoBalance]:
    """Of a bundled task of two contacts: the share of the way to the middle of the regions."""
    task = load_task(name)
    body = load_body(str(task.object))
    middle = (
        NoBalance(task, Loads.gravity(body), 3.0, center=np.zeros(3))
        .placements.at(np.full((1, 4), 0.5))[0][0]
        .mean(axis=0)
    )
    own = np.asarray(body.center_of_mass)

    def at(share: float) -> NoBalance:
        there = replace(body, center_of_mass=own + share * (middle - own))
        return ran(NoBalance(task, Loads.gravity(there), 3.0, center=np.zeros(3)), options)

    return at


def by_angle(friction: float, options: argparse.Namespace) -> Callable[[float], NoBalance]:
    """Two contacts on one side of a wedge, one on the other, a torque about the wedge's axis."""

    def at(degrees: float) -> NoBalance:
        a, pairs = np.radians(degrees), []
        for side, z in ((1.0, 0.01), (1.0, -0.01), (-1.0, 0.0)):
            n = np.array([side * np.cos(a), np.sin(a), 0.0])
            pairs.append(ContactPair("index_distal", TIP, region(np.array([0.02 * side, 0.0, z]), -n, HALF)))
        task = Task.of(load_hand("schunk-sah"), tuple(pairs))
        return ran(NoBalance(task, Loads.wrench([0, 0, 0, 0, 0, 0.01]), friction, center=np.zeros(3)), options)

    return at


TIP = Cap((0.02, 0, 0), 0.013, (0.5, 0, 0.87), 1.0)


# --- tasks around contacts that hold --------------------------------------------------------------------


def region(
    point: Array, normal: Array, half: float, bent: float = 0.0, rng: np.random.Generator | None = None
) -> Bezier:
    """A patch through a contact in its middle, its outward normal there against the contact's."""
    u = np.linalg.svd(normal[None])[2][1:]
    grid = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], indexing="ij"), axis=-1)
    height = np.zeros((3, 3))
    if rng is not None:  # symmetric: the middle of the patch stays where it is, and its tangents too
        a, b, c = bent * half * rng.normal(size=3)
        height = a * (grid[..., 0] ** 2 - 0.5) + b * (grid[..., 1] ** 2 - 0.5) + c * grid[..., 0] * grid[..., 1]
    points = point + half * (grid @ u) + height[..., None] * normal
    out = Bezier(points, False)
    return out if out.outward(0.5, 0.5) @ normal < 0 else Bezier(points, True)


def known(rng: np.random.Generator) -> tuple[Array, Array, float]:
    """Contacts of a bundled grasp, or of a random one: points, normals, friction."""
    if rng.random() < 0.5:
        names = bundled.names("grasps")
        g = load_grasp(names[rng.integers(len(names))])
        its = rng.permutation(len(g.contacts))[: rng.integers(2, 6)]
        contacts = [g.contacts[i] for i in its]
        return np.array([c.position for c in contacts]), np.array([c.normal for c in contacts]), contacts[0].friction
    K = int(rng.integers(2, 5))
    n = rng.normal(size=(K, 3))
    return (
        0.03 * rng.normal(size=(K, 3)),
        n / np.linalg.norm(n, axis=1, keepdims=True),
        float(rng.choice([0.1, 0.5, 1.0])),
    )


def held(options: argparse.Namespace) -> Iterator[dict[str, int]]:
    """How many tasks about contacts that hold are refuted, and how many boxes about the contacts: both 0."""
    for first in range(0, options.tasks, PART):
        yield held_part(first, min(PART, options.tasks - first), options)


def held_part(first: int, tasks: int, options: argparse.Namespace) -> dict[str, int]:
    """The same of so many tasks from one on."""
    rng, hand = np.random.default_rng([11, first]), load_hand("schunk-sah")
    wrong, lost, tried, edges_, curved, limited = 0, 0, 0, 0, 0, 0
    for _ in range(tasks):
        p, n, mu = known(rng)
        use, wrench = rng.choice(SHARES, size=len(p)), np.zeros(6)
        pushed = rng.exponential(size=len(p))
        for point, normal, share, size in zip(p, n, use, pushed, strict=True):
            t = np.cross(normal, rng.normal(size=3))
            force = size * (normal + mu * share * t / np.linalg.norm(t))
            wrench -= np.r_[force, np.cross(point, force)]
        limit = None if rng.random() < 0.5 else float(pushed.max()) * (1 + 1e-12)
        bent = float(rng.choice([0.0, 0.3]))
        pairs = tuple(
            ContactPair("index_distal", TIP, region(a, b, HALF, bent, rng)) for a, b in zip(p, n, strict=True)
        )
        # the friction that the forces use, but for the rounding of contacts on the edge of a cone
        how: dict[str, Any] = {"center": np.zeros(3), "force_limits": np.inf if limit is None else limit}
        search = NoBalance(Task.of(hand, pairs), Loads.wrench(wrench), mu * (1 + 1e-12), **how)
        search.looked = True  # it is to try, whatever balances
        search._missing = lambda at: np.ones(len(at))  # type: ignore[method-assign]
        search.run(options.held_boxes)
        wrong += search.shown
        middle = np.full(2 * len(p), 0.5)
        size = 10.0 ** rng.uniform(-8, 0, size=(8, 1))
        low, high = (middle + sign * 0.5 * size * rng.random((8, len(middle))) for sign in (-1, 1))
        boxes = np.stack([low, high], axis=2)
        closed, _, _ = search.examined(boxes, np.full(8, NO_MOTION))
        lost += int((closed != NO_MOTION).sum())
        limited += limit is not None
        tried, edges_, curved = tried + 1, edges_ + bool((use == 1).any()), curved + bool(bent)
    return {
        "tasks": tried,
        "on_an_edge": edges_,
        "curved": curved,
        "forces_limited": limited,
        "refuted": wrong,
        "boxes": 8 * tried,
        "boxes_lost": lost,
    }


# --- within limits of torques ---------------------------------------------------------------------------


def held_by_motors(options: argparse.Namespace) -> Iterator[dict[str, int]]:
    """How many boxes about configurations that hold within limits of torques are discarded: 0."""
    places = []
    for task in (pinch(), load_task("scalpel-handling"), load_task("teapot-service"), load_task("guitar-playing")):
        task = replace(task, hand=task.hand.with_laws("none"))
        found = synthesize(task, count=8, timeout=60).solutions
        contacts = ContactBoxes.of(read_task(task_to_dict(task)))
        places += [(task, contacts, solution, *coordinates(contacts, task, solution)) for solution in found]
    for first in range(0, options.tasks, MOTORS_PART):
        yield held_by_motors_part(places, first, min(MOTORS_PART, options.tasks - first))


def held_by_motors_part(places: Sequence[Any], first: int, tasks: int) -> dict[str, int]:
    """The same of so many tasks from one on."""
    rng = np.random.default_rng([23, first])
    out = {"tasks": 0, "boxes": 0, "proposed_weaker": 0, "checked": 0, "lost": 0}
    while out["tasks"] < tasks:
        task, contacts, solution, x, chart = places[out["tasks"] % len(places)]
        mu = float(rng.choice([0.1, 0.5, 1.0]))
        wrench, torques = load_within(task, solution, mu, rng)
        low, high = contacts.root.T
        sizes = 10.0 ** rng.uniform(-7, -0.5, size=(4, 1)) * (high - low)
        ends = [np.clip(x + sign * sizes * rng.random((4, len(x))), low, high) for sign in (-1, 1)]
        boxes = Boxes.of(contacts, np.stack(ends, axis=2), np.full(4, chart))
        claims: list[Motions] = []
        for share in (1.0, 0.9):
            limits = PlanLimits(torque_limits={name: share * limit for name, limit in torques.items()})
            motors = motors_of(task, limits)
            placements = Placements.of(contacts.task.on_object, wrench[None], mu * (1 + 1e-9))
            if share == 1:
                exact = Balance(
                    placements, Motions(np.zeros((0, 1)), np.zeros((0, 2)), np.zeros((0, 6))), contacts, motors
                )
            with np.errstate(all="ignore"):
                motions, _ = VirtualMotions(contacts, motors, placements).propose(boxes.some(PROPOSED_IN), np.zeros(1))
            claims += [motions]
            out["proposed_weaker"] += len(motions) if share < 1 else 0
        for motions in claims:
            if len(motions):
                m, reason = len(motions), replace(exact, motions=motions)
                its, which = np.tile(np.arange(4), m), np.repeat(np.arange(m), 4)
                with np.errstate(all="ignore"):
                    out["lost"] += int(reason.examined(boxes.some(its), which).refuted.sum())
                out["checked"] += 4 * m
        out["tasks"], out["boxes"] = out["tasks"] + 1, out["boxes"] + 4
    return out


def pinch() -> Task:
    """A block of 3 cm between index finger and thumb."""
    sides = ((1.0, "index_distal"), (-1.0, "thumb_distal"))
    at = {link: (np.array([0, side * 0.015, 0]), np.array([0, -side, 0.0])) for side, link in sides}
    return Task.of(load_hand("schunk-sah"), tuple(ContactPair(k, TIP, region(*its, 0.01)) for k, its in at.items()))


def coordinates(contacts: ContactBoxes, task: Task, solution: Any) -> tuple[Array, int]:
    """Those of a certified configuration, and its chart."""
    first = task.hand.link_poses(solution.q)[contacts.task.links[0]]
    quaternion = matrix_quaternion(first[:3, :3].T @ solution.pose[:3, :3])
    chart = int(np.abs(quaternion).argmax())
    spots = np.concatenate([[*spot.object, *(spot.hand or ())] for spot in solution.existence.contacts])
    joints = solution.q[list(contacts.task.free)]
    return np.concatenate([joints, np.delete(quaternion, chart) / quaternion[chart], spots]), chart


def load_within(task: Task, solution: Any, mu: float, rng: np.random.Generator) -> tuple[Array, dict[str, float]]:
    """A load (6,) that forces within their cones balance, some on an edge, and what each motor gives then."""
    hand, data, wrench, torques = task.hand, read_task(task_to_dict(task)).hand, np.zeros(6), np.zeros(task.hand.l)
    for pair, spot in zip(task.contact_pairs, solution.existence.contacts, strict=True):
        p, n = pair.object.at(*spot.object), -pair.object.outward(*spot.object)
        t = np.cross(n, rng.normal(size=3))
        force = rng.exponential() * (n + mu * rng.choice(SHARES) * t / np.linalg.norm(t))
        wrench -= np.r_[force, np.cross(p, force)]
        there = solution.pose[:3, :3] @ p + solution.pose[:3, 3]
        jacobian = hand.jacobian(hand.link_names.index(pair.link), there, solution.q)
        torques += jacobian.T @ (solution.pose[:3, :3] @ force)
    leads = [j for j in range(hand.l) if not data.driving(j)]
    moves = joint_rates(data, np.eye(hand.l)[leads]).mid
    forces = np.linalg.lstsq(moves @ hand.mechanism.R.T, moves @ torques, rcond=None)[0]
    assert np.allclose(moves @ hand.mechanism.R.T @ forces, moves @ torques, atol=1e-9)
    each = np.abs(forces) * (1 + 1e-9) + 1e-12
    return wrench, dict(zip(hand.mechanism.actuators, each.tolist(), strict=True))


def motors(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Edges known by hand."""
    with TemporaryDirectory() as folder:
        cases = [
            ("flat jaws, one motor [N]", jaws(), "-z", 19.62),
            ("fingers of 60 mm [N m]", levers(Path(folder)), "-x", 0.5886),
        ]
    for name, task, side, by_hand in cases:
        loads = Loads.gravity(BLOCK, side)

        def searched_to(limit: float, task: Task = task, loads: Loads = loads) -> Any:
            limits = PlanLimits(torque_limits=dict.fromkeys(task.hand.mechanism.actuators, limit))
            balance = NoBalance(task, loads, 0.5, center=np.zeros(3))
            return ran(sets_of(task, BLOCK, balance, limits)[-1], options)

        ends, row = (0.5 * by_hand, by_hand), {"task": name, "by_hand": by_hand, "balanced": by_hand}
        row = next((r for r in stored().get("motors", []) if options.each and r["task"] == name), row)
        for _ in range(options.questions if options.each else HALVINGS):
            row = narrowed(row | {"balanced": by_hand}, searched_to, ends, options.each or 0.0) or row
        yield row


# --- anywhere on the surface --------------------------------------------------------------------------

OFF = np.array([0.05, 0.07, 0.03])  # of the size of an object, how far its centre of mass is moved


def surface(options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Of bundled objects, and of random solids."""
    for name in bundled.names("objects"):
        body = load_body(name)
        moved = np.asarray(body.center_of_mass) + OFF * np.ptp(body.vertices, axis=0)
        yield least_friction(name, replace(body, center_of_mass=moved, mass=body.mass or 1.0))
    for seed in range(20):
        solid = stone(np.random.default_rng([13, seed]))
        body = Body.of([solid], mass=1.0, center_of_mass=solid.centroid + 0.1 * OFF)
        yield least_friction(f"stone {seed}", body)


def least_friction(name: str, body: Body) -> dict[str, Any]:
    """Up to which friction it is shown that two contacts cannot hold the weight from six sides."""
    loads, shown, open_, seconds = Loads.gravity(body), 0.0, 1.0, []
    for _ in range(HALVINGS):
        friction, begin = (shown + open_) / 2, time.process_time()
        none = held_by_contacts(body, loads, friction=friction).fewest().most >= 2
        seconds.append(time.process_time() - begin)
        shown, open_ = (friction, open_) if none else (shown, friction)
    return {"object": name, "solids": len(body.pieces), "shown": shown, "seconds": max(seconds)}


def stone(rng: np.random.Generator) -> Shape:
    """An irregular convex solid of 5 to 30 corners."""
    return Shape.hull(rng.normal(size=(rng.integers(5, 31), 3)) * [0.05, 0.03, 0.02])


def surface_held(options: argparse.Namespace) -> Iterator[dict[str, int]]:
    """How often contacts that hold are refuted: two on a line through the centre of mass; more with limited forces."""
    tasks, rng, wrong = options.tasks, np.random.default_rng(17), {"pairs": 0, "limited": 0, "refuted": 0}
    while wrong["pairs"] + wrong["limited"] < tasks:
        solid = stone(rng)
        vertices, faces = solid.triangles()
        corners = vertices[faces[rng.integers(len(faces), size=rng.integers(2, 6))]]
        p = np.einsum("ki,kij->kj", rng.dirichlet([1, 1, 1], size=len(corners)), corners)
        n = -np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        if len(p) == 2:
            along = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
            slant = np.arccos(np.clip([n[0] @ along, -n[1] @ along], -1, 1)).max()
            if not slant < 1.4:
                continue
            body = Body.of([solid], mass=1.0, center_of_mass=p[0] + rng.random() * (p[1] - p[0]))
            loads, mu, limit = Loads.gravity(body), float(np.tan(slant)) * (1 + 1e-9), np.inf
        else:
            mu, body = float(rng.choice([0.0, 0.3, 1.0])), Body.of([solid], mass=1.0)
            wrenches = []
            for _ in range(3):
                t = np.cross(n, rng.normal(size=3))
                t *= mu * rng.choice(SHARES, size=(len(n), 1)) / np.linalg.norm(t, axis=1, keepdims=True)
                force = (n + t) * rng.choice([0.0, 0.5, 1.0], size=(len(n), 1))
                wrenches.append(-np.r_[force.sum(axis=0), np.cross(p, force).sum(axis=0)])
            loads, limit = Loads(("a", "b", "c"), np.array(wrenches)), 1 + 1e-12
        wrong["pairs" if len(p) == 2 else "limited"] += 1
        wrong["refuted"] += held_by_contacts(body, loads, limit, mu).fewest().most >= len(p)
    yield wrong


# --- output -------------------------------------------------------------------------------------------


def show(results: dict[str, Any]) -> None:
    """Markdown."""
    if "two" in results:
        print("| task | boxes | search [s] | replay [s] | distance proved [mm] | met [mm] |\n|---|---|---|---|---|---|")
        for r in results["two"]:
            near = f"{1e3 * r['line_distance']:.3g} | {1e3 * r['met']:.3g}"
            print(f"| {r['task']} | {r['boxes']} | {r['search']:.2f} | {r['replay']:.2f} | {near} |")
    if "edges" in results:
        print("\n| task | shown at | forces balance at | boxes |\n|---|---|---|---|")
        for r in results["edges"]:
            if r["shown"] is None:
                first = "shown" if r.get("shown_at_first") else "not shown"
                last = "met" if r.get("balanced_at_last") else "not met"
                print(f"| {r['task']} | {first} at the first end | {last} at the last | |")
            else:
                known = "not met" if r["balanced"] is None else f"{r['balanced']:.4g}"
                print(f"| {r['task']} | {r['shown']:.4g} | {known} | {r['boxes']} |")
    if "joined" in results:
        print("\n| task | verdict | shown by | seconds |\n|---|---|---|---|")
        for r in results["joined"]:
            print(f"| {r['task']} | {r['verdict'].upper()} | {r['by']} | {r['seconds']:.0f} |")
    if "motors" in results:
        print("\n| task | shown up to | by hand | boxes |\n|---|---|---|---|")
        for r in results["motors"]:
            print(f"| {r['task']} | {r['shown']:.4g} | {r['by_hand']:.4g} | {r['boxes']} |")
    if "least_friction" in results:
        print("\n| object | solids | two contacts: none up to a friction of | seconds |\n|---|---|---|---|")
        for r in results["least_friction"]:
            print(f"| {r['object']} | {r['solids']} | {r['shown']:.3g} | {r['seconds']:.2f} |")
    for name in ("held", "held_by_motors", "surface_held"):
        if name in results:
            print(f"\n{name}: " + ", ".join(f"{key} {value}" for key, value in results[name].items()))


ROWS = {"two": two, "edges": edges, "joined": joined, "motors": motors, "obstacle": obstacle, "least_friction": surface}
COUNTS = {"held": held, "held_by_motors": held_by_motors, "surface_held": surface_held}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--part", choices=(*ROWS, *COUNTS))
    parser.add_argument("--boxes", type=int, default=400)
    parser.add_argument(
        "--only", choices=("friction", "limit", "loads", "moved", "center", "wedge"), help="of the edges"
    )
    parser.add_argument("--seconds", type=float, default=60.0, help="of each of the joined")
    parser.add_argument("--each", type=float, help="seconds of processor time for each question about an edge")
    parser.add_argument("--questions", type=int, default=2, help="at each edge, with --each")
    parser.add_argument("--named", default="", help="only edges, and joined tasks, with this in their names")
    parser.add_argument("--at", type=float, nargs=2, help="of the joined: a limit [N m], half the edge of a block [m]")
    parser.add_argument("--tasks", type=int, default=2000)
    parser.add_argument("--held-boxes", type=int, default=64)
    parser.add_argument("--print", action="store_true", dest="only_print")
    options = parser.parse_args()
    results = stored()
    for name in () if options.only_print else (*ROWS, *COUNTS):
        if options.part not in (None, name):
            continue
        results |= {"machine": describe(), "asked": {"boxes": options.boxes, "held_boxes": options.held_boxes}}
        for row in (
            ROWS[name](options) if name in ROWS else ()
        ):  # each is written when it is there, in place of an old one
            known = {next(iter(r.values())): r for r in results.get(name, [])} | {next(iter(row.values())): row}
            results[name] = list(known.values())
            RESULTS.write_text(json.dumps(results, indent=1) + "\n", "utf-8")
        counted = Counter[str]()
        for part in COUNTS[name](options) if name in COUNTS else ():
            counted.update(part)
            results[name] = dict(counted)
            RESULTS.write_text(json.dumps(results, indent=1) + "\n", "utf-8")
    show(results)


if __name__ == "__main__":
    main()
