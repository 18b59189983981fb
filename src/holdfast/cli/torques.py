"""`holdfast torques`: the smallest commands that resist a disturbance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from holdfast.cli import console
from holdfast.cli.options import Command, QueryOptions, Wrench


@dataclass(kw_only=True)
class Torques(QueryOptions, Command):
    """Which motor commands resist this disturbance with the least effort?

    Sought are the commands of the actuators that the grasp preloads, or of all if it preloads none.
    """

    wrench: Wrench
    """force [N] and torque [N m] on the object at its origin; three numbers are a force"""
    objective: Literal["max", "sum"] = "max"
    """make the largest command small, or the sum of all"""

    def run(self) -> int:
        from holdfast.answer import Stop, Verdict
        from holdfast.cli import tables
        from holdfast.report import Entry, write_report
        from holdfast.report.words import load_text
        from holdfast.stability.answers import TorquesAnswer
        from holdfast.stability.queries import torques

        grasp, options = self.load(), self.options()
        with console.watch("torques") as watch:
            try:
                answer = torques(grasp, self.wrench, objective=self.objective, on_step=watch.step, **options)
            except KeyboardInterrupt:  # between two programs, where the query does not expect it
                upper = float("inf") if watch.upper is None else watch.upper
                cost = (watch.seconds, watch.nodes, ())
                answer = TorquesAnswer(
                    Verdict.UNDECIDED, Stop.INTERRUPTED, *cost, None, None, watch.lower or 0.0, upper
                )
        if self.report:
            title = f"Which commands resist {load_text(self.wrench)}?"
            entry = Entry(title, answer, eta=options["eta"])
            write_report(self.report, grasp, [entry], settings=options["settings"], force=self.force)
        if self.json:
            console.print_json(answer.to_json())
        else:
            tables.show_torques(console.out(), grasp, self.wrench, answer, self)
        return console.status(answer.verdict, answer.stop)
