"""Shows that a task has no grasp: every box of configurations of some of its contacts is discarded, each for a reason.

A tree halves boxes (`posed_boxes`) until each is empty, as its contacts cannot be made there, or meets another reason:

- *collision*: a point of a link is inside a solid of its own and inside one of the object, or of another link, at every
  configuration of the box. Balls about it are inside both, of radii a and b; to part two convex solids that share such
  a point they have to move by a + b at least, and that is more than is let pass.
- *balance*: no contact forces balance the loads, wherever in the box's parameters the contacts are (`unbalanced`).
- *slips*: the same with the torques that such forces take at the joints, whatever motors within their limits are
  commanded: the twist of the object comes with motions of the joints.

A reason has a name, reads its own claims from a file and says which boxes they discard. The tree only knows their
numbers. What conditions leave of a box (`ContactBoxes.narrowed`) is worked out again by the checker, and halved.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from handfast.proofs.chains import joint_rates
from handfast.proofs.convex_solids import SolidData, SolidsData
from handfast.proofs.fields import Array, BadFile, Fields, Integers, Mask, refuse_unknown
from handfast.proofs.intervals import Dual, Interval
from handfast.proofs.motors import Motors
from handfast.proofs.posed_boxes import CHARTS, OBJECT_LINK, ContactBoxes, Posed, mean_value
from handfast.proofs.replay import Figure, Refused, Replay, down
from handfast.proofs.tasks import TaskData
from handfast.proofs.unbalanced import (
    MAX_TREE_ENTRIES,
    BoxBounds,
    HandMotion,
    Motions,
    MovedJoint,
    Placements,
    halves,
    nearness,
)

DISCARD_BATCH = 64  # boxes that are looked at together
NO_CONTACT_ENTRY = -1  # the entry of a box in which the contacts cannot be made; -2 - r: discarded by claim r


@dataclass(frozen=True, eq=False)
class Boxes:
    """N boxes, and where all is in them and in their middles.

    Attributes:
        box: (N, n, 2). charts: (N,).
    """

    box: Array
    charts: Integers
    over: Posed
    middle: Posed

    @classmethod
    def of(cls, contacts: ContactBoxes, box: Array, charts: Integers) -> Boxes:
        over = contacts.at(Interval.between(box[..., 0], box[..., 1]), charts, box.shape[1])
        return cls(box, charts, over, contacts.at(Interval.of(box.mean(axis=2)), charts, 0))

    @property
    def away(self) -> Interval:
        """(N, n) from their middles."""
        return Interval.between(self.box[..., 0], self.box[..., 1]) - self.box.mean(axis=2)

    def some(self, its: Integers) -> Boxes:
        """Some of them."""
        return Boxes(self.box[its], self.charts[its], self.over.some(its), self.middle.some(its))


class Reason(Protocol):
    """Why boxes are discarded, with claims that are numbered from 0."""

    name: str

    def __len__(self) -> int: ...

    def chosen(self, claims: Sequence[int]) -> Reason:
        """With some of the claims alone."""

    def examined(self, boxes: Boxes, claims: Integers) -> BoxBounds:
        """Whether one claim for each box shows that no grasp is in it, and how nearly."""


@dataclass(frozen=True, eq=False)
class Collision:
    """Claims that a link and a body overlap: a point of a link's solid that stays inside a solid of the body.

    Attributes:
        solids: of the question, meshes with faces.
        which: (M, 4) link, its solid, body (another link or the `OBJECT_LINK`), its solid. points: (M, 3) [m] link
        frame.
    """

    solids: SolidsData
    which: Integers
    points: Array
    name = "collision"

    def __len__(self) -> int:
        return len(self.which)

    def chosen(self, claims: Sequence[int]) -> Collision:
        return replace(self, which=self.which[list(claims)], points=self.points[list(claims)])

    def examined(self, boxes: Boxes, claims: Integers) -> BoxBounds:
        """`missing` is the depth [m] by which the point would have to be farther inside."""
        out, away = BoxBounds.unknown(*boxes.box.shape[:2]), boxes.away
        for link, k, body, m in np.unique(self.which[claims], axis=0).tolist():
            its = np.flatnonzero((self.which[claims] == (link, k, body, m)).all(axis=1))
            points, over, middle = self.points[claims[its]], boxes.over.some(its), boxes.middle.some(its)
            own, other = inside(self.solids.of(link)[k], points), self.solids.of(body)[m]
            rows, here = (other.depths(at.seen(link, body, points)) for at in (over, middle))
            allowed = self.solids.depth_allowed(link, body)
            lower, changes = mean_value(rows, here.value, away[its])
            both = (Interval.of(lower) + own[:, None]).lo
            deep = (lower >= 0) & (both > allowed)  # NaN is not
            refuted = (own >= 0) & deep.all(axis=1) & bool(deep.shape[1])
            reach = np.where(deep[..., None], 0.0, changes).max(axis=1, initial=0.0)
            due = np.maximum(allowed - own, 0.0)[:, None]  # how deep the point itself has to be
            short = np.where(deep, 0.0, np.maximum(due - lower, 0.0)).max(axis=1, initial=0.0)
            near = np.where(deep, 1.0, nearness(lower - due, here.value.lo - due)).min(axis=1, initial=1.0)
            known = (own >= 0) & bool(deep.shape[1])
            short, near = np.where(known, short, np.nan), np.where(known, near, 0.0)
            out.put(its, BoxBounds(refuted, reach, short, near))
        return out

    def to_json(self, links: Sequence[str]) -> list[dict[str, Any]]:
        """Each claim; no body is the object."""
        return [
            {"link": links[i], "solid": k, "body": None if j < 0 else links[j], "other": m, "point": point}
            for (i, k, j, m), point in zip(self.which.tolist(), self.points.tolist(), strict=True)
        ]

    @classmethod
    def read(cls, f: Fields, solids: SolidsData, links: Sequence[str], placed: frozenset[int]) -> Collision:
        """Of a file; `BadFile` for a link that no joint of the contacts places, a solid that is not there."""
        which, points = [], []
        for part in f.objects("collisions"):
            link, body = (body_of(part, name, links) for name in ("link", "body"))
            row = [link, part.whole("solid"), body, part.whole("other")]
            if link == OBJECT_LINK or not {link, body} <= placed | {OBJECT_LINK} or not solids.may_not_meet(link, body):
                raise BadFile("may overlap, or stands where the contacts do not say", part.place)
            if not (row[1] < len(solids.of(link)) and row[3] < len(solids.of(body))):
                raise BadFile("has no such solid", part.place)
            which.append(row)
            points.append(part.numbers("point", (3,)))
            part.done()
        return cls(solids, np.array(which, dtype=np.int64).reshape(-1, 4), np.array(points).reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class Balance:
    """Claims that no contact forces balance the loads: twists of the object, with motions of the hand's joints or none.

    Attributes:
        contacts: all of the task. motors: of its hand.
    """

    placements: Placements
    motions: Motions
    contacts: ContactBoxes
    motors: Motors
    name = "balance"

    def __len__(self) -> int:
        return len(self.motions)

    @property
    def columns(self) -> Integers:
        """Of the boxes' coordinates, in the order of the placements' parameters."""
        return self.contacts.sides.object.columns.ravel()

    def chosen(self, claims: Sequence[int]) -> Balance:
        return replace(self, motions=self.motions[list(claims)])

    def examined(self, boxes: Boxes, claims: Integers) -> BoxBounds:
        out = BoxBounds.unknown(*boxes.box.shape[:2])
        moved = self.motions.joints[claims] != 0
        for these in np.unique(moved, axis=0):
            its = np.flatnonzero((moved == these).all(axis=1))
            motions = self.motions[claims[its]]
            if these.any():
                over_all = replace(self.placements, side=self.contacts.sides.object)
                hand = hand_motion(self.contacts, self.motors, boxes.some(its), motions.joints)
                found = over_all.examined(boxes.box[its], motions, hand)
                reach = np.nan_to_num(found.reach)
            else:
                found = self.placements.examined(boxes.box[its][:, self.columns], motions)
                reach = np.zeros((len(its), boxes.box.shape[1]))
                reach[:, self.columns] = np.nan_to_num(found.reach)
            out.put(its, replace(found, reach=reach))
        return out


def hand_motion(contacts: ContactBoxes, motors: Motors, boxes: Boxes, own: Array) -> HandMotion:
    """Motions of a hand in N boxes, in which the joints that no coupling drives move at own (N, l)."""
    task, drive = contacts.task, contacts.sides.drive
    hand, rates = task.hand, joint_rates(task.hand, own)
    ends = np.tile(hand.limits, (len(own), 1, 1)) * [-1.0, 1.0]
    ends[:, list(drive.joints)] = boxes.over.joints.value.ends
    carried = [{j for i in hand.path(link) for j in hand.links[i].joints} for link in task.links]
    moved = [j for j in drive.joints if rates.ends[:, j].any() and any(j in its for its in carried)]
    of = {j: tuple(k for k, its in enumerate(carried) if j in its) for j in moved}
    over, middle = (
        tuple(MovedJoint(rates[:, j], *axes[j], bool(hand.revolute[j]), of[j]) for j in moved)
        for axes in (contacts.axes(at, moved) for at in (boxes.over, boxes.middle))
    )
    turned, slid = (Interval.of(rates.mag[:, those]).sum().hi for those in (hand.revolute, ~hand.revolute))
    return HandMotion(
        over,
        middle,
        motors.work(-rates, Interval(ends)),
        turned,
        np.where(rates.mag[:, ~hand.revolute].any(axis=1), slid, 0.0),
    )


def inside(solid: SolidData, points: Array) -> Array:
    """(N,) radii of balls about points (N, 3) of the carrier's frame that are inside a solid; negative outside."""
    lower = solid.depths(Dual.constant(Interval.of(points), 0)).value.lo
    if not lower.shape[1]:
        return np.full(len(points), -np.inf)
    return np.where(np.isnan(lower).any(axis=1), -np.inf, lower.min(axis=1))


