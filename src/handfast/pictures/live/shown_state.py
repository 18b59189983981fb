"""What is drawn for a state and what is known about it; pure, and knows neither threads nor the page."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

from handfast.core.answer import Verdict
from handfast.core.arrays import Array, Mask
from handfast.model.grasp import Grasp
from handfast.pictures import words
from handfast.pictures.live.answering import QUICK, PlaneMap, Reply
from handfast.pictures.live.view_state import LOAD_ARROW, MIN_LOAD, Stage, ViewState
from handfast.stability.answers import MaxAnswer

Tone = Literal["holds", "slips", "undecided", "unknown"]
RGB = tuple[int, int, int]
TONE_COLORS: dict[Tone, RGB] = {
    "holds": (38, 145, 84),
    "slips": (208, 52, 44),
    "undecided": (217, 130, 0),
    "unknown": (150, 150, 150),
}
GREY: RGB = (165, 165, 165)
FORCE_COLOR: RGB = (47, 109, 179)
WOOD: RGB = (222, 199, 158)
STICK_COLOR: RGB = (43, 43, 43)
SLIDE_COLOR: RGB = (122, 92, 196)
OPEN_COLOR: RGB = (205, 205, 205)
GREYING_DELAY = 0.25  # [s] without an answer after which the last one is greyed
MAX_FORCE_ARROW = 1.2  # grasp sizes, of a contact force
MIN_ARROW = 0.02  # grasp sizes: a shorter arrow is not drawn
TWO_HEADS = 0.8  # of a torque's arrow, where its second head ends
CURVE: RGB = (47, 109, 179)
SLIP_TRAVEL = 0.6  # of the grasp's size, that the farthest contact goes
PERIOD = 2.4  # [s] of one repetition
REST_SHARE = 0.25  # of it, at the end, in which the object stays
MIN_SHOWN_SIZE = 1e-9


@dataclass(frozen=True, eq=False)
class SlipMotion:
    """A motion of the object about its origin.

    Attributes:
        twist: (6,) translation [m] and rotation [rad] at its end.
        why: where it comes from, in a few words.
    """

    twist: Array
    why: str

    def pose(self, seconds: float) -> tuple[Array, Array]:
        """Position (3,) [m] and rotation (3, 3) of the object after this time, over and over again."""
        phase = min((seconds / PERIOD % 1.0) / (1 - REST_SHARE), 1.0)
        share = phase * phase * (3 - 2 * phase)
        return share * self.twist[:3], Rotation.from_rotvec(share * self.twist[3:]).as_matrix()


@dataclass(frozen=True, eq=False)
class ShownMap:
    """The map as drawn, a closed line.

    Attributes:
        outline: (n, 3) [m] of the lower bounds, cut at the rim.
        cut: (n,) bool, larger than the rim, or unbounded.
        grey: is it of another state?
    """

    at: Array
    outline: Array
    cut: Mask
    grey: bool


@dataclass(frozen=True, eq=False)
class Shown:
    """Everything that changes with a state and its reply.

    Attributes:
        tone: of the load, of the object and of the headline.
        grey: is the reply of an older state, or late?
        headline, sentences: in words.
        load: (k, 2, 3) [m] from and to, of the force, and two of the torque; drawn in the tone.
        tip: (3,) [m] where the load is grabbed to be dragged.
        forces: (k, 2, 3) of the hand on the object.
        contacts: the colours of the contacts: sticking, sliding, open, or unknown.
        share: size of the load over the largest in its direction; None if that is not known or not bounded.
        motion: how it goes if it slips.
    """

    tone: Tone
    grey: bool
    headline: str
    sentences: tuple[str, ...]
    load: Array
    tip: Array
    forces: Array
    contacts: tuple[RGB, ...]
    share: float | None
    map: ShownMap | None
    motion: SlipMotion | None

    @property
    def color(self) -> RGB:
        """Of the load."""
        return GREY if self.grey else TONE_COLORS[self.tone]

    @property
    def object_color(self) -> RGB:
        """Of the object: its own, tinted by the verdict."""
        tint = GREY if self.grey else TONE_COLORS[self.tone]
        share = 0.25 if self.tone == "unknown" else 0.45
        r, g, b = (round((1 - share) * w + share * t) for w, t in zip(WOOD, tint, strict=True))
        return r, g, b


def shown(state: ViewState, stage: Stage, reply: Reply | None, waited: float = 0.0, fault: str = "") -> Shown:
    """What the page shows.

    Args:
        reply: the last that was told, of this state or of an older one; None if there is none of this grasp.
        waited: [s] for which an answer has been due.
        fault: why there is no answer.
    """
    same = reply is not None and reply.state is state
    if reply is not None and reply.state.number != state.number:
        reply = None
    grey = bool(fault) or reply is None or (not same and waited > GREYING_DELAY)
    tone: Tone = "unknown" if fault or reply is None else _tone(reply.verdict)
    grasp = state.grasp
    witness = reply.check.witness if reply and reply.check else None
    forces, colors = np.zeros((0, 2, 3)), (GREY,) * grasp.m
    if witness is not None:
        forces = force_arrows(grasp.positions, witness.forces, stage)
        kind = {"stick": STICK_COLOR, "slide": SLIDE_COLOR, "open": OPEN_COLOR}
        colors = tuple(kind[s] for s in witness.contact_states)
    arrows, tip = load_arrows(state, stage)
    slips = same and tone == "slips"
    return Shown(
        tone,
        grey,
        headline(tone, grey=grey, fault=fault),
        sentences(state, reply if same else None, fault),
        arrows,
        tip,
        forces,
        colors,
        load_share(state, reply) if same else None,
        _map(reply.map, state, stage) if reply and reply.map and state.map_axes is not None else None,
        slip_motion(state.asked, state.wrench, reply.most if reply else None) if slips else None,
    )


def _tone(verdict: Verdict) -> Tone:
    return {Verdict.HOLDS: "holds", Verdict.SLIPS: "slips"}.get(verdict, "undecided")  # type: ignore[return-value]


def headline(tone: Tone, *, grey: bool = False, fault: str = "") -> str:
    """HOLDS, SLIPS, UNDECIDED, or that it is being computed."""
    if fault:
        return "NO ANSWER"
    return "…" if tone == "unknown" else tone.upper() + (" …" if grey else "")


def sentences(state: ViewState, reply: Reply | None, fault: str = "") -> tuple[str, ...]:
    """The load, what is shown about it, the largest in its direction, and whether proofs were replayed."""
    load = words.load_text(np.r_[state.force, state.torque])
    where = words.place_text(np.round(state.at, 4)) if state.size > MIN_LOAD else ""
    asked = f"Load: {load} {where}".strip() + "."
    if fault:
        return asked, fault
    if reply is None:
        return (asked,)
    said = [asked]
    if reply.check is None:
        said.append(f"No forces at these {words.count(state.grasp.m, 'contact')} balance it, whatever the friction.")
    if reply.verdict is Verdict.UNDECIDED:
        said.append("Neither was shown within the time that the page gives a question.")
    most, torque = reply.most, state.is_torque
    unit = "N·m" if torque else "N"
    if most is not None:
        if most.unbounded:
            said.append("In this direction any size is resisted.")
        elif most.verdict is Verdict.SLIPS:
            said.append("In this direction nothing is resisted, however small.")
        elif most.verdict is Verdict.HOLDS and not bounded(most):
            size = f"{words.num(most.lower, 3)} {unit}"
            said.append(f"In this direction {size} is resisted; how much more was not shown within the time.")
        elif most.verdict is Verdict.HOLDS:
            said.append(f"Largest in this direction: {words.num(most.lower, 3)} {unit}.")
    if reply.replayed:
        said.append("Replayed by the checkers.")
    return tuple(said)


def bounded(most: MaxAnswer) -> bool:
    """Have both bounds of a largest load met, as far as the page asks for it?"""
    return bool(most.upper <= (1 + 2 * QUICK.gap) * most.lower)


def load_share(state: ViewState, reply: Reply | None) -> float | None:
    """Size of the load over the largest in its direction; inf where nothing is resisted, 0 where anything is; None
    where the largest is not known."""
    if reply is not None and reply.check is None:
        return float("inf")
    if reply is None or reply.most is None:
        return None
    most = reply.most
    if most.unbounded:
        return 0.0
    if most.verdict is Verdict.UNDECIDED or (most.verdict is Verdict.HOLDS and not bounded(most)):
        return None
    if not most.lower > 0:
        return float("inf") if state.size > MIN_LOAD else 0.0
    return state.size / most.lower


def load_arrows(state: ViewState, stage: Stage) -> tuple[Array, Array]:
    """(k, 2, 3) arrows of the load, cut at the longest, and the point (3,) at the end of the first."""
    at, arrows = state.at, []
    tip = at + 0.3 * stage.size * state.frame[:, 0]
    for v, scale, is_torque in (
        (state.torque, stage.metres_per_newton_metre, True),
        (state.force, stage.metres_per_newton, False),
    ):
        step = _cut(scale * v, LOAD_ARROW * stage.size)
        if np.linalg.norm(step) > MIN_ARROW * stage.size:
            arrows.append([at, at + step])
            tip = at + step
            if is_torque:
                arrows.append([at, at + TWO_HEADS * step])
    return np.array(arrows, dtype=float).reshape(-1, 2, 3), tip


def force_arrows(positions: Array, forces: Array, stage: Stage) -> Array:
    """(k, 2, 3) contact forces on the load's scale, from the contacts, all shrunk alike if one were too long."""
    steps = stage.metres_per_newton * forces
    longest = float(np.linalg.norm(steps, axis=1).max(initial=0.0))
    steps = steps * min(1.0, MAX_FORCE_ARROW * stage.size / max(longest, 1e-30))
    drawn = np.linalg.norm(steps, axis=1) > MIN_ARROW * stage.size
    return np.stack([positions, positions + steps], axis=1)[drawn]


