"""A dataset's labels at a glance: verdicts, contacts, and how factors, forces and commands are spread."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from handfast.datasets.labels.label_columns import LabelSummary, edges
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON, tidy
from handfast.pictures.words import num

VERDICT_COLORS = {"holds": BLUE, "slips": MAROON, "undecided": AMBER, "no weight": GREY, "broken": INK}
GAP_BINS, WORD_BINS = 3, 5  # bins between the rest and what is beyond it, and that the words below it take
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
    handles = [Patch(color=VERDICT_COLORS[v], label=f"{v} {summary.verdicts[v]}") for v in seen]
    if handles:
        place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0.075, 0.955)}
        figure.legend(handles=handles, ncols=4, frameon=False, fontsize=9, title="", **place)
    return figure


def _contacts(ax: Any, summary: LabelSummary) -> None:
    """Grasps by their number of contacts, on an axis of numbers."""
    numbers = sorted(summary.contacts)
    ax.bar(numbers, [summary.contacts[n] for n in numbers], color=GREY)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    _whole_grasps(ax)
    ax.set_title("contacts", loc="left", fontsize=10, color=INK)
    ax.set_ylabel("grasps", fontsize=9)
    tidy(ax, 8)


def _spread(ax: Any, summary: LabelSummary, column: str) -> None:
    """Histograms by verdict, one on the other, over powers of ten; zeros and what is beyond apart from the rest."""
    places = np.log10(edges(column))
    wide, n = places[1] - places[0], len(places) - 1
    bins = {v: np.array(summary.spread[column].get(v) or [0.0] * n, dtype=float) for v in VERDICT_COLORS}
    inside = np.flatnonzero(np.sum(list(bins.values()), axis=0)[1:-1]) + 1
    first, last = (inside[0], inside[-1]) if len(inside) else (n // 2, n // 2)
    x = places[:-1].copy()
    x[0], x[-1] = (
        places[first] - GAP_BINS * wide,
        places[last] + GAP_BINS * wide,
    )  # the first and last hold all beyond them
    beyond = [(0, "up to {}", places[1]), (-1, "from {}", places[-2])]
    filled = [(k, text.format(num(10**edge, 2))) for k, text, edge in beyond if any(b[k] for b in bins.values())]
    ends = [(x[k] + wide / 2, text) for k, text in filled]
    below = np.zeros(n)
    for verdict, color in VERDICT_COLORS.items():
        its = bins[verdict] > 0  # a bar of no height takes as long
        ax.bar(x[its], bins[verdict][its], wide, below[its], align="edge", color=color, lw=0)
        below += bins[verdict]
    _whole_grasps(ax)
    if not below.any():
        ax.text(0.5, 0.5, "none", transform=ax.transAxes, ha="center", color=GREY)
        ax.set_yticks([])
    if len(inside):
        tens = np.arange(np.floor(places[first]), np.ceil(places[last + 1]) + 1)
        shown = tens[(tens >= places[first] - wide) & (tens <= places[last + 1] + wide)]
        shown = [t for t in shown if all(abs(t - at) > WORD_BINS * wide for at, _ in ends)]
        ends += [(t, num(10**t, 2)) for t in shown or (places[first], places[last + 1])]
    ends.sort()
    ax.set_xticks([at for at, _ in ends], [text for _, text in ends])
    ax.set_xlim((x[0] if below[0] else places[first]) - wide, (x[-1] if below[-1] else places[last]) + 2 * wide)
    if column == "weight_factor":
        ax.axvline(0.0, color=INK, lw=0.8, ls=":")
    ax.set_title(PANELS[column], loc="left", fontsize=10, color=INK)
    tidy(ax, 8)


def _whole_grasps(ax: Any) -> None:
    ax.yaxis.set_major_locator(MaxNLocator(5, integer=True, min_n_ticks=1))
