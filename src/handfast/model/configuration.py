"""Configuration: where the joints and the object are, as the `handfast/configuration/1` file states it.

{"schema": "handfast/configuration/1", "hand": "barrett-bh8-280", "object": "can.obj",
 "joints": {"finger_1_prox": 1.2}, "preload": {"finger_1_prox": 0.1},
 "object_pose": {"position": [0, 0, 0.15], "quaternion": [1, 0, 0, 0]}}
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from handfast.core.arrays import Array
from handfast.core.files import Finite, Strict, Vector
from handfast.core.presented import Presented
from handfast.core.transforms import matrix_quaternion, quaternion_matrix, transform
from handfast.model.hand.hand import Hand


class PoseFile(Strict):
    """A rigid motion: position [m] and unit quaternion (w, x, y, z)."""

    position: Vector = (0.0, 0.0, 0.0)
    quaternion: tuple[Finite, Finite, Finite, Finite] = (1.0, 0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _turns(self) -> PoseFile:
        length = float(np.linalg.norm(self.quaternion))
        if abs(length - 1) > 1e-3:
            raise ValueError(f"quaternion has length {length:.4g}; a unit quaternion w, x, y, z is needed")
        return self

    @classmethod
    def of(cls, pose: Array) -> PoseFile:
        """From (4, 4)."""
        return cls(position=tuple(pose[:3, 3]), quaternion=tuple(matrix_quaternion(pose[:3, :3])))

    @property
    def matrix(self) -> Array:
        """(4, 4)."""
        return transform(self.position, quaternion_matrix(self.quaternion))


class Configuration(Presented, Strict):
    """The whole file.

    Attributes:
        hand, object: names or paths, optional: a caller may give its own.
        joints: values by joint name [rad, m]; the others follow `Hand.configuration`.
        object_pose: of the object in the hand's base frame.
        closing: overrides of the joints' closing senses.
        preload: commanded forces by actuator name [N m, N].
    """

    schema_: Literal["handfast/configuration/1"] = Field(alias="schema")
    hand: str | None = None
    object: str | None = None
    joints: dict[str, Finite] = Field(default_factory=dict)
    object_pose: PoseFile = PoseFile()
    closing: dict[str, Annotated[int, Field(ge=-1, le=1)]] | None = None
    preload: dict[str, Finite] | None = None

    @classmethod
    def of(cls, hand: Hand, q: Array, object_pose: Array, /, **others: Any) -> Configuration:
        """The configuration of a hand at q (l,) with the object at a pose (4, 4) in its base frame."""
        pose = PoseFile.of(object_pose)
        return cls(schema="handfast/configuration/1", joints=hand.values(q), object_pose=pose, **others)

    @property
    def pose(self) -> Array:
        """(4, 4) object pose in the hand's base frame."""
        return self.object_pose.matrix

    def applied(self, hand: Hand) -> tuple[Hand, Array]:
        """The hand with this file's closing senses, and its full configuration (l,)."""
        hand = hand.with_closing(self.closing) if self.closing else hand
        return hand, hand.configuration(self.joints)

    def dumped(self) -> str:
        """The file's text; absent fields are left out."""
        return json.dumps(self.model_dump(by_alias=True, exclude_none=True), indent=2) + "\n"
