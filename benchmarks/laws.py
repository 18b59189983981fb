"""Laws that join the questions about stability: what one answer says, the others must not contradict.

    python -m benchmarks.laws [--count 100] [--first 1400000] [--limit 10] [--interval-limit 10]

Fresh random grasps of 3 to 5 contacts of the kinds of `no_cap.py`. Of each:

    interval  `check` holds where `maximum(..., interval=True)` shows that magnitudes are resisted, and slips in its
              holes and above its upper bound
    frames    turning and moving the frame, the order of contacts, joints and actuators, units of length and of force
              change no verdict, and bounds overlap
    commands  commands from `torques` hold in `check`, and none below its lower bound do
    maps      a force map has the verdicts of the maxima in its directions, and their bounds overlap
    proofs    `handfast.verify` accepts every answer to the questions above, and every answer says that it was verified

A law asserts what the answers claim and no more. Where an answer was stopped early, or is proved for motions up to a
cap only, what would contradict it is *open*, not broken. Writes results/laws.json after every grasp, and goes on where
it was stopped. `tests/stability/test_laws.py` has the same laws as property tests.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from benchmarks.machine import describe
from benchmarks.no_cap import KINDS, question
from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies import maps
from handfast.stability.studies import questions as queries

RESULTS = Path(__file__).parent / "results" / "laws.json"
SIZES = (3, 4, 5)
BELOW, ABOVE = 0.999, 1.001  # times the lower and the upper bound of a maximum
LESS = 0.99  # times the lower bound of commands
MAGNITUDES = 3  # at random, below and above
COMMANDS = 2  # at random, below the lower bound
DIRECTIONS = 4  # of a map
ROUNDING = 1e-9  # relative, between bounds in different units
THOUSAND = 1e3

A = TypeVar("A", bound=Answer)


@dataclass
class Tally:
    """How often a law was kept, where it could not be decided, where it was broken."""

    kept: int = 0
    open: list[str] = field(default_factory=list)
    broken: list[str] = field(default_factory=list)

    def claim(self, what: str, right: bool, *, sure: bool = True) -> None:
        """Something that has to be; if it rests on an answer that is not `sure`, it is open where it is not."""
        if right:
            self.kept += 1
        else:
            (self.broken if sure else self.open).append(what)

    def verdict(self, what: str, answer: CheckAnswer, expected: Verdict, *, sure: bool = True) -> None:
        """A check has to answer as expected."""
        sure = sure and not (stopped(answer) or capped(answer))
        self.claim(
            f"{what}: {answer.verdict}, {answer.stop}; expected {expected}", answer.verdict is expected, sure=sure
        )

    def overlap(self, what: str, one: tuple[float, float], two: tuple[float, float], *, sure: bool = True) -> None:
        """Two pairs of bounds of the same number have to overlap."""
        above = max(one[0], two[0]) <= min(one[1], two[1]) * (1 + ROUNDING)
        self.claim(f"{what}: {one[0]!r} to {one[1]!r} and {two[0]!r} to {two[1]!r}", above, sure=sure)


@dataclass(frozen=True)
class Verbs:
    """The questions of Handfast; others take their places where the laws are tested."""

    check: Callable[..., CheckAnswer] = queries.check
    maximum: Callable[..., MaxAnswer] = queries.maximum
    torques: Callable[..., TorquesAnswer] = queries.torques
    force_map: Callable[..., maps.MapAnswer] = queries.force_map


@dataclass
class Subject:
    """A grasp, what is asked about it, and what comes of it.

    Attributes:
        direction, base: (6,) of the maximum [N, N m], object frame. options: what all questions share.
        seed: of what the laws draw. limit, interval_limit: [s] per question.
        tallies: by law; that of `proofs` grows with every question.
    """

    kind: str
    grasp: Grasp
    direction: Array
    base: Array
    options: dict[str, Any]
    seed: int
    verbs: Verbs = field(default_factory=Verbs)
    limit: float = 10.0
    interval_limit: float = 10.0
    tallies: dict[str, Tally] = field(default_factory=dict)

    @classmethod
    def of(cls, k: int, first: int, **rest: Any) -> Subject:
        """The k-th grasp."""
        kind, grasp, direction, options = question(k, first, SIZES)
        base = options.pop("base", np.zeros(6))
        return cls(kind, grasp, direction, base, options, first + k, **rest)

    def tally(self, law: str) -> Tally:
        return self.tallies.setdefault(law, Tally())

    def rng(self, law: str) -> np.random.Generator:
        """Always the same for one law and grasp, whichever other laws are asked for."""
        return np.random.default_rng([self.seed, list(LAWS).index(law)])

    def check(self, wrench: Array, grasp: Grasp | None = None) -> CheckAnswer:
        return self._proved(self.verbs.check(grasp or self.grasp, wrench, settings=self._settings(), **self.options))

    def maximum(self, direction: Array, grasp: Grasp | None = None, base: Array | None = None) -> MaxAnswer:
        """Above this subject's base load, unless another one is given."""
        rest = {"base": self.base if base is None else base, "settings": self._settings()} | self.options
        return self._proved(self.verbs.maximum(grasp or self.grasp, direction, **rest))

    def interval(self) -> MaxAnswer:
        settings = self._settings(self.interval_limit)
        rest = {"base": self.base, "interval": True, "settings": settings} | self.options
        return self._proved(self.verbs.maximum(self.grasp, self.direction, **rest))

    def torques(self, wrench: Array, objective: str = "max") -> TorquesAnswer:
        rest = {"objective": objective, "settings": self._settings()} | self.options
        return self._proved(self.verbs.torques(self.grasp, wrench, **rest))

    def _settings(self, limit: float | None = None) -> Settings:
        return Settings(timeout=limit or self.limit, jobs=1)

    def _proved(self, answer: A) -> A:
        """The answer, after the law of proofs has been applied to it."""
        tally, name = self.tally("proofs"), type(answer).__name__
        done = answer.verify()
        tally.claim(f"{name} refused: {done.reason}", done.ok)
        tally.claim(f"{name} not verified", answer.verified)
        tally.claim(f"{name} stopped: {answer.stop}", not stopped(answer), sure=False)
        if answer.verdict is Verdict.SLIPS:
            tally.claim(f"{name}: slips, nothing replayed", done.part("certificate") is not None)
        proof = done.part("certificate")
        cap = proof.figures.get("motion_cap") if proof else None
        tally.claim(
            f"{name}: up to motions of {cap} only; it says {answer.proof_json()}", (cap is not None) == capped(answer)
        )
        return answer


