"""Shows that few contacts cannot hold an object, wherever on its surface they are: nothing of a search.

Forces f_i in friction cones, and if normal forces are limited within these, have to balance each of some loads alone.
Soft fingers have a torque about the normal as well, at most the torsion times the normal force; they have friction.
Four reasons, each for all numbers of contacts below one:

- *opposed*: if forces balance w, and others -w, their sums balance nothing. Without friction the wrenches of n contacts
  that hold loads of both signs that span d dimensions span these by positive combinations: n > d. With friction it
  takes two contacts: forces in one cone add up to 0 only if they are 0.
- *line*: two point contacts and weights of both signs in three directions. Their sums h and -h have no moment, so h is
  along the line between the contacts, and the weights, which have none about that line, act at a point of it. So both
  contacts are on a line through the centre of mass, one normal within the friction angle of a direction along it, the
  other of the opposite one. The surface is cut into parts (`solids`) until no two of them allow that. There is none
  between solids that touch, which are less than 1e-5 of the object's length apart.
- *force*: a contact with a normal force up to f pushes in direction d with no more than f (n.d + mu sqrt(1 - (n.d)^2)).
  What all loads ask for together is no more than the largest sum of that over all normals n, times the contacts. And
  torques about the centre of mass are at most f sqrt(1 + mu^2) times the distance of the farthest point, from each, and
  f times the torsion.
- *turning*: without friction, where all solids are round about one axis. Then turning about it moves no point of the
  surface along its normal, and if a load has a torque about it, no number of contacts holds that.

Angles and sums are compared with a margin of 1e-6 and more. That is far above their rounding, and above what a state
that holds may miss (`tolerance`): forces that balance a load are no smaller than it, in its own scale. Torques count by
what they are as forces at `reach`; with much friction forces in one cone may all but cancel, so that less is shown.
What turns a force or the line at a contact near the centre of mass more than at the farthest is bounded at each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from handfast.proofs.fields import (
    Array,
    BadFile,
    Fields,
    Integers,
    Mask,
    cross,
    floats,
    rationals,
    rounded,
)
from handfast.proofs.replay import Replay, down
from handfast.proofs.solids import SOLID_TOUCH_DISTANCE, ConvexSolid, SurfaceParts, angle, hidden
from handfast.proofs.tolerance import MIN_FORCE_SCALE

SCHEMA = "handfast/contacts/1"
DIRECTION_MARGIN = 1e-6  # [rad], or of a sum
OPPOSITE_TOLERANCE = 1e-9  # of loads: these are one the other with the other sign
MAX_OPPOSED_FRICTION = 1e8  # sqrt(1 + mu^2), 10 times less than what two forces in one cone need to miss 0 by that
MAX_LINE_FRICTION = 100.0  # up to which what a state may miss turns no force by as much as `DIRECTION_MARGIN`
LOST_PLACES = 1e-14  # relative: more than rounding loses of places, over the largest coordinate
DIRECTION = 1e-3  # share of the largest of the loads below which a force or a torque counts as no direction
# of the surface that are looked at together, and how often each is halved, at most
SURFACE_PARTS, SURFACE_HALVINGS = 6000, 48
FIRST_PARTS = 1_000_000  # before any is left out: a mesh of 20,000 vertices has 200,000
CUBE_GRID = 200  # directions along each side of the six faces of a cube
MAX_LOADS = 10_000
LOAD_BATCH = 1 << 21  # numbers that are in memory at a time, where loads are looked at beside each other


@dataclass(frozen=True)
class Fewest:
    """How many contacts a load needs at least.

    Attributes:
        contacts: no fewer hold; None: no number does. 1 if nothing is shown.
        reason: opposed, line, force or turning; "" if nothing is shown.
    """

    contacts: int | None
    reason: str = ""

    @property
    def most(self) -> float:
        """The largest number that is shown not to hold."""
        return np.inf if self.contacts is None else self.contacts - 1


@dataclass(frozen=True, eq=False)
class Held:
    """What is to be held.

    Attributes:
        solids: the object. center: (3,) [m] its centre of mass.
        loads: (k, 6) [N, N m] at the object's origin, each alone.
        friction: coefficient at every contact. force_limit: [N] largest normal force at one; inf for none.
        torsion: [m] coefficient of torsional friction at every contact; 0 for point contacts.
    """

    solids: tuple[ConvexSolid, ...]
    center: Array
    loads: Array
    friction: float
    force_limit: float = np.inf
    torsion: float = 0.0

    def fewest(self) -> Fewest:
        """The most that is shown by any reason."""
        best = max(Fewest(1), self.opposed(), self._force(), self._turning(), key=lambda f: f.most)
        if best.contacts == 2 and self._weighed() and self._no_line():
            return Fewest(3, "line")
        return best

    @cached_property
    def _reach(self) -> float:
        """[m] from the centre of mass to the farthest point, at least."""
        return max(s.reach(self.center) for s in self.solids)

    def _torques(self, point: Array) -> Array:
        """(k, 3) [N m] of the loads about a point, rounded once."""
        at = rationals(point.tolist())
        both = ((rationals(w[3:]), cross(at, rationals(w[:3]))) for w in self.loads.tolist())
        return np.array([[rounded(t - m) for t, m in zip(*pair, strict=True)] for pair in both]).reshape(-1, 3)

    @cached_property
    def _turns(self) -> Array:
        """(k, 3) [N m] of the loads about the centre of mass."""
        return self._torques(self.center)

    # --- loads alone ---

    def _both(self, reach: float) -> Mask:
        """(k,) loads that come with both signs; torques about the centre of mass count as forces at `reach` [m]."""
        out = np.zeros(len(self.loads), dtype=bool)
        if not reach > MIN_FORCE_SCALE:
            return out
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which is opposite to none
            scaled = np.hstack([self.loads[:, :3], self._turns / reach])
            size = np.linalg.norm(scaled, axis=1)
            unit = scaled / size[:, None]
            for k in range(0, len(unit), step := max(1, LOAD_BATCH // (6 * max(len(unit), 1)))):
                off = np.linalg.norm(unit[k : k + step, None] + unit, axis=2)
                out[k : k + step] = (off < OPPOSITE_TOLERANCE).any(axis=1)
        return out & (size > MIN_FORCE_SCALE)

    def opposed(self, reach: float | None = None) -> Fewest:
        """What loads of both signs take, whatever the shape.

        reach: [m] from `center` to the farthest place of a contact, where there are no `solids`.
        """
        reach = self._reach if reach is None else reach
        both = self._both(reach)
        if not both.any():
            return Fewest(1)
        if self.friction or self.torsion:
            # a load is no more than 2 + torsion / reach times the force behind it, both in the scale of `_both`
            near = np.hypot(1.0, self.friction) * (1 + self.torsion / reach) <= MAX_OPPOSED_FRICTION
            return Fewest(2, "opposed") if near else Fewest(1)
        force, torque = self.loads[both, :3], self._turns[both]
        most = max(np.abs(force).max(initial=0.0), np.abs(torque).max(initial=0.0) / max(reach, 1e-300))
        rank = max(_rank(force, most), _rank(torque, most * reach))
        return Fewest(1 + rank, "opposed")

    @cached_property
    def _spanned(self) -> tuple[int, float]:
        """How many of the loads are forces of both signs at the centre of mass, and the least singular value of their
        directions.
        """
        force, off = self.loads[:, :3], np.linalg.norm(self._turns, axis=1)
        size = np.linalg.norm(force, axis=1)
        its = (size > 0) & self._both(self._reach) & (off <= OPPOSITE_TOLERANCE * self._reach * size)
        if its.sum() < 6:
            return 0, 0.0
        return int(its.sum()), float(np.linalg.svd(force[its] / size[its, None], full_matrices=False)[1][2])

    def _weighed(self) -> bool:
        """Are among the loads forces at the centre of mass of both signs that span all directions?"""
        return self._spanned[1] > 0.1

    @cached_property
    def _aside(self) -> float:
        """[m] over the distance of a contact from the centre of mass: the angle between the way there and a force along
        the line that is left open, as weights and states may be off by `OPPOSITE_TOLERANCE`.

        k weights, whose directions have the least singular value s, act within 1e-9 reach of the centre and are missed
        by as much: the line is within 2e-9 reach sqrt(k) / s of it. What a contact gives to both signs of one of them
        is s / sqrt(k) / sqrt(1 + mu^2) of it or more, times 2 and the distance from the centre over that between the
        contacts; both contacts miss its torque by 6e-9 reach. So it is turned by 3e-9 reach over the distance.
        """
        k, least = self._spanned
        if not least > 0:
            return 0.0
        far = max(float(np.abs(np.stack([*s.box, self.center])).max()) for s in self.solids)
        missed = 5 * OPPOSITE_TOLERANCE * np.hypot(1.0, self.friction) * np.sqrt(k) / least
        return float(missed * self._reach + LOST_PLACES * far)

    def _force(self) -> Fewest:
        if not np.isfinite(self.force_limit):
            return Fewest(1)
        force, torque = self.loads[:, :3], np.linalg.norm(self._turns, axis=1)
        size, most = np.linalg.norm(force, axis=1), np.hypot(1.0, self.friction)
        arm = self._reach * most + self.torsion
        needed = max(size.max() / most, torque.max() / arm), self._in_all_directions(force, size)
        n = float(np.ceil(max(needed) / max(self.force_limit, 1e-300) * (1 - DIRECTION_MARGIN)))
        return Fewest(int(min(n, 1e9)), "force") if n > 1 else Fewest(1)

    def _in_all_directions(self, force: Array, size: Array) -> float:
        """[N] what all loads ask for, over what one contact gives to all of them per newton of its normal force."""
        steps = np.linspace(-1, 1, CUBE_GRID)
        u, v = (a.ravel() for a in np.meshgrid(steps, steps))
        one = np.ones_like(u)
        faces = [np.roll(np.stack([sign * one, u, v], axis=1), k, axis=1) for k in range(3) for sign in (1, -1)]
        n = np.concatenate(faces)
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        some = size > 0
        if not some.any():
            return 0.0
        ways, step, most = (force[some] / size[some, None]).T, max(1, LOAD_BATCH // int(some.sum())), 0.0
        for k in range(0, len(n), step):
            along = np.clip(n[k : k + step] @ ways, -1, 1)
            gives = np.maximum(along + self.friction * np.sqrt(1 - along**2), 0.0)
            most = max(most, float(gives.sum(axis=1).max()))
        between = 1.01 * np.sqrt(2) / (CUBE_GRID - 1) * np.hypot(1.0, self.friction)  # by how much one may be missed
        return float(size.sum() / (most + between * some.sum()))

    # --- the surface ---

    def _turning(self) -> Fewest:
        if self.friction or self.torsion or any(s.kind == "mesh" for s in self.solids):
            return Fewest(1)
        first = self.solids[0].pose[:3, 3]
        at, torques = [rationals(s.pose[:3, 3].tolist()) for s in self.solids], self._torques(first)
        axes = [rationals(a.tolist()) for s in self.solids if (a := _axis(s)) is not None]
        axes += [way for p in at if any(way := [x - y for x, y in zip(p, at[0], strict=True)])]
        # of a ball any will do
        axis = axes[0] if axes else rationals(torques[np.linalg.norm(torques, axis=1).argmax()].tolist())
        # no rounding is let pass: without friction a push that is all but along a normal may be as strong as it likes
        round_ = all(_ball(s) or _axis(s) is not None for s in self.solids)
        if not round_ or not any(axis) or any(any(cross(a, axis)) for a in axes):
            return Fewest(1)
        along = floats([x / max(map(abs, axis)) for x in axis])
        reach = max(s.reach(first) for s in self.solids)
        size = np.linalg.norm(self.loads[:, :3], axis=1) * reach + np.linalg.norm(torques, axis=1)
        turned = np.abs(torques @ along) > DIRECTION_MARGIN * size * np.linalg.norm(along)
        return Fewest(None, "turning") if (turned & (size > MIN_FORCE_SCALE)).any() else Fewest(1)

    def _no_line(self) -> bool:
        """Is there no line through the centre of mass along which two contacts can push against each other?"""
        if not 0 < self.friction <= MAX_LINE_FRICTION or self.torsion:
            return False
        own: list[SurfaceParts] = []
        for k, solid in enumerate(self.solids):
            its = solid.parts()
            if its is None or sum(map(len, own)) + len(its) > FIRST_PARTS:
                return False
            own.append(replace(its, solid=its.solid + k))
        parts = SurfaceParts.joined(own)
        for _ in range(SURFACE_HALVINGS):
            parts = parts[self._against(parts)]
            parts = parts[~hidden(parts, self.solids)]
            if 0 < len(parts) <= SURFACE_PARTS:
                parts = parts[_meets(*self._lines(parts))]
            if not 0 < len(parts) <= SURFACE_PARTS:
                break
            parts = parts.halves(self.center)
        return not len(parts)

    def _seen(self, parts: SurfaceParts) -> tuple[Array, Array, Array, Array, Array]:
        """Of N parts from the centre of mass: ways to them, angles within which these are; where forces push, likewise.

        Last (N, 2) the least angle [rad] between a force and the way there, and the way back; 0 or less if none.
        """
        middle, reach = parts.balls()
        way = middle - self.center
        far = np.linalg.norm(way, axis=1)
        within = np.where(reach < far, np.arcsin(np.minimum(reach / np.maximum(far, 1e-300), 1.0)), np.pi)
        nearest = np.maximum(far - reach, 1e-300)
        margin = DIRECTION_MARGIN + np.where(
            self._aside < nearest, np.arcsin(np.minimum(self._aside / nearest, 1)), np.pi
        )
        within = within + margin
        axis, half = parts.cones()
        pushed = np.minimum(half + np.arctan(self.friction) + margin, np.pi)
        miss = np.stack([angle(sign * way, -axis) for sign in (1, -1)], axis=1) - (within + pushed)[:, None]
        return way / np.maximum(far, 1e-300)[:, None], within, -axis, pushed, miss

    def _against(self, parts: SurfaceParts) -> Mask:
        """(N,) can a force there point to the centre of mass, or away from it?"""
        return np.asarray((self._seen(parts)[4] <= 0).any(axis=1))

    def _lines(self, parts: SurfaceParts) -> tuple[Array, Array, Integers]:
        """Cones of the directions that forces along lines through the centre of mass can have.

        Unit axes (M, 3), half the angles (M,) [rad], and which of the parts each is of.
        """
        way, within, push, pushed, miss = self._seen(parts)
        out = []
        for sign, off in ((1, miss[:, 0]), (-1, miss[:, 1])):
            its = np.flatnonzero(off <= 0)
            by_way = (within < pushed)[its, None]
            half = np.minimum(within, pushed)[its]
            out.append((np.where(by_way, sign * way[its], push[its]), half, its))
        axes, halves, owners = (np.concatenate(a) for a in zip(*out, strict=True))
        return axes, halves, owners.astype(np.int64)


def _meets(axis: Array, half: Array, owner: Integers) -> Mask:
    """(N,) parts with a cone that another part's, or their own, meets on the other side of the centre of mass."""
    out = np.zeros(owner.max() + 1, dtype=bool)
    wide = half >= np.pi / 2
    out[owner] = wide.any()
    c, s = np.cos(half), np.sin(half)
    for k in range(0, len(axis), 256):
        some = slice(k, k + 256)
        near = -axis[some] @ axis.T >= c[some, None] * c - s[some, None] * s
        out[owner[some][near.any(axis=1)]] = True
    return out


