"""How maxima of sampled grasps are spread: the sentences about them, and a histogram beside nominal and eta."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from handfast.core.answer import Stop
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON, tidy
from handfast.pictures.words import count, direction_text, listed, magnitude, num
from handfast.stability.answers import MaxAnswer
from handfast.stability.studies.sampled_maximum import SampledMaximum

BINS = 30
SAMPLED_BOUND_GAP = 0.01  # relative distance of two bounds beyond which the lower one is called a bound


def bounds_text(found: SampledMaximum) -> str:
    """'Off by up to: contacts 1 mm, normals 2.5°; seed 0.'"""
    b = found.bounds
    parts = [f"contacts {num(1e3 * b.positions)} mm"] if b.positions else []
    parts += [f"normals {num(float(np.degrees(b.normals)))}°"] if b.normals else []
    parts += [f"friction {num(100 * b.friction)} %"] if b.friction else []
    parts += [f"commands {num(100 * b.command)} %"] if b.command else []
    return f"Off by up to: {', '.join(parts)}; seed {found.seed}."


def bound_text(answer: MaxAnswer, factor: float) -> str:
    """'2.224', '2.1 to 2.5' where the bounds are apart, or what else a maximum can be."""
    if answer.unbounded:
        return "any size"
    lower, upper = num(factor * answer.lower), num(factor * answer.upper)
    if answer.upper <= (1 + SAMPLED_BOUND_GAP) * answer.lower:
        return lower
    if answer.lower == 0:
        return f"not decided, at most {upper}" if np.isfinite(answer.upper) else "not decided"
    return f"{lower} to {upper}" if np.isfinite(answer.upper) else f"{lower} or more"


def conclusion(found: SampledMaximum) -> list[str]:
    """What the samples say of the grasp and of equation (17), a sentence each."""
    decided, n = int(found.decided.sum()), len(found.lower)
    lines = []
    if found.stop is not Stop.COMPLETE:
        lines.append("Interrupted: the samples that were asked are shown.")
    if decided < n:
        lines.append(f"{count(n - decided, 'sample')} not decided, left out; more time for each may decide them.")
    if not decided:
        return lines
    lower, upper = found.lower[found.decided], found.upper[found.decided]
    if bounds := int((upper > (1 + SAMPLED_BOUND_GAP) * lower).sum()):
        part = "1 value is a lower bound" if bounds == 1 else f"{bounds} values are lower bounds"
        lines.append(f"{part}: the search ended before it was known how much more is resisted.")
    slips = int((found.values == 0).sum())
    if slips:
        lines.append(f"{num(100 * slips / decided)} % resist nothing along this direction.")
    lines.append(f"{num(100 * found.below_nominal)} % resist less than the grasp as it stands.")
    if found.below_uncertain is not None:
        promised = "what eta promises"
        if found.conservative:
            lines.append(f"Every sample resists {promised}: here eta was on the safe side.")
        else:
            lines.append(f"{num(100 * found.below_uncertain)} % resist less than {promised}: here eta is no bound.")
        beside = [name for name, x in zip(("positions", "friction", "commands"), _others(found), strict=True) if x > 0]
        if beside:
            word = "is" if beside == ["friction"] else "are"
            lines.append(f"Eta is about normals alone; beside them, {listed(beside)} {word} off.")
    which = "within these bounds" if decided == n else "within these bounds that can be decided so"
    lines.append(
        f"Samples prove nothing of grasps between them: with 95 % confidence at most {num(100 * found.unseen, 2)} % of "
        f"all grasps {which} resist less than the worst sample."
    )
    return lines


def _others(found: SampledMaximum) -> tuple[float, float, float]:
    b = found.bounds
    return b.positions, b.friction, b.command


def draw_sampled(found: SampledMaximum) -> Figure:
    """A histogram of the samples' maxima, with nominal, eta and quantiles as lines.

    Samples beyond the picture, unbounded ones among them, are counted in a bar of their own.
    """
    factor, unit = magnitude(found.direction)
    figure = Figure(figsize=(8.0, 4.6), dpi=100)
    ax = figure.add_axes((0.09, 0.135, 0.88, 0.6))
    values = factor * found.values
    marks: list[tuple[float, str, str, Any]] = [_mark(found.nominal, factor, "as it stands", INK, "-")]
    if found.uncertain is not None:
        eta = num(float(np.degrees(found.bounds.normals)))
        marks.append(_mark(found.uncertain, factor, f"eta = {eta}°", MAROON, "--"))
    for share, label, style in ((0.0, "worst sample", ":"), (0.05, "5 %", (0, (1, 4))), (0.5, "median", "-.")):
        if share in found.quantiles:
            marks.append((factor * found.quantiles[share], label, GREY, style))
    end = _end(values, [x for x, *_ in marks if np.isfinite(x)])
    inside = values[values <= end]
    first = min(0.0 if not len(inside) else float(inside.min()), end * 0.999)
    ax.hist(inside, BINS, range=(first, end), color=BLUE)
    beyond = len(values) - len(inside)
    if beyond:  # apart from the bars that have a place on the axis
        wide = (end - first) / BINS
        apart = end + 2 * wide
        ax.bar(apart, beyond, 2 * wide, color=AMBER, label=f"{beyond} resist more, or any size")
        ticks = [t for t in MaxNLocator(7).tick_values(first, end) if first <= t < end]
        ax.set_xticks([*ticks, apart], [*(num(t) for t in ticks), "more"])
    for x, label, color, style in sorted(marks, key=lambda m: m[0]):
        value = num(x, 3) if np.isfinite(x) else "any size"
        line = ax.axvline(x, ls=style) if np.isfinite(x) else ax.plot([], [])[0]
        line.set(color=color, lw=1.6, label=f"{label}: {value}")
    place: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (-0.01, 1.0), "ncols": 3}
    ax.legend(frameon=False, fontsize=8, **place)
    ax.set_xlabel(f"largest {direction_text(found.direction)} that is resisted [{unit}]")
    ax.set_ylabel("samples")
    tidy(ax, 8)
    figure.text(0.09, 0.935, f"{found.grasp.name}: {count(len(found.lower), 'sample')}", fontsize=12, color=INK)
    figure.text(0.09, 0.885, bounds_text(found), fontsize=8.5, color=INK)
    return figure


def _mark(answer: MaxAnswer, factor: float, label: str, color: str, style: str) -> tuple[float, str, str, Any]:
    return (np.inf if answer.unbounded else factor * answer.lower, label, color, style)


def _end(values: Any, marks: list[float]) -> float:
    """Where the picture ends: all that is finite if it is not far beyond the rest."""
    finite = values[np.isfinite(values)]
    least = max((1.05 * m for m in marks), default=1e-9)
    if not len(finite):
        return max(least, 1e-9)
    return max(min(1.6 * float(np.quantile(finite, 0.9)), 1.02 * float(finite.max())), least, 1e-9)
