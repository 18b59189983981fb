"""Every table and figure of the two papers, by the name that `handfast paper` takes, and how each is made again.

The papers are M. Haas-Heger and M. Ciocarlie, "Accurate Energetic Constraints for Passive Grasp Stability Analysis",
2020, and C. Rosales, L. Ros, J. M. Porta and R. Suárez, "Synthesizing Grasp Configurations with Specified Contact
Regions", 2010. The authors published no data of the first: its grasps are rebuilt with the bundled Barrett hand.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from handfast.core.errors import InputError, unknown_name
from handfast.papers.mixed_integer import Solver

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STABILITY = "Accurate Energetic Constraints for Passive Grasp Stability Analysis (Haas-Heger and Ciocarlie 2020)"
REGIONS = "Synthesizing Grasp Configurations with Specified Contact Regions (Rosales and others 2010)"
ROBUST = 2.5  # [degrees] the uncertainty of normals of Figs 6b, 8 and 10


@dataclass(frozen=True)
class MakingOptions:
    """How finely an exhibit is made.

    Attributes:
        steps: directions of a map, commands of a sweep; None for the exhibit's own number.
        count: of random directions and wrenches (Table II), of levels (Table I); None for what takes about a minute.
        timeout: [s] for each question.
        solver: of mixed-integer programs, where Algorithm 1 is asked; None for whichever is installed, SCIP first.
    """

    steps: int | None = None
    count: int | None = None
    timeout: float = 20.0
    solver: Solver | None = None

    def __post_init__(self) -> None:
        for name in ("steps", "count"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InputError(f"is {value}; 1 or more is needed", field=name)
        if not self.timeout > 0:
            raise InputError(f"is {self.timeout:g} s; a positive number is needed", field="timeout")


@dataclass(frozen=True)
class TextTable:
    """A table as text: heads and cells, and what is to be said below it."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def markdown(self) -> str:
        """The table as Markdown."""
        lines = [self.heads, ("---",) * len(self.heads), *self.rows]
        text = "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
        return "\n\n".join([text, *self.notes]) + "\n"


@dataclass(frozen=True)
class Exhibit:
    """A table or a figure of a paper.

    Attributes:
        name: what `handfast paper` calls it.
        paper: title, authors and year.
        title: what the paper shows there.
        seconds: about how long it takes.
        maker: function of this package that makes it of `MakingOptions` and `arguments`; "" for a sketch without data.
        instead: of a sketch: where what it explains is.
    """

    name: str
    paper: str
    title: str
    seconds: int = 1
    maker: str = ""
    arguments: tuple[Any, ...] = ()
    instead: str = ""


def _from(paper: str, module: str) -> Callable[..., Exhibit]:
    """Exhibits of a paper by name, title, seconds, and the function of a module with its arguments."""

    def exhibit(name: str, title: str, seconds: int, function: str, *arguments: Any) -> Exhibit:
        return Exhibit(name, paper, title, seconds, f"{module}.{function}", arguments)

    return exhibit


_figure, _table = _from(STABILITY, "stability_figures"), _from(STABILITY, "stability_tables")
_regions = _from(REGIONS, "region_exhibits")
EXHIBITS = {
    e.name: e
    for e in (
        _figure("fig1", "two fingers around a jar, four contacts", 2, "scene", "fig1"),
        _figure("fig2", "the friction cone, and a pyramid with edges that contain it", 1, "fig2"),
        _figure("fig3", "three steps of refining friction sectors", 1, "fig3"),
        _figure("fig4", "a load that is held against all reason without the dissipation principle", 3, "fig4"),
        _figure("fig5", "contact forces under 2.2 N, and the refined sectors that hold them", 10, "fig5"),
        _figure(
            "fig6", "resisted forces of Fig. 1, exact normals and normals off by 2.5 degrees", 15,
            "force_maps", "fig1", 0.0, ROBUST,
        ),
        _figure("fig7", "the grasp with a visible offset of its contacts", 2, "scene", "fig7"),
        _figure("fig8", "resisted forces of Fig. 7, normals off by 2.5 degrees", 5, "force_maps", "fig7", ROBUST),
        _figure("fig9", "a flask in three fingers", 2, "scene", "fig9"),
        _figure("fig10", "resisted forces of Fig. 9, normals off by 2.5 degrees", 5, "force_maps", "fig9", ROBUST),
        _figure("fig11", "three fingers around a plane", 2, "scene", "fig11"),
        _figure("fig12", "largest force and torque over the command of finger 3", 2, "fig12"),
        _figure("fig13", "twelve generated grasps", 2, "fig13"),
        _table("table1", "largest force of Fig. 9 by the number of sectors, full and refined", 30, "table1"),
        _table("table2", "times of the three queries on twelve grasps", 20, "table2"),
        _regions("regions-fig1", "a scalpel held with four contact regions", 2, "fig1"),
        Exhibit("regions-fig2", REGIONS, "a URR finger", instead="handfast show table1:dlr-2"),
        Exhibit("regions-fig3", REGIONS, "assembly of two links by a joint", instead="(8) to (11)"),
        Exhibit("regions-fig4", REGIONS, "what meets in a contact", instead="(15), (16)"),
        _regions("regions-fig5", "polytopes about the forms of the expanded system", 1, "fig5"),
        _regions("regions-fig6", "the Schunk hand in its reference configuration", 2, "fig6"),
        _regions("regions-table1", "eleven hands by the structure of their fingers", 1, "table1"),
        _regions("regions-table2", "nine tasks: sizes of the system, time to a configuration", 5, "table2"),
        _regions("regions-table3", "parameters of the Schunk hand's joints", 1, "table3"),
    )
}  # fmt: skip


def make(name: str, options: MakingOptions | None = None) -> Figure | TextTable:
    """A table or figure made again from bundled data.

    Raises:
        InputError: no such exhibit, or a sketch, which holds no data; a solver that is not installed.
    """
    if name not in EXHIBITS:
        raise unknown_name("table or figure", name, EXHIBITS)
    exhibit = EXHIBITS[name]
    if not exhibit.maker:
        raise InputError(f"is a sketch without data; see {exhibit.instead}", field=name)
    module, function = exhibit.maker.split(".")
    made: Figure | TextTable = getattr(import_module(f"handfast.papers.{module}"), function)(
        options or MakingOptions(), *exhibit.arguments
    )
    return made
