"""How maxima of sampled grasps are spread: the sentences about them, and a histogram beside nominal and eta."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from handfast.core.answer import Stop
from handfast.pictures.drawing import AMBER, BLUE, GREY, INK, MAROON
from handfast.pictures.words import count, direction_text, listed, magnitude, num

if TYPE_CHECKING:
    from handfast.stability.queries import MaxAnswer
    from handfast.stability.sampled_maximum import SampledMaximum

BINS = 30


def bounds_text(found: SampledMaximum) -> str:
    """'Off by up to: contacts 1 mm, normals 2.5°; seed 0.'"""
    b = found.bounds
    parts = [f"contacts {num(1e3 * b.positions)} mm"] if b.positions else []
    parts += [f"normals {num(float(np.degrees(b.normals)))}°"] if b.normals else []
    parts += [f"friction {num(100 * b.friction)} %"] if b.friction else []
    parts += [f"commands {num(100 * b.command)} %"] if b.command else []
    return f"Off by up to: {', '.join(parts)}; seed {found.seed}."


def bound_text(answer: MaxAnswer, factor: float) -> str:
    """'2.224', or what else a maximum can be."""
    if answer.unbounded:
        return "∞"
    if answer.lower == 0:
        return "0" if answer.upper == 0 else "not decided"
    return num(factor * answer.lower)


def conclusion(found: SampledMaximum) -> list[str]:
    """What the samples say of the grasp and of equation (17), a sentence each."""
    decided, n = int(found.decided.sum()), len(found.lower)
    lines = []
    if found.stop is not Stop.COMPLETE:
        lines.append("Interrupted: the samples that were asked are shown.")
    if decided < n:
        lines.append(f"{count(n - decided, 'sample')} not decided, left out.")
    if not decided:
        return lines
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

    Samples beyond the picture, unbounded ones among them, are counted in its last bar, which says so.
    """
    factor, unit = magnitude(found.direction)
    figure = Figure(figsize=(8.0, 4.2), dpi=100)
    ax = figure.add_axes((0.09, 0.15, 0.88, 0.68))
    values = factor * found.values
    marks: list[tuple[float, str, str, str]] = [_mark(found.nominal, factor, "as it stands", INK, "-")]
    if found.uncertain is not None:
        eta = num(float(np.degrees(found.bounds.normals)))
        marks.append(_mark(found.uncertain, factor, f"eta = {eta}°", MAROON, "--"))
    for share, label in ((0.0, "worst sample"), (0.05, "5 %"), (0.5, "median")):
        if share in found.quantiles:
            marks.append((factor * found.quantiles[share], label, GREY, ":"))
    end = _end(values, [x for x, *_ in marks if np.isfinite(x)])
    shown = np.minimum(values, end)
    _, edges, _ = ax.hist(
        shown, BINS, range=(min(0.0 if not len(shown) else shown.min(), end * 0.999), end), color=BLUE
    )
    beyond = int((values > end).sum())
    top = ax.get_ylim()[1] * 1.3
    ax.set_ylim(0, top)
    for k, (x, label, color, style) in enumerate(sorted(marks, key=lambda m: m[0])):
        if not np.isfinite(x):
            continue
        ax.axvline(min(x, end), color=color, ls=style, lw=1.6)
        place: dict[str, Any] = {"ha": "left", "va": "top", "fontsize": 8, "color": INK if color == GREY else color}
        ax.text(min(x, end), top * (0.99 - 0.055 * (k % 6)), f" {label} {num(x, 3)}", **place)
    if beyond:
        text = f"{beyond} resist\nmore, or\nany size"
        ax.text(edges[-2], top * 0.5, text, ha="right", va="center", fontsize=8, color=AMBER)
    ax.set_xlabel(f"largest {direction_text(found.direction)} that is resisted [{unit}]")
    ax.set_ylabel("samples")
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    ax.tick_params(color=GREY, labelcolor=INK, labelsize=8)
    figure.text(0.09, 0.93, f"{found.grasp.name}: {count(len(found.lower), 'sample')}", fontsize=12, color=INK)
    figure.text(0.09, 0.875, bounds_text(found), fontsize=8.5, color=INK)
    return figure


def _mark(answer: MaxAnswer, factor: float, label: str, color: str, style: str) -> tuple[float, str, str, str]:
    return (np.inf if answer.unbounded else factor * answer.lower, label, color, style)


def _end(values: Any, marks: list[float]) -> float:
    """Where the picture ends: all that is finite if it is not far beyond the rest."""
    finite = values[np.isfinite(values)]
    far = max([float(np.quantile(finite, 0.9)) * 1.6 if len(finite) else 0.0, *(1.15 * m for m in marks)])
    most = float(finite.max()) * 1.02 if len(finite) else 1.0
    return max(min(far, most) if np.isfinite(values).all() else max(far, 1e-9), *(1.05 * m for m in marks), 1e-9)
