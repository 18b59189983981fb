"""Make the bundled grasps that are not of a common hand: a tendon hand, a fixture for milling, a body on four feet.

    python tools/body_grasps.py [--check]

Hands, objects and configurations are written by hand; this finds the contacts, rounds them to a nanometre, so that
what is symmetrical in the model is so in the file, and writes src/handfast/data/grasps. `--check` writes nothing and
fails if a file would change.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handfast.geometry.contacts import contact_grasp
from handfast.model.grasp import Grasp
from handfast.readers.configuration_file import load_configuration
from handfast.readers.grasp_file import load_grasp, save_grasp
from handfast.readers.load_body import load_body
from handfast.readers.load_hand import load_hand

DATA = Path(__file__).parents[1] / "src" / "handfast" / "data" / "grasps"
NAMES = ("tendon-block", "milling-fixture", "four-feet")
DIGITS = 9


def clean(values: Any) -> Any:
    """Rounded, and no −0."""
    return np.round(values, DIGITS) + 0.0


def made(name: str) -> Grasp:
    """The grasp of a bundled configuration."""
    placed = load_configuration(name)
    hand, q = placed.applied(load_hand(placed.hand or ""))
    found = contact_grasp(hand, q, load_body(placed.object or ""), placed.pose, preload=placed.preload)
    contacts = [replace(c, position=clean(c.position), normal=clean(c.normal), depth=0.0) for c in found.contacts]
    joints = [replace(j, axis=clean(j.axis), origin=clean(j.origin)) for j in found.joints]
    grasp = Grasp(contacts, joints, found.mechanism, found.command, name)
    grasp = grasp.about(mass=found.mass, center_of_mass=found.center_of_mass, provenance=found.provenance)
    return grasp.from_configuration(name)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare with the stored files, write nothing")
    check, wrong = parser.parse_args().check, 0
    for name in NAMES:
        grasp, path = made(name), DATA / f"{name}.json"
        if check:
            stored = load_grasp(name)
            same = np.array_equal(grasp.G, stored.G) and np.array_equal(grasp.J, stored.J)
            print(f"{name}: {'as stored' if same else 'differs from the stored file'}")
            wrong += not same
        else:
            save_grasp(grasp, path, force=True)
            print(f"{name}: {grasp.m} contacts")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
