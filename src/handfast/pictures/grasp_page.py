"""The page about a grasp: in three dimensions, with its loads, torques, proofs, and a map of what else it holds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handfast.pictures import Entry, words, write_report
from handfast.pictures.scene import scene_meshes
from handfast.pictures.words import num
from handfast.planning.results.grasps import Grasps
from handfast.stability.maps import PLANES, Plane, force_map
from handfast.stability.settings import Settings

STEPS = 48  # directions of the map
NODES = 400  # of the search for each of them: a picture, its open directions are drawn as such


def report_grasp(path: str | Path, answer: Grasps, which: int = 0, *, force: bool = False) -> None:
    """Write a self-contained page about one of the grasps.

    Args:
        which: index into `answer.grasps`.

    Raises:
        InputError: the file exists and `force` is not set, or cannot be written.
    """
    g, body = answer.grasps[which], answer.body
    settings = Settings(node_limit=NODES)
    entries = [Entry(f"Does it hold “{name}”?", a) for name, a in zip(answer.loads.names, g.answer.checks, strict=True)]
    weight = None if body.mass is None else 9.81 * body.mass
    whole = force_map(g.grasp, plane_of(answer), steps=STEPS, at=body.center_of_mass, settings=settings)
    title = f"Which forces at the centre of mass does it hold, in the {whole.plane} plane?"
    entries.append(Entry(title, whole, weight=weight))
    notes = [
        "The configuration exists: a box around it was proved to contain an exact one. Every load is held in an "
        "equilibrium of equations (1) to (8) that anyone can check. Clearances are measured on convex pieces."
    ]
    meshes = scene_meshes(answer.task.hand, g.q, body, g.pose)
    write_report(
        path, g.grasp, entries, settings=settings, meshes=meshes, notes=notes, facts=facts(answer, which), force=force
    )


def plane_of(answer: Grasps) -> Plane:
    """The plane of the object's axes in which the loads' forces vary most."""
    spread = np.var(answer.loads.wrenches[:, :3], axis=0)
    return PLANES[int(np.argmax([spread["xyz".index(p[0])] + spread["xyz".index(p[1])] for p in PLANES]))]


def facts(answer: Grasps, which: int) -> list[tuple[str, str]]:
    """Names and values for the table at the top."""
    g = answer.grasps[which]
    unit = words.actuator_unit(g.grasp, g.grasp.mechanism.actuators[0])
    report, residual = g.solution.verify(), max(a.witness.residuals.worst for a in g.answer.checks if a.witness)
    c, least = g.clearances, f", at least {num(g.answer.lower, 3)} {unit} proved" if g.answer.lower else ""
    pair = " and ".join(c.nearest_pair) if c.nearest_pair else "none"
    return [
        ("rank", f"{which + 1} of {len(answer.grasps)}, score {g.score:.2f}"),
        ("existence", "proved" if report.ok else f"REFUSED: {report.reason}"),
        ("loads", f"{words.count(len(g.answer.checks), 'load')}, each with a witness, residual {residual:.1e} at most"),
        ("largest command", f"{num(g.command, 3)} {unit}{least}"),
        ("hand to object", f"{1e3 * c.least_to_object:.2f} mm apart or more outside the contacts ({c.nearest_link})"),
        ("at the contacts", ", ".join(f"{1e3 * d:.2f}" for d in c.at_contacts) + " mm between the solids"),
        ("link to link", f"{1e3 * c.least_between:.2f} mm or more ({pair})"),
        ("curvature at contacts", ", ".join(num(k, 3) for k in g.curvatures) + " 1/m relative; 0 or more fits"),
        ("friction margin", f"{100 * g.friction_margin:.0f} % less would balance the loads too"),
        ("joint limits", f"{100 * g.terms['from_limits']:.0f} % of half the range away, or more"),
        ("manipulability", f"{num(g.dexterity.manipulability, 3)}, isotropy {num(g.dexterity.isotropy, 3)}"),
    ]
