"""The largest load without friction at contacts, by a linear program for each combination of what parts do.

Written from the definition of the laws, apart from everything that the engine and its checker use: a contact is open or
pressed, an actuator rests or moves, a joint rests, closes or opens.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from scipy.optimize import linprog

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp

END = 1e7  # what is resisted up to there is unbounded
Rows = list[tuple[Array, float]]
Case = tuple[Rows, Rows]  # equations, and rows that are at most their right-hand sides


def largest_load(grasp: Grasp, direction: Array, limits: Mapping[str, float] | None = None) -> float:
    """The largest s of s direction (6,) without contact friction; -inf without any state, inf if it has no end."""
    n = 6 + 2 * grasp.l + grasp.m + grasp.mechanism.a + len(grasp.mechanism.A) + 1
    always = _balance(grasp, direction, n)
    last = np.eye(n)[-1]
    best = -np.inf
    for cases in itertools.product(*_cases(grasp, n, limits or {})):
        equal = always + [row for case in cases for row in case[0]]
        below = [row for case in cases for row in case[1]]
        A, b = (np.array(part) for part in zip(*equal, strict=True))
        B, h = (np.array(part) for part in zip(*below, strict=True)) if below else (None, None)
        found = linprog(-last, B, h, A, b, [(None, None)] * (n - 1) + [(0, END)])
        if found.status == 0:
            best = max(best, found.x[-1])
    return np.inf if best > 0.9 * END else best


def _columns(grasp: Grasp, n: int) -> dict[str, Array]:
    """(k, n) rows that pick r, q, c_n, f, lambda and rho out of the unknowns."""
    sizes = 6, grasp.l, grasp.m, grasp.mechanism.a, len(grasp.mechanism.A), grasp.l
    parts = np.split(np.eye(n)[:-1], np.cumsum(sizes)[:-1])
    return dict(zip(("r", "q", "c", "f", "coupling", "rho"), parts, strict=True))


def _balance(grasp: Grasp, direction: Array, n: int) -> Rows:
    """(1), (2) with all that a joint carries, A q = 0."""
    x, mech = _columns(grasp, n), grasp.mechanism
    object_ = grasp.G[:, ::3] @ x["c"] + np.outer(direction, np.eye(n)[-1])
    joints = grasp.J[::3].T @ x["c"] - mech.R.T @ x["f"] - mech.A.T @ x["coupling"] - x["rho"]
    rows = [(row, 0.0) for row in object_]
    rows += [(row, joint.torque) for row, joint in zip(joints, grasp.joints, strict=True)]
    return rows + [(row, 0.0) for row in mech.A @ x["q"]]


def _cases(grasp: Grasp, n: int, limits: Mapping[str, float]) -> list[list[Case]]:
    """What each contact, actuator and joint may do."""
    x, mech = _columns(grasp, n), grasp.mechanism
    d, t = grasp.G[:, ::3].T @ x["r"] - grasp.J[::3] @ x["q"], mech.R @ x["q"]
    out: list[list[Case]] = [
        [([(c, 0.0)], [(-gap, 0.0)]), ([(c + gap, 0.0)], [(-c, 0.0)])] for c, gap in zip(x["c"], d, strict=True)
    ]
    for i, name in enumerate(mech.actuators):
        f, command = x["f"][i], grasp.command[i]
        within: Rows = [(f, limits[name]), (-f, limits[name])] if name in limits else []
        sense = -1.0 if command < 0 else 1.0
        if mech.backdrivable[i]:
            out.append([([(f, command)], within)])
        elif command == 0 and not mech.tendon[i]:
            out.append([([(t[i], 0.0)], within)])
        else:
            rests = ([(t[i], 0.0)], [(-sense * f, -sense * command), *within])
            out.append([rests, ([(f, command)], [(-sense * t[i], 0.0), *within])])
    for j, joint in enumerate(grasp.joints):
        q, rho, F = x["q"][j], x["rho"][j], joint.friction
        upper, lower = joint.stop in ("upper", "both"), joint.stop in ("lower", "both")
        held: Rows = ([] if lower else [(rho, F)]) + ([] if upper else [(-rho, F)])
        ways: list[Case] = [([(q, 0.0)], held)]
        ways += [] if upper else [([(rho, -F)], [(-q, 0.0)])]
        ways += [] if lower else [([(rho, F)], [(q, 0.0)])]
        out.append(ways)
    return out
