"""Answers as short tables: the verdict first, then the numbers behind it, with units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from rich.console import Console
from rich.text import Text

from handfast.cli import console
from handfast.cli.console import print_table, table
from handfast.cli.options import QueryOptions
from handfast.core.answer import Verdict
from handfast.model.grasp import Contact, Grasp
from handfast.pictures import sentences, words
from handfast.pictures.words import joint_text, laws_text, num, vector
from handfast.proofs.replay import Replay
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.margin import Margin
from handfast.stability.problem import model
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.witness import Witness
from handfast.stability.studies.maps import Curve, MapAnswer, SweepAnswer

VERDICT_STYLES = {Verdict.HOLDS: "bold green", Verdict.SLIPS: "bold red", Verdict.UNDECIDED: "bold yellow"}
MOST_CLAIMS = 20  # that are shown, of those that are proved and of those that are not
Load = Sequence[float]


def show_check(out: Console, grasp: Grasp, wrench: Load, answer: CheckAnswer, asked: QueryOptions) -> None:
    _verdict(out, grasp, answer, sentences.check_sentence(answer, words.load_text(wrench)), asked)
    if answer.witness:
        if answer.margin:
            if answer.margin.fragile:
                out.print(sentences.fragile_text(answer.margin), style="yellow")
            show_margin(out, answer.margin)
        show_witness(out, answer.witness)
    elif answer.verdict is Verdict.SLIPS and not grasp.preload and grasp.mechanism.a:
        out.print("Nothing is commanded; try --preload NAME=VALUE, or handfast torques.")
    _written(out, asked)


def show_checks(out: Console, grasp: Grasp, loads: Loads, answers: Sequence[CheckAnswer], asked: QueryOptions) -> None:
    """Several disturbances, a line each."""
    verdicts = [a.verdict for a in answers]
    worst = next(v for v in (Verdict.SLIPS, Verdict.UNDECIDED, Verdict.HOLDS) if v in verdicts)
    held = f"{verdicts.count(Verdict.HOLDS)} of {len(verdicts)} disturbances are resisted."
    _head(out, grasp, Text(worst.upper(), VERDICT_STYLES[worst]), held, asked, grasp.preload)
    rows = []
    for name, wrench, a in zip(loads.names, loads.wrenches, answers, strict=True):
        shown = "a state" if a.found else sentences.certified(a.certificate, a.verified) if a.certificate else "–"
        fragile = ", FRAGILE" * sentences.fragile(a)
        rows.append(
            (name, Text(a.verdict.upper() + fragile, style=VERDICT_STYLES[a.verdict]), words.load_text(wrench), shown)
        )
    print_table(out, ["disturbance", "", "load", "shown by"], rows)
    _written(out, asked)


def show_margin(out: Console, margin: Margin) -> None:
    """What a HOLDS leans on."""
    print_table(out, ["it leans on", "", ""], sentences.margin_rows(margin))
    out.print(sentences.margin_note(margin), style="dim")


def show_beside(out: Console, alone: CheckAnswer, most: MaxAnswer, free: CheckAnswer | None = None) -> None:
    """Where a disturbance slips: does the preload alone hold, and is more or less of the disturbance resisted?

    free: the answer without the limits of torques and forces; None if there are none.
    """
    if free is not None and free.verdict is Verdict.HOLDS:
        out.print("Without the limits (--torque-limit, --force-limit) it is resisted.")
    elif free is not None:
        out.print(f"Without the limits (--torque-limit, --force-limit), too: {free.verdict}.")
    if alone.verdict is Verdict.SLIPS and free is not None:
        out.print("The preload alone slips already within these limits.")
    elif alone.verdict is Verdict.SLIPS:
        out.print("The preload alone slips already: its own forces do not balance on the object.")
    elif alone.verdict is Verdict.HOLDS:
        out.print("The preload alone holds.")
    if most.lower > 1:
        times = "as much as you like" if most.unbounded else f"{num(most.lower)} times as much"
        out.print(
            f"More of this disturbance is resisted: {times}. Magnitudes that are resisted need not be an interval."
        )
    elif 0 < most.upper < 1:
        out.print(f"It is too much: nothing above {num(most.upper)} times as much is resisted.")


def show_max(out: Console, grasp: Grasp, direction: Load, answer: MaxAnswer, asked: QueryOptions) -> None:
    _verdict(out, grasp, answer, sentences.max_sentence(answer, direction), asked)
    if answer.witness:
        factor, unit = words.magnitude(direction)
        out.print(f"\nThe equilibrium at {num(factor * answer.lower)} {unit}:", style="bold")
        show_witness(out, answer.witness)
    if answer.interval:
        out.print(f"\n{sentences.interval_sentence(answer, direction)}")
    _written(out, asked)


def show_torques(
    out: Console, grasp: Grasp, wrench: Load, answer: TorquesAnswer, objective: str, asked: QueryOptions
) -> None:
    sentence = sentences.torques_sentence(answer, words.load_text(wrench), objective)
    _verdict(out, grasp, answer, sentence, asked)
    if answer.preload is not None and answer.witness:
        out.print("\nThe equilibrium with these commands:", style="bold")
        show_witness(out, answer.witness)
    _written(out, asked)


def show_replay(out: Console, head: str, done: Replay) -> str:
    """What a saved answer claims and what of it was proved; returns the verdict: its first word."""
    word, style = ("PROVED", "bold green") if done.ok else ("REFUSED", "bold red")
    if done.open and not done.fault:
        word, style = "UNDECIDED", "bold yellow"
    if done.ok and not done.replayed:
        word, style = "NOTHING CLAIMED", "bold yellow"
    out.print(Text.assemble((word, style), "  ", head))
    if not done.ok:
        out.print(done.reason, style="yellow", soft_wrap=True)
    rows = list(_claims(done, ""))
    proved = [row for row in rows if row[-1] == "proved"][MOST_CLAIMS // 2 : -MOST_CLAIMS // 2]
    left = [row for row in rows if row[-1] != "proved"][MOST_CLAIMS:]
    hidden = {id(row) for row in (*proved, *left)}
    shown = []
    for row in rows:
        if proved and row is proved[0]:
            shown.append(("...", f"{words.count(len(proved), 'claim')} between; --json lists all", "", "proved"))
        if id(row) not in hidden:
            shown.append(row)
    if rows:
        out.print()
        out.print(table(["", "claims", "replayed", ""], shown, whole=3))
    if left:
        out.print(f"and {words.count(len(left), 'claim')} more that are not proved; --json lists all", style="dim")
    for line in dict.fromkeys(_not_shown(done)):
        out.print(f"Not shown: {line}.", style="dim", soft_wrap=True)
    return word


def _not_shown(done: Replay) -> Iterator[str]:
    """What an answer and its parts say besides that is not shown."""
    yield from done.not_replayed
    for part in done.parts:
        yield from _not_shown(part)


def _claims(done: Replay, above: str) -> Iterator[tuple[str, str, str, str]]:
    """A row for each claim: where it belongs, what it says, figures, verdict."""
    for part in done.parts:
        name = f"{above}{part.name}"
        if part.claim:
            word = "proved" if part.ok else "refused" if part.fault else "undecided"
            yield name, part.claim, _figures(part), word
        yield from _claims(part, f"{name}, ")


def _figures(part: Replay) -> str:
    """Its figures in a few words."""
    f, out = part.figures, []
    if f.get("exact"):
        out.append("an exact state")
    elif isinstance(f.get("residual"), float):
        out.append(f"residual {f['residual']:.1e}")
    for name, unit in (("leaves", "leaf"), ("arcs", "range of states"), ("slips", "certificate"), ("boxes", "box")):
        count = f.get(name)
        if isinstance(count, int):
            out.append(words.count(count, unit))
    if isinstance(f.get("margin"), float):
        out.append(f"margin {f['margin']:.1e}")
    return ", ".join(out)


def _share(answer: MapAnswer | SweepAnswer) -> Text:
    return Text(sentences.share_word(answer).upper(), VERDICT_STYLES[answer.verdict])


def show_map(out: Console, answer: MapAnswer, asked: QueryOptions) -> None:
    named = [("no preload", answer.passive), ("with preload", answer.preloaded)]
    plane = f"{len(answer.directions)} directions of force in the {answer.plane} plane, {words.place_text(answer.at)}"
    text = f"{plane}: {sentences.cases_text(answer)}, {num(answer.seconds, 3)} s."
    _head(out, answer.grasp, _share(answer), text, asked, answer.grasp.preload)
    rows = [(name, *_counts(curve)) for name, curve in named if curve is not None]
    print_table(out, ["", "any size", "limited", "none", "open", "largest [N]", "smallest [N]"], rows)
    _written(out, asked)


def show_sweep(out: Console, answer: SweepAnswer, asked: QueryOptions) -> None:
    grasp = answer.grasp
    others = {name: value for name, value in grasp.preload.items() if name != answer.actuator}
    _head(out, grasp, _share(answer), sentences.sweep_sentence(answer), asked, others)
    heads = [f"{answer.actuator} [{words.actuator_unit(grasp, answer.actuator)}]"]
    heads += [f"{words.direction_text(d)} [{words.magnitude(d)[1]}]" for d in answer.directions]
    rows = []
    states = [sentences.curve_states(c) for c in answer.curves]
    for i, value in enumerate(answer.values):
        cells = []
        for c, d, state in zip(answer.curves, answer.directions, states, strict=True):
            factor = words.magnitude(d)[0]
            lower, upper = num(factor * c.lower[i]), num(factor * c.upper[i])
            shown = {"unbounded": "any size", "open": f"{lower} to {upper}"}.get(state[i], lower)
            cells.append("not reached" if np.isnan(c.lower[i]) else shown)
        rows.append((num(float(value)), *cells))
    print_table(out, heads, rows)
    _written(out, asked)


def show_witness(out: Console, witness: Witness) -> None:
    """The contacts and actuators of an exact equilibrium."""
    c = witness.state.c.reshape(-1, 3)
    g, x = witness.grasp, witness.state
    rubs, soft = np.linalg.norm(model.friction(g, x.c, x.torsion), axis=1), len(g.soft) > 0
    heads = ["#", "link", "normal [N]", "friction [N]", *(["torsion [N m]"] if soft else [])]
    rows = []
    for i, contact in enumerate(witness.grasp.contacts):
        friction = float(np.linalg.norm(c[i, 1:]))
        limit = contact.friction * c[i, 0]
        share = f"{100 * float(rubs[i]) / limit:.0f} %" if limit > 1e-12 else "–"
        state = witness.contact_states[i]
        torque = [num(x.torsion[i]) if contact.torsion else "–"] if soft else []
        cells = [num(c[i, 0]), num(friction), *torque, share, state, vector(witness.forces[i])]
        rest = ["–", "–", *["–" for _ in torque], "–", state, "–"]
        rows.append((str(i), contact.link or "–", *(cells if state != "open" else rest)))
    print_table(out, [*heads, "of limit", "state", "force [N]"], rows)
    mech = witness.grasp.mechanism
    if mech.a:
        motors = []
        turns = sentences.actuators_that_turn(witness)
        for i, name in enumerate(mech.actuators):
            unit = words.actuator_unit(witness.grasp, name)
            command = witness.grasp.command[i]
            held = "rests" if mech.backdrivable[i] else "held by its gearing"
            moved = "turns" if turns[i] else held
            commanded = f"{num(command)} {unit}" if command else "free" if mech.backdrivable[i] else "locked"
            motors.append((name, commanded, f"{num(witness.state.f[i])} {unit}", moved))
        print_table(out, ["actuator", "commanded", "carries", ""], motors)
    if witness.grasp.has_laws:
        _show_joints(out, witness)
    out.print()
    out.print(f"Checked against equations (1) to (8): residual {witness.residuals.worst:.1e}.", style="dim")


def _show_joints(out: Console, witness: Witness) -> None:
    """What joints carry themselves, by friction, springs and stops."""
    rows = []
    for j, joint in enumerate(witness.grasp.joints):
        unit, reaction = words.joint_unit(witness.grasp, j), float(witness.state.reaction[j])
        if not (joint.friction or joint.torque or joint.stop):
            continue
        rubs = f"friction up to {num(joint.friction)} {unit}" if joint.friction else ""
        stop = f"at its {joint.stop} stop" if joint.stop and joint.stop != "both" else "between two stops"
        how = ", ".join(text for text in (rubs, stop if joint.stop else "") if text)
        spring = f"{num(joint.torque)} {unit}" if joint.torque else "–"
        rows.append((joint.name, f"{num(reaction)} {unit}", spring, how))
    if rows:
        print_table(out, ["joint", "friction, stop", "spring", ""], rows)


def show_contacts(out: Console, contacts: Sequence[Contact]) -> None:
    """Where a hand touches."""
    rows = [
        (str(i), c.link or "–", vector(1e3 * c.position, 4), vector(c.normal), num(c.friction), num(1e3 * c.depth, 2))
        for i, c in enumerate(contacts)
    ]
    print_table(out, ["#", "link", "position [mm]", "normal", "friction", "depth [mm]"], rows)


def show_grasp(out: Console, grasp: Grasp) -> None:
    """A grasp's contacts and joints."""
    show_contacts(out, grasp.contacts)
    if grasp.joints:
        laws = [joint_text(grasp, i) for i in range(grasp.l)]
        columns = 4 if any(laws) else 3
        each = zip(grasp.joints, laws, strict=True)
        rows = [(j.name, j.type, ", ".join(map(str, j.moves)) or "none", law)[:columns] for j, law in each]
        print_table(out, ["joint", "type", "moves contacts", "besides its motor"][:columns], rows)


