"""`handfast measures`: what the literature's measures say of a grasp, beside what it resists passively."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rich.console import Console
from tyro.conf import arg

from handfast.cli import console
from handfast.cli.console import print_table
from handfast.cli.maps import Figures
from handfast.cli.options import (
    Command,
    GraspOptions,
    Reported,
    TorqueLimits,
    Triple,
    write_as,
)
from handfast.core.errors import InputError
from handfast.measures.catalogue import MEASURE_GAP
from handfast.measures.measuring import MeasuredValue, Measures, measure
from handfast.pictures import words
from handfast.pictures.words import num
from handfast.stability.problem.settings import Settings


@dataclass(kw_only=True)
class MeasureGrasp(GraspOptions, Reported, Command):
    """What do the usual measures of grasps say of it, beside what it resists passively?

    Ferrari-Canny, force closure, optimal contact forces, internal forces, PCR and PGR, singular values and the
    energies of dexterous grasp planners. None of them knows what the motors hold and command; what each takes the
    hand to be stands beside it.
    """

    about: Triple = ()
    """point about which torques are taken [m], object frame; the centre of mass, or the contacts' middle"""
    length: Annotated[float | None, arg(metavar="M")] = None
    """length by which torques are divided [m]; the largest distance of a contact from that point"""
    edges: Annotated[int, arg(metavar="N")] = 8
    """edges of the pyramids that stand for friction cones"""
    force_limit: Annotated[float, arg(metavar="N")] = 1.0
    """largest normal force at each contact [N], where a measure has one"""
    torque_limit: TorqueLimits = ()
    """largest torque of an actuator, for the largest wrench and the smallest forces; hand: what its file states"""
    passive: bool = True
    """leave out the passive maxima, which are searches and may take seconds"""
    nodes: Annotated[float, arg(metavar="N")] = 1000
    """nodes of the search for each passive maximum"""
    output: Figures = None
    """picture (.png, .svg) or numbers (.csv, .json)"""

    def run(self) -> int:
        grasp = self.load()
        try:
            found = measure(
                grasp, about=self.about or None, length=self.length, edges=self.edges, force_limit=self.force_limit,
                torque_limits=self.torque_limits(), passive=self.passive,
                settings=Settings(nodes=self.nodes, gap=MEASURE_GAP, verify=False),
            )  # fmt: skip
        except InputError as error:
            names = {"torque_limits": "torque_limit"}
            first, *rest = (error.field or "").split(".")
            option = "--" + names.get(first, first).replace("_", "-")
            raise InputError(error.problem, field=".".join([option, *rest])) from None
        if self.output:
            save(found, self.output, force=self.force)
        if self.report:
            from handfast.pictures.measures_picture import draw_measures

            values = [(v.measure.name, value_text(v)) for v in found.values]
            picture = (
                draw_measures(found),
                "Blue: resisted passively. Orange: what chosen contact forces could balance.",
            )
            self.write_page(grasp, facts=values, gallery=[picture])
        if self.json:
            console.print_json(found.to_json())
        else:
            show(console.out(), found, self.output, self.report)
        return console.ANSWERED


def save(found: Measures, path: Path, *, force: bool = False) -> None:
    """Write measures as picture or numbers, by the file's ending."""
    from handfast.pictures.measures_picture import draw_measures

    write_as(path, found, lambda: draw_measures(found), lambda: csv(found), force=force)


def csv(found: Measures) -> str:
    """A line of heads and one of numbers."""
    columns = found.columns()
    row = [_quoted(found.grasp.name), *map(_cell, columns.values())]
    return ",".join(["grasp", *columns]) + "\n" + ",".join(row) + "\n"


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def _cell(value: Any) -> str:
    return "" if value is None else str(value).lower() if isinstance(value, bool) else repr(value)


def show(out: Console, found: Measures, *written: Path | None) -> None:
    """The table."""
    grasp = found.grasp
    out.print(f"{grasp.name}: {words.grasp_text(grasp)}; preload {words.preload_text(grasp)}")
    about = words.place_text(found.scale.about).removeprefix("at ")
    out.print(f"Torques about {about}, divided by {num(1e3 * found.scale.length)} mm.", style="dim")
    if len(grasp.soft):
        out.print("Soft fingers count as point contacts, but for passive maxima.", style="dim")
    told = ((v.measure, value_text(v)) for v in found.values)
    rows = [(m.name, value, m.better, m.assumes, m.source) for m, value in told]
    print_table(out, ["measure", "value", "better", "the hand", "from"], rows)
    notes = [f"{v.measure.name}: {v.note}" for v in found.values if v.note]
    if notes:
        out.print()
        for note in notes:
            out.print(note, style="dim")
    console.say_written(out, *written)


def value_text(v: MeasuredValue) -> str:
    """A value with its unit."""
    if v.value is None:
        return "–"
    if isinstance(v.value, bool):
        return "yes" if v.value else "no"
    unit = {"dimensions": "", "N^6": " N⁶"}.get(v.measure.unit, f" {v.measure.unit}".rstrip())
    return num(v.value) + unit
