"""Real hands, real objects: load, close, contacts and `check` under gravity from six sides.

Two hands (Barrett BH8-280, Allegro right) times six YCB objects. The poses are in `real_hands/`, one
`handfast/configuration/1` file per pair: the object's pose, the pre-shape, which joints close and the
preload. The poses are random trials about hand-written ones (60 to 750 per pair), chosen for three to five
contacts and then, among the few that were checked, for the most sides that hold. So the share of verdicts
that hold says how well the poses were chosen, not how often such hands hold: many of those checked failed
on every side. The preloads were chosen likewise: 0.5 N m was too little for the Barrett on the box and
the bottle. Masses are those published with the YCB object set; friction is 0.5 everywhere.

Preloads: 1 N m at the Barrett's proximal flexion joints, about
10 N at a fingertip; 0.2 N m at every flexion joint of the Allegro fingers that take part, of the banana's
only at the first one of each finger. Spreads, abductions and all other joints are locked: that no joint
can be driven back is the model's assumption, for both hands.

The Barrett URDF has no mimic joints: all eight joints are motors of their own. Its two variants here:
`paper`, the main one, is the stability paper's actuation: the three proximal flexion joints close and
are commanded, the distal joints stay where the pre-shape puts them and are locked. `motors` is the URDF
as it stands: the distal joints close too, and those stopped by a touch are commanded a third as much.

    python -m benchmarks.real_hands --shared ../shared --out reports --timeout 30
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from handfast import Settings, check, close, contact_grasp, load_body, load_configuration, load_hand
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand import Hand
from handfast.pictures import Entry, write_report
from handfast.pictures.drawing import picture
from handfast.pictures.grasp_picture import draw_grasp
from handfast.pictures.scene import Mesh, scene_meshes
from handfast.planning.closing import Closed
from handfast.stability.answers.check_query import CheckAnswer

HERE = Path(__file__).parent
POSES = HERE / "real_hands"
FRICTION = 0.5
MASSES = {  # [kg], published with the YCB object and model set
    "cracker_box": 0.411,
    "tomato_soup_can": 0.349,
    "mustard_bottle": 0.603,
    "banana": 0.066,
    "hammer": 0.665,
    "master_chef_can": 0.414,
}
HANDS = ("barrett", "allegro")
VARIANTS = {"barrett": ("paper", "motors"), "allegro": ("motors",)}  # the first is the main one
SIDES = {f"{sign}{axis}": float(f"{sign}1") * np.eye(3)[k] for k, axis in enumerate("xyz") for sign in "+-"}
DISTAL_SHARE = 1 / 3  # of the proximal command, in the variant `motors` of the Barrett hand
PICTURES = {  # in docs/img: pair, direction of gravity
    "real_barrett_mustard": ("barrett_mustard_bottle", "-z"),
    "real_allegro_can": ("allegro_master_chef_can", "-z"),
}


@dataclass(frozen=True, eq=False)
class Scenario:
    """A hand closed on an object."""

    pair: str
    variant: str
    hand: Hand
    body: Body
    pose: np.ndarray
    closed: Closed
    grasp: Grasp

    @property
    def meshes(self) -> list[Mesh]:
        return scene_meshes(self.hand, self.closed.q, self.body, self.pose)

    @property
    def fingers(self) -> int:
        """How many fingers, or the palm, touch: groups of links moved by the same first joint."""
        roots = {(self.hand.moved_by(self.hand.link(c.link)) or (-1,))[0] for c in self.closed.contacts}
        return len(roots)


@dataclass(frozen=True)
class Row:
    """One check."""

    gravity: str
    verdict: str
    stop: str
    seconds: float
    nodes: int
    residual: float | None


def pairs() -> Iterator[tuple[str, str]]:
    """Hand and object of every pair."""
    for hand in HANDS:
        for thing in MASSES:
            yield hand, thing


def motors(placed: Configuration, hand: Hand) -> Configuration:
    """The Barrett pose with the distal joints closing and commanded as motors of their own."""
    distal = [j for j in hand.joint_names if "dist" in j]
    command = dict(placed.preload or {})
    for j in distal:
        command[j] = DISTAL_SHARE * command[j.replace("dist", "med")]
    joints = {k: v for k, v in placed.joints.items() if k not in distal}
    closing = {k: v for k, v in (placed.closing or {}).items() if k not in distal}
    return placed.model_copy(update={"preload": command, "joints": joints, "closing": closing})


def prepare(shared: Path, hand_name: str, thing: str, variant: str | None = None) -> Scenario:
    """Load, pose and close. The preload keeps the actuators whose joints were stopped by a touch."""
    pair = f"{hand_name}_{thing}"
    variant = variant or VARIANTS[hand_name][0]
    placed = load_configuration(POSES / f"{pair}.json")
    hand = load_hand(shared / str(placed.hand))
    body = load_body(shared / str(placed.object), mass=MASSES[thing], friction=FRICTION)
    if hand_name == "barrett" and variant == "motors":
        placed = motors(placed, hand)
    hand, q0 = placed.applied(hand)
    closed = close(hand, q0, body, placed.pose)
    touched = {j for j, why in closed.stopped.items() if why.endswith("touches")}
    preload = {j: v for j, v in (placed.preload or {}).items() if j in touched}
    grasp = contact_grasp(hand, closed.q, body, placed.pose, preload=preload, name=f"{hand_name} on {thing}")
    return Scenario(pair, variant, hand, body, placed.pose, closed, grasp)


def six_sides(scene: Scenario, settings: Settings) -> dict[str, CheckAnswer]:
    """`check` with the object's weight along each axis of its frame, both ways."""
    return {side: check(scene.grasp, scene.body.gravity_wrench(d), settings=settings) for side, d in SIDES.items()}


