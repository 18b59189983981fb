"""A certificate: the written proof that no state of the model exists, for anyone to check (`verify`).

It claims: no state of any motion solves (1)-(8) for the question, with the scalar in its range. The proof is
a tree of cases. A node is its parent with one part changed: parts 0 to m-1 are the
contacts, m to m+a-1 the actuators. Each leaf lists inequalities that hold in its case, and multipliers
>= 0 under which they contradict the equilibrium: Farkas' lemma. Certificates of version 1 claim it for motions
inside a cap only, and their multipliers need the cap.

Directions in the contact plane are integers, 2^24 to the turn; a sector is a pair left < right of them.
A soft finger slides in a patch of the sphere of directions instead (`patches`), whose number stands in the place of
the sector's left end. Actuators are mirrored into the sense of their command, so that (8) reads t >= 0, f >= |f_c|
everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from handfast.core.arrays import Array, Mask, frozen
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability import model
from handfast.stability.equivalent_grasp import EquivalentGrasp, equivalent_of
from handfast.stability.goal import ANY_STATE, AffineLoad, Goal, Range

Integers = NDArray[np.int64]

TURN = 2**24  # directions in a full turn
HALF = TURN // 2  # a sector is narrower than this
WIDER = 2.0**-40  # relative; rows of the cone, and bounds on |d_t|, give way by as much: see `farkas`
MAX_ETA = float(np.radians(45.0))
NODE_ARRAYS = ("parent", "part", "state", "left", "right")
ROW_ARRAYS = ("start", "kind", "index", "a", "b", "multiplier")


class ContactState(IntEnum):
    """The case of a contact."""

    UNDECIDED = 0
    OPEN = 1  # c = 0, d^_n >= 0; with a sector: -d_t in its cone
    CLOSED = 2  # c_n = -d^_n >= 0; with a sector, of half a turn at most: -d_t and c_t in its cone
    STICK = 3  # closed, d_t = 0; with a sector: c_t in its cone
    SLIDE = 4  # closed, -d_t in the sector's cone and c_t = mu c_n along it


class ActuatorState(IntEnum):
    """The case of an actuator."""

    FREE = 0
    LOCKED = 1  # t = 0
    MOVES = 2  # t >= 0, f = f_c


class Row(IntEnum):
    """An inequality: contact i or actuator j, directions a and b, value >= 0; `verify` says when it holds.

    U_a is the unit vector of direction a, g = -(U_a + U_b) . d_t / (1 + U_a . U_b) >= |d_t| in a sector.
    """

    CN_UP = 0  # c_n
    CN_DOWN = 1  # -c_n
    GAP_UP = 2  # c_n + cos(eta) d_n + sin(eta) g
    GAP_DOWN = 3  # -(c_n + cos(eta) d_n - sin(eta) U_a . d_t)
    DN_UP = 4  # cos(eta) d_n + sin(eta) g
    TANGENT = 5  # mu c_n - U_a . c_t
    CHORD = 6  # ((U_a + U_b) . c_t - mu (1 + U_a . U_b) c_n) / 2
    C_LEFT = 7  # U_a x c_t
    C_RIGHT = 8  # c_t x U_b
    D_LEFT = 9  # U_a x -d_t
    D_RIGHT = 10  # -d_t x U_b
    STILL_1_UP = 11  # d_t1
    STILL_1_DOWN = 12  # -d_t1
    STILL_2_UP = 13  # d_t2
    STILL_2_DOWN = 14  # -d_t2
    T_UP = 15  # t
    T_DOWN = 16  # -t
    E_UP = 17  # f - f_c; f if driven
    E_DOWN = 18  # f_c - f
    S_UP = 19  # T - f, or e_j - f if the objective is the sum
    BOUND_UP = 20  # x_k - lo_k, k in `Columns`
    BOUND_DOWN = 21  # hi_k - x_k
    ENERGY = 22  # w . r + f_c . t - sum of (2 x_i c_n,i - x_i^2), x and the commands' scalar from `references`
    # of soft fingers, with c_f = (c_t1, c_t2, twist) and d_f = (d_t1, d_t2, turning):
    SOFT_TANGENT = 23  # mu c_n - (cos b cos a, cos b sin a, sin b) . c_f
    SOFT_CHORD = 24  # w . c_f - h mu c_n, middle w and reach h of patch a
    C_SIDE = 25  # n . c_f, normal n of side b of patch a
    D_SIDE = 26  # -n . d_f
    TURN_UP = 27  # turning
    TURN_DOWN = 28  # -turning


def directions(k: Integers) -> Array:
    """(n, 2) the vectors U_k = (cos, sin)(2 pi k / 2^24) as floats; quarter turns rotate them exactly."""
    quarter, rest = np.divmod(np.mod(k, TURN), TURN // 4)
    x, y = np.cos(rest * (2 * np.pi / TURN)), np.sin(rest * (2 * np.pi / TURN))
    return np.column_stack([np.choose(quarter, [x, -y, -x, y]), np.choose(quarter, [y, x, -y, -x])])


@dataclass(frozen=True, eq=False)
class Question:
    """What was asked.

    Attributes:
        grasp: with its preload.
        goal: what is sought, and what its scalar is.
        wrench: (6,) w0 [N, N m]; zero where the goal is homogeneous.
        direction: (6,) [N, N m]; only where the scalar multiplies it.
        eta: uncertainty of the contact normals [rad].
        mdp: with the maximum dissipation principle.
        torque_limits: actuator -> largest |f| [N m or N].
        force_limit: largest c_n [N].
        driven: actuators whose commands are sought, torques only; each in the sense of its preload, or +.

    Raises:
        InputError: the parts do not make a question.
    """

    grasp: Grasp
    goal: Goal = ANY_STATE
    wrench: Array = field(default_factory=lambda: np.zeros(6))
    direction: Array | None = None
    eta: float = 0.0
    mdp: bool = True
    torque_limits: Mapping[str, float] = field(default_factory=dict)
    force_limit: float | None = None
    driven: Sequence[str] = ()

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "wrench", frozen(self.wrench, (6,), "wrench"))
        if (self.direction is not None) != self.goal.has_direction:
            need = "is needed" if self.direction is None else "has no meaning"
            raise InputError(f"{need} where the goal is '{self.goal.word}'", field="direction")
        if self.direction is not None:
            put(self, "direction", frozen(self.direction, (6,), "direction"))
        if not 0 <= self.eta < MAX_ETA:
            raise InputError(f"is {self.eta:g} rad; 0 to {MAX_ETA:.4f} is possible", field="eta")
        if self.eta > 0 and not self.mdp:
            raise InputError("needs the maximum dissipation principle", field="eta")
        if self.eta > 0:
            self.grasp.refuse_soft_fingers("uncertainty of the normals")
        put(self, "torque_limits", {n: float(v) for n, v in self.torque_limits.items()})
        self.grasp.mechanism.commands(self.torque_limits, field="torque_limits")  # names and finite numbers
        limits = [*self.torque_limits.values(), *([] if self.force_limit is None else [self.force_limit])]
        if not all(0 < v < np.inf for v in limits):
            raise InputError("a limit is positive and finite", field="torque_limits, force_limit")
        if self.goal.homogeneous and (self.wrench.any() or limits):
            raise InputError(f"the {self.goal.word} knows no base load and no limits", field="goal")
        put(self, "driven", tuple(self.driven))
        self.grasp.mechanism.commands(dict.fromkeys(self.driven, 1.0), field="driven")
        if self.driven and not self.goal.seeks_commands:
            raise InputError(f"have no meaning where the goal is '{self.goal.word}'", field="driven")

    @cached_property
    def sought(self) -> Mask:
        """(a,) bool: the grasp's actuators whose command is sought."""
        return np.array([name in self.driven for name in self.grasp.mechanism.actuators], dtype=bool)

    @cached_property
    def equivalent(self) -> EquivalentGrasp:
        """What stands for the grasp, whose laws of joints are tendons and given torques there."""
        return equivalent_of(self.grasp, self.sought if self.goal.seeks_commands else None, self.torque_limits)

    @property
    def plain(self) -> Grasp:
        """The equivalent grasp, with all joints and actuators that proofs are about."""
        return self.equivalent.plain

    @cached_property
    def is_driven(self) -> Mask:
        """(a,) bool: actuators of the equivalent whose command is sought."""
        return np.array([name in self.driven for name in self.plain.mechanism.actuators], dtype=bool)

    @cached_property
    def load(self) -> AffineLoad:
        """Disturbance and magnitudes of the commands, affine in the scalar; no commands where they are sought."""
        direction = np.zeros(6) if self.direction is None else self.direction
        return self.goal.load(self.wrench, direction, np.abs(self.plain.command), self.plain.given_torques)

    @cached_property
    def may_move(self) -> Mask:
        """(a,) bool: actuators that are commanded or driven, or a tendon; for the others t = 0."""
        return model.commanded(self.plain, self.load.f_a + self.load.f_b) | self.is_driven

    @property
    def soft_fingers(self) -> Integers:
        """(m,) which soft finger a contact is, -1 for a point contact."""
        out = np.full(self.grasp.m, -1, np.int64)
        out[self.grasp.soft] = np.arange(len(self.grasp.soft))
        return out

    @property
    def sense(self) -> Array:
        """(a,) -1 for actuators mirrored into the sense of their command, else +1."""
        turned = (self.plain.command < 0) & (self.is_driven | (not self.goal.seeks_commands))
        return np.where(turned, -1.0, 1.0)


