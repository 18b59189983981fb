"""The laws of joints as tendons and given torques: an equivalent grasp that searches and certificates know.

A joint with friction F, a given torque g and a stop carries tau = (R^T f + A^T lambda)_j + g + rho, see
`model.reaction_range`. The equivalent grasp has given torques alone, and rows of actuators that nobody commands and
that can only pull (*tendons*: t >= 0, f >= 0, t f = 0). Each step replaces a law by one that allows the same pairs of
motion and torque; proofs are in docs/joint-laws.md.

- *Given torques*, and R^T f_c of backdrivable motors, are constants; these motors have no row.
- A *stop* is a tendon: t = -q at the upper one, t = q at the lower one. A joint at both is tied: a row of A.
- *Friction* where a tendon, a stop or a motor that is commanded lets the joint move in one sense s only: the torque
  -s F. On rest the two together carry what is beyond f_c - F, and f_c - F where the joint moves.
- *Friction* otherwise: a joint u that touches nothing, with the tendons t+ = u and t- = u - q and the torque -2 F, so
  that f+ + f- = 2 F; the torque F on q. Then q carries F - f-, from -F to F. Where q > 0, t- >= 0 makes u > 0, so
  that f+ = 0 and q carries -F; where q < 0, t- > 0, so that f- = 0 and q carries F.
- *Joints that are tied* to each other rigidly and may move have one friction, of the weighed sum of their motions.
- Friction of a joint that is held rigidly does nothing.

Actuators with a largest force, passive reaction included, are no part of these mergers: what friction carries beside
them does not count towards their limit. In a step of a load's path friction knows the step's motion, stops and tendons
that nobody commands the whole one: those that have moved away do not keep a joint from moving either way.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.core.errors import InputError
from handfast.model.grasp import Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.model.start import Start
from handfast.proofs.constants import MAX_GRASP_SIZE
from handfast.proofs.fields import not_zero
from handfast.proofs.joint_laws import given_torques, shared
from handfast.proofs.states import State
from handfast.stability.problem import model


@dataclass(frozen=True, eq=False)
class FrictionPair:
    """The two tendons that stand for the friction of some joints which move alike.

    Attributes:
        slider: number of the joint u among those of the equivalent grasp.
        first: number of its row t+ = u; the next one is t- = u - weights . q.
        weights: (l,) of the motions of the grasp's joints; friction F_i and sense over F, see `joint_laws.shared`.
        friction: F [N m or N].
    """

    slider: int
    first: int
    weights: Array
    friction: float


@dataclass(frozen=True, eq=False)
class EquivalentGrasp:
    """A grasp, and one with the same states whose joints know given torques only.

    Attributes:
        grasp: as it is.
        plain: its equivalent: the same contacts, first the same joints, first the `kept` actuators and the same
            couplings. Its joints' torques are given; nobody commands what is added. The grasp itself if it has no laws.
        kept: (a',) actuators of the grasp that are rows of the equivalent: all that are not backdrivable.
        arms: (l',) what measures the joints' motions, see `model.joint_arms`.
        constant, of_forces, of_couplings: (l,), (l, a'), (l, k'): rho = constant + of_forces f + of_couplings lambda.
        held: (l,) bool, joints that are held rigidly.
        stops: (row, joint, sign) of the tendons of stops, which carry sign f on their joint.
        pairs: of friction.
    """

    grasp: Grasp
    plain: Grasp
    kept: Indices
    arms: Array
    constant: Array
    of_forces: Array
    of_couplings: Array
    held: Mask
    stops: tuple[tuple[int, int, float], ...] = ()
    pairs: tuple[FrictionPair, ...] = ()

    @property
    def is_same(self) -> bool:
        """Is there nothing to replace?"""
        return self.plain is self.grasp

    @cached_property
    def is_given(self) -> bool:
        """Does anything act whose size is given, beside loads and commands that may be sought?

        Then states are not multiples of each other.
        """
        return bool(self.plain.given_torques.any() or self.drives)

    @cached_property
    def drives(self) -> bool:
        """Is there anything among it that may put energy in, as springs and backdrivable motors do?

        Friction takes: its torque times motion is never positive, -s F q where s q >= 0, F q - 2 F u where u is not
        below 0 nor q.
        """
        driven = self.grasp.command[list(self.backdrivable)]
        return bool(self.grasp.given_torques.any() or driven.any())

    @cached_property
    def largest_given(self) -> float:
        """[N] the largest torque that is given to a joint that may move a contact, as a force there."""
        l = self.grasp.l
        paired = sum((pair.friction * pair.weights for pair in self.pairs), np.zeros(l))
        given = np.abs(self.plain.given_torques[:l] - paired) / self.arms[..., :l]
        return float(np.where(self.grasp.touches & ~self.held, given, 0.0).max(initial=0.0))

    @cached_property
    def largest_friction(self) -> float:
        """[N] the largest friction of a joint that may move a contact, as a force there."""
        moves = self.grasp.touches & ~self.held
        return float(np.where(moves, self.grasp.joint_friction / self.arms[..., : self.grasp.l], 0.0).max(initial=0.0))

    @cached_property
    def backdrivable(self) -> tuple[int, ...]:
        """The actuators of the grasp that are no rows."""
        return tuple(int(i) for i in np.flatnonzero(self.grasp.mechanism.backdrivable))

    def torques_under(self, command: Array) -> Array:
        """(l',) the given torques of the equivalent under other commands (a,) of the backdrivable motors."""
        out = self.plain.given_torques
        if not self.backdrivable:
            return out
        i = list(self.backdrivable)
        change = self.grasp.mechanism.R[i].T @ (command[i] - self.grasp.command[i])
        return out + np.concatenate([change, np.zeros(self.plain.l - self.grasp.l)])

    def command_of(self, command: Array, share: float = 1.0) -> Array:
        """(a,) commands of the grasp's actuators from those of the equivalent's (a',).

        Backdrivable motors keep a share of theirs.
        """
        if self.is_same:
            return command
        out = share * self.grasp.command
        out[self.kept] = command[: len(self.kept)]
        return out

    def parts_of(
        self, q: Array, f: Array, coupling: Array, command: Array | None = None, share: float | Array = 1.0
    ) -> tuple[Array, Array, Array, Array]:
        """q (..., l), f (..., a), coupling (..., k) and reactions (..., l) of the grasp, from the equivalent's.

        command: (a,) of the backdrivable motors; the grasp's by default.
        share: (..., 1) of what is given to joints, of these commands and of friction, that acts.
        """
        g = self.grasp
        if self.is_same:
            return q, f, coupling, np.zeros(q.shape)
        forces = np.empty((*f.shape[:-1], g.mechanism.a))
        forces[...] = share * (g.command if command is None else command)
        forces[..., self.kept] = f[..., : len(self.kept)]
        reaction = share * self.constant + f @ self.of_forces.T + coupling @ self.of_couplings.T
        return q[..., : g.l], forces, coupling[..., : len(g.mechanism.A)], reaction

    def plain_parts(self, state: State, share: float = 1.0) -> tuple[Array, Array, Array]:
        """q (l',), f (a',) and coupling (k',) of the equivalent, from a state of the grasp; share: of `parts_of`."""
        if self.is_same:
            return state.q, state.f, state.coupling
        mech = self.plain.mechanism
        q, f, coupling = np.zeros(self.plain.l), np.zeros(mech.a), np.zeros(len(mech.A))
        q[: self.grasp.l], f[: len(self.kept)] = state.q, state.f[self.kept]
        k = len(self.grasp.mechanism.A)
        coupling[:k], own = state.coupling, state.reaction - share * self.constant
        for row in range(k, len(coupling)):
            coupling[row] = state.reaction[np.flatnonzero(self.of_couplings[:, row])[0]]
        for row, joint, sign in self.stops:
            f[row] = max(0.0, sign * own[joint])
        for pair in self.pairs:
            size, most = float(pair.weights @ pair.weights), 2 * share * pair.friction
            f[pair.first + 1] = np.clip(-(pair.weights @ own) / size, 0.0, most)
            f[pair.first] = most - f[pair.first + 1]
            q[pair.slider] = max(0.0, float(pair.weights @ state.q))
        return q, f, coupling


def equivalent_of(grasp: Grasp, driven: Mask | None = None, limited: Collection[str] = ()) -> EquivalentGrasp:
    """The equivalent of a grasp.

    Args:
        grasp: with its commands.
        driven: (a,) bool, actuators whose commands are sought, in the sense of the grasp's; the others that are not
            backdrivable are then locked.
        limited: names of actuators with a largest force, passive reaction included.

    Raises:
        InputError: more rows than can be searched, a backdrivable motor with a command that is sought or beyond its
            limit.
    """
    if not grasp.has_laws:
        none = np.zeros((grasp.l, grasp.mechanism.a))
        every = np.arange(grasp.mechanism.a)
        ties = np.zeros((grasp.l, len(grasp.mechanism.A)))
        nothing, held = np.zeros(grasp.l), np.zeros(grasp.l, dtype=bool)
        return EquivalentGrasp(grasp, grasp, every, model.joint_arms(grasp), nothing, none, ties, held)
    # beside backdrivable motors, the laws are replaced in the same way whatever the sizes of the commands
    same = grasp if any(grasp.mechanism.backdrivable) else _Signs(grasp)
    made = _made(same, None if driven is None else driven.tobytes(), frozenset(limited))
    if made.grasp is grasp:
        return made
    command = np.zeros(made.plain.mechanism.a)
    command[: len(made.kept)] = grasp.command if driven is None else np.where(driven, grasp.command, 0.0)
    return replace(made, grasp=grasp, plain=made.plain.with_preload(command))


class _Signs:
    """A grasp that equals others which differ from it in the sizes of their commands alone."""

    def __init__(self, grasp: Grasp) -> None:
        self.grasp = grasp
        parts = (grasp.contacts, grasp.joints, grasp.mechanism, grasp.start)
        self._key = *parts, grasp.name, np.sign(grasp.command).tobytes()

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Signs) and self._key == other._key


@lru_cache(maxsize=32)  # of a grasp that is asked again and again
def _made(grasp: Grasp | _Signs, driven: bytes | None, limited: frozenset[str]) -> EquivalentGrasp:
    sought = None if driven is None else np.frombuffer(driven, dtype=bool)
    return _Replacing(grasp.grasp if isinstance(grasp, _Signs) else grasp, sought, limited).made()


class _Replacing:
    """Replaces the laws of one grasp, step by step."""

    def __init__(self, grasp: Grasp, driven: Mask | None, limited: frozenset[str]) -> None:
        mech, back = grasp.mechanism, np.array(grasp.mechanism.backdrivable, dtype=bool)
        self.grasp, self.kept = grasp, np.flatnonzero(~back)
        if driven is not None and (driven & back).any():
            name = mech.actuators[int(np.flatnonzero(driven & back)[0])]
            raise InputError(f"'{name}' is backdrivable: its command is given, not sought", field="actuators")
        command = grasp.command if driven is None else np.where(driven | back, grasp.command, 0.0)
        self.command = command[self.kept]
        self.R = mech.R[self.kept]
        tendon = np.array(mech.tendon, dtype=bool)[self.kept]
        self.start = start = grasp.start or Start(np.zeros(grasp.m), np.zeros(grasp.l), np.zeros(mech.a))
        one_sided = (self.command != 0) | (tendon & (start.slack[self.kept] == 0))
        if driven is not None:
            one_sided |= driven[self.kept]
        free = np.array([mech.actuators[i] not in limited for i in self.kept], dtype=bool)
        self.one_sided, self.rigid = one_sided & free, ~(one_sided | tendon) & free
        self.reaction = np.zeros(grasp.l)
        self.both = [j for j, joint in enumerate(grasp.joints) if joint.stop == "both"]
        self.held, self.tie = self._ties()
        self.stops = [
            (j, 1.0 if joint.stop == "lower" else -1.0)
            for j, joint in enumerate(grasp.joints)
            if joint.stop in ("lower", "upper") and not self.held[j]
        ]

    def _ties(self) -> tuple[Mask, list[dict[int, float]]]:
        """(l,) bool which joints are held rigidly; the others in groups that move alike, each with its rate."""
        l = self.grasp.l
        rows = [*self.grasp.mechanism.A, *self.R[self.rigid]]
        held = np.zeros(l, dtype=bool)
        held[self.both] = True
        found = True
        while found:  # what is tied to nothing but held joints is held
            found = False
            for row in rows:
                rest = np.flatnonzero((row != 0) & ~held)
                if len(rest) == 1:
                    held[rest] = found = True
        groups = {j: {j: 1.0} for j in range(l) if not held[j]}
        for row in rows:
            two = np.flatnonzero((row != 0) & ~held).tolist()
            if len(two) != 2 or groups[two[0]] is groups[two[1]]:
                continue
            first, second = groups[two[0]], groups[two[1]]
            # q_b = rate q_a; motions of the second group are told in those of the first
            rate = -row[two[0]] / row[two[1]] * first[two[0]] / second[two[1]]
            first.update({j: rate * x for j, x in second.items()})
            groups.update(dict.fromkeys(second, first))
        return held, list({id(group): group for group in groups.values()}.values())

    def _sense(self, group: dict[int, float]) -> float:
        """In which sense alone, +1 or -1 in the group's rate, a row of one of its joints lets it move; 0 if in both."""
        for j, sign in self.stops:
            if j in group and self.start.stops[j] == 0:
                return float(sign * np.sign(group[j]))
        for row, command in zip(self.R[self.one_sided], self.command[self.one_sided], strict=True):
            moved = np.flatnonzero((row != 0) & ~self.held).tolist()
            if len(moved) == 1 and moved[0] in group:
                turned = -1.0 if command < 0 else 1.0
                return float(turned * np.sign(row[moved[0]]) * np.sign(group[moved[0]]))
        return 0.0

    def made(self) -> EquivalentGrasp:
        """The equivalent grasp."""
        g, friction = self.grasp, self.grasp.joint_friction
        arms = model.joint_arms(g)
        sliders: list[tuple[Array, float, float]] = []  # weights, friction, arm
        for group in self.tie:
            rubs = np.array([j for j in group if friction[j] > 0], dtype=int)
            if not len(rubs):
                continue
            sense, of_rates = self._sense(group), np.zeros(g.l)
            of_rates[rubs] = friction[rubs] * np.sign([group[j] for j in rubs])
            if sense:
                self.reaction -= sense * of_rates
                continue
            self.reaction += of_rates
            weights, total = shared(of_rates)
            sliders.append((weights, total, float((arms[rubs] / np.abs(weights[rubs])).min())))
        self._check_size(len(sliders))
        return self._assembled(sliders, arms)

    def _sums(self) -> Array:
        """(l,) given torques and what friction adds to them, rounded once."""
        g, back = self.grasp, np.array(self.grasp.mechanism.backdrivable, dtype=bool)
        exact = given_torques(g.given_torques, g.mechanism.R[back], g.command[back], self.reaction)
        return np.array([not_zero(x) for x in exact])

    def _check_size(self, sliders: int) -> None:
        g, a = self.grasp, len(self.kept)
        more = len(self.stops) + 2 * sliders
        if 3 * g.m + g.l + sliders + 2 * (a + more) > MAX_GRASP_SIZE:
            sizes = (
                f"{g.m} contacts, {g.l} joints and {a} actuators, and {sliders} joints rub and {len(self.stops)} stop"
            )
            right = (
                f"3 x contacts + joints + 2 x actuators + 5 x rubbing + 2 x stopping may be {MAX_GRASP_SIZE} at most"
            )
            raise InputError(f"has {sizes}, too many to search; {right}", field="grasp")

    def _assembled(self, sliders: list[tuple[Array, float, float]], arms: Array) -> EquivalentGrasp:
        g, mech, own = self.grasp, self.grasp.mechanism, len(self.kept)
        l, rows = g.l + len(sliders), own + len(self.stops) + 2 * len(sliders)
        R, A = np.zeros((rows, l)), np.zeros((len(mech.A) + len(self.both), l))
        R[:own, : g.l], A[: len(mech.A), : g.l] = self.R, mech.A
        A[len(mech.A) + np.arange(len(self.both)), self.both] = 1.0
        of_forces, of_couplings = np.zeros((g.l, rows)), np.zeros((g.l, len(A)))
        of_couplings[self.both, len(mech.A) + np.arange(len(self.both))] = 1.0
        actuators, stops, pairs = [mech.actuators[i] for i in self.kept], [], []
        for k, (j, sign) in enumerate(self.stops, start=own):
            R[k, j] = of_forces[j, k] = sign
            stops.append((k, j, sign))
            actuators.append(_unused(f"stop of {g.joints[j].name}", mech.actuators))
        joints = [
            GraspJoint(joint.name, joint.axis, joint.origin, joint.moves, joint.type, torque=float(torque))
            for joint, torque in zip(g.joints, self._sums(), strict=True)
        ]
        names = [joint.name for joint in joints]
        for n, (weights, total, _) in enumerate(sliders):
            first, slider = own + len(self.stops) + 2 * n, g.l + n
            R[first : first + 2, slider], R[first + 1, : g.l] = 1.0, -weights
            of_forces[:, first + 1] = -weights
            rubs = g.joints[int(np.flatnonzero(weights)[0])]
            name = _unused(f"friction of {rubs.name}", names)
            joints.append(GraspJoint(name, rubs.axis, rubs.origin, (), rubs.type, torque=-2 * total))
            actuators += [_unused(f"friction of {rubs.name}, {way}", mech.actuators) for way in ("closing", "opening")]
            pairs.append(FrictionPair(slider, first, weights, total))
        tendon = [mech.tendon[i] for i in self.kept] + [True] * (rows - own)
        command = np.concatenate([self.command, np.zeros(rows - own)])
        plain = Grasp(g.contacts, joints, Mechanism(tuple(actuators), R, A, tuple(tendon)), command, g.name)
        if g.start is not None:
            way = [g.start.stops[j] for j, _ in self.stops]
            slack = np.concatenate([g.start.slack[self.kept], way, np.zeros(2 * len(sliders))])
            plain = plain.with_start(Start(g.start.gaps, np.zeros(l), slack))
        arms = np.concatenate([arms, [arm for _, _, arm in sliders]])
        return EquivalentGrasp(
            g, plain, self.kept, arms, self.reaction, of_forces, of_couplings, self.held, tuple(stops), tuple(pairs)
        )


def _unused(name: str, taken: Collection[str]) -> str:
    """The name, or one like it that is not taken."""
    while name in taken:
        name += "'"
    return name


# --- joints that touch nothing ------------------------------------------------------------------


def runs_away(grasp: Grasp) -> bool:
    """Is there no torque balance of the joints that touch nothing, by (2), (8) and what they can carry themselves?

    A finger in the air that is pulled and held by nothing moves on for ever, and no load makes a difference. Beside
    loads that are ten thousand times as large as what pulls it, a search cannot tell that from rounding.

    What anything moves by is left aside, so that False says nothing; True is a proof that nothing is resisted.
    """
    idle = ~grasp.touches
    mech, given = grasp.mechanism, grasp.given_torques
    if not idle.any() or not (grasp.command.any() or given[idle].any()):
        return False
    moves, back = model.commanded(grasp), np.array(mech.backdrivable, dtype=bool)
    f_c = grasp.command
    low = np.where(back, f_c, np.where(moves & (f_c >= 0), f_c, -np.inf))
    high = np.where(back, f_c, np.where(moves & (f_c < 0), f_c, np.inf))
    lo, hi = model.reaction_range(grasp)
    of_idle = mech.R[:, idle].any(axis=1)
    rest = not given[idle].any() and ((low <= 0) & (high >= 0))[of_idle].all() and ((lo <= 0) & (hi >= 0))[idle].all()
    if rest:  # nothing pulls them
        return False
    from scipy.optimize import linprog  # slow to import, and seldom needed

    free = np.full(len(mech.A), np.inf)
    columns = np.hstack([mech.R.T, mech.A.T, np.eye(grasp.l)])[idle]
    bounds = np.column_stack([np.concatenate([low, -free, lo]), np.concatenate([high, free, hi])])
    found = linprog(np.zeros(columns.shape[1]), A_eq=columns, b_eq=-given[idle], bounds=bounds)
    return bool(found.status == 2)
