"""A tendon hand, a body on four feet and a fixture: passive answers beside those of the classical computations.

    python -m benchmarks.other_bodies [--only tendon-block four-feet milling-fixture]

*Held constant*: the classical computation for motors that can be backdriven, or clamps at constant pressure: contact
forces inside their friction cones balance the load and the joint torques of the commands, J^T c = R^T f_c + A^T lambda
with f_c fixed, by a second-order cone program. Nothing says that these forces arise, so it is an upper bound of what
such a hand holds. Without joints it is the classical support region of a legged body: Bretl and Lall, *Testing static
equilibrium for legged robots*, IEEE T-RO 2008; Or and Rimon, *Computation and graphical characterization of robust
multiple-contact postures in two-dimensional gravitational environments*, IJRR 2006.

Passive answers are those of `maximum`, to 0.1 %, to 1 % in maps. Writes results/other_bodies.json, which
`docs/make_bodies_pictures.py` draws.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.machine import describe
from handfast.core.arrays import Array
from handfast.measures.conic_program import ConicProgram
from handfast.model.grasp import Contact, Grasp
from handfast.readers.grasp_file import load_grasp
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.maps import Curve
from handfast.stability.studies.questions import force_map, maximum

RESULTS = Path(__file__).parent / "results" / "other_bodies.json"
SETTINGS = Settings(gap=1e-3, timeout=20.0)
MOST = 1e5  # [N] or other multiples of a direction; more counts as without end
MAP_GAP = 1e-2
STEPS = 72  # directions of a map, rays of a region
DOWN = np.array([0.0, 0.0, -1.0])
LOADS = {
    "+y": (0, 1, 0, 0, 0, 0),
    "-y": (0, -1, 0, 0, 0, 0),
    "-x": (-1, 0, 0, 0, 0, 0),
    "-x, 30 mm towards +y": (-1, 0, 0, 0, 0, 0.03),
    "+z": (0, 0, 1, 0, 0, 0),
    "torque +z": (0, 0, 0, 0, 0, 1),
}  # of the tendon hand


def held_constant(grasp: Grasp, direction: object, base: object = None) -> float:
    """The largest multiple of a wrench beside a base load that forces in the cones balance at constant commands.

    Infinite beyond `MOST`; NaN if not even the base load, or less of it, is balanced.
    """
    p = ConicProgram(3 * grasp.m + 1 + len(grasp.mechanism.A))
    for i, mu in enumerate(grasp.mu):
        rows = np.zeros((3, p.n))
        rows[:, 3 * i : 3 * i + 3] = np.diag([mu, 1.0, 1.0])
        p.in_cone(rows)
        p.at_most(-np.eye(p.n)[3 * i : 3 * i + 1], np.zeros(1))
    scale = np.r_[np.ones(3), np.full(3, 1 / grasp.size)]
    couplings = grasp.mechanism.A.T
    d, w = np.asarray(direction, dtype=float), np.zeros(6) if base is None else np.asarray(base, dtype=float)
    p.equal(scale[:, None] * np.hstack([grasp.G, d[:, None], np.zeros((6, couplings.shape[1]))]), -scale * w)
    if grasp.l:
        lever = np.hstack([grasp.J.T, np.zeros((grasp.l, 1)), -couplings])
        p.equal(lever / grasp.size, grasp.mechanism.R.T @ grasp.command / grasp.size)
    cost = np.zeros(p.n)
    cost[3 * grasp.m] = -1.0
    p.at_most(-cost[None], np.full(1, MOST))
    x = p.solve(cost)
    if x is None:
        return np.nan
    return float(x[3 * grasp.m]) if x[3 * grasp.m] < 0.999 * MOST else np.inf


def own_motors(grasp: Grasp) -> Grasp:
    """The same hand with a motor at each joint, with the torques that the tendons' commands give."""
    torques = grasp.mechanism.R.T @ grasp.command
    names = [j.name for j in grasp.joints]
    preload = dict(zip(names, torques.tolist(), strict=True))
    return Grasp(grasp.contacts, grasp.joints, None, preload, f"{grasp.name}, own motors")


def bounds(grasp: Grasp, direction: object, base: object = None) -> list[float | None]:
    """Bounds of a passive maximum; None stands for no end."""
    found = maximum(grasp, direction, base=base, settings=SETTINGS)  # type: ignore[arg-type]
    return [None, None] if found.unbounded else [found.lower, ended(found.upper)]


def ended(x: float) -> float | None:
    """A number, None where there is no end."""
    return float(x) if np.isfinite(x) else None


