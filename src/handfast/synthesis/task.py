"""Task: which regions of a hand are to touch which regions of an object, and what bounds the answer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from handfast.core.arrays import Array, Indices, frozen
from handfast.core.errors import InputError, unknown_name
from handfast.core.presented import Presented
from handfast.model.hand.coupling import drivers
from handfast.model.hand.hand import Coupling, Hand, coupling_rows
from handfast.model.mechanism import Mechanism
from handfast.model.region import Bezier, Cap, Region

PAD_DIRECTION = np.array([0.5, 0.0, 0.87])  # middle of the pad in a distal frame: palmar, a little towards the tip
PAD_HALF_ANGLE = np.radians(60)


@dataclass(frozen=True, eq=False)
class ContactPair:
    """One pair of regions (h_c, o_c) that must touch (synthesis paper, section 2.2).

    Attributes:
        link: name of the hand link.
        hand: the region on that link, link frame.
        object: the region on the object, object frame.
    """

    link: str
    hand: Region
    object: Region


@dataclass(frozen=True, eq=False)
class PoseBounds:
    """Bounds on the object's pose in the palm frame.

    Attributes:
        position: (3, 2) [m] of the object's origin; infinite where there is no bound.
        axes: (3, 3, 2): axes[k, i] bounds component i of the object's axis k (x, y, z) in the palm
            frame, which is R[i, k]; [-1, 1] where there is no bound.
    """

    position: Array
    axes: Array

    def __post_init__(self) -> None:
        for name, shape in (("position", (3, 2)), ("axes", (3, 3, 2))):
            a = np.array(getattr(self, name), dtype=float)
            if a.shape != shape or np.isnan(a).any():
                raise InputError(f"has shape {a.shape}, needs {shape} and no NaN", field=f"pose.{name}")
            a.flags.writeable = False
            object.__setattr__(self, name, a)
        for i, (lo, hi) in enumerate(self.position):
            if not lo <= hi:
                raise InputError(f"is [{lo:g}, {hi:g}]; the lower one comes first", field=f"pose.position[{i}]")
        for k, bounds in enumerate(self.axes):
            name = f"pose.{'xyz'[k]}_axis"
            for i, (lo, hi) in enumerate(bounds):
                if not lo <= hi:
                    raise InputError(f"is [{lo:g}, {hi:g}]; the lower one comes first", field=f"{name}[{i}]")
            most = np.abs(bounds).max(axis=1) @ np.abs(bounds).max(axis=1)
            inside = np.where((bounds[:, 0] <= 0) & (bounds[:, 1] >= 0), 0.0, np.abs(bounds).min(axis=1))
            if most < 1 or inside @ inside > 1:
                how = "shorter" if most < 1 else "longer"
                raise InputError(f"contradicts itself: every vector within is {how} than 1", field=name)

    @classmethod
    def none(cls) -> PoseBounds:
        """Any pose."""
        return cls(np.tile([-np.inf, np.inf], (3, 1)), np.tile([-1.0, 1.0], (3, 3, 1)))


@dataclass(frozen=True, eq=False)
class Task(Presented):
    """The configuration problem: bring each hand region onto its object region.

    Attributes:
        hand: with the task's limits and couplings already in it (see `Task.of`).
        touches: the contacts, at least one.
        pose: bounds on the object's pose in the palm frame (the hand's base link).
        object: name or path of the object's mesh, for pictures and collision; None if not known.
        name: of the task.
    """

    hand: Hand
    contact_pairs: tuple[ContactPair, ...]
    pose: PoseBounds
    object: str | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if not self.contact_pairs:
            raise InputError("is empty; at least one pair of regions is needed", field="contacts")
        for k, pair in enumerate(self.contact_pairs):
            if pair.link not in self.hand.link_names:
                raise unknown_name("link", pair.link, self.hand.link_names, field=f"contacts[{k}].hand.link")

    @classmethod
    def of(
        cls,
        hand: Hand,
        contact_pairs: tuple[ContactPair, ...],
        *,
        limits: Mapping[str, tuple[float, float]] | None = None,
        couplings: tuple[tuple[str, str, float], ...] = (),
        pose: PoseBounds | None = None,
        object: str | None = None,
        name: str = "",
    ) -> Task:
        """A task from a hand as it is and what the task says beside it.

        Args:
            limits: by joint name [rad, m]; they replace the hand's, also where they are wider: then nothing stops
                the joint there. A narrower one is no stop.
            couplings: (joint, driver, ratio): q[joint] = ratio * q[driver], on the angle itself; they
                come beside the hand's own and replace those of the same joint.

        Raises:
            InputError: an unknown joint (the known ones are listed), a lower limit above the upper one,
                a joint that drives itself or is tied twice, a hand with closed loops.
        """
        if hand.loops:
            problem = f"closes a loop ({hand.loops[0].name}); synthesis knows hands whose links are a tree"
            raise InputError(problem, source=hand.source or hand.name)
        joints = list(hand.joints)
        for joint, (lo, hi) in (limits or {}).items():
            j = hand.joint(joint, field="limits")
            if not lo <= hi:
                raise InputError(f"is [{lo:g}, {hi:g}]; the lower one comes first", field=f"limits.{joint}")
            law = joints[j].law.within(float(lo), float(hi))
            joints[j] = replace(joints[j], lower=float(lo), upper=float(hi), law=law)
        changed = replace(hand, joints=tuple(joints))
        for n, (joint, driver, ratio) in enumerate(couplings):
            changed = _coupled(changed, joint, driver, ratio, f"couplings[{n}]")
        return cls(changed, tuple(contact_pairs), pose or PoseBounds.none(), object, name)

    @cached_property
    def links(self) -> tuple[int, ...]:
        """Index of the hand link of each contact."""
        return tuple(self.hand.link(t.link) for t in self.contact_pairs)

    @cached_property
    def involved(self) -> Indices:
        """Indices of the joints between the palm and some contact, ascending."""
        return np.array(sorted({j for link in self.links for j in self.hand.moved_by(link)}), dtype=np.intp)

    @cached_property
    def moving(self) -> tuple[int, ...]:
        """Indices of the joints that move some contact, and of all that move with them."""
        follows, involved = drivers(self.hand), self.involved.tolist()
        driving = {follows[j][0] for j in involved} - {-1}
        return tuple(j for j in follows if follows[j][0] in driving or j in involved)

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Names of the joints that are coordinates: of `moving` those that are free, by coupling and by limits."""
        follows = drivers(self.hand)
        joints = [self.hand.joints[j] for j in self.moving if follows[j][0] == j]
        return tuple(joint.name for joint in joints if joint.lower < joint.upper)