def stopped(answer: Answer) -> bool:
    """Was the search stopped early?"""
    return answer.stop is not Stop.COMPLETE


def capped(answer: Answer) -> bool:
    """Is what it proves about motions up to a cap only?"""
    return answer.proof_json()["motion_cap"] is not None


# --- a maximum and the checks along its direction ---------------------------------------------------


def shown(answer: MaxAnswer, s: float) -> Verdict | None:
    """What a maximum says of a magnitude; None if nothing."""
    p, _ = answer.posed
    if s > answer.upper:
        return Verdict.SLIPS if s < p.last_magnitude else None
    if s == answer.lower and answer.verdict is Verdict.HOLDS:
        return Verdict.HOLDS
    said = answer.interval
    if said is None or not 0 < s < answer.lower:
        return None
    if any(first < s < last for first, last in said.holes):
        return Verdict.SLIPS
    fine = said.resolution * max(s, min(p.unit_magnitude, answer.lower))
    near = any(first - fine <= s <= last + fine for first, last in said.holes)
    return None if near or any(first <= s <= last for first, last in said.unproved) else Verdict.HOLDS


def interval(subject: Subject) -> None:
    """Checks along a direction answer what the maximum shows of their magnitudes."""
    tally, rng, answer = subject.tally("interval"), subject.rng("interval"), subject.interval()
    p, _ = answer.posed
    inside = np.r_[rng.uniform(0, 1, MAGNITUDES), 10 ** rng.uniform(-4, 0)]
    outside = np.r_[ABOVE, 10 ** rng.uniform(np.log10(ABOVE), 1, MAGNITUDES)]
    sizes = [answer.lower, BELOW * answer.lower, *(inside * answer.lower)] if answer.lower > 0 else []
    if answer.interval:
        sizes += [(1 - t) * a + t * b for a, b in answer.interval.holes for t in (0.001, 0.5, 0.999)]
    sizes += list(outside * (answer.upper or p.unit_magnitude * 1e-3))
    for s in sizes:
        expected = shown(answer, s)
        if expected is not None:
            sure = expected is Verdict.HOLDS or not capped(answer)
            tally.verdict(
                f"check at {s!r}, {s / (answer.lower or s)!r} of lower",
                subject.check(subject.base + s * subject.direction),
                expected,
                sure=sure,
            )


