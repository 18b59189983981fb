"""The report's HTML: sections of verdicts, pictures and tables."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from html import escape
from importlib import metadata

import numpy as np
from matplotlib.figure import Figure

from handfast.core.answer import Verdict
from handfast.core.errors import kinds_checked
from handfast.model.grasp import Grasp
from handfast.pictures import Entry, page_parts, page_tables, sentences, view3d, words
from handfast.pictures.grasp_picture import draw_grasp, draw_scene
from handfast.pictures.map_picture import draw_map, draw_sweep
from handfast.pictures.page_parts import still, table
from handfast.pictures.scene import DrawnScene, Mesh, ShownLoad
from handfast.pictures.words import laws_text, num
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.problem.settings import Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.studies.maps import MapAnswer, SweepAnswer

DRAWN_CHECKS = 3  # checks; from one more on, only the first one that holds is drawn in still pictures


@kinds_checked
def render(
    scene: DrawnScene,
    entries: Sequence[Entry],
    *,
    settings: Settings | None = None,
    notes: Sequence[str] = (),
    facts: Sequence[tuple[str, str]] = (),
    gallery: Sequence[tuple[Figure, str]] = (),
) -> str:
    """The whole page; see `handfast.pictures.write_report`. Its entries are about the scene's first grasp.

    Args:
        settings: what the answers were computed with, for the record.
        notes: sentences above the answers.
        facts: rows of a table above the answers, name and value, such as clearances and ranks.
        gallery: pictures with captions, after the answers: of other grasps that were found.
    """
    settings = settings or Settings()
    grasp, meshes = scene.grasps[0].grasp, scene.meshes_of(0)
    checks = [e for e in entries if isinstance(e.answer, CheckAnswer)]
    held = [e for e in checks if getattr(e.answer, "witness", None)]
    folded = {id(e) for e in held[1:]} if len(checks) > DRAWN_CHECKS else set()
    parts = [_section(grasp, entry, settings, meshes, folded=id(entry) in folded) for entry in entries]
    witnessed = any(getattr(e.answer, "witness", None) for e in entries)
    parts.append(_grasp_section(grasp, () if witnessed else meshes, draw=not witnessed))
    if gallery:
        pictures = "".join(still(figure, caption, "png") for figure, caption in gallery)
        parts.append(f"<section><h2>All that was found</h2>{pictures}</section>")
    if entries or not gallery:
        parts.append(_settings_section(settings, entries))
    about = f"{words.grasp_text(grasp)}. Preload {words.preload_text(grasp)}."
    top = [
        f'<h1>{escape(grasp.name)}</h1><p class="facts">{escape(about)}</p>',
        *(f'<p class="facts">{escape(laws)}</p>' for laws in [laws_text(grasp)] if laws),
        *(f"<p>{escape(note)}</p>" for note in notes),
        _overview(facts, checks if len(checks) > DRAWN_CHECKS else []),
        view3d.view(scene),
    ]
    return page_parts.page(grasp.name, ["page.css"], [*top, *parts])


def shown_loads(entries: Sequence[Entry]) -> tuple[ShownLoad, ...]:
    """The loads of a grasp that was asked about."""
    asked = [(e, e.answer) for e in entries if isinstance(e.answer, Answer)]
    return tuple(
        ShownLoad(e.title, f"{sentences.verdict_word(a)}: {_sentence(e, a)}", *sentences.state_of(a)) for e, a in asked
    )


def _overview(facts: Sequence[tuple[str, str]], checks: Sequence[Entry]) -> str:
    """The facts, and with many loads their verdicts at a glance."""
    parts = [table(["", "#"], facts), page_tables.checks_table(checks)]
    return f'<section class="overview">{"".join(parts)}</section>' if any(parts) else ""


def _section(grasp: Grasp, entry: Entry, settings: Settings, meshes: Sequence[Mesh], *, folded: bool) -> str:
    answer = entry.answer
    parts = [f"<h2>{escape(entry.title)}</h2>"]
    if isinstance(answer, MapAnswer):
        parts.append(_verdict(answer.verdict, sentences.map_sentence(answer), share=sentences.share_word(answer)))
        caption = f"Forces resisted in the {answer.plane} plane; they act {words.place_text(answer.at)}."
        if entry.weight:
            caption += f" {sentences.weight_sentence(answer.curves[-1], entry.weight)}"
        parts.append(still(draw_map(answer, limit=entry.limit, weight=entry.weight), caption))
        parts.append(page_tables.map_table(answer))
    elif isinstance(answer, SweepAnswer):
        parts.append(_verdict(answer.verdict, sentences.sweep_sentence(answer), share=sentences.share_word(answer)))
        parts.append(still(draw_sweep(answer), "Largest resisted disturbances over the command."))
        parts.append(page_tables.sweep_table(answer))
    else:
        parts += _answer(grasp, entry, answer, settings, meshes, folded=folded)
    return f"<section>{''.join(parts)}</section>"


def _answer(
    grasp: Grasp, entry: Entry, answer: Answer, settings: Settings, meshes: Sequence[Mesh], *, folded: bool
) -> list[str]:
    witness = answer.witness
    unreal = sentences.unphysical(witness)
    parts = [
        _verdict(
            answer.verdict,
            _sentence(entry, answer),
            unreal=unreal,
            fragile=sentences.fragile(answer),
        )
    ]
    why = sentences.reason(answer, settings)
    if why:
        parts.append(f'<p class="why">{escape(why)}</p>')
    if isinstance(answer, MaxAnswer | TorquesAnswer):
        parts.append(page_tables.bounds_table(answer, entry))
    if isinstance(answer, CheckAnswer) and answer.margin:
        if answer.margin.fragile:
            parts.append(f'<p class="why">{escape(sentences.fragile_text(answer.margin))}</p>')
        parts.append(page_tables.margin_table(answer.margin))
    if witness is not None:
        if unreal:
            parts.append(_warning(witness))
        tables = (
            page_tables.contact_table(witness)
            + page_tables.actuator_table(witness)
            + page_tables.energy_table(witness)
            + page_tables.residual_table(witness)
        )
        if folded:
            parts.append(f"<details><summary>The equilibrium in numbers</summary>{tables}</details>")
        else:
            parts += [*_pictures(grasp, witness, meshes), tables]
    elif answer.verdict is Verdict.SLIPS:
        why = "a relaxation of equations (1) to (8), wider than the model, has no solution."
        if answer.certificate:
            proved = sentences.certified(answer.certificate, answer.verified)
            why = f"every case of equations (1) to (8) was refuted: {proved}."
        parts.append(f'<p class="note">There is no equilibrium to show: {escape(why)}</p>')
    parts.append(page_tables.search_note(answer))
    return parts


def _pictures(grasp: Grasp, witness: Witness, meshes: Sequence[Mesh]) -> list[str]:
    caption = (
        f"An equilibrium under {words.load_text(witness.wrench)}. Arrows of force share one scale; "
        "the virtual motion is that of the object relative to the finger."
    )
    if not meshes:
        return [still(draw_grasp(grasp, witness), caption)]
    bare = "The same without the solids: fingers as lines from joint to joint to contact."
    return [still(draw_scene(meshes, grasp, witness), caption), still(draw_grasp(grasp, witness), bare)]


def _verdict(
    verdict: Verdict, sentence: str, *, unreal: bool = False, fragile: bool = False, share: str | None = None
) -> str:
    word, style = (f"{verdict}?", "unreal") if unreal else (share or str(verdict), str(verdict))
    if fragile and not unreal:
        word, style = f"{verdict}, fragile", "unreal"
    return f'<p class="verdict"><b class="{style}">{word.upper()}</b><span>{escape(sentence)}</span></p>'


def _warning(witness: Witness) -> str:
    """Why a solution without the maximum dissipation principle cannot be believed."""
    e = witness.energy
    scale = abs(e.disturbance) + abs(e.preload) + abs(e.stored)
    total = e.disturbance + e.preload
    wrong = [i for i, work in enumerate(e.friction) if work < -sentences.CREATED * scale]
    names = [f"{i} ({witness.grasp.contacts[i].link})" if witness.grasp.contacts[i].link else str(i) for i in wrong]
    return (
        '<div class="warning"><strong>This solution is not physical: friction pushes along the motion.'
        "</strong>"
        f"{num(e.created)} N² of work come out of nothing, against {num(total)} N² that the disturbance and "
        f"the preload put in. It happens at contact{'s' if len(wrong) > 1 else ''} "
        f"{escape(words.listed(names))}, where the friction force does not oppose the sliding. The maximum "
        "dissipation principle, which was left out here, forbids it.</div>"
    )


def _sentence(entry: Entry, answer: Answer) -> str:
    return sentences.answer_sentence(answer, entry.direction, entry.objective)


def _grasp_section(grasp: Grasp, meshes: Sequence[Mesh], *, draw: bool) -> str:
    parts = ["<h2>The grasp</h2>"]
    if draw:
        if meshes:
            parts.append(still(draw_scene(meshes, grasp), "Hand and object with their contacts."))
        caption = "Contacts with friction cones, normals into the object, and joint axes."
        parts.append(still(draw_grasp(grasp), caption))
    parts.append(page_tables.grasp_table(grasp))
    return f"<section>{''.join(parts)}</section>"


def _settings_section(settings: Settings, entries: Sequence[Entry]) -> str:
    limit = f"{num(settings.timeout)} s" if np.isfinite(settings.timeout) else "none"
    nodes = num(settings.nodes) if np.isfinite(settings.nodes) else "none"
    etas = sorted({float(np.degrees(e.eta)) for e in entries}) or [0.0]
    versions = f"handfast {_version('handfast')}, Python {platform.python_version()}, numpy {np.__version__}"
    rows = [["gap of the bounds", f"{num(100 * settings.gap)} %"], ["time limit per question", limit]]
    rows = [["method", "tree search with certificates"], *rows, ["node limit per question", nodes]]
    rows += [["uncertainty of the normals", ", ".join(f"{num(x)}°" for x in etas)], ["versions", versions]]
    return (
        f"<section><h2>Settings</h2>{table(['', ''], rows)}"
        '<p class="note">SI units, object frame. Equation numbers are those of the model in the '
        "documentation. Virtual motions and works belong to contact springs of unit stiffness: a motion "
        "is measured by the force it causes, in N, and work in N².</p></section>"
    )


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"