def body_of(f: Fields, name: str, links: Sequence[str]) -> int:
    """A link by its name, or the `OBJECT_LINK` for null."""
    if not f.has(name):
        return OBJECT_LINK
    said = f.text(name)
    refuse_unknown(said, links, "link", f.at(name))
    return list(links).index(said)


# --- trees ------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class BoxTree:
    """Boxes in order, the lower half first, one tree for each chart after the other.

    Attributes:
        entries: of each box the coordinate in whose middle it is halved, `NO_CONTACT_ENTRY`, -2 - r, or None: it is
        open.
    """

    entries: tuple[int | None, ...]

    @classmethod
    def read(cls, f: Fields, n: int, claims: int) -> BoxTree:
        entries = f.take("tree")
        if not isinstance(entries, list) or not CHARTS <= len(entries) <= MAX_TREE_ENTRIES:
            raise BadFile(f"is no list of {CHARTS} to {MAX_TREE_ENTRIES} entries", f.at("tree"))
        for k, x in enumerate(entries):
            if x is not None and (type(x) is not int or not -2 - claims < x < n):
                raise BadFile(f"is {x!r}; a coordinate below {n}, a claim or null is needed", f"{f.at('tree')}[{k}]")
        return cls(tuple(entries))

    def upper(self) -> dict[int, int]:
        """Where the upper half of each box that is halved stands; the lower one comes next to the box.

        Raises:
            Refused: the tree leaves out a box, or goes on after its last one.
        """
        out: dict[int, int] = {}
        waiting: list[int | None] = [None] * CHARTS  # boxes whose upper half comes next; None: a chart
        for k, x in enumerate(self.entries):
            if not waiting:
                raise Refused(f"the tree goes on after its last box, at entry {k}")
            parent = waiting.pop()
            if parent is not None and parent >= 0:
                out[parent] = k
            if x is not None and x >= 0:
                waiting += [k, -1]
        if waiting:
            raise Refused(f"the tree leaves out {len(waiting)} boxes")
        return out

    def roots(self, upper: Mapping[int, int]) -> list[int]:
        """The first box of each chart."""
        out = [0]
        while len(out) < CHARTS:
            last = out[-1]
            while last in upper:
                last = upper[last]
            out.append(last + 1)
        return out

    def checked(self, contacts: ContactBoxes, reasons: Sequence[Reason]) -> tuple[list[OpenBox], Counter[int]]:
        """The boxes that are open; and how many are discarded by each entry.

        Raises:
            Refused: the tree does not cover the space, or a box is not discarded as it says.
        """
        upper = self.upper()
        stack = [OpenBox(k, contacts.root, chart, 1 / CHARTS) for chart, k in enumerate(self.roots(upper))]
        left: list[OpenBox] = []
        done: Counter[int] = Counter()
        with np.errstate(all="ignore"):  # numbers that overflow end as NaN, which discards nothing
            while stack:
                part, stack = stack[-DISCARD_BATCH:], stack[:-DISCARD_BATCH]
                left += [at for at in part if self.entries[at.index] is None]
                part = [at for at in part if self.entries[at.index] is not None]
                if not part:
                    continue
                entries = np.array([self.entries[at.index] for at in part])
                boxes = Boxes.of(contacts, np.array([at.box for at in part]), np.array([at.chart for at in part]))
                alive, kept, _ = contacts.narrowed(boxes.box, boxes.over, boxes.middle)
                its = np.flatnonzero(alive & (entries <= -2))
                shown = ~alive
                shown[its] = discarded(boxes.some(its), -2 - entries[its], reasons)
                entries[~alive] = NO_CONTACT_ENTRY  # whatever else is said of them
                for at, x, ok, box in zip(part, entries.tolist(), shown.tolist(), kept, strict=True):
                    if ok:
                        done[x] += 1
                    elif x < 0:
                        raise Refused(f"box {at.index} of the tree is not discarded as it says")
                    else:
                        stack += at.halves(box, x, (at.index + 1, upper[at.index]))
        return left, done


