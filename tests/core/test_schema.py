"""Dataclasses that are their own file format: read, refused, written again."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
import pytest

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Strict, validate
from handfast.core.schema import LEFT_OUT, OPEN_FIELD, InFiles, NullFor, Numbers, Vector3, written


class Kind(StrEnum):
    FLAT = "flat"
    ROUND = "round"


@dataclass(frozen=True, eq=False)
class Pad(InFiles):
    middle: Vector3
    outline: Annotated[Array, Numbers(None, 2)]
    kind: Kind = Kind.FLAT
    width: float = field(default=0.0, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        if self.width < 0:
            raise InputError(f"is {self.width:g}; 0 or more is needed", field="width")


@dataclass(frozen=True, eq=False)
class Finger(InFiles):
    name: str
    pads: tuple[Pad, ...] = ()


class FingerFile(Strict):
    finger: Finger


PAD = {"middle": [1, 2, 3.5], "outline": [[0, 0], [1, 0], [0, 1]], "kind": "round", "width": 2.0}


def test_a_class_is_read_and_written_again() -> None:
    finger = validate(Finger, {"name": "thumb", "pads": [PAD, {k: PAD[k] for k in ("middle", "outline")}]})
    round_one, flat_one = finger.pads
    assert isinstance(round_one.middle, np.ndarray)
    assert round_one.outline.shape == (3, 2)
    assert round_one.kind is Kind.ROUND
    assert written(round_one) == PAD
    assert written(finger)["pads"][1] == {"middle": [1, 2, 3.5], "outline": PAD["outline"], "kind": "flat"}
    assert flat_one.width == 0.0
    assert validate(Finger, written(finger)).pads[0].width == 2.0


def test_a_class_is_a_field_of_a_model() -> None:
    file = validate(FingerFile, {"finger": {"name": "thumb", "pads": [PAD]}})
    assert file.finger.pads[0].width == 2.0
    assert file.model_dump(mode="json")["finger"]["pads"][0]["middle"] == [1, 2, 3.5]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"colour": 1}, r"^finger\.pads\[0\]\.colour: is not a known field; leave it out$"),
        ({"middle": [1, 2]}, r"^finger\.pads\[0\]\.middle\[2\]: is missing$"),
        ({"middle": [1, 2, "3"]}, r"^finger\.pads\[0\]\.middle\[2\]: input should be a valid number$"),
        ({"middle": [1, 2, True]}, r"^finger\.pads\[0\]\.middle\[2\]: input should be a valid number$"),
        ({"outline": [[1, 2], [3]]}, r"^finger\.pads\[0\]\.outline\[1\]\[1\]: is missing$"),
        ({"kind": "square"}, r"^finger\.pads\[0\]\.kind: input should be 'flat' or 'round'$"),
        ({"width": -1}, r"^finger\.pads\[0\]\.width: is -1; 0 or more is needed$"),
        ({"width": "1"}, r"^finger\.pads\[0\]\.width: input should be a valid number$"),
    ],
)
def test_faults_name_the_field(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        validate(FingerFile, {"finger": {"name": "thumb", "pads": [PAD | change]}})


def test_what_is_missing_is_named() -> None:
    with pytest.raises(InputError, match=r"^name: is missing$"):
        validate(Finger, {})
    with pytest.raises(InputError, match=r"^input should be "):
        validate(Finger, [])


@dataclass(frozen=True)
class Range(InFiles):
    ends: tuple[Annotated[float, NullFor(-math.inf)], Annotated[float, NullFor(math.inf)]] = field(
        default=(-math.inf, math.inf), metadata=OPEN_FIELD
    )


def test_what_is_open_is_null() -> None:
    assert validate(Range, {"ends": [None, 2]}).ends == (-math.inf, 2.0)
    assert written(Range((1.0, math.inf))) == {"ends": [1.0, None]}
    assert validate(Range, written(Range())) == Range()
    with pytest.raises(InputError, match=r"^ends\[0\]: input should be a valid number$"):
        validate(Range, {"ends": ["1", 2]})
