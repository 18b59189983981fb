"""`handfast check`: does the grasp resist this disturbance?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from tyro.conf import arg

from handfast.cli import console
from handfast.cli.options import Command, FrictionModel, Load, QueryOptions, Saved
from handfast.core.errors import InputError


@dataclass(kw_only=True)
class Check(Load, QueryOptions, Saved, FrictionModel, Command):
    """Does the grasp resist this disturbance?"""

    margin: bool = False
    """if it holds, say how much it leans on: motion, friction, normals"""
    stiffness: Annotated[float | None, arg(metavar="N/M")] = None
    """contact stiffness for --margin [N/m]; by default that of a rubber fingertip pad, 10000"""

    def run(self) -> int:
        from handfast.cli import tables
        from handfast.core.answer import Verdict
        from handfast.report import Entry, write_report
        from handfast.report.words import load_text
        from handfast.stability.margin_search import RUBBER_PAD, margin
        from handfast.stability.queries import check, maximum
        from handfast.stability.settings import Settings

        if self.stiffness is not None and not self.margin:
            raise InputError("--stiffness is for --margin; give both")
        grasp, options, wrench = self.load(), self.options(), self.disturbance()
        with console.watch("check") as watch:
            answer = check(grasp, wrench, mdp=self.mdp, on_step=watch.step, **options)
            if self.margin:
                k = RUBBER_PAD if self.stiffness is None else self.stiffness
                asked = options | {"mdp": self.mdp, "stiffness": k, "answer": answer, "on_sample": watch.say}
                answer = replace(answer, margin=margin(grasp, wrench, **asked))
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
        return console.status(answer.verdict, answer.margin.stop if answer.margin else answer.stop)
