"""Which commands resist a disturbance with the least effort? Stability paper, section VII-C, (26)-(27)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from handfast.core.answer import SearchLimits, Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.proofs.path_commands import PathBound, PathCommands
from handfast.stability.answers.answer import Answer, finite
from handfast.stability.answers.load_path import comes_after
from handfast.stability.answers.path_torques import PathTorques
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.objective import INF, Effort, Objective, SmallestCommands
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import Loading, OnStep, Settings
from handfast.stability.search.reduced import LEAST_COMMAND
from handfast.stability.search.solve import ANY_STATE_NODES, clock_of, held_under, solve, time_left, without_end

if TYPE_CHECKING:
    from handfast.stability.search.proof import Outcome

COMMAND_RAISES = (1e-3, 1e-2, 1e-1)  # shares of the gap by which commands are raised until a check holds


@dataclass(frozen=True, eq=False)
class TorquesAnswer(Answer):
    """Which commands resist a disturbance with the least effort?

    Attributes:
        preload: actuator name -> command [N m or N]; None without a witness. 0 is a locked actuator.
        lower, upper: certified and witnessed bound on the objective [N m or N]. Of a path the commands are some that
            were found, and `lower` is 0 where nothing is known below.
        sought, bound: of a path, what is behind `lower`; no bound where it is 0.
    """

    query = "torques"

    preload: dict[str, float] | None
    lower: float
    upper: float
    sought: PathCommands | None = field(default=None, kw_only=True, repr=False)
    bound: PathBound | None = field(default=None, kw_only=True, repr=False)

    @property
    def sums_commands(self) -> bool:
        """Is the sum of the commands made small, not the largest?"""
        if self.sought is not None:
            return self.sought.sums
        return bool(self.posed and self.posed.goal.sums_commands)

    @property
    def _bound(self) -> float:
        """The commands below which the proof says that none are enough."""
        return self.lower if np.isfinite(self.lower) else 0.0

    def proof_json(self) -> dict[str, Any]:
        return super().proof_json() | ({} if self.sought is None else {"certified": self.bound is not None})

    def to_file(self) -> dict[str, Any]:
        """Of a path with what its bound rests on."""
        out = super().to_file()
        if self.sought is None:
            return out
        return out | {"sought": self.sought.to_json(), "bound": None if self.bound is None else self.bound.to_json()}

    def settled(self, until: float = INF) -> TorquesAnswer:
        """UNDECIDED, without commands, if its witness or its bound cannot be proved; else as it is."""
        out = super().settled(until)
        if out.verdict is self.verdict:
            return out
        return replace(out, preload=None, lower=self.lower if np.isfinite(self.lower) else 0.0, upper=INF)

    def said(self) -> dict[str, Any]:
        return {"preload": self.preload, "lower": finite(self.lower), "upper": finite(self.upper)}


def ask(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    objective: Effort = "max",
    actuators: Sequence[str] | None = None,
    limits: GraspLimits = NO_LIMITS,
    loading: Loading = "together",
    settings: Settings | None = None,
    on_progress: OnStep | None = None,
) -> TorquesAnswer:
    """What `handfast.torques` answers, whose arguments and errors these are."""
    settings = settings or Settings()
    posed, names = posed_torques(grasp, wrench, objective, actuators, limits)
    if comes_after(loading):
        return _on_path(grasp, posed, names, settings, on_progress)
    clock = clock_of(settings)
    first: TorquesAnswer | None = None
    for found in _found(grasp, posed.problem, posed.goal, settings, on_progress, clock):
        answer = shown_torques(posed, names, found)
        settled = answer.settled(clock.end) if settings.verify else answer
        if settled.verdict is not Verdict.UNDECIDED:
            return settled
        first = first or settled
    assert first is not None
    return first


def _on_path(
    grasp: Grasp, posed: BoundProblem, names: list[str], settings: Settings, on_progress: OnStep | None
) -> TorquesAnswer:
    """Commands that hold the load on its path."""

    def together(within: Settings) -> tuple[dict[str, float] | None, int]:
        found = solve(posed.problem, posed.goal, within, None)
        if found.stop is Stop.INTERRUPTED:
            raise KeyboardInterrupt
        return shown_torques(posed, names, found).preload, found.nodes

    found = PathTorques(grasp, posed, names, together, settings, on_progress).found()
    bounds: dict[str, Any] = {"preload": found.commands, "lower": found.lower, "upper": found.upper}
    return TorquesAnswer(**found.backing, **bounds, sought=found.sought, bound=found.bound)


def posed_torques(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    objective: Effort,
    actuators: Sequence[str] | None,
    limits: GraspLimits,
) -> tuple[BoundProblem, list[str]]:
    """The question of `torques`, and the names of the actuators whose commands are sought."""
    if objective not in ("max", "sum"):
        raise InputError(f"is '{objective}'; 'max' or 'sum' is needed", field="objective")
    names = list(actuators or grasp.sought_actuators)
    chosen = grasp.mechanism.commands(dict.fromkeys(names, 1.0), field="actuators") != 0
    sense = {n: v for n, v in grasp.preload.items() if n in names}
    asked = grasp.with_commands({n: np.sign(sense.get(n, 1.0)) for n in names})
    return BoundProblem(
        scaled_problem.build(asked, wrench, limits=limits, driven=chosen), SmallestCommands(objective)
    ), names


def shown_torques(posed: BoundProblem, names: Sequence[str], found: Outcome) -> TorquesAnswer:
    """What a search has shown of the smallest commands of these actuators; not settled yet."""
    assert isinstance(posed.goal, SmallestCommands)
    preload, lower, upper = None, max(found.bound, 0.0), INF
    if lower == INF and found.proof is not None:  # no more than the certificate covers
        lower = posed.goal.scalar_unit(posed.problem) * found.proof.cut
    if lower == INF:
        verdict = Verdict.SLIPS
    elif found.witness is None:
        verdict = Verdict.UNDECIDED
    else:
        verdict, commands = Verdict.HOLDS, found.witness.grasp.command
        every = dict(zip(found.witness.grasp.mechanism.actuators, commands.tolist(), strict=True))
        preload, upper = {n: every[n] for n in names}, posed.goal.cost(found.witness.grasp)
    backing: dict[str, Any] = {"posed": posed, "verified": found.backed}
    backing |= {"preload": preload, "lower": lower, "upper": upper}
    return TorquesAnswer(verdict, found.stop, *found.cost, found.witness, found.proof, **backing)


def with_hardly_any(p: ScaledProblem) -> Grasp:
    """The grasp with next to no commands, where any will do and none will not."""
    same = p.equivalent
    return p.grasp.with_preload(same.command_of(LEAST_COMMAND * p.command_units * same.plain.command))


def _found(
    grasp: Grasp,
    p: ScaledProblem,
    goal: Objective,
    settings: Settings,
    on_progress: OnStep | None,
    clock: SearchLimits,
) -> Iterator[Outcome]:
    """The least commands that were found, raised by a little so that they hold by more than luck, the best first."""
    finer = replace(settings, gap=(1 - 2 * COMMAND_RAISES[-1]) * settings.gap)  # leaves room for raising the commands
    found = solve(p, goal, finer, on_progress, refuted=False)
    if found.bound == INF:
        beyond = solve(p, goal, time_left(finer, clock), on_progress, endless=True) if not clock.late else None
        if beyond is not None and beyond.bound == INF and (beyond.verified or not settings.verify):
            found = beyond.after(found)
        else:  # what there is up to an end has to be proved by itself
            first = solve(p, goal, time_left(finer, clock), on_progress)
            found = without_end(p, goal, finer, on_progress, first, clock) if first.bound == INF else first
    if found.stop is not Stop.INTERRUPTED and found.witness is None and found.bound <= 0.0:
        # any will do, and none will not: ask for hardly any
        held = held_under(with_hardly_any(p), p, settings, found, clock)
        if held is not None:
            found = replace(held, stop=Stop.COMPLETE)  # nothing is less than none
    elif found.stop is not Stop.INTERRUPTED and found.witness is not None and not clock.late:
        # commands that are the smallest to the last bit hold by luck: a little more, as `check` answers
        command = found.witness.grasp.command
        back = np.array(grasp.mechanism.backdrivable, dtype=bool)
        for share in COMMAND_RAISES:
            raised = grasp.with_preload(np.where(back, command, (1 + settings.gap * share) * command))
            few = (
                replace(settings, nodes=min(settings.nodes, ANY_STATE_NODES))
                if share < COMMAND_RAISES[-1]
                else settings
            )
            held = held_under(raised, p, few, found, clock)
            if held is not None:
                yield held
    yield found
    left = min(settings.nodes - found.nodes, ANY_STATE_NODES + 2 * found.nodes)
    if found.stop in (Stop.COMPLETE, Stop.NUMERICAL) and found.bound < INF and left > 0 and not clock.late:
        found = _carrying(p, goal, replace(time_left(settings, clock), nodes=left), found)
        yield found
    if found.stop is not Stop.INTERRUPTED and found.bound < INF:  # no fewer are found than the grasp has
        own = grasp.with_preload(np.where(p.grasp.command != 0, grasp.command, 0.0))
        few = replace(settings, nodes=min(settings.nodes, ANY_STATE_NODES))
        held = held_under(own, p, few, found, clock) if own.command.any() else None
        if held is not None:
            yield held


def _carrying(p: ScaledProblem, goal: Objective, settings: Settings, found: Outcome) -> Outcome:
    """Commands of which each is carried, where those that were found are not proved, with the better bound of both.

    The least may be approached only as a command goes to none, which leaves its actuator turning without force.
    """
    there = solve(p, goal, settings, None, least=LEAST_COMMAND)
    if there.witness is None:  # up to the end of a search, which is not that there are none
        return found.after(there)
    out = there.after(found)
    if there.stop is Stop.COMPLETE or found.bound <= there.bound:
        return out
    stop = Stop.COMPLETE if goal.near(p, out.value, found.bound, settings.gap) else out.stop
    return replace(out, bound=found.bound, proof=found.proof, verified=found.verified, stop=stop)
