"""One preload for many loads: does it exist, and how small can it be?

`torques` finds the least commands for one wrench, with proof. A grasp that is to hold an object in every
orientation needs a single preload under which all of its loads are resisted, and no convexity helps: what
resists two loads need not resist what lies between, and more squeezing may loosen. So shapes of the preload
are proposed and each is scaled to the smallest level that holds; every load is then decided by `check` alone.
The lower bound is that of the hardest load, certified by `torques`; between it and the level found may lie a
preload of a shape that nobody proposed. Where the loads come after the commands, shapes and levels are found in the
same way, and every load is followed on its path; least commands of loads and commands together bound nothing there.
How much more of each load the preload resists is asked of `maximum`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from handfast.core.answer import SearchLimits, Stop, Verdict, header
from handfast.core.errors import InputError, refuse_other_kinds
from handfast.core.files import write_text
from handfast.core.presented import Presented
from handfast.model.grasp import Grasp
from handfast.proofs import holds
from handfast.proofs.replay import Replay
from handfast.readers.grasp_file import to_dict
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer, finite
from handfast.stability.answers.check_query import ask as check
from handfast.stability.answers.check_query import check_along
from handfast.stability.answers.load_path import PathsFromRest, comes_after
from handfast.stability.answers.max_query import ask as maximum
from handfast.stability.answers.torques_query import ask as torques
from handfast.stability.problem.equivalent_grasp import equivalent_of
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.scaled_problem import unbalanced
from handfast.stability.problem.settings import MIN_SEARCH_TIME, Loading, Settings
from handfast.stability.search.solve import compiled
from handfast.stability.studies.margin_search import OnSample

A = TypeVar("A", bound=Answer)
MODERATE_COMMAND = 10.0  # times the largest load: a moderate command
NEGLIGIBLE_COMMAND = 1e-6  # share of the largest command below which one is rounding
MARGINS = 0.25  # share of the time that is left for them, where they are asked
SIZING_NODES = 20_000  # of a search that only says how large a preload is to be: what it found until then will do
LOAD_TIME_SHARE = 0.5  # share of the time that is left in which a load is to be decided under a preload
PRELOAD_FACTORS = (1.00001, 1.001, 1.05, 1.25, 1.6, 2.5, 4.0, 8.0)  # above a level that is critical for one load


@dataclass(frozen=True, eq=False)
class HoldAnswer(Presented):
    """Is there one preload under which every load is resisted?

    Attributes:
        verdict: HOLDS with a witness for each load; SLIPS if some load is resisted by no preload at all
            (within the limits); else UNDECIDED.
        stop: why the search ended. seconds, nodes: its cost.
        loads: as asked.
        preload: actuator -> command [N m or N], 0 is locked; None unless HOLDS.
        lower, upper: of the largest command [N m or N]; lower is certified, 0 where it was not asked for.
        checks: for each load the answer under `preload`; () unless HOLDS.
        refuted: name and answer of the load that no preload resists, no answer where the grasp map G cannot
            even produce it; None unless SLIPS.
        hardest: name of the load that asked most of the commands, or that was not met; "" if none was.
        bounding: name and answer of the load whose least commands are `lower`; None where nothing is behind it.
        grasp, command_limit: as asked.
        actuators: whose commands were sought.
        limits, loading: as asked.
        margins: how much of each load is resisted under `preload`; empty where that was not asked, none of a load of 0.
    """

    verdict: Verdict
    stop: Stop
    seconds: float
    nodes: int
    loads: Loads
    preload: dict[str, float] | None
    lower: float
    upper: float
    checks: tuple[CheckAnswer, ...] = field(default=(), repr=False)
    refuted: tuple[str, Answer | None] | None = field(default=None, repr=False)
    hardest: str = ""
    bounding: tuple[str, TorquesAnswer] | None = field(default=None, repr=False)
    grasp: Grasp | None = field(default=None, repr=False)
    command_limit: float = field(default=np.inf, repr=False)
    actuators: tuple[str, ...] = field(default=(), repr=False)
    limits: GraspLimits = field(default=NO_LIMITS, repr=False)
    loading: Loading = field(default="together", repr=False)
    margins: Mapping[str, MaxAnswer] = field(default_factory=dict, repr=False)

    def verify(self) -> Replay:
        """Replays every load's witness under the preload, the bound of the commands, or why some load is not held.

        Raises:
            InputError: it does not know its grasp.
        """
        return holds.replay(holds.read_hold(self.to_file()))

    def to_file(self) -> dict[str, Any]:
        """The `handfast/hold/1` object: question, answer, what backs it. `InputError` without a grasp."""
        if self.grasp is None:
            raise InputError("does not know its grasp; save what `hold` returned", field="answer")
        asked = {"loads": self.loads.by_name, "actuators": list(self.actuators)}
        asked |= self.limits.to_json() | self._of_path
        checks = zip(self.loads.names, self.checks, strict=False)
        return {
            "schema": holds.SCHEMA,
            "question": {"grasp": to_dict(self.grasp), "command_limit": finite(self.command_limit)} | asked,
            "answer": self.to_json(),
            "checks": {name: answer.to_file() for name, answer in checks},
            "bounding": _part(self.bounding if self.verdict is not Verdict.SLIPS and self.lower > 0 else None),
            "refuted": _part(self.refuted),
        } | ({"margins": {name: a.to_file() for name, a in self.margins.items()}} if self.margins else {})

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/hold/1` file. `InputError` if it exists and `force` is not set, or cannot be written."""
        write_text(path, json.dumps(self.to_file(), allow_nan=False) + "\n", force=force)

    @property
    def _of_path(self) -> dict[str, Any]:
        return {"loading": self.loading} if self.loading != "together" else {}

    @property
    def margin(self) -> float | None:
        """The factor up to which every load is shown to be resisted under the preload, each on its own: 1 or more.

        inf where all loads are resisted at any size; None where it was not asked.
        """
        return min((holds.grown(a.lower, a.unbounded) for a in self.margins.values()), default=None)

    @property
    def _bounds(self) -> dict[str, Any]:
        return {
            name: {"lower": a.lower, "upper": finite(a.upper), "unbounded": a.unbounded}
            for name, a in self.margins.items()
        }

    @property
    def weakest(self) -> str:
        """Name of the load with the least margin; "" where none was asked."""
        return min(
            self.margins,
            key=lambda name: holds.grown(self.margins[name].lower, self.margins[name].unbounded),
            default="",
        )

    @property
    def exact(self) -> bool | None:
        """Is an exact state of every load proved to exist? None unless HOLDS."""
        return all(a.exact for a in self.checks) if self.checks else None

    def to_json(self) -> dict[str, Any]:
        """The keys that the command line prints."""
        return (
            header(self, "hold")
            | {
                "loads": self.loads.by_name,
                "preload": self.preload,
                "lower": finite(self.lower),
                "upper": finite(self.upper),
                "hardest": self.hardest or None,
                "exact": self.exact,
                "residuals": [a.state_json()["residual"] for a in self.checks],
            }
            | (holds.margins_json(self._bounds) if self.margins else {})
            | self._of_path
        )


