"""What `verify` has proved, and relative to what: the question in words, beside the table of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import Console

from handfast.cli.table import table
from handfast.model import grasp_file
from handfast.report import words
from handfast.report.words import num
from handfast.stability.certify.certificate import Question
from handfast.stability.certify.certificate_file import question_to_dict
from handfast.synthesis.embedded import digest, fingerprint, task_to_dict

if TYPE_CHECKING:
    from handfast.model.grasp import Grasp
    from handfast.planning.results.grasps_file import SavedGrasps
    from handfast.synthesis.task import Task

DIGITS = 16  # of a SHA-256 that are shown
RELATIVE = ("hand", "object", "task")
LAW = {True: "maximum dissipation", False: "friction without maximum dissipation, which may create energy"}


def question_json(q: Question) -> dict[str, Any]:
    """The question of an answer about one disturbance, with what tells its grasp from others."""
    g = q.grasp
    about = {"name": g.name, "sha256": grasp_digest(g), "friction": g.mu.tolist(), "preload": g.preload}
    return question_to_dict(q) | {"grasp": about}


def grasp_digest(grasp: Grasp) -> str:
    """SHA-256 of a grasp as a `handfast/grasp/1` object, without its name and its preload."""
    return digest({k: v for k, v in grasp_file.to_dict(grasp).items() if k not in ("name", "preload")})


def show_question(out: Console, q: Question, *, proved: bool) -> None:
    """The question of an answer about one disturbance."""
    out.print(f"\n{_opening(proved)} {_asked(q)}", soft_wrap=True)
    facts = [words.grasp_text(q.grasp), f"preload {words.preload_text(q.grasp)}" if not q.goal.seeks_commands else ""]
    out.print("; ".join(filter(None, [*facts, *_terms(q.eta, q.mdp, q.torque_limits, q.force_limit)])), soft_wrap=True)
    told = f"relative to grasp '{q.grasp.name}' sha256 {grasp_digest(q.grasp)[:DIGITS]}…"
    out.print(told, style="dim", soft_wrap=True)


def task_json(task: Task) -> dict[str, Any]:
    """The question of a synthesis: `sha256` is of hand, limits, regions and bounds."""
    about = {"name": task.name, "sha256": fingerprint(task_to_dict(task))}
    return {"hand": {"name": task.hand.name}, "task": about}


def show_task_question(out: Console, task: Task, *, proved: bool) -> None:
    """The question of a synthesis."""
    asked = (
        f"hand '{task.hand.name}' on {words.count(len(task.contact_pairs), 'pair')} of regions, in limits and bounds"
    )
    out.print(f"\n{_opening(proved)} {asked}", soft_wrap=True)
    told = f"relative to task '{task.name}' sha256 {task_json(task)['task']['sha256'][:DIGITS]}…"
    out.print(told, style="dim", soft_wrap=True)


def show_grasps_question(out: Console, what: SavedGrasps, question: Mapping[str, Any], *, proved: bool) -> None:
    """The question of grasps for a task."""
    asked, body = what.requirements, what.object
    terms = _terms(asked.eta, question["mdp"], asked.torque_limits or {}, asked.force_limit)
    limit = [] if asked.command_limit is None else [f"commands up to {num(asked.command_limit)}"]
    facts = "; ".join([f"friction {num(asked.friction)}", *terms, *limit])
    out.print(f"\n{_opening(proved)} each load alone is held under one preload; {facts}", soft_wrap=True)
    grid = table("load", "at the object's origin", "")
    for name, wrench, weight in zip(what.loads.names, what.loads.wrenches, what.loads.weights, strict=True):
        made = "as stated"
        if weight:
            factor = "" if weight.factor == 1 else f"{num(weight.factor)} × "
            made = f"{factor}weight of {num(body.mass or 0.0)} kg at {num(weight.g)} m/s²"
        grid.add_row(name, words.load_text(wrench), made)
    out.print(grid)
    parts = [f"{part} '{question[part]['name']}' sha256 {question[part]['sha256'][:DIGITS]}…" for part in RELATIVE]
    out.print(f"relative to {', '.join(parts)}", style="dim", soft_wrap=True)


def _opening(proved: bool) -> str:
    return "Proved:" if proved else "Asked:"


def _asked(q: Question) -> str:
    if not q.goal.has_scalar:
        return words.load_text(q.wrench)
    if q.goal.seeks_commands:
        return (
            f"commands of {words.listed(q.driven) or 'no actuator'} ({q.goal.effort}) for {words.load_text(q.wrench)}"
        )
    base = f", beside {words.load_text(q.wrench)}" if q.wrench.any() else ""
    return f"multiples of {words.load_text(q.direction if q.direction is not None else np.zeros(6))}{base}"


def _terms(eta: float, mdp: bool, torque_limits: Mapping[str, float], force_limit: float | None) -> list[str]:
    """Law and limits."""
    limits = [f"{name} carries up to {num(v)}" for name, v in torque_limits.items()]
    normal = [] if force_limit is None else [f"normal forces up to {num(force_limit)} N"]
    exact = f"normals off by up to {num(float(np.degrees(eta)))}°" if eta else "normals exact"
    return [exact, LAW[mdp], *limits, *normal]
