"""How the largest disturbance is spread over grasps that are a little off, beside what uncertain normals promise.

Equation (17) of the stability paper answers for normals that are off by up to eta all at once, each the worst way along
its own motion. Drawing them at random tells what that costs, and when it is not the worst: its load acts in another
state of the contacts than that of the real normals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Real
from typing import Any

import numpy as np

from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array, Mask
from handfast.core.errors import InputError, kinds_checked, refuse_other_kinds
from handfast.core.presented import Presented
from handfast.core.transforms import normal_frame
from handfast.model.grasp import Contact, Grasp
from handfast.proofs.constants import MAX_ETA
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.answer import finite
from handfast.stability.answers.batch_answer import INTERRUPTED
from handfast.stability.answers.max_query import ask as maximum
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.batch import OnItem, max_many

QUANTILE_SHARES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95)  # of the samples, for which `quantiles` are given
TRUST = 0.95  # how often what is said of unseen grasps is to be true
BOUNDS = {  # what is too large, and what is right
    "positions": (np.inf, "0 m or more"),
    "normals": (MAX_ETA, "0 to below 45 degrees, as for eta,"),
    "friction": (np.nextafter(1.0, 2.0), "a share from 0 to 1"),
    "command": (1.0, "a share from 0 to below 1, so that no command is lost"),
}
SAMPLED_PARTS = ("positions", "normals", "friction", "command")  # each with random numbers of its own


@dataclass(frozen=True)
class Perturbation:
    """How far a grasp may be from its file; 0 is exact.

    Every contact and every actuator is off by itself, all in the same sample. All densities are uniform.

    Attributes:
        positions: [m] radius of the ball about each contact in which it may be.
        normals: [rad] half angle of the cone about each normal in which it may be, below 45 degrees.
        friction: share of each contact's coefficient by which that may be larger or smaller, 0 to 1.
        command: share of each commanded force or torque by which that may be larger or smaller, below 1.

    Raises:
        InputError: a bound that is no number, negative, not finite or too large, or all of them 0.
    """

    positions: float = 0.0
    normals: float = 0.0
    friction: float = 0.0
    command: float = 0.0

    def __post_init__(self) -> None:
        for name, (least_too_large, right) in BOUNDS.items():
            given = getattr(self, name)
            value = float(given) if isinstance(given, Real) else np.nan
            if not (np.isfinite(value) and 0 <= value < least_too_large):
                shown = f"{value:g}" if isinstance(given, Real) else repr(given)
                raise InputError(f"is {shown}; {right} is needed", field=name)
        if not any(getattr(self, f.name) for f in fields(self)):
            raise InputError("are all 0; give at least one of positions, normals, friction and command", field="bounds")

    def leaves(self, grasp: Grasp) -> bool:
        """Is every sample the grasp itself, for want of commands or friction to be off?"""
        rubs, driven = self.friction and grasp.mu.any(), self.command and grasp.command.any()
        return not (self.positions or self.normals or rubs or driven)

    def sample(self, grasp: Grasp, seed: int, number: int) -> Grasp:
        """The sample of this number: the same for the same seed, however many there are and whatever else varies."""
        draws = {part: np.random.default_rng([seed, number, k]) for k, part in enumerate(SAMPLED_PARTS)}
        off = self.positions * _in_ball(draws["positions"], grasp.m)
        tilts = _in_cone(draws["normals"], grasp.m, self.normals)
        mu = grasp.mu * (1 + self.friction * draws["friction"].uniform(-1, 1, grasp.m))
        factors = 1 + self.command * draws["command"].uniform(-1, 1, grasp.mechanism.a)
        contacts = [
            _moved(c, p, tilt, f) for c, p, tilt, f in zip(grasp.contacts, off, tilts, mu.tolist(), strict=True)
        ]
        return Grasp(contacts, grasp.joints, grasp.mechanism, grasp.command * factors, grasp.name)

    def to_json(self) -> dict[str, Any]:
        """The bounds by name, in SI units."""
        return {part: float(getattr(self, part)) for part in SAMPLED_PARTS}


def _moved(contact: Contact, off: Array, tilt: Array, friction: float) -> Contact:
    normal = normal_frame(contact.normal) @ tilt
    torsion = contact.torsion * friction / contact.friction if contact.torsion else 0.0
    return replace(contact, position=contact.position + off, normal=normal, friction=friction, torsion=torsion)


def _in_ball(rng: np.random.Generator, n: int) -> Array:
    """(n, 3) uniform in the unit ball."""
    x = rng.normal(size=(n, 3))
    out: Array = x / np.linalg.norm(x, axis=1)[:, None] * rng.uniform(size=n)[:, None] ** (1 / 3)
    return out


def _in_cone(rng: np.random.Generator, n: int, angle: float) -> Array:
    """(n, 3) unit vectors, uniform by area within an angle [rad] of the first axis."""
    cos = 1 - (1 - np.cos(angle)) * rng.uniform(size=n)
    around, sin = rng.uniform(0, 2 * np.pi, n), np.sqrt(np.maximum(0.0, 1 - cos**2))
    return np.column_stack([cos, sin * np.cos(around), sin * np.sin(around)])


@dataclass(frozen=True, eq=False)
class SampledMaximum(Presented):
    """The largest disturbance along a direction, of a grasp and of samples about it; magnitudes times the direction.

    Attributes:
        grasp: as it was asked about.
        direction, base: (6,) [N, N m].
        bounds: within which the samples were drawn.
        seed: of the samples.
        nominal: of the grasp itself.
        uncertain: of the grasp with normals that may be off by the bound, equation (17); None if they may not be.
        lower: (n,) of each sample: shown to be resisted; inf if as far as the search goes. 0, like `upper`, where no
            forces whatever at its contacts balance the direction.
        upper: (n,) nothing above is resisted, by a search that ended; inf if unbounded or not decided.
        decided: (n,) bool: did the search end with an answer?
        stop: `INTERRUPTED` if Ctrl-C left samples out, else `COMPLETE`.
        seconds: wall time.
    """

    grasp: Grasp
    direction: Array
    base: Array
    bounds: Perturbation
    seed: int
    nominal: MaxAnswer
    uncertain: MaxAnswer | None
    lower: Array = field(repr=False)
    upper: Array = field(repr=False)
    decided: Mask = field(repr=False)
    stop: Stop
    seconds: float

    @property
    def values(self) -> Array:
        """(k,) the magnitudes that decided samples resist, ascending."""
        return np.sort(self.lower[self.decided])

    @property
    def quantiles(self) -> dict[float, float]:
        """The magnitude that a share of the decided samples does not exceed: a sample's own, none between two."""
        v = self.values
        return {s: float(v[max(0, int(np.ceil(s * len(v))) - 1)]) for s in QUANTILE_SHARES} if len(v) else {}

    @property
    def below_nominal(self) -> float:
        """Share of the decided samples that surely resist less than the grasp as it stands."""
        return self._below(self.nominal.lower)

    @property
    def below_uncertain(self) -> float | None:
        """Share of the decided samples that surely resist less than equation (17) promises; None without it."""
        return None if self.uncertain is None else self._below(self.uncertain.lower)

    @property
    def conservative(self) -> bool | None:
        """Did every sample resist what equation (17) promises? None without it or without a decided sample."""
        if self.uncertain is None or not self.decided.any():
            return None
        return self.below_uncertain == 0

    @property
    def unseen(self) -> float:
        """At most this share of all grasps within the bounds resists less than the worst sample: true in 95 of 100
        repetitions of the whole draw."""
        n = int(self.decided.sum())
        return 1 - (1 - TRUST) ** (1 / n) if n else 1.0

    def _below(self, magnitude: float) -> float:
        return float((self.upper[self.decided] < magnitude).mean()) if self.decided.any() else 0.0

    def to_json(self) -> dict[str, Any]:
        """One JSON object; what has no bound is null."""
        found = self.nominal
        bounds = [finite(found.lower), finite(found.upper)]
        uncertain = None if self.uncertain is None else [self.uncertain.lower, finite(self.uncertain.upper)]
        return {
            "schema": "handfast/robust/1",
            "grasp": self.grasp.name,
            "direction": self.direction.tolist(),
            "base": self.base.tolist(),
            "bounds": self.bounds.to_json(),
            "seed": self.seed,
            "samples": len(self.lower),
            "decided": int(self.decided.sum()),
            "nominal": bounds,
            "uncertain_normals": uncertain,
            "quantiles": {f"{s:g}": finite(x) for s, x in self.quantiles.items()},
            "below_nominal": self.below_nominal,
            "below_uncertain": self.below_uncertain,
            "conservative": self.conservative,
            "unseen": self.unseen,
            "lower": [finite(x) for x in self.lower],
            "upper": [finite(x) for x in self.upper],
            "stop": str(self.stop),
            "seconds": round(self.seconds, 6),
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class SampleOptions:
    """What a maximum of samples can be asked with.

    Attributes:
        samples: how many are drawn; sample i is the same for the same seed, however many there are.
        seed: of the samples.
        base: as in `maximum`.
        settings: of each question; by default 10 s at most for each.
        jobs: cores to use; by default all. Answers do not depend on it.
    """

    samples: int = 200
    seed: int = 0
    base: Sequence[float] | Array | None = None
    settings: Settings = field(default_factory=lambda: Settings(timeout=10.0))
    jobs: int | None = None

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        if self.samples < 1:
            raise InputError(f"is {self.samples}; at least 1 is needed", field="samples")
        if self.seed < 0:
            raise InputError(f"is {self.seed}; 0 or more is needed", field="seed")


@kinds_checked
def sampled_maximum(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    bounds: Perturbation,
    *,
    on_progress: OnItem | None = None,
    **options: Any,
) -> SampledMaximum:
    """The largest disturbance along a direction, of samples of a grasp that may be off by stated bounds.

    Args:
        direction: as in `maximum`.
        bounds: how far the grasp may be off.
        on_progress: called with (done, total) of the samples.
        options: of `SampleOptions`, by name: `sampled_maximum(grasp, [0, 1, 0], bounds, samples=50)`.

    Raises:
        InputError: no samples, a negative seed, bounds that leave this grasp as it is, and what `maximum` raises.
    """
    asked = SampleOptions(**options)
    base, samples, seed, settings = asked.base, asked.samples, asked.seed, asked.settings
    if bounds.leaves(grasp):
        what = " and ".join(n for n, share in (("friction", bounds.friction), ("command", bounds.command)) if share)
        raise InputError(f"of {what} alone leave this grasp as it is: it has none", source=grasp.name, field="bounds")
    towards = scaled_problem.as_wrench(direction, "direction")
    beside = np.zeros(6) if base is None else scaled_problem.as_wrench(base, "base")
    nominal = maximum(grasp, towards, base=beside, settings=settings)
    tilted = GraspLimits(eta=bounds.normals)
    uncertain = maximum(grasp, towards, base=beside, limits=tilted, settings=settings) if bounds.normals else None
    drawn = [bounds.sample(grasp, seed, i) for i in range(samples)]
    found = max_many(drawn, [towards], base=beside, settings=settings, jobs=asked.jobs, on_progress=on_progress)
    verdict, error = found.verdict[:, 0], found.error[:, 0]
    interrupted = error == INTERRUPTED
    unbalanced = np.array([bool(e) for e in error]) & ~interrupted  # by any forces at its contacts: refused
    lower = np.where(found.unbounded[:, 0], np.inf, np.nan_to_num(found.lower[:, 0]))
    upper = np.where(np.isnan(found.upper[:, 0]), np.inf, found.upper[:, 0])
    closed = (verdict == str(Verdict.SLIPS)) | found.unbounded[:, 0] | np.isfinite(upper)
    lower, upper = np.where(unbalanced, 0.0, lower), np.where(unbalanced, 0.0, upper)
    decided = unbalanced | (closed & (verdict != str(Verdict.UNDECIDED)) & ~interrupted)
    stop = Stop.INTERRUPTED if interrupted.any() else Stop.COMPLETE
    seconds = nominal.seconds + (uncertain.seconds if uncertain else 0.0) + float(found.seconds.sum())
    return SampledMaximum(
        grasp, towards, beside, bounds, seed, nominal, uncertain, lower, upper, decided, stop, seconds
    )
