"""Proofs of existence: planted right ones are accepted, planted wrong ones refused with their own reason.

The object is made to fit: a configuration is drawn, a point chosen on each hand region, and the object
region laid through it with the opposite normal. `contact_equations` is written again here, with other
formulas, for float arrays and for balls of arbitrary precision.
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.hand import Coupling, Hand, Joint, Link, load_hand
from handfast.model.hand.hand import coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.model.region import Bezier, Cap, Region
from handfast.synthesis.certify.equations import equations_of
from handfast.synthesis.certify.existence import (
    ContactPoint,
    Existence,
    existence_from_dict,
    existence_to_dict,
    free_joints,
)
from handfast.synthesis.certify.interval_arithmetic import Interval
from handfast.synthesis.certify.verify_existence import Report, verify_existence
from handfast.synthesis.task import ContactPair, PoseBounds, Task
from tests.support.places import ROOT

# --- the equations, once more -----------------------------------------------------------------------


def contact_equations(task: Task, labels: list[str], x: Array) -> Array:
    """(B, E) at coordinates (B, N) in the order of `labels`; floats or, in object arrays, balls."""
    hand, one = task.hand, x[:, 0] * 0 + 1
    at = {label: x[:, n] for n, label in enumerate(labels)}
    poses = _link_poses(hand, _joint_values(hand, at, one), one)
    w, *v = (at[f"quaternion:{i}"] for i in range(4))
    length = w * w + sum(c * c for c in v)
    # R y = y + 2 w v x y + 2 v x (v x y) for a unit quaternion
    V = _cross_matrix(np.stack(v, -1))
    R = np.eye(3) + 2 * (_times(V, w) + V @ V) / length[:, None, None]
    position = np.stack([at[f"position:{i}"] for i in range(3)], -1)
    out = []
    for k, pair in enumerate(task.contact_pairs):
        R_k, p_k = poses[task.links[k]]
        o, n, tangents = _surface(pair.object, at[f"contact:{k}:s"], at[f"contact:{k}:t"])
        if isinstance(pair.hand, Cap):
            here = pair.hand.center + one[:, None] * 0
            there = o + pair.hand.sign * pair.hand.radius * n
        else:
            here, m, _ = _surface(pair.hand, at[f"contact:{k}:u"], at[f"contact:{k}:v"])
            there = o
        out += [*(_apply(R_k, here) + p_k - position - _apply(R, there)).T]
        if isinstance(pair.hand, Bezier):
            out += [(_apply(R_k, m) * _apply(R, tangent)).sum(axis=-1) for tangent in tangents]
    return np.stack(out, -1)


def _joint_values(hand: Hand, at: dict, one: Array) -> dict[int, Array]:
    q = {}
    for j, joint in enumerate(hand.joints):
        if f"joint:{joint.name}" in at:
            q[j] = at[f"joint:{joint.name}"]
        elif joint.lower == joint.upper:
            q[j] = joint.lower * one
    q |= {c.joint: c.offset * one for c in hand.couplings if c.driver < 0}
    for _ in hand.couplings:
        q |= {c.joint: c.ratio * q[c.driver] + c.offset for c in hand.couplings if c.driver in q}
    return q


def _link_poses(hand: Hand, q: dict[int, Array], one: Array) -> list[tuple[Array, Array] | None]:
    eye, poses = np.eye(3) * one[:, None, None], []
    for link in hand.links:
        if not set(link.joints) <= set(q) or (link.parent >= 0 and poses[link.parent] is None):  # no contact there
            poses.append(None)
            continue
        R, p = poses[link.parent] if link.parent >= 0 else (eye, eye[:, 0] * 0)
        if link.parent >= 0:
            p = p + _apply(R, link.pose[:3, 3])
            x, y = (link.pose[:3, i] * one[:, None] for i in (0, 1))
            x = _normalised(x)
            y = _normalised(y - _times(x, (x * y).sum(axis=-1)))
            R = R @ np.stack([x, y, _product(x, y)], -1)
        for j in link.joints:
            joint, axis = hand.joints[j], _normalised(hand.joints[j].axis * one[:, None])
            value = q[j] - joint.ref
            if joint.type == "prismatic":
                p = p + _apply(R, _times(axis, value))
                continue
            # in the axis and across it, instead of with the squared cross product matrix
            along = axis[:, :, None] * axis[:, None, :]
            turn = _times(eye - along, np.cos(value)) + along + _times(_cross_matrix(axis), np.sin(value))
            p = p + _apply(R, joint.anchor - _apply(turn, joint.anchor))
            R = R @ turn
        poses.append((R, p))
    return poses


def _surface(region: Region, s: Array, t: Array) -> tuple[Array, Array, list[Array]]:
    """Point, outward unit normal and two tangents."""
    if isinstance(region, Bezier):
        return _patch(region.points, region.sign, s, t)
    axis = _normalised(region.axis + 0 * s[:, None])
    e1 = region.frame[:, 0] + 0 * s[:, None]
    e1 = _normalised(e1 - _times(axis, (axis * e1).sum(axis=-1)))
    e2 = _product(axis, e1)
    out = _times(e1, np.cos(t)) + _times(e2, np.sin(t))
    direction = _times(out, np.sin(s)) + _times(axis, np.cos(s))
    tangents = [_times(out, np.cos(s)) - _times(axis, np.sin(s)), _times(e2, np.cos(t)) - _times(e1, np.sin(t))]
    return region.center + region.radius * direction, region.sign * direction, tangents


def _patch(points: Array, sign: float, s: Array, t: Array) -> tuple[Array, Array, list[Array]]:
    points = points + 0 * s[:, None, None, None]
    first, second = ((points.shape[a] - 1) * np.diff(points, axis=a) for a in (1, 2))
    tangents = [_casteljau(p, s, t) for p in (first, second)]
    return _casteljau(points, s, t), sign * _normalised(_product(*tangents)), tangents


def _casteljau(points: Array, s: Array, t: Array) -> Array:
    while points.shape[1] > 1:
        points = points[:, :-1] + _times(np.diff(points, axis=1), s)
    while points.shape[2] > 1:
        points = points[:, :, :-1] + _times(np.diff(points, axis=2), t)
    return points[:, 0, 0]


def _times(a: Array, factor: Array) -> Array:
    """(B, ...) times (B,)."""
    return a * factor.reshape(-1, *[1] * (a.ndim - 1))


def _apply(R: Array, x: Array) -> Array:
    return (R * np.broadcast_to(x, (len(R), 3))[:, None, :]).sum(axis=-1)


def _product(a: Array, b: Array) -> Array:
    return np.stack([a[:, i - 2] * b[:, i - 1] - a[:, i - 1] * b[:, i - 2] for i in range(3)], -1)


def _cross_matrix(a: Array) -> Array:
    x, y, z = a.T
    return np.stack([np.stack(row, -1) for row in ((0 * x, -z, y), (z, 0 * x, -x), (-y, x, 0 * x))], -2)


def _normalised(a: Array) -> Array:
    return a / np.sqrt((a * a).sum(axis=-1))[:, None]


# --- right ones, planted ----------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Planted:
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
        at = {name: values[f"joint:{name}"] for name in free_joints(self.task)}
        contacts = tuple(
            ContactPoint(
                pair.link,
                (values[f"contact:{k}:s"], values[f"contact:{k}:t"]),
                (values[f"contact:{k}:u"], values[f"contact:{k}:v"]) if isinstance(pair.hand, Bezier) else None,
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
            if isinstance(pair.object if kind[2] in "st" else pair.hand, Bezier):
                return min(x, 1 - x)
        return 0.1 if kind[0] == "position" else 1.0


@cache
def dependent_of(planted: Planted, prefer: str) -> list[str]:
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


def plant(hand: Hand, spots: list[Spot], rng: np.random.Generator, far: float = 0.0) -> Planted:
    """Draw a configuration, and make the object's regions fit; `far` [m] is where the object's origin is."""
    anything = Cap(np.zeros(3), 1.0, np.ones(3), 1.0)
    task = Task(hand, tuple(ContactPair(s.link, anything, anything) for s in spots), PoseBounds.none())
    values: dict[str, float] = {}
    for name in free_joints(task):
        joint = hand.joints[hand.joint(name)]
        values[f"joint:{name}"] = joint.lower + (joint.upper - joint.lower) * rng.uniform(0.15, 0.85)
    quaternion = rng.normal(size=4)
    position = rng.normal(size=3) * 0.05 + far * rng.normal(size=3)
    values |= {f"position:{i}": x for i, x in enumerate(position.tolist())}
    values |= {f"quaternion:{i}": x for i, x in enumerate(quaternion.tolist())}
    at = {label: np.array([x]) for label, x in values.items()}
    poses = _link_poses(hand, _joint_values(hand, at, np.ones(1)), np.ones(1))
    R = Rotation.from_quat(quaternion[[1, 2, 3, 0]]).as_matrix()
    pairs = []
    for k, spot in enumerate(spots):
        (R_k,), (p_k,) = poses[hand.link(spot.link)]
        n = _direction(rng)
        on_hand, uv = surface_through(spot.hand, 0.02 * rng.normal(size=3), n, rng)
        point = _surface(on_hand, *np.array(uv)[:, None])[0][0]
        x, normal = R.T @ (R_k @ point + p_k - position), -R.T @ R_k @ n
        on_object, st = surface_through(spot.object, x, normal, rng)
        values |= dict(zip((f"contact:{k}:s", f"contact:{k}:t"), st, strict=True))
        if isinstance(on_hand, Bezier):
            values |= dict(zip((f"contact:{k}:u", f"contact:{k}:v"), uv, strict=True))
        pairs.append(ContactPair(spot.link, on_hand, on_object))
    return Planted(replace(task, contact_pairs=tuple(pairs)), values)


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
    M, N = DEGREES[kind]
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, M + 1), np.linspace(-1, 1, N + 1), indexing="ij"), -1)
    points = np.concatenate([grid, np.zeros((M + 1, N + 1, 1))], -1) + 0.12 * rng.normal(size=(M + 1, N + 1, 3))
    s, t = rng.uniform(0.15, 0.85, size=2)
    found = _patch(0.02 * points, -1.0 if flip else 1.0, np.array([s]), np.array([t]))
    at, normal, (tangent, _) = (np.array(a)[..., 0, :] for a in found)
    here = np.column_stack([normal, tangent / np.linalg.norm(tangent), np.cross(normal, tangent)])
    here[:, 2] /= np.linalg.norm(here[:, 2])
    across = _across(n, rng)
    there = np.column_stack([n, across, np.cross(n, across)])
    return Bezier((0.02 * points - at) @ (there @ here.T).T + x, flip), (float(s), float(t))


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
def odd_case(seed: int) -> Planted:
    rng = np.random.default_rng(seed)
    hand = odd_hand(rng)
    links = rng.choice(hand.link_names, 1 + seed % 4)  # the same link twice, and the palm, now and then
    return plant(hand, [Spot(link, *rng.choice(KINDS, 2)) for link in links], rng, far=(seed % 5 == 0) * 1.0)


SAH_LINKS = ("index_distal", "thumb_distal", "index_proximal", "palm", "ring_middle")


@cache
def sah_case(seed: int, hand_kinds: tuple[str, ...] = KINDS, object_kinds: tuple[str, ...] = KINDS) -> Planted:
    """1 to 5 contacts, in the order of SAH_LINKS."""
    rng = np.random.default_rng(seed)
    spots = [Spot(link, rng.choice(hand_kinds), rng.choice(object_kinds)) for link in SAH_LINKS[: 1 + seed % 5]]
    return plant(sah(), spots, rng)


def pose_of(planted: Planted) -> tuple[Array, Array]:
    """Rotation and position of the object."""
    w, *v = (planted.values[f"quaternion:{i}"] for i in range(4))
    position = np.array([planted.values[f"position:{i}"] for i in range(3)])
    return Rotation.from_quat([*v, w]).as_matrix(), position


def all_joints(planted: Planted) -> dict[str, float]:
    """Value of every joint that moves a contact, or follows one that does."""
    at = {label: np.array([x]) for label, x in planted.values.items()}
    q = _joint_values(planted.task.hand, at, np.ones(1))
    return {planted.task.hand.joint_names[j]: float(x[0]) for j, x in q.items()}


def cone_edges(planted: Planted) -> list[float]:
    """(K,) angle between the axis of each hand cap and the contact, as seen from its centre."""
    hand, at = planted.task.hand, {label: np.array([x]) for label, x in planted.values.items()}
    poses = _link_poses(hand, _joint_values(hand, at, np.ones(1)), np.ones(1))
    out = []
    for k, pair in enumerate(planted.task.contact_pairs):
        _, n, _ = _surface(pair.object, at[f"contact:{k}:s"], at[f"contact:{k}:t"])
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


@pytest.mark.parametrize("block", range(8))
@pytest.mark.parametrize("case", [odd_case, sah_case])
def test_planted_right_ones_are_accepted(case, block: int) -> None:
    for seed in range(14 * block, 14 * (block + 1)):
        planted = case(seed)
        report = verify_existence(planted.task, planted.proof())
        assert report.ok, (seed, report.reasons)
        assert report.reasons == ()
        assert report.gap < 1e-12
        assert report.step + report.contraction < 1
        assert min(report.slacks.values()) > 0


def test_bounds_that_leave_room_are_met() -> None:
    """A pose within bounds, and a joint limit and a cone as near as they may come."""
    planted = sah_case(3, ("cap",), ("bicubic",))
    R, p = pose_of(planted)
    near = PoseBounds(np.column_stack([p - 1e-7, p + 1e-7]), np.clip(np.stack([R.T - 1e-5, R.T + 1e-5], -1), -1.0, 1.0))
    report = verify_existence(replace(planted.task, pose=near), planted.proof())
    assert report.ok, report.reasons
    assert 0 < report.slacks["position:0"] < 1e-7
    assert 0 < report.slacks["x_axis:2"] < 1e-5
    for label in ("joint:index_distal", "joint:thumb_base"):
        name = label.removeprefix("joint:")
        narrow = limited(planted.task, name, -3.0, all_joints(planted)[name] + 1e-6)
        report = verify_existence(narrow, planted.proof())
        assert report.ok, report.reasons
        assert 0 < report.slacks[label] < 1e-6
    for k, edge in enumerate(cone_edges(planted)):
        report = verify_existence(reshaped(planted.task, k, hand={"half_angle": edge + 1e-5}), planted.proof())
        assert report.ok, report.reasons
        assert 0 < report.slacks[f"contact:{k}:cone"] < 1e-4


def test_no_bounds_are_no_bounds() -> None:
    planted = sah_case(2)
    position = np.array([[-np.inf, np.inf], [-np.inf, 9.0], [-9.0, np.inf]])
    axes = np.tile([-1.0, 1.0], (3, 3, 1))
    R, _ = pose_of(planted)
    axes[2, 1] = [R[1, 2] - 0.01, 1.0]
    report = verify_existence(replace(planted.task, pose=PoseBounds(position, axes)), planted.proof())
    assert report.ok, report.reasons
    assert [name for name in report.slacks if "axis" in name or "position" in name] == [
        "position:1",
        "position:2",
        "z_axis:1",
    ]
    assert 0.009 < report.slacks["z_axis:1"] < 0.01


def test_a_cap_may_be_passed_at_its_pole() -> None:
    """s on both sides of 0: the points of an object cap about its axis."""
    planted = sah_case(1, ("cap",), ("cap",))
    cap, values = planted.task.contact_pairs[0].object, planted.values
    pole, _, _ = _surface(cap, *(np.array([values[f"contact:0:{x}"]]) for x in "st"))
    turned = replace(cap, axis=pole[0] - cap.center)
    spun = replace(planted.task.contact_pairs[0], object=turned)
    again = Planted(
        replace(planted.task, contact_pairs=(spun, planted.task.contact_pairs[1])), values | {"contact:0:s": 0.0}
    )
    proof = again.proof(prefer="contact:0:s")
    assert "contact:0:s" in proof.dependent
    report = verify_existence(again.task, proof)
    assert report.ok, report.reasons


# --- wrong ones -------------------------------------------------------------------------------------

OPEN = r"do not meet the equations \(contact \d is open by"


def refused(task: Task, proof: Existence, message: str) -> Report:
    report = verify_existence(task, proof)
    assert not report.ok
    assert len(report.reasons) >= 1
    assert all("\n" not in reason for reason in report.reasons)
    assert any(re.search(message, reason) for reason in report.reasons), report.reasons
    return report


def test_a_point_that_is_moved() -> None:
    for seed in range(30):
        planted = (odd_case if seed % 2 else sah_case)(seed)
        rng = np.random.default_rng(seed)
        label = rng.choice([name for name in planted.labels if not name.endswith(":t")])  # around a pole t moves little
        wrong = planted.values[label] + 1e-4 * rng.choice([-1, 1])
        report = refused(planted.task, planted.proof(**{label: wrong}), OPEN)
        assert report.gap > 1e-7
        assert report.step > 1


def test_floats_that_are_swapped() -> None:
    planted = sah_case(3)
    v = planted.values
    for a, b in pairwise(["joint:index_proximal", "joint:index_middle", "joint:thumb_base"]):
        refused(planted.task, planted.proof(**{a: v[b], b: v[a]}), OPEN)
    refused(planted.task, planted.proof(**{"contact:0:s": v["contact:0:t"], "contact:0:t": v["contact:0:s"]}), OPEN)


@pytest.mark.parametrize("by", [1e-3, 1e-9, 0.0])
@pytest.mark.parametrize("upper", [False, True])
@pytest.mark.parametrize("name", ["index_proximal", "index_middle", "index_distal", "thumb_base"])
def test_a_limit_that_is_passed_or_reached(name: str, upper: bool, by: float) -> None:
    """index_distal follows index_middle. A free joint may be a dependent coordinate or a frozen one."""
    planted = sah_case(6)
    q = all_joints(planted)[name]
    task = limited(planted.task, name, -2.0, q - by) if upper else limited(planted.task, name, q + by, 2.0)
    report = refused(task, planted.proof(), f"joint {name} comes to .* not strictly inside")
    assert len(report.reasons) == 1
    assert report.slacks[f"joint:{name}"] <= 0
    assert report.step + report.contraction < 1


def test_bounds_that_pass_through_the_box() -> None:
    """The floats are within, the box of radius 1e-7 (3e-9 m) is not; a box a tenth as wide is."""
    planted = sah_case(1, ("cap",))
    R, p = pose_of(planted)
    none = PoseBounds.none()
    position, axes = np.array(none.position), np.array(none.axes)
    position[0, 1] = p[0] + 1e-9
    i, k = np.unravel_index(np.abs(R).argmin(), (3, 3))
    axes[k, i, 1] = R[i, k] + 1e-7
    edge = cone_edges(planted)[0]
    q = all_joints(planted)
    tasks = {
        "joint:index_middle": limited(planted.task, "index_middle", -2.0, q["index_middle"] + 3e-8),
        "joint:index_distal": limited(planted.task, "index_distal", q["index_distal"] - 3e-8, 2.0),
        "position:0": replace(planted.task, pose=PoseBounds(position, none.axes)),
        f"{'xyz'[k]}_axis:{i}": replace(planted.task, pose=PoseBounds(none.position, axes)),
        "contact:0:cone": reshaped(planted.task, 0, hand={"half_angle": edge + 5e-7}),
    }
    for label, task in tasks.items():
        prefer = "joint:index_middle" if label.startswith("joint") else "position:0"
        assert label.split(":")[0] != "joint" or prefer in planted.proof(prefer=prefer).dependent
        report = refused(task, planted.proof(prefer=prefer), "in the box, not strictly inside|may leave the hand's cap")
        assert len(report.reasons) == 1
        assert report.slacks[label] <= 0
        assert report.step + report.contraction < 1
        report = verify_existence(task, planted.proof(1e-8, 3e-10, prefer=prefer))
        assert report.ok, (label, report.reasons)


def test_an_edge_that_passes_through_the_box() -> None:
    planted, label = sah_case(1, ("bicubic",), ("bicubic",)), "contact:1:v"
    near = 1 - 3e-8
    cut = planted.task.contact_pairs[1].hand.restricted((0, 1), (0, planted.values[label] / near))
    task = reshaped(planted.task, 1, hand={"points": cut.points})
    wide, narrow = (planted.proof(r, 3e-9, prefer=label, **{label: near}) for r in (1e-7, 1e-8))
    assert label in wide.dependent
    report = refused(task, wide, f"{label} comes to .* not strictly inside")
    assert len(report.reasons) == 1
    assert report.step + report.contraction < 1
    assert verify_existence(task, narrow).ok


def test_a_limit_of_a_joint_beyond_the_last_contact_that_must_follow() -> None:
    planted = plant(sah(), [Spot("index_middle"), Spot("thumb_distal")], np.random.default_rng(0))
    assert verify_existence(planted.task, planted.proof()).ok
    task = limited(planted.task, "index_distal", 0.0, all_joints(planted)["index_distal"] - 1e-3)
    refused(task, planted.proof(), "joint index_distal comes to .* not strictly inside")


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_cone_that_is_too_narrow(seed: int) -> None:
    planted = sah_case(seed, ("cap",))
    for k, edge in enumerate(cone_edges(planted)):
        for by in (1e-2, 1e-9):
            task = reshaped(planted.task, k, hand={"half_angle": edge - by})
            report = refused(task, planted.proof(), f"contact {k} may leave the hand's cap")
            assert len(report.reasons) == 1


def test_an_object_cap_that_is_too_narrow() -> None:
    planted = sah_case(2, object_kinds=("cap",))
    for k in range(3):
        task = reshaped(planted.task, k, object={"half_angle": planted.values[f"contact:{k}:s"]})
        report = refused(task, planted.proof(), f"contact:{k}:s comes to .* not strictly inside")
        assert len(report.reasons) == 1


def test_normals_that_are_equal() -> None:
    for seed in (0, 1, 3):
        planted = sah_case(seed, ("bicubic", "mixed", "bilinear"))
        for k, pair in enumerate(planted.task.contact_pairs):
            task = reshaped(planted.task, k, hand={"flip": not pair.hand.flip})
            report = refused(
                task, planted.proof(), f"contact {k}: the normals are not opposite: their cosine comes to \\[(1|0.9999)"
            )
            assert len(report.reasons) == 1
            task = reshaped(planted.task, k, object={"flip": not pair.object.flip})
            refused(task, planted.proof(), f"contact {k}: the normals are not opposite")


def test_a_sphere_on_the_wrong_side() -> None:
    """A hand cap touches with its centre across the object's surface if either normal is reversed."""
    planted = sah_case(1, ("cap",))
    for side in ("hand", "object"):
        for k, pair in enumerate(planted.task.contact_pairs):
            task = reshaped(planted.task, k, **{side: {"flip": not getattr(pair, side).flip}})
            report = refused(task, planted.proof(), OPEN)
            assert report.gap == pytest.approx(2 * pair.hand.radius)


