"""Make the bundled grasps of the stability paper's figures: objects, configurations, contact-level files.

    python tools/paper_grasps.py [--check]

The authors published no files, so each figure is rebuilt with the bundled Barrett hand from what the
paper says of it. Writes src/holdfast/data/{objects,configurations,grasps}; `--check` writes nothing and
fails if a file would change.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from holdfast.body import load_body
from holdfast.configuration import Configuration
from holdfast.contacts import contact_grasp
from holdfast.grasp_file import to_dict
from holdfast.hand import load_hand
from holdfast.planning.close import close

DATA = Path(__file__).parents[1] / "src" / "holdfast" / "data"
HAND = "barrett-bh8-280"
PALM = 0.0754  # [m] height of the proximal joints above the palm frame
TIP = np.array([0.0371572, 0.0, 0.0334565])  # fingertip centre in the distal frame
TIP_RADIUS = 0.008
PAD = 0.013  # [m] the proximal link's palmar face above its joint axis
# object axes in the palm frame: y away from the palm, x across it, z = x cross y
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
OPPOSED = np.array([[-1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])  # z is the palm's y
ALONG_Y = Rotation.from_euler("x", -90, degrees=True).as_matrix()  # shape z axis to object y axis


def finger(hand: Any, k: int, spread: float, conditions: Callable[[float, float], list[float]]) -> tuple[float, float]:
    """Proximal and distal angles at which both conditions vanish."""
    found, _, status, _ = fsolve(lambda a: conditions(*a), [0.85, 0.6], full_output=True, xtol=1e-13)
    if status != 1:
        raise RuntimeError(f"finger {k} cannot reach")
    return float(found[0]), float(found[1])


def tip(hand: Any, k: int, spread: float, prox: float, dist: float) -> np.ndarray:
    """Fingertip centre: distance from the finger's proximal joint outwards, and height above it [m]."""
    names = {"finger_1_spread": spread} if k < 3 else {}
    q = hand.configuration({**names, f"finger_{k}_prox": prox, f"finger_{k}_dist": dist})
    poses = hand.link_poses(q)
    to_joint = np.linalg.inv(poses[hand.link(f"finger_{k}_prox")])
    p = poses[hand.link(f"finger_{k}_dist")] @ np.r_[TIP, 1.0]
    local = (to_joint @ p)[:3]
    c, s = np.cos(prox), np.sin(prox)
    return np.array([c * local[0] - s * local[2], s * local[0] + c * local[2]])


# --- Figs 1 and 7: a jar with a flange, two opposed fingers, off-centre by a hair or visibly -------

JAR = {"neck": 0.078, "flange": 0.0976, "height": 0.0464}  # radii; height of the flange's lower rim


def jar_object() -> dict[str, Any]:
    low = JAR["height"] - 0.0944  # of the lower rim, object frame: the origin is level with the fingertips
    quaternion = Rotation.from_matrix(ALONG_Y).as_quat(canonical=True, scalar_first=True).tolist()
    return {
        "schema": "holdfast/body/1",
        "shapes": [
            {
                "cylinder": {"radius": JAR["neck"], "length": 0.100},
                "pose": {"position": [0, low + 0.050, 0], "quaternion": quaternion},
            },
            {
                "cylinder": {"radius": JAR["flange"], "length": 0.012},
                "pose": {"position": [0, low + 0.006, 0], "quaternion": quaternion},
            },
        ],
        "mass": 0.4,
        "friction": 1.0,
    }


def jar(hand: Any, shift: float) -> dict[str, Any]:
    """The jar `shift` [m] off the middle towards finger 1: each finger finds neck and flange where they are."""
    joints: dict[str, float] = {"finger_1_spread": np.pi / 2, "finger_2_spread": np.pi / 2}
    for k, side in ((1, 1.0), (2, -1.0)):

        def conditions(prox: float, dist: float, side: float = side, k: int = k) -> list[float]:
            rim = np.array([JAR["flange"] + side * shift - 0.075, JAR["height"]])
            off = -np.sin(prox) * rim[0] + np.cos(prox) * rim[1] - PAD
            reach = tip(hand, k, np.pi / 2, prox, dist)[0] - (JAR["neck"] + side * shift + TIP_RADIUS - 0.075)
            return [off, reach]

        joints[f"finger_{k}_prox"], joints[f"finger_{k}_dist"] = finger(hand, k, np.pi / 2, conditions)
    joints["finger_3_prox"] = joints["finger_3_dist"] = 0.0
    return joints


if __name__ == "__main__":
    hand = load_hand(HAND)
    Path("/tmp/jar.json").write_text(json.dumps(jar_object()))
    body = load_body("/tmp/jar.json")
    for shift in (0.0, 1e-4, 2e-4, 5e-4, 2e-3, 4e-3):
        j = jar(hand, shift)
        t = [tip(hand, k, np.pi / 2, j[f"finger_{k}_prox"], j[f"finger_{k}_dist"]) for k in (1, 2)]
        print(shift, {k: round(v, 4) for k, v in j.items()}, t)
        T = np.eye(4)
        T[:3, :3] = UPRIGHT
        T[:3, 3] = [shift, 0, PALM + 0.0944]
        g = contact_grasp(hand, hand.configuration(j), body, T, mechanism="direct")
        for c in g.contacts:
            print("  ", c.link, np.round(c.position, 5), np.round(c.normal, 4), round(c.depth, 6))
        print([x.name for x in g.joints])
