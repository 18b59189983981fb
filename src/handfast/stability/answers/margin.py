"""How much a HOLDS leans on: on motion at a real contact stiffness, on its friction, on its normals."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.core.files import same_json
from handfast.model.grasp import Contact, Grasp
from handfast.proofs.replay import Replay
from handfast.readers.grasp_file import to_dict
from handfast.stability.answers.answer import Answer
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.witness import Witness

FRAGILE_MOTION = 1.0  # [mm] a grasp that moves farther than this, and
FRAGILE_LEAN = 5.0  # so many times as far as its pads are squeezed, is fragile,
FRAGILE_FRICTION = 0.1  # so is one that slips with friction changed by this share,
FRAGILE_TILT = 2.5  # [degrees] or with normals tilted by this

UNPROVED_CLAIMS = (
    "motion: that no equilibrium moves less is the search's word",
    "holds: the changed grasps that held had witnesses, which are not kept; of changes between them nothing is known",
    "limit, undecided, checks: what was tried is the course of the search",
)


@dataclass(frozen=True, eq=False)
class Flip:
    """Where a verdict flips as one thing changes, as far as samples tell.

    Attributes:
        holds: the largest change such that it and every smaller one that was tried was witnessed to hold; 0 if none.
        slips: the smallest change that was tried and slips; None if none did.
        limit: the largest change that was to be tried.
        undecided: how many changes that were tried stayed undecided.
        answer: of the changed grasp that slips, with its certificate; `answer.posed.problem.grasp` is that grasp.
        contacts: of tilts, the contacts whose normals are tilted in it;
        towards: (k, 3) unit, and where to, object frame.
    """

    holds: float
    slips: float | None
    limit: float
    undecided: int
    answer: Answer | None = field(repr=False)
    contacts: tuple[int, ...] = ()
    towards: Array | None = field(default=None, repr=False)

    @property
    def certified(self) -> bool:
        """Is there a proof that it slips?"""
        return self.answer is not None and self.answer.certificate is not None

    def fault(self, witness: Witness, changed: Callable[[float], Grasp], limits: GraspLimits) -> str:
        """What is missing for the claim that a changed grasp slips under a witness's load, if the answer is right.

        Args:
            changed: the grasp after a change.
            limits: as asked.
        """
        if self.slips is None:
            return ""
        if self.answer is None or self.answer.posed is None or self.answer.verdict is not Verdict.SLIPS:
            return "without an answer that it slips"
        if self.holds > self.slips:
            return f"it slips at {self.slips:.6g}, and holds up to {self.holds:.6g}"
        p = self.answer.posed.problem
        same = same_json(to_dict(p.grasp), to_dict(changed(self.slips))) and np.array_equal(p.wrench, witness.wrench)
        if not same or p.mdp != witness.mdp or p.limits != limits:
            return "the answer is about another change"
        return ""

    def to_json(self) -> dict[str, Any]:
        """The keys `holds`, `slips`, `limit`, `undecided`, `certified`."""
        names = ("holds", "slips", "limit", "undecided", "certified")
        return {name: getattr(self, name) for name in names}


@dataclass(frozen=True, eq=False)
class Margin:
    """How much a HOLDS leans on.

    Attributes:
        stiffness: [N/m] of every contact.
        held: the answer that holds, whose witness is the equilibrium of least motion that was found.
        less, more: all friction coefficients lessened and raised by the same share.
        tilt: normals tilted, by angles in degrees: one at a time, or all at once.
        checks: how many changed grasps were asked.
        stop: `COMPLETE`, or `INTERRUPTED` by Ctrl-C.
        limits: as asked.
    """

    stiffness: float
    held: Answer = field(repr=False)
    less: Flip
    more: Flip
    tilt: Flip
    checks: int
    stop: Stop
    limits: GraspLimits = field(default=NO_LIMITS, repr=False)

    @property
    def witness(self) -> Witness:
        """The equilibrium of least motion; others may move more."""
        assert self.held.witness is not None
        return self.held.witness

    @property
    def motion(self) -> float:
        """[mm] the largest motion at a contact: of the object, or of the object against the finger."""
        return 1e3 * self.witness.largest_motion / self.stiffness

    @property
    def squeeze(self) -> float:
        """[mm] how far the most loaded contact gives way along its normal: what no equilibrium does without."""
        return 1e3 * float(self.witness.state.c[::3].max()) / self.stiffness

    @property
    def friction(self) -> Flip:
        """Of `less` and `more` the one that slips first; if none does, `less`."""
        return self.more if _slips(self.more) < _slips(self.less) else self.less

    @property
    def fragile(self) -> bool:
        """Is any of the three small?"""
        return bool(self.why)

    @property
    def why(self) -> tuple[str, ...]:
        """Which of "motion", "friction" and "tilt" make it fragile."""
        far = self.motion > FRAGILE_MOTION and self.motion > FRAGILE_LEAN * self.squeeze
        small = {
            "motion": far,
            "friction": _slips(self.friction) <= FRAGILE_FRICTION,
            "tilt": _slips(self.tilt) <= FRAGILE_TILT,
        }
        return tuple(name for name, is_small in small.items() if is_small)

    def verify(self) -> Replay:
        """Replays the equilibrium, and the proof of each flip that one was found for."""
        moves = f"an equilibrium moves by {self.motion:.6g} mm at {self.stiffness:.6g} N/m"
        known = replace(self.held.verify(), name="motion", claim=moves)
        flips = {"less friction": self.less, "more friction": self.more, "tilted normals": self.tilt}
        proofs = [replace(flip.answer.verify(), name=name) for name, flip in flips.items() if flip.answer]
        w = self.witness
        changed = {
            "less friction": lambda x: rubbed(w.grasp, 1 - x),
            "more friction": lambda x: rubbed(w.grasp, 1 + x),
            "tilted normals": lambda x: tilted(w.grasp, self.tilt.contacts, self.tilt.towards, np.radians(x)),
        }
        found = {name: flip.fault(w, changed[name], self.limits) for name, flip in flips.items()}
        faults = (f"{name}: {fault}" for name, fault in found.items() if fault)
        return Replay("margin", "", next(faults, ""), parts=(known, *proofs), not_replayed=UNPROVED_CLAIMS)

    def to_json(self) -> dict[str, Any]:
        """The object under the key `margin` of a check."""
        where = {
            "contacts": list(self.tilt.contacts),
            "towards": [] if self.tilt.towards is None else self.tilt.towards.tolist(),
        }
        return {
            "fragile": self.fragile,
            "why": list(self.why),
            "stiffness": self.stiffness,
            "motion": self.motion,
            "squeeze": self.squeeze,
            "friction": {"less": self.less.to_json(), "more": self.more.to_json()},
            "tilt": self.tilt.to_json() | where,
            "checks": self.checks,
            "stop": str(self.stop),
        }


def _slips(flip: Flip) -> float:
    return np.inf if flip.slips is None else flip.slips


def rubbed(grasp: Grasp, factor: float) -> Grasp:
    """With every friction coefficient times a factor, torsional ones included."""
    contacts = [replace(c, friction=factor * c.friction, torsion=factor * c.torsion) for c in grasp.contacts]
    return _with_contacts(grasp, contacts)


def tilted(grasp: Grasp, moved: Sequence[int], towards: Array | None, angle: float) -> Grasp:
    """With the normals of these contacts tilted by an angle [rad] towards unit vectors (k, 3)."""
    contacts = list(grasp.contacts)
    for i, side in zip(moved, () if towards is None else towards, strict=True):
        contacts[i] = replace(contacts[i], normal=np.cos(angle) * contacts[i].normal + np.sin(angle) * side)
    return _with_contacts(grasp, contacts)


def _with_contacts(grasp: Grasp, contacts: Sequence[Contact]) -> Grasp:
    return Grasp(contacts, grasp.joints, grasp.mechanism, grasp.command, grasp.name)
