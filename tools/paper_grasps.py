"""Make the bundled grasps of the stability paper's figures: objects, configurations, contact-level files.

    python tools/paper_grasps.py [--check]

The authors published no files, so each figure is rebuilt with the bundled Barrett hand from what the
paper says of it. Writes src/handfast/data/{objects,configurations,grasps}; `--check` writes nothing and
fails if a file would change.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import fsolve
from scipy.spatial.transform import Rotation

from handfast.core.arrays import Array
from handfast.core.files import same_json
from handfast.geometry.contacts import contact_grasp
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.hand import Hand
from handfast.planning.closing import close
from handfast.readers.grasp_file import file_dict
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

DATA = Path(__file__).parents[1] / "src" / "handfast" / "data"
HAND = "barrett-bh8-280"
PALM = 0.0754  # [m] height of the proximal joints above the palm frame
TIP = np.array([0.0371572, 0.0, 0.0334565])  # fingertip centre in the distal frame
TIP_RADIUS = 0.008
JOINT = 0.075  # [m] fingers 1 and 2 spread by 90 degrees: proximal joints from the middle
PAD = 0.013  # [m] the proximal link's palmar face above its joint axis
# object axes in the palm frame: y away from the palm, x across it, z = x cross y
UPRIGHT = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
OPPOSED = np.array([[-1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]])  # z is the palm's y
ALONG_Y = Rotation.from_euler("x", -90, degrees=True).as_matrix()  # shape z axis to object y axis


def solve_finger(conditions: Callable[[float, float], list[float]]) -> tuple[float, float]:
    """Proximal and distal angles at which both conditions vanish."""
    found, _, status, _ = fsolve(lambda a: conditions(*a), [0.85, 0.6], full_output=True, xtol=1e-13)
    if status != 1:
        raise RuntimeError("the finger cannot reach")
    return float(found[0]), float(found[1])


def tip(hand: Hand, k: int, prox: float, dist: float) -> Array:
    """Fingertip centre: distance from the finger's proximal joint outwards, and height above it [m]."""
    q = hand.configuration({f"finger_{k}_prox": prox, f"finger_{k}_dist": dist})
    poses = hand.link_poses(q)
    to_joint = np.linalg.inv(poses[hand.link(f"finger_{k}_prox")])
    p = poses[hand.link(f"finger_{k}_dist")] @ np.r_[TIP, 1.0]
    local = (to_joint @ p)[:3]
    c, s = np.cos(prox), np.sin(prox)
    return np.array([c * local[0] - s * local[2], s * local[0] + c * local[2]])


def pose(R: Array, position: list[float]) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, position
    return T


# --- Figs 1 and 7: a jar with a flange, two opposed fingers, off the middle by a hair or visibly -----
# The tips meet the neck 78 mm, the proximal links the flange 97.6 mm from the axis: then the moment arm
# of a sliding tip about its proximal joint, height minus mu times offset, is the paper's 90 mm.

NECK, FLANGE, RIM = 0.078, 0.0976, 0.0464  # radii; height of the flange's lower rim above the joints
LEVEL = 0.0933  # [m] height of the object's origin above the joints: level with the tips when centred
HAIR, VISIBLE = 0.0005, 0.012  # [m] how far the jar is off the middle in Fig. 1 and Fig. 7


def jar() -> dict[str, Any]:
    upright = Rotation.from_matrix(ALONG_Y).as_quat(canonical=True, scalar_first=True).round(12).tolist()

    def disc(radius: float, length: float) -> dict[str, Any]:
        centre = [0, round(RIM - LEVEL + length / 2, 6), 0]
        return {
            "cylinder": {"radius": radius, "length": length},
            "pose": {"position": centre, "quaternion": upright},
        }

    return body([disc(NECK, 0.1), disc(FLANGE, 0.012)], mass=0.4, friction=1.0)


def jar_held(hand: Hand, shift: float) -> tuple[dict[str, float], Array]:
    """The jar `shift` [m] off the middle towards finger 1; each finger meets neck and flange where they are."""
    joints = {"finger_1_spread": np.pi / 2, "finger_2_spread": np.pi / 2}
    for k, side in ((1, 1.0), (2, -1.0)):

        def conditions(prox: float, dist: float, side: float = side, k: int = k) -> list[float]:
            out = FLANGE + side * shift - JOINT
            off = -np.sin(prox) * out + np.cos(prox) * RIM - PAD
            return [off, tip(hand, k, prox, dist)[0] - (NECK + side * shift + TIP_RADIUS - JOINT)]

        joints[f"finger_{k}_prox"], joints[f"finger_{k}_dist"] = solve_finger(conditions)
    joints |= {"finger_3_prox": 0.0, "finger_3_dist": 0.0}
    return joints, pose(UPRIGHT, [shift, 0, PALM + LEVEL])


# --- Fig. 11: three fingertips in a plane, all moment arms alike ---------------------------------------


