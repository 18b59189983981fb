"""Regions in files: one, as in tasks and in what a search keeps, and all of a hand, `handfast/hand-regions/1`.

{"schema": "handfast/hand-regions/1", "hand": "schunk-sah",
 "regions": {"thumb_tip": {"link": "thumb_distal", "finger": "thumb", "role": "tip",
                           "region": {"cap": {"center": [0.02, 0, 0], "radius": 0.013, "axis": [0.14, 0, 0.99],
                                              "half_angle": 1.05}}}}}
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from handfast.core.bundled import relative_path
from handfast.core.errors import FaultsOf, InputError
from handfast.core.files import Finite, Strict, Vector, read_named, validate, write_text
from handfast.model.cylinder_side import ConeSide, CylinderSide
from handfast.model.hand.hand import Hand
from handfast.model.hand_regions import HandRegion, HandRegions, Role
from handfast.model.region import Bezier, Cap, Region
from handfast.readers.load_hand import bundled_hands, load_hand

# each has a field in `RegionEntry`
REGION_KINDS: dict[str, type[Region]] = {kind.kind: kind for kind in (Bezier, Cap, CylinderSide, ConeSide)}


class RegionEntry(Strict):
    """Exactly one kind of region, under its key; `flip` reverses its outward normal."""

    bezier: list[list[Vector]] | None = None
    cap: dict[str, Any] | None = None
    cylinder_side: dict[str, Any] | None = None
    cone_side: dict[str, Any] | None = None
    flip: bool = False

    @field_validator("bezier")
    @classmethod
    def _grid(cls, rows: list[list[Vector]] | None) -> list[list[Vector]] | None:
        if rows is None:
            return None
        counts = [len(row) for row in rows]
        if len(set(counts)) > 1:
            raise ValueError(f"has rows of {', '.join(map(str, counts))} points; every row needs the same number")
        if len(counts) < 2 or counts[0] < 2:
            shape = f"{len(counts)} x {counts[0] if counts else 0}"
            raise ValueError(f"has {shape} points; at least 2 x 2 are needed")
        return rows

    @model_validator(mode="after")
    def _one(self) -> RegionEntry:
        if sum(getattr(self, kind) is not None for kind in REGION_KINDS) != 1:
            raise ValueError(f"exactly one of {', '.join(REGION_KINDS)} is needed")
        return self

    def region(self, field: str, flip: bool) -> Region:
        """The region; `field` is where it stands in the file, `flip` what stands beside it."""
        if flip and self.flip:
            raise InputError("is given twice, in the region and beside it; once is enough", field=f"{field}.flip")
        (kind,) = (kind for kind in REGION_KINDS if getattr(self, kind) is not None)
        with FaultsOf(field=field):
            return REGION_KINDS[kind].of(getattr(self, kind), flip or self.flip)


def region_to_dict(region: Region) -> dict[str, Any]:
    """A region as a task file writes it; `RegionEntry.region` reads it."""
    return {region.kind: region.numbers()} | ({"flip": True} if region.flip else {})


class HandRegionEntry(Strict):
    """One region; `flip` stands in it, as in a task file."""

    link: str
    region: RegionEntry
    finger: str
    role: Role
    error: Finite = Field(default=0.0, ge=0)


class HandRegionsFile(Strict):
    """The whole file."""

    schema_: Literal["handfast/hand-regions/1"] = Field(alias="schema")
    hand: str
    regions: dict[str, HandRegionEntry]


def load_hand_regions(source: str | Path, hand: Hand | None = None) -> HandRegions:
    """Read a `handfast/hand-regions/1` file, or the bundled one of a hand by that hand's name.

    Args:
        hand: to check the links against; the one that the file names if absent, a path relative to the file.

    Raises:
        InputError: one line with file, field, fault and what would be right: a missing file, no JSON, an
            unknown or missing field, a link that the hand does not have (its links are listed), a role that is
            none of tip, pad and palm, a degenerate region, no regions.
    """

    def regions(data: Any, file: Path) -> HandRegions:
        entry = validate(HandRegionsFile, data)
        named = entry.hand if entry.hand in bundled_hands() else str(file.parent / entry.hand)
        each = tuple(
            HandRegion(name, r.link, r.region.region(f"regions.{name}.region", False), r.finger, r.role, r.error)
            for name, r in entry.regions.items()
        )
        found = HandRegions(named, each)
        found.refuse_strangers(hand or load_hand(named))
        return found

    return read_named("hand_regions", source, "hand-regions", regions)


def save_hand_regions(regions: HandRegions, path: str | Path, *, force: bool = False) -> None:
    """Write a `handfast/hand-regions/1` file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(hand_regions_dict(regions, folder=Path(path).parent), indent=1) + "\n", force=force)


def hand_regions_dict(regions: HandRegions, *, folder: str | Path = ".") -> dict[str, Any]:
    """The regions as a `handfast/hand-regions/1` object; a path is written relative to `folder`."""
    hand = regions.hand
    if hand not in bundled_hands():
        hand = relative_path(hand, folder)
    return {
        "schema": "handfast/hand-regions/1",
        "hand": hand,
        "regions": {
            r.name: {"link": r.link, "finger": r.finger, "role": r.role, "region": region_to_dict(r.region)}
            | ({"error": r.error} if r.error else {})
            for r in regions
        },
    }
