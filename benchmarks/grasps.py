"""The published set of grasps for the benchmark of the engine: 3 to 8 contacts, and power grasps.

    from grasps import cases
    python -m benchmarks.grasps                          # what is in it
    python -m benchmarks.grasps --make --shared ../shared  # choose seeds and make the grasps of real hands

Families:

    random     20 per number of contacts: a superquadric (ellipsoid to nearly a box) between two to four
               fingers of two or three joints (six to eight in all) that touch it below its middle, the
               proximal joints commanded.
    barrett    real hands on real objects and primitives, closed by `handfast.close`: four per number of
    allegro    contacts and hand, stored at contact level in `benchmarks/grasps/`. The Barrett is the bundled
               one or the vendor's, the Allegro the vendor's, the objects bundled, primitives or YCB.
    fixture    eight per number of contacts, no joints: tables, nests and corners that hold a weight.
    power      10, 12 and 15 contacts, 15 each: eight like `random`, seven that reach round the object and
               have contacts on the palm.

Where there are joints the question is the largest pull out of the hand: a unit force within a cone about the
hand's outward axis, at the middle of the contacts, with a small random torque. Fixtures carry a weight and
are pushed any way, mostly sideways. Seeds are the first ones whose preload some forces inside the friction
cones balance when nothing else acts (`pressing`, a linear program; the commands of real hands are its
solution). No case was chosen by its answer, but how low the random fingers touch was: higher ones cage the
object, and most maxima are unbounded.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.hand.hand import Hand
from handfast.model.shape import Shape
from handfast.readers.grasp_file import from_dict, to_dict
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand
from handfast.stability.problem.model import reaction_range

DATA = Path(__file__).parent / "grasps"
INDEX = DATA / "index.json"
SIZES = (3, 4, 5, 6, 7, 8)
POWER = (10, 12, 15)
PER_SIZE = {"random": 20, "barrett": 4, "allegro": 4, "fixture": 8}
OPEN, WRAPPED = 8, 7  # power grasps per number of contacts
FAMILIES = ("random", "barrett", "allegro", "fixture", "power")
CONE = 0.6  # spread of the pull about the hand's outward axis
TWIST = 0.01  # [N m] per component, standard deviation of the torque beside 1 N
WEIGHT = 10.0  # [N] in a fixture
LEAST = 0.2  # share of a real hand's command that a finger keeps, if all in full do not balance
DIGITS = 9  # decimals in the stored files


@dataclass(frozen=True, eq=False)
class Case:
    """One question: the largest s such that base + s direction is resisted.

    Attributes:
        family: one of `FAMILIES`.
        direction, base: (6,) [N, N m], object frame.
    """

    name: str
    family: str
    grasp: Grasp
    direction: Array
    base: Array = field(default_factory=lambda: np.zeros(6))

    @property
    def contacts(self) -> int:
        return self.grasp.m


def cases(families: tuple[str, ...] = FAMILIES) -> list[Case]:
    """The whole set, always the same, by family and number of contacts."""
    made = [c for family in families for c in MAKERS[family]()]
    return sorted(made, key=lambda c: (FAMILIES.index(c.family), c.contacts))


def fingerprint(chosen: list[Case]) -> str:
    """SHA-256 of all numbers of the cases, rounded to eight decimals."""
    digest = hashlib.sha256()
    for case in chosen:
        g, mech = case.grasp, case.grasp.mechanism
        contacts = [np.r_[c.position, c.normal, c.friction] for c in g.contacts]
        joints = [np.r_[j.axis, j.origin, j.moves] for j in g.joints]
        digest.update(case.name.encode())
        for a in (*contacts, *joints, mech.R, mech.A, g.command, case.direction, case.base):
            digest.update((np.round(a, 8) + 0.0).tobytes())
    return digest.hexdigest()


# --- random grasps ------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Quadric:
    """A superquadric: semi-axes [m], exponent 2 an ellipsoid, 8 nearly a box."""

    axes: Array
    exponent: float

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> Quadric:
        return cls(rng.uniform(0.02, 0.05, 3), float(rng.choice([2.0, 4.0, 8.0])))

    def contact(self, azimuth: float, elevation: float, friction: float, link: str) -> Contact:
        """The surface point in a direction from the middle, its normal inwards."""
        flat = np.cos(elevation)
        u = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)]) / self.axes
        u /= (np.abs(u) ** self.exponent).sum() ** (1 / self.exponent)
        outward = np.sign(u) * np.abs(u) ** (self.exponent - 1) / self.axes
        return Contact(self.axes * u, -outward / np.linalg.norm(outward), friction, link)


@dataclass
class Sketch:
    """A grasp in the making: fingers come up from a palm below the object."""

    rng: np.random.Generator
    body: Quadric
    friction: float
    contacts: list[Contact] = field(default_factory=list)
    joints: list[GraspJoint] = field(default_factory=list)
    preload: dict[str, float] = field(default_factory=dict)

    def touch(self, azimuth: float, elevation: float, link: str) -> None:
        self.contacts.append(self.body.contact(azimuth, elevation, self.friction, link))

    def finger(self, name: str, azimuth: float, count: int, joints: int, reach: tuple[float, float]) -> None:
        """A finger with `count` contacts between two elevations; the uppermost is its tip's."""
        rng, first = self.rng, len(self.contacts)
        middle = (sum(reach) + 0.2) / 2
        heights = np.linspace(*reach, count) if count > 1 else np.array([middle])
        for height in np.sort(heights + 0.1 * rng.normal(size=count)):
            self.touch(azimuth + 0.3 * rng.normal(), height, name)
        tip = self.contacts[-1]
        outward = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        base = 0.8 * self.body.axes[:2].max() * outward - [0, 0, self.body.axes[2] + 0.03] + 0.005 * rng.normal(size=3)
        axis = np.cross(tip.position - base, tip.normal)
        axis /= np.linalg.norm(axis)  # a positive motion presses the tip on
        for j in range(joints):
            along = j / joints
            origin = (1 - along) * base + along * (tip.position + 0.02 * outward)
            moves = tuple(first + i for i in range(count) if max(1, joints - (count - 1 - i)) > j)
            self.joints.append(GraspJoint(f"{name}_{j}", axis, origin, moves))
        self.preload[f"{name}_0"] = float(rng.uniform(0.05, 0.15))

    def grasp(self, name: str) -> Grasp:
        return Grasp(self.contacts, self.joints, preload=self.preload, name=name)


