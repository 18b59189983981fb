"""`handfast paper`: the two papers' tables and figures made again, and their own methods."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from rich.console import Console
from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.options import Assignments, Command, Wrench, assigned, check_writable
from handfast.core.errors import InputError, unknown_name
from handfast.core.files import write_bytes, write_text
from handfast.papers.algorithm1 import RefinementSettings
from handfast.papers.exhibits import EXHIBITS, Exhibit, MakingOptions, TextTable, make
from handfast.papers.mixed_integer_solvers import available
from handfast.stability.problem.grasp_limits import GraspLimits

if TYPE_CHECKING:
    from handfast.papers.methods import MethodOptions

FIGURE_ENDINGS, PAPER_TABLE_ENDINGS = (".svg", ".png"), (".md",)
EVERY = {"list": "json", "exhibit": "output force quick timeout", "method": "json"}  # options of each of a kind
TAKES = {  # and of single ones
    **dict.fromkeys(("fig6", "fig8", "fig10", "fig12"), "steps"),
    **dict.fromkeys(("table1", "table2"), "count solver json"),
    **dict.fromkeys(("regions-table1", "regions-table2", "regions-table3"), "json"),
    "fig5": "solver",
    "algorithm1": "direction wrench base least plane steps eta torque_limit force_limit gap timeout"
    " solver sectors full as_printed",
    "earlier-scheme": "wrench edges solver timeout",
    "planar": "direction wrench base",
    "pyramids": "wrench edges",
    "box-shrinking": "over timeout",
}
NEEDS = {"base": ("direction", "plane"), "least": ("wrench",), "steps": ("plane",)}  # of methods: one of which


@dataclass(kw_only=True)
class Paper(Command):
    """The two papers Handfast began with: their tables and figures made again, their own methods run.

    `handfast paper` lists every table, figure and method. `handfast paper fig8 -o fig8.svg` makes one again from
    bundled data; `handfast paper algorithm1 fig9 --direction 0 -1 0` runs a method on a grasp or a task.
    """

    what: Annotated[Positional[str], arg(metavar="NAME")] = ""
    """a table, a figure or a method of the list; without one, the list"""
    about: Annotated[Positional[str], arg(metavar="GRASP|TASK")] = ""
    """for a method: a file, or the name of a bundled grasp or task"""
    output: Annotated[Path | None, arg(metavar="FILE", aliases=["-o"])] = None
    """picture (.svg, .png), NAME.svg by default; for a table, Markdown (.md)"""
    force: bool = False
    """write over a file that exists"""
    json: bool = False
    """print one JSON object instead of text"""
    quick: bool = False
    """coarse and in seconds: 24 directions of a map, four rows of Table I, one direction of Table II"""
    count: Annotated[int | None, arg(metavar="N")] = None
    """for table1: rows, up to 10 (6); for table2: random directions and wrenches, up to 10 (3)"""
    steps: Annotated[int | None, arg(metavar="N")] = None
    """directions of a map (360; with --plane 36), commands of fig12 (21)"""
    timeout: Annotated[float, arg(metavar="S")] = 20.0
    """seconds for each question"""
    direction: Wrench = ()
    """for a method: how large a force and torque along this is resisted?"""
    wrench: Wrench = ()
    """for a method: is this load resisted?"""
    base: Wrench = ()
    """a constant load beside --direction"""
    least: bool = False
    """for algorithm1: the smallest commands that resist --wrench"""
    plane: Literal["xy", "xz", "yz"] | None = None
    """for algorithm1: the largest force in --steps directions of a plane"""
    eta: Annotated[float, arg(metavar="DEG")] = 0.0
    """for algorithm1: how far the contact normals may be off [degrees]"""
    torque_limit: Assignments = ()
    """for algorithm1: largest torque (force) of an actuator with its gearing"""
    force_limit: Annotated[float | None, arg(metavar="N")] = None
    """for algorithm1: largest normal force at any contact [N]"""
    gap: Annotated[float, arg(metavar="G")] = 1e-3
    """for algorithm1: relative distance of the two bounds at which a number is exact enough"""
    solver: Literal["scip", "gurobi"] | None = None
    """mixed-integer solver: by default the first that is installed; table2 times Algorithm 1 only if one is named"""
    sectors: Annotated[int, arg(metavar="N")] = 2048
    """for algorithm1: finest friction sectors per contact: 4, 8, 16, ... more are more exact"""
    full: bool = False
    """for algorithm1: all sectors at once, no refinement (the paper's comparison)"""
    as_printed: bool = False
    """for algorithm1: the paper to the letter: refine to the end, (19) as printed"""
    edges: Annotated[int, arg(metavar="N")] = 8
    """for pyramids and earlier-scheme: edges of a friction pyramid"""
    over: Literal["all", "original"] = "all"
    """for box-shrinking: shrink all variables of (29), or the original ones alone"""

    def run(self) -> int:
        from handfast.papers.methods import METHODS

        if not self.what:
            self._refuse_idle("list")
            return self._list()
        if self.what not in METHODS and self.what not in EXHIBITS:
            raise unknown_name("table, figure or method", self.what, [*EXHIBITS, *METHODS])
        self._refuse_idle("method" if self.what in METHODS else "exhibit")
        if self.what in METHODS:
            return self._method()
        if self.about:
            raise InputError(f"is '{self.about}'; {self.what} is made from bundled data alone", field="GRASP|TASK")
        return self._exhibit()

    def _refuse_idle(self, kind: str) -> None:
        """`InputError` for an option that would be passed over; kind: of `EVERY`."""
        takes = {*EVERY[kind].split(), *TAKES.get(self.what, "").split()}
        options = [f for f in fields(self) if f.name not in ("what", "about")]
        given = [f.name for f in options if getattr(self, f.name) != f.default]
        if idle := next((name for name in given if name not in takes), ""):
            listed = ", ".join(_option(n) for n in sorted(takes))
            raise InputError(f"means nothing to {self.what or 'the list'}, which takes {listed}", field=_option(idle))
        for name in given:
            option, needed = _option(name), NEEDS.get(name, ()) if kind == "method" else ()
            if needed and not any(n in given for n in needed):
                raise InputError(f"is for {' or '.join(map(_option, needed))}; give both", field=option)
            if self.plane and name in ("direction", "wrench"):
                raise InputError(f"asks in all directions of a plane; leave out {option}", field="--plane")

    def _list(self) -> int:
        from handfast.papers.methods import METHODS

        if self.json:
            exhibits = {e.name: {"paper": e.paper, "title": e.title, "made": bool(e.maker)} for e in EXHIBITS.values()}
            methods = {name: {"about": m.about.lower(), "title": m.title} for name, m in METHODS.items()}
            console.print_json({"schema": "handfast/paper/1", "exhibits": exhibits, "methods": methods})
            return console.ANSWERED
        out = console.out()
        for paper in dict.fromkeys(e.paper for e in EXHIBITS.values()):
            out.print(paper, style="bold")
            console.print_list(out, [(e.name, e.title, _effort(e)) for e in EXHIBITS.values() if e.paper == paper])
        out.print("Methods", style="bold")
        console.print_list(out, [(f"{name} {m.about}", m.title, "") for name, m in METHODS.items()])
        return console.ANSWERED

    def _exhibit(self) -> int:
        is_table = "table" in self.what
        file = self.output or (None if is_table else Path(f"{self.what}.svg"))
        if EXHIBITS[self.what].maker:
            check_writable(file, self.force, PAPER_TABLE_ENDINGS if is_table else FIGURE_ENDINGS)
        with console.watch(self.what):
            made = make(self.what, self._effort())
        out = console.out()
        if isinstance(made, TextTable):
            if self.json:
                records = [dict(zip(made.heads, row, strict=True)) for row in made.rows]
                console.print_json({"schema": "handfast/paper/1", "table": records, "notes": list(made.notes)})
            else:
                _print(out, made)
            if file:
                write_text(file, made.markdown(), force=self.force)
        else:
            from handfast.pictures.drawing import picture

            assert file is not None
            write_bytes(file, picture(made, file.suffix.lower().removeprefix(".")), force=self.force)
        if file and not self.json:
            out.print(f"{file} written.", style="dim")
        return console.ANSWERED

    def _effort(self) -> MakingOptions:
        steps, count = self.steps, self.count
        if self.quick:
            steps, count = steps or (6 if self.what == "fig12" else 24), count or (4 if self.what == "table1" else 1)
        return MakingOptions(steps, count, self.timeout, self.solver)

    def _method(self) -> int:
        from handfast.papers.methods import METHODS

        method = METHODS[self.what]
        if not self.about:
            raise InputError(
                f"missing: {method.about}, a file or the name of a bundled one", source=f"paper {self.what}"
            )
        with console.watch(self.what):
            answer = method.run(self.about, self._asked())
        if self.json:
            console.print_json(
                {"schema": "handfast/paper/1", "method": self.what, "about": self.about, **answer.numbers}
            )
        else:
            out = console.out()
            out.print(answer.sentence)
            for line in answer.lines:
                out.print(line, style="dim")
            if answer.table:
                _print(out, answer.table)
        return console.UNDECIDED if answer.undecided else console.ANSWERED

    def _asked(self) -> MethodOptions:
        from handfast.papers.box_shrinking import Over
        from handfast.papers.methods import MethodOptions

        torques = assigned(self.torque_limit, "--torque-limit")
        limits = GraspLimits(float(np.radians(self.eta)), torques, self.force_limit)
        solver = self.solver or ("gurobi" if available("gurobi") and not available("scip") else "scip")
        settings, steps = self.made(RefinementSettings, solver=solver), 36 if self.steps is None else self.steps
        return self.made(MethodOptions, steps=steps, limits=limits, settings=settings, over=Over(self.over))


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _effort(exhibit: Exhibit) -> str:
    """How long it takes; of a sketch, where to look instead."""
    return f"about {exhibit.seconds} s" if exhibit.maker else f"sketch: {exhibit.instead}"


def _print(out: Console, made: TextTable) -> None:
    out.print(console.table(made.heads, made.rows))
    for note in made.notes:
        out.print(note, style="dim")
