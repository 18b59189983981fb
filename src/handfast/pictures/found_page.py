"""Pages about what a search has found: the first to be turned with the mouse, and a picture of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from handfast.core.errors import InputError
from handfast.core.files import write_text
from handfast.geometry.contacts import grasp_of
from handfast.model.body import Body
from handfast.pictures import Entry, words, write_report
from handfast.pictures.grasp_picture import draw_scene
from handfast.pictures.page import render, shown_loads
from handfast.pictures.scene import DrawnScene, ShownGrasp, link_meshes, link_poses, scene_meshes
from handfast.pictures.words import clearance_text, laws_text, num
from handfast.planning.evaluation.evaluator import contacts_at
from handfast.planning.propose_tasks import Proposals
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.plan import Plan
from handfast.readers.load_body import load_body
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.maps import PLANES, Plane
from handfast.stability.studies.questions import force_map
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Synthesis

NOTHING_FOUND = "nothing was found that a page could show"
PAGE_DIRECTIONS = 48  # directions of the map
PAGE_NODES = 400  # of the search for each of them: a picture, its open directions are drawn as such


def report_plan(path: str | Path, planned: Plan, *, force: bool = False) -> None:
    """Write a page about the grasps of a plan, all in one scene with their loads.

    Raises:
        InputError: the plan has no grasps; the file exists and `force` is not set, or cannot be written.
    """
    shown, asked, options = [], [], planned.asked.options
    for g in planned.grasps:
        preload = f"preload {words.preload_text(g.grasp)}"
        about = f"Grasp {planned.number(g)}, of start {g.index}: {words.grasp_text(g.grasp)}; {preload}."
        about += f" {words.sentence(words.quality_text(g.quality))}" if g.quality else ""
        about += f" {laws_text(g.grasp)}"
        checks = zip(planned.loads.names, g.answer.checks, strict=True)
        entries = [Entry(f"Does it hold “{name}”?", a, eta=options.limits.eta) for name, a in checks]
        poses = link_poses(planned.hand, g.q, g.pose)
        shown.append(ShownGrasp(g.grasp, shown_loads(entries), str(planned.number(g)), about, poses))
        asked.append(entries)
    facts = [
        (
            "grasps",
            f"{len(planned.grasps)} of {planned.count} asked for, {planned.tried} starts, seed {options.seed}",
        ),
        ("each holds", f"{words.times_text(options.safety)}{words.listed(planned.loads.names)}"),
        ("best first", words.BEST_FIRST),
    ]
    note = "Each grasp holds every load, in an equilibrium that anyone can check. The first in full:"
    scene = DrawnScene(tuple(shown), tuple(link_meshes(planned.hand, planned.body)))
    _write(path, scene, asked[0] if asked else [], facts, note, force)


def report_proposals(path: str | Path, proposals: Proposals, body: Body, *, force: bool = False) -> None:
    """Write a page about tasks that were proposed, each in its certified configuration.

    Raises:
        InputError: none was proposed; the file exists and `force` is not set, or cannot be written.
    """
    found = []
    for p in proposals.proposals:
        measured = f"score {p.score:.2f}, {1e3 * p.off_centre:.0f} mm off centre, {clearance_text(p.clearance)}"
        about = f"{p.task.name}: {', '.join(p.names)}; {measured}."
        found.append(_configuration(p.answer.solutions[0], body, p.task.name, about))
    facts = [("kind", proposals.kind), ("candidates", f"{proposals.tried} tried, {len(found)} certified and kept")]
    note = "Regions chosen by a heuristic; each configuration is proved to exist. Whether it holds was not asked."
    hand = proposals.proposals[0].task.hand if found else None
    _write(path, DrawnScene(tuple(found), tuple(link_meshes(hand, body)) if hand else ()), [], facts, note, force)


def report_synthesis(path: str | Path, answer: Synthesis, *, force: bool = False) -> None:
    """Write a page about the configurations of a synthesis, with the task's object if it names one.

    Raises:
        InputError: no configuration was found, or the object cannot be read; the file exists and `force` is not set,
            or cannot be written.
    """
    task = answer.task
    body = None if task.object is None else load_body(task.object)
    links = ", ".join(pair.link for pair in task.contact_pairs)
    found = tuple(
        _configuration(solution, body, task.name or f"configuration {k}", f"Configuration {k}: {links} touch.")
        for k, solution in enumerate(answer.solutions, start=1)
    )
    facts = [("verdict", answer.verdict.upper()), ("configurations", str(len(found)))]
    note = "Each configuration is proved to exist. Whether it collides or holds was not asked."
    _write(path, DrawnScene(found, tuple(link_meshes(task.hand, body))), [], facts, note, force)


def _configuration(solution: Solution, body: Body | None, name: str, said: str) -> ShownGrasp:
    """A configuration with its contacts, object frame."""
    hand, pose = solution.task.hand, solution.pose
    contacts = contacts_at(solution, 0.5 if body is None else body.friction)
    grasp = grasp_of(hand, solution.q, contacts, pose, name=name)
    return ShownGrasp(grasp, (), name, said, link_poses(hand, solution.q, pose))


def _write(
    path: str | Path,
    scene: DrawnScene,
    entries: Sequence[Entry],
    facts: Sequence[tuple[str, str]],
    note: str,
    force: bool,
) -> None:
    if not scene.grasps:
        raise InputError(NOTHING_FOUND, source=str(path))
    gallery = [(draw_scene(scene.meshes_of(k), g.grasp), g.said) for k, g in enumerate(scene.grasps)]
    write_text(path, render(scene, entries, notes=[note], facts=facts, gallery=gallery), force=force)


# --- one grasp of `grasp_for` ---


def report_grasp(path: str | Path, answer: Grasps, which: int = 0, *, force: bool = False) -> None:
    """Write a self-contained page about one of the grasps.

    Args:
        which: index into `answer.grasps`.

    Raises:
        InputError: the file exists and `force` is not set, or cannot be written.
    """
    g, body = answer.grasps[which], answer.body
    settings = Settings(nodes=PAGE_NODES)
    entries = [Entry(f"Does it hold “{name}”?", a) for name, a in zip(answer.loads.names, g.answer.checks, strict=True)]
    weight = None if body.mass is None else 9.81 * body.mass
    whole = force_map(g.grasp, plane_of(answer), steps=PAGE_DIRECTIONS, at=body.center_of_mass, settings=settings)
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
        ("dexterity", f"{num(g.dexterity.typical, 3)}, isotropy {num(g.dexterity.isotropy, 3)}"),
    ]