def _coupled(hand: Hand, joint: str, driver: str, ratio: float, field: str) -> Hand:
    j, k = hand.joint(joint, field=f"{field}.joint"), hand.joint(driver, field=f"{field}.equals")
    if not np.isfinite(ratio) or ratio == 0:
        raise InputError(f"is {ratio:g}; a finite number other than zero is needed", field=f"{field}.ratio")
    couplings = tuple(c for c in hand.couplings if c.joint != j)
    tied = {c.joint: c.driver for c in couplings} | {j: k}
    seen, end = {j}, k
    while end in tied and end not in seen:
        seen.add(end)
        end = tied[end]
    if end in seen:
        raise InputError(f"ties {joint} to itself", field=field)
    couplings += (Coupling(j, k, float(ratio)),)
    driven = [i for i in range(hand.l) if i not in {c.joint for c in couplings}]
    mechanism = Mechanism(
        tuple(hand.joint_names[i] for i in driven),
        frozen(np.eye(hand.l)[driven], (len(driven), hand.l), "mechanism.R"),
        coupling_rows(couplings, hand.l),
        (False,) * len(driven),
    )
    return replace(hand, couplings=couplings, mechanism=mechanism)


def pinch(
    hand: Hand, *, fingers: tuple[str, str] = ("index", "thumb"), edge: float = 0.02, patch: float = 0.008
) -> Task:
    """The precision grasp as a task: both fingertips on a small cube.

    The cube has a given edge [m] and its origin at its centre; each fingertip is on a square of side `patch` [m].

    The squares are in the middle of the faces +x (first finger) and -x. A fingertip is the sphere among the
    shapes of the link `<finger>_distal` that lies furthest out along its x; the pad is the cap of 60
    degrees about (0.5, 0, 0.87) of that frame.

    Raises:
        InputError: no such link, or no sphere on it.
    """
    pairs = []
    for finger, side in zip(fingers, (1.0, -1.0), strict=True):
        link = f"{finger}_distal"
        pairs.append(ContactPair(link, fingertip(hand, link), _face(side, edge / 2, patch / 2)))
    return Task.of(hand, tuple(pairs), name=f"pinch-{hand.name}")


def fingertip(hand: Hand, link: str) -> Cap:
    """The pad of a spherical fingertip, link frame."""
    balls = [s for s in hand.links[hand.link(link)].shapes if s.kind == "sphere"]
    if not balls:
        raise InputError("has no sphere among its shapes; a spherical fingertip is needed", field=link)
    tip = max(balls, key=lambda s: float(s.pose[0, 3]))
    return Cap(tip.pose[:3, 3], tip.size[0], PAD_DIRECTION, PAD_HALF_ANGLE)


def _face(side: float, x: float, half: float) -> Bezier:
    """A square about the x axis at side * x, outward normal along side * x."""
    corners: Array = np.array([[[side * x, u, v] for v in (-half, half)] for u in (-half, half)])
    return Bezier(corners, flip=side < 0)