@dataclass(frozen=True, eq=False)
class OpenBox:
    """A box of a tree: its place there, (n, 2), its chart, and its share of the whole volume."""

    index: int
    box: Array
    chart: int
    share: float

    def halves(self, kept: Array, k: int, indices: tuple[int, int]) -> tuple[OpenBox, OpenBox]:
        """What is kept (n, 2) of it, halved along side k, the upper half first; indices: of the lower and the upper."""
        width = np.ptp(self.box, axis=1)
        left = np.divide(np.ptp(kept, axis=1), width, out=np.ones(len(width)), where=width > 0)
        low, high = halves(kept, k)
        both = zip(reversed(indices), (high, low), strict=True)
        first, second = (OpenBox(n, half, self.chart, self.share * float(left.prod()) / 2) for n, half in both)
        return first, second


def discarded(boxes: Boxes, claims: Integers, reasons: Sequence[Reason]) -> Mask:
    """(N,) whether one claim for each box discards it; claims are numbered through all reasons."""
    out, first = np.zeros(len(claims), dtype=bool), 0
    for reason in reasons:
        its = np.flatnonzero((claims >= first) & (claims < first + len(reason)))
        if len(its):
            out[its] = reason.examined(boxes.some(its), claims[its] - first).refuted
        first += len(reason)
    return out


