"""Tables and figures of the papers are made again; their sizes and marks are those of the data behind them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from handfast.core.answer import Stop
from handfast.core.errors import InputError
from handfast.model.bernstein import evaluate
from handfast.papers import mixed_integer_solvers, region_exhibits, stability_figures, stability_tables
from handfast.papers.exhibits import EXHIBITS, MakingOptions, TextTable, make
from handfast.papers.friction_relaxation import Discretisation
from handfast.papers.region_exhibits import PRINTED_TASKS
from handfast.pictures.drawing import picture
from handfast.stability.studies.maps import MapAnswer
from handfast.stability.studies.questions import force_map

COARSE = MakingOptions(steps=4, count=1)
SCENES = ["fig1", "fig4", "fig7", "fig9", "fig11", "fig13"]
CHEAP = [*SCENES, "fig2", "fig3", "fig8", "fig12", "regions-fig1", "regions-fig5", "regions-fig6"]
needs_solver = pytest.mark.skipif(not mixed_integer_solvers.available("scip"), reason="pyscipopt is not installed")


def figure(name: str) -> Figure:
    made = make(name, COARSE)
    assert isinstance(made, Figure)
    return made


def table(name: str) -> TextTable:
    made = make(name, COARSE)
    assert isinstance(made, TextTable)
    assert all(len(row) == len(made.heads) for row in made.rows)
    return made


@pytest.mark.parametrize("name", CHEAP)
@pytest.mark.slow
def test_each_cheap_figure_is_made(name: str) -> None:
    assert picture(figure(name), "svg").startswith(b"<?xml")


def test_every_table_and_figure_of_both_papers_is_listed() -> None:
    stability = [f"fig{k}" for k in range(1, 14)] + ["table1", "table2"]
    regions = [f"regions-fig{k}" for k in range(1, 7)] + [f"regions-table{k}" for k in range(1, 4)]
    assert list(EXHIBITS) == stability + regions
    sketches = [e for e in EXHIBITS.values() if not e.maker]
    assert [e.name for e in sketches] == ["regions-fig2", "regions-fig3", "regions-fig4"]
    for exhibit in sketches:
        with pytest.raises(InputError, match=f"{exhibit.name}: is a sketch without data; see "):
            make(exhibit.name)


def test_an_unknown_name_and_bad_numbers_are_one_line() -> None:
    with pytest.raises(InputError, match=r"unknown table or figure 'fig14'; known: fig1, "):
        make("fig14")
    for field, value in (("steps", 0), ("count", -1), ("timeout", 0.0)):
        with pytest.raises(InputError, match=field):
            MakingOptions(**{field: value})  # type: ignore[arg-type]


def test_the_sectors_of_fig3_contain_the_circle_and_the_next_step() -> None:
    """(14), (16): every refinement lies in the one before, and none cuts the exact cone."""
    figure = stability_figures.fig3(COARSE)
    counts = []
    for ax in figure.axes:
        whole = [p.get_xy() for p in ax.patches if isinstance(p, Polygon) and p.get_alpha() == 0.15]
        counts.append(len(whole))
        corners = np.vstack(whole)
        assert np.linalg.norm(corners, axis=1).max() >= 1.0
    assert counts == [4, 6, 8]  # a sector bisected is two, and the step between two levels
    assert len(Discretisation.coarse(2).sectors) == 4


def test_the_polytopes_of_fig5_contain_their_forms() -> None:
    rng = np.random.default_rng(1)
    (li, lj), (ui, uj) = region_exhibits.BOX
    u, v = li + rng.random(50) * (ui - li), lj + rng.random(50) * (uj - lj)
    bicubic = [float(evaluate(region_exhibits.BICUBIC[:, :, None], a, b)[0]) for a, b in zip(u, v, strict=True)]
    axes = region_exhibits.fig5(COARSE).axes
    for ax, points in ((axes[1], np.column_stack([u, v, u * v])), (axes[2], np.column_stack([u, v, bicubic]))):
        corners = np.unique(np.vstack([np.column_stack(line.get_data_3d()) for line in ax.lines]), axis=0)
        sides = ConvexHull(corners).equations
        assert (points @ sides[:, :3].T + sides[:, 3] <= 1e-9).all()


def test_sizes_of_the_nine_systems_are_the_papers() -> None:
    made = table("regions-table2")
    ours, theirs = made.heads.index("n_v, n_e, d"), made.heads.index("paper")
    assert [row[0] for row in made.rows] == list(PRINTED_TASKS)
    for row in made.rows:
        assert row[ours].split(", ")[:2] == row[theirs].split(", ")[:2]


def test_tables_of_hands() -> None:
    assert len(table("regions-table1").rows) == 11
    by_joint = {row[0]: row for row in table("regions-table3").rows}
    assert by_joint["ring_middle"][1:3] == ("(67.8, 0, 0)", "(0, -1, 0)")
    assert by_joint["thumb_base"] == ("thumb_base", "(-3, 27.1, 0)", "(0, 0, -1)", "0° to 90°")


def test_markdown_has_a_line_for_each_row() -> None:
    made = table("regions-table1")
    lines = made.markdown().splitlines()
    assert lines[0].startswith("| hand | DOF |")
    assert sum(line.startswith("|") for line in lines) == len(made.rows) + 2


@pytest.mark.optional
@needs_solver
def test_table1_has_both_papers_values_and_ours() -> None:
    made = table("table1")
    assert made.rows[0][:2] == ("4", ">100")
    assert float(made.rows[0][2]) == pytest.approx(2.29658, rel=1e-4)  # as benchmarks/results/table1.json


@pytest.mark.slow
@pytest.mark.optional
@needs_solver
@pytest.mark.parametrize("name", ["fig5", "fig6", "fig10", "table2"])
def test_each_long_one_is_made(name: str) -> None:
    assert make(name, COARSE)


@pytest.mark.parametrize(("timeout", "open_"), [(1e-9, True), (20.0, False)])
def test_what_is_not_decided_is_in_the_key_of_two_maps(timeout: float, open_: bool) -> None:
    """Without any time nothing is; with enough, four directions of Fig. 9 all are."""
    made = stability_figures.force_maps(MakingOptions(steps=4, timeout=timeout), "fig9", 0.0, 2.5)
    assert ("not decided" in [text.get_text() for text in made.legends[0].texts]) is open_


@pytest.mark.parametrize("which", [0, 1])
def test_what_is_interrupted_is_not_made(monkeypatch: pytest.MonkeyPatch, which: int) -> None:
    """Ctrl-C ends an answer with what was reached: a figure of two maps is not made of one, whichever it comes in."""
    asked = []

    def interrupted(*args: Any, **options: Any) -> MapAnswer:
        asked.append(args)
        answer = force_map(*args, **options)
        if len(asked) - 1 != which:
            return answer
        curve = replace(answer.passive, stops=(Stop.INTERRUPTED, *answer.passive.stops[1:]))
        return replace(answer, passive=curve)

    monkeypatch.setattr(stability_figures, "force_map", interrupted)
    with pytest.raises(KeyboardInterrupt):
        figure("fig6")
    assert len(asked) == which + 1


def test_a_cell_that_is_interrupted_ends_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    cells = []

    def cell(*args: Any) -> dict[str, Any]:
        cells.append(args)
        return {"status": "interrupted"}

    monkeypatch.setattr(stability_tables, "resolution_cell", cell)
    with pytest.raises(KeyboardInterrupt):
        stability_tables.table1(replace(COARSE, solver="scip"))
    assert len(cells) == 1
