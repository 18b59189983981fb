"""`handfast verify`: replays what backs a saved answer, and says what that proves: of which question, about what."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from rich.console import Console
from tyro.conf import Positional, UseAppendAction, arg

from handfast.cli import console, tables
from handfast.cli.console import table
from handfast.cli.options import Command
from handfast.model.grasp import Grasp
from handfast.pictures import words
from handfast.pictures.words import num
from handfast.planning.results.grasps_file import SavedGrasps
from handfast.planning.results.grasps_file import from_dict as grasps_from_dict
from handfast.planning.results.verify import question_of
from handfast.proofs.path_commands import sought_words
from handfast.readers import grasp_file
from handfast.saved import stated, verify
from handfast.stability.studies.ask_again import LARGEST_GAP
from handfast.synthesis.embedded_task import digest, fingerprint, task_from_dict, task_to_dict
from handfast.synthesis.task import Task


@dataclass(kw_only=True)
class Verify(Command):
    """Is everything that a saved answer claims proved? Prints what: the question, and the grasp or hand it is about.

    Proves that an exact state is near its witness and replays its certificate, the proofs that its configurations
    exist, or both for each grasp, without the engine and without any solver. Geometry is measured anew.
    Maps, sweeps, settled grasps and tables of labels keep no proofs: --replay asks all of it again, now with them.
    Exit status: 0 all is proved, 1 something is refused, 2 bad input, 3 with --replay: something stayed undecided.
    """

    result: Annotated[Positional[str], arg(metavar="RESULT")]
    """a file that --save wrote, a handfast/certificate/1 file, the folder of a plan; with --replay also an answer of
    map or sweep (.json), a settled.json, or a table of labels (.jsonl, .parquet)"""
    replay: bool = False
    """ask again what keeps no proofs: each of its numbers and verdicts, with proofs that are replayed"""
    dataset: Annotated[Path | None, arg(metavar="DATASET")] = None
    """of a table of labels: what was labelled"""
    row: Annotated[UseAppendAction[tuple[int, ...]], arg(metavar="N")] = ()
    """of a table of labels: the number of a row, from 0; once for each; all unless given"""
    question_timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds for each question that is asked again"""
    timeout: Annotated[float, arg(metavar="S")] = float("inf")
    """seconds for all of them"""
    json: bool = False
    """print one JSON object instead of a table"""

    def run(self) -> int:
        start = time.monotonic()
        with console.watch("verify") as watch:
            done = verify(
                self.result, replay=self.replay, dataset=self.dataset, rows=self.row,
                question_timeout=self.question_timeout, timeout=self.timeout, on_progress=watch.item,
            )  # fmt: skip
        data, seconds = stated(self.result), time.monotonic() - start
        again = is_asked_again(data)
        if self.json:
            said = {"schema": "handfast/verification/1", "seconds": round(seconds, 6)} | done.to_json()
            console.print_json(said | {"question": question_json(data)})
        else:
            out = console.out()
            word = tables.show_replay(out, head(data), done)
            show_question(out, data, proved=word == "PROVED")
            how = (
                "asked again; witnesses and certificates replayed"
                if again
                else "without any search and without any solver"
            )
            out.print(f"{tables.num(seconds, 2)} s, {how}", style="dim")
        if done.fault:
            return console.REFUSED
        return console.UNDECIDED if done.open else console.ANSWERED


HASH_DIGITS = 16  # of a SHA-256 that are shown
RELATIVE = ("hand", "object", "task")
LAW = {True: "maximum dissipation", False: "friction without maximum dissipation, which may create energy"}


ASKED_AGAIN = "handfast/settled/1", "handfast/labels/1"  # schemas of what keeps no proofs, beside maps and sweeps


def is_asked_again(data: Mapping[str, Any]) -> bool:
    """Does it keep no proofs, so that it was asked again?"""
    return data.get("schema") in ASKED_AGAIN or data.get("query") in ("map", "sweep")


def head(data: Mapping[str, Any]) -> str:
    """What a saved file is about, in a line."""
    if "answers" in data:
        return f"folder: {words.count(len(data['answers']), 'answer')}"
    answer = data.get("answer", data)
    said = f": {answer['verdict'].upper()}" if "verdict" in answer else ""  # a certificate by itself has none
    said += f", stop {answer['stop']}" if "stop" in answer else ""
    if is_asked_again(data):
        return f"asked again: {_head_again(data)}{said}"
    if data.get("query") == "plan":
        return f"plan: {words.count(len(data.get('grasps', [])), 'grasp')}"
    if "task" in data:
        task = task_from_dict(data["task"])
        return f"{'synthesis' if 'grasps' not in data else 'grasps'} of {task.name or task.hand.name}{said}"
    name = grasp_file.from_dict(data["question"]["grasp"]).name
    return f"certificate of {name}: by itself" if "answer" not in data else f"{answer['query']} of {name}{said}"


