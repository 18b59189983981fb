"""The questions that a label asks the engine, all of them: largest disturbances, loads held, smallest commands.

Whatever answers many questions at once belongs here, and nothing else of this package knows how they are asked.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.stability.answers.batch_answer import BatchAnswer
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.scaled_problem import unbalanced
from handfast.stability.problem.settings import Loading, Settings
from handfast.stability.studies.batch import max_many
from handfast.stability.studies.prepared import PreparedGrasp, prepare
from handfast.stability.studies.questions import hold, torques

MIN_QUESTION_TIME = 1e-3  # [s] that a question has where no time is left,
MIN_QUESTION_NODES = 64  # and nodes
COMMAND_GAP, BRIEF = 0.1, 256  # gap and nodes of commands that need not be the least,
FIRST_NODES = 16  # and nodes that show mostly that there are none
# of the smallest commands for one load: they may hold all, some to spare
COMMAND_FACTORS = 1.5, 1.1, 2.5, 5.0, 1.00001


@dataclass(frozen=True)
class LargestLoad:
    """Up to where a disturbance is resisted, as a multiple of it: witnessed, and proved (inf: no end was shown)."""

    lower: float
    upper: float
    unbounded: bool

    @property
    def ends(self) -> bool:
        """Is it known how much is resisted, however much?"""
        return self.unbounded or bool(np.isfinite(self.upper))


def largest_command(grasp: Grasp, commands: Array) -> float:
    """The largest of commands (a,), of the motors that can be commanded otherwise."""
    free = ~np.asarray(grasp.mechanism.backdrivable, dtype=bool)
    return float(np.abs(commands[free]).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class LeastCommands:
    """Commands (a,) that resist a disturbance, None if none were found; none whose largest is below `lower` does."""

    commands: Array | None
    lower: float


def free_motors(grasp: Grasp) -> tuple[str, ...]:
    """The motors that can be commanded otherwise: all but the backdrivable ones."""
    motors = zip(grasp.mechanism.actuators, grasp.mechanism.backdrivable, strict=True)
    return tuple(name for name, back in motors if not back)


@dataclass
class Questions:
    """Asks about one grasp, and counts what it cost.

    Attributes:
        grasp: with the preload in force.
        settings: of each question but for its time, and for its nodes where these come to an end.
        seconds: [s] for all questions together. budget: nodes for all of them.
        loading: as of `check`.
        nodes: spent so far. open: questions that a limit left open. stop: the last limit that was hit.
    """

    grasp: Grasp
    settings: Settings
    seconds: float
    budget: float
    loading: Loading = "together"
    nodes: int = 0
    open: int = 0
    stop: Stop = Stop.COMPLETE
    _begin: float = field(default_factory=time.monotonic)

    @property
    def along_paths(self) -> bool:
        """Do loads come after the commands?"""
        return self.loading != "together"

    def largest(self, directions: list[Array]) -> list[LargestLoad]:
        """The largest multiple of each disturbance (6,) that is resisted; each helps the next."""
        out = [LargestLoad(0.0, 0.0, False)] * len(directions)
        asked = [k for k, direction in enumerate(directions) if not unbalanced(self.grasp, direction)]
        if not asked:
            return out
        settings, W = self._limited(len(asked)), [directions[k] for k in asked]
        if settings.verify:
            found = max_many(self.grasp, W, settings=settings, jobs=1, answers=True, loading=self.loading)
        else:
            found = self._prepared(settings).maximum(W)
        for i, k in enumerate(asked):
            out[k] = LargestLoad(float(found.lower[i]), float(found.upper[i]), bool(found.unbounded[i]))
            slips = found.verdict[i] == Verdict.SLIPS
            self._count_row(found, i, out[k].ends or bool(slips))
        return out

    def held(self, wrenches: list[Array]) -> list[Verdict]:
        """Is each of these disturbances (6,) resisted? Each helps the next."""
        out = [Verdict.SLIPS] * len(wrenches)
        asked = [k for k, wrench in enumerate(wrenches) if not unbalanced(self.grasp, wrench)]
        if not asked:
            return out
        found = self._prepared(self._limited(len(asked))).check([wrenches[k] for k in asked])
        for i, k in enumerate(asked):
            out[k] = Verdict(str(found.verdict[i]) or Verdict.UNDECIDED)
            self._count_row(found, i, out[k] is not Verdict.UNDECIDED)
        return out

    def commands(self, wrench: Array, motors: tuple[str, ...] | None = None, *, rough: bool = False) -> LeastCommands:
        """The smallest commands that resist a disturbance (6,), of the motors that the grasp commands, else of all.

        On a path none are sought.

        Args:
            motors: others in place of these.
            rough: is it enough to know some, which need not be the least? Nothing counts as open then.
        """
        if unbalanced(self.grasp, wrench) or not (motors or self.grasp.sought_actuators):
            return LeastCommands(None, np.inf)
        if self.along_paths:
            return LeastCommands(None, 0.0)
        settings = self._limited(1)
        if rough:
            answer = torques(self.grasp, wrench, actuators=motors, settings=self._roughly(settings))
            self._count(Stop.COMPLETE if answer.stop is Stop.NODES else answer.stop, answer.nodes, closed=True)
        if not rough or answer.verdict is Verdict.UNDECIDED:
            answer = torques(self.grasp, wrench, actuators=motors, settings=settings)
            self._count(answer.stop, answer.nodes, answer.verdict is not Verdict.UNDECIDED)
        if answer.preload is None:
            return LeastCommands(None, answer.lower)
        return LeastCommands(self.grasp.with_commands(answer.preload).command, answer.lower)

    def resisted_by_none(
        self, wrenches: list[Array], order: Iterable[int]
    ) -> tuple[int | None, dict[int, dict[str, float]]]:
        """The first of these disturbances (6,) that is seen in a few nodes to slip whatever is commanded, if one is.

        They are asked in an order. Beside it commands, by number, that were found to resist some of those before it. On
        paths only what no forces balance, or nothing can be commanded for, is known to slip so.
        """
        free, found = free_motors(self.grasp), dict[int, dict[str, float]]()
        for k in order:
            if not free or unbalanced(self.grasp, wrenches[k]):
                return k, found
            if self.along_paths:
                continue
            settings = self._limited(1)
            first = replace(settings, nodes=min(settings.nodes, FIRST_NODES))
            answer = torques(self.grasp, wrenches[k], actuators=free, settings=first)
            limited = answer.stop in (Stop.NODES, Stop.NUMERICAL)  # which leaves nothing open: it is asked again
            self._count(Stop.COMPLETE if limited else answer.stop, answer.nodes, closed=True)
            if answer.verdict is Verdict.SLIPS:
                return k, found
            if answer.preload is not None:
                found[k] = answer.preload
        return None, found

    def one_preload(
        self, wrenches: list[Array], known: dict[int, dict[str, float]], hardest: int, least: LeastCommands
    ) -> tuple[Verdict, Array | None]:
        """Is there one preload (a,) under which each of these disturbances (6,) is resisted? The first that is found.

        The motors that the grasp commands are tried first, then all; backdrivable ones stay as they are commanded.

        Args:
            known: commands that resist some of the disturbances, by number.
            hardest: which of them asks most. least: the smallest commands for it, of the motors that are commanded.
        """
        own, free = self.grasp.sought_actuators, free_motors(self.grasp)
        if least.lower == np.inf and own != free:
            least, own = self.commands(wrenches[hardest], free), free
        if least.lower == np.inf:
            return Verdict.SLIPS, None
        order = [hardest, *(k for k in range(len(wrenches)) if k != hardest)]
        if least.commands is not None:
            for command in (factor * least.commands for factor in COMMAND_FACTORS):
                if self._all_held(command, wrenches, order):
                    return Verdict.HOLDS, command
        resisting = {str(k): commands for k, commands in known.items()}
        loads, found = Loads(tuple(str(k) for k in range(len(wrenches))), np.array(wrenches)), Verdict.UNDECIDED
        for motors in dict.fromkeys((own, free)):
            settings = self._limited(len(wrenches))
            asked: dict[str, Any] = {"least": False, "known": resisting, "settings": settings, "loading": self.loading}
            asked["bounding"] = self._roughly(settings)
            answer = hold(self.grasp, loads, actuators=motors, timeout=len(wrenches) * settings.timeout, **asked)
            self._count(answer.stop, answer.nodes, answer.verdict is not Verdict.UNDECIDED)
            found = answer.verdict
            if answer.preload is not None:
                return found, self.grasp.with_commands(answer.preload).command
        return found, None

    def _all_held(self, command: Array, wrenches: list[Array], order: list[int]) -> bool:
        """Is each of these disturbances (6,) shown to be resisted under other commands (a,)?

        They are asked in an order; what is not resisted goes to its front.
        """
        settings = self._limited(len(wrenches))
        prepared = prepare(self.grasp.with_preload(command), settings=settings, loading=self.loading)
        for k in order:
            found = prepared.check([wrenches[k]])
            self._count_row(found, 0, closed=True)  # what is open is tried otherwise
            if str(found.verdict[0]) != Verdict.HOLDS:
                order.remove(k)
                order.insert(0, k)
                return False
        return True

    def _limited(self, count: int) -> Settings:
        """The settings with an equal share of the time that is left, and of the nodes if these are fewer."""
        left = (self.seconds - (time.monotonic() - self._begin)) / max(count, 1)
        nodes = max((self.budget - self.nodes) / max(count, 1), MIN_QUESTION_NODES)
        return replace(self.settings, timeout=max(left, MIN_QUESTION_TIME), nodes=min(self.settings.nodes, nodes))

    @staticmethod
    def _roughly(settings: Settings) -> Settings:
        """For commands that need not be the least."""
        return replace(settings, gap=max(COMMAND_GAP, settings.gap), nodes=min(settings.nodes, BRIEF))

    def _count_row(self, found: BatchAnswer, i: int, closed: bool) -> None:
        if found.error[i]:  # questions that cannot be asked were left out before: Ctrl-C came first
            raise KeyboardInterrupt
        stop, nodes = Stop(str(found.stop[i])), int(found.nodes[i])  # one at its limit has a slice more
        self._count(stop, min(nodes, int(self._together.settings.nodes)) if stop is Stop.NODES else nodes, closed)

    def _count(self, stop: Stop, nodes: int, closed: bool) -> None:
        if stop is Stop.INTERRUPTED:  # half a label is none
            raise KeyboardInterrupt
        self.nodes += nodes
        if stop is not Stop.COMPLETE:
            self.stop = stop
        if not closed or stop in (Stop.TIME, Stop.NODES):
            self.open += 1

    def _prepared(self, settings: Settings) -> PreparedGrasp:
        """The grasp, prepared once, with these settings from now on."""
        self._together.settings = settings
        return self._together

    @cached_property
    def _together(self) -> PreparedGrasp:
        return prepare(self.grasp, loading=self.loading)
