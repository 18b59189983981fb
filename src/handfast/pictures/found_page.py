"""Pages about what a search has found: the first to be turned with the mouse, and a picture of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handfast.core.errors import InputError
from handfast.geometry.contacts import grasp_of
from handfast.model.body import Body
from handfast.model.grasp import Contact
from handfast.model.shape import Shape
from handfast.pictures import Entry, words, write_report
from handfast.pictures.grasp_picture import draw_scene
from handfast.pictures.scene import scene_meshes
from handfast.pictures.words import laws_text
from handfast.readers.load_body import load_body

if TYPE_CHECKING:
    from handfast.core.arrays import Array
    from handfast.model.grasp import Grasp
    from handfast.model.hand.hand import Hand
    from handfast.pictures.scene import Mesh
    from handfast.planning.propose_tasks import Proposals
    from handfast.planning.results.plan import Plan
    from handfast.synthesis.solution import Solution
    from handfast.synthesis.synthesis_answer import Synthesis

NOTHING = "nothing was found that a page could show"


@dataclass(frozen=True, eq=False)
class FoundItem:
    """Something that was found: a grasp, its solids, and a line about it."""

    grasp: Grasp
    meshes: Sequence[Mesh]
    caption: str


def report_plan(path: str | Path, planned: Plan, *, force: bool = False) -> None:
    """Write a page about the grasps of a plan: the first with all its loads, then a picture of each.

    Raises:
        InputError: the plan has no grasps; the file exists and `force` is not set, or cannot be written.
    """
    items = []
    options = planned.asked.options
    for g in planned.grasps:
        preload = f"preload {words.preload_text(g.grasp)}"
        about = f"Grasp {planned.number(g)}, of start {g.index}: {words.grasp_text(g.grasp)}; {preload}."
        about += f" {words.quality_text(g.quality)}." if g.quality else ""
        about += f" {laws_text(g.grasp)}"
        items.append(FoundItem(g.grasp, solids(planned.hand, g.q, planned.body, g.pose), about))
    entries = []
    if planned.grasps:
        asked = zip(planned.loads.names, planned.grasps[0].answer.checks, strict=True)
        entries = [Entry(f"Does it hold “{name}”?", a, eta=options.limits.eta) for name, a in asked]
    facts = [
        (
            "grasps",
            f"{len(planned.grasps)} of {planned.count} asked for, {planned.tried} starts, seed {options.seed}",
        ),
        ("each holds", f"{words.times_text(options.safety)}{words.listed(planned.loads.names)}"),
        ("best first", words.BEST_FIRST),
    ]
    note = "Each grasp holds every load, in an equilibrium that anyone can check. The first in full:"
    _write(path, items, entries, facts, note, force)


def report_proposals(path: str | Path, proposals: Proposals, body: Body, *, force: bool = False) -> None:
    """Write a page about tasks that were proposed, each in its certified configuration.

    Raises:
        InputError: none was proposed; the file exists and `force` is not set, or cannot be written.
    """
    items = []
    for p in proposals.proposals:
        measured = f"score {p.score:.2f}, {1e3 * p.off_centre:.0f} mm off centre, clearance {1e3 * p.clearance:.1f} mm"
        solution = p.answer.solutions[0]
        about = f"{p.task.name}: {', '.join(p.names)}; {measured}."
        items.append(_configuration(solution, body, p.task.name, about))
    facts = [("kind", proposals.kind), ("candidates", f"{proposals.tried} tried, {len(items)} certified and kept")]
    note = "Regions chosen by a heuristic; each configuration is proved to exist. Whether it holds was not asked."
    _write(path, items, [], facts, note, force)


def report_synthesis(path: str | Path, answer: Synthesis, *, force: bool = False) -> None:
    """Write a page about the configurations of a synthesis, with the task's object if it names one.

    Raises:
        InputError: no configuration was found, or the object cannot be read; the file exists and `force` is not set,
            or cannot be written.
    """
    task = answer.task
    body = None if task.object is None else load_body(task.object)
    items = []
    for k, solution in enumerate(answer.solutions, start=1):
        links = ", ".join(pair.link for pair in task.contact_pairs)
        items.append(_configuration(solution, body, task.name or "task", f"Configuration {k}: {links} touch."))
    facts = [("verdict", answer.verdict.upper()), ("configurations", str(len(items)))]
    note = "Each configuration is proved to exist. Whether it collides or holds was not asked."
    _write(path, items, [], facts, note, force)


def _configuration(solution: Solution, body: Body | None, name: str, caption: str) -> FoundItem:
    """A configuration with its contacts, object frame."""
    hand, pose = solution.task.hand, solution.pose
    R, friction = pose[:3, :3], 0.5 if body is None else body.friction
    contacts = [
        Contact(R.T @ (point - pose[:3, 3]), R.T @ normal, friction, pair.link)
        for pair, point, normal in zip(solution.task.contact_pairs, solution.points, solution.normals, strict=True)
    ]
    grasp = grasp_of(hand, solution.q, contacts, pose, name=name)
    return FoundItem(grasp, solids(hand, solution.q, body, pose), caption)


def solids(hand: Hand, q: Array, body: Body | None, pose: Array) -> list[Mesh]:
    """Hand and object; the hand alone where no object is known."""
    if body is not None:
        return scene_meshes(hand, q, body, pose)
    speck = Body.of([Shape("sphere", 1e-6)])
    return [mesh for mesh in scene_meshes(hand, q, speck, pose) if mesh.kind == "hand"]


def _write(
    path: str | Path,
    items: Sequence[FoundItem],
    entries: Sequence[Entry],
    facts: Sequence[tuple[str, str]],
    note: str,
    force: bool,
) -> None:
    if not items:
        raise InputError(NOTHING, source=str(path))
    first = items[0]
    pictures: list[tuple[Any, str]] = [(draw_scene(item.meshes, item.grasp), item.caption) for item in items]
    shown: dict[str, Any] = {"meshes": first.meshes, "notes": [note], "facts": facts, "gallery": pictures}
    write_report(path, first.grasp, entries, **shown, force=force)