def _head_again(data: Mapping[str, Any]) -> str:
    if data["schema"] == "handfast/labels/1":
        return "labels"
    if data["schema"] == "handfast/settled/1":
        return f"{grasp_file.from_dict(data['first']).name} {data['rest']}"
    return f"{data['query']} of {grasp_file.from_dict(data['question']['grasp']).name}"


def question_json(data: Mapping[str, Any]) -> dict[str, Any]:
    """What was asked, with what tells its grasp, or its hand, object and task, from others."""
    if "answers" in data:
        return {name: question_json(one) for name, one in data["answers"].items()}
    if is_asked_again(data):
        return _again_json(data)
    if data.get("query") == "plan":
        return {"sha256": data["question"], "loads": data["loads"]}
    if "task" in data:
        return task_json(task_from_dict(data["task"])) if "motors" not in data else question_of(grasps_from_dict(data))
    sought = {"sought": data["sought"]} if "sought" in data else {}
    return dict(data["question"]) | {"grasp": _about(grasp_file.from_dict(data["question"]["grasp"]))} | sought


def _about(g: Grasp) -> dict[str, Any]:
    return {"name": g.name, "sha256": grasp_digest(g), "friction": g.mu.tolist(), "preload": g.preload}


def _again_json(data: Mapping[str, Any]) -> dict[str, Any]:
    """The same of what was asked again."""
    if data["schema"] == "handfast/labels/1":
        return {key: data.get(key) for key in ("dataset", "questions", "changes", "scene")}
    if data["schema"] == "handfast/settled/1":
        last = data["last"] and _about(grasp_file.from_dict(data["last"]))
        loads = {key: data[key] for key in ("wrench", "last_wrench")}
        return {"first": _about(grasp_file.from_dict(data["first"])), "last": last} | loads
    g = grasp_file.from_dict(data["question"]["grasp"])
    beside = ("plane", "at", "directions") if data["query"] == "map" else ("joint", "directions")
    return dict(data["question"]) | {"grasp": _about(g)} | {key: data[key] for key in beside}


def grasp_digest(grasp: Grasp) -> str:
    """SHA-256 of a grasp as a `handfast/grasp/1` object, without its name and its preload."""
    return digest({k: v for k, v in grasp_file.to_dict(grasp).items() if k not in ("name", "preload")})


def show_question(out: Console, data: Mapping[str, Any], *, proved: bool) -> None:
    """The question of a saved file."""
    if "answers" in data:
        for name, one in data["answers"].items():
            out.print(f"\n{name}", style="bold")
            show_question(out, one, proved=proved)
        return
    if data.get("query") == "plan":
        made = data.get("scene", {})
        soft = f", torsion {num(1e3 * data['torsion'])} mm" if data.get("torsion") else ""
        given = f"friction {num(made['friction'])}{soft}; joint laws: {made['joint_laws']}" if made else ""
        said = "each grasp holds" if data["grasps"] else f"of the object, {data.get('fewest_contacts')}; asked are"
        out.print(f"\n{_opening(proved)} {said} {', '.join(data['loads'])}", soft_wrap=True)
        out.print(given, style="dim", soft_wrap=True)
        return
    if "task" in data:
        if "motors" in data:
            saved = grasps_from_dict(data)
            show_grasps_question(out, saved, question_of(saved), proved=proved)
        else:
            show_task_question(out, task_from_dict(data["task"]), proved=proved)
        return
    if is_asked_again(data):
        _show_again(out, data, proved=proved)
        return
    asked = data["question"]
    g = grasp_file.from_dict(asked["grasp"])
    sought = "loads" in asked or asked["goal"] == "torques" or "sought" in data
    out.print(f"\n{_opening(proved)} {_asked(asked, data.get('sought'))}", soft_wrap=True)
    facts = [words.grasp_text(g), "" if sought else f"preload {words.preload_text(g)}"]
    limits = asked["torque_limits"], asked["force_limit"]
    after = ["first the squeeze, then the load"] if "loading" in data.get("answer", ()) else []
    terms = [*_terms(asked["eta"], asked.get("mdp", True), *limits), *after]
    out.print("; ".join(filter(None, [*facts, *terms])), soft_wrap=True)
    _show_grasp(out, g)


def _show_grasp(out: Console, g: Grasp) -> None:
    out.print(f"relative to grasp '{g.name}' sha256 {grasp_digest(g)[:HASH_DIGITS]}…", style="dim", soft_wrap=True)