def _rank(a: Array, most: float) -> int:
    """Directions of forces or torques (k, 3) that are a share of the largest, far above what a state may miss."""
    return int(np.linalg.matrix_rank(a, tol=DIRECTION * most))


def _ball(s: ConvexSolid) -> bool:
    return s.kind == "sphere" or (s.kind == "ellipsoid" and len(set(s.size)) == 1)


def _axis(s: ConvexSolid) -> Array | None:
    """(3,) about which a solid is round; None of a ball and of what is not."""
    if s.kind in ("capsule", "cylinder"):
        return np.asarray(s.pose[:3, 2])
    if s.kind == "ellipsoid" and not _ball(s):
        alone = [k for k in range(3) if s.size[k - 1] == s.size[k - 2]]
        return np.asarray(s.pose[:3, alone[0]]) if alone else None
    return None


# --- files ------------------------------------------------------------------------------------------

FEWEST_REASONS = {
    "opposed": "loads of both signs need more contacts than the directions that these span",
    "line": "two point contacts hold a weight from every side only along a line through the centre of mass that is "
    "within both friction cones, and there is no such line",
    "force": "the normal forces that are allowed do not add up to the loads",
    "turning": "the object is round about an axis and there is no friction, so that it turns",
}


def words(fewest: Fewest) -> str:
    """What is shown of an object, in one sentence without a full stop."""
    why = f": {FEWEST_REASONS[fewest.reason]}" if fewest.reason else ""
    if fewest.contacts is None:
        return f"no number of contacts on its surface can hold{why}"
    most = fewest.contacts - 1
    if most < 1:
        return "any number of contacts on its surface may hold"
    few = "1 contact" if most == 1 else f"{'1 or 2' if most == 2 else f'1 to {most}'} contacts"
    return f"{few} on its surface cannot hold{why}"


