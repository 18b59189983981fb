"""Named contact regions of a hand."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from handfast.core.arrays import Array
from handfast.core.errors import InputError, unknown_name
from handfast.model.hand.hand import Hand
from handfast.model.region import Region

Role = Literal["tip", "pad", "palm"]


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