def _map(found: PlaneMap, state: ViewState, stage: Stage) -> ShownMap:
    scale = stage.metres_per_newton_metre if found.is_torque else stage.metres_per_newton
    rim = LOAD_ARROW * stage.size
    reach = scale * found.sizes[found.known]
    cut = reach >= rim
    outline = found.at + np.minimum(reach, rim)[:, None] * found.directions[found.known]
    return ShownMap(found.at, outline, cut, found.key != state.map_key)


def _cut(v: Array, longest: float) -> Array:
    length = float(np.linalg.norm(v))
    return v * min(1.0, longest / length) if length > 0 else v


# --- how the object goes when it slips, exaggerated: a motion to look at, which nothing else rests on ---


def slip_motion(grasp: Grasp, wrench: Array, most: MaxAnswer | None) -> SlipMotion | None:
    """The motion of the equilibrium at the largest load of this direction, or else the way out that is free.

    Args:
        wrench: (6,) the load that is not resisted.
        most: the largest load in its direction, if it is known.
    """
    if most is not None and most.found is not None and most.lower > 0:
        found = _sized(grasp, most.found.state.r)  # that of least motion hardly goes where it slips
        if found is not None:
            return SlipMotion(found, "as it moves under the largest load that is resisted, enlarged")
    found = _sized(grasp, escape(grasp, wrench))
    return None if found is None else SlipMotion(found, "the way out along which no contact is pressed")


