"""Searches for a proof that a task has no grasp, for several reasons together: `proofs/discarded_boxes`.

For sets of contacts (each alone, each two, all), in turns, boxes of their configurations are halved until the contacts
cannot be made there, a link is too deep in the object or in another link, or no contact forces balance the loads.
Each reason proposes a claim for a box, from what is so in its middle; the checker's own arithmetic says whether it
discards the box. The claim that was tried last on a box is the first that its halves try. One set without a box left
settles the task. A set is given up at a box that no reason discards, and in which nothing moves by more than
`MIN_BOX_MOTION`.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import combinations
from typing import Any, Protocol

import numpy as np
from scipy.spatial import QhullError

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.libraries import deferred_interrupt
from handfast.geometry.collision import Collisions
from handfast.model.shape import Shape
from handfast.planning.missing import Missing, of_balance, of_collision, of_contacts, units
from handfast.planning.no_balance import NoBalance
from handfast.planning.question import Allowed
from handfast.planning.virtual_motions import VirtualMotions
from handfast.proofs.convex_solids import SolidsData, solid_to_dict
from handfast.proofs.discarded_boxes import (
    DISCARD_BATCH,
    NO_CONTACT_ENTRY,
    Balance,
    Boxes,
    Collision,
    DiscardCounts,
    NoGraspProof,
    OpenBox,
    Reason,
)
from handfast.proofs.fields import BadFile, Fields, Integers
from handfast.proofs.motors import Motors
from handfast.proofs.posed_boxes import CHARTS, OBJECT_LINK, ContactBoxes, Pose
from handfast.proofs.replay import Refused
from handfast.proofs.tasks import TaskData, read_task
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.task import Task

MAX_SET_BOXES = 300_000  # boxes of a set that are kept in memory
MIN_BOX_MOTION = 1e-5  # [m] a box in which nothing moves further is not halved
HULL_CORNERS = 48  # of a mesh at most, whose hull stands for it
OVERLAP_POINTS = 24  # points of a solid that may show an overlap
OVERLAP_STEPS = (0.3, 0.1, 0.03)  # to points beside the best sample, of the smaller solid's radius
NEIGHBOUR_OFFSETS = np.array([[i, j, k] for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=float)
DEPTH_SHARES = (0.95, 0.5)  # of the way from its middle to its surface
MIN_TURN_SHARE = 0.05  # sets have turns by how much of them is left, but no more than of one with this share
NO_CLAIM = -1
OTHERS = 0.3  # of what other links move counts beside the first contact's: they need joints to be known, it does not

# --- the solids of a question -----------------------------------------------------------------------


def solids_to_dict(collisions: Collisions, allowed: Allowed) -> dict[str, Any]:
    """Convex solids of hand and object, and how deep they may be in each other: `question.solids` of a file."""
    scene, hand = collisions.scene, collisions.scene.hand
    judged = [pair not in collisions.left_out for pair in scene.self_pairs]
    pairs = [
        {"first": hand.link_names[a], "second": hand.link_names[b], "depth": float(allowed.self_depth + rest)}
        for (a, b), rest, its in zip(scene.self_pairs, collisions.at_rest, judged, strict=True)
        if its
    ]
    links = [{"link": k.name, "solids": [_solid(s) for s in k.shapes]} for k in hand.links if k.shapes]
    depth = float(max(allowed.depth, allowed.at_contacts))
    return {"links": links, "object": [_solid(s) for s in scene.body.pieces], "depth": depth, "pairs": pairs}


def _solid(shape: Shape) -> dict[str, Any]:
    return solid_to_dict(shape.kind, shape.size, shape.pose, shape.vertices)


@dataclass(frozen=True, eq=False)
class _Sampled:
    """A solid, or of a mesh a hull of few of its vertices, with points inside it and how deep they are."""

    shape: Shape
    faces: Integers | None
    points: Array
    depths: Array
    radius: float

    @classmethod
    def of(cls, shape: Shape) -> _Sampled | None:
        """None of a mesh that has no inside."""
        faces = None
        if shape.kind == "mesh":
            chosen = _spread(shape.vertices, HULL_CORNERS)
            try:
                hull = Shape.hull(shape.vertices[chosen], shape.pose)
            except (InputError, QhullError):
                return None
            rows = {tuple(v): i for i, v in zip(chosen.tolist(), shape.vertices[chosen].tolist(), strict=True)}
            faces = np.array([rows[tuple(v)] for v in hull.vertices.tolist()])[hull.faces]
            shape = hull
        surface, middle = shape.triangles()[0], shape.centroid
        points = np.vstack([middle, *(middle + share * (surface - middle) for share in DEPTH_SHARES)])
        points = points[_spread(points, OVERLAP_POINTS)]
        depths = shape.depth(points)
        radius = float(np.linalg.norm(surface - middle, axis=1).max())
        return cls(shape, faces, points, depths, radius)


def _spread(points: Array, most: int) -> Integers:
    """Indices of points (n, 3), each the farthest from those before it."""
    out, away = [0], np.linalg.norm(points - points[0], axis=1)
    while len(out) < most and away.max() > 0:
        out.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(points - points[out[-1]], axis=1))
    return np.array(out)


# --- what may discard a box -------------------------------------------------------------------------


class Proposer(Protocol):
    """A reason that finds its own claims."""

    @property
    def reason(self) -> Reason: ...

    def propose(self, boxes: Boxes, last: Integers) -> Integers:
        """(N,) the most promising claim for each box, or `NO_CLAIM`; last: what was tried on the box it is half of."""


class BalanceProposer:
    """Twists on which the loads do work and no contact forces do, see `NoBalance`; else with motions of the joints."""

    def __init__(self, balance: NoBalance, contacts: ContactBoxes, motors: Motors) -> None:
        self.balance, self.contacts, self.motors = balance, contacts, motors
        self.virtual = VirtualMotions(contacts, motors, balance.placements)

    @property
    def reason(self) -> Balance:
        return Balance(self.balance.placements, self.balance.motions, self.contacts, self.motors)

    def propose(self, boxes: Boxes, last: Integers) -> Integers:
        moved = self.balance.motions.moved
        still = np.where((last >= 0) & moved[last], NO_CLAIM, last) if len(moved) else last
        closed, tried, _ = self.balance.examined(boxes.box[:, self.reason.columns], still)
        its = np.flatnonzero(closed == NO_CLAIM)
        if self.virtual.free and len(its):
            motions, found = self.virtual.propose(boxes.some(its), self.balance.hits)
            tried[its[found]] = self.balance.add_motions(motions)
        return tried


class CollisionProposer:
    """Points of links that are inside another solid in the middle of a box."""

    def __init__(self, contacts: ContactBoxes, collisions: Collisions, solids: SolidsData) -> None:
        scene = collisions.scene
        carriers: dict[int, Sequence[Shape]] = {i: link.shapes for i, link in enumerate(scene.hand.links)}
        carriers[OBJECT_LINK] = scene.body.pieces
        sampled = {(i, k): _Sampled.of(s) for i, its in carriers.items() for k, s in enumerate(its)}
        self.sampled = {key: s for key, s in sampled.items() if s is not None}
        faced = {i: list(solids.of(i)) for i in carriers}
        for (i, k), s in self.sampled.items():
            if s.faces is not None:
                faced[i][k] = faced[i][k].with_faces(s.faces)
        thing = tuple(faced.pop(OBJECT_LINK))
        self.solids = SolidsData({i: tuple(s) for i, s in faced.items()}, thing, solids.allowed)
        placed = contacts.placed
        self.pairs = [
            (a, b)
            for a in self.sampled
            for b in self.sampled
            if a[0] in placed and b[0] in placed | {OBJECT_LINK} and (a[0], b[0]) in solids.allowed
        ]
        self.first = contacts.task.links[0]
        self.links = sorted({a[0] for a, _ in self.pairs})
        self.reason = Collision(self.solids, np.zeros((0, 4), dtype=np.int64), np.zeros((0, 3)))

    def reach(self, boxes: Boxes, which: Array, points: Array) -> Array:
        """(N, n) [m] how far each side moves points (N, 3) of one link for each box against a body: which (N, 2)."""
        out = np.zeros(boxes.box.shape[:2])
        wide = np.ptp(boxes.box, axis=2)
        for link, body in np.unique(which, axis=0).tolist():
            its = np.flatnonzero((which == (link, body)).all(axis=1))
            slope = boxes.over.some(its).seen(link, body, points[its]).slope.mag  # (n, M, 3)
            out[its] = np.linalg.norm(slope, axis=2).T * wide[its] / 2
        return out

    def moves(self, boxes: Boxes) -> Array:
        """(N, n) [m] the most that each side moves the middle of any link against the object."""
        out = np.zeros(boxes.box.shape[:2])
        for link in self.links:
            middle = self.sampled[min(key for key in self.sampled if key[0] == link)].shape.centroid
            which = np.tile([link, OBJECT_LINK], (len(out), 1))
            reach = self.reach(boxes, which, np.tile(middle, (len(out), 1)))
            out = np.fmax(out, reach if link == self.first else OTHERS * reach)
        return out

    def propose(self, boxes: Boxes, last: Integers) -> Integers:
        N = len(last)
        half = np.ptp(boxes.box, axis=2) / 2
        frames = {pair: boxes.over.relative(*pair) for pair in {(a[0], b[0]) for a, b in self.pairs}}
        best, which, points = np.full(N, -np.inf), np.full((N, 4), NO_CLAIM), np.zeros((N, 3))
        for a, b in self.pairs:
            one, other, frame = self.sampled[a], self.sampled[b], frames[a[0], b[0]]
            middle = frame.rotation.value.mid @ one.shape.centroid + frame.place.value.mid
            its = np.flatnonzero(np.linalg.norm(middle - other.shape.centroid, axis=1) < one.radius + other.radius)
            if len(its):
                allowed = self.solids.depth_allowed(a[0], b[0])
                value, x = _Meeting.of(frame, its, half[its], one.shape, other.shape, allowed).best(one, other)
                better = value > best[its]
                best[its[better]] = value[better]
                which[its[better]], points[its[better]] = (*a, *b), x[better]
        found = np.flatnonzero(np.isfinite(best))
        claims = np.full(N, NO_CLAIM)
        claims[found] = len(self.reason) + np.arange(len(found))
        r = self.reason
        self.reason = replace(r, which=np.vstack([r.which, which[found]]), points=np.vstack([r.points, points[found]]))
        return claims


@dataclass(frozen=True, eq=False)
class _Meeting:
    """Two solids in M boxes: in the middles, and how the first one moves in the second one's frame.

    Attributes:
        turn, shift: (M, 3, 3) and (M, 3) its frame. turns, shifts: (n, M, 3, 3) and (n, M, 3) what sides change.
        allowed: [m] that they may overlap.
    """

    turn: Array
    shift: Array
    turns: Array
    shifts: Array
    first: Shape
    second: Shape
    allowed: float

    @classmethod
    def of(cls, frame: Pose, its: Integers, half: Array, first: Shape, second: Shape, allowed: float) -> _Meeting:
        """half: (M, n) of the boxes' sides."""
        R, p, by = frame.rotation, frame.place, half.T[..., None]
        turns, shifts = R.slope.mid[:, its] * by[..., None], p.slope.mid[:, its] * by
        return cls(R.value.mid[its], p.value.mid[its], turns, shifts, first, second, allowed)

    def best(self, one: _Sampled, other: _Sampled) -> tuple[Array, Array]:
        """(M,) what is spare, at most, and (M, 3) where: at a sample of either solid, or beside the best of these."""
        back = (other.points - self.shift[:, None]) @ self.turn  # into the first one's frame
        x, m = np.concatenate([np.tile(one.points, (len(back), 1, 1)), back], axis=1), np.arange(len(back))
        for step in (*OVERLAP_STEPS, None):
            spare = self._spare(x)
            k = spare.argmax(axis=1)
            value, at = spare[m, k], x[m, k]
            if step is not None:
                x = at[:, None] + step * min(one.radius, other.radius) * NEIGHBOUR_OFFSETS
        return value, at

    def _spare(self, x: Array) -> Array:
        """(M, S) by how much points (M, S, 3) of the first solid show more overlap than is allowed; -inf outside."""
        z = x @ self.turn.swapaxes(1, 2) + self.shift[:, None]
        own, deep = (s.depth(y.reshape(-1, 3)).reshape(y.shape[:2]) for s, y in ((self.first, x), (self.second, z)))
        moved = np.linalg.norm(x @ self.turns.swapaxes(2, 3) + self.shifts[:, :, None], axis=3).sum(axis=0)
        possible = (own >= 0) & (deep >= 0) & (own + deep > self.allowed)
        return np.where(possible, np.minimum(deep, own + deep - self.allowed) - moved, -np.inf)


