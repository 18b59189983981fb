"""Plan the twelve bundled Barrett grasps, and draw them.

    python docs/make_twelve.py [--check | --picture] [--only OBJECT ...]

Twelve grasps of `barrett-bh8-280` on differently shaped objects, with as many contacts as those of the stability
paper's Fig. 13: four with three contacts, five with four, one with five, two with six. Each object is planned
for with a fixed seed and a fixed number of attempts; among the distinct grasps that hold the object's weight from
all six axis directions, touch with all three fingers at the wanted number of contacts, and whose preload squeezes
with at least two actuators, the one with the smallest largest command is taken. So they are good among many, not
typical. The hand approaches along the line from the middle of its palm to that of its half-closed fingertips: the
planner's own guess when these grasps were first planned, before it asked for the face of the palm. It is kept, as the
questions of Table II (benchmarks/table2.py) are about these very grasps.

Writes src/handfast/data/{configurations,grasps}/barrett-OBJECT.json and docs/img/twelve.png; `--check` only
compares what it plans with the files that are there, `--picture` only draws them.
"""

from __future__ import annotations

import argparse
import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from handfast import Settings, load_body, load_configuration, load_grasp, load_hand
from handfast.core.arrays import Array
from handfast.core.files import write_bytes
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand import Hand
from handfast.pictures.camera import View
from handfast.pictures.drawing import picture
from handfast.pictures.scene import scene_meshes
from handfast.planning.candidates.palm_poses import Sampling, palm_of
from handfast.planning.evaluation.attempt import PlannedGrasp
from handfast.planning.plan_grasps import plan
from handfast.planning.question import PlanLimits
from handfast.planning.results.plan import Plan
from handfast.readers.configuration_file import save_configuration
from handfast.readers.grasp_file import save_grasp

HAND = "barrett-bh8-280"
CONTACTS = {  # object: contacts, in the order of Fig. 13's letters
    "ball": 3,
    "can": 3,
    "mug": 3,
    "pear": 3,
    "block": 4,
    "egg": 4,
    "dumbbell": 4,
    "wedge": 4,
    "mallet": 4,
    "ring": 5,
    "bottle": 6,
    "torch": 6,
}
ATTEMPTS = 300  # per object
SEED = 0
SAMPLING = Sampling(aligned=0.0, central=0.0)
SETTINGS = Settings(nodes=4000)
COLUMNS = 4
SAME = 1e-6  # [rad], and [m] of the pose
SAME_PRELOAD = 1e-2  # relative: the gap to which `hold` looks for it
HAND_COLOR, OBJECT_COLOR = np.array([0.62, 0.67, 0.73]), np.array([0.93, 0.76, 0.48])
ROOT = Path(__file__).parents[1]
DATA = ROOT / "src" / "handfast" / "data"
IMAGE = ROOT / "docs" / "img" / "twelve.png"


def suits(held: PlannedGrasp, contacts: int) -> bool:
    """As many contacts as wanted, on all three fingers, and at least two actuators that squeeze."""
    fingers = {c.link.split("_")[1] for c in held.grasp.contacts if c.link.startswith("finger")}
    return held.grasp.m == contacts and len(fingers) == 3 and len(held.grasp.preload) >= 2


def chosen(planned: Plan, contacts: int) -> PlannedGrasp | None:
    """The suitable grasp with the smallest largest command; the first of equals."""
    fitting = [g for g in planned.grasps if suits(g, contacts)]
    return min(fitting, key=lambda g: g.answer.upper, default=None)


def from_palm_to_fingertips(hand: Hand) -> Array:
    """(3,) the way the hand approaches, base frame."""
    palm = palm_of(hand)
    return np.asarray(palm.center - palm.anatomy.middles(palm.opened, palm.anatomy.palm).mean(axis=0))


def made(name: str, contacts: int) -> tuple[PlannedGrasp, Configuration]:
    """The grasp of an object, planned, and its configuration file.

    Raises:
        LookupError: none suits.
    """
    hand, body = load_hand(HAND).with_laws("none"), load_body(name)  # as in the paper: motors alone
    effort = {"count": ATTEMPTS, "attempts": ATTEMPTS, "timeout": 3600}
    sampling = replace(SAMPLING, approach=tuple(from_palm_to_fingertips(hand)))
    planned = plan(hand, body, seed=SEED, limits=PlanLimits(settings=SETTINGS), sampling=sampling, **effort)
    counts = sorted(g.grasp.m for g in planned.grasps)
    print(f"{name}: {len(counts)} of {planned.tried} in {planned.seconds:.0f} s, contacts {counts}", file=sys.stderr)
    held = chosen(planned, contacts)
    if held is None:
        raise LookupError(f"{name}: no suitable grasp with {contacts} contacts")
    placed = Configuration.of(hand, held.q, held.pose, hand=HAND, object=name, preload=held.grasp.preload)
    return held, placed


