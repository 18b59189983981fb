"""`handfast map` and `sweep`: largest resisted disturbances, in all directions of a plane or while a command grows."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from tyro.conf import UseAppendAction, arg

from handfast.cli import console, tables
from handfast.cli.load_options import WeightOptions
from handfast.cli.options import Command, EndsIn, LoadingOrder, QueryOptions, Triple, Wrench, write_as
from handfast.core.errors import InputError
from handfast.pictures import Entry
from handfast.stability.studies.maps import MapAnswer, SweepAnswer, sweep
from handfast.stability.studies.questions import force_map

Figures = Annotated[Path | None, arg(metavar="FILE", aliases=["-o"]), EndsIn((".png", ".svg", ".csv", ".json"))]


@dataclass(kw_only=True)
class Map(QueryOptions, LoadingOrder, Command):
    """The largest resisted force in every direction of a plane, without and with the preload.

    Figures 6, 8 and 10 of the stability paper. Directions are spread over all processors; Ctrl-C ends
    the map and keeps the directions that are done.
    """

    plane: Literal["xy", "xz", "yz"] = "xy"
    """plane of the object frame"""
    at: Triple = (0.0, 0.0, 0.0)
    """point of the object at which the forces act [m], object frame; its centre of mass, for a map of weights"""
    steps: Annotated[int, arg(metavar="N")] = 360
    """number of directions"""
    output: Figures = None
    """picture (.png, .svg) or numbers (.csv, .json)"""
    interval: bool = False
    """show in every direction which smaller forces slip, too; takes many times as long"""
    limit: Annotated[float | None, arg(metavar="N")] = None
    """radius of the picture [N]"""
    weight: Annotated[float | None, arg(metavar="N")] = None
    """weight of the object [N], a circle in the picture: red where the grasp resists less"""

    def run(self) -> int:
        grasp, options = self.load(), self.options()
        for name, force in (("--limit", self.limit), ("--weight", self.weight)):
            if force is not None and not 0 < force < float("inf"):
                raise InputError(f"is {force:g}; a force above 0 [N] is needed", field=name)
        with console.watch("map") as watch:
            options |= {"interval": self.interval, "loading": self.loading}
            options |= {"at": self.at, "steps": self.steps, "on_progress": watch.item}
            answer = force_map(grasp, self.plane, **options)
        if self.output:
            save_map(answer, self.output, limit=self.limit, weight=self.weight, force=self.force)
        title = f"Which forces in the {self.plane} plane does it resist?"
        entry = Entry(title, answer, eta=self.limits.eta, limit=self.limit, weight=self.weight)
        return self.finish(grasp, answer, [entry], lambda out: tables.show_map(out, answer, self))


def save_map(
    answer: MapAnswer, path: Path, *, limit: float | None = None, weight: float | None = None, force: bool = False
) -> None:
    """Write a map as picture or numbers, by the file's ending; limit and weight are those of `draw_map`."""
    from handfast.pictures.map_picture import draw_map

    write_as(path, answer, lambda: draw_map(answer, limit=limit, weight=weight), lambda: map_csv(answer), force=force)


def map_csv(answer: MapAnswer) -> str:
    """One line per direction; an empty upper bound is unbounded or not known.

    Holes are first:last, with spaces between.
    """
    named = [("without", answer.passive), ("with", answer.preloaded)]
    curves = [(name, curve) for name, curve in named if curve is not None]
    keys: tuple[str, ...] = ("lower", "upper", "unbounded", "verdict")
    asked = any(c.intervals for _, c in curves)
    keys += ("holds_from_zero_to", "holes") if asked else ()
    columns = [f"{key}_{name}_preload" for name, _ in curves for key in keys]
    lines = [",".join(["dx", "dy", "dz", *columns])]
    for i, d in enumerate(answer.directions):
        cells = [repr(float(x)) for x in d]
        for _, c in curves:
            unbounded = str(bool(c.unbounded[i])).lower()
            cells += [number(c.lower[i]), number(c.upper[i]), unbounded, str(c.verdicts[i])]
            if asked:
                shown = c.intervals[i] if c.intervals else None
                holes = [f"{first!r}:{last!r}" for first, last in shown.holes] if shown else []
                cells += [number(shown.holds_from_zero_to if shown else 0.0), " ".join(holes)]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


@dataclass(kw_only=True)
class Sweep(QueryOptions, LoadingOrder, WeightOptions):
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
    output: Figures = None
    """picture (.png, .svg) or numbers (.csv, .json)"""

    def run(self) -> int:
        grasp, options = self.load(), self.options()
        self.check_one(self.direction, self.gravity)
        directions = self.direction or (self.one_wrench((), self.gravity, grasp, self.grasp),)
        if self.steps < 2:
            raise InputError(f"is {self.steps}; at least 2 commands are needed", field="--steps")
        for value, field in ((self.from_, "--from"), (self.to, "--to")):
            if not np.isfinite(value):
                raise InputError(f"is {value}; a finite number is needed", field=field)
        values = np.linspace(self.from_, self.to, self.steps)
        with console.watch("sweep") as watch:
            options |= {"loading": self.loading, "on_progress": watch.item}
            answer = sweep(grasp, self.joint, values, directions, **options)
        if self.output:
            save_sweep(answer, self.output, force=self.force)
        entry = Entry(f"How does the command of {self.joint} change what it resists?", answer, eta=self.limits.eta)
        return self.finish(grasp, answer, [entry], lambda out: tables.show_sweep(out, answer, self))


def save_sweep(answer: SweepAnswer, path: Path, *, force: bool = False) -> None:
    """Write a sweep as picture or numbers, by the file's ending."""
    from handfast.pictures.map_picture import draw_sweep

    write_as(path, answer, lambda: draw_sweep(answer), lambda: sweep_csv(answer), force=force)


def sweep_csv(answer: SweepAnswer) -> str:
    """One line per command; an empty upper bound is unbounded or not known."""
    keys = [f"{key}_{k + 1}" for k in range(len(answer.curves)) for key in ("lower", "upper", "unbounded")]
    lines = [",".join([answer.actuator, *keys])]
    for i, value in enumerate(answer.values):
        cells = [repr(float(value))]
        for c in answer.curves:
            cells += [number(c.lower[i]), number(c.upper[i]), str(bool(c.unbounded[i])).lower()]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def number(x: float) -> str:
    """A finite number in full, nothing otherwise."""
    return repr(float(x)) if abs(x) < float("inf") else ""