def _part(named: tuple[str, Answer | None] | None) -> dict[str, Any] | None:
    """An answer about one load as a file has it."""
    return None if named is None else {"load": named[0], "result": named[1].to_file() if named[1] else None}


@dataclass(frozen=True, eq=False, kw_only=True)
class HoldOptions:
    """How one preload for many loads is sought.

    Attributes:
        actuators: whose commands are sought; by default those that the grasp commands now, or all. The
            others stay locked; backdrivable motors stay as the grasp commands them. Where one is named its command is
            found by trying shapes alone: no bound is known, and never that there is none.
        least: try every shape of the preload and bound its largest command from below; False is content with
            the first that holds.
        margins: find how much of each load is resisted under the preload, with `maximum`: `HoldAnswer.margins`.
        command_limit: largest command allowed [N m or N]; see `moderate`.
        limits: as in `check`.
        loading: as in `check`; with "preload-first" each load is followed on its path, and `lower` is 0: no
            bound of the commands is sought.
        settings: of each query, as in `check`; its `timeout` is that of a single one.
        bounding: settings of the queries for the least commands; `settings` unless given. If these do not verify, no
            lower bound is claimed, and only what says that there is no preload is asked again with its proof.
        timeout: [s] for the whole question, margins included.
        known: by names of loads, preloads that are known to resist them. Only with `least` are these loads asked what
            they need.
    """

    actuators: Sequence[str] | None = None
    least: bool = True
    margins: bool = False
    command_limit: float | None = None
    limits: GraspLimits = NO_LIMITS
    loading: Loading = "together"
    settings: Settings = field(default_factory=Settings)
    bounding: Settings | None = None
    timeout: float | None = None
    known: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        comes_after(self.loading)


