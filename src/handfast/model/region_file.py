"""A region as it stands in files: of tasks, of hands, and of what a search keeps."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import field_validator, model_validator

from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, Vector
from handfast.model.region import Bezier, Cap, Region


class CapEntry(Strict):
    """A spherical cap: see `handfast.model.region.Cap`."""

    center: Vector
    radius: Finite
    axis: Vector
    half_angle: Finite


class RegionEntry(Strict):
    """Exactly one of a Bezier patch and a cap; `flip` reverses its outward normal."""

    bezier: list[list[Vector]] | None = None
    cap: CapEntry | None = None
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
        if (self.bezier is None) == (self.cap is None):
            raise ValueError("exactly one of bezier, cap is needed")
        return self

    def region(self, field: str, flip: bool) -> Region:
        """The region; `field` is where it stands in the file, `flip` what stands beside it."""
        if flip and self.flip:
            raise InputError("is given twice, in the region and beside it; once is enough", field=f"{field}.flip")
        flip = flip or self.flip
        try:
            if self.cap is None:
                return Bezier(np.array(self.bezier), flip)
            cap = self.cap
            return Cap(np.array(cap.center), cap.radius, np.array(cap.axis), cap.half_angle, flip)
        except InputError as fault:
            raise fault.within(field) from None


def region_to_dict(region: Region) -> dict[str, Any]:
    """A region as a task file writes it; `RegionEntry.region` reads it."""
    data: dict[str, Any]
    if isinstance(region, Bezier):
        data = {"bezier": region.points.tolist()}
    else:
        cap = {"center": region.center.tolist(), "radius": float(region.radius)}
        data = {"cap": cap | {"axis": region.axis.tolist(), "half_angle": region.half_angle}}
    return data | ({"flip": True} if region.flip else {})