def read_held(f: Fields) -> tuple[Held, tuple[str, ...]]:
    """What a file asks, and the names of the loads."""
    solids = tuple(ConvexSolid.read(s) for s in f.objects("solids"))
    loads = f.object("loads")
    if len(loads.names()) > MAX_LOADS:
        raise BadFile(f"has {len(loads.names())} loads; at most {MAX_LOADS} are possible", loads.place)
    named = {name: loads.numbers(name, (6,)) for name in loads.names()}
    limit = f.number("force_limit", least=0.0) if f.has("force_limit") else np.inf
    torsion = f.number("torsion", 0.0, least=0.0)
    for name, some in (("solids", solids), ("loads", named)):
        if not some:
            raise BadFile("is empty; at least one is needed", f.at(name))
    center, friction = f.numbers("center_of_mass", (3,)), f.number("friction", least=0.0)
    wrenches = np.array(list(named.values())).reshape(-1, 6)
    return Held(solids, center, wrenches, friction, limit, torsion), tuple(named)


@dataclass(frozen=True, eq=False)
class ContactsClaim:
    """What a file says: of what, how many contacts at least, and loads (6,) by name."""

    held: Held
    fewest: Fewest
    loads: Mapping[str, list[float]]

    @property
    def words(self) -> str:
        """In one sentence."""
        return words(self.fewest)


