"""The report's tables."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from handfast.model.grasp import Grasp
from handfast.pictures import Entry, sentences, words
from handfast.pictures.page_parts import BAD, table
from handfast.pictures.words import joint_text, num, vector
from handfast.stability.answers import MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.margin import Margin
from handfast.stability.problem import model
from handfast.stability.problem.witness import Witness
from handfast.stability.studies.maps import Curve, MapAnswer, SweepAnswer

MIN_SHOWN_DEPTH = 1e-9  # [m]; depths below are rounding
EQUATIONS = {
    "object_balance": "(1) object in equilibrium",
    "joint_balance": "(2) joint torques carried",
    "couplings": "rigid couplings, A q = 0",
    "normal": "(4) contact springs",
    "cone": "(5) inside the friction cones",
    "dissipation": "(6), (7) friction opposes sliding",
    "actuators": "(8) actuators",
}


def margin_table(margin: Margin) -> str:
    """What a HOLDS leans on."""
    rows = [list(row) for row in sentences.margin_rows(margin)]
    note = f'<p class="note">{escape(sentences.margin_note(margin))}</p>'
    return table(["#", "#", "#"], rows, "What it leans on") + note


def contact_table(witness: Witness) -> str:
    """Forces per contact, and for those that slide whether friction opposes it."""
    c = witness.state.c.reshape(-1, 3)
    g, x = witness.grasp, witness.state
    rubs = model.friction(g, x.c, x.torsion)
    slides = model.sliding(g, model.relative_motion(g, x.r, x.q), model.turning(g, x.r, x.q))
    soft = len(g.soft) > 0
    forces, sliding = [], []
    for i, contact in enumerate(witness.grasp.contacts):
        name, state = [str(i), contact.link or "–"], witness.contact_states[i]
        friction, speed = float(np.linalg.norm(rubs[i])), float(np.linalg.norm(slides[i]))
        if state == "open":
            forces.append([*name, state, *["–"] * (5 if soft else 4)])
            continue
        limit = contact.friction * c[i, 0]
        share = f"{100 * friction / limit:.0f} %" if limit > 0 else "–"
        torque = [f"{num(x.torsion[i])} N m" if contact.torsion else "–"] if soft else []
        own = num(float(np.linalg.norm(c[i, 1:])))
        forces.append([*name, state, num(c[i, 0]), own, *torque, share, vector(witness.forces[i])])
        if state == "slide":
            angle = 180.0
            if friction > 1e-12:
                angle = float(np.degrees(np.arccos(np.clip(rubs[i] @ slides[i] / (friction * speed), -1, 1))))
            says = "opposes it" if angle > 179 else f"{BAD}pushes along it" if angle < 90 else "at an angle to it"
            sliding.append([*name, num(speed), num(friction), f"{angle:.0f}°", says])
    heads = [
        "#contact",
        "#link",
        "#state",
        "normal [N]",
        "friction [N]",
        *(["torsion"] if soft else []),
        "of its limit",
        "#force on the object [N]",
    ]
    out = table(heads, forces, "Contacts")
    heads = ["#contact", "#link", "sliding [N]", "friction [N]", "angle between", "#friction"]
    return out + table(heads, sliding, "Sliding and friction")


def actuator_table(witness: Witness) -> str:
    """Forces against commands, and the joint torques they come from."""
    grasp, mech = witness.grasp, witness.grasp.mechanism
    turns = sentences.actuators_that_turn(witness)
    rows = []
    for i, name in enumerate(mech.actuators):
        moves = "turns" if turns[i] else "rests" if mech.backdrivable[i] else "held by its gearing"
        carries = f"{num(witness.state.f[i])} {words.actuator_unit(grasp, name)}"
        rows.append([name, words.command_text(grasp, i), carries, moves])
    out = table(["actuator", "#commanded", "#carries", "#state"], rows, "Actuators")
    tau = model.joint_torques(grasp, witness.state.c, witness.state.torsion)
    rows = [
        [j.name, f"{num(tau[k])} {words.joint_unit(grasp, k)}", num(witness.state.q[k])]
        for k, j in enumerate(grasp.joints)
    ]
    heads = ["joint", "#torque of the contacts", "virtual motion"]
    if grasp.has_laws:
        heads = [*heads[:2], "#carried by friction and stops", "#given torque", heads[2]]
        units = [words.joint_unit(grasp, k) for k in range(grasp.l)]
        own = [f"{num(x)} {unit}" for x, unit in zip(witness.state.reaction, units, strict=True)]
        given = [f"{num(j.torque)} {unit}" for j, unit in zip(grasp.joints, units, strict=True)]
        rows = [[*row[:2], *more, row[2]] for row, *more in zip(rows, own, given, strict=True)]
    return out + table(heads, rows, "Joints")


def energy_table(witness: Witness) -> str:
    """Where the virtual work goes, term by term."""
    e = witness.energy
    scale = abs(e.disturbance) + abs(e.preload) + abs(e.stored) or 1.0

    def work(x: float) -> str:
        return num(x) if abs(x) > 1e-12 * scale else "0"

    rows = [
        ["put in by the disturbance, w·r", work(e.disturbance), ""],
        ["put in by the preload", work(e.preload), ""],
        ["stored in the contact springs", work(e.stored), ""],
    ]
    for i, (lost, most) in enumerate(zip(e.friction, e.maximum, strict=True)):
        bad = BAD if lost < -sentences.CREATED * scale else ""
        verb = "fed in by friction" if bad else "dissipated by friction"
        rows.append([f"{verb} at contact {i}", bad + work(lost), work(most)])
    if e.created > 0 and sentences.unphysical(witness):
        rows.append(["created out of nothing", BAD + num(e.created), "0"])
    heads = ["#virtual work", "N²", "the maximum dissipation principle demands"]
    note = f'<p class="note">In minus out: {abs(e.residual) / scale:.1e} of the total.</p>'
    return table(heads, rows, "Energy") + note


def residual_table(witness: Witness) -> str:
    """How well the equilibrium satisfies each equation."""
    left_out = "left out" if not witness.mdp else None
    rows = []
    for name, text in EQUATIONS.items():
        residual = getattr(witness.residuals, name)
        value = f"{residual:.1e}" if residual else "0"
        extra = f" with (17), {num(np.degrees(witness.eta))}°" if name == "normal" and witness.eta else ""
        rows.append([text + extra, left_out if left_out and name == "dissipation" else value])
    return table(["#equation", "relative residual"], rows, "Checked against the model")


def checks_table(entries: Sequence[Entry]) -> str:
    """Many loads at a glance: verdict, the largest normal force, and what the contacts do."""
    rows = []
    for entry in entries:
        answer, w = entry.answer, getattr(entry.answer, "witness", None)
        verdict = f"{answer.verdict}?" if sentences.unphysical(w) else str(answer.verdict)
        cells = ["–", "–"]
        if w is not None:
            states = w.contact_states
            does = [f"{states.count(s)} {s}" for s in ("stick", "slide", "open") if s in states]
            cells = [num(w.state.c[::3].max()), ", ".join(does)]
        rows.append([entry.title, BAD + verdict if verdict == "slips" else verdict, *cells])
    return table(["#load", "#verdict", "largest normal force [N]", "#contacts"], rows, "The loads")


def bounds_table(answer: MaxAnswer | TorquesAnswer, entry: Entry) -> str:
    """Both bounds of a number, and the commands of an optimum."""
    if isinstance(answer, MaxAnswer):
        d = entry.direction if entry.direction is not None else np.eye(6)[0]
        factor, unit = words.magnitude(d)
        upper = "unbounded" if answer.unbounded else f"{num(factor * answer.upper, 6)} {unit}"
        what = "resisted, largest tried" if answer.unbounded else "resisted, witnessed"
        rows = [[what, f"{num(factor * answer.lower, 6)} {unit}"], ["no more than", upper]]
        if not answer.unbounded and np.isfinite(answer.gap):
            rows.append(["gap", f"{100 * answer.gap:.2g} %"])
        return table(["#", "#bound"], rows, "Bounds")
    rows = [["at least", num(answer.lower, 6)], ["suffices, witnessed", num(answer.upper, 6)]]
    out = table(["#", "#largest command" if entry.objective == "max" else "#sum of commands"], rows, "Bounds")
    if answer.preload is not None and answer.witness is not None:
        grasp = answer.witness.grasp
        rows = [[n, f"{num(v)} {words.actuator_unit(grasp, n)}" if v else "locked"] for n, v in answer.preload.items()]
        out += table(["actuator", "#command"], rows, "Commands")
    return out


def map_table(answer: MapAnswer) -> str:
    """Every direction's bounds, folded away."""
    heads = ["angle [°]", "without preload [N]", "with preload [N]"][: 1 + len(answer.curves)]
    angles = 360.0 * np.arange(len(answer.directions)) / len(answer.directions)
    rows = [[num(a), *(_bounds(c, i, 1.0) for c in answer.curves)] for i, a in enumerate(angles)]
    first, second = answer.plane
    note = f'<p class="note">Angles run from +{first} towards +{second}.</p>'
    return f"<details><summary>All directions</summary>{table(heads, rows)}{note}</details>"