def escape(grasp: Grasp, wrench: Array) -> Array:
    """(6,) motion nearest to a load's own direction that presses no contact: fingers stand still, nothing rubs.

    The load's projection onto the cone of motions that separate, or slide on, every contact: the remainder of the load
    after the normal forces of least squares, lengths in grasp sizes.
    """
    scale = np.r_[np.ones(3), np.full(3, 1 / grasp.size)]
    normals = scale[:, None] * grasp.G[:, ::3]
    load = scale * wrench
    length = float(np.linalg.norm(load))
    if length < MIN_SHOWN_SIZE:
        return np.zeros(6)
    forces, left = nnls(normals, -load / length)
    return scale * (load / length + normals @ forces) if left > MIN_SHOWN_SIZE else np.zeros(6)


def _sized(grasp: Grasp, r: Array) -> Array | None:
    """A motion scaled so that the farthest contact goes `SLIP_TRAVEL`; None if there is none."""
    moved = r[:3] + np.cross(r[3:], grasp.positions)
    farthest = float(np.linalg.norm(moved, axis=1).max())
    size = float(np.linalg.norm(r[:3]) + grasp.size * np.linalg.norm(r[3:]))
    if not size > MIN_SHOWN_SIZE * max(1.0, grasp.size):
        return None
    return SLIP_TRAVEL * grasp.size / max(farthest, 0.2 * size) * r