def _show_again(out: Console, data: Mapping[str, Any], *, proved: bool) -> None:
    """The question of what keeps no proofs."""
    after = "; first the squeeze, then the load" if "loading" in data.get("questions", data) else ""
    if data["schema"] == "handfast/labels/1":
        kind = data["dataset"].get("kind")
        source = next((str(x) for key, x in data["dataset"].items() if key.startswith("sha256")), "")
        asked_of = f"what the grasps of the dataset hold, by how much, and with which commands{after}"
        out.print(f"{_opening(proved)} {asked_of}", soft_wrap=True)
        out.print(f"relative to the dataset ({kind}) sha256 {source[:HASH_DIGITS]}…", style="dim", soft_wrap=True)
        return
    out.print()
    if data["schema"] == "handfast/settled/1":
        for name, key, wrench in (("as it stood", "first", "wrench"), ("at rest", "last", "last_wrench")):
            if data[key]:
                g = grasp_file.from_dict(data[key])
                load = words.load_text(np.array(data[wrench]))
                held = f"{words.grasp_text(g)}; preload {words.preload_text(g)}{after}"
                out.print(f"{_opening(proved)} {load}, {name}; {held}", soft_wrap=True)
                _show_grasp(out, g)
        return
    asked = data["question"]
    g, count = grasp_file.from_dict(asked["grasp"]), len(data["directions"])
    if data["query"] == "map":
        what = (
            f"forces in {words.count(count, 'direction')} of the {data['plane']} plane, {words.place_text(data['at'])}"
        )
    else:
        what = f"{words.count(count, 'direction')} under {words.count(len(data['rows']), 'command')} of {data['joint']}"
    limits = asked["torque_limits"], asked["force_limit"]
    facts = [words.grasp_text(g), f"preload {words.preload_text(g)}", *_terms(asked["eta"], asked["mdp"], *limits)]

    within = f"lower bounds to within {num(100 * min(asked['gap'], LARGEST_GAP))} %"
    facts.append("first the squeeze, then the load: ends of paths" if "loading" in asked else within)
    out.print(f"{_opening(proved)} {what}", soft_wrap=True)
    out.print("; ".join(facts), soft_wrap=True)
    _show_grasp(out, g)


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
    told = f"relative to task '{task.name}' sha256 {task_json(task)['task']['sha256'][:HASH_DIGITS]}…"
    out.print(told, style="dim", soft_wrap=True)


def show_grasps_question(out: Console, what: SavedGrasps, question: Mapping[str, Any], *, proved: bool) -> None:
    """The question of grasps for a task."""
    asked, body = what.requirements, what.object
    terms = _terms(asked.eta, question["mdp"], asked.torque_limits or {}, asked.force_limit)
    limit = [] if asked.command_limit is None else [f"commands up to {num(asked.command_limit)}"]
    soft = f", torsion {num(1e3 * asked.torsion)} mm" if asked.torsion else ""
    facts = "; ".join([f"friction {num(asked.friction)}{soft}", *terms, *limit])
    held = (
        "no grasp of these regions holds each load alone" if what.none else "each load alone is held under one preload"
    )
    out.print(f"\n{_opening(proved)} {held}; {facts}", soft_wrap=True)
    rows = []
    for name, wrench, weight in zip(what.loads.names, what.loads.wrenches, what.loads.weights, strict=True):
        made = "as stated"
        if weight:
            factor = "" if weight.factor == 1 else f"{num(weight.factor)} × "
            made = f"{factor}weight of {num(body.mass or 0.0)} kg at {num(weight.g)} m/s²"
        rows.append((name, words.load_text(wrench), made))
    out.print(table(["load", "at the object's origin", ""], rows))
    parts = [f"{part} '{question[part]['name']}' sha256 {question[part]['sha256'][:HASH_DIGITS]}…" for part in RELATIVE]
    out.print(f"relative to {', '.join(parts)}", style="dim", soft_wrap=True)
    warning = "Checksums protect from damage, not from forgery: compare hand, object and task with those you mean."
    out.print(warning, style="dim", soft_wrap=True)


def _opening(proved: bool) -> str:
    return "Proved:" if proved else "Asked:"


def _asked(q: Mapping[str, Any], sought: Mapping[str, Any] | None = None) -> str:
    """sought: of commands on a path."""
    if "loads" in q:
        return (
            f"one preload of {words.listed(q['actuators']) or 'no actuator'} for {words.count(len(q['loads']), 'load')}"
        )
    load = words.load_text(np.array(q["wrench"]))
    if sought is not None:
        return f"commands of {sought_words(**sought)} for {load}"
    if q["goal"] == "torques":
        return f"commands of {words.listed(q['driven']) or 'no actuator'} ({q['objective']}) for {load}"
    if q["direction"] is None:
        return load
    base = f", beside {load}" if any(q["wrench"]) else ""
    return f"multiples of {words.load_text(np.array(q['direction']))}{base}"


def _terms(eta: float, mdp: bool, torque_limits: Mapping[str, float], force_limit: float | None) -> list[str]:
    """Law and limits."""
    limits = [f"{name} carries up to {num(v)}" for name, v in torque_limits.items()]
    normal = [] if force_limit is None else [f"normal forces up to {num(force_limit)} N"]
    exact = f"normals off by up to {num(float(np.degrees(eta)))}°" if eta else "normals exact"
    return [exact, LAW[mdp], *limits, *normal]
