"""`handfast max`: the largest disturbance along a direction that the grasp resists."""

from __future__ import annotations

from dataclasses import dataclass

from handfast.cli import console
from handfast.cli.load_options import Direction
from handfast.cli.options import FrictionModel, LoadingOrder, QueryOptions, Saved, Wrench


@dataclass(kw_only=True)
class Max(Direction, QueryOptions, Saved, LoadingOrder, FrictionModel):
    """How large a disturbance along a direction does the grasp resist?

    The answer is a pair of bounds: the largest magnitude shown to be resisted, and one that no larger
    magnitude exceeds. Magnitudes below the largest are not always resisted too; --interval tells which.
    """

    base: Wrench = ()
    """a constant load beside it, such as the weight"""
    interval: bool = False
    """show up to which magnitude everything is resisted, and where there are holes"""

    def run(self) -> int:
        from handfast.cli import tables
        from handfast.pictures import Entry
        from handfast.pictures.words import direction_text, load_text, num
        from handfast.stability.answers import maximum

        grasp, options = self.load(), self.options()
        direction = self.along(grasp, self.grasp)
        options |= {"base": self.base or None, "mdp": self.mdp, "interval": self.interval, "loading": self.loading}
        with console.watch("max") as watch:
            answer = maximum(grasp, direction, on_progress=watch.step, **options)
        if self.save:
            answer.save(self.save, force=self.force)
        if self.report:
            beside = f" beside {load_text(self.base)}" if self.base else ""
            title = f"How much {direction_text(direction)} does it resist{beside}?"
            entry = Entry(title, answer, eta=options["limits"].eta, mdp=self.mdp, direction=direction)
            self.write_report(grasp, [entry], options)
        if self.json:
            console.print_json(answer.to_json())
        else:
            tables.show_max(console.out(), grasp, direction, answer, self)
            if self.gravity:
                times = "any multiple of" if answer.unbounded else f"{num(answer.lower)} times"
                console.out().print(f"It resists {times} the weight. {self.weight_text(grasp)}", style="dim")
        return console.status(answer.verdict, answer.stop)
