"""`torques` where the load comes after the commands: commands that were found to hold, and a bound of all paths.

Shapes of the commands are those that the grasp has, the least ones of commands and load together, all alike, and each
actuator alone. Each is followed along its ray to the smallest level whose path was checked to hold, to the relative
resolution `Settings.gap`; then single commands are changed while that helps. Levels below may fail and others hold:
what is said is only what was checked. The bound from below is `search/path_bound.py`'s, of all paths.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from handfast.core.answer import SearchLimits, Stop, Verdict
from handfast.model.grasp import Grasp
from handfast.proofs.path_commands import PathBound, PathCommands
from handfast.stability.answers.load_path import LoadPath, check_path, path_end
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.equivalent_grasp import equivalent_of
from handfast.stability.problem.objective import ANY_STATE, INF
from handfast.stability.problem.settings import MIN_SEARCH_TIME, OnStep, Progress, Settings
from handfast.stability.search.solve import clock_of

LEVEL_FACTORS = 1.00001, 1.001, 1.02, 1.25, 2.0  # above the level at which a path ends
FIRST_LEVEL = 10.0  # times the load: a level to begin with where nothing else is known
LEVEL_HALVINGS = 60  # of a level at most
CHANGES = 0.0, 0.5, 0.8, 1.25  # of single commands
FINE_CHANGES = 0.95, 1.05
CHANGE_ROUNDS = 3  # of changes at most
COMBINED_NODES = 20_000  # nodes for the least commands of commands and load together
COMMAND_PROGRESS = 0.98  # of the least so far: a change of single commands that does not come so far is not followed
SEARCH_SHARE = 0.75  # share of the time for finding commands; the rest bounds them
BOUND = 30.0  # [s] for the bound at most

Commands = dict[str, float]


@dataclass(frozen=True, eq=False)
class FoundOnPath:
    """What was found.

    Attributes:
        commands: that hold on the path; None if none were found.
        lower, upper: bound of all paths, inf if no commands hold the load; what the commands cost, inf without any.
        sought, bound: what is behind `lower`.
        backing: fields of an answer.
    """

    commands: Commands | None
    lower: float
    upper: float
    sought: PathCommands
    bound: PathBound | None
    backing: dict[str, Any]


class PathTorques:
    """Commands of actuators that hold the load of a posed question on its path, and their bound; asked once.

    together: the least commands of commands and load together, and nodes.
    """

    def __init__(
        self,
        grasp: Grasp,
        posed: BoundProblem,
        names: Sequence[str],
        together: Callable[[Settings], tuple[Commands | None, int]],
        settings: Settings,
        on_progress: OnStep | None,
    ) -> None:
        self.grasp, self.posed, self.names, self.settings = grasp, posed, names, settings
        self.together, self.on_progress, self.nodes = together, on_progress, 0
        self.total = clock_of(settings)
        self.clock = SearchLimits(SEARCH_SHARE * self.total.seconds_left)
        self.p = posed.problem
        sense = {n: float(np.sign(grasp.preload.get(n, 1.0)) or 1.0) for n in names}
        self.senses = np.array([sense.get(n, 0.0) for n in grasp.mechanism.actuators])
        self.sense = sense
        self.best: tuple[float, Commands, LoadPath] | None = None
        self.tried: set[tuple[float, ...]] = set()

    def found(self) -> FoundOnPath:
        """What is found until the search, or its time, is over, or Ctrl-C ends it."""
        try:
            self.run()
            stop = Stop.TIME if self.clock.late else Stop.COMPLETE
        except KeyboardInterrupt:
            stop = Stop.INTERRUPTED
        return self.answer(stop)

    @property
    def sums(self) -> bool:
        return self.posed.goal.sums_commands

    @property
    def upper(self) -> float:
        """[N m or N] the least so far."""
        return self.best[0] if self.best else INF

    def cost(self, commands: Mapping[str, float]) -> float:
        """Of commands, what is made small."""
        sizes = [abs(v) for v in commands.values()]
        return sum(sizes) if self.sums else max(sizes, default=0.0)

    def under(self, commands: Mapping[str, float]) -> scaled_problem.ScaledProblem:
        """The whole load from rest, with commands; the other actuators are locked, but for backdrivable ones."""
        return scaled_problem.build(self.grasp.with_commands(commands), self.p.wrench, limits=self.p.limits)

    def limited(self, verify: bool = False, **others: Any) -> Settings:
        """Settings of a part of the search."""
        return replace(self.settings, timeout=max(self.clock.seconds_left, MIN_SEARCH_TIME), verify=verify, **others)

    def holds(self, commands: Commands) -> bool:
        """Is the load reached on its path? The best are kept."""
        if self.clock.late:
            return False
        path = check_path(self.under(commands), self.limited())
        self.counted(path)
        held = bool(path.steps) and path.steps[-1].verdict is Verdict.HOLDS
        if held and self.cost(commands) < self.upper:
            self.best = self.cost(commands), commands, path
            if self.on_progress:
                self.on_progress(Progress(0.0, self.upper, self.nodes))
        return held

    def counted(self, path: LoadPath) -> None:
        """Its nodes; Ctrl-C, which ended its search, ends this one, too."""
        self.nodes += path.nodes
        if any(s.stop is Stop.INTERRUPTED for s in path.steps):
            raise KeyboardInterrupt

    def run(self) -> None:
        """Nothing commanded; then shapes, each to its smallest level; then changes of single commands."""
        if self.holds(dict.fromkeys(self.names, 0.0)):
            return
        for shape, level in self.shapes():
            self.ray(shape, level)
        for factors in (CHANGES, FINE_CHANGES):
            self.changed(factors)

    def shapes(self) -> Iterator[tuple[Commands, float | None]]:
        """Directions of commands to be followed, each with its level if that is one to begin with."""
        own = {n: self.grasp.preload.get(n, 0.0) for n in self.names}
        yield own, self.cost(own)
        least, nodes = self.together(self.limited(nodes=min(self.settings.nodes, COMBINED_NODES)))
        self.nodes += nodes
        if least:
            yield least, self.cost(least)
        yield dict(self.sense), None
        if len(self.names) > 1:
            for name in self.names:
                yield {n: self.sense[n] * (n == name) for n in self.names}, None

    def ray(self, shape: Mapping[str, float], level: float | None = None) -> None:
        """The smallest level of a shape at which the path was seen to hold, if that is below the best so far.

        level: to begin with where nothing holds yet.
        """
        size = self.cost(shape)
        if not size:
            return
        unit = {n: v / size for n, v in shape.items()}
        key = tuple(round(v, 9) for v in unit.values())
        if key in self.tried:
            return
        self.tried.add(key)
        if self.best is not None:
            high = COMMAND_PROGRESS * self.upper
            if not self.holds(scaled(unit, high)):
                return
        else:
            first = self.first_level(unit, level)
            levels = [] if first is None else [first * factor for factor in LEVEL_FACTORS]
            found = next((x for x in levels if self.holds(scaled(unit, x))), None)
            if found is None:
                return
            high = found
        low = 0.0
        for k in range(LEVEL_HALVINGS):
            if high - low <= self.settings.gap * high or self.clock.late:
                return
            middle = max(high * (1 - self.settings.gap * 4.0**k), 0.5 * (low + high))  # near the level at first
            if self.holds(scaled(unit, middle)):
                high = middle
            else:
                low = middle

    def first_level(self, unit: Mapping[str, float], level: float | None) -> float | None:
        """Near where the path ends in the load: with commands a times larger a times the load is reached.

        Where springs, friction of joints and limits do not grow with the commands: a level that holds, if any is met.
        """
        limits = self.p.limits
        limited = bool(limits.torque_limits) or np.isfinite(limits.largest_normal_force)
        free = not (limited or equivalent_of(self.grasp).is_given)
        load = self.p.wrench
        if self.clock.late:
            return None
        if free:
            path = path_end(self.under(unit), self.limited(gap=max(self.settings.gap, 1e-2)))
            self.counted(path)
            end = path.reached
            return 1.0 / end if end else None
        start = FIRST_LEVEL * float(np.abs(load).max()) if level is None else level
        for factor in (1.0, 4.0, 0.25, 16.0, 1 / 16):
            if self.holds(scaled(unit, start * factor)):
                return start * factor / LEVEL_FACTORS[0]
        return None

    def changed(self, factors: tuple[float, ...]) -> None:
        """Single commands of the best times these factors, as long as that needs less."""
        better = len(self.names) > 1
        for _ in range(CHANGE_ROUNDS):
            if not (better and self.best) or self.clock.late:
                return
            better = False
            for name in self.names:
                for factor in factors:
                    commands = self.best[1]  # the newest
                    other = commands | {name: factor * (commands[name] or self.sense[name] * self.upper / 4)}
                    size = self.cost(other)
                    if not size:
                        continue
                    before = self.upper
                    shape = scaled(other, 1.0 / size)
                    if self.holds(scaled(shape, COMMAND_PROGRESS * before)):
                        self.ray(shape)
                        better = True

    def answer(self, stop: Stop) -> FoundOnPath:
        """What was found, with the bound and the path of the commands proved."""
        commands = self.best[1] if self.best else dict.fromkeys(self.names, 0.0)
        whole = BoundProblem(self.under(commands), ANY_STATE)
        sought = PathCommands(whole.question, self.senses, self.sums)
        lower, bound, nodes = 0.0, None, 0
        if stop is not Stop.INTERRUPTED and self.upper > 0 and not self.total.late:
            from handfast.stability.search.path_bound import path_bound  # with scipy

            limits = SearchLimits(min(self.total.seconds_left, BOUND))
            lower, bound, nodes = path_bound(sought, limits, self.upper * (1 - self.settings.gap))
        if self.best:
            path = self.best[2]
            backing = path.backing(self.total.seconds) | {"stop": stop}
        else:
            none = lower == INF
            ended: Stop = Stop.RESOLUTION if stop is Stop.COMPLETE and not none else stop
            ended = Stop.COMPLETE if none else ended
            verdict = Verdict.SLIPS if none else Verdict.UNDECIDED
            backing = {"verdict": verdict, "stop": ended, "seconds": self.total.seconds, "found": None, "proof": None}
            backing |= {"posed": whole, "path": LoadPath(whole, (), ()), "verified": True}
        backing["nodes"] = self.nodes + nodes
        found = commands if self.best else None
        return FoundOnPath(found, lower, self.upper, sought, bound, backing)


def scaled(commands: Mapping[str, float], by: float) -> Commands:
    """Times a number."""
    return {n: by * v for n, v in commands.items()}
