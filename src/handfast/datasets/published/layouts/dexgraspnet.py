"""DexGraspNet: one `.npy` an object, a list of `{scale, qpos}`; the wrist's place and its Euler angles are joints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from handfast.core.errors import InputError
from handfast.core.transforms import transform
from handfast.datasets.published.recorded import (
    Posture,
    PublishedLayout,
    RecordedGrasp,
    Rows,
    entry,
    number,
    positive,
    rows,
)

PLACE, TURN = ("WRJTx", "WRJTy", "WRJTz"), ("WRJRx", "WRJRy", "WRJRz")  # [m]; [rad] about the fixed x, then y, then z


def recognises(data: Any) -> bool:
    """A list of dictionaries with `qpos` by name."""
    first = data[0] if isinstance(data, list | np.ndarray) and np.ndim(data) == 1 and len(data) else None
    return isinstance(first, Mapping) and isinstance(first.get("qpos"), Mapping)


def read(data: Any, name: str) -> Rows:
    """The object is the file's name; the hand is posed in the frame of its scaled mesh."""
    return rows(len(data), lambda i: _grasp(data[i], i, name))


def _grasp(row: Any, index: int, name: str) -> RecordedGrasp:
    score = row.get("energy") if isinstance(row, Mapping) else None
    return RecordedGrasp(
        index,
        _posture(entry(row, "qpos")),
        object=name,
        scale=positive(entry(row, "scale"), "scale"),
        score=None if score is None else number(score, "energy"),
    )


def _posture(qpos: Any) -> Posture:
    from scipy.spatial.transform import Rotation

    if not isinstance(qpos, Mapping) or not all(isinstance(k, str) for k in qpos):
        raise InputError("is no dictionary of joint values", field="qpos")
    values = {k: number(v, f"qpos.{k}") for k, v in qpos.items()}
    missing = [k for k in (*PLACE, *TURN) if k not in values]
    if missing:
        raise InputError(f"has no {missing[0]}", field="qpos")
    turn = Rotation.from_euler("xyz", [values[k] for k in TURN]).as_matrix()
    joints = {k: v for k, v in values.items() if k not in PLACE + TURN}
    return Posture(transform([values[k] for k in PLACE], turn), joints)


LAYOUT = PublishedLayout("dexgraspnet", "a list of {scale, qpos}", recognises, read)