# --- other frames, orders and units -----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Change:
    """The same grasp in other words: frame, order, units.

    Attributes:
        R, p: a point x [m] of the object is R x + p in the new frame.
        length, force: new units in one of the old ones.
        backwards: are contacts, joints and actuators listed in the opposite order?
    """

    R: Array = field(default_factory=lambda: np.eye(3))
    p: Array = field(default_factory=lambda: np.zeros(3))
    length: float = 1.0
    force: float = 1.0
    backwards: bool = False

    def point(self, x: Array) -> Array:
        return self.length * (self.R @ x + self.p)

    def wrench(self, w: Array) -> Array:
        f, t = self.R @ w[:3], self.R @ w[3:]
        return self.force * np.r_[f, self.length * (t + np.cross(self.p, f))]

    def joints(self, grasp: Grasp) -> Array:
        """(l,) the new force or torque of a joint per old one."""
        return self.force * np.array([1.0 if j.type == "prismatic" else self.length for j in grasp.joints])

    def actuators(self, grasp: Grasp) -> Array:
        """(a,) the same of actuators; one that drives several joints has the unit of the first."""
        return self.joints(grasp)[np.argmax(grasp.mechanism.R != 0, axis=1)]

    def options(self, grasp: Grasp, options: dict[str, Any]) -> dict[str, Any]:
        if "limits" not in options:
            return dict(options)
        limits: GraspLimits = options["limits"]
        units = dict(zip(grasp.mechanism.actuators, self.actuators(grasp), strict=True))
        torques = {n: v * units[n] for n, v in limits.torque_limits.items()}
        force = None if limits.force_limit is None else self.force * limits.force_limit
        return options | {"limits": GraspLimits(limits.eta, torques, force)}

    def grasp(self, grasp: Grasp) -> Grasp:
        step = -1 if self.backwards else 1
        last = grasp.m - 1
        contacts = [Contact(self.point(c.position), self.R @ c.normal, c.friction, c.link) for c in grasp.contacts]
        joints = [
            GraspJoint(
                j.name,
                self.R @ j.axis,
                self.point(j.origin),
                tuple(last - i for i in j.moves) if self.backwards else j.moves,
                j.type,
            )
            for j in grasp.joints
        ]
        mechanism, units = grasp.mechanism, self.actuators(grasp)
        R = (mechanism.R * self.joints(grasp) / units[:, None])[::step, ::step]
        couplings = (mechanism.A * self.joints(grasp))[:, ::step]
        other = Mechanism(mechanism.actuators[::step], R, couplings, mechanism.tendon[::step])
        return Grasp(contacts[::step], joints[::step], other, (units * grasp.command)[::step])


def changes(rng: np.random.Generator) -> dict[str, Change]:
    """The changes that must not change an answer, by name."""
    R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    R *= np.linalg.det(R)
    return {
        "turned and moved": Change(R=R, p=0.3 * rng.normal(size=3)),
        "in another order": Change(backwards=True),
        "in millimetres": Change(length=THOUSAND),
        "in millinewtons": Change(force=THOUSAND),
    }


