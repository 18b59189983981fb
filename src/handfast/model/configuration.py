"""The `handfast/configuration/1` file: where the joints and the object are.

{"schema": "handfast/configuration/1", "hand": "barrett-bh8-280", "object": "can.obj",
 "joints": {"finger_1_prox": 1.2}, "preload": {"finger_1_prox": 0.1},
 "object_pose": {"position": [0, 0, 0.15], "quaternion": [1, 0, 0, 0]}}
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from handfast.core import bundled
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, read_json, validate, write_text
from handfast.core.transforms import matrix_quaternion
from handfast.model.body_file import PoseFile
from handfast.model.graspit_world import read_graspit_world
from handfast.model.hand.hand import Hand


class Configuration(Strict):
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
        pose = PoseFile(position=tuple(object_pose[:3, 3]), quaternion=tuple(matrix_quaternion(object_pose[:3, :3])))
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


def load_configuration(path: str | Path) -> Configuration:
    """Read a configuration file, or a bundled one by name, or the configuration in a GraspIt! world.

    Of a world (XML), hand and object are named by their files. `world.xml#Barrett,mug` chooses among several; a robot
    that carries another, an arm, is not the hand. Obstacles are left out.

    Raises:
        InputError: no such file, not JSON, or the first field that is wrong. One line, naming the file.
    """
    name, _, chosen = str(path).partition("#")
    if name.lower().endswith(".xml"):
        world = read_graspit_world(Path(name), tuple(filter(None, chosen.split(","))))
        pose = PoseFile(position=tuple(world.pose[:3, 3]), quaternion=tuple(matrix_quaternion(world.pose[:3, :3])))
        return Configuration(
            schema="handfast/configuration/1",
            hand=str(world.robot),
            object=str(world.body),
            joints=world.joints,
            object_pose=pose,
        )
    file = bundled.resolve("configurations", str(path))
    data = read_json(file, "configuration")
    try:
        return validate(Configuration, data)
    except InputError as fault:
        raise fault.at(str(path)) from None


def save_configuration(configuration: Configuration, path: str | Path, *, force: bool = False) -> None:
    """Write a configuration file; `InputError` if it exists, unless `force`, or cannot be written."""
    write_text(path, configuration.dumped(), force=force)
