"""What is asked of a grasp, as certificates state it: the load and the commands, affine in one number, the scalar.

| goal | scalar sigma | load | commands |
|---|---|---|---|
| check, (20) | none | w | f_c |
| smallest preload, (23) turned around | share of the preload | d | sigma f_c, and sigma times what is given to joints |
| largest, (23) | magnitude | w + sigma d | f_c |
| torques, (26) | largest command sought, or the sum of all | w | sought |

A certificate says that no state has its scalar in a range.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from handfast.proofs.constants import MAX_ETA
from handfast.proofs.fields import Array, BadFile, Fields, Integers, Mask, refuse_no_limit, refuse_unknown
from handfast.proofs.grasp import GraspData, read_grasp, read_start
from handfast.proofs.joint_laws import Equivalent, equivalent_of
from handfast.proofs.replay import down, up

CHECK, SMALLEST_PRELOAD, LARGEST_GOAL, TORQUES = GOALS = "check", "smallest preload", "largest", "torques"
Range = tuple[float, float]


@dataclass(frozen=True, eq=False)
class AffineLoad:
    """Load w_a + sigma w_b (6,), magnitudes of commands f_a + sigma f_b (a',), given torques g_a + sigma g_b (l',).

    Given torques are rounded once, see `Equivalent.exact`.
    """

    w_a: Array
    w_b: Array
    f_a: Array
    f_b: Array
    g_a: Array
    g_b: Array


@dataclass(frozen=True, eq=False)
class Question:
    """What was asked.

    Attributes:
        grasp: with its commands, and the state that a step of a load's path starts from.
        goal: one of `GOALS`; sums: of torques, is the sum of commands sought, not the largest?
        wrench: (6,) [N, N m] object frame, at its origin; 0 where the goal is the smallest preload.
        direction: (6,) that the scalar multiplies, or the load of the smallest preload; 0 for other goals.
        eta: uncertainty of the contact normals [rad], (17). mdp: with the maximum dissipation principle, (6), (7)?
        torque_limits: actuator -> largest |f| [N m or N]. force_limit: largest c_n [N], inf for none.
        driven: actuators whose commands are sought.
    """

    grasp: GraspData
    goal: str
    sums: bool
    wrench: Array
    direction: Array
    eta: float
    mdp: bool
    torque_limits: Mapping[str, float]
    force_limit: float
    driven: tuple[str, ...]

    @property
    def has_scalar(self) -> bool:
        """Is there one?"""
        return self.goal != CHECK

    @property
    def homogeneous(self) -> bool:
        """Are all states multiples of each other, so that base load and limits have no place?"""
        return self.goal == SMALLEST_PRELOAD

    @property
    def seeks_commands(self) -> bool:
        return self.goal == TORQUES

    @cached_property
    def sought(self) -> Mask:
        """(a,) bool: the grasp's actuators whose commands are sought."""
        return _named(self.grasp, self.driven)

    @cached_property
    def equivalent(self) -> Equivalent:
        """Mechanism and given torques that stand for the joints' laws; actuators and joints below are its."""
        return _equivalent(self.grasp, tuple(self.driven) if self.seeks_commands else None, tuple(self.torque_limits))

    @property
    def actuators(self) -> int:
        """a', rows of the equivalent's mechanism."""
        return len(self.equivalent.R)

    @property
    def joints(self) -> int:
        """l', the grasp's joints and the sliders behind them."""
        return self.grasp.l + self.equivalent.sliders

    @cached_property
    def is_driven(self) -> Mask:
        """(a',) bool: actuators of the equivalent whose command is sought."""
        out = np.zeros(self.actuators, dtype=bool)
        out[: len(self.equivalent.kept)] = self.sought[self.equivalent.kept]
        return out

    @cached_property
    def limit(self) -> Array:
        """(a',) [N m or N] the largest |f| of each actuator; inf for none."""
        own = np.array([self.torque_limits.get(name, np.inf) for name in self.grasp.actuators], dtype=float)
        out = np.full(self.actuators, np.inf)
        out[: len(self.equivalent.kept)] = own[self.equivalent.kept]
        return out

    @cached_property
    def load(self) -> AffineLoad:
        """Load, magnitudes of commands and given torques, affine in the scalar; no commands where they are sought."""
        e = self.equivalent
        f_c, given, w0 = np.abs(e.command), e.torque, np.zeros(6)
        f0, g0 = np.zeros(len(f_c)), np.zeros(len(given))
        if self.goal == CHECK:
            return AffineLoad(self.wrench, w0, f_c, f0, given, g0)
        if self.goal == SMALLEST_PRELOAD:
            return AffineLoad(self.direction, w0, f0, f_c, g0, given)
        if self.goal == LARGEST_GOAL:
            return AffineLoad(self.wrench, self.direction, f_c, f0, given, g0)
        return AffineLoad(self.wrench, w0, f0, f0, given, g0)

    @cached_property
    def may_move(self) -> Mask:
        """(a',) bool: actuators that are commanded or driven, or a tendon; for the others t = 0, (8)."""
        return (self.load.f_a + self.load.f_b != 0) | self.equivalent.tendon | self.is_driven

    @cached_property
    def sense(self) -> Array:
        """(a',) -1 for actuators that are mirrored into the sense of their command, so that (8) reads t >= 0."""
        turned = (self.equivalent.command < 0) & (self.is_driven | (not self.seeks_commands))
        return np.where(turned, -1.0, 1.0)

    @property
    def soft_fingers(self) -> Integers:
        """(m,) which soft finger a contact is, -1 for a point contact."""
        out = np.full(self.grasp.m, -1, np.int64)
        out[self.grasp.soft] = np.arange(len(self.grasp.soft))
        return out

    def claim(self, scalar: Range | None) -> str:
        """What a certificate for a range of the scalar says, in words."""
        of = "" if scalar is None else f"{up(scalar[0])} to {down(scalar[1])}"
        return {
            CHECK: "the disturbance is not resisted" + ("" if self.grasp.start is None else " from the state before"),
            SMALLEST_PRELOAD: f"the direction is not resisted with {of} times the preload",
            LARGEST_GOAL: f"{of} times the direction is not resisted",
            TORQUES: f"no commands of {of} suffice",
        }[self.goal]

    def magnitudes(self, scalar: Range | None) -> Range:
        """The range of the scalar as a range of magnitudes of the direction."""
        lo, hi = scalar or (0.0, 0.0)
        if not self.homogeneous:
            return lo, hi
        return (1.0 / hi if hi > 0 else np.inf), (1.0 / lo if lo > 0 else np.inf)