@pytest.mark.parametrize("label", ["contact:0:s", "contact:0:t", "contact:1:u", "contact:1:v"])
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_parameter_beyond_the_edge(label: str, share: float) -> None:
    """The patch is cut short, so that the same point lies outside of it or on its edge."""
    planted = sah_case(1, ("bicubic",), ("bilinear", "bicubic"))
    k, end = int(label[8]), planted.values[label] * share
    side = "object" if label[-1] in "st" else "hand"
    region = getattr(planted.task.contact_pairs[k], side)
    cut = region.restricted((0, end), (0, 1)) if label[-1] in "su" else region.restricted((0, 1), (0, end))
    task = reshaped(planted.task, k, **{side: {"points": cut.points}})
    report = refused(task, planted.proof(**{label: 1 / share}), f"{label} comes to .* not strictly inside")
    assert len(report.reasons) == 1


def test_a_wrong_coupling() -> None:
    """distal = middle is what the proof was made with; the hand says distal = 90 degrees - middle."""
    planted = sah_case(1)
    hand = planted.task.hand
    other = tuple(replace(c, ratio=-1.0, offset=np.pi / 2) for c in hand.couplings)
    refused(replace(planted.task, hand=replace(hand, couplings=other)), planted.proof(), OPEN)


@pytest.mark.parametrize("seed", range(4))
def test_radii_that_are_too_small_or_too_large(seed: int) -> None:
    planted = sah_case(seed)
    assert verify_existence(planted.task, planted.proof(1e-10, 1e-11)).ok
    refused(planted.task, planted.proof(1e-17, 1e-18), OPEN)
    refused(planted.task, planted.proof(0.3, 0.01), "the box is too wide")


