"""Every table and figure of the two papers, by the name that `handfast paper` takes, and how each is made again.

The papers are M. Haas-Heger and M. Ciocarlie, "Accurate Energetic Constraints for Passive Grasp Stability Analysis",
2020, and C. Rosales, L. Ros, J. M. Porta and R. Suárez, "Synthesizing Grasp Configurations with Specified Contact
Regions", 2010. The authors published no data of the first: its grasps are rebuilt with the bundled Barrett hand.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from handfast.core.errors import InputError, unknown_name
from handfast.papers.exhibit import Exhibit, Maker, MakingOptions, TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STABILITY = "Accurate Energetic Constraints for Passive Grasp Stability Analysis (Haas-Heger and Ciocarlie 2020)"
REGIONS = "Synthesizing Grasp Configurations with Specified Contact Regions (Rosales and others 2010)"


def _stability(name: str, title: str, seconds: int) -> Exhibit:
    def make(options: MakingOptions) -> Figure | TextTable:
        from handfast.papers import stability_figures, stability_tables

        makers: dict[str, Maker] = {**stability_figures.FIGURES, **stability_tables.TABLES}
        return makers[name](options)

    return Exhibit(name, STABILITY, title, seconds, make)


def _regions(name: str, title: str, seconds: int) -> Exhibit:
    def make(options: MakingOptions) -> Figure | TextTable:
        from handfast.papers import region_figures, region_tables

        makers: dict[str, Maker] = {**region_figures.FIGURES, **region_tables.TABLES}
        return makers[name](options)

    return Exhibit(name, REGIONS, title, seconds, make)


EXHIBITS = {
    e.name: e
    for e in (
        _stability("fig1", "two fingers around a jar, four contacts", 2),
        _stability("fig2", "the friction cone, and a pyramid with edges that contain it", 1),
        _stability("fig3", "three steps of refining friction sectors", 1),
        _stability("fig4", "a load that is held against all reason without the dissipation principle", 3),
        _stability("fig5", "contact forces under 2.2 N, and the refined sectors that hold them", 10),
        _stability("fig6", "resisted forces of Fig. 1, exact normals and normals off by 2.5 degrees", 15),
        _stability("fig7", "the grasp with a visible offset of its contacts", 2),
        _stability("fig8", "resisted forces of Fig. 7, normals off by 2.5 degrees", 5),
        _stability("fig9", "a flask in three fingers", 2),
        _stability("fig10", "resisted forces of Fig. 9, normals off by 2.5 degrees", 5),
        _stability("fig11", "three fingers around a plane", 2),
        _stability("fig12", "largest force and torque over the command of finger 3", 2),
        _stability("fig13", "twelve generated grasps", 2),
        _stability("table1", "largest force of Fig. 9 by the number of sectors, full and refined", 30),
        _stability("table2", "times of the three queries on twelve grasps", 20),
        _regions("regions-fig1", "a scalpel held with four contact regions", 2),
        Exhibit("regions-fig2", REGIONS, "a URR finger", instead="handfast show table1:dlr-2"),
        Exhibit("regions-fig3", REGIONS, "assembly of two links by a joint", instead="(8) to (11)"),
        Exhibit("regions-fig4", REGIONS, "what meets in a contact", instead="(15), (16)"),
        _regions("regions-fig5", "polytopes about the forms of the expanded system", 1),
        _regions("regions-fig6", "the Schunk hand in its reference configuration", 2),
        _regions("regions-table1", "eleven hands by the structure of their fingers", 1),
        _regions("regions-table2", "nine tasks: sizes of the system, time to a configuration", 5),
        _regions("regions-table3", "parameters of the Schunk hand's joints", 1),
    )
}


def make(name: str, options: MakingOptions | None = None) -> Figure | TextTable:
    """A table or figure made again from bundled data.

    Raises:
        InputError: no such exhibit, or a sketch, which holds no data; a solver that is not installed.
    """

    if name not in EXHIBITS:
        raise unknown_name("table or figure", name, EXHIBITS)
    exhibit = EXHIBITS[name]
    if exhibit.make is None:
        raise InputError(f"is a sketch without data; see {exhibit.instead}", field=name)
    return exhibit.make(options or MakingOptions())
