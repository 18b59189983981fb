"""`handfast torques`: the smallest commands that resist a disturbance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from handfast.cli import console
from handfast.cli.load_options import Load
from handfast.cli.options import QueryOptions, Saved


@dataclass(kw_only=True)
class Torques(Load, QueryOptions, Saved):
    """Which motor commands resist this disturbance with the least effort?

    Sought are the commands of the actuators that the grasp preloads, or of all if it preloads none.
    """

    objective: Literal["max", "sum"] = "max"
    """make the largest command small, or the sum of all"""

    def run(self) -> int:
        from handfast.cli import tables
        from handfast.pictures import Entry
        from handfast.pictures.words import load_text
        from handfast.stability.answers import torques

        grasp, options = self.load(), self.options()
        wrench = self.disturbance(grasp, self.grasp)
        with console.watch("torques") as watch:
            answer = torques(grasp, wrench, objective=self.objective, on_progress=watch.step, **options)
        if self.save:
            answer.save(self.save, force=self.force)
        if self.report:
            title = f"Which commands resist {load_text(wrench)}?"
            entry = Entry(title, answer, eta=options["limits"].eta)
            self.write_report(grasp, [entry], options)
        if self.json:
            console.print_json(answer.to_json())
        else:
            tables.show_torques(console.out(), grasp, wrench, answer, self.objective, self)
            if self.gravity:
                console.out().print(self.weight_text(grasp), style="dim")
        return console.status(answer.verdict, answer.stop)
