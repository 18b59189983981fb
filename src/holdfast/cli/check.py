"""`holdfast check`: does the grasp resist this disturbance?"""

from __future__ import annotations

from dataclasses import dataclass

from holdfast.cli import console
from holdfast.cli.options import Command, FrictionModel, QueryOptions, Wrench


@dataclass(kw_only=True)
class Check(QueryOptions, FrictionModel, Command):
    """Does the grasp resist this disturbance?"""

    wrench: Wrench
    """force [N] and torque [N m] on the object at its origin; three numbers are a force"""

    def run(self) -> int:
        from holdfast.answer import Stop, Verdict
        from holdfast.cli import tables
        from holdfast.report import Entry, write_report
        from holdfast.report.words import load_text
        from holdfast.stability.answers import CheckAnswer
        from holdfast.stability.queries import check

        grasp, options = self.load(), self.options()
        with console.watch("check") as watch:
            try:
                answer = check(grasp, self.wrench, mdp=self.mdp, on_step=watch.step, **options)
            except KeyboardInterrupt:  # between two programs, where the query does not expect it
                cost = (watch.seconds, watch.nodes, ())
                answer = CheckAnswer(Verdict.UNDECIDED, Stop.INTERRUPTED, *cost, None)
        if self.report:
            title = f"Does it resist {load_text(self.wrench)}?"
            entry = Entry(title, answer, eta=options["eta"], mdp=self.mdp)
            write_report(self.report, grasp, [entry], settings=options["settings"], force=self.force)
        if self.json:
            console.print_json(answer.to_json())
        else:
            tables.show_check(console.out(), grasp, self.wrench, answer, self)
        return console.status(answer.verdict, answer.stop)
