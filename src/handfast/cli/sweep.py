"""`handfast sweep`: the largest resisted disturbances while one command grows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import UseAppendAction, arg

from handfast.cli import console
from handfast.cli.load_options import WeightOptions
from handfast.cli.map import ENDINGS, number
from handfast.cli.options import QueryOptions, Triple, Wrench, check_writable
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.stability.studies.maps import SweepAnswer


@dataclass(kw_only=True)
class Sweep(QueryOptions, WeightOptions):
    """The largest resisted disturbances while one actuator's command varies.

    Figure 12 of the stability paper. The other commands stay as in the grasp.
    """

    one_of = "--direction FX FY FZ TX TY TZ", "--gravity GX GY GZ"
    joint: Annotated[str, arg(metavar="NAME")]
    """the actuator whose command varies"""
    to: Annotated[float, arg(metavar="VALUE")]
    """last command [N m, or N if prismatic or tendon]"""
    from_: Annotated[float, arg(metavar="VALUE", name="from")] = 0.0
    """first command"""
    steps: Annotated[int, arg(metavar="N")] = 21
    """number of commands, first and last included"""
    direction: UseAppendAction[tuple[Wrench, ...]] = ()
    """direction of a disturbance, once for each curve; three numbers are a force"""
    gravity: Triple = ()
    """instead: the direction in which gravity pulls, object axes; the answer multiplies the object's weight"""
    output: Annotated[Path | None, arg(metavar="FILE", aliases=["-o"])] = None
    """picture (.png, .svg) or numbers (.csv, .json)"""

    def run(self) -> int:
        import numpy as np

        from handfast.cli import tables
        from handfast.pictures import Entry
        from handfast.stability.studies.maps import sweep

        grasp, options = self.load(), self.options()
        self.check_one(self.direction, self.gravity)
        directions = self.direction or (self.one_wrench((), self.gravity, grasp, self.grasp),)
        check_writable(self.output, self.force, ENDINGS)
        if self.steps < 2:
            raise InputError(f"is {self.steps}; at least 2 commands are needed", field="--steps")
        for value, field in ((self.from_, "--from"), (self.to, "--to")):
            if not np.isfinite(value):
                raise InputError(f"is {value}; a finite number is needed", field=field)
        values = np.linspace(self.from_, self.to, self.steps)
        with console.watch("sweep") as watch:
            answer = sweep(grasp, self.joint, values, directions, on_progress=watch.item, **options)
        if self.output:
            save(answer, self.output, force=self.force)
        if self.report:
            title = f"How does the command of {self.joint} change what it resists?"
            entry = Entry(title, answer, eta=options["limits"].eta)
            self.write_report(grasp, [entry], options)
        if self.json:
            console.print_json(answer.to_json())
        else:
            tables.show_sweep(console.out(), answer, self)
        return console.status(answer.verdict, answer.stop)


def save(answer: SweepAnswer, path: Path, *, force: bool = False) -> None:
    """Write a sweep as picture or numbers, by the file's ending."""
    import json

    from handfast.core.files import write_bytes, write_text

    match path.suffix.lower():
        case ".json":
            write_text(path, json.dumps(answer.to_json(), indent=1) + "\n", force=force)
        case ".csv":
            write_text(path, csv(answer), force=force)
        case ending:
            from handfast.pictures.drawing import picture
            from handfast.pictures.map_picture import draw_sweep

            write_bytes(path, picture(draw_sweep(answer), ending.removeprefix(".")), force=force)


def csv(answer: SweepAnswer) -> str:
    """One line per command; an empty upper bound is unbounded or not known."""
    keys = [f"{key}_{k + 1}" for k in range(len(answer.curves)) for key in ("lower", "upper", "unbounded")]
    lines = [",".join([answer.actuator, *keys])]
    for i, value in enumerate(answer.values):
        cells = [repr(float(value))]
        for c in answer.curves:
            cells += [number(c.lower[i]), number(c.upper[i]), str(bool(c.unbounded[i])).lower()]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"