def curve(found: Curve) -> list[float | None]:
    """Lower bounds over the directions; None stands for no end."""
    return [None if u else float(x) for u, x in zip(found.unbounded, found.lower, strict=True)]


def mapped(grasp: Grasp, plane: str) -> dict[str, Any]:
    """A map with and without preload, and held constant."""
    answer = force_map(grasp, plane, steps=STEPS, settings=replace(SETTINGS, gap=MAP_GAP))  # type: ignore[arg-type]
    assert answer.preloaded is not None
    constant = [ended(held_constant(grasp, np.r_[d, 0, 0, 0])) for d in answer.directions]
    return {
        "directions": answer.directions.tolist(),
        "preloaded": curve(answer.preloaded),
        "upper": [ended(x) for x in answer.preloaded.upper],
        "locked": curve(answer.passive),
        "constant": constant,
    }


def tendon_block() -> dict[str, Any]:
    """Largest loads of the tendon hand, and its map."""
    grasp = load_grasp("tendon-block")
    rows = {}
    for name, load in LOADS.items():
        passive = {"tendons": bounds(grasp, load), "no preload": bounds(grasp.with_preload(None), load)}
        rows[name] = passive | {
            "own motors": bounds(own_motors(grasp), load),
            "constant": ended(held_constant(grasp, load)),
        }
    return {"loads": rows, "map": mapped(grasp, "xy")}


def milling_fixture() -> dict[str, Any]:
    """Maps of cutting forces at half height and at the upper edge of the end that is not located."""
    grasp = load_grasp("milling-fixture")
    return {"xy": mapped(grasp, "xy"), "xz": mapped(grasp, "xz")}


# --- the body on four feet --------------------------------------------------------------------------


def weight_at(grasp: Grasp, x: float, y: float) -> Array:
    """(6,) the weight with the centre of mass above (x, y)."""
    force = (grasp.mass or 1.0) * 9.81 * DOWN
    return np.r_[force, np.cross([x, y, 0.0], force)]


def tilted(slope: float, towards: float) -> Array:
    """(3,) the normal of ground that falls by `slope` towards an azimuth [degrees]."""
    s, a = np.radians([slope, towards])
    return np.array([np.sin(s) * np.cos(a), np.sin(s) * np.sin(a), np.cos(s)])


def rough() -> Grasp:
    """Four feet on four stones, one of them steep."""
    feet = [
        Contact([-0.3, -0.2, 0.0], tilted(20, 60), 0.5, "hind_right"),
        Contact([-0.3, 0.2, 0.05], tilted(15, -40), 0.5, "hind_left"),
        Contact([0.3, -0.2, 0.1], tilted(70, 170), 0.5, "fore_right"),
        Contact([0.3, 0.2, -0.03], tilted(30, -135), 0.5, "fore_left"),
    ]
    return Grasp(feet, name="four feet on rough ground", mass=20.0, center_of_mass=[0, 0, 0.4])


def ray(grasp: Grasp, centre: tuple[float, float], angle: float) -> dict[str, Any]:
    """How far [m] the centre of mass may go from `centre`, classically and passively; `centre` itself is held."""
    u = np.array([np.cos(angle), np.sin(angle)])
    base = weight_at(grasp, *centre)
    step = weight_at(grasp, *(centre + u)) - base
    return {"classical": ended(held_constant(grasp, step, base)), "passive": bounds(grasp, step, base)}


def region(grasp: Grasp, centre: tuple[float, float]) -> dict[str, Any]:
    """The support region, as rays from a point inside it."""
    angles = 2 * np.pi * np.arange(STEPS) / STEPS
    rays = [ray(grasp, centre, a) for a in angles]
    feet = [c.position[:2].tolist() for c in grasp.contacts]
    return {"centre": centre, "feet": feet, "angles": angles.tolist(), "rays": rays}


def four_feet() -> dict[str, Any]:
    return {"step": region(load_grasp("four-feet"), (-0.2, 0.0)), "rough": region(rough(), (0.0, 0.0))}


PARTS = {"tendon-block": tendon_block, "four-feet": four_feet, "milling-fixture": milling_fixture}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=list(PARTS), choices=list(PARTS))
    for name in parser.parse_args().only:
        start = time.monotonic()
        found = PARTS[name]()
        data = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
        data |= {"machine": describe(), name: found}
        RESULTS.write_text(json.dumps(data, indent=1) + "\n")
        print(f"{name}: {time.monotonic() - start:.0f} s", flush=True)


if __name__ == "__main__":
    main()