def random_case(m: int, seed: int, *, wrapped: bool = False) -> Case:
    """m contacts of a hand that comes from below; `wrapped` reaches higher and adds contacts on the palm."""
    rng = np.random.default_rng([m, seed, wrapped])
    sketch = Sketch(rng, Quadric.drawn(rng), rng.uniform(0.3, 0.8))
    fingers = int(rng.integers(3, 5)) if wrapped else int(rng.integers(2, min(4, m) + 1))
    palm = int(rng.integers(2, 4)) if wrapped else 0
    turn = rng.uniform(0, 2 * np.pi)
    for k in range(palm):
        sketch.touch(turn + 2 * np.pi * k / palm + 0.3 * rng.normal(), -1.2 + 0.1 * rng.normal(), "palm")
    joints = 3 if fingers == 2 else 2
    for f in range(fingers):
        count = len(range(f, m - palm, fingers))
        reach = (-0.7, 0.1) if wrapped else (-0.5, -0.1)
        azimuth = turn + 2 * np.pi * f / fingers + 0.2 * rng.normal()
        sketch.finger(f"finger_{f + 1}", azimuth, count, joints, reach)
    name = f"{'wrapped' if wrapped else 'random'} {m} {seed}"
    grasp = sketch.grasp(name)
    return Case(name, "random", grasp, pull(rng, grasp, np.array([0, 0, 1.0])))