# --- proofs in files --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NoGraspProof:
    """A tree with its claims, as a file has them.

    Attributes:
        chosen: the contacts of the task whose configurations are looked at.
    """

    chosen: tuple[int, ...]
    contacts: ContactBoxes
    balance: Balance
    collision: Collision
    tree: BoxTree

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """In the order in which their claims are numbered."""
        return self.balance, self.collision

    @classmethod
    def read(
        cls,
        f: Fields,
        task: TaskData,
        solids: SolidsData,
        placements: Placements,
        names: Sequence[str],
        motors: Motors,
    ) -> NoGraspProof:
        """`BadFile` for what cannot be one of such a task; `Refused` as of `ContactBoxes` and faces of meshes."""
        K, links = len(task.links), [link.name for link in task.hand.links]
        said = f.numbers("contacts", (-1,)).tolist()
        if not said or sorted(set(said)) != said or not set(said) <= {*range(K)}:
            raise BadFile(f"is {said}; contacts from 0 to {K - 1} in order are needed", f.at("contacts"))
        chosen = tuple(int(k) for k in said)
        contacts = ContactBoxes.of(task.part(chosen))
        hand = contacts.task.hand
        free = [name if not hand.driving(j) and j in contacts.task.moving else "" for j, name in enumerate(hand.joints)]
        motions = Motions.read(f, names, K, free)
        if len(motions) and len(chosen) < K:
            raise BadFile("are there, but not all contacts", f.at("motions"))
        faced = _faced(f, solids, links)
        balance = Balance(placements, motions, contacts, motors)
        collision = Collision.read(f, faced, links, contacts.placed)
        tree = BoxTree.read(f, len(contacts.root), len(balance) + len(collision))
        f.done()
        return cls(chosen, contacts, balance, collision, tree)