def frames(subject: Subject) -> None:
    """The same question in other words has the same answer."""
    tally, rng = subject.tally("frames"), subject.rng("frames")
    answer = subject.maximum(subject.direction)
    p, _ = answer.posed
    bound = answer.upper if 0 < answer.upper < np.inf else p.unit_magnitude
    sizes = [ABOVE * bound, bound * rng.uniform(0, 1), *([BELOW * answer.lower] if answer.lower > 0 else [])]
    checks = [subject.check(subject.base + s * subject.direction) for s in sizes]
    for name, change in changes(rng).items():
        other = replace(
            subject,
            grasp=change.grasp(subject.grasp),
            direction=change.wrench(subject.direction),
            base=change.wrench(subject.base),
            options=change.options(subject.grasp, subject.options),
        )
        again = other.maximum(other.direction)
        sure = not (capped(answer) or capped(again))
        tally.overlap(name, (answer.lower, answer.upper), (again.lower, again.upper), sure=sure)
        same = answer.verdict is again.verdict
        finished = sure and not (stopped(answer) or stopped(again))
        tally.claim(f"{name}: {answer.verdict} and {again.verdict}", same, sure=finished)
        for s, one in zip(sizes, checks, strict=True):
            two = other.check(other.base + s * other.direction)
            tally.verdict(f"{name}, at {s!r}", two, one.verdict, sure=not (stopped(one) or capped(one)))


# --- commands ---------------------------------------------------------------------------------------


def commands(subject: Subject) -> None:
    """Commands from `torques` hold in `check`; none whose effort is below the lower bound do.

    The bound is about all commands of the actuators that the grasp commands, in their senses, the others locked.
    """
    tally, rng, grasp = subject.tally("commands"), subject.rng("commands"), subject.grasp
    largest = subject.maximum(subject.direction)
    p, _ = largest.posed
    wrench = subject.base + rng.uniform(0.2, 1.5) * min(largest.lower or np.inf, p.unit_magnitude) * subject.direction
    own = subject.check(wrench)
    for objective, effort in (("max", lambda f: np.abs(f).max()), ("sum", lambda f: np.abs(f).sum())):
        answer = subject.torques(wrench, objective)
        sure = not capped(answer)
        none = answer.verdict is Verdict.SLIPS
        if own.verdict is Verdict.HOLDS:
            least = answer.lower * (1 - ROUNDING) <= effort(grasp.command)
            what = f"{objective}: {effort(grasp.command)!r} holds, {answer.verdict} from {answer.lower!r}"
            tally.claim(what, least and not none, sure=sure)
        tries = [rng.uniform(0, 1, grasp.mechanism.a) * np.sign(grasp.command) for _ in range(COMMANDS)]
        tries.append(grasp.command)
        if answer.preload is not None:
            found = grasp.with_preload(answer.preload)
            tally.verdict(f"{objective}: its own commands", subject.check(wrench, found), Verdict.HOLDS)
            tally.overlap(f"{objective}: its bounds", (answer.lower, answer.upper), (answer.upper, answer.upper))
            tries.append(found.command)
        if none or answer.lower > 0:
            # that nothing suffices is shown up to a thousand times the forces in play: the grasp's own are well below
            bound = effort(grasp.command) if none else answer.lower
            below = [LESS * bound / effort(f) * f for f in tries if f.any()]
            for f in (*below, 0.5 * below[0], np.zeros(len(grasp.command))):
                there = subject.check(wrench, grasp.with_preload(f))
                tally.verdict(f"{objective}: {f.tolist()} below {bound!r}", there, Verdict.SLIPS, sure=sure)


# --- maps -------------------------------------------------------------------------------------------


