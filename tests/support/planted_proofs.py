"""Tasks with a planted configuration and its proof of existence.

The object is made to fit: a configuration is drawn, a point chosen on each hand region, and the object region laid
through it with the opposite normal.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.model.cylinder_side import ConeSide, CylinderSide
from handfast.model.hand import Coupling, Hand, Joint, Link
from handfast.model.hand.hand import coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.model.region import Bezier, Cap, Region
from handfast.proofs.configurations import AND, ContactPoint, Existence
from handfast.proofs.contact_equations import ContactEquations
from handfast.proofs.replay import Replay
from handfast.proofs.tasks import TaskData, read_task
from handfast.readers.load_hand import load_hand
from handfast.synthesis import solution
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from tests.support.contact_equations import contact_equations, joint_values, link_poses, patch_at, surface_at


@dataclass(frozen=True, eq=False)
class PlantedProof:
    """A task with a configuration that solves it but for rounding."""

    task: Task
    values: dict[str, float]  # by label

    @property
    def labels(self) -> list[str]:
        return list(self.values)

    def jacobian(self) -> Array:
        """(E, N) of `contact_equations`, by central differences."""
        x, h = np.array(list(self.values.values())), 1e-6
        steps = x + h * np.concatenate([np.eye(len(x)), -np.eye(len(x))])
        up, down = np.split(contact_equations(self.task, self.labels, steps), 2)
        return (up - down).T / (2 * h)

    def proof(self, angle: float = 1e-7, length: float = 3e-9, prefer: str = "", **changes: float) -> Existence:
        """With the dependent coordinates that column-pivoted QR picks; coordinates may be changed."""
        dependent = dependent_of(self, prefer)
        prismatic = {f"joint:{j.name}" for j in self.task.hand.joints if j.type == "prismatic"}
        in_metres = [label.startswith("position") or label in prismatic for label in dependent]
        values = self.values | changes
        at = {name: values[f"joint:{name}"] for name in self.task.free}
        contacts = tuple(
            ContactPoint(
                pair.link,
                (values[f"contact:{k}:s"], values[f"contact:{k}:t"]),
                (values[f"contact:{k}:u"], values[f"contact:{k}:v"]) if not isinstance(pair.hand, Cap) else None,
            )
            for k, pair in enumerate(self.task.contact_pairs)
        )
        pose = [np.array([values[f"{name}:{i}"] for i in range(n)]) for name, n in (("position", 3), ("quaternion", 4))]
        return Existence(at, *pose, contacts, tuple(dependent), np.where(in_metres, length, angle))

    def slack(self, label: str) -> float:
        kind, x = label.split(":"), self.values[label]
        if kind[0] == "joint":
            joint = self.task.hand.joints[self.task.hand.joint(kind[1])]
            return min(x - joint.lower, joint.upper - x)
        if kind[0] == "contact":
            pair = self.task.contact_pairs[int(kind[1])]
            if not isinstance(pair.object if kind[2] in "st" else pair.hand, Cap):
                return min(x, 1 - x)
        return 0.1 if kind[0] == "position" else 1.0


@cache
def dependent_of(planted: PlantedProof, prefer: str) -> list[str]:
    """Labels that column-pivoted QR picks, columns scaled by slack; one of them as if it had 100 times as much."""
    J = planted.jacobian() * [planted.slack(x) * (100 if x == prefer else 1) for x in planted.labels]
    largest = max(range(4), key=lambda i: abs(planted.values[f"quaternion:{i}"]))
    J[:, planted.labels.index(f"quaternion:{largest}")] = 0
    _, _, order = scipy.linalg.qr(J, pivoting=True, mode="economic")
    return [planted.labels[i] for i in order[: len(J)]]


@dataclass(frozen=True)
class Spot:
    """What to plant: a link and the kinds of the two regions."""

    link: str
    hand: str = "cap"
    object: str = "bicubic"


DEGREES = {"bilinear": (1, 1), "bicubic": (3, 3), "mixed": (2, 4)}
KINDS = (*DEGREES, "cap")


def plant(hand: Hand, spots: list[Spot], rng: np.random.Generator, far: float = 0.0) -> PlantedProof:
    """Draw a configuration, and make the object's regions fit; `far` [m] is where the object's origin is."""
    anything = Cap(np.zeros(3), 1.0, np.ones(3), 1.0)
    task = Task(hand, tuple(ContactPair(s.link, anything, anything) for s in spots), PoseBounds.none())
    values: dict[str, float] = {}
    for name in task.free:
        joint = hand.joints[hand.joint(name)]
        values[f"joint:{name}"] = joint.lower + (joint.upper - joint.lower) * rng.uniform(0.15, 0.85)
    quaternion = rng.normal(size=4)
    position = rng.normal(size=3) * 0.05 + far * rng.normal(size=3)
    values |= {f"position:{i}": x for i, x in enumerate(position.tolist())}
    values |= {f"quaternion:{i}": x for i, x in enumerate(quaternion.tolist())}
    at = {label: np.array([x]) for label, x in values.items()}
    poses = link_poses(hand, joint_values(hand, at, np.ones(1)), np.ones(1))
    R = Rotation.from_quat(quaternion[[1, 2, 3, 0]]).as_matrix()
    pairs = []
    for k, spot in enumerate(spots):
        (R_k,), (p_k,) = poses[hand.link(spot.link)]
        n = _direction(rng)
        on_hand, uv = surface_through(spot.hand, 0.02 * rng.normal(size=3), n, rng)
        point = surface_at(on_hand, *np.array(uv)[:, None])[0][0]
        x, normal = R.T @ (R_k @ point + p_k - position), -R.T @ R_k @ n
        on_object, st = surface_through(spot.object, x, normal, rng)
        values |= dict(zip((f"contact:{k}:s", f"contact:{k}:t"), st, strict=True))
        if not isinstance(on_hand, Cap):
            values |= dict(zip((f"contact:{k}:u", f"contact:{k}:v"), uv, strict=True))
        pairs.append(ContactPair(spot.link, on_hand, on_object))
    return PlantedProof(replace(task, contact_pairs=tuple(pairs)), values)


def surface_through(kind: str, x: Array, n: Array, rng: np.random.Generator) -> tuple[Region, tuple[float, float]]:
    """A region with the outward unit normal n at the point x, and the parameters there."""
    flip = bool(rng.integers(2))
    if kind == "cap":
        radius, half = rng.uniform(0.005, 0.03), rng.uniform(0.5, np.pi)
        direction = -n if flip else n
        off = Rotation.from_rotvec(rng.uniform(0.1, 0.8) * half * _across(direction, rng))
        cap = Cap(x - radius * direction, radius, off.apply(direction), half, flip)
        a, b, c = cap.frame.T @ direction
        return cap, (float(np.arctan2(np.hypot(a, b), c)), float(np.arctan2(b, a)))
    if kind == "side":
        return _side_through(x, -n if flip else n, flip, rng)
    M, N = DEGREES[kind]
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, M + 1), np.linspace(-1, 1, N + 1), indexing="ij"), -1)
    points = np.concatenate([grid, np.zeros((M + 1, N + 1, 1))], -1) + 0.12 * rng.normal(size=(M + 1, N + 1, 3))
    s, t = rng.uniform(0.15, 0.85, size=2)
    found = patch_at(0.02 * points, -1.0 if flip else 1.0, np.array([s]), np.array([t]))
    at, normal, (tangent, _) = (np.array(a)[..., 0, :] for a in found)
    here = np.column_stack([normal, tangent / np.linalg.norm(tangent), np.cross(normal, tangent)])
    here[:, 2] /= np.linalg.norm(here[:, 2])
    across = _across(n, rng)
    there = np.column_stack([n, across, np.cross(n, across)])
    return Bezier((0.02 * points - at) @ (there @ here.T).T + x, flip), (float(s), float(t))


def _side_through(x: Array, out: Array, flip: bool, rng: np.random.Generator) -> tuple[Region, tuple[float, float]]:
    """Part of a cylinder's or a cone's side through x, whose normal there is `out`, away from the axis."""
    axis, radius, (u, v) = _across(out, rng), rng.uniform(0.005, 0.03), rng.uniform(0.15, 0.85, size=2)
    turn, length, first, lowest = rng.uniform(0.5, 6.2), rng.uniform(0.01, 0.05), *rng.uniform(-3, 3, size=2)
    zero = Rotation.from_rotvec(-(first + u * turn) * axis).apply(out)
    lowest *= 0.01
    center, ranges = x - radius * out - (lowest + v * length) * axis, ((first, first + turn), (lowest, lowest + length))
    if first < 0:
        return CylinderSide(center, radius, axis, zero, *ranges, flip), (float(u), float(v))
    grows = radius * np.sin(first)  # of any sign, and less than the radius
    tilt = np.arctan2(grows, length)
    side = np.cross(out, axis)
    axis, away = (Rotation.from_rotvec(tilt * side).apply(w) for w in (axis, out))
    zero = Rotation.from_rotvec(-(first + u * turn) * axis).apply(away)
    center = x - radius * away - (lowest + v * length) * axis
    return ConeSide(center, (radius - v * grows, radius + (1 - v) * grows), axis, zero, *ranges, flip), (u, v)


def _direction(rng: np.random.Generator) -> Array:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def _across(n: Array, rng: np.random.Generator) -> Array:
    v = np.cross(n, rng.normal(size=3))
    return v / np.linalg.norm(v)


def odd_hand(rng: np.random.Generator) -> Hand:
    """Every kind of joint and coupling: see the comments. Frames, axes and anchors are random."""
    ratio, offset = rng.choice([-1, 1], 4) * rng.uniform(0.3, 1.2, 4), rng.uniform(-0.5, 0.5, 4)
    parts = [  # link, parent, its joints: name and type
        ("a1", "palm", {"a1": "revolute"}),
        ("a2", "a1", {"a2": "revolute"}),
        ("a3", "a2", {"a3": "revolute"}),  # follows a2
        ("b1", "palm", {"b1": "revolute", "b2": "prismatic"}),  # two joints of one link
        ("b_pad", "b1", {}),  # a fixed link on the way
        ("b3", "b_pad", {"b3": "revolute"}),
        ("c1", "palm", {"c1": "prismatic"}),
        ("c2", "c1", {"c2": "revolute"}),  # follows a1, on another finger
        ("c3", "c2", {"c3": "revolute"}),  # follows c2
        ("d1", "palm", {"d1": "revolute"}),  # fixed by its limits
        ("d2", "d1", {"d2": "revolute"}),  # follows d1
        ("d3", "d2", {"d3": "prismatic"}),  # stands where a coupling to nothing holds it
        ("d4", "d3", {"d4": "revolute"}),
        ("tip", "d4", {}),  # a fixed link at the end
    ]
    links, joints = [Link("palm", -1, np.eye(4))], []
    for link, parent, own in parts:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), 0.04 * rng.normal(size=3)
        first = len(joints)
        for name, kind in own.items():
            reach = 0.03 if kind == "prismatic" else 1.3
            where = _direction(rng), 0.01 * rng.normal(size=3)
            joints.append(Joint(name, kind, *where, -reach, reach, ref=0.3 * reach * rng.normal()))
        up = next(i for i, other in enumerate(links) if other.name == parent)
        links.append(Link(link, up, pose, tuple(range(first, len(joints)))))
    number = {joint.name: j for j, joint in enumerate(joints)}
    ties = (("a3", "a2"), ("c2", "a1"), ("c3", "c2"), ("d2", "d1"))
    couplings = [Coupling(number[j], number[k], r, o) for (j, k), r, o in zip(ties, ratio, offset, strict=True)]
    couplings.append(Coupling(number["d3"], -1, 0.0, 0.01))
    for name in ("a3", "c2", "c3", "d2"):
        joints[number[name]] = replace(joints[number[name]], lower=-3.0, upper=3.0)
    fixed = float(rng.uniform(-1, 1))
    joints[number["d1"]] = replace(joints[number["d1"]], lower=fixed, upper=fixed)
    return hand_of(links, joints, couplings)


def hand_of(links: list[Link], joints: list[Joint], couplings: list[Coupling]) -> Hand:
    tied = {c.joint for c in couplings}
    driven = [j for j in range(len(joints)) if j not in tied]
    names = tuple(joints[j].name for j in driven)
    A = coupling_rows(tuple(couplings), len(joints))
    mechanism = Mechanism(names, np.eye(len(joints))[driven], A, (False,) * len(driven))
    return Hand("odd", tuple(links), tuple(joints), mechanism, tuple(couplings), np.zeros(len(joints)))


@cache
def sah() -> Hand:
    return load_hand("schunk-sah")


@cache
def odd_case(seed: int) -> PlantedProof:
    rng = np.random.default_rng(seed)
    hand = odd_hand(rng)
    links = rng.choice(hand.link_names, 1 + seed % 4)  # the same link twice, and the palm, now and then
    return plant(hand, [Spot(link, *rng.choice(KINDS, 2)) for link in links], rng, far=(seed % 5 == 0) * 1.0)


SAH_LINKS = ("index_distal", "thumb_distal", "index_proximal", "palm", "ring_middle")


@cache
def sah_case(seed: int, hand_kinds: tuple[str, ...] = KINDS, object_kinds: tuple[str, ...] = KINDS) -> PlantedProof:
    """1 to 5 contacts, in the order of SAH_LINKS."""
    rng = np.random.default_rng(seed)
    spots = [Spot(link, rng.choice(hand_kinds), rng.choice(object_kinds)) for link in SAH_LINKS[: 1 + seed % 5]]
    return plant(sah(), spots, rng)


def pose_of(planted: PlantedProof) -> tuple[Array, Array]:
    """Rotation and position of the object."""
    w, *v = (planted.values[f"quaternion:{i}"] for i in range(4))
    position = np.array([planted.values[f"position:{i}"] for i in range(3)])
    return Rotation.from_quat([*v, w]).as_matrix(), position


def all_joints(planted: PlantedProof) -> dict[str, float]:
    """Value of every joint that moves a contact, or follows one that does."""
    at = {label: np.array([x]) for label, x in planted.values.items()}
    q = joint_values(planted.task.hand, at, np.ones(1))
    return {planted.task.hand.joint_names[j]: float(x[0]) for j, x in q.items()}


def cone_edges(planted: PlantedProof) -> list[float]:
    """(K,) angle between the axis of each hand cap and the contact, as seen from its centre."""
    hand, at = planted.task.hand, {label: np.array([x]) for label, x in planted.values.items()}
    poses = link_poses(hand, joint_values(hand, at, np.ones(1)), np.ones(1))
    out = []
    for k, pair in enumerate(planted.task.contact_pairs):
        _, n, _ = surface_at(pair.object, at[f"contact:{k}:s"], at[f"contact:{k}:t"])
        outward = -pair.hand.sign * (pose_of(planted)[0] @ n[0])
        out.append(float(np.arccos(outward @ poses[planted.task.links[k]][0][0] @ pair.hand.axis)))
    return out


def limited(task: Task, name: str, lower: float, upper: float) -> Task:
    """With other limits of one joint."""
    joints = [replace(j, lower=lower, upper=upper) if j.name == name else j for j in task.hand.joints]
    return replace(task, hand=replace(task.hand, joints=tuple(joints)))


def reshaped(task: Task, k: int, **sides: dict) -> Task:
    """With other attributes of the hand's or the object's region of contact k."""
    pair = task.contact_pairs[k]
    new = replace(pair, **{side: replace(getattr(pair, side), **what) for side, what in sides.items()})
    return replace(task, contact_pairs=(*task.contact_pairs[:k], new, *task.contact_pairs[k + 1 :]))


def data_of(task: Task) -> TaskData:
    """A task as the checkers have it."""
    return read_task(task_to_dict(task))


def equations_of(task: Task) -> ContactEquations:
    return ContactEquations.of(data_of(task))


@dataclass(frozen=True)
class Report:
    """A replay of a proof of existence, its parts by name."""

    replay: Replay

    @property
    def ok(self) -> bool:
        return self.replay.ok

    @property
    def reasons(self) -> tuple[str, ...]:
        return tuple(self.replay.reason.split(AND)) if self.replay.reason else ()

    @property
    def slacks(self) -> dict[str, float]:
        return {label: x for label, x in self.replay.figures.items() if ":" in label}

    @property
    def contraction(self) -> float:
        return self.replay.figures["contraction"]

    @property
    def step(self) -> float:
        return self.replay.figures["step"]

    @property
    def gap(self) -> float:
        return self.replay.figures["gap"]


def verify_existence(task: Task, proof: Existence) -> Report:
    return Report(solution.verify_existence(task, proof))


def refused(task: Task, proof: Existence, message: str) -> Report:
    report = verify_existence(task, proof)
    assert not report.ok
    assert len(report.reasons) >= 1
    assert all("\n" not in reason for reason in report.reasons)
    assert any(re.search(message, reason) for reason in report.reasons), report.reasons
    return report
