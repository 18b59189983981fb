"""The configuration file: round trip, application to a hand, refusals, no silent overwriting."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.model.configuration import Configuration
from handfast.readers.configuration_file import load_configuration, save_configuration
from handfast.readers.load_hand import load_hand


def write(path: Path, **fields: object) -> Path:
    path.write_text(json.dumps({"schema": "handfast/configuration/1", **fields}))
    return path


def test_round_trip(tmp_path: Path) -> None:
    hand = load_hand("barrett-bh8-280")
    q = hand.configuration({"finger_1_prox": 0.7, "finger_1_spread": 0.2, "finger_2_dist": 0.8})
    pose = transform([0.01, -0.02, 0.15], quaternion_matrix([0.1, -0.7, 0.3, 0.2]))
    written = Configuration.of(hand, q, pose, hand="barrett-bh8-280", preload={"finger_1_prox": 0.1})
    save_configuration(written, tmp_path / "c.json")
    read = load_configuration(tmp_path / "c.json")
    assert read == written
    same, q_read = read.applied(hand)
    np.testing.assert_array_equal(q_read, q)
    assert same is hand
    np.testing.assert_allclose(read.pose, pose, atol=1e-12)
    assert read.preload == {"finger_1_prox": 0.1}
    assert "closing" not in json.loads((tmp_path / "c.json").read_text())


def test_closing_senses_are_applied(tmp_path: Path) -> None:
    path = write(tmp_path / "c.json", closing={"finger_1_spread": -1}, joints={"finger_1_prox": 0.3})
    hand, q = load_configuration(path).applied(load_hand("barrett-bh8-280"))
    assert hand.closing[hand.joint("finger_1_spread")] == -1
    assert hand.closing[hand.joint("finger_2_spread")] == -1  # coupled
    assert hand.values(q)["finger_1_dist"] == pytest.approx(0.1)


def test_never_overwrites_silently(tmp_path: Path) -> None:
    hand = load_hand("parallel-gripper")
    first = Configuration.of(hand, hand.configuration(), np.eye(4))
    save_configuration(first, tmp_path / "c.json")
    with pytest.raises(InputError, match=r"c.json: exists already"):
        save_configuration(first, tmp_path / "c.json")
    save_configuration(first, tmp_path / "c.json", force=True)
    with pytest.raises(InputError, match=r"cannot be written"):
        save_configuration(first, tmp_path / "c.json" / "c.json")  # a file where a folder is needed


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"joint": {}}, r"c.json: joint: is not a known field"),
        ({"joints": {"a": "x"}}, r"c.json: joints.a: input should be a valid number"),
        ({"joints": {"a": float("nan")}}, r"c.json: .*NaN.*finite numbers"),
        ({"schema": "handfast/grasp/1"}, r"c.json: schema: input should be 'handfast/configuration/1'"),
        ({"object_pose": {"quaternion": [2, 0, 0, 0]}}, r"object_pose: quaternion has length 2"),
        ({"object_pose": {"position": [0, 0]}}, r"object_pose.position\[2\]: is missing"),
        ({"closing": {"a": 2}}, r"closing.a: input should be less than or equal to 1"),
    ],
)
def test_refusals(tmp_path: Path, fields: dict, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        load_configuration(write(tmp_path / "c.json", **fields))
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone.json: no such file"):
        load_configuration(tmp_path / "gone.json")
    (tmp_path / "c.json").write_text("{")
    with pytest.raises(InputError, match=r"c.json: is not valid JSON"):
        load_configuration(tmp_path / "c.json")
    (tmp_path / "c.json").write_text("{}")
    with pytest.raises(InputError, match=r"c.json: schema: is missing"):
        load_configuration(tmp_path / "c.json")
