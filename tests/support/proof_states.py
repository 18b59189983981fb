"""Questions on plain arrays, and exact states of the model (1) to (8) that are made rather than searched.

A state is drawn first: motions of contacts and actuators in given cases, forces by (4) and (7), actuator forces by (8).
Load and given torques are then what makes (1) and (2) hold.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from handfast.proofs.cases import HALF_TURN
from handfast.proofs.grasp import read_grasp
from handfast.proofs.kinds import (
    ABOVE,
    BELOW,
    CLOSED,
    FREE,
    HIGH,
    LOCKED,
    LOW,
    MOVES,
    OPEN,
    SLIDE,
    STICK,
    TURN_DIRECTIONS,
    UNDECIDED,
)
from handfast.proofs.question import CHECK, LARGEST_GOAL, SMALLEST_PRELOAD, TORQUES, Question, read_question
from handfast.proofs.rows import Columns

KINDS = "open", "stick", "slide"


def question(contacts: list[dict[str, Any]], wrench: Any, goal: str = CHECK, **more: Any) -> Question:
    """From contacts, a load, and other fields of a question or a grasp."""
    of_grasp = {k: more.pop(k) for k in ("joints", "mechanism", "preload") if k in more}
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts} | of_grasp
    return read_question({"grasp": grasp, "goal": goal, "wrench": list(wrench)} | more, "question")


def contact(position: Any, normal: Any, friction: float = 0.5, **more: Any) -> dict[str, Any]:
    return {"position": list(position), "normal": list(normal), "friction": friction} | more


def pinch(wrench: Any, friction: float = 0.5, size: float = 1.0, goal: str = CHECK, **more: Any) -> Question:
    """Two rigid walls, one at x = -size, one at x = size, normals to each other."""
    walls = [contact([-size, 0, 0], [1, 0, 0], friction), contact([size, 0, 0], [-1, 0, 0], friction)]
    return question(walls, wrench, goal, **more)


@dataclass(frozen=True)
class Drawn:
    """A question with a state of it.

    Attributes:
        x: (n,) the unknowns. motions: (3m+a+1+s,) d, t, the work of given torques, turning.
        kinds: of the contacts. moves: (a,) bool, t > 0.
    """

    question: Question
    scalar: tuple[float, float] | None
    x: np.ndarray
    motions: np.ndarray
    kinds: tuple[str, ...]
    moves: np.ndarray


def unit(rng: np.random.Generator, n: int = 3) -> np.ndarray:
    x = rng.normal(size=n)
    return x / np.linalg.norm(x)


def drawn(
    rng: np.random.Generator, goal: str = CHECK, eta: float = 0.0, soft: bool = False, sums: bool = False
) -> Drawn:
    """A random state of a random question: two contacts on fingers of three joints each, and four actuators."""
    m, l = 2, 8
    lever = 0.02 if soft else 0.0
    contacts = []
    for _ in range(m):
        mu = rng.uniform(0.2, 1.5)
        more = {"torsion": lever * mu} if soft else {}
        contacts.append(contact(rng.normal(size=3), unit(rng), mu, **more))
    joints = [
        {"name": f"j{j}", "type": ("revolute", "prismatic")[j % 2], "axis": unit(rng).tolist(), "moves": [j // 4]}
        | {"origin": rng.normal(size=3).tolist()}
        for j in range(l)
    ]
    grasp = {"schema": "handfast/grasp/1", "contacts": contacts, "joints": joints}
    g = read_grasp(grasp, "grasp")

    kinds = tuple(rng.choice(KINDS) for _ in range(m))
    if goal == SMALLEST_PRELOAD and set(kinds) == {"open"}:  # no load at all is no direction
        kinds = ("slide", *kinds[1:])
    r, d, turning = rng.normal(size=6), np.zeros((m, 3)), np.zeros(m * soft)
    c, twist = np.zeros((m, 3)), np.zeros(m * soft)
    for i, kind in enumerate(kinds):
        side = 0.0 if kind == "stick" else rng.uniform(0.2, 2.0)
        way = unit(rng, 3 if soft else 2)
        slide = side * way
        normal = rng.uniform(0.1, 2.0) if kind == "open" else -rng.uniform(0.1, 2.0) - np.tan(eta) * side
        d[i] = [normal, *slide[:2]]
        if kind != "open":
            c_n = -(normal * np.cos(eta) + side * np.sin(eta))
            share = rng.uniform(0, 1) if kind == "stick" else 1.0
            pull = -share * g.mu[i] * c_n * way
            c[i] = [c_n, *pull[:2]]
            if soft:
                twist[i] = pull[2]
        if soft:
            turning[i] = slide[2]
    rows, wanted = (
        np.vstack([g.J, g.twist_jacobian]),
        np.concatenate([g.G.T @ r - d.ravel(), g.twist_map.T @ r - turning]),
    )
    q = np.linalg.lstsq(rows, wanted, rcond=None)[0]

    R, A = rng.normal(size=(4, l)), rng.normal(size=(1, l))
    for row in (A[0], R[1], R[3]):
        row -= (row @ q) / (q @ q) * q
    t = R @ q
    t[[1, 3]] = 0.0
    sense = np.where(t < 0, -1.0, 1.0)  # actuator 3 is locked for good
    command = np.array([0.7, 0.4, 1.1, 0.0])
    scalar = {CHECK: None, SMALLEST_PRELOAD: (0.5, 0.9), LARGEST_GOAL: (-1.0, 2.0), TORQUES: (0.2, 6.0)}[goal]
    sigma = 0.0 if scalar is None else float(rng.uniform(*scalar)) if goal != TORQUES else 2.2 if sums else 1.1
    f = command * (sigma if goal == SMALLEST_PRELOAD else 1.0)
    f[1] += rng.uniform(0, 1)  # rests: more than its command
    if goal == TORQUES and rng.random() < 0.2:
        f[1] *= -1.0
    f[3] = rng.normal()
    coupling = rng.normal(size=1)
    force = c.ravel()
    given = g.J.T @ force + g.twist_jacobian.T @ twist - R.T @ (sense * f) - A.T @ coupling
    w = -g.G @ force - g.twist_map @ twist
    share = sigma if goal == SMALLEST_PRELOAD else 1.0
    for j, joint in enumerate(joints):
        joint["torque"] = float(given[j] / share)
    names = ["m0", "m1", "m2", "m3"]
    row_of = [dict(zip((j["name"] for j in joints), row.tolist(), strict=True)) for row in R]
    tie = dict(zip((j["name"] for j in joints), A[0].tolist(), strict=True))
    actuators = [{"name": n, "joints": row} for n, row in zip(names, row_of, strict=True)]
    preload = {n: float(x) for n, x in zip(names, sense * command, strict=True) if x}
    grasp |= {"mechanism": {"actuators": actuators, "couplings": [tie]}, "preload": preload}
    asked: dict[str, Any] = {"grasp": grasp, "goal": goal, "wrench": w.tolist(), "eta": eta}
    if goal == SMALLEST_PRELOAD:
        asked |= {"direction": w.tolist(), "wrench": [0.0] * 6}
    if goal == LARGEST_GOAL:
        direction = rng.normal(size=6)
        asked |= {"direction": direction.tolist(), "wrench": (w - sigma * direction).tolist(), "force_limit": 50.0}
    if goal == TORQUES:
        asked |= {"driven": names[:3], "objective": "sum" if sums else "max", "torque_limits": {"m3": 9.0}}
    found = read_question(asked, "question")
    at = Columns.of(found)
    x = np.zeros(at.n)
    x[at.r], x[at.q], x[at.c], x[at.f], x[at.coupling], x[at.twist] = r, q, force, f, coupling, twist
    x[at.scalar] = sigma
    x[at.e] = np.where(found.is_driven, command, 0.0)[: at.e.stop - at.e.start]
    motions = np.concatenate([d.ravel(), sense * t, [found.grasp.torque @ q], turning])
    return Drawn(found, scalar, x, motions, kinds, t != 0)


def case_of(state: Drawn, rng: np.random.Generator) -> np.ndarray:
    """(m+a, 3) a random case that the state is in."""
    q = state.question
    m, at = q.grasp.m, Columns.of(q)
    out = np.zeros((m + q.actuators, 3), dtype=np.int64)
    for i, kind in enumerate(state.kinds):
        d, c = state.motions[3 * i : 3 * i + 3], state.x[at.c][3 * i : 3 * i + 3]
        way = c[1:] if kind == "stick" else -d[1:]
        place = int(np.floor(np.arctan2(way[1], way[0]) / (2 * np.pi) * TURN_DIRECTIONS))
        widest = HALF_TURN if rng.random() < 0.3 else HALF_TURN // 4
        left = place - int(rng.integers(2, widest - 2))
        sector = left, left + widest
        sector = sector[0] - TURN_DIRECTIONS * int(rng.integers(0, 2)), sector[1]
        sector = (sector[1] - widest, sector[1])
        point = q.soft_fingers[i] < 0
        cases = [(UNDECIDED, 0, 0)]
        if kind == "open":
            cases = [*cases, (OPEN, 0, 0)] + ([(OPEN, *sector)] if q.eta > 0 else [])
        else:
            cases += [(CLOSED, 0, 0)] + ([(CLOSED, *sector)] if point else [])
        if kind == "stick":
            cases += [(STICK, 0, 0)] * 2 + ([(STICK, *sector)] if point else [])
        if kind == "slide" and point and widest < HALF_TURN:
            cases += [(SLIDE, *sector)] * 3
        if kind == "slide" and not point:
            slide = np.append(d[1:], state.motions[3 * m + q.actuators + 1 + i])
            cases += [(SLIDE, patch_with(-slide, int(rng.integers(0, 4))), 0)] * 3
        out[i] = cases[int(rng.integers(len(cases)))]
    for j in range(q.actuators):
        rest, free = (LOCKED if j == 3 else [FREE, LOCKED][int(rng.integers(2))]), [FREE, MOVES][int(rng.integers(2))]
        out[m + j, 0] = FREE if j == 3 else free if state.moves[j] else rest
        if q.is_driven[j] and not q.sums and rng.random() < 0.5:
            force, top, still = state.x[at.f][j], state.x[at.scalar][0], not state.moves[j]
            in_it = {HIGH: still and force >= top, LOW: still and force <= 0, BELOW: force <= top, ABOVE: force >= 0}
            some = [case for case, true in in_it.items() if true]
            out[m + j, 0] = some[int(rng.integers(len(some)))]
    return out


def patch_with(direction: np.ndarray, depth: int) -> int:
    """The patch that a direction is in, halved so often."""
    from handfast.proofs.cases import patch

    number = 8 + sum(1 << k for k in range(3) if direction[k] < 0)
    for _ in range(depth):
        number = next(k for k in (2 * number, 2 * number + 1) if (patch(k).planes @ direction >= -1e-15).all())
    return number