def ask(grasp: Grasp, loads: Loads, asked: HoldOptions, on_progress: OnSample | None = None) -> HoldAnswer:
    """What `handfast.hold` answers."""
    compiled()
    whole = SearchLimits(asked.timeout)
    clock = SearchLimits((1 - MARGINS) * whole.seconds_left) if asked.margins else whole
    search = _HoldSearch(grasp, loads, asked, clock, on_progress)
    try:
        answer = search.run(asked.least)
    except KeyboardInterrupt:
        return search.answer(search.found, Stop.INTERRUPTED)
    if asked.margins and answer.preload is not None:
        search.clock = whole
        answer = search.with_margins(answer)
    return replace(answer, seconds=whole.seconds)


def moderate(grasp: Grasp, loads: Loads) -> float:
    """A bound for commands where none is known: ten times what the largest load asks for at the grasp's size.

    [N m]; [N] if an actuator drives a prismatic joint. Far larger ones squeeze an object that is nearly slipping.
    """
    w = loads.wrenches
    force = np.linalg.norm(w[:, :3], axis=1) + np.linalg.norm(w[:, 3:], axis=1) / grasp.size
    arm = 1.0 if any(j.type == "prismatic" for j in grasp.joints) else grasp.size
    return MODERATE_COMMAND * float(force.max()) * arm