@dataclass(frozen=True)
class Columns:
    """Where the unknowns are in x = (r, q, c, f, coupling, scalar, e, twist).

    f is mirrored, e one effort per actuator, twist the torsion of each soft finger over its lever [N].
    """

    r: slice
    q: slice
    c: slice
    f: slice
    coupling: slice
    scalar: slice  # empty for a check
    e: slice  # empty unless the sum of efforts is sought
    twist: slice  # empty without soft fingers
    n: int

    @classmethod
    def of(cls, question: Question) -> Columns:
        """The columns of a question."""
        g, goal = question.plain, question.goal
        a, scalar = g.mechanism.a, int(goal.has_scalar)
        efforts = a if goal.sums_commands else 0
        ends = np.cumsum([0, 6, g.l, 3 * g.m, a, len(g.mechanism.A), scalar, efforts, len(g.soft)]).tolist()
        r, q, c, f, coupling, s, e, twist = (slice(i, j) for i, j in pairwise(ends))
        return cls(r, q, c, f, coupling, s, e, twist, ends[-1])


@dataclass(frozen=True, eq=False)
class Certificate:
    """A claim and its proof; arrays of the tree have one entry per node, node 0 is the root.

    Attributes:
        question: what was asked.
        scalar: no state with the goal's scalar in this range (lo, hi) exists; hi may be infinite for the smallest
            preload. None for a check.
        parent: the parent of each node, a smaller number; -1 for the root.
        part, state, left, right: what changed: part, its state, its sector (0, 0 without).
        leaves: (L,) nodes that are not split.
        start: (L+1,) leaf i has the rows start[i] to start[i+1].
        kind, index, a, b, multiplier: one entry per row: a `Row`, of which contact, actuator, column or
            reference, its directions, and its multiplier.
        references: (K, m+1) normal forces [N] at which the balance of energy has tangents, and the scalar that
            f_c is taken at.
        cap_r, cap_q: (6,), (l,) of version 1: nothing is claimed of motions but |r_k| <= cap_r[k],
            |q_j| <= cap_q[j] (units of `State`). None otherwise.

    Raises:
        InputError: arrays of the wrong shape, caps or a range that are none. Whether the proof is right
            is for `verify` to say.
    """

    question: Question
    scalar: Range | None
    parent: Integers
    part: Integers
    state: Integers
    left: Integers
    right: Integers
    leaves: Integers
    start: Integers
    kind: Integers
    index: Integers
    a: Integers
    b: Integers
    multiplier: Array
    references: Array = field(default_factory=lambda: np.zeros((0, 1)))
    cap_r: Array | None = None
    cap_q: Array | None = None

    def __post_init__(self) -> None:
        put = object.__setattr__
        if not len(self.references):
            put(self, "references", np.zeros((0, self.question.grasp.m + 1)))
        shape = (len(self.references), self.question.grasp.m + 1)
        put(self, "references", frozen(self.references, shape, "references"))
        if (self.cap_r is None) != (self.cap_q is None):
            raise InputError("caps are of all motions, or of none", field="cap_r, cap_q")
        for name, size in (("cap_r", 6), ("cap_q", self.question.plain.l)) if self.capped else ():
            put(self, name, frozen(getattr(self, name), (size,), name))
            if (getattr(self, name) < 0).any():
                raise InputError("is negative; a cap is 0 or more", field=name)
        if (self.scalar is None) == self.question.goal.has_scalar:
            raise InputError("is the range of the goal's scalar; null for a check", field="scalar")
        if self.scalar is not None:
            lo, hi = (float(v) for v in self.scalar)
            put(self, "scalar", (lo, hi))
            real = np.isfinite(lo) and lo <= hi and (hi < np.inf or not self.capped)
            if not real or (lo < 0 and not self.question.goal.maximised):
                raise InputError(f"is {lo:g} to {hi:g}, not a range that the goal knows", field="scalar")
        nodes, leaves, rows = len(np.atleast_1d(self.parent)), len(np.atleast_1d(self.leaves)), len(self.kind)
        sizes = {"leaves": leaves, "start": leaves + 1} | dict.fromkeys(NODE_ARRAYS, nodes)
        for name in (*NODE_ARRAYS, "leaves", *ROW_ARRAYS):
            kind = np.float64 if name == "multiplier" else np.int64
            value = np.array(getattr(self, name), dtype=kind)
            if kind is np.int64 and ((value < -(2**31)) | (value >= 2**31)).any():
                raise InputError("has a number beyond 2^31", field=name)
            if value.shape != (sizes.get(name, rows),):
                raise InputError(f"has shape {value.shape}, needs {(sizes.get(name, rows),)}", field=name)
            value.flags.writeable = False
            put(self, name, value)
        s = self.start
        if not nodes:
            raise InputError("is empty; the root at least is needed", field="parent")
        if s[0] != 0 or s[-1] != rows or (np.diff(s) < 0).any():
            raise InputError(f"must rise from 0 to the number of rows, {rows}", field="start")

    @property
    def claim(self) -> str:
        """What it says, in words."""
        return self.question.goal.claim(self.scalar)

    @property
    def magnitudes(self) -> Range:
        """The magnitudes of which it says that they slip."""
        return self.question.goal.magnitudes(self.scalar)

    @property
    def capped(self) -> bool:
        """Is it of version 1, which says nothing about motions beyond its caps?"""
        return self.cap_r is not None

    def some(self, leaves: Integers) -> Certificate:
        """With these leaves only (their places in `leaves`): to look at them, no proof of anything."""
        counts = np.diff(self.start)
        first = np.cumsum([0, *counts[leaves][:-1]]) if len(leaves) else np.zeros(0, np.int64)
        rows = np.arange(counts[leaves].sum()) + np.repeat(self.start[leaves] - first, counts[leaves])
        kept = {name: getattr(self, name)[rows] for name in ROW_ARRAYS[1:]}
        return replace(self, leaves=self.leaves[leaves], start=np.cumsum([0, *counts[leaves]]), **kept)