def read_claim(data: Any, place: str = "") -> ContactsClaim:
    """The claim of a parsed file. Raises `BadFile`."""
    f = Fields(data, place)
    f.text("schema", among=[SCHEMA])
    f.text("object")
    reason = f.text("reason", among=["", *FEWEST_REASONS])
    held, names = read_held(f)
    contacts = f.whole("contacts", least=1) if f.has("contacts") else None
    f.done()
    return ContactsClaim(held, Fewest(contacts, reason), dict(zip(names, held.loads.tolist(), strict=True)))


def replay(data: Any, place: str = "") -> Replay:
    """Is the claim of a parsed file shown? Raises `BadFile`."""
    claimed = read_claim(data, place)
    held, contacts, names = claimed.held, claimed.fewest.contacts, claimed.loads
    found = held.fewest()
    limit = f" and normal forces up to {down(held.force_limit)} N" if np.isfinite(held.force_limit) else ""
    shown = found.contacts is None or (contacts is not None and contacts <= found.contacts)
    shown &= claimed.fewest.reason in ("", found.reason)
    said = words(Fewest(contacts, found.reason)) if shown else words(Fewest(contacts))
    limit = f", a torsion of {down(1e3 * held.torsion)} mm{limit}" if held.torsion else limit
    if found.reason == "line" and len(held.solids) > 1:
        said += f", where solids touch that are less than {SOLID_TOUCH_DISTANCE:g} of the object's length apart"
    claim = f"with a friction of {down(held.friction)}{limit}, of {', '.join(names)}: {said}"
    refused = "" if shown else f"shown is only that {words(found)}"
    return Replay("contacts", claim, refused, {"contacts": found.contacts})