def record(scene: Scenario, answers: dict[str, CheckAnswer]) -> dict[str, Any]:
    """What is kept of a pair."""
    rows = [
        Row(
            side,
            str(a.verdict),
            str(a.stop),
            round(a.seconds, 2),
            a.nodes,
            float(f"{a.witness.residuals.worst:.1e}") if a.witness else None,
        )
        for side, a in answers.items()
    ]
    return {
        "pair": scene.pair,
        "variant": scene.variant,
        "mass": scene.body.mass,
        "fingers": scene.fingers,
        "penetration_mm": round(1e3 * scene.closed.penetration, 4),
        "preload": {k: round(v, 4) for k, v in scene.grasp.preload.items()},
        "contacts": [
            {
                "link": c.link,
                "position": c.position.round(5).tolist(),
                "normal": (c.normal.round(4) + 0.0).tolist(),
                "depth_mm": round(1e3 * c.depth, 4),
            }
            for c in scene.grasp.contacts
        ],
        "checks": [asdict(r) for r in rows],
    }


def report(scene: Scenario, answers: dict[str, CheckAnswer], settings: Settings, folder: Path) -> None:
    """One page per pair and variant."""
    mass = scene.body.mass
    entries = [Entry(f"Does it hold {mass:g} kg when gravity pulls along {side}?", a) for side, a in answers.items()]
    notes = [f"Variant: {scene.variant}. Largest penetration: {1e3 * scene.closed.penetration:.3f} mm."]
    file = folder / f"{scene.pair}_{scene.variant}.html"
    write_report(file, scene.grasp, entries, settings=settings, meshes=scene.meshes, notes=notes, force=True)


def drawn(scene: Scenario, answer: CheckAnswer) -> bytes:
    """Hand, object and contact forces as a PNG, with the key in three columns so that it fits."""
    figure = draw_grasp(scene.grasp, answer.witness, scene.meshes)
    for key in list(figure.legends):
        handles, labels = key.legend_handles, [t.get_text() for t in key.get_texts()]
        key.remove()
        figure.legend(handles=handles, labels=labels, loc="lower center", ncols=3, frameon=False, fontsize=9)
    return picture(figure)


def machine() -> dict[str, Any]:
    """What the times belong to."""
    libraries = ["handfast", "numpy", "scipy", "mujoco", "trimesh"]
    return {
        "cores": os.cpu_count(),
        "architecture": platform.machine(),
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in libraries},
    }


def table(records: list[dict[str, Any]]) -> str:
    """The summary in Markdown."""
    head = ["pair", "variant", "contacts (fingers)", "penetration [mm]", *(f"gravity {s}" for s in SIDES), "seconds"]
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    for r in records:
        cells = [c["verdict"] if c["verdict"] != "undecided" else f"undecided ({c['stop']})" for c in r["checks"]]
        seconds = sum(c["seconds"] for c in r["checks"])
        shape = f"{len(r['contacts'])} ({r['fingers']})"
        line = [
            r["pair"].replace("_", " "),
            r["variant"],
            shape,
            f"{r['penetration_mm']:.3f}",
            *cells,
            f"{seconds:.1f}",
        ]
        lines.append("| " + " | ".join(line) + " |")
    return "\n".join(lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--shared", type=Path, default=HERE.parents[1] / "shared", help="folder with hands/ and objects/"
    )
    parser.add_argument("--out", type=Path, help="folder for one HTML report per pair and variant")
    parser.add_argument("--results", type=Path, help="JSON file for the numbers")
    parser.add_argument("--pictures", type=Path, help="folder for the pictures of the documentation")
    parser.add_argument("--timeout", type=float, default=30.0, metavar="S", help="per check [s]")
    parser.add_argument("--only", default="", metavar="TEXT", help="pairs whose name contains this")
    options = parser.parse_args()
    if not (options.shared / "hands").is_dir():
        print(f"{options.shared}: no folder hands/ in it; give --shared", file=sys.stderr)
        return 2
    settings = Settings(timeout=options.timeout)
    for folder in (options.out, options.pictures, options.results and options.results.parent):
        if folder:
            folder.mkdir(parents=True, exist_ok=True)
    records = []
    for hand, thing in pairs():
        if options.only not in f"{hand}_{thing}":
            continue
        for variant in VARIANTS[hand]:
            scene = prepare(options.shared, hand, thing, variant)
            print(f"{scene.pair} ({variant}): {scene.grasp.m} contacts", file=sys.stderr, flush=True)
            for c in scene.grasp.contacts:
                where = f"at {c.position.round(4)}, normal {c.normal.round(2)}, depth {1e3 * c.depth:.3f} mm"
                print(f"  {c.link} {where}", file=sys.stderr)
            answers = six_sides(scene, settings)
            records.append(record(scene, answers))
            verdicts = ", ".join(f"{side} {a.verdict} {a.seconds:.1f} s" for side, a in answers.items())
            print(f"  {verdicts}", file=sys.stderr, flush=True)
            if options.out:
                report(scene, answers, settings, options.out)
            for name, (pair, side) in PICTURES.items():
                if options.pictures and (pair, VARIANTS[hand][0]) == (scene.pair, variant):
                    (options.pictures / f"{name}.png").write_bytes(drawn(scene, answers[side]))
    if options.results:
        data = {
            "poses": "chosen among many for the most sides that hold, see real_hands.py: no success rate",
            "friction": FRICTION,
            "timeout": options.timeout,
            "machine": machine(),
            "rows": records,
        }
        options.results.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    print(table(records))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
