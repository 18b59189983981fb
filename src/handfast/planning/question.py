"""What searches are asked: limits, options, what tells two questions apart, whether hand and object are of one size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, Literal

import numpy as np

from handfast.core.errors import InputError, refuse_other_kinds, require_not_negative, unknown_name
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.model.hand.anatomy import Anatomy
from handfast.model.hand.hand import Hand
from handfast.model.mesh_pieces import MAX_BODY_LENGTH
from handfast.planning.candidates.palm_poses import STANDARD, Sampling
from handfast.planning.filters.surroundings import Surroundings
from handfast.planning.search import GIVE_UP
from handfast.stability.answers.load_path import comes_after
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.settings import Loading, Settings
from handfast.synthesis.embedded_task import digest


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanLimits:
    """Within what a grasp has to hold.

    Attributes:
        command_limit: largest command [N m or N]; None where none was stated.
        torque_limits: actuator -> largest force of motor and gearing [N m or N].
        force_limit: largest normal force at any contact [N].
        eta: uncertainty of the contact normals [rad].
        settings: of each query about stability; None for the planner's own.
        loading: as in `check`; with "preload-first" every load is held on its path.
    """

    command_limit: float | None = None
    torque_limits: Mapping[str, float] | None = None
    force_limit: float | None = None
    eta: float = 0.0
    settings: Settings | None = None
    loading: Loading = "together"

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        comes_after(self.loading)

    @property
    def of_a_load(self) -> GraspLimits:
        """What `check` and `hold` take of these."""
        return GraspLimits(self.eta, self.torque_limits or {}, self.force_limit)

    def of_grasp(self, grasp: Grasp) -> GraspLimits:
        """The same of a grasp: it has no actuators that move none of its contacts, so that no torque limits these."""
        limits, own = self.of_a_load, grasp.mechanism.actuators
        return replace(limits, torque_limits={name: most for name, most in limits.torque_limits.items() if name in own})

    def refuse_unknown(self, hand: Hand) -> None:
        """`InputError` for a torque limit of an actuator that the hand does not have."""
        hand.mechanism.commands(dict.fromkeys(self.torque_limits or {}, 1.0), field="torque limit")


@dataclass(frozen=True, eq=False, kw_only=True)
class Requirements(PlanLimits):
    """The numbers of a question about grasps for a task.

    Attributes:
        friction: coefficient at every contact. torsion: [m] of soft fingers; 0 for point contacts.
        actuators: that may be commanded.
    """

    friction: float
    torsion: float = 0.0
    actuators: tuple[str, ...]

    @classmethod
    def of(cls, limits: PlanLimits, friction: float, actuators: Sequence[str], torsion: float = 0.0) -> Requirements:
        """These limits, with friction, torsion and the actuators."""
        return cls(friction=friction, torsion=torsion, actuators=tuple(actuators), **vars(limits))

    def driven(self, grasp: Grasp) -> list[str]:
        """The actuators of a grasp that may be commanded; where none of those asked for moves it, all of its own."""
        own = grasp.mechanism.actuators
        return [n for n in self.actuators if n in own] or list(own)


@dataclass(frozen=True)
class Allowed:
    """How deep solids may be in each other [m]: link and object, at the requested contacts, link and link.

    Raises:
        InputError: a depth below 0, or none.
    """

    depth: float = 1e-3
    at_contacts: float = 1e-3
    self_depth: float = 1e-3

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        for field_, value in vars(self).items():
            if not value >= 0:
                raise InputError(f"is {value:g} m; 0 or more is needed", field=field_)


# --- options ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, kw_only=True)
class SearchOptions:
    """What `plan` and `grasp_for` have in common.

    Attributes:
        count: of grasps that differ from each other.
        seed: of the random numbers: the same seed finds the same grasps on any number of cores, if the time allows.
        timeout: [s] wall time after start-up; None goes on until there are `count`.
        limits: of commands and forces. No `command_limit` is ten times the largest load at the size of the grasp.
        ignored: pairs of links, by name, that may overlap: where the collision shapes do and the real links do not.
        torsion: [m] coefficient of torsional friction at every contact, of soft fingers; 0 for point contacts.
        safety: so many times every load is to be held. A grasp that holds its loads and no more lets go at the first
            disturbance: the command line asks for 1.5.

    Raises:
        InputError: a count or a time that is not positive, a safety below 1, a negative seed or torsion, torsion with
            uncertain normals.
    """

    count: int = 1
    seed: int = 0
    timeout: float | None = 60.0
    limits: PlanLimits = field(default_factory=PlanLimits)
    ignored: Sequence[tuple[str, str]] = ()
    torsion: float = 0.0
    safety: float = 1.0

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        refuse_no_positive({"count": self.count, "timeout": self.timeout, "safety": self.safety})
        refuse_no_positive({"command_limit": self.limits.command_limit})
        if self.safety < 1:
            raise InputError(
                f"is {self.safety:g}: the loads themselves would not be held; 1 or more is needed", field="safety"
            )
        refuse_negative(self.seed)
        require_not_negative(self.torsion, "torsion", "a coefficient of torsional friction is 0 or more [m]")
        if self.torsion and self.limits.eta:
            problem = f"is {self.torsion:g} m; uncertain normals (eta) know point contacts only, leave one out"
            raise InputError(problem, field="torsion")


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanOptions(SearchOptions):
    """Options of `plan`, beside those of every search. Without `limits.settings` a query has some hundred to thousand
    nodes, so that the outcome does not hang on the clock (but no grasp is thought about for more than 30 s).

    Attributes:
        attempts: largest number of random starts.
        contacts: grasps of at most so many contacts; None for any number.
        pool: gather so many that differ, then return the `count` that differ most from each other, the best among them.
        sampling: how the starts are drawn.
        give_up: the search ends after so many attempts of which none came through the filters, or after three tenths
            of these if one reason rejected all of them.
        surroundings: what the object stands on and what is around it. The hand comes in and leaves in a straight line
            and touches nothing of it; None does not look at that.
        simulate: keep what the dynamics engine holds too (`simulate_bodies`), each load without the factor of safety.
    """

    count: int = 20
    timeout: float | None = 300.0
    attempts: int = 100_000
    contacts: int | None = None
    pool: int | None = None
    sampling: Sampling = STANDARD
    give_up: int = GIVE_UP
    surroundings: Surroundings | None = None
    simulate: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        refuse_no_positive(
            {"attempts": self.attempts, "contacts": self.contacts, "pool": self.pool, "give_up": self.give_up}
        )
        if self.torsion and self.simulate:
            problem = f"is {self.torsion:g} m; the dynamics engine (simulate) knows point contacts only, leave one out"
            raise InputError(problem, field="torsion")


@dataclass(frozen=True, eq=False, kw_only=True)
class TaskGraspOptions(SearchOptions):
    """Options of `grasp_for`, beside those of every search.

    Attributes:
        actuators: that may be commanded; None for those that close the hand.
        friction: coefficient; None for the object's.
        allowed: how deep solids may be in each other; two links beyond what they are in the hand at rest.
        best: "margin" goes on until the time is over for the grasps that hold the largest multiple of all loads under
            one preload, and bounds what any placement of the contacts could hold. None is content with the first.
    """

    actuators: Sequence[str] | None = None
    friction: float | None = None
    allowed: Allowed = field(default_factory=Allowed)
    best: Literal["margin"] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.limits.loading != "together":
            raise InputError("'preload-first' is not known to grasps for a task; plan knows it", field="loading")
        if self.best not in (None, "margin"):
            raise InputError(f"is {self.best!r}; margin is needed", field="best")


def refuse_no_cone(friction: float, torsion: float) -> None:
    """`InputError` for coefficients that no contact can have."""
    Contact(np.zeros(3), np.array([0.0, 0.0, 1.0]), friction, torsion=torsion)


def refuse_negative(seed: int) -> None:
    """`InputError` for a seed below 0, of which no random numbers can be drawn."""
    if seed < 0:
        raise InputError(f"is {seed}; a number from 0 on is needed", field="seed")


def refuse_no_positive(numbers: Mapping[str, float | None]) -> None:
    """`InputError` for a number that is 0, below, or none; None is not stated."""
    for name, value in numbers.items():
        if value is not None and not value > 0:
            raise InputError(f"is {value:g}; a positive number is needed", field=name)


def link_pairs(hand: Hand, ignored: Sequence[tuple[str, str]]) -> tuple[tuple[str, str], ...]:
    """Pairs of two links in an order of their own, each once and known to the hand; `InputError` otherwise."""
    for name in (name for pair in ignored for name in pair):
        if name not in hand.link_names:
            raise unknown_name("link", name, hand.link_names, field="ignored")
    for one, other in ignored:
        if one == other:
            raise InputError(f"has {one} with itself; two links are needed", field="ignored")
    return tuple(sorted({(min(pair), max(pair)) for pair in ignored}))


# --- which question it is ---------------------------------------------------------------------------


def fingerprint(hand: Hand, body: Body, loads: Loads, seed: int, **others: object) -> str:
    """SHA-256 of a question: every number of hand, object and loads, the seed, and `others` as text."""
    of_body = {"pieces": body.pieces, "mass": body.mass, "center": body.center_of_mass, "friction": body.friction}
    asked = {"hand": replace(hand, name="", source=""), "body": of_body, "loads": loads.by_name, "seed": seed}
    return digest(_plain(asked | {"others": {name: str(value) for name, value in others.items()}}))


def refuse_another(found: str, question: str) -> None:
    """`InputError` if the fingerprint of what was begun is not that of what is asked."""
    if found != question:
        raise InputError(
            "was begun with another hand, object, load, seed or limit; ask the same, or take another folder",
            field="question",
        )


def _plain(value: Any) -> Any:
    """JSON of a value: dataclasses by their fields, arrays as lists, sets in order, numbers without an end as text."""
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): _plain(of) for key, of in value.items()}
    if isinstance(value, frozenset):
        return sorted(map(_plain, value))
    if isinstance(value, list | tuple):
        return [_plain(x) for x in value]
    return str(value) if isinstance(value, float) and not np.isfinite(value) else value


# --- hand and object of one world -------------------------------------------------------------------

ABSURD = 100.0  # an object so many times larger or smaller than the hand is refused
STRANGE = 12.0  # .. or warned about


def hand_size(hand: Hand) -> float:
    """[m] the longest side of a box about palm and open fingers; an arm below the palm does not count."""
    anatomy = Anatomy.of(hand)
    poses = hand.link_poses(anatomy.ends(hand.closing)[0])
    own = [i for i in range(len(hand.links)) if i in anatomy.palm or anatomy.finger(i) >= 0]
    corners = [s.triangles()[0] @ poses[i][:3, :3].T + poses[i][:3, 3] for i in own for s in hand.links[i].shapes]
    return float(np.ptp(np.vstack(corners), axis=0).max()) if corners else 0.0


def object_size(body: Body) -> float:
    """[m] the longest side of a box about the object."""
    return float(np.ptp(body.vertices, axis=0).max())


def compared(hand: Hand, body: Body) -> str:
    """A warning if the object is far larger or smaller than the hand, '' if it is not.

    Raises:
        InputError: it is a hundred times larger or smaller.
    """
    return compared_size(hand, object_size(body), body.name or "", body.scale)


def compared_size(hand: Hand, its: float, name: str, scale: float) -> str:
    """As `compared`, of an object of which no more is known than its longest side [m] and its mesh's scale."""
    own = hand_size(hand)
    ratio = its / own if own and its else 1.0
    if 1 / STRANGE <= ratio <= STRANGE:
        return ""
    smaller = "a mesh in millimetres needs --scale 0.001, one in inches --scale 0.0254"
    larger = "its mesh may be in metres already: --scale 1"
    if own > MAX_BODY_LENGTH:
        larger = "the hand's file may be in millimetres, and lengths of URDF and MJCF are in metres"
    elif scale == 1:
        larger = "its mesh may be in other units: --scale METRES says how long one is"
    help_ = smaller if ratio > 1 else larger
    sizes = f"is {_length(its)} long, the hand {_length(own)}; {help_}"
    if not 1 / ABSURD <= ratio <= ABSURD:
        raise InputError(sizes, source=name or None, field="size")
    return f"{name or 'the object'} {sizes}"


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 1 else f"{1e3 * metres:.3g} mm"