# --- one set of contacts ----------------------------------------------------------------------------


class ContactSetSearch:
    """The boxes of the configurations of some contacts of a task.

    Raises:
        Refused: as of `ContactBoxes`.
    """

    def __init__(
        self,
        chosen: Sequence[int],
        task: TaskData,
        collisions: Collisions,
        solids: SolidsData,
        balance: NoBalance,
        motors: Motors,
    ) -> None:
        self.chosen, self.task, self.balance = tuple(chosen), task, balance
        self.contacts = ContactBoxes.of(task.part(chosen))
        self.collision = CollisionProposer(self.contacts, collisions, solids)
        self.proposers: list[Proposer] = [self.collision]
        if len(chosen) == len(task.links):
            self.proposers.insert(0, BalanceProposer(balance, self.contacts, motors))
        # of each box the side that is halved, `NO_CONTACT_ENTRY`, or the number of a proposer and its claim; None if it
        # is open
        self.entries: list[int | tuple[int, int] | None] = [None] * CHARTS
        self.roots, self.halves = list(range(CHARTS)), dict[int, tuple[int, int]]()
        self.open = [OpenBox(k, self.contacts.root, k, 1 / CHARTS) for k in range(CHARTS)]
        self.tried: dict[int, tuple[int, ...]] = {}  # of open boxes: the claim that each proposer made last
        self.boxes = 0
        self.stuck: OpenBox | None = None

    @property
    def shown(self) -> bool:
        """Is no box left?"""
        return not self.open

    @property
    def over(self) -> bool:
        """Is there nothing left to do?"""
        return self.stuck is not None or not self.open or len(self.entries) > MAX_SET_BOXES

    @property
    def discarded(self) -> float:
        """Share of the volume."""
        return 1 - sum(at.share for at in self.open) if self.open else 1.0

    @property
    def words(self) -> str:
        """What is shown so far, and the share of each reason."""
        claims = Counter(e for e in self.entries if isinstance(e, tuple))
        last, pairs, forces = len(self.proposers) - 1, Counter[tuple[int, int]](), [0, 0]
        moved = self.balance.motions.moved
        for (proposer, claim), count in claims.items():
            if proposer == last:
                link, _, body, _ = self.collision.reason.which[claim].tolist()
                pairs[link, body] += count
            else:
                forces[int(moved[claim])] += count
        counts = DiscardCounts(self.entries.count(NO_CONTACT_ENTRY), forces[0], forces[1], pairs)
        return counts.words(self.contacts.task, self.collision.solids)

    @property
    def left(self) -> OpenBox | None:
        """The box at which the set is given up, or the largest that is open; None if none is."""
        return self.stuck or max(self.open, key=lambda at: at.share, default=None)

    @property
    def missing(self) -> tuple[Missing, ...]:
        """What is missing there for each reason, the nearest first; of claims those that were tried last."""
        if (at := self.left) is None:
            return ()
        with np.errstate(all="ignore"):
            boxes, out = Boxes.of(self.contacts, at.box[None], np.array([at.chart])), list[Missing | None]()
            out.append(of_contacts(self.contacts, boxes))
            for proposer, claim in zip(self.proposers, self.tried.get(at.index, ()), strict=False):
                if claim == NO_CLAIM:
                    continue
                if isinstance(proposer, BalanceProposer):
                    out.append(of_balance(proposer.reason, boxes, claim))
                else:
                    links = [link.name for link in self.task.hand.links]
                    out.append(of_collision(self.collision.reason, boxes, claim, links))
        return tuple(sorted((m for m in out if m is not None), key=lambda m: -m.near))

    def step(self) -> None:
        """Discard or halve the boxes that came last."""
        with deferred_interrupt(), np.errstate(all="ignore"):
            taken, self.open = self.open[-DISCARD_BATCH:], self.open[:-DISCARD_BATCH]
            self.boxes += len(taken)
            none = (NO_CLAIM,) * len(self.proposers)
            tried = np.array([self.tried.pop(at.index, none) for at in taken])
            boxes = Boxes.of(self.contacts, np.array([at.box for at in taken]), np.array([at.chart for at in taken]))
            alive, kept, changes = self.contacts.narrowed(boxes.box, boxes.over, boxes.middle)
            claimed, reach = self._claimed(boxes, np.flatnonzero(alive), tried)
            nothing = np.flatnonzero(alive & ~(reach > 0).any(axis=1))
            reach[nothing] = self.collision.moves(boxes.some(nothing))
            reach = np.fmax(reach, self._by_conditions(boxes, changes))
            small = np.flatnonzero(alive & (claimed < 0) & (reach.max(axis=1) < MIN_BOX_MOTION))
            if len(small):
                first = int(small[0])
                self.stuck = replace(taken[first], box=kept[first])
                self.tried[taken[first].index] = tuple(tried[first].tolist())
            sides = reach.argmax(axis=1).tolist()
            for n, (at, k) in enumerate(zip(taken, sides, strict=True)):
                by = int(claimed[n])
                if not alive[n] or by >= 0:
                    self.entries[at.index] = (by, int(tried[n, by])) if alive[n] else NO_CONTACT_ENTRY
                    continue
                low = len(self.entries)
                self.entries[at.index], self.halves[at.index] = k, (low, low + 1)
                self.entries += [None, None]
                self.open += at.halves(kept[n], k, (low, low + 1))
                self.tried |= dict.fromkeys((low, low + 1), tuple(tried[n].tolist()))

    def _claimed(self, boxes: Boxes, left: Integers, tried: Integers) -> tuple[Integers, Array]:
        """Which proposer discards each box, or -1, with its claim in `tried` (N, proposers).

        And (N, n) what sides change in the claim that is nearest to it. First what was tried on a neighbour, then new
        claims, that of collisions before the dearer one of forces.
        """
        claimed, reach = np.full(len(tried), NO_CLAIM), np.zeros(boxes.box.shape[:2])
        nearest = np.zeros(len(tried))
        for again in (True, False):
            for number, proposer in [*enumerate(self.proposers)][::-1]:  # the cheap one first
                its = left[claimed[left] < 0]
                if not again and len(its):
                    tried[its, number] = proposer.propose(boxes.some(its), tried[its, number])
                its = its[tried[its, number] >= 0]
                if len(its):
                    found = proposer.reason.examined(boxes.some(its), tried[its, number])
                    claimed[its[found.refuted]] = number
                    nearer = found.near >= nearest[its]
                    reach[its[nearer]], nearest[its[nearer]] = found.reach[nearer], found.near[nearer]
        return claimed, reach

    def _by_conditions(self, boxes: Boxes, changes: Array) -> Array:
        """(N, n) [m] how much each side changes the conditions that may be missed."""
        rows, c = boxes.over.rows.value, self.contacts
        met = (rows.lo >= c.low) & (rows.hi <= c.high)
        moved = np.where(met[:, None], 0.0, changes * units(c)).max(axis=2, initial=0.0)
        return np.where(np.isfinite(moved), moved, np.ptp(boxes.box, axis=2))

    # --- files ---

    def to_json(self) -> dict[str, Any]:
        """The tree so far, as `NoGraspProof` reads it: a proof once no box is open."""
        used: list[dict[int, int]] = [{} for _ in self.proposers]
        order: list[int | tuple[int, int] | None] = []
        stack = self.roots[::-1]
        while stack:
            k = stack.pop()
            entry = self.entries[k]
            order.append(entry)
            stack += self.halves.get(k, ())[::-1]
            if isinstance(entry, tuple):
                used[entry[0]].setdefault(entry[1], len(used[entry[0]]))
        first = np.cumsum([0, *map(len, used)]).tolist()
        tree = [-2 - first[e[0]] - used[e[0]][e[1]] if isinstance(e, tuple) else e for e in order]
        links = [link.name for link in self.task.hand.links]
        its = self.balance.motions[list(used[0])] if len(used) > 1 else None
        motions = its.to_json(self.balance.names, self.task.hand.joints) if its else []
        hits = self.collision.reason.chosen(list(used[-1]))
        bodies = {tuple(key) for key in np.vstack([hits.which[:, :2], hits.which[:, 2:]]).tolist()}
        faces = [
            {"body": None if i < 0 else links[i], "solid": k, "faces": s.faces.tolist()}
            for (i, k), s in self.collision.sampled.items()
            if (i, k) in bodies and s.faces is not None
        ]
        said = {"contacts": list(self.chosen), "tree": tree, "motions": motions}
        return said | {"collisions": hits.to_json(links), "faces": faces}

    def restore(self, proof: NoGraspProof) -> None:
        """Go on with the tree of a file; `Refused` if it is none."""
        left, _ = proof.tree.checked(self.contacts, proof.reasons)
        upper, m = proof.tree.upper(), proof.balance.motions
        own = self.balance.add_motions(m).tolist()
        hits = proof.collision
        self.collision.reason = replace(self.collision.reason, which=hits.which, points=hits.points)
        claims = [*((0, x) for x in own), *((len(self.proposers) - 1, n) for n in range(len(hits)))]
        self.entries = [claims[-2 - x] if x is not None and x <= -2 else x for x in proof.tree.entries]
        self.roots, self.halves = proof.tree.roots(upper), {k: (k + 1, high) for k, high in upper.items()}
        self.open, self.boxes = left, len(self.entries) - len(left)


