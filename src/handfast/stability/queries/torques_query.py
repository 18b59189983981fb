"""Which commands resist a disturbance with the least effort? Stability paper, section VII-C, (26)-(27)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.stability import scaled_problem
from handfast.stability.answers import Answer, finite
from handfast.stability.goal import INF, NEAR_END, STRONGEST, Effort, SmallestCommands
from handfast.stability.posed import Posed
from handfast.stability.query import (
    CertificateClaim,
    ClaimRefused,
    Query,
    ResultAnswerEntry,
    SavedAnswer,
    WitnessClaim,
    close,
)
from handfast.stability.scaled_problem import ScaledProblem
from handfast.stability.settings import OnStep, Settings
from handfast.stability.solve import held_under, solve, without_end
from handfast.stability.witness import Witness

if TYPE_CHECKING:
    from handfast.stability.search.outcome import Outcome

MORE = (1e-3, 1e-2, 1e-1)  # shares of the gap by which commands are raised until a check holds
NEARLY_NONE = 1e-6  # (scaled) commands where the least that hold are only approached, as they go to 0


class TorquesEntry(ResultAnswerEntry):
    query: Literal["torques"]
    preload: dict[str, float] | None
    lower: float | None
    upper: float | None


Saved = SavedAnswer[TorquesEntry]


class TorquesQuery(Query[TorquesEntry]):
    name = "torques"
    entry = TorquesEntry

    def witness_claim(self, saved: Saved, witness: Witness) -> WitnessClaim:
        words = f"commands of {saved.answer.upper or 0.0:.6g} suffice"
        return WitnessClaim(words, saved.question.wrench, witness.grasp.command)

    def witness_fault(self, saved: Saved, witness: Witness) -> str:
        """Are the commands those that the answer gives, and do they cost what it says?"""
        q, answer, command = saved.question, saved.answer, witness.grasp.command
        names = q.grasp.mechanism.actuators
        sought = q.sought
        given = np.where(q.grasp.mechanism.backdrivable, q.grasp.command, 0.0)
        if (command[~sought] != given[~sought]).any():
            return "an actuator is commanded that was to stay locked, or a backdrivable one otherwise"
        if (np.where(q.grasp.command < 0, -1.0, 1.0) * command < 0)[sought].any():
            return "a command has the wrong sense"
        said = answer.preload or {}
        if set(said) != {n for n, d in zip(names, sought, strict=True) if d}:
            return "the answer's commands are of other actuators"
        each = zip(names, command[:, None], given, strict=True)
        if not all(close(np.array([said.get(n, own)]), x) for n, x, own in each):
            return "the answer gives other commands"
        cost = SmallestCommands(q.goal.effort).cost(witness.grasp)
        if answer.upper is None or not close(np.array([answer.upper]), np.array([cost])):
            return f"its commands cost {cost:.6g}; the answer says {answer.upper}"
        return ""

    def certificate_claim(self, saved: Saved) -> CertificateClaim | None:
        q, answer = saved.question, saved.answer
        if not q.goal.seeks_commands:
            raise ClaimRefused(f"is of torques, its question of '{q.goal.word}'")
        if answer.verdict is Verdict.SLIPS:
            if answer.lower is not None or answer.upper is not None:
                raise ClaimRefused("SLIPS with bounds")
            end = STRONGEST * Posed.of(q).problem.command_unit * (1 - NEAR_END) if saved.first else INF
            return CertificateClaim("no commands suffice", (0.0, end))
        if answer.lower is None:
            raise ClaimRefused("has no lower bound")
        if not answer.lower >= 0:
            raise ClaimRefused(f"a lower bound of {answer.lower:.6g}")
        if answer.upper is not None and answer.lower > answer.upper:
            raise ClaimRefused(f"its lower bound {answer.lower:.9g} is above its upper bound {answer.upper:.9g}")
        words = f"no commands below {answer.lower:.6g} suffice"
        return CertificateClaim(words, (0.0, answer.lower)) if answer.lower > 0 else None

    def shown(self, saved: Saved) -> dict[str, Any]:
        """The bounds are those that witness and certificate were held against."""
        answer, w = saved.answer, saved.witness
        commands = None if w is None else {n: w.grasp.preload.get(n, 0.0) for n in saved.question.driven}
        return {"preload": commands, "lower": answer.lower, "upper": None if w is None else answer.upper}


@dataclass(frozen=True, eq=False)
class TorquesAnswer(Answer):
    """Which commands resist a disturbance with the least effort?

    Attributes:
        preload: actuator name -> command [N m or N]; None without a witness. 0 is a locked actuator.
        lower, upper: certified and witnessed bound on the objective [N m or N].
    """

    query = TorquesQuery()

    preload: dict[str, float] | None
    lower: float
    upper: float

    def said(self) -> dict[str, Any]:
        return {"preload": self.preload, "lower": finite(self.lower), "upper": finite(self.upper)}


def torques(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    objective: Effort = "max",
    actuators: Sequence[str] | None = None,
    eta: float = 0.0,
    torque_limits: Mapping[str, float] | None = None,
    force_limit: float | None = None,
    settings: Settings | None = None,
    on_step: OnStep | None = None,
) -> TorquesAnswer:
    """The commands that resist a disturbance with the least effort: section VII-C, (26)-(27).

    An actuator that need not turn is locked and costs nothing, whatever passive load its gearing
    carries: that is (8), tau free where the command is zero.

    Args:
        wrench: (6,) force [N] and torque [N m] on the object, or (3,) a force at its origin.
        objective: "max", the largest single command, or "sum".
        actuators: whose commands are sought; by default those that the grasp commands now, or all.
            The others stay locked; backdrivable motors stay as the grasp commands them.

    The other arguments and errors are those of `check`.

    Raises:
        InputError: also for an unknown objective or actuator, and for a backdrivable one.
    """
    settings = settings or Settings()
    if objective not in ("max", "sum"):
        raise InputError(f"is '{objective}'; 'max' or 'sum' is needed", field="objective")
    names = list(actuators or grasp.sought_actuators)
    chosen = grasp.mechanism.commands(dict.fromkeys(names, 1.0), field="actuators") != 0
    sense = {n: v for n, v in grasp.preload.items() if n in names}
    asked = grasp.with_commands({n: np.sign(sense.get(n, 1.0)) for n in names})
    limits: dict[str, Any] = {"torque_limits": torque_limits, "force_limit": force_limit}
    p = scaled_problem.build(asked, wrench, eta=eta, driven=chosen, **limits)
    goal = SmallestCommands(objective)
    found = _search(grasp, p, goal, settings, on_step)
    preload, lower, upper = None, max(found.bound, 0.0), INF
    if found.bound == INF:
        verdict, lower = Verdict.SLIPS, INF
    elif found.witness is None:
        verdict = Verdict.UNDECIDED
    else:
        verdict, commands = Verdict.HOLDS, found.witness.grasp.command
        every = dict(zip(found.witness.grasp.mechanism.actuators, commands.tolist(), strict=True))
        preload, upper = {n: every[n] for n in names}, goal.cost(found.witness.grasp)
    backing: dict[str, Any] = {"posed": Posed(p, goal), "verified": found.backed}
    return TorquesAnswer(verdict, found.stop, *found.cost, found.witness, found.proof, preload, lower, upper, **backing)


def _search(
    grasp: Grasp, p: ScaledProblem, goal: SmallestCommands, settings: Settings, on_step: OnStep | None
) -> Outcome:
    """The least commands that were found, raised by a little so that they hold by more than luck."""
    finer = replace(settings, gap=(1 - 2 * MORE[-1]) * settings.gap)  # leaves room for raising the commands
    found = solve(p, goal, finer, on_step)
    if found.bound == INF and settings.method == "engine":
        found = without_end(p, goal, finer, on_step, found)
    if found.stop is Stop.INTERRUPTED:
        return found
    if found.witness is None and found.bound <= 0.0:  # any will do, and none will not: ask for hardly any
        same = p.equivalent
        little = p.grasp.with_preload(same.command_of(NEARLY_NONE * p.command_units * same.plain.command))
        held = held_under(little, p, settings, found)
        return found if held is None else replace(held, stop=Stop.COMPLETE)  # nothing is less than none
    if found.witness is not None and settings.method == "engine":
        # commands that are the smallest to the last bit hold by luck: a little more, as `check` answers
        command = found.witness.grasp.command
        back = np.array(grasp.mechanism.backdrivable, dtype=bool)
        factors = 1 + settings.gap * np.array(MORE)
        raised = (grasp.with_preload(np.where(back, command, factor * command)) for factor in factors)
        return next((held for g in raised if (held := held_under(g, p, settings, found))), found)
    return found