def pull(rng: np.random.Generator, grasp: Grasp, outward: Array) -> Array:
    """(6,) a unit force about `outward` at the middle of the contacts, and a small torque."""
    across = rng.normal(size=3)
    across -= outward * (outward @ across)
    force = outward + CONE * across
    force /= np.linalg.norm(force)
    middle = np.mean([c.position for c in grasp.contacts], axis=0)
    return np.r_[force, np.cross(middle, force) + TWIST * rng.normal(size=3)]


def randoms() -> Iterator[Case]:
    for m, seeds in index()["random"].items():
        yield from (random_case(int(m), seed) for seed in seeds)


def powers() -> Iterator[Case]:
    for kind in ("open", "wrapped"):
        for m, seeds in index()[kind].items():
            for seed in seeds:
                yield replace(random_case(int(m), seed, wrapped=kind == "wrapped"), family="power")


def presses(grasp: Grasp) -> bool:
    """Is there a load of the contacts, inside the friction cones, that balances the commands alone?"""
    return pressing(grasp, 1.0) is not None


def pressing(grasp: Grasp, least: float, edges: int = 16) -> Array | None:
    """(a,) the strongest commands between a share of the grasp's and all of them that press; None if none do.

    They press if some load of the contacts, inside the friction cones, balances them alone. Actuators
    without a command are locked and carry anything.
    """
    from scipy.optimize import linprog

    angle = 2 * np.pi * np.arange(edges) / edges
    rays = np.zeros((3 * grasp.m, edges * grasp.m))
    for i, mu in enumerate(grasp.mu):
        rays[3 * i : 3 * i + 3, edges * i : edges * (i + 1)] = np.ones(edges), mu * np.cos(angle), mu * np.sin(angle)
    mech, size = grasp.mechanism, grasp.size
    n, others = rays.shape[1], mech.a + len(mech.A)
    object_rows = np.hstack([grasp.G @ rays / np.r_[np.ones(3), np.full(3, size)][:, None], np.zeros((6, others))])
    joint_rows = np.hstack([grasp.J.T @ rays, -mech.R.T, -mech.A.T]) / size
    rows = np.vstack([object_rows, joint_rows])
    given = [(least * f, f) if f else (None, None) for f in grasp.command]
    bounds = [(0, None)] * n + given + [(None, None)] * len(mech.A)
    cost = np.r_[np.zeros(n), np.where(grasp.command != 0, -1.0, 0.0), np.zeros(len(mech.A))]
    right = np.zeros(len(rows))
    if any(joint.friction or joint.torque or joint.stop for joint in grasp.joints):  # what joints carry themselves
        rows = np.hstack([rows, np.vstack([np.zeros((6, grasp.l)), -np.eye(grasp.l) / size])])
        cost = np.r_[cost, np.zeros(grasp.l)]
        bounds += [tuple(bound) for bound in np.column_stack(reaction_range(grasp))]
        right[6:] = [joint.torque / size for joint in grasp.joints]
    found = linprog(cost, A_eq=rows, b_eq=right, bounds=bounds)
    return np.where(grasp.command != 0, found.x[n : n + mech.a], 0.0) if found.status == 0 else None


# --- fixtures -----------------------------------------------------------------------------------


def fixtures() -> Iterator[Case]:
    kinds = (table, nest, corner)
    for m in SIZES:
        for seed in range(PER_SIZE["fixture"]):
            yield fixture_case(m, seed, kinds[seed % len(kinds)])