def test_radii_that_hold_the_step_but_not_what_may_follow() -> None:
    planted = sah_case(3)
    low, high = 1e-9, 1.0
    for _ in range(20):  # up to where the box contracts by a factor of about 0.8
        scale = np.sqrt(low * high)
        contraction = verify_existence(planted.task, planted.proof(scale, 0.03 * scale)).contraction
        low, high = (scale, high) if contraction < 0.8 else (low, scale)
    proof = planted.proof(low, 0.03 * low)
    assert verify_existence(planted.task, proof).ok
    label, radius = next((label, r) for label, r in zip(proof.dependent, proof.radii, strict=True) if label[-1] == "s")
    moved = planted.proof(low, 0.03 * low, **{label: planted.values[label] + 0.5 * radius})
    report = refused(planted.task, moved, "the box is too tight")
    assert report.step < 1
    assert report.contraction < 1


def test_dependent_coordinates_that_determine_nothing() -> None:
    planted = sah_case(2)
    proof = planted.proof()
    of_others = [label for label in planted.labels if "index" in label or "thumb" in label or label[:9] == "contact:0"]
    of_others += [label for label in planted.labels if label.startswith("contact:1") or label[-1] in "uv"]
    chosen = list(dict.fromkeys(of_others))[: len(proof.dependent)]
    assert len(chosen) == len(proof.dependent)
    wrong = replace(proof, dependent=tuple(chosen))
    refused(planted.task, wrong, "Jacobian is singular|contracts by a factor")


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda p: {"dependent": p.dependent[1:], "radii": p.radii[1:]}, "coordinates are dependent; the .* equations"),
        (lambda p: {"dependent": ("joint:tail", *p.dependent[1:])}, "'joint:tail' is no coordinate of this task"),
        (lambda p: {"dependent": ("joint:index_distal", *p.dependent[1:])}, "'joint:index_distal' is no coordinate"),
        (lambda p: {"dependent": ("contact:9:s", *p.dependent[1:])}, "'contact:9:s' is no coordinate"),
        (lambda p: {"dependent": (p.dependent[1], *p.dependent[1:])}, "is dependent twice"),
        (lambda p: {"dependent": (*(f"quaternion:{i}" for i in range(4)), *p.dependent[4:])}, "all of the quaternion"),
        (lambda p: {"radii": [0.0, *p.radii[1:]]}, "the radius of .* is 0; it must be positive"),
        (lambda p: {"radii": [-1e-7, *p.radii[1:]]}, "the radius of .* is -1e-07; it must be positive"),
        (lambda p: {"quaternion": p.quaternion * 1e-4}, "the quaternion is shorter than 0.001"),
        (lambda p: {"joints": {}}, "has no value for joint index_abduction; the free joints are index_abduction, "),
        (lambda p: {"joints": {**p.joints, "index_distal": 1.0}}, "has a value for joint index_distal; the free"),
        (lambda p: {"contacts": p.contacts[1:]}, "has 1 contacts; the task has 2"),
        (lambda p: {"contacts": p.contacts[::-1]}, "contact 0 is on thumb_distal; in the task it is on index_distal"),
        (lambda p: {"contacts": (replace(p.contacts[0], hand=None), p.contacts[1])}, "contact 0: .* needs u and v"),
        (lambda p: {"contacts": (p.contacts[0], replace(p.contacts[1], hand=(0.5, 0.5)))}, "contact 1: .* no u and v"),
    ],
)
def test_a_proof_that_does_not_fit(change, message: str) -> None:
    planted = plant(sah(), [Spot("index_distal", "bicubic"), Spot("thumb_distal", "cap")], np.random.default_rng(0))
    proof = planted.proof()
    assert verify_existence(planted.task, proof).ok
    report = refused(planted.task, replace(proof, **change(proof)), message)
    assert report.contraction == np.inf


