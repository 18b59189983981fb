"""`handfast check`, `max` and `torques`: what of a disturbance does the grasp resist, how much, with which commands?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from rich.console import Console
from tyro.conf import arg

from handfast.cli import console, tables
from handfast.cli.console import Watch
from handfast.cli.load_options import Disturbances, Load, LoadDirection
from handfast.cli.options import FrictionModel, LoadingOrder, QueryOptions, Saved, Wrench
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.pictures import Entry
from handfast.pictures.words import direction_text, load_text, num
from handfast.stability.answers import CheckAnswer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.margin_search import RUBBER_PAD, margin
from handfast.stability.studies.questions import check, maximum, torques


@dataclass(kw_only=True)
class Check(Disturbances, QueryOptions, Saved, LoadingOrder, FrictionModel):
    """Does the grasp resist this disturbance? Several are asked about one by one."""

    margin: bool = False
    """if it holds, say how much it leans on: motion, friction, normals"""
    stiffness: Annotated[float | None, arg(metavar="N/M")] = None
    """contact stiffness for --margin [N/m]; by default that of a rubber fingertip pad, 10000"""

    def run(self) -> int:
        if self.stiffness is not None and not self.margin:
            raise InputError("--stiffness is for --margin; give both")
        if self.margin and self.loading != "together":
            raise InputError("--margin is about commands and load together; leave --loading out")
        grasp, options = self.load(), self.options()
        loads = self.disturbances(grasp, self.grasp)
        if self.save and len(loads) > 1:
            raise InputError(f"keeps one answer, and {len(loads)} disturbances are asked about", field="--save")
        with console.watch("check") as watch:
            answers = [self._asked(grasp, wrench, options, watch) for wrench in loads.wrenches]
        if self.save:
            answers[0].save(self.save, force=self.force)
        self.write_page(grasp, self._entries(loads, answers), settings=self.settings())
        if self.json:
            several = {"schema": "handfast/answers/1", "query": "check", "loads": loads.by_name}
            found = dict(zip(loads.names, (a.to_json() for a in answers), strict=True))
            console.print_json(answers[0].to_json() if len(loads) == 1 else several | {"answers": found})
        elif len(loads) > 1:
            tables.show_checks(console.out(), grasp, loads, answers, self)
        else:
            self._show(grasp, loads.wrenches[0], answers[0], options)
        if self.gravity and not self.json:
            console.out().print(self.weight_text(grasp), style="dim")
        return max(console.status(a.verdict, a.margin.stop if a.margin else a.stop) for a in answers)

    def _asked(self, grasp: Grasp, wrench: Array, options: dict[str, Any], watch: Watch) -> CheckAnswer:
        answer = check(grasp, wrench, mdp=self.mdp, loading=self.loading, on_progress=watch.step, **options)
        if not self.margin:
            return answer
        k = RUBBER_PAD if self.stiffness is None else self.stiffness
        asked = options | {"mdp": self.mdp, "stiffness": k, "answer": answer, "on_progress": watch.say}
        return replace(answer, margin=margin(grasp, wrench, **asked))

    def _entries(self, loads: Loads, answers: list[CheckAnswer]) -> list[Entry]:
        titles = [f"Does it hold “{name}”?" for name in loads.names]
        titles = titles if len(loads) > 1 else [f"Does it resist {load_text(loads.wrenches[0])}?"]
        return [Entry(title, a, self.limits.eta, self.mdp) for title, a in zip(titles, answers, strict=True)]

    def _show(self, grasp: Grasp, wrench: Array, answer: CheckAnswer, options: dict[str, Any]) -> None:
        tables.show_check(console.out(), grasp, wrench.tolist(), answer, self)
        if answer.verdict is Verdict.SLIPS and grasp.preload and any(wrench) and answer.path is None:
            # too much, too little, or was there no equilibrium to disturb? A short look tells
            short = {**options, "mdp": self.mdp, "settings": Settings(timeout=5.0)}
            alone, most = check(grasp, [0.0] * 6, **short), maximum(grasp, wrench, **short)
            limited = bool(self.torque_limit) or self.force_limit is not None
            exact = short | {"limits": GraspLimits(options["limits"].eta)}
            tables.show_beside(console.out(), alone, most, check(grasp, wrench, **exact) if limited else None)


@dataclass(kw_only=True)
class Max(LoadDirection, QueryOptions, Saved, LoadingOrder, FrictionModel):
    """How large a disturbance along a direction does the grasp resist?

    The answer is a pair of bounds: the largest magnitude shown to be resisted, and one that no larger
    magnitude exceeds. Magnitudes below the largest are not always resisted too; --interval tells which.
    """

    base: Wrench = ()
    """a constant load beside it, such as the weight"""
    interval: bool = False
    """show up to which magnitude everything is resisted, and where there are holes"""

    def run(self) -> int:
        grasp, options = self.load(), self.options()
        direction = self.one_wrench(self.direction, self.gravity, grasp, self.grasp)
        options |= {"base": self.base or None, "mdp": self.mdp, "interval": self.interval, "loading": self.loading}
        with console.watch("max") as watch:
            answer = maximum(grasp, direction, on_progress=watch.step, **options)
        beside = f" beside {load_text(self.base)}" if self.base else ""
        title = f"How much {direction_text(direction)} does it resist{beside}?"
        entry = Entry(title, answer, eta=self.limits.eta, mdp=self.mdp, direction=direction)
        times = "any multiple of" if answer.unbounded else f"{num(answer.lower)} times"
        note = f"It resists {times} the weight. {self.weight_text(grasp)}" if self.gravity else ""
        return self.finish(
            grasp, answer, [entry], lambda out: tables.show_max(out, grasp, direction, answer, self), note
        )


@dataclass(kw_only=True)
class LeastTorques(Load, QueryOptions, Saved, LoadingOrder):
    """Which motor commands resist this disturbance with the least effort?

    Sought are the commands of the actuators that the grasp preloads, or of all if it preloads none.
    """

    objective: Literal["max", "sum"] = "max"
    """make the largest command small, or the sum of all"""

    def run(self) -> int:
        grasp, options = self.load(), self.options()
        wrench = self.one_wrench(self.wrench, self.gravity, grasp, self.grasp)
        with console.watch("torques") as watch:
            options |= {"objective": self.objective, "loading": self.loading, "on_progress": watch.step}
            answer = torques(grasp, wrench, **options)
        entry = Entry(f"Which commands resist {load_text(wrench)}?", answer, eta=self.limits.eta)
        note = self.weight_text(grasp) if self.gravity else ""

        def show(out: Console) -> None:
            tables.show_torques(out, grasp, wrench, answer, self.objective, self)

        return self.finish(grasp, answer, [entry], show, note)
