"""A dataset's labels at a glance: verdicts, contacts, and how factors, forces and commands are spread."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from handfast.datasets.labels.label_summary import edges
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON

if TYPE_CHECKING:
    from handfast.datasets.labels.label_summary import LabelSummary

VERDICT_COLORS = {"holds": BLUE, "slips": MAROON, "undecided": AMBER, "no weight": GREY, "broken": INK}
PANELS = {
    "weight_factor": "least factor on the weight",
    "worst_force": "largest force in the worst direction [N]",
    "largest_command": "least commands, the largest [N m, N]",
}


def draw_labels(summary: LabelSummary, name: str) -> Figure:
    """The picture of a summary; `name` of the table is its title."""
    figure = Figure(figsize=(9.0, 6.2), dpi=100)
    axes = figure.subplots(2, 2)
    figure.subplots_adjust(left=0.08, right=0.98, top=0.86, bottom=0.09, hspace=0.42, wspace=0.22)
    rest = f", {summary.broken} broken" if summary.broken else ""
    figure.suptitle(f"{name}: {summary.labelled} of {summary.rows} grasps labelled{rest}", x=0.08, ha="left", color=INK)
    _contacts(axes[0, 0], summary)
    for ax, column in zip(axes.ravel()[1:], PANELS, strict=True):
        _spread(ax, summary, column)
    seen = [v for v in VERDICT_COLORS if summary.verdicts.get(v)]
    handles = [_patch(VERDICT_COLORS[v], f"{v} {summary.verdicts[v]}") for v in seen]
    if handles:
        place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.075, 0.955)}
        figure.legend(handles=handles, ncols=4, frameon=False, fontsize=9, title="", **place)
    return figure


def _contacts(ax: Any, summary: LabelSummary) -> None:
    numbers = sorted(summary.contacts)
    ax.bar([str(n) for n in numbers], [summary.contacts[n] for n in numbers], color=GREY)
    ax.set_title("contacts", loc="left", fontsize=10, color=INK)
    ax.set_ylabel("grasps", fontsize=9)
    _plain(ax)


def _spread(ax: Any, summary: LabelSummary, column: str) -> None:
    """Histograms by verdict, one on the other, over a logarithmic axis."""
    places = edges(column)
    below = np.zeros(len(places) - 1)
    for verdict, color in VERDICT_COLORS.items():
        bins = np.array(summary.spread[column].get(verdict, []), dtype=float)
        if len(bins):
            ax.bar(places[:-1], bins, np.diff(places), below, align="edge", color=color, lw=0)
            below += bins
    filled = np.flatnonzero(below)
    if len(filled):
        ax.set_xlim(places[max(filled[0] - 1, 0)], places[min(filled[-1] + 2, len(places) - 1)])
    else:
        ax.text(0.5, 0.5, "none", transform=ax.transAxes, ha="center", color=GREY)
    ax.set_xscale("log")
    if column == "weight_factor":
        ax.axvline(1.0, color=INK, lw=0.8, ls=":")
    ax.set_title(PANELS[column], loc="left", fontsize=10, color=INK)
    _plain(ax)


def _plain(ax: Any) -> None:
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(color=GREY, labelcolor=INK, labelsize=8)


def _patch(color: str, text: str) -> Any:
    from matplotlib.patches import Patch

    return Patch(color=color, label=text)
