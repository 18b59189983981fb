"""What a search seeks: any state at all, or one number (the *scalar*) that is to be small or large.

An `Objective` owns what follows from that choice: the disturbance and the commands that the scalar multiplies, the
range in which it is sought, its units, and what a certificate about a range of it claims. Its value, which the search
makes small, is the scalar, or its negative where that is to be large. Files call it a goal.

The maximum (23) is posed as its homogeneous twin where nothing breaks homogeneity: minimise lambda with
w = d and commands lambda f_c, s = 1 / lambda; springs and friction of joints are lambda times as large, too. In the
limit lambda = 0 grasps can resist what they resist at no finite magnitude, so the search ends at
`ScaledProblem.search_end`, and a maximum there counts as unbounded.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.proofs.question import AffineLoad
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.witness import Witness

INF = float("inf")
# times the usual end of magnitudes, where nothing is resisted up to there: commands still count there
COMMAND_END_FACTOR = 1e3
HIGHEST = 1e4  # of lambda, unless it is to be endless: the balance of energy needs an end
NO_MAGNITUDE = 1e-10  # magnitudes, in other forces in play, that count as none
NO_COMMAND = 1e-8  # (scaled) by which commands may differ that count as the same

Effort = Literal["max", "sum"]
Range = tuple[float, float]


@dataclass(frozen=True)
class Objective(ABC):
    """What is sought. Magnitudes are those of a maximum, as multiples of the direction as it was given.

    Attributes:
        word: its name in files.
        effort: of `SmallestCommands`, what is made small; otherwise without meaning.
        has_scalar: or is any state sought?
        has_direction: does the scalar multiply a direction, or what is beside it?
        homogeneous: are all states multiples of each other, so that base load and limits have no place?
        maximised: is the scalar to be large?
        seeks_commands: is the scalar a measure of commands that are sought?
        bounds_energy: do the commands have an end in every range of the scalar, so that w . r + f_c . t bounds energy?
    """

    word: ClassVar[str]
    effort: Effort = "max"
    has_scalar: ClassVar[bool] = True
    has_direction: ClassVar[bool] = False
    homogeneous: ClassVar[bool] = False
    maximised: ClassVar[bool] = False
    seeks_commands: ClassVar[bool] = False
    bounds_energy: ClassVar[bool] = False

    # --- the question as certificates put it, in any units

    @abstractmethod
    def load(self, base: Array, direction: Array, command: Array, given: Array) -> AffineLoad:
        """The load, from base load and direction (6,), magnitudes of commands (a,) and torques given to joints (l,)."""

    @abstractmethod
    def claim(self, scalar: Range | None) -> str:
        """What a certificate for a range of the scalar says, in words."""

    def magnitudes(self, scalar: Range | None) -> Range:
        """The range of the scalar as a range of magnitudes."""
        return scalar or (0.0, 0.0)

    @property
    def sums_commands(self) -> bool:
        """Is the sum of commands made small, so that each of them is an unknown of its own?"""
        return self.seeks_commands and self.effort == "sum"

    # --- the search's side: scaled scalars

    @abstractmethod
    def search_range(self, p: ScaledProblem, *, endless: bool = False) -> Range:
        """Between what the objective is sought; `endless` goes on beyond where searches end otherwise."""

    def scaled_load(self, p: ScaledProblem) -> AffineLoad:
        """The load in the scales of a problem."""
        return self.load(p.w0, p.direction, p.f_c, p.torque)

    def objective(self, scalar: float) -> float:
        """What is made small, or the scalar of an objective."""
        return -scalar if self.maximised else scalar

    def scalar_range(self, lo: float, hi: float) -> Range:
        """The scalar in a range of the objective."""
        return (-hi, -lo) if self.maximised else (lo, hi)

    def scalar_unit(self, p: ScaledProblem) -> float:
        """One scaled unit of the scalar in the question's own units."""
        return 1.0

    def force_unit(self, p: ScaledProblem) -> float:
        """[N] one scaled unit of force in the question's own units."""
        return p.force

    def gaps(self, gap: float) -> tuple[float, float]:
        """Relative and absolute (scaled) distance of value and bound, for a gap that was asked."""
        return gap, NO_MAGNITUDE

    def near(self, p: ScaledProblem, value: float, bound: float, gap: float) -> bool:
        """Are value and bound of the objective as near as asked, relative to the smaller magnitude or larger torque?"""
        relative, absolute = self.gaps(gap)
        unit = p.command_unit if self.seeks_commands else 1.0
        return bool(np.isfinite(value) and value - bound <= relative * abs(value) + absolute * unit)

    def bounds(self, p: ScaledProblem, value: float, bound: float) -> Range:
        """(lower, upper) of what was asked, from an objective achieved and a bound on it, inf without."""
        return bound, value

    def given_share(self, scalar: float) -> float:
        """What is given to joints, in multiples of what the grasp says, at a scalar."""
        return scalar if self.homogeneous else 1.0

    def achieved(self, witness: Witness, scalar: float) -> float:
        """The objective of an exact state with its scaled scalar."""
        return self.objective(scalar)

    def at_magnitude(self, p: ScaledProblem, magnitude: float) -> float:
        """The scaled scalar of a magnitude."""
        raise TypeError(f"'{self.word}' has no magnitudes")

    def magnitude(self, p: ScaledProblem, objective: float) -> float:
        """The magnitude of an objective."""
        raise TypeError(f"'{self.word}' has no magnitudes")


