"""Named contact regions of a hand, and the `handfast/hand-regions/1` file that holds them.

{"schema": "handfast/hand-regions/1", "hand": "schunk-sah",
 "regions": {"thumb_tip": {"link": "thumb_distal", "finger": "thumb", "role": "tip",
                           "region": {"cap": {"center": [0.02, 0, 0], "radius": 0.013, "axis": [0.14, 0, 0.99],
                                              "half_angle": 1.05}}}}}
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from pydantic import Field

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.core.files import Finite, Strict, read_json, validate, write_text
from handfast.model.hand.hand import Hand
from handfast.model.hand.load import bundled_hands, load_hand
from handfast.model.region import Region
from handfast.model.region_file import RegionEntry, region_to_dict

Role = Literal["tip", "pad", "palm"]
ROLES: tuple[Role, ...] = get_args(Role)


@dataclass(frozen=True, eq=False)
class HandRegion:
    """A part of a hand's surface that may touch.

    Attributes:
        name: unique in the hand.
        link: name of the link that carries it.
        region: in the link frame; its outward normal points away from the link.
        finger: the name that the regions of one finger share; "palm" for the palm.
        role: "tip" at a finger's end, "pad" further in, "palm".
        error: [m] largest distance of the region from the link's collision shapes, 0 if it lies on them.
    """

    name: str
    link: str
    region: Region
    finger: str
    role: Role
    error: float = 0.0

    @property
    def middle(self) -> tuple[Array, Array]:
        """The point (3,) [m] in its middle and the outward unit normal (3,) there, link frame."""
        return self.region.middle


@dataclass(frozen=True, eq=False)
class HandRegions:
    """The named regions of one hand.

    Attributes:
        hand: name or path of the hand.
        regions: at least one; names are unique.
    """

    hand: str
    regions: tuple[HandRegion, ...]

    def __post_init__(self) -> None:
        if not self.regions:
            raise InputError("is empty; at least one region is needed", field="regions")

    def __iter__(self) -> Iterator[HandRegion]:
        return iter(self.regions)

    def __getitem__(self, name: str) -> HandRegion:
        """By name; `InputError` listing the known ones if there is none."""
        for region in self.regions:
            if region.name == name:
                return region
        raise unknown_name("region", name, [r.name for r in self.regions])

    def of(self, *roles: Role) -> tuple[HandRegion, ...]:
        """Those of some roles, in order."""
        return tuple(r for r in self.regions if r.role in roles)

    def refuse_strangers(self, hand: Hand) -> None:
        """`InputError` listing the known links if a region is on a link that the hand does not have."""
        for r in self.regions:
            if r.link not in hand.link_names:
                raise unknown_name("link", r.link, hand.link_names, field=f"regions.{r.name}.link")


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
    file = Path(bundled.resolve("hand_regions", str(source)))
    data = read_json(file, "hand-regions")
    try:
        entry = validate(HandRegionsFile, data)
        named = entry.hand if entry.hand in bundled_hands() else str(file.parent / entry.hand)
        regions = tuple(
            HandRegion(name, r.link, r.region.region(f"regions.{name}.region", False), r.finger, r.role, r.error)
            for name, r in entry.regions.items()
        )
        found = HandRegions(named, regions)
        found.refuse_strangers(hand or load_hand(named))
    except InputError as fault:
        raise fault.at(str(source)) from None
    return found


def save_hand_regions(regions: HandRegions, path: str | Path, *, force: bool = False) -> None:
    """Write a `handfast/hand-regions/1` file. Raises `InputError` if it exists and `force` is not set."""
    write_text(path, json.dumps(to_dict(regions, folder=Path(path).parent), indent=1) + "\n", force=force)


def to_dict(regions: HandRegions, *, folder: str | Path = ".") -> dict[str, Any]:
    """The regions as a `handfast/hand-regions/1` object; a path is written relative to `folder`."""
    hand = regions.hand
    if hand not in bundled_hands():
        hand = Path(os.path.relpath(hand, folder)).as_posix()
    return {
        "schema": "handfast/hand-regions/1",
        "hand": hand,
        "regions": {
            r.name: {"link": r.link, "finger": r.finger, "role": r.role, "region": region_to_dict(r.region)}
            | ({"error": r.error} if r.error else {})
            for r in regions
        },
    }
