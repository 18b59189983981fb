"""`holdfast check`: does the grasp resist this disturbance?"""

from __future__ import annotations

from dataclasses import dataclass

from holdfast.cli import console
from holdfast.cli.options import Command, FrictionModel, Load, QueryOptions, Saved


@dataclass(kw_only=True)
class Check(Load, QueryOptions, Saved, FrictionModel, Command):
    """Does the grasp resist this disturbance?"""

    def run(self) -> int:
        from holdfast.answer import Verdict
        from holdfast.cli import tables
        from holdfast.report import Entry, write_report
        from holdfast.report.words import load_text
        from holdfast.stability.queries import check, maximum
        from holdfast.stability.settings import Settings

        grasp, options, wrench = self.load(), self.options(), self.disturbance()
        with console.watch("check") as watch:
            answer = check(grasp, wrench, mdp=self.mdp, on_step=watch.step, **options)
        if self.save:
            answer.save(self.save, force=self.force)
        if self.report:
            title = f"Does it resist {load_text(wrench)}?"
            entry = Entry(title, answer, eta=options["eta"], mdp=self.mdp)
            write_report(self.report, grasp, [entry], settings=options["settings"], force=self.force)
        if self.json:
            console.print_json(answer.to_json())
        else:
            tables.show_check(console.out(), grasp, wrench, answer, self)
            if answer.verdict is Verdict.SLIPS and grasp.preload and any(wrench):
                # too much, too little, or was there no equilibrium to disturb? A short look tells
                short = {**options, "mdp": self.mdp, "settings": Settings(time_limit=5.0)}
                alone, most = check(grasp, [0.0] * 6, **short), maximum(grasp, wrench, **short)
                tables.show_beside(console.out(), alone, most)
        return console.status(answer.verdict, answer.stop)