class _HoldSearch:
    """One call of `hold`."""

    def __init__(
        self, grasp: Grasp, loads: Loads, asked: HoldOptions, clock: SearchLimits, on_progress: OnSample | None
    ) -> None:
        self.grasp, self.loads, self.clock, self.on_progress = grasp, loads, clock, on_progress
        self.names = tuple(asked.actuators or grasp.sought_actuators)
        self.known = {} if asked.least else asked.known
        back = dict(zip(grasp.mechanism.actuators, grasp.mechanism.backdrivable, strict=True))
        self.turned_back = any(back.get(name) for name in self.names)  # `torques` does not seek their commands
        self.settings, self.bounds, self.limits = asked.settings, asked.bounding or asked.settings, asked.limits
        self.loading, self.along = asked.loading, comes_after(asked.loading)
        if self.along:
            self.bounds = replace(self.bounds, verify=False)
        self.tried: set[tuple[tuple[str, float], ...]] = set()
        self.nodes = 0
        self.lower, self.most = 0.0, np.inf if asked.command_limit is None else asked.command_limit
        self.bounding: tuple[str, TorquesAnswer] | None = None
        self.order = list(range(len(loads)))  # the load that failed last comes first
        self.best: tuple[dict[str, float], tuple[CheckAnswer, ...]] | None = None
        self.stops: set[Stop] = set()

    def run(self, least: bool) -> HoldAnswer:
        """Nothing commanded, then the grasp's own preload, the best for each load, and shapes that mix them."""
        for k, w in enumerate(self.loads.wrenches):
            if unbalanced(self.grasp, w):
                self.first(k, Stop.COMPLETE)
                return self.answer(Verdict.SLIPS, Stop.COMPLETE, refuted=(self.loads.names[k], None))
        locked = self.checked({})
        if locked:
            self.best = {}, locked
            return self.answer(Verdict.HOLDS, Stop.COMPLETE)
        own = {n: v for n, v in self.grasp.preload.items() if v}
        if least and own and set(own) <= set(self.names) and max(map(abs, own.values())) <= self.most:
            held = self.checked(own)  # whatever is found after it is smaller
            self.best = (own, held) if held else None
        needs: list[dict[str, float]] = []
        if not least:  # squeezing with all, or with one against the others, often does
            for shape in self.plain():
                if self.level(shape) and self.best:
                    return self.answer(Verdict.HOLDS, Stop.COMPLETE)
        for left, k in zip(range(len(self.loads), 0, -1), self.order[:], strict=True):
            if self.late():
                return self.answer(self.found, Stop.TIME)
            if self.loads.names[k] in self.known:
                known = self.known[self.loads.names[k]]
                needs.append({n: float(known.get(n, 0.0)) for n in self.names})
                continue
            if self.turned_back:
                continue
            share = 1 / (left + 1)  # as much is left for shapes
            a = self.torques(k, self.bounds, share)
            if self.refutes(a) and not self.bounds.verify:
                a = self.torques(k, replace(self.bounds, verify=True), share)
            if self.refutes(a):
                refuted = (self.loads.names[k], a)
                return self.answer(Verdict.SLIPS, Stop.COMPLETE, refuted=refuted)
            if a.lower > self.lower and self.bounds.verify and a.reaches_far:
                self.lower, self.bounding = a.lower, (self.loads.names[k], a)
            if a.preload:
                needs.append(a.preload)
        both = {n: max((p[n] for p in needs), key=abs) for n in self.names} if needs else {}
        for shape in [*needs, *([both] if len(needs) > 1 else []), *(self.plain() if least else [])]:
            if self.late():
                break
            self.level(shape)
            if self.best and not least:
                break
        return self.answer(self.found, Stop.TIME if self.late() else Stop.COMPLETE)

    @property
    def found(self) -> Verdict:
        return Verdict.HOLDS if self.best else Verdict.UNDECIDED

    def plain(self) -> list[dict[str, float]]:
        """Shapes that need no search: all actuators alike, and each on its own against locked ones."""
        sense = {n: float(np.sign(self.grasp.preload.get(n, 1.0))) for n in self.names}
        alone = [{n: sense[n]} for n in self.names] if len(self.names) > 1 else []
        return [sense, *alone]

    def level(self, shape: Mapping[str, float]) -> bool:
        """Scale a shape until it holds every load with less than the best so far; is there such a level?"""
        size = max(map(abs, shape.values()), default=0.0)
        if not size:
            return False
        unit = {n: v / size for n, v in shape.items() if abs(v) > NEGLIGIBLE_COMMAND * size}
        as_it_is = False
        if equivalent_of(self.grasp).is_given and size < self.upper:  # more of it need not do better
            checks = self.checked(shape)
            if checks:
                as_it_is, self.best = True, (dict(shape), checks)
        key = tuple(sorted((n, round(v, 9)) for n, v in unit.items()))
        if key in self.tried:  # as every shape is, of a single actuator
            return as_it_is
        self.tried.add(key)
        need = 0.0
        for k in self.order[:]:
            if self.late():
                return False
            enough = self.enough(unit, k)
            if enough is None:
                return as_it_is
            need = max(need, enough)
        for factor in PRELOAD_FACTORS:
            if self.late() or need * factor >= self.upper:
                return as_it_is
            preload = {n: need * factor * v for n, v in unit.items()}
            checks = self.checked(preload)
            if checks:
                self.best = preload, checks
                return True
        return as_it_is

    def enough(self, unit: Mapping[str, float], k: int) -> float | None:
        """The level from which on a shape may resist a load; None if it does not, as far as is seen.

        Homogeneous: s loads are resisted at level 1, so one at level 1/s. Where springs and friction of joints do not
        grow with the level, s is taken to be linear in it.
        """
        first = self.resisted(unit, k)
        if not equivalent_of(self.grasp).is_given:
            return 1 / first if first > 0 else None
        other = 1 / first if 0 < first < 1 or first > 1 else MODERATE_COMMAND
        second = self.resisted({n: other * v for n, v in unit.items()}, k)
        if second == first:
            return other if second > 0 else None
        between = 1.0 + (1.0 - first) * (other - 1.0) / (second - first)
        return between if between > 0 else other

    def resisted(self, preload: Mapping[str, float], k: int) -> float:
        """How many times a load is resisted under a preload."""
        if self.late():
            return 0.0
        if not self.loads.wrenches[k].any():
            return np.inf  # any multiple of nothing, if the preload alone is resisted
        self.say(f"level of a preload for {self.loads.names[k]}")
        settings = replace(self.within(self.settings, LOAD_TIME_SHARE), gap=1e-2, verify=False)
        settings = replace(settings, nodes=min(settings.nodes, SIZING_NODES))
        grasp, exact = self.grasp.with_commands(preload), GraspLimits(self.limits.eta)
        asked: dict[str, Any] = {"limits": exact, "settings": settings, "loading": self.loading}
        a = self.counted(maximum(grasp, self.loads.wrenches[k], **asked))
        if not a.lower > 0:
            self.first(k, a.stop if a.verdict is Verdict.UNDECIDED else Stop.COMPLETE)
        return a.lower

    def checked(self, preload: Mapping[str, float]) -> tuple[CheckAnswer, ...]:
        """The answers to all loads under a preload, in order; () as soon as one is not resisted."""
        grasp = self.grasp.with_commands(preload)
        found: dict[int, CheckAnswer] = {}
        paths = PathsFromRest(self.limits)
        for k in self.order[:]:
            if self.late():
                return ()
            self.say(f"{self.loads.names[k]} under a preload")
            # what slips is tried differently, so that its proof is not needed
            settings = replace(self.within(self.settings, LOAD_TIME_SHARE), verify=False)
            if self.along:
                a = self.counted(paths.answer(check_along, grasp, self.loads.wrenches[k], settings))
            else:
                a = self.counted(check(grasp, self.loads.wrenches[k], settings=settings, limits=self.limits))
                a = a.settled(self.clock.end) if self.settings.verify else a
            if a.verdict is not Verdict.HOLDS:
                self.first(k, a.stop)
                return ()
            found[k] = a
        return tuple(found[k] for k in range(len(self.loads)))

    def refutes(self, a: TorquesAnswer) -> bool:
        """Does an answer about a load alone say that there is no preload? None says so of a path."""
        if self.along:
            return False
        return a.verdict is Verdict.SLIPS or (a.lower > self.most and a.reaches_far)

    def torques(self, k: int, settings: Settings, share: float) -> TorquesAnswer:
        """The least commands for a load alone, in a share of the time that is left."""
        settings = self.within(settings, share)
        self.say(f"least commands for {self.loads.names[k]}")
        asked = torques(self.grasp, self.loads.wrenches[k], actuators=self.names, settings=settings, limits=self.limits)
        a = self.counted(asked)
        if a.verdict is not Verdict.HOLDS:
            self.first(k, a.stop)
        return a

    def with_margins(self, answer: HoldAnswer) -> HoldAnswer:
        """An answer that holds, with how much of each load is resisted; what there is no time for is left open."""
        grasp, found, stop = self.grasp.with_commands(answer.preload or {}), {}, answer.stop
        loads = [(name, w) for name, w in zip(self.loads.names, self.loads.wrenches, strict=True) if w.any()]
        try:
            for k, (name, w) in enumerate(loads):
                self.say(f"margin of {name}")
                settings = self.within(self.settings, 1 / (len(loads) - k))
                asked: dict[str, Any] = {"settings": settings, "limits": self.limits, "loading": self.loading}
                found[name] = self.counted(maximum(grasp, w, **asked))
        except KeyboardInterrupt:
            found, stop = {}, Stop.INTERRUPTED  # the least is that of all
        return replace(answer, margins=found, nodes=self.nodes, stop=stop)

    def say(self, what: str) -> None:
        if self.on_progress:
            self.on_progress(what)

    def within(self, settings: Settings, share: float) -> Settings:
        """The settings of a query that has a share of the time that is left."""
        left = max(share * self.clock.seconds_left, MIN_SEARCH_TIME)
        return replace(settings, timeout=min(settings.timeout, left))

    def counted(self, a: A) -> A:
        """An answer, its nodes counted; Ctrl-C, which ended its search, ends this one too."""
        self.nodes += a.nodes
        if a.stop is Stop.INTERRUPTED:
            raise KeyboardInterrupt
        return a

    def first(self, k: int, stop: Stop) -> None:
        """Ask about this load first from now on."""
        self.order.remove(k)
        self.order.insert(0, k)
        self.stops.add(stop)

    @property
    def upper(self) -> float:
        """Largest command of the best preload so far."""
        return max(map(abs, self.best[0].values()), default=0.0) if self.best else self.most

    def late(self) -> bool:
        return self.clock.late

    def answer(self, verdict: Verdict, stop: Stop, refuted: tuple[str, Answer | None] | None = None) -> HoldAnswer:
        """As far as it came; an undecided one tells the limit that was hit."""
        if verdict is Verdict.UNDECIDED and stop is Stop.COMPLETE:
            stop = next((s for s in (Stop.TIME, Stop.NODES) if s in self.stops), Stop.RESOLUTION)
        held = self.best if verdict is Verdict.HOLDS else None
        return HoldAnswer(
            verdict,
            stop,
            self.clock.seconds,
            self.nodes,
            self.loads,
            {n: held[0].get(n, 0.0) for n in self.names} if held else None,
            self.lower if verdict is not Verdict.SLIPS else np.inf,
            self.upper if held else np.inf,
            held[1] if held else (),
            refuted,
            self.loads.names[self.order[0]] if verdict is not Verdict.HOLDS or self.upper > 0 else "",
            bounding=self.bounding,
            grasp=self.grasp,
            command_limit=self.most,
            actuators=self.names,
            limits=self.limits,
            loading=self.loading,
        )