def force_maps(subject: Subject) -> None:
    """A force map says what the maxima in its directions say, without a preload and with it."""
    tally, rng = subject.tally("maps"), subject.rng("maps")
    at, plane = 0.01 * rng.normal(size=3), str(rng.choice(maps.PLANES))
    settings = Settings(timeout=subject.limit, jobs=1)
    drawn = subject.verbs.force_map(
        subject.grasp, plane, at=at, steps=DIRECTIONS, jobs=1, settings=settings, **subject.options
    )
    for grasp, curve in zip((subject.grasp.with_preload(None), subject.grasp), drawn.curves, strict=True):
        for i, force in enumerate(drawn.directions):
            answer = subject.maximum(np.r_[force, np.cross(at, force)], grasp, np.zeros(6))
            what = f"{plane} {i}, {'with' if grasp.preload else 'without'} preload"
            sure = not capped(answer)
            bounds = float(curve.lower[i]), float(curve.upper[i])
            tally.overlap(what, bounds, (answer.lower, answer.upper), sure=sure)
            reached = curve.stops[i] is Stop.COMPLETE
            tally.claim(f"{what} stopped: {curve.stops[i]}", reached, sure=False)
            finished = sure and reached and not stopped(answer)
            same = curve.verdicts[i] is answer.verdict
            tally.claim(f"{what}: {curve.verdicts[i]} and {answer.verdict}", same, sure=finished)
            both = bool(curve.unbounded[i]) == answer.unbounded
            tally.claim(f"{what}: unbounded {curve.unbounded[i]} and {answer.unbounded}", both, sure=finished)


# that of proofs is applied to every answer on the way
LAWS: dict[str, Callable[[Subject], None]] = {
    "interval": interval,
    "frames": frames,
    "commands": commands,
    "maps": force_maps,
}
NAMES = (*LAWS, "proofs")


# --- the benchmark ----------------------------------------------------------------------------------


def row(k: int, first: int, limit: float, interval_limit: float) -> dict[str, Any]:
    """All laws of one grasp."""
    subject = Subject.of(k, first, limit=limit, interval_limit=interval_limit)
    start = time.perf_counter()
    for law in LAWS.values():
        law(subject)
    return {
        "name": str(subject.seed),
        "kind": subject.kind,
        "contacts": subject.grasp.m,
        "seconds": round(time.perf_counter() - start, 3),
        "limits": [limit, interval_limit],
        "laws": {name: vars(subject.tally(name)) for name in NAMES},
    }


def summary(rows: list[dict[str, Any]], kind: str | None = None) -> dict[str, Any]:
    """Counts by law, of one kind or of all."""
    chosen = [r["laws"] for r in rows if kind in (None, r["kind"])]
    return {
        name: {
            "kept": sum(laws[name]["kept"] for laws in chosen),
            "open": sum(len(laws[name]["open"]) for laws in chosen),
            "broken": sum(len(laws[name]["broken"]) for laws in chosen),
        }
        for name in NAMES
    }


def listed(rows: list[dict[str, Any]], which: str) -> list[dict[str, Any]]:
    """Everything `open` or `broken`, with its seed."""
    return [
        {"seed": r["name"], "kind": r["kind"], "contacts": r["contacts"], "law": name, "what": what}
        for r in rows
        for name in NAMES
        for what in r["laws"][name][which]
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--first", type=int, default=1_400_000)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] per question")
    parser.add_argument("--interval-limit", type=float, default=10.0, help="[s] per maximum with its interval")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    rows: list[dict[str, Any]] = json.loads(args.out.read_text())["rows"] if args.out.exists() else []
    done = {r["name"] for r in rows}
    for k in range(args.count):
        if str(args.first + k) in done:
            continue
        rows.append(row(k, args.first, args.limit, args.interval_limit))
        for which in ("broken", "open"):
            for entry in listed(rows[-1:], which):
                print(f"{which}: {json.dumps(entry)}", flush=True)
        data = {
            "machine": describe(),
            "first seed": args.first,
            "grasps": len(rows),
            "summary": summary(rows),
            "kinds": {kind: summary(rows, kind) for kind in KINDS},
            "broken": listed(rows, "broken"),
            "open": listed(rows, "open"),
            "rows": rows,
        }
        part = args.out.with_suffix(".part")
        part.write_text(json.dumps(data, indent=1) + "\n")
        part.replace(args.out)
    print(json.dumps(summary(rows), indent=1))


if __name__ == "__main__":
    main()