@pytest.mark.parametrize("field", ["position", "quaternion", "radii", "contacts"])
@pytest.mark.parametrize("size", [1e155, 1e300])
def test_numbers_that_overflow_prove_nothing(field: str, size: float) -> None:
    proof = sah_case(2).proof()
    value = getattr(proof, field) * size if field != "contacts" else proof.contacts
    if field == "contacts":
        value = tuple(replace(c, object=(size, size)) for c in proof.contacts)
    report = verify_existence(sah_case(2).task, replace(proof, **{field: value}))
    assert not report.ok
    assert not report.step + report.contraction < 1


def test_another_task() -> None:
    """The same hand, links and kinds of regions, in other places; then another hand."""
    first, second = (sah_case(seed, ("cap",), ("bicubic",)) for seed in (2, 7))
    refused(second.task, first.proof(), OPEN)
    refused(odd_case(2).task, first.proof(), "has no value for joint")


def test_pose_bounds_that_are_passed_or_reached() -> None:
    planted = sah_case(1)
    R, p = pose_of(planted)
    none = PoseBounds.none()
    for i in range(3):
        for bound in ([p[i], 9.0], [-9.0, p[i]], [p[i] + 1e-3, 9.0]):
            position = np.array(none.position)
            position[i] = bound
            task = replace(planted.task, pose=PoseBounds(position, none.axes))
            report = refused(task, planted.proof(), rf"pose.position\[{i}\] comes to .* not strictly inside")
            assert len(report.reasons) == 1
    for k, i in np.ndindex(3, 3):
        for bound in ([R[i, k] + 1e-3, 1.0], [-1.0, R[i, k] - 1e-3], [R[i, k], 1.0]):
            axes = np.array(none.axes)
            axes[k, i] = bound
            task = replace(planted.task, pose=PoseBounds(none.position, axes))
            refused(task, planted.proof(), rf"pose.{'xyz'[k]}_axis\[{i}\] comes to .* not strictly inside")