# --- all sets ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class JoinedSearched:
    """How far the search for the proof has come, of the set of contacts that was discarded most.

    Attributes:
        shown: is every box discarded? Then the task has no grasp.
        contacts: the set, by number. boxes: that were examined, of all sets. pending: those of the set that are left.
        discarded: share of the volume of the set's boxes.
        words: how many boxes each reason has discarded.
        open: the largest box that is left, or that at which the set is given up, ends by coordinate; None if none is.
        missing: what is missing there for each reason, the nearest first.
        stuck: is the set given up, as no reason discards some configuration of it?
        proof: for files, once all is shown; else None. solids: what it is about, `question.solids`.
    """

    shown: bool
    contacts: tuple[int, ...]
    boxes: int
    pending: int
    discarded: float
    words: str
    open: Mapping[str, tuple[float, float]] | None
    missing: tuple[Missing, ...]
    stuck: bool
    proof: Mapping[str, Any] | None = field(default=None, repr=False)
    solids: Mapping[str, Any] | None = field(default=None, repr=False)

    def to_json(self) -> dict[str, Any]:
        """Without the proof."""
        said = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("proof", "solids")}
        left = None if self.open is None else {name: list(ends) for name, ends in self.open.items()}
        missing = [m.to_json() for m in self.missing]
        return said | {"contacts": list(self.contacts), "open": left, "missing": missing}


