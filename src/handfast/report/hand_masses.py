"""Masses of a hand's links, as far as its file states them. Grasp stability does not need them, so `Hand` has none."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.errors import InputError
from handfast.core.limited import limited
from handfast.core.quiet import quiet
from handfast.model.hand.hand import Hand
from handfast.model.hand.urdf import parse_xml


def stated_masses(hand: Hand) -> dict[str, float]:
    """Masses [kg] by link, of the links for which the file behind `hand.source` states one; {} without a file.

    URDF: `inertial`. MJCF: `inertial`, or the masses of all geoms of the body; one that would follow from a density
    alone is not counted as stated.
    """
    if not os.path.isfile(hand.source):
        return {}
    try:
        root = parse_xml(Path(hand.source))
        found = limited(_of_mjcf, hand.source) if root.tag == "mujoco" else _of_urdf(root)
    except (InputError, ValueError):  # a hand that was read by other means: there is nothing to add
        return {}
    return {name: m for name, m in found.items() if name in hand.link_names and np.isfinite(m) and m >= 0}


def _of_urdf(root: Element) -> dict[str, float]:
    values = {e.get("name", ""): e.find("inertial/mass") for e in root.findall("link")}
    return {name: float(m.get("value", "nan")) for name, m in values.items() if m is not None}


def _of_mjcf(path: str) -> dict[str, float]:
    import mujoco  # slow to import

    try:
        with quiet():
            spec = mujoco.MjSpec.from_file(path)
    except (RuntimeError, mujoco.FatalError):  # as where there is no more memory
        return {}
    found = {}
    for body in spec.bodies:
        of_geoms = [g.mass for g in body.geoms]
        if body.explicitinertial:
            found[body.name] = float(body.mass)
        elif of_geoms and not np.isnan(of_geoms).any():
            found[body.name] = float(np.sum(of_geoms))
    return found