def sweep_table(answer: SweepAnswer) -> str:
    """Every command's bounds."""
    heads = [f"{answer.actuator} [{words.actuator_unit(answer.grasp, answer.actuator)}]"]
    heads += [f"{words.direction_text(d)} [{words.magnitude(d)[1]}]" for d in answer.directions]
    factors = [words.magnitude(d)[0] for d in answer.directions]
    rows = [
        [num(float(v)), *(_bounds(c, i, f) for c, f in zip(answer.curves, factors, strict=True))]
        for i, v in enumerate(answer.values)
    ]
    return table(heads, rows, "Numbers")


def search_note(answer: Answer) -> str:
    """What the search took."""
    return f'<p class="note">The search: {escape(sentences.work(answer))}.</p>'


def grasp_table(grasp: Grasp) -> str:
    """Contacts, joints and actuators as given."""
    rows = [
        [
            str(i),
            c.link or "–",
            vector(1e3 * c.position, 4),
            vector(c.normal),
            num(c.friction),
            num(1e3 * c.depth, 2) if abs(c.depth) >= MIN_SHOWN_DEPTH else "0",
        ]
        for i, c in enumerate(grasp.contacts)
    ]
    heads = ["#contact", "#link", "#position [mm]", "#normal, into the object", "friction", "depth [mm]"]
    out = table(heads, rows, "Contacts")
    rows = [
        [j.name, j.type, vector(j.axis), vector(1e3 * j.origin, 4), ", ".join(map(str, j.moves)) or "none"]
        for j in grasp.joints
    ]
    laws = [joint_text(grasp, i) for i in range(grasp.l)]
    heads = ["joint", "type", "#axis", "#through [mm]", "#moves contacts"]
    if any(laws):
        heads, rows = [*heads, "#besides its motor"], [[*row, law] for row, law in zip(rows, laws, strict=True)]
    out += table(heads, rows, "Joints")
    mech = grasp.mechanism
    rows = []
    for i, name in enumerate(mech.actuators):
        drives = [_times(r, j.name) for j, r in zip(grasp.joints, mech.R[i], strict=True) if r]
        kind = " (tendon)" if mech.tendon[i] else " (backdrivable)" if mech.backdrivable[i] else ""
        rows.append([name + kind, " + ".join(drives), words.command_text(grasp, i)])
    out += table(["actuator", "#moves", "#commanded"], rows, "Actuators")
    rows = [
        [" + ".join(_times(a, j.name) for j, a in zip(grasp.joints, row, strict=True) if a) + " = 0"] for row in mech.A
    ]
    return out + table(["#coupling"], rows, "Couplings")


def _times(factor: float, name: str) -> str:
    return name if factor == 1 else f"−{name}" if factor == -1 else f"{num(factor)} × {name}"


def _bounds(curve: Curve, i: int, factor: float) -> str:
    if np.isnan(curve.lower[i]):
        return "not reached"
    if curve.unbounded[i]:
        return "∞"
    lower, upper = num(factor * curve.lower[i]), num(factor * curve.upper[i])
    return lower if lower == upper or sentences.curve_states(curve)[i] != "open" else f"{lower} to {upper}"