def test_pose_bounds_without_an_inside() -> None:
    planted = sah_case(1)
    _, p = pose_of(planted)
    position, axes = np.array(PoseBounds.none().position), np.array(PoseBounds.none().axes)
    position[1] = p[1]
    task = replace(planted.task, pose=PoseBounds(position, axes))
    refused(task, planted.proof(), r"pose.position\[1\] is bounded to .* alone; nothing lies strictly inside")
    axes[2, 0] = 0.0
    task = replace(planted.task, pose=PoseBounds(PoseBounds.none().position, axes))
    refused(task, planted.proof(), r"pose.z_axis\[0\] is bounded to 0 alone; nothing lies strictly inside")


def test_joints_that_their_limits_fix() -> None:
    """The value is exact, the joint no coordinate; what follows it must agree, and must not be free."""
    at = {"index_abduction": 0.05, "index_middle": 0.7, "index_distal": 0.7}
    hand = sah()
    for name, value in at.items():
        hand = replace(
            hand, joints=tuple(replace(j, lower=value, upper=value) if j.name == name else j for j in hand.joints)
        )
    spots = [Spot("index_distal"), Spot("thumb_distal"), Spot("palm")]
    planted = plant(hand, spots, np.random.default_rng(5))
    assert free_joints(planted.task)[0] == "index_proximal"
    report = verify_existence(planted.task, planted.proof())
    assert report.ok, report.reasons
    assert "joint:index_middle" not in report.slacks
    refused(limited(planted.task, "index_distal", 0.8, 0.8), planted.proof(), "fixed at 0.8 by its limits, at 0.7 by")
    refused(limited(planted.task, "index_distal", 0.7, 0.8), planted.proof(), "joint index_distal comes to")
    refused(limited(planted.task, "index_abduction", 0.06, 0.06), planted.proof(), OPEN)
    free = limited(planted.task, "index_middle", 0.0, 1.0)
    proof = planted.proof()
    proof = replace(proof, joints={**proof.joints, "index_middle": 0.7})
    refused(free, proof, "joint index_distal is fixed by its limits, but follows index_middle, which is free")