@dataclass(frozen=True)
class AnyState(Objective):
    """Any solution, (20): there is no scalar. The disturbance is the base load, the commands are the grasp's."""

    word = "check"
    has_scalar = False
    bounds_energy = True

    def load(self, base: Array, direction: Array, command: Array, given: Array) -> AffineLoad:
        return AffineLoad(base, np.zeros(6), command, np.zeros(command.shape), given, np.zeros(given.shape))

    def claim(self, scalar: Range | None) -> str:
        return "the disturbance is not resisted"

    def search_range(self, p: ScaledProblem, *, endless: bool = False) -> Range:
        return -INF, INF

    def near(self, p: ScaledProblem, value: float, bound: float, gap: float) -> bool:
        return False

    def achieved(self, witness: Witness, scalar: float) -> float:
        return 0.0


@dataclass(frozen=True)
class SmallestPreload(Objective):
    """lambda, the homogeneous form of (23): the disturbance is the direction, the commands are lambda f_c.

    So is what is given to joints: lambda times as large.
    """

    word = "smallest preload"
    has_direction = True
    homogeneous = True
    bounds_energy = True

    def load(self, base: Array, direction: Array, command: Array, given: Array) -> AffineLoad:
        return AffineLoad(direction, np.zeros(6), np.zeros(command.shape), command, np.zeros(given.shape), given)

    def claim(self, scalar: Range | None) -> str:
        return f"the direction is not resisted with {_range(scalar)} times the preload"

    def magnitudes(self, scalar: Range | None) -> Range:
        lo, hi = scalar or (0.0, 0.0)
        return (1.0 / hi if hi > 0 else INF), (1.0 / lo if lo > 0 else INF)

    def search_range(self, p: ScaledProblem, *, endless: bool = False) -> Range:
        return 1.0 / ((COMMAND_END_FACTOR if endless else 1.0) * p.search_end), INF if endless else HIGHEST

    def scalar_unit(self, p: ScaledProblem) -> float:
        return 1.0 / p.direction_scale

    def force_unit(self, p: ScaledProblem) -> float:
        return p.force / p.direction_scale

    def gaps(self, gap: float) -> tuple[float, float]:
        return gap / (1 + gap), 0.0

    def near(self, p: ScaledProblem, value: float, bound: float, gap: float) -> bool:
        return bool(np.isfinite(value) and value - bound <= gap * abs(bound))

    def bounds(self, p: ScaledProblem, value: float, bound: float) -> Range:
        scale = p.direction_scale
        return scale / value if value > 0 else INF, scale / bound if bound > 0 else INF

    def at_magnitude(self, p: ScaledProblem, magnitude: float) -> float:
        return p.direction_scale / magnitude if magnitude > 0 else INF

    def magnitude(self, p: ScaledProblem, objective: float) -> float:
        return p.direction_scale / objective