def slab_held(hand: Hand) -> tuple[dict[str, float], dict[str, Any], Array]:
    """Each tip touches right above its proximal joint, so friction has no moment about the joint."""
    prox = np.radians(50.0)
    _, dist = solve_finger(lambda p, d: [p - prox, tip(hand, 1, p, d)[0] - TIP_RADIUS])
    joints = {"finger_1_spread": np.pi / 2, "finger_2_spread": np.pi / 2}
    for k in (1, 2, 3):
        joints |= {f"finger_{k}_prox": prox, f"finger_{k}_dist": dist}
    size = [2 * JOINT, 0.05, 2 * 0.05]  # joints 75 mm from the middle, that of finger 3 50 mm
    slab = body([{"box": {"size": size}}], mass=0.3, friction=0.45)
    return joints, slab, pose(OPPOSED, [0, 0, PALM + float(tip(hand, 1, prox, dist)[1])])


# --- Fig. 9: a flask in three fingers, closed as a gripper closes ---------------------------------------

PROFILE = ((0.040, -0.055), (0.040, -0.030), (0.017, 0.045), (0.017, 0.085))  # radius and height [m]
ACROSS = np.array([[0, 1.0, 0], [0, 0, 1.0], [1.0, 0, 0]])  # the flask's axis y lies along the palm's x


def flask_mesh(sides: int = 40) -> str:
    """The flask as an OBJ of three convex pieces."""
    angle = 2 * np.pi * (np.arange(sides) + 0.5) / sides
    lines, first = ["# Handfast: a flask of three convex pieces, metres, axis y"], 1
    for piece, (low, high) in enumerate(pairwise(PROFILE)):
        lines.append(f"o piece_{piece + 1}")
        for radius, y in (low, high):
            lines += [f"v {radius * np.cos(a):.6f} {y:.6f} {radius * np.sin(a):.6f}" for a in angle]
        for i in range(sides):
            a, b = first + i, first + (i + 1) % sides
            lines += [f"f {a} {a + sides} {b + sides}", f"f {a} {b + sides} {b}"]
        for i in range(1, sides - 1):
            lines.append(f"f {first} {first + i} {first + i + 1}")
            top = first + sides
            lines.append(f"f {top} {top + i + 1} {top + i}")
        first += 2 * sides
    return "\n".join(lines) + "\n"


def flask_held(hand: Hand, flask: Body) -> tuple[dict[str, float], Array]:
    where = pose(ACROSS, [-0.010, -0.020, 0.130])
    closed = close(hand, hand.configuration({"finger_1_spread": 0.0}), flask, where)
    return hand.values(closed.q), where


# --- writing ---------------------------------------------------------------------------------------------


def body(shapes: list[dict[str, Any]], mass: float, friction: float) -> dict[str, Any]:
    return {"schema": "handfast/body/1", "shapes": shapes, "mass": mass, "friction": friction}


class Writer:
    """Writes a text into the data folder, or only compares."""

    def __init__(self, check: bool) -> None:
        self.check, self.stale = check, list[str]()

    def __call__(self, path: str, text: str) -> None:
        target = DATA / path
        if self.check:
            # another processor rounds the last digit otherwise
            if not target.exists() or not _same(target.read_text("utf-8"), text):
                self.stale.append(path)
        else:
            target.write_text(text, "utf-8")


def _same(old: str, new: str) -> bool:
    """The same text, or JSON whose numbers agree to 1e-9."""
    try:
        return old == new or same_json(json.loads(old), json.loads(new))
    except ValueError:
        return False


def main(check: bool) -> int:
    write = Writer(check)
    hand = load_hand(HAND)
    held, slab, slab_pose = slab_held(hand)
    write("objects/jar.json", dumped(jar()))
    write("objects/slab.json", dumped(slab))
    write("objects/flask.obj", flask_mesh())
    flask = {"schema": "handfast/body/1", "mesh": "flask.obj", "mass": 0.3, "friction": 1.0}
    write("objects/flask.json", dumped(flask))

    two = {"finger_1_prox": 0.1, "finger_2_prox": 0.1}
    three = two | {"finger_3_prox": 0.1}
    figures = {
        "fig1": ("jar", *jar_held(hand, HAIR), two),
        "fig7": ("jar", *jar_held(hand, VISIBLE), two),
        "fig9": ("flask", *flask_held(hand, load_body("flask")), three),
        "fig11": ("slab", held, slab_pose, two),
    }
    for name, (thing, joints, where, preload) in figures.items():
        configuration = Configuration.of(
            hand, hand.configuration(joints), where, hand=HAND, object=thing, preload=preload
        )
        write(f"configurations/{name}.json", configuration.dumped())
        _, q = configuration.applied(hand)
        # "direct" is the paper's actuation: a motor on every joint, the distal ones locked
        for suffix, mechanism in (("", "direct"), ("-coupled", "hand")):
            grasp = contact_grasp(
                hand,
                q,
                load_body(thing),
                configuration.pose,
                preload=preload,
                mechanism=mechanism,  # type: ignore[arg-type]
                laws="none",  # the paper's joints have motors alone
                name=name + suffix,
            )
            grasp = grasp.from_configuration(name)
            write(f"grasps/{name}{suffix}.json", json.dumps(file_dict(grasp), indent=1) + "\n")
    for path in write.stale:
        print(f"stale: {path}")
    return 1 if write.stale else 0


def dumped(data: dict[str, Any]) -> str:
    return json.dumps(data, indent=2) + "\n"


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