def test_hands_in_which_nothing_can_be_proved() -> None:
    planted = sah_case(0)
    hand = planted.task.hand
    links = list(hand.links)
    crooked = np.array(links[9].pose)
    crooked[:3, 0] *= 1 + 1e-9
    links[9] = replace(links[9], pose=crooked)
    bent = replace(planted.task, hand=replace(hand, links=tuple(links)))
    refused(bent, planted.proof(), "link index_knuckle does not stand at a rotation, but .*e-10 off one")


# --- the enclosure ----------------------------------------------------------------------------------


def balls(x: object) -> Array:
    """Floats as exact balls, in an object array."""
    arb = pytest.importorskip("flint").arb
    x = np.asarray(x, dtype=float)
    return np.array([arb(v) for v in x.ravel().tolist()], dtype=object).reshape(x.shape)


def encloses(x: Interval, exact: Array) -> bool:
    """Is every ball certainly within its interval?"""
    ends = zip(balls(x.lo).ravel(), exact.ravel(), balls(x.hi).ravel(), strict=True)
    return x.shape == exact.shape and all(lo <= v and v <= hi for lo, v, hi in ends)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("case", [odd_case, sah_case])
def test_equations_and_derivatives_enclose_exact_ones(case, seed: int) -> None:
    """At the floats, and at random points of a box as wide as the proofs' and of one much wider."""
    flint = pytest.importorskip("flint")
    planted, rng = case(seed), np.random.default_rng(seed)
    middle = np.array(list(planted.values.values()))
    equations = equations_of(planted.task)
    assert list(equations.column) == planted.labels
    n, (h, most) = len(middle), (2.0**-200, 2.0**-60)
    for radius in (1e-7, 1e-3):
        box = Interval.around(middle, radius)
        both = Interval(np.stack([middle, box.lo]), np.stack([middle, box.hi]))
        slope = np.repeat(np.eye(n)[:, None, :], 2, axis=1)
        at = equations.at(both, Interval.of(slope))
        with flint.ctx.workprec(700):
            x = balls(np.stack([middle, middle + radius * rng.uniform(-0.99, 0.99, n)]))
            F = contact_equations(planted.task, planted.labels, x)
            assert encloses(at.F.value, F)
            width = at.F.value.hi - at.F.value.lo
            assert width[0].max() < 1e-12
            least = 2 * radius * np.abs(at.F.slope.mid[:, 0]).sum(axis=0)  # the width of the linear part
            assert (width[1] < 50 * least).all()
            for point in (0, 1):
                up, down = (
                    contact_equations(planted.task, planted.labels, x[point] + s * h * balls(np.eye(n)))
                    for s in (1, -1)
                )
                slopes = (up - down) / (2 * h)
                J = at.F.slope[:, point]
                wide = Interval(J.lo - most, J.hi + most)  # the differences are right to 2^-390 or so
                assert encloses(wide, slopes)
                assert (J.hi - J.lo).max() < (1e-11 if point == 0 else 1e3 * radius)


