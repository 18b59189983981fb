"""A region as it stands in files: of tasks, of hands, and of what a search keeps."""

from __future__ import annotations

from typing import Any

from pydantic import field_validator, model_validator

from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, Vector
from handfast.model.cylinder_side import CylinderSide
from handfast.model.region import Bezier, Cap, Region

# each has a field in `RegionEntry`
KINDS: dict[str, type[Region]] = {kind.kind: kind for kind in (Bezier, Cap, CylinderSide)}


class CapEntry(Strict):
    """A spherical cap: see `handfast.model.region.Cap`."""

    center: Vector
    radius: Finite
    axis: Vector
    half_angle: Finite


class CylinderSideEntry(Strict):
    """Part of a cylinder's side: see `handfast.model.cylinder_side.CylinderSide`."""

    center: Vector
    radius: Finite
    axis: Vector
    x_axis: Vector
    angles: tuple[Finite, Finite]
    heights: tuple[Finite, Finite]


class RegionEntry(Strict):
    """Exactly one kind of region, under its key; `flip` reverses its outward normal."""

    bezier: list[list[Vector]] | None = None
    cap: CapEntry | None = None
    cylinder_side: CylinderSideEntry | None = None
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
        if sum(getattr(self, kind) is not None for kind in KINDS) != 1:
            raise ValueError(f"exactly one of {', '.join(KINDS)} is needed")
        return self

    def region(self, field: str, flip: bool) -> Region:
        """The region; `field` is where it stands in the file, `flip` what stands beside it."""
        if flip and self.flip:
            raise InputError("is given twice, in the region and beside it; once is enough", field=f"{field}.flip")
        (kind,) = (kind for kind in KINDS if getattr(self, kind) is not None)
        try:
            return KINDS[kind].of(self.model_dump()[kind], flip or self.flip)
        except InputError as fault:
            raise fault.within(field) from None


def region_to_dict(region: Region) -> dict[str, Any]:
    """A region as a task file writes it; `RegionEntry.region` reads it."""
    return {region.kind: region.numbers()} | ({"flip": True} if region.flip else {})