def alike(one: Configuration, other: Configuration) -> bool:
    """The same configuration and preload, up to what another machine's rounding may change."""
    if one.joints.keys() != other.joints.keys() or (one.preload or {}).keys() != (other.preload or {}).keys():
        return False
    joints = [abs(one.joints[n] - other.joints[n]) for n in one.joints]
    preload = [abs(v / (other.preload or {})[n] - 1) for n, v in (one.preload or {}).items()]
    return max(joints) < SAME and np.abs(one.pose - other.pose).max() < SAME and max(preload) < SAME_PRELOAD


def best_view(grasp: Grasp, forward: Array) -> View:
    """From where the contacts lie farthest apart in the picture, not from behind the palm, which looks `forward`."""
    points = np.array([c.position for c in grasp.contacts])

    def spread(view: View) -> float:
        flat = points @ view.matrix[:2].T
        apart = np.linalg.norm(flat[:, None] - flat[None], axis=2)
        return float(apart[np.triu_indices(len(flat), 1)].min())

    sides = [View.of(a, e, "") for a in range(0, 360, 15) for e in (-30, -15, 15, 30, 45)]
    return max((v for v in sides if v.matrix[2] @ forward > 0.2 * np.linalg.norm(forward)), key=spread)


def panel(ax: Any, name: str) -> None:
    """One stored grasp: solids, contacts as dots with their normals."""
    placed = load_configuration(f"barrett-{name}")
    hand, q = placed.applied(load_hand(HAND))
    grasp = load_grasp(f"barrett-{name}")
    body = load_body(name)
    palm = np.linalg.inv(placed.pose)[:3, 3]
    V = best_view(grasp, body.center_of_mass - palm).matrix
    corners, colors = [], []
    for mesh in scene_meshes(hand, q, body, placed.pose):
        triangles = mesh.vertices[mesh.faces] @ V.T
        normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        length = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        light = 0.55 + 0.45 * np.abs(normal / length @ np.array([0.25, 0.35, 0.9]))
        color = OBJECT_COLOR if mesh.kind == "object" else HAND_COLOR
        corners.append(triangles)
        colors.append(np.column_stack([light[:, None] * color, np.full(len(light), 0.85)]))
    triangles, shade = np.vstack(corners), np.vstack(colors)
    order = np.argsort(triangles[:, :, 2].mean(axis=1))
    ax.add_collection(PolyCollection(list(triangles[order][:, :, :2]), fc=shade[order], ec="none", rasterized=True))
    for c in grasp.contacts:
        at, step = V[:2] @ c.position, 0.03 * V[:2] @ c.normal
        ax.plot(*np.array([at - step, at]).T, color="#8c1d40", lw=1.6, zorder=3)
        ax.plot(*at, "o", ms=5, color="#8c1d40", mec="white", mew=0.8, zorder=4)
    seen = triangles[:, :, :2].reshape(-1, 2)
    middle, half = (seen.min(0) + seen.max(0)) / 2, 0.52 * np.ptp(seen, axis=0).max()
    ax.set(xlim=middle[0] + np.array([-half, half]), ylim=middle[1] + np.array([-half, half]), aspect="equal")
    ax.axis("off")
    ax.set_title(f"{name}, {grasp.m} contacts", fontsize=10)


def drawn() -> bytes:
    """All twelve as a PNG."""
    rows = -(-len(CONTACTS) // COLUMNS)
    figure = Figure(figsize=(2.6 * COLUMNS, 2.8 * rows), dpi=80)
    for k, name in enumerate(CONTACTS):
        panel(figure.add_subplot(rows, COLUMNS, k + 1), name)
    figure.tight_layout(pad=0.4)
    few = Image.open(io.BytesIO(picture(figure, dpi=100))).convert("RGB").quantize(64)  # a third of the size
    out = io.BytesIO()
    few.save(out, "PNG", optimize=True)
    return out.getvalue()


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare with the stored files, write nothing")
    parser.add_argument("--picture", action="store_true", help="draw the stored files, plan nothing")
    parser.add_argument("--only", nargs="*", default=[], metavar="OBJECT")
    asked = parser.parse_args()
    wrong = 0
    if asked.picture:
        write_bytes(IMAGE, drawn(), force=True)
        return 0
    for name, contacts in CONTACTS.items():
        if asked.only and name not in asked.only:
            continue
        try:
            held, placed = made(name, contacts)
        except LookupError as fault:
            print(fault, file=sys.stderr)
            wrong += 1
            continue
        g = held.grasp
        grasp = Grasp(g.contacts, g.joints, g.mechanism, g.command, f"barrett-{name}")
        grasp = grasp.about(mass=g.mass, center_of_mass=g.center_of_mass, provenance=g.provenance)
        files = DATA / "configurations" / f"barrett-{name}.json", DATA / "grasps" / f"barrett-{name}.json"
        if asked.check:
            same = alike(placed, load_configuration(files[0]))
            print(f"{name}: {'as stored' if same else 'differs from the stored file'}", flush=True)
            wrong += not same
        else:
            save_configuration(placed, files[0], force=True)
            save_grasp(grasp.from_configuration(f"barrett-{name}"), files[1], force=True)
            print(f"{name}: {grasp.m} contacts, preload {grasp.preload}", flush=True)
    if not asked.check and not wrong:
        write_bytes(IMAGE, drawn(), force=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