# --- the file's form, and independence --------------------------------------------------------------


def test_every_bit_comes_back() -> None:
    planted = sah_case(4)
    proof = planted.proof()
    again = existence_from_dict(json.loads(json.dumps(existence_to_dict(proof))))
    assert existence_to_dict(again) == existence_to_dict(proof)
    assert again.coordinates == proof.coordinates
    assert list(proof.coordinates) == planted.labels
    assert verify_existence(planted.task, again) == verify_existence(planted.task, proof)


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: d.pop("radii"), "^radii: is missing$"),
        (lambda d: d.update(note="x"), "^note: is not a known field"),
        (lambda d: d.update(schema="handfast/existence/2"), "^schema: "),
        (lambda d: d.update(quaternion=[1.0, 0.0, 0.0]), "^quaternion: "),
        (lambda d: d["radii"].pop(), r"^radii: has shape \(\d+,\), needs"),
        (lambda d: d["joints"].update(index_proximal=float("nan")), "^joints.index_proximal: .* finite"),
        (lambda d: d["contacts"][0].update(object=[0.5]), r"^contacts\[0\].object"),
        (lambda d: d["contacts"][0].pop("hand"), r"^contacts\[0\].hand: is missing$"),
    ],
)
def test_faults_in_files(change, message: str) -> None:
    data = existence_to_dict(sah_case(1).proof())
    change(data)
    with pytest.raises(InputError, match=message) as fault:
        existence_from_dict(data)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize("field", ["joints", "position", "quaternion", "radii"])
def test_only_finite_numbers(field: str) -> None:
    proof = sah_case(0).proof()
    value = dict.fromkeys(proof.joints, np.inf) if field == "joints" else np.full_like(getattr(proof, field), np.nan)
    with pytest.raises(InputError, match=f"{field}: contains NaN or infinity"):
        replace(proof, **{field: value})


def test_the_checker_needs_nothing_of_the_search() -> None:
    code = (
        "import sys; from tests.synthesis.certify import test_existence as t\n"
        "planted = t.sah_case(1)\n"
        "assert t.verify_existence(planted.task, planted.proof()).ok\n"
        "print([m for m in sys.modules if m.split('.')[0] in ('numba', 'llvmlite') or m.startswith('handfast')])"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = set(ast.literal_eval(run.stdout))
    assert not any(name.startswith(("numba", "llvmlite")) for name in loaded)
    checker = ("chains", "equations", "existence", "interval_arithmetic", "regions", "verify_existence")
    parts = {"task", "certify", *(f"certify.{part}" for part in checker)}
    assert {name for name in loaded if name.startswith("handfast.synthesis.")} == {
        f"handfast.synthesis.{part}" for part in parts
    }
    assert not any(name.startswith(("handfast.stability", "handfast.core.branch")) for name in loaded)