def fixture_case(m: int, seed: int, kind: Callable[[np.random.Generator, int, float], list[Contact]]) -> Case:
    """A weight of 10 N on fixed contacts, and a push."""
    rng = np.random.default_rng([m, seed, 2])
    name = f"{kind.__name__} {m} {seed}"
    grasp = Grasp(kind(rng, m, rng.uniform(0.2, 0.6)), name=name)
    down = np.array([0, 0, -WEIGHT])
    centre = np.r_[rng.normal(0, 0.005, 2), 0.03]
    force = rng.normal(size=3) * [1, 1, 0.4]
    force /= np.linalg.norm(force)
    push = np.r_[force, np.cross(centre, force) + TWIST * rng.normal(size=3)]
    return Case(name, "fixture", grasp, push, np.r_[down, np.cross(centre, down)])


def table(rng: np.random.Generator, m: int, mu: float) -> list[Contact]:
    """Points on a plane around the object."""
    angles = 2 * np.pi * (np.arange(m) + 0.3 * rng.normal(size=m)) / m
    radii = rng.uniform(0.03, 0.06, m)
    up = np.array([0, 0, 1.0])
    return [Contact(np.array([r * np.cos(a), r * np.sin(a), 0]), up, mu) for a, r in zip(angles, radii, strict=True)]


def nest(rng: np.random.Generator, m: int, mu: float) -> list[Contact]:
    """Points below a superquadric."""
    body = Quadric.drawn(rng)
    turn = rng.uniform(0, 2 * np.pi)
    spots = [(turn + 2 * np.pi * (k + 0.2 * rng.normal()) / m, -0.8 + 0.2 * rng.normal()) for k in range(m)]
    return [body.contact(azimuth, elevation, mu, "") for azimuth, elevation in spots]


def corner(rng: np.random.Generator, m: int, mu: float) -> list[Contact]:
    """A box on three, two and one points of a floor and two walls and more, tilted so that it leans on all."""
    half = 0.04
    up = np.array([0.35, 0.25, 1.0]) / np.linalg.norm([0.35, 0.25, 1.0])  # in the corner's frame
    side = np.cross([0, 1.0, 0], up) / np.hypot(up[0], up[2])
    turn = np.array([side, np.cross(up, side), up])
    counts = [len(range(k, m, 6)) for k in range(6)]
    faces = [2] * sum(counts[0:6:2]) + [0] * (counts[1] + counts[3]) + [1] * counts[5]  # floor, wall, wall
    out = []
    for axis in faces:
        point = rng.uniform(-half, half, 3)
        point[axis] = -half
        normal = np.eye(3)[axis]
        out.append(Contact(turn @ point + [0, 0, half], turn @ normal, mu))
    return out


# --- real hands: stored, and how they are made --------------------------------------------------


@cache
def index() -> dict[str, Any]:
    """Seeds of the random families, and directions of the stored grasps."""
    return json.loads(INDEX.read_text("utf-8"))


def stored(family: str) -> Callable[[], Iterator[Case]]:
    def read() -> Iterator[Case]:
        for name, entry in index()[family].items():
            data = json.loads((DATA / f"{name}.json").read_text("utf-8"))
            yield Case(name, family, from_dict(data), np.array(entry["direction"]))

    return read


MAKERS: dict[str, Callable[[], Iterator[Case]]] = {
    "random": randoms,
    "barrett": stored("barrett"),
    "allegro": stored("allegro"),
    "fixture": fixtures,
    "power": powers,
}


@dataclass(frozen=True, eq=False)
class Rig:
    """How a hand is tried on objects.

    Attributes:
        outward: (3,) from the palm to where objects are, hand frame.
        near: (3,) [m] where the middle of an object goes, give or take `spread`.
        still: joints that do not close, with the range of their value.
        command: actuator -> largest preload if its joint was stopped by a touch.
    """

    hand: Hand
    outward: Array
    near: Array
    spread: Array
    still: dict[str, tuple[float, float]]
    command: dict[str, float]

    def drawn(self, body: Body, turn: Array, rng: np.random.Generator) -> tuple[Hand, Array, Array, float]:
        """The hand with its still joints, where they stand, the object's pose (4, 4) under a turn (3, 3), friction."""
        pose = np.eye(4)
        pose[:3, :3] = turn
        middle = (body.vertices.max(axis=0) + body.vertices.min(axis=0)) / 2
        pose[:3, 3] = self.near + rng.uniform(-1, 1, 3) * self.spread - pose[:3, :3] @ middle
        hand = self.hand.with_closing(dict.fromkeys(self.still, 0))
        start = hand.configuration({j: float(rng.uniform(*r)) for j, r in self.still.items()})
        return hand, start, pose, float(np.round(rng.uniform(0.4, 0.8), 2))