def _faced(f: Fields, solids: SolidsData, links: Sequence[str]) -> SolidsData:
    """The solids, meshes with the faces that a file gives them."""
    bodies = {i: list(s) for i, s in solids.of_link.items()} | {OBJECT_LINK: list(solids.of_object)}
    for part in f.objects("faces"):
        body, k = body_of(part, "body", links), part.whole("solid")
        if not k < len(bodies.get(body, ())):
            raise BadFile("has no such solid", part.place)
        faces = part.numbers("faces", (-1, 3))
        if (faces != np.floor(faces)).any():
            raise BadFile("are no indices", part.at("faces"))
        bodies[body][k] = bodies[body][k].with_faces(faces.astype(np.int64))
        part.done()
    thing = tuple(bodies.pop(OBJECT_LINK))
    return SolidsData({i: tuple(s) for i, s in bodies.items()}, thing, solids.allowed)


def replay_no_grasp(
    task: TaskData, solids: SolidsData, placements: Placements, names: Sequence[str], motors: Motors, f: Fields
) -> Replay:
    """The claim that no configuration meets a task's contacts, is free of collision, and lets forces within the limits
    of motors balance the loads.

    Raises:
        BadFile: what is wrong with the file.
    """
    claim = "every configuration is discarded"
    try:
        proof = NoGraspProof.read(f, task, solids, placements, names, motors)
        left, done = proof.tree.checked(proof.contacts, proof.reasons)
    except Refused as why:
        return Replay("no grasp", claim, str(why))
    figures: dict[str, Figure] = {"boxes": len(proof.tree.entries)}
    if left:
        return Replay("no grasp", claim, f"{len(left)} boxes are open", figures)
    counts = DiscardCounts.of(proof, done)
    figures |= {"contacts": counts.contacts, "balance": counts.balance, "slips": counts.slips}
    figures |= {"collision": counts.collision.total()}
    return Replay("no grasp", counts.words(proof.contacts.task, proof.collision.solids), "", figures)


@dataclass(frozen=True)
class DiscardCounts:
    """How many boxes are discarded by each reason; by collision for each link and what it is in.

    Attributes:
        slips: by twists that come with motions of joints.
    """

    contacts: int
    balance: int
    slips: int
    collision: Counter[tuple[int, int]]

    @classmethod
    def of(cls, proof: NoGraspProof, done: Mapping[int, int]) -> DiscardCounts:
        """By the entries of a tree."""
        pairs: Counter[tuple[int, int]] = Counter()
        first, moved, forces = 2 + len(proof.balance), proof.balance.motions.moved, [0, 0]
        for x, count in done.items():
            if x <= -first:
                link, _, body, _ = proof.collision.which[-first - x].tolist()
                pairs[link, body] += count
            elif x <= -2:
                forces[int(moved[-2 - x])] += count
        return cls(done.get(NO_CONTACT_ENTRY, 0), forces[0], forces[1], pairs)

    def words(self, task: TaskData, solids: SolidsData) -> str:
        """What is shown of the contacts of a task, and the share of each reason."""
        whole = self.contacts + self.balance + self.slips + self.collision.total()
        links = [link.name for link in task.hand.links]
        parts = []
        for (link, body), count in self.collision.most_common():
            other = "the object" if body == OBJECT_LINK else links[body]
            deep = f"{down(1e3 * solids.depth_allowed(link, body), 3)} mm"
            parts.append((count, f"{links[link]} is more than {deep} inside {other}"))
        slips = "it slips, whatever the motors do within their limits"
        parts += [(self.balance, "no contact forces balance the loads"), (self.slips, slips)]
        parts += [(self.contacts, "they cannot touch so")]
        said = ", or ".join(f"{words} ({100 * count / whole:.3g} %)" for count, words in parts if count)
        touching = ", ".join(links[i] for i in task.links)
        return f"wherever {touching} would touch as asked, {said} of {whole} boxes"