@dataclass(frozen=True)
class LargestMagnitude(Objective):
    """s of w0 + s d, (23), under the grasp's commands; the objective is -s."""

    word = "largest"
    has_direction = True
    maximised = True

    def load(self, base: Array, direction: Array, command: Array, given: Array) -> AffineLoad:
        return AffineLoad(base, direction, command, np.zeros(command.shape), given, np.zeros(given.shape))

    def claim(self, scalar: Range | None) -> str:
        return f"{_range(scalar)} times the direction is not resisted"

    def search_range(self, p: ScaledProblem, *, endless: bool = False) -> Range:
        return -INF if endless else -p.search_end, 0.0

    def scalar_unit(self, p: ScaledProblem) -> float:
        return p.direction_scale

    def bounds(self, p: ScaledProblem, value: float, bound: float) -> Range:
        scale = p.direction_scale
        return max(0.0, -value * scale), max(0.0, -bound * scale)  # of equals the first: no -0

    def at_magnitude(self, p: ScaledProblem, magnitude: float) -> float:
        return magnitude / p.direction_scale

    def magnitude(self, p: ScaledProblem, objective: float) -> float:
        return -objective * p.direction_scale


@dataclass(frozen=True)
class SmallestCommands(Objective):
    """The largest command (26), or the sum of all, of the actuators whose commands are sought; others are locked."""

    word = "torques"
    seeks_commands = True

    def load(self, base: Array, direction: Array, command: Array, given: Array) -> AffineLoad:
        none = np.zeros(command.shape)
        return AffineLoad(base, np.zeros(6), none, none, given, np.zeros(given.shape))

    def claim(self, scalar: Range | None) -> str:
        return f"no commands of {_range(scalar)} suffice"

    def search_range(self, p: ScaledProblem, *, endless: bool = False) -> Range:
        return 0.0, INF if endless else p.command_end

    def scalar_unit(self, p: ScaledProblem) -> float:
        return p.command_unit

    def gaps(self, gap: float) -> tuple[float, float]:
        return gap, NO_COMMAND

    def achieved(self, witness: Witness, scalar: float) -> float:
        return self.cost(witness.grasp)

    def cost(self, grasp: Grasp) -> float:
        """[N m or N] of the commands of a grasp that were sought: those of backdrivable motors are given."""
        command = grasp.command[~np.array(grasp.mechanism.backdrivable, dtype=bool)]
        return float(np.abs(command).max(initial=0.0) if self.effort == "max" else np.abs(command).sum())


ANY_STATE, SMALLEST_PRELOAD, LARGEST_MAGNITUDE = AnyState(), SmallestPreload(), LargestMagnitude()
SMALLEST_LARGEST_COMMAND, SMALLEST_SUM_OF_COMMANDS = SmallestCommands("max"), SmallestCommands("sum")
GOALS: tuple[Objective, ...] = (
    ANY_STATE,
    SMALLEST_PRELOAD,
    LARGEST_MAGNITUDE,
    SMALLEST_LARGEST_COMMAND,
    SMALLEST_SUM_OF_COMMANDS,
)
GOAL_WORDS = tuple(dict.fromkeys(goal.word for goal in GOALS))


def named(word: str, effort: Effort = "max") -> Objective:
    """The goal that files call so; `KeyError` if there is none."""
    found = {goal.word: goal for goal in GOALS}[word]
    return SmallestCommands(effort) if found.seeks_commands else found


def _range(scalar: Range | None) -> str:
    return "" if scalar is None else f"{scalar[0]:.6g} to {scalar[1]:.6g}"