def rigs(shared: Path) -> dict[str, list[Rig]]:
    """Both Barretts and the Allegro."""
    z = np.array([0, 0, 1.0])
    above, about = np.array([0, 0, 0.12]), np.array([0.015, 0.02, 0.025])
    wide = (0.0, 1.2)
    bundled = Rig(
        load_hand("barrett-bh8-280"), z, above, about, {"finger_1_spread": wide},
        {f"finger_{k}_prox": 1.0 for k in (1, 2, 3)},
    )  # fmt: skip
    vendor = Rig(
        load_hand(shared / "hands/barrett_hand/bhand_model.urdf"), z, above, about,
        {"finger_1_prox_joint": (-1.2, 0.0), "finger_2_prox_joint": (0.0, 1.2)},
        {f"finger_{k}_med_joint": 1.0 for k in (1, 2, 3)},
    )  # fmt: skip
    allegro = Rig(
        load_hand(shared / "hands/allegro_hand/allegro_hand_right.urdf"), np.array([1.0, 0, 0]),
        np.array([0.08, 0.0, 0.04]), np.array([0.02, 0.02, 0.03]),
        {"joint_0.0": (-0.1, 0.1), "joint_4.0": (-0.1, 0.1), "joint_8.0": (-0.1, 0.1),
         "joint_12.0": (1.0, 1.39), "joint_13.0": (-0.1, 0.5)},
        {f"joint_{k}.0": 0.3 for k in (1, 5, 9, 14)},
    )  # fmt: skip
    return {"barrett": [bundled, vendor], "allegro": [allegro]}


def bodies(shared: Path) -> list[Body]:
    """Bundled objects, primitives and YCB."""
    solids = {"ball": ("sphere", [0.035]), "rod": ("cylinder", [0.025, 0.16]), "can": ("cylinder", [0.04, 0.09]),
              "brick": ("box", [0.05, 0.07, 0.10]), "cube": ("box", [0.06, 0.06, 0.06]),
              "egg": ("ellipsoid", [0.03, 0.04, 0.05])}  # fmt: skip
    primitives = [Body.of([Shape(kind, size)], name=name) for name, (kind, size) in solids.items()]
    files = sorted((shared / "objects/ycb").glob("*.obj"))
    return [load_body(n) for n in ("jar", "flask", "slab")] + primitives + [load_body(f) for f in files]


def attempt(rig: Rig, body: Body, rng: np.random.Generator) -> tuple[Grasp, Array] | None:
    """One trial: a pose, closing, contacts. None if it is no grasp of 3 to 8 contacts that can press."""
    from scipy.spatial.transform import Rotation

    from handfast.geometry.contacts import contact_grasp
    from handfast.planning.closing import close

    turn = Rotation.random(rng=rng)
    if rng.random() < 0.6:  # faces along the hand's axes, so that they meet flat
        turn = Rotation.create_group("O")[int(rng.integers(24))]
    hand, start, pose, friction = rig.drawn(body, turn.as_matrix(), rng)
    try:
        closed = close(hand, start, body, pose)
        touched = {j for j, why in closed.stopped.items() if why.endswith("touches")}
        preload = {a: f for a, f in rig.command.items() if a in touched}
        grasp = contact_grasp(hand, closed.q, body, pose, preload=preload, friction=friction)
    except InputError:
        return None
    if not 3 <= grasp.m <= 8 or len(preload) < 2 or np.linalg.matrix_rank(grasp.G, tol=1e-6) < 6:
        return None
    commands = pressing(grasp, LEAST)
    if commands is None:
        return None
    grasp = grasp.with_preload(np.round(commands, 4))
    return grasp, pull(rng, grasp, turn.inv().apply(rig.outward))


