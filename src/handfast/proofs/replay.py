"""What of an answer was replayed: claims in words, each proved or refused, and what nothing here can show."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import Any

Figure = float | int | bool | str | None


SEARCH_STOPS = "complete", "time", "nodes", "interrupted", "resolution", "fruitless", "numerical"


def down(x: float, digits: int = 6) -> str:
    """A number in so many digits, rounded down: for what holds up to there."""
    return _rounded(x, digits, ROUND_FLOOR)


def up(x: float, digits: int = 6) -> str:
    """The same rounded up: for what holds from there on."""
    return _rounded(x, digits, ROUND_CEILING)


def _rounded(x: float, digits: int, way: str) -> str:
    near = f"{x:.{digits}g}"  # as it was typed, if it has no more digits
    return near if float(near) == x else f"{float(Context(digits, way).create_decimal(x)):.{digits}g}"


class Refused(Exception):
    """Why a claim is not proved, in one line."""


@dataclass(frozen=True)
class Replay:
    """A claim, and whether it is proved.

    Attributes:
        name: what backs it: "witness", "certificate", "configuration 0", the name of a part.
        claim: what it says, in words; "" for what is made of others.
        refused: why it is refused, one line; "" if it is proved, or if it only has parts.
        undecided: why it is neither proved nor refused, one line, of a claim that was asked again; else "".
        figures: what was measured, by name: residuals, margins, numbers of leaves.
        parts: the claims that it is made of; all of them have to be proved.
        not_replayed: what is said besides and cannot be shown here, and why, a line each.
    """

    name: str
    claim: str = ""
    refused: str = ""
    figures: Mapping[str, Figure] = field(default_factory=dict)
    parts: tuple[Replay, ...] = ()
    not_replayed: tuple[str, ...] = ()
    undecided: str = ""

    @property
    def fault(self) -> str:
        """What is refused of it, one line: its own reason, or that of the first part that is refused; or ""."""
        return self.refused or next((f"{part.name}: {part.fault}" for part in self.parts if part.fault), "")

    @property
    def open(self) -> str:
        """What of it is neither proved nor refused, one line; or ""."""
        return self.undecided or next((f"{part.name}: {part.open}" for part in self.parts if part.open), "")

    @property
    def reason(self) -> str:
        """Why not all of it is proved, one line: what is refused, else what is undecided; or ""."""
        return self.fault or self.open

    @property
    def ok(self) -> bool:
        """Is all of it proved?"""
        return not self.reason

    def part(self, name: str) -> Replay | None:
        """The part with a name; None if there is none."""
        return next((part for part in self.parts if part.name == name), None)

    @property
    def replayed(self) -> tuple[str, ...]:
        """The claims that are proved, a line each."""
        own = (self.claim,) if self.claim and not (self.refused or self.undecided) else ()
        return own + tuple((f"{p.name}: " if p.parts else "") + line for p in self.parts for line in p.replayed)

    def to_json(self) -> dict[str, Any]:
        """The same as a JSON object; numbers that are not finite are null."""
        figures = {k: None if isinstance(x, float) and not math.isfinite(x) else x for k, x in self.figures.items()}
        own = {"name": self.name, "claim": self.claim, "ok": self.ok, "reason": self.reason} | figures
        own |= {"undecided": True} if self.open and not self.fault else {}
        own |= {"parts": [part.to_json() for part in self.parts]} if self.parts else {}
        return own | ({"not_replayed": list(self.not_replayed)} if self.not_replayed else {})
