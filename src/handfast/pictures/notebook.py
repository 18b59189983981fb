"""What each thing says of itself in a few lines, and the picture that goes with them: for prints and notebooks.

`core.presented.Presented` is the base of what is shown so.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import singledispatch
from html import escape
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from handfast.core.answer import Stop, Verdict
from handfast.measures.measuring import Measures
from handfast.model.body import Body
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.model.hand.hand import Hand
from handfast.pictures import sentences, words
from handfast.pictures.drawing import data_uri
from handfast.pictures.grasp_picture import draw_grasp, draw_grasps
from handfast.pictures.hand_facts import facts_of, shown_hand
from handfast.pictures.hand_picture import draw_hand
from handfast.pictures.map_picture import draw_map, draw_sweep
from handfast.pictures.measures_picture import draw_measures
from handfast.pictures.motion_picture import details, draw_settled, headline, strip
from handfast.pictures.sampled_picture import bounds_text, conclusion, draw_sampled
from handfast.pictures.scene import moving_scene, scene_meshes, source_meshes
from handfast.pictures.task_picture import draw_task
from handfast.pictures.words import count, num
from handfast.planning.closing import Closed
from handfast.planning.evaluation.attempt import PlannedGrasp
from handfast.planning.propose_tasks import Proposals
from handfast.planning.results.grasps import Grasps, ProvedGrasp
from handfast.planning.results.plan import Plan
from handfast.simulation.result import SimulationResult
from handfast.simulation.settled import Settled
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.batch_answer import BatchAnswer
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.witness import Witness
from handfast.stability.studies.hold import HoldAnswer
from handfast.stability.studies.maps import MapAnswer, SweepAnswer
from handfast.stability.studies.sampled_maximum import SampledMaximum
from handfast.synthesis.solution import Solution
from handfast.synthesis.synthesis_answer import Synthesis
from handfast.synthesis.task import Task

NAMED_ITEMS = 5  # grasps, loads and so on that are named; of more it is said how many there are
NOTEBOOK_CSS = "max-width:48rem;line-height:1.45"
FIGURE_CSS = "max-width:100%;background:#fff;border-radius:.3rem"  # figures are drawn on white, in dark notebooks too


# --- words ---------------------------------------------------------------------------------------


@singledispatch
def lines(thing: Any) -> list[str]:
    """What a thing is, in a few lines; the first is the headline."""
    return [f"{type(thing).__name__} without a summary"]


@lines.register
def _(grasp: Grasp) -> list[str]:
    return [f"{grasp.name}: {words.grasp_text(grasp)}", f"Preload {words.preload_text(grasp)}."]


@lines.register
def _(hand: Hand) -> list[str]:
    return [f"{hand.name}: {words.hand_text(hand)}", *([f"From {hand.source}."] if hand.source else [])]


@lines.register
def _(body: Body) -> list[str]:
    return [f"{body.name}: {words.body_text(body)}"]


@lines.register
def _(placed: Configuration) -> list[str]:
    joints = count(len(placed.joints), "joint")
    preload = ", ".join(f"{name} {num(v)}" for name, v in (placed.preload or {}).items() if v)
    where = f"Object at {words.vector(1e3 * placed.pose[:3, 3], 4)} mm in the hand's base frame."
    said = f"{placed.hand or 'any hand'} with {placed.object or 'any object'}: {joints} stated"
    return [said, where, *([f"Preload {preload}."] if preload else [])]


@lines.register
def _(closed: Closed) -> list[str]:
    touching = ", ".join(closed.touching) or "nothing"
    said = f"closed: {count(len(closed.contacts), 'contact')}, penetration {num(1e3 * closed.penetration, 3)} mm"
    stopped = "; ".join(f"{name}: {why}" for name, why in closed.stopped.items())
    return [said, f"Touches with {touching}.", *([f"Stopped by {stopped}."] if stopped else [])]


@lines.register
def _(loads: Loads) -> list[str]:
    rows = [f"{name}: {words.load_text(w)}" for name, w in zip(loads.names, loads.wrenches, strict=True)]
    return [count(len(loads), "load"), *_few(rows)]


@lines.register
def _(w: Witness) -> list[str]:
    does = [f"{w.contact_states.count(s)} {s}" for s in ("stick", "slide", "open") if s in w.contact_states]
    return [f"Equilibrium under {words.load_text(w.wrench)}: {', '.join(does)}; residual {w.residuals.worst:.1e}"]


@lines.register
def _(answer: Answer) -> list[str]:
    name = f"{answer.posed.problem.grasp.name}: " if answer.posed else ""
    replayed = "; its proof was replayed" if answer.verified else ""
    return [
        f"{sentences.verdict_word(answer)}  {name}{sentences.answer_sentence(answer)}",
        f"{_cost(answer)}{replayed}.",
    ]


@lines.register
def _(answer: HoldAnswer) -> list[str]:
    name = f"{answer.grasp.name}: " if answer.grasp else ""
    out = [f"{answer.verdict.upper()}  {name}{sentences.hold_sentence(answer)}"]
    out += [f"Hardest load: {answer.hardest}."] if answer.hardest else []
    return [*out, f"{_cost(answer)}."]


@lines.register
def _(answer: MapAnswer) -> list[str]:
    title = f"{answer.grasp.name}: forces in the {answer.plane} plane, {words.place_text(answer.at)}"
    return [title, sentences.map_sentence(answer), f"{_cost(answer)}."]


@lines.register
def _(answer: SweepAnswer) -> list[str]:
    low, high = (num(float(x)) for x in (answer.values.min(), answer.values.max()))
    unit = words.actuator_unit(answer.grasp, answer.actuator)
    out = [f"{answer.grasp.name}: {count(len(answer.values), 'command')} of {answer.actuator}, {low} to {high} {unit}"]
    for curve, d in zip(answer.curves, answer.directions, strict=True):
        factor, unit = words.magnitude(d)
        ends = "any size" if curve.unbounded.any() else f"{num(factor * float(np.nanmax(curve.lower)))} {unit}"
        out.append(f"Largest {words.direction_text(d)} at any of them: {ends}.")
    return [*out, f"{_cost(answer)}."]


@lines.register
def _(answer: BatchAnswer) -> list[str]:
    said = [f"{n} {v}" for v in Verdict if (n := int((answer.verdict == v).sum()))]
    broken = int((answer.error != "").sum())
    said += [f"{broken} without an answer"] if broken else []
    shape = " × ".join(map(str, answer.shape))
    return [f"{answer.query} of {shape} questions: {', '.join(said)}", "As a table: .to_frame()."]


@lines.register
def _(found: SampledMaximum) -> list[str]:
    title = f"{found.grasp.name}: largest {words.direction_text(found.direction)} of {len(found.lower)} samples"
    return [title, bounds_text(found), *conclusion(found)]


@lines.register
def _(found: Measures) -> list[str]:
    rows = [f"{v.measure.name}: {v.value if isinstance(v.value, bool) else num(v.value, 3)}"
            for v in found.values if v.value is not None]  # fmt: skip
    return [f"{found.grasp.name}: {count(len(rows), 'measure')}", *rows]


@lines.register
def _(plan: Plan) -> list[str]:
    out = [f"{count(len(plan.grasps), 'grasp')} of {plan.count} asked for: {plan.hand.name} on {plan.body.name}"]
    out.append(f"{count(plan.tried, 'start')}, {_cost(plan)}.")
    if plan.grasps:
        out.append(f"Each holds, under its preload: {', '.join(plan.loads.names)}.")
    return [*out, *_few([f"{plan.number(g)}: {_contacts(g.grasp)}" for g in plan.grasps]), *plan.diagnosis]


@lines.register
def _(g: PlannedGrasp) -> list[str]:
    return [f"Planned grasp of start {g.index}: {_contacts(g.grasp)}", *lines(g.held)]


@lines.register
def _(answer: Grasps) -> list[str]:
    found = f"{count(len(answer.grasps), 'grasp')} of {answer.count} asked for"
    out = [f"{answer.verdict.upper()}  {answer.task.name or 'task'} on {answer.body.name}: {found}"]
    out.append(f"{count(answer.evaluated, 'configuration')} judged, {_cost(answer)}.")
    if answer.grasps:
        out.append(f"Each holds, under its preload: {', '.join(answer.loads.names)}.")
    rows = [f"{k}: score {g.score:.2f}, {_contacts(g.grasp)}" for k, g in enumerate(answer.grasps)]
    return [*out, *_few(rows)]


@lines.register
def _(g: ProvedGrasp) -> list[str]:
    return [f"Certified grasp, score {g.score:.2f}: {_contacts(g.grasp)}", *lines(g.answer)]


@lines.register
def _(found: Proposals) -> list[str]:
    rows = [f"{p.task.name}: {', '.join(p.names)}, score {p.score:.2f}" for p in found.proposals]
    title = f"{count(len(rows), 'task')} for a {found.kind} grasp: {found.hand} on {found.object}"
    return [title, f"{count(found.tried, 'candidate')} tried, {num(found.seconds, 2)} s.", *_few(rows)]


@lines.register
def _(task: Task) -> list[str]:
    links = ", ".join(pair.link for pair in task.contact_pairs)
    thing = f" touch {task.object}" if task.object else ""
    return [f"{task.name or 'task'}: {task.hand.name}, {count(len(task.contact_pairs), 'contact pair')}", links + thing]


@lines.register
def _(answer: Synthesis) -> list[str]:
    found = count(len(answer.solutions), "configuration") if answer.solutions else "no configuration"
    return [f"{answer.verdict.upper()}  {answer.task.name or 'task'}: {found}", f"{_cost(answer)}."]


@lines.register
def _(found: Solution) -> list[str]:
    joints = ", ".join(f"{n} {num(float(v), 3)}" for n, v in zip(found.task.hand.joint_names, found.q, strict=True))
    return [f"A configuration of {found.task.hand.name} that is proved to exist", joints]


@lines.register
def _(result: SimulationResult) -> list[str]:
    most = num(1e3 * float(np.max(result.motion, initial=0.0)), 3)
    out = [f"{str(result.ending).upper()}  {result.grasp.name} under {words.load_text(result.wrench)}, simulated"]
    out.append(f"Moved by {most} mm at most; {count(result.steps, 'step')}, {num(result.seconds, 2)} s.")
    return [*out, *([result.why] if result.why else [])]


@lines.register
def _(found: Settled) -> list[str]:
    return [f"{str(found.rest).upper()}  {found.first.name} {headline(found)}", *details(found)]


def _contacts(grasp: Grasp) -> str:
    links = ", ".join(sorted({c.link for c in grasp.contacts if c.link}))
    return f"{count(grasp.m, 'contact')} ({links}), preload {words.preload_text(grasp)}"


def _cost(answer: Any) -> str:
    nodes = getattr(answer, "nodes", 0)
    stopped = "" if answer.stop is Stop.COMPLETE else f", stopped: {answer.stop}"
    return f"{count(nodes, 'node')}, {num(answer.seconds, 2)} s{stopped}"


def _few(rows: list[str]) -> list[str]:
    return rows if len(rows) <= NAMED_ITEMS + 1 else [*rows[:NAMED_ITEMS], f"and {len(rows) - NAMED_ITEMS} more"]


# --- pictures ------------------------------------------------------------------------------------


def html(thing: Any) -> str:
    """The lines with the picture, for a notebook."""
    first, *others = (escape(line) for line in lines(thing))
    said = "".join(f"<div>{line}</div>" for line in others)
    drawn = ""
    if (figure := draw(thing)) is not None:
        drawn = f'<img style="{FIGURE_CSS}" alt="{first}" src="{data_uri(figure, "png")}">'
    return f'<div style="{NOTEBOOK_CSS}"><b>{first}</b>{said}{drawn}</div>'


@singledispatch
def draw(thing: Any) -> Figure | None:
    """The picture that shows a thing best; None for what is a matter of words."""
    return None


def draw_equilibrium(grasp: Grasp, witness: Witness | None = None) -> Figure:
    """A grasp with its forces, and hand and object if their files are there."""
    return draw_grasp(grasp, witness, source_meshes(grasp)[0])


def draw_found(hand: Hand, body: Body, grasps: Sequence[PlannedGrasp | ProvedGrasp]) -> Figure | None:
    """The first few grasps of a search side by side; None without any."""
    found = [(g.grasp, scene_meshes(hand, g.q, body, g.pose)) for g in grasps[:NAMED_ITEMS]]
    return draw_grasps(found) if found else None


draw.register(Grasp, draw_equilibrium)
draw.register(MapAnswer, draw_map)
draw.register(SweepAnswer, draw_sweep)
draw.register(SampledMaximum, draw_sampled)
draw.register(Settled, draw_settled)
draw.register(Task, draw_task)
draw.register(Witness, lambda w: draw_equilibrium(w.grasp, w))
draw.register(Hand, lambda hand: draw_hand(shown_hand(facts_of(hand))))
draw.register(Measures, lambda found: draw_measures(found, source_meshes(found.grasp)[0]))
draw.register(SimulationResult, lambda result: strip(result, moving_scene(result.grasp)[0]))
draw.register(Plan, lambda plan: draw_found(plan.hand, plan.body, plan.grasps))
draw.register(Grasps, lambda answer: draw_found(answer.task.hand, answer.body, answer.grasps))
draw.register(PlannedGrasp, lambda g: draw(g.held))
draw.register(ProvedGrasp, lambda g: draw(g.answer))
draw.register(Solution, lambda found: draw_task(found.task, found))
draw.register(Synthesis, lambda answer: draw(answer.solutions[0] if answer.solutions else answer.task))
draw.register(Proposals, lambda found: draw(found.proposals[0].answer) if found.proposals else None)


@draw.register
def _(answer: Answer) -> Figure | None:
    if answer.witness is not None:
        return draw_equilibrium(answer.witness.grasp, answer.witness)
    return draw_equilibrium(answer.posed.problem.grasp) if answer.posed else None


@draw.register
def _(answer: HoldAnswer) -> Figure | None:
    if answer.checks:
        return draw(answer.checks[0])
    return draw(answer.grasp) if answer.grasp else None