def make_real(family: str, shared: Path) -> dict[str, dict[str, Any]]:
    """The first grasps of each number of contacts, each of another hand and object; written, and their index."""
    things = bodies(shared)
    taken: Counter[int] = Counter()
    seen: set[tuple[int, str]] = set()
    out: dict[str, dict[str, Any]] = {}
    for seed in range(4_000):
        if all(taken[m] == PER_SIZE[family] for m in SIZES):
            break
        rng = np.random.default_rng([FAMILIES.index(family), seed])
        choices = rigs_of(family, shared)
        rig, body = choices[seed % len(choices)], things[int(rng.integers(len(things)))]
        found = attempt(rig, body, rng)
        if found is None:
            continue
        grasp, direction = found
        key = (grasp.m, grasp.name)
        if key in seen or taken[grasp.m] == PER_SIZE[family]:
            continue
        seen.add(key)
        taken[grasp.m] += 1
        name = f"{family}_{grasp.m}_{taken[grasp.m]}"
        write(grasp, DATA / f"{name}.json")
        out[name] = {"grasp": grasp.name, "seed": seed, "direction": np.round(direction, DIGITS).tolist()}
        print(name, grasp.name, seed, file=sys.stderr, flush=True)
    return dict(sorted(out.items()))


@cache
def rigs_of(family: str, shared: Path) -> list[Rig]:
    return rigs(shared)[family]


def write(grasp: Grasp, path: Path) -> None:
    """The grasp with rounded numbers."""

    def rounded(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: rounded(v) for k, v in value.items()}
        if isinstance(value, list):
            return [rounded(v) for v in value]
        return round(value, DIGITS) + 0.0 if isinstance(value, float) else value

    path.write_text(json.dumps(rounded(to_dict(grasp)), indent=1) + "\n", encoding="utf-8")


def first_seeds(m: int, count: int, *, wrapped: bool = False) -> list[int]:
    """The first seeds whose preload presses."""
    found = (seed for seed in range(10_000) if presses(random_case(m, seed, wrapped=wrapped).grasp))
    return [next(found) for _ in range(count)]


def make(shared: Path) -> None:
    """Choose the seeds, make the stored grasps, write the index."""
    DATA.mkdir(exist_ok=True)
    data: dict[str, Any] = {
        "random": {m: first_seeds(m, PER_SIZE["random"]) for m in SIZES},
        "open": {m: first_seeds(m, OPEN) for m in POWER},
        "wrapped": {m: first_seeds(m, WRAPPED, wrapped=True) for m in POWER},
    }
    for family in ("barrett", "allegro"):
        data[family] = make_real(family, shared)
    INDEX.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def summary() -> str:
    """How many of each family and number of contacts, as Markdown."""
    count = Counter((c.family, c.contacts) for c in cases())
    sizes = (*SIZES, *POWER)
    lines = ["| family | " + " | ".join(map(str, sizes)) + " |", "|---|" + "---:|" * len(sizes)]
    for f in FAMILIES:
        lines.append(f"| {f} | " + " | ".join(str(count[f, m] or "") for m in sizes) + " |")
    total = sum(n for (_, m), n in count.items() if m in SIZES)
    return "\n".join([*lines, "", f"{total} with 3 to 8 contacts, {fingerprint(cases())}"])


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--make", action="store_true", help="choose seeds, make and write the stored grasps")
    shared = Path(__file__).parents[2] / "shared"
    parser.add_argument("--shared", type=Path, default=shared, help="folder with hands/ and objects/")
    options = parser.parse_args()
    if options.make:
        make(options.shared)
        index.cache_clear()
    print(summary())


if __name__ == "__main__":
    main()
