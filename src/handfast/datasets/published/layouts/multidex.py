"""MultiDex and GenDexGrasp: `metadata` is a list of (q, "set+object", robot); q is position, 6-D rotation, joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.datasets.published.recorded import (
    Posture,
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    numbers,
    rows,
    text,
)


def recognises(data: Any) -> bool:
    """By `metadata`, a list of triples."""
    found = data.get("metadata") if isinstance(data, Mapping) else None
    return isinstance(found, list | tuple) and (
        not found or (isinstance(found[0], list | tuple) and len(found[0]) >= 2)
    )


def read(data: Any, name: str) -> Rows:
    """The object is what stands after the "+"; the hand is posed in its frame."""
    found = entry(data, "metadata")
    return rows(len(found), lambda i: _grasp(found[i], i))


def _grasp(row: Any, index: int) -> RecordedGrasp:
    if not isinstance(row, list | tuple) or not 2 <= len(row) <= 3:
        raise InputError("is no triple of joints, object and robot", field="metadata")
    q = numbers(row[0], (None,), "metadata.q")
    if len(q) < 9:
        raise InputError(f"has {len(q)} numbers; position, 6-D rotation and joints are needed", field="metadata.q")
    root = transform(q[:3], rotation_6d(q[3:9]))
    hand = text(row[2]) if len(row) == 3 else ""
    return RecordedGrasp(index, Posture(root, q[9:]), object=text(row[1]), hand=hand)


def rotation_6d(six: Array) -> Array:
    """(3, 3) whose first two columns are the given ones (6,), made unit and turned apart evenly until square."""
    x, y = (v / max(float(np.linalg.norm(v)), 1e-12) for v in (six[:3], six[3:]))
    between, across = x + y, x - y
    lengths = np.linalg.norm(between), np.linalg.norm(across)
    if min(lengths) < 1e-6:
        raise InputError("has a 6-D rotation of parallel columns", field="metadata.q")
    a, b = between / lengths[0], across / lengths[1]
    x, y = (a + b) / np.sqrt(2), (a - b) / np.sqrt(2)
    return np.column_stack([x, y, np.cross(x, y)])


LAYOUT = PublishedLayout("multidex", "metadata, a list of (q, object, robot)", recognises, read)