def read_question(data: Any, place: str) -> Question:
    """The question in a parsed object. Raises `BadFile`: the field, what is wrong, and what would be right."""
    f = Fields(data, place)
    g = read_grasp(f.take("grasp"), f.at("grasp"))
    goal, effort = f.text("goal", among=GOALS), f.text("objective", "max", among=("max", "sum"))
    if effort == "sum" and goal != TORQUES:
        raise BadFile("is 'sum', which is for the goal 'torques'", f.at("objective"))
    wrench = f.numbers("wrench", (6,))
    direction = f.numbers("direction", (6,)) if f.has("direction") else None
    if (direction is not None) != (goal in (SMALLEST_PRELOAD, LARGEST_GOAL)):
        need = "is needed" if direction is None else "has no meaning"
        raise BadFile(f"{need} where the goal is '{goal}'", f.at("direction"))
    if direction is not None and not direction.any():
        raise BadFile("is zero: nothing is asked; a force, a torque or both are needed", f.at("direction"))
    eta, mdp = f.number("eta", 0.0, least=0.0), f.flag("mdp", True)
    if not eta < MAX_ETA or (eta > 0 and (not mdp or len(g.soft))):
        right = f"0 to {MAX_ETA:.4f} is possible, above 0 with the dissipation principle and point contacts alone"
        raise BadFile(f"is {eta:g} rad; {right}", f.at("eta"))
    limits = f.named("torque_limits", {})
    for name, value in limits.items():
        refuse_unknown(name, g.actuators, "actuator", f.at("torque_limits"))
        refuse_no_limit(value, f.at(f"torque_limits.{name}"))
    force = f.number("force_limit", least=0.0) if f.has("force_limit") else np.inf
    refuse_no_limit(force, f.at("force_limit"))
    if goal == SMALLEST_PRELOAD and (wrench.any() or limits or force < np.inf):
        raise BadFile(f"'{goal}' knows no base load and no limits", f.at("goal"))
    driven = f.texts("driven", ())
    for name in driven:
        refuse_unknown(name, g.actuators, "actuator", f.at("driven"))
    if len(set(driven)) < len(driven) or (driven and goal != TORQUES):
        raise BadFile("is for the goal 'torques', each actuator once", f.at("driven"))
    if f.has("from"):
        g = read_start(f, g)
        if goal != CHECK or not mdp:
            right = "it is for the goal 'check', with the dissipation principle"
            raise BadFile(f"has no meaning here; {right}", f.at("from"))
    f.done()
    zero = np.zeros(6) if direction is None else direction
    return Question(g, goal, effort == "sum", wrench, zero, eta, mdp, limits, force, driven)


def _named(grasp: GraspData, names: Collection[str]) -> Mask:
    """(a,) bool: which of a grasp's actuators are among these."""
    return np.array([name in names for name in grasp.actuators], dtype=bool)


@lru_cache(maxsize=8)  # of a grasp that is asked again, or proved in several ranges
def _equivalent(grasp: GraspData, driven: tuple[str, ...] | None, limited: tuple[str, ...]) -> Equivalent:
    return equivalent_of(grasp, None if driven is None else _named(grasp, driven), limited)