def replay_of_loads(
    contacts: int, reach: float, loads: Mapping[str, Array], friction: float, f: Fields, torsion: float = 0.0
) -> Replay:
    """The claim that so many contacts, up to `reach` [m] from the origin, cannot hold some loads, (6,) by name.

    Raises `BadFile`.
    """
    few = f.whole("fewest_contacts", least=1)
    f.done()
    found = Held((), np.zeros(3), np.array(list(loads.values())), friction, torsion=torsion).opposed(reach)
    claim = f"{contacts} contacts cannot hold {', '.join(loads)} with a friction of {down(friction)}"
    refused = "" if contacts < few <= found.most + 1 else f"shown is only that it takes {found.most + 1:g}"
    return Replay(
        "balance", claim + (f": {FEWEST_REASONS[found.reason]}" if found.reason else ""), refused, {"contacts": few}
    )


def to_json(held: Held, names: Sequence[str], thing: str, fewest: Fewest) -> dict[str, Any]:
    """For files, as `replay` reads it."""
    solids = [
        {"kind": s.kind, "size": list(s.size), "pose": s.pose.tolist()}
        | ({"vertices": s.vertices.tolist(), "faces": s.faces.tolist()} if s.kind == "mesh" else {})
        for s in held.solids
    ]
    return {
        "schema": SCHEMA,
        "object": thing,
        "contacts": fewest.contacts,
        "reason": fewest.reason,
        "friction": held.friction,
        "force_limit": held.force_limit if np.isfinite(held.force_limit) else None,
        **({"torsion": held.torsion} if held.torsion else {}),
        "center_of_mass": held.center.tolist(),
        "loads": {name: w.tolist() for name, w in zip(names, held.loads, strict=True)},
        "solids": solids,
    }
