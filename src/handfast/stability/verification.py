"""What a replay has shown, of any answer of this half: one type, and its parts.

Nothing of the engine and no solver is needed: witnesses are put into the equations (`model`), certificates are given
to their checker (`certify`), and what an answer says besides is worked out again from these, see `query`.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handfast.core.answer import Checked
from handfast.stability.certify import checker
from handfast.stability.certify.certificate import Certificate, Question
from handfast.stability.certify.claim import caps
from handfast.stability.posed import Posed

# certificates of version 1: 10^4 force scales of motion and of lambda, ends of a search by a scale that was defined
# slightly otherwise. What they cover exactly is in their claim.
FIRST_SHARE = 4.0
FIRST_CAP = FIRST_HIGHEST = 1e4 / FIRST_SHARE
COURSE = "stop, seconds, nodes: the course of the search is recorded, and nothing rests on it"


@dataclass(frozen=True)
class WitnessCheck:
    """A replayed witness: what it stands for, its worst residual, and why it is refused ('' if it is not)."""

    claim: str
    residual: float
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        return {"claim": self.claim, "residual": _number(self.residual), "ok": not self.reason, "reason": self.reason}


@dataclass(frozen=True)
class CertificateCheck:
    """A replayed certificate.

    Attributes:
        claim: what it stands for.
        motion: virtual translations of the object that it covers [N]; None for all, as of version 2.
        leaves, margin: of its proof, see `checker.CheckedCertificate`.
        reason: why it is refused, '' if it is not.
    """

    claim: str
    motion: float | None
    leaves: int
    margin: float
    reason: str = ""

    @classmethod
    def of(cls, c: Certificate, claim: str, reason: str = "") -> CertificateCheck:
        """Replay a certificate; claim: what it has to show, in words; reason: why it is refused in any case."""
        if c.capped:
            reason = reason or _cap_fault(c)
        found = checker.verify(c)
        if found.cap is not None:
            claim = f"{claim}, up to virtual motions of {found.cap:.6g} N"
        return cls(claim, found.cap, found.leaves, found.margin, reason or found.reason)

    def to_json(self) -> dict[str, Any]:
        return {
            "claim": self.claim,
            "motion_cap": self.motion,
            "leaves": self.leaves,
            "margin": _number(self.margin),
            "ok": not self.reason,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class IntervalCheck:
    """Which smaller magnitudes are resisted, replayed.

    Attributes:
        claim: what is claimed.
        arcs, residual: ranges with states, and the worst residual that any of these may have.
        slips: ranges with certificates.
        reason: why it is refused, '' if it is not.
    """

    claim: str
    arcs: int
    residual: float
    slips: int
    reason: str = ""

    def to_json(self) -> dict[str, Any]:
        return {
            "claim": self.claim,
            "arcs": self.arcs,
            "residual": _number(self.residual),
            "slips": self.slips,
            "ok": not self.reason,
            "reason": self.reason,
        }


@dataclass(frozen=True)
class Verified(Checked):
    """What was claimed and replayed.

    Attributes:
        witness, certificate, interval: the parts of an answer about one disturbance; None was neither claimed nor
            there.
        seconds: wall time.
        reason: why it is not all proved: one line; '' if it is.
        parts: of an answer that is made of others, each of these by what it shows.
        not_replayed: what the answer says that cannot be replayed, and why, a line each.
    """

    witness: WitnessCheck | None
    certificate: CertificateCheck | None
    seconds: float
    reason: str
    interval: IntervalCheck | None = None
    parts: Mapping[str, Verified] = field(default_factory=dict)
    not_replayed: tuple[str, ...] = (COURSE,)

    @classmethod
    def of_parts(
        cls, parts: Mapping[str, Verified], seconds: float, reason: str = "", not_replayed: tuple[str, ...] = ()
    ) -> Verified:
        """Of an answer that is made of others: all of them have to be proved. reason: why it is refused in any case."""
        faults = (f"{name}: {part.reason}" for name, part in parts.items() if part.reason)
        reason = reason or next(faults, "")
        return cls(None, None, seconds, reason, parts=dict(parts), not_replayed=(*not_replayed, COURSE))

    @property
    def replayed(self) -> tuple[str, ...]:
        """What was replayed and found right, a line each."""
        own = tuple(p.claim for p in (self.witness, self.certificate, self.interval) if p and not p.reason)
        return own + tuple(f"{name}: {line}" for name, part in self.parts.items() for line in part.replayed)

    def to_json(self) -> dict[str, Any]:
        own: dict[str, Any] = {
            "witness": self.witness.to_json() if self.witness else None,
            "certificate": self.certificate.to_json() if self.certificate else None,
            "interval": self.interval.to_json() if self.interval else None,
        }
        parts = {"parts": {name: part.to_json() for name, part in self.parts.items()}} if self.parts else {}
        return self._json(own | parts)


def verified_certificate(c: Certificate) -> Verified:
    """Does a certificate by itself prove what it claims?"""
    start = time.monotonic()
    done = CertificateCheck.of(c, c.claim)
    return Verified(
        None, done, time.monotonic() - start, done.reason and f"certificate: {done.reason}", not_replayed=()
    )


def _cap_fault(c: Certificate) -> str:
    """What is wrong with the caps of version 1: they are a matter of the question, not of the file."""
    p, goal = Posed.of(c.question)
    least = FIRST_CAP * goal.force_unit(p)
    if c.cap_r is None or c.cap_q is None:
        return ""
    least_r, least_q = caps(c.question.grasp, least)
    if (c.cap_r >= least_r).all() and (c.cap_q >= least_q).all():
        return ""
    return f"it covers motions up to {c.cap_r[:3].min():.6g} N only; this question's begin to matter at {least:.6g} N"


def first_range(q: Question, lo: float, hi: float) -> tuple[float, float]:
    """What a certificate of version 1 has to cover at least: its searches ended a little earlier or later."""
    if q.goal.homogeneous:
        return FIRST_SHARE * lo, min(hi, FIRST_HIGHEST / Posed.of(q).problem.direction_scale)
    return lo, max(lo, hi / FIRST_SHARE)


def _number(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