class JoinedSearch:
    """The search; `run` goes on where it was left.

    Args:
        collisions: of hand and object. allowed: how deep they may be in each other.
        balance: the search for a proof that no forces balance the loads: its question, its motions.
        motors: what drives and holds the hand's joints, within their limits.
        saved: what `to_json` made, to go on from.

    Raises:
        InputError: `saved` is not of such a task.
    """

    def __init__(
        self,
        task: Task,
        collisions: Collisions,
        allowed: Allowed,
        balance: NoBalance,
        motors: Motors,
        *,
        saved: Any = None,
    ) -> None:
        data = read_task(task_to_dict(task))
        links = [link.name for link in data.hand.links]
        self.said = solids_to_dict(collisions, allowed)
        solids, K = SolidsData.read(Fields(self.said), links), len(data.links)
        sizes = sorted({1, 2, K} & {*range(1, K + 1)})
        chosen = [some for size in sizes for some in combinations(range(K), size)]
        self.sets: list[ContactSetSearch] = []
        try:
            self.sets = [ContactSetSearch(some, data, collisions, solids, balance, motors) for some in chosen]
            for k, part in enumerate(saved or []):
                f = Fields(part, f"[{k}]")
                proof = NoGraspProof.read(f, data, solids, balance.placements, balance.names, motors)
                self.sets[chosen.index(proof.chosen)].restore(proof)
        except BadFile as bad:
            raise InputError(bad.problem, field=bad.field or None) from None
        except Refused as why:
            if saved:
                raise InputError(str(why), field="tree") from None

    @property
    def shown(self) -> bool:
        """Has a set no box left?"""
        return any(part.shown for part in self.sets)

    @property
    def over(self) -> bool:
        """Is there nothing left to do?"""
        return self.shown or all(part.over for part in self.sets)

    @property
    def searched(self) -> JoinedSearched | None:
        """How far it has come; None if nothing was examined."""
        if not any(part.boxes for part in self.sets):
            return None
        best = max(self.sets, key=lambda part: (part.shown, not part.over, part.discarded))
        left = best.left
        labels = sorted(best.contacts.sides.column, key=best.contacts.sides.column.__getitem__)
        where = None if left is None else dict(zip(labels, zip(*left.box.T.tolist(), strict=True), strict=True))
        proof, solids = (best.to_json(), self.said) if best.shown else (None, None)
        boxes = sum(part.boxes for part in self.sets)
        said = best.shown, best.chosen, boxes, len(best.open), best.discarded, best.words, where, best.missing
        return JoinedSearched(*said, best.stuck is not None, proof, solids)

    def run(self, boxes: int, end: float = np.inf) -> None:
        """Examine so many more boxes, the sets in turns, or until the monotonic clock shows `end`."""
        most = boxes + sum(part.boxes for part in self.sets)
        while not self.over and sum(part.boxes for part in self.sets) < most and time.monotonic() < end:
            going_on = [part for part in self.sets if not part.over]
            min(going_on, key=lambda part: part.boxes * (1 + MIN_TURN_SHARE - part.discarded)).step()

    def to_json(self) -> list[dict[str, Any]]:
        """The trees of the sets that are searched on."""
        return [part.to_json() for part in self.sets if part.boxes and not part.over]