def _verdict(out: Console, grasp: Grasp, answer: Answer, sentence: str, asked: QueryOptions) -> None:
    word = answer.verdict.upper()
    said = Text(word, VERDICT_STYLES[answer.verdict])
    if sentences.unphysical(answer.witness):
        said = Text(f"{word}?", "bold yellow")
    elif sentences.fragile(answer):
        said = Text(f"{word}, FRAGILE", "bold yellow")
    _head(out, grasp, said, sentence, asked, {} if answer.query == "torques" else grasp.preload)
    if why := sentences.reason(answer, asked.settings()):
        out.print(why, style="yellow")
    out.print(sentences.work(answer), style="dim")


def _head(
    out: Console, grasp: Grasp, word: Text, sentence: str, asked: QueryOptions, commands: Mapping[str, float]
) -> None:
    """word: the verdict; commands: with which it is asked."""
    out.print(Text.assemble(word, "  ", sentence))
    eta = f"; normals off by up to {num(asked.eta)}°" if asked.eta else ""
    after = "; first the squeeze, then the load" if getattr(asked, "loading", "together") != "together" else ""
    facts = f"{words.grasp_text(grasp)}; preload {words.preload_text(grasp)}{eta}{after}"
    out.print(f"{grasp.name}: {facts}", style="dim")
    if laws := laws_text(grasp):
        out.print(laws, style="dim", soft_wrap=True)
    for name, most in asked.limits.torque_limits.items():
        if abs(commands.get(name, 0.0)) > most:
            unit = words.actuator_unit(grasp, name)
            text = (
                f"{name} is commanded {num(commands[name])} {unit} and may carry {num(most)} {unit}: no state has both."
            )
            out.print(text, style="yellow", soft_wrap=True)


def _written(out: Console, asked: QueryOptions) -> None:
    console.say_written(out, getattr(asked, "output", None), getattr(asked, "save", None), asked.report)


def _counts(curve: Curve) -> list[str]:
    states = sentences.curve_states(curve)
    finite = [x for x, s in zip(curve.lower, states, strict=True) if s == "resisted"]
    ends = [num(max(finite)), num(min(finite))] if finite else ["–", "–"]
    return [str(states.count(s)) for s in ("unbounded", "resisted", "slips", "open")] + ends
