"""What `hold` says on the screen: of one grasp load by load, of several a line each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console
from rich.text import Text

from handfast.cli.console import table
from handfast.cli.tables import STYLE
from handfast.core.answer import Stop, Verdict
from handfast.pictures import words
from handfast.pictures.sentences import command_text, hold_sentence
from handfast.pictures.words import num

if TYPE_CHECKING:
    from handfast.model.grasp import Grasp
    from handfast.stability.answers import MaxAnswer
    from handfast.stability.studies.hold import HoldAnswer

CUT = Stop.TIME, Stop.NODES, Stop.INTERRUPTED  # limits that ended a search


@dataclass(frozen=True, eq=False)
class HeldGrasp:
    """What is known of one grasp of several: an answer, or why there is none."""

    name: str
    answer: HoldAnswer | None
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        said = None if self.answer is None else self.answer.to_json()
        return {"name": self.name, "answer": said, "reason": self.reason or None}


def show_hold(out: Console, grasp: Grasp, answer: HoldAnswer, eta: float, why: str) -> None:
    """Verdict, preload, loads.

    Args:
        eta: how far normals may be off [degrees].
        why: the answer is not complete; '' if it is.
    """
    out.print(Text.assemble((answer.verdict.upper(), STYLE[answer.verdict]), "  ", hold_sentence(answer)))
    off = f"; normals off by up to {num(eta)}°" if eta else ""
    out.print(f"{grasp.name}: {words.grasp_text(grasp)}{off}", style="dim")
    if why:
        out.print(why, style="yellow")
    out.print(f"{words.count(answer.nodes, 'node')}, {num(answer.seconds, 2)} s", style="dim")
    if answer.preload:
        grid = table("actuator", "command")
        for name, value in answer.preload.items():
            grid.add_row(name, f"{num(value)} {words.actuator_unit(grasp, name)}" if value else "locked")
        out.print()
        out.print(grid)
    if answer.checks:
        grid = table("load", "", "shown by", *(["margin"] if answer.margins else []))
        for name, wrench, a in zip(answer.loads.names, answer.loads.wrenches, answer.checks, strict=True):
            shown = "an exact state" if a.exact else "a state to 1e-9"
            more = [margin_text(answer.margins.get(name))] if answer.margins else []
            grid.add_row(name, words.load_text(wrench), shown, *more)
        out.print()
        out.print(grid)
    if answer.margin is not None:
        out.print(conclusion(answer))


def show_holds(out: Console, rows: Sequence[HeldGrasp]) -> None:
    """A line for each grasp; below it, why some have no answer."""
    answers = [row.answer for row in rows if row.answer]
    counts = [(v, sum(a.verdict is v for a in answers)) for v in Verdict]
    said = ", ".join(f"{n} {v}" for v, n in counts if n) or "none asked"
    broken = len(rows) - len(answers)
    out.print(f"{words.count(len(rows), 'grasp')}: {said}{f', {broken} broken' if broken else ''}", style="bold")
    grid = table("#", "grasp", "", "largest command", "hardest load", "margin", "exact", "seconds")
    for k, row in enumerate(rows):
        a = row.answer
        if a is None:
            grid.add_row(str(k), row.name, Text("BROKEN", style="bold red"), *["–"] * 5)
            continue
        exact = "–" if a.exact is None else "yes" if a.exact else "to 1e-9"
        cut = f", {a.stop}" if a.stop in CUT else ""
        verdict = Text(a.verdict.upper() + cut, style=STYLE[a.verdict])
        hardest = a.refuted[0] if a.refuted else a.hardest or "–"
        margin = "–" if a.margin is None else "any size" if np.isinf(a.margin) else num(a.margin)
        margin += " or more" * any(m.stop in CUT for m in a.margins.values())
        grid.add_row(str(k), row.name, verdict, command_text(a), hardest, margin, exact, num(a.seconds, 2))
    out.print()
    out.print(grid)
    for k, row in enumerate(rows):
        if row.reason:
            out.print(f"{k}: {row.reason}", style="yellow", soft_wrap=True)


def margin_text(a: MaxAnswer | None) -> str:
    """'1.25', with the bound above it where they are apart."""
    if a is None or a.unbounded:
        return "any size"
    lower = num(max(a.lower, 1.0))
    if not np.isfinite(a.upper):
        return f"{lower} or more"
    upper = num(max(a.upper, 1.0))
    return lower if lower == upper else f"{lower} to {upper}"


def conclusion(answer: HoldAnswer) -> str:
    """The least margin in words."""
    if answer.margin is None or np.isinf(answer.margin):
        return "Each load is resisted at any size under this preload."
    return f"Margin {num(answer.margin)}: each load alone is resisted so many times; {answer.weakest} has the least."
