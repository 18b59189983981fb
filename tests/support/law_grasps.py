"""Grasps whose joints have laws: small ones with answers by hand, and random ones."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism

FREE = Mechanism((), np.zeros((0, 1)), np.zeros((0, 1)), ())
BACKDRIVABLE = Mechanism(("motor",), np.eye(1), np.zeros((0, 1)), (False,), (True,))
DOWN, OPENS = [0, 0, -1, 0, 0, 0], [1, 0, 0, 0, 0, 0]


def jaw(mechanism: Mechanism | None = FREE, preload: Mapping[str, float] | None = None, **laws: Any) -> Grasp:
    """A fixed finger and one on a hinge 0.1 m below, 2 cm apart, mu 0.5; the object between them.

    A force along +x pushes the hinged finger open with 0.1 m of arm; along -z the object is pulled out.
    """
    contacts = [Contact([-0.01, 0, 0], [1, 0, 0], 0.5), Contact([0.01, 0, 0], [-1, 0, 0], 0.5)]
    hinge = GraspJoint("hinge", [0, -1, 0], [0.01, 0, -0.1], (1,), **laws)
    return Grasp(contacts, [hinge], mechanism, preload, "jaw")


def curled(
    preload: float = 0.0, *, knuckle: Mapping[str, Any] | None = None, tip: Mapping[str, Any] | None = None
) -> Grasp:
    """As `jaw`, with a second hinge 0.04 m below the contact and one tendon over both: (1, 1)."""
    joints = [
        GraspJoint("knuckle", [0, -1, 0], [0.01, 0, -0.1], (1,), **(knuckle or {})),
        GraspJoint("tip", [0, -1, 0], [0.01, 0, -0.04], (1,), **(tip or {})),
    ]
    tendon = Mechanism(("tendon",), np.ones((1, 2)), np.zeros((0, 2)), (True,))
    return Grasp(jaw().contacts, joints, tendon, {"tendon": preload} if preload else None, "curled")


def random_law_grasp(rng: np.random.Generator, friction: float = 0.0) -> Grasp:
    """2 or 3 contacts around the origin, 1 to 3 joints with random laws, and a random mechanism behind them."""
    m, l = int(rng.integers(2, 4)), int(rng.integers(1, 4))
    contacts = []
    for _ in range(m):
        p, lean = _unit(rng), 0.3 * _unit(rng)
        contacts.append(Contact(0.03 * p, (lean - p) / np.linalg.norm(lean - p), friction))
    joints = []
    for j in range(l):
        laws: dict[str, Any] = {}
        if rng.random() < 0.6:
            laws["friction"] = rng.choice([0.02, 0.05, 0.1])
        if rng.random() < 0.35:
            laws["torque"] = rng.choice([-0.1, -0.03, 0.03, 0.08])
        if rng.random() < 0.3:
            laws["stop"] = str(rng.choice(["lower", "upper", "both"]))
        moves = tuple(int(i) for i in range(m) if rng.random() < 0.6)
        kind = str(rng.choice(["revolute", "revolute", "prismatic"]))
        joints.append(GraspJoint(f"j{j}", _unit(rng), 0.05 * _unit(rng), moves, kind, **laws))  # type: ignore[arg-type]
    return Grasp(contacts, joints, *_mechanism(rng, l))


def _mechanism(rng: np.random.Generator, l: int) -> tuple[Mechanism, np.ndarray]:
    """Motors of single joints, locked, commanded or backdrivable; a motor or a tendon over two joints; a coupling."""
    rows, tendon, back = [], [], []
    for j in range(l):
        kind = rng.random()
        if kind < 0.5:
            rows.append(np.eye(l)[j] * (1.0 if kind > 0.35 else rng.choice([1.0, -1.0, 2.0])))
            back.append(kind > 0.35)
            tendon.append(not back[-1] and rng.random() < 0.3)
    pairs = []
    for likely in (0.4, 0.35):
        row = np.zeros(l)
        if l > 1 and rng.random() < likely:
            row[rng.choice(l, 2, replace=False)] = rng.choice([1.0, -1.0, 0.5], 2)
        pairs.append(row)
    if pairs[0].any():
        rows.append(pairs[0])
        back.append(False)
        tendon.append(rng.random() < 0.5)
    A = pairs[1][None] if pairs[1].any() else np.zeros((0, l))
    command = rng.choice([0.0, 0.0, 0.1, 0.05, -0.1], len(rows))
    R = np.array(rows).reshape(len(rows), l)
    names = tuple(f"a{i}" for i in range(len(rows)))
    return Mechanism(names, R, A, tuple(tendon), tuple(back)), np.where(tendon, np.abs(command), command)


def _unit(rng: np.random.Generator) -> np.ndarray:
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)
