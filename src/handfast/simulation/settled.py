"""Where a grasp ended up: the path, the last grasp, what is proved of it, and how a file of it is verified."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.files import refuse_existing, write_text
from handfast.core.presented import Presented
from handfast.core.transforms import matrix_quaternion
from handfast.geometry.scene import Scene
from handfast.model.configuration import Configuration
from handfast.model.grasp import Grasp
from handfast.proofs.answers import VERDICTS
from handfast.proofs.fields import BadFile, Fields, numbers
from handfast.proofs.files import SETTLED_SCHEMA
from handfast.proofs.replay import Replay
from handfast.readers.grasp_file import save_grasp, to_dict
from handfast.stability.answers import CheckAnswer, MaxAnswer
from handfast.stability.answers.answer import finite
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.grasp_limits import AskedWith
from handfast.stability.problem.settings import INF, Loading
from handfast.stability.studies.ask_again import Asking, BoundsClaim, Claim, VerdictClaim, asked, together
from handfast.stability.studies.verify_maps import grasp_of


class Rest(StrEnum):
    """What became of a grasp under its load."""

    HOLDS = "holds"  # it does not slip in the first place: `check` certifies it
    SETTLES = "settles"  # it moved, came to rest, and `check` certifies the grasp that it is then
    RESTS = "rests"  # it moved and came to rest, and `check` does not certify what it is then
    LEAVES = "leaves"  # it moved farther than it was to be followed, or nothing touches any more
    UNDECIDED = "undecided"  # it still moved when the steps were spent


@dataclass(frozen=True, eq=False)
class PathPoint:
    """One step of the motion.

    Attributes:
        share: of the load that acts.
        moved: [m] of the first contacts' points on the object, the farthest of them.
        pose: (4, 4) of the object in the hand's base frame.
        q: (l,) joints of the hand [rad, m].
        links: of the contacts that carry, by name;
        positions: (n, 3) [m], object frame; forces: (n,) [N] normal.
    """

    share: float
    moved: float
    pose: Array
    q: Array
    links: tuple[str, ...]
    positions: Array
    forces: Array

    def to_json(self) -> dict[str, Any]:
        contacts = zip(self.links, self.positions.tolist(), self.forces.tolist(), strict=True)
        return {
            "share": self.share,
            "moved": self.moved,
            "position": self.pose[:3, 3].tolist(),
            "quaternion": matrix_quaternion(self.pose[:3, :3]).tolist(),
            "joints": self.q.tolist(),
            "contacts": [{"link": l, "position": p, "force": f} for l, p, f in contacts],
        }


@dataclass(frozen=True, eq=False)
class Settled(Presented):
    """What became of a grasp under a load.

    Attributes:
        rest: holds, settles, rests, leaves or undecided.
        first: the grasp as it was asked about. before: what `check` says of it under the load; None where no forces
            whatever at its contacts balance the load.
        wrench: (6,) the load, in the object's frame as it stood [N, N m].
        path: the start and each step; empty if it was not followed. joints: names of q.
        onset: share of the load, or of the commands, at which it first moved on; None if it never did.
        onset_of: "commands" or "load".
        last: the grasp at rest, its contacts found anew; None if it is not at rest or touches nothing.
        after: what `check` says of it, as `before`. last_wrench: (6,) the load in the object's frame as it stands then.
        most: how much of that load `last` resists; None if it was not asked.
        placed: its configuration, where it was followed.
        simulated: how `simulate` ends with `last`; "" if it was not asked.
        scene: hand and object.
        seconds: wall time.
        notes: what there is to know beside it, a sentence each.
        loading: as of `check`; with "preload-first" the second point of `path` is where the load's path ends.
    """

    rest: Rest
    first: Grasp
    before: CheckAnswer | None
    wrench: Array
    path: tuple[PathPoint, ...] = field(repr=False)
    joints: tuple[str, ...] = field(repr=False)
    onset: float | None
    onset_of: str
    last: Grasp | None
    after: CheckAnswer | None
    last_wrench: Array | None
    most: MaxAnswer | None
    placed: Configuration | None = field(repr=False)
    simulated: str
    scene: Scene = field(repr=False)
    seconds: float
    notes: tuple[str, ...] = ()
    loading: Loading = "together"

    @property
    def moved(self) -> float:
        """[m] how far the first contacts' points on the object are from where they were, the farthest of them."""
        return self.path[-1].moved if self.path else 0.0

    @property
    def turned(self) -> float:
        """[rad] by how much the object has turned."""
        if not self.path:
            return 0.0
        R = self.path[-1].pose[:3, :3] @ self.path[0].pose[:3, :3].T
        return float(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1)))

    @property
    def gone_on_at(self) -> float | None:
        """The share of the load at which it went on from the load's path; None where it was followed from rest."""
        begun = self.before is not None and isinstance(self.before.path, LoadPath) and self.before.path.held
        return self.path[1].share if self.path and begun else None

    @property
    def confirmed(self) -> bool:
        """Does `check` certify the grasp at rest?"""
        return self.after is not None and self.after.verdict is Verdict.HOLDS

    def to_json(self) -> dict[str, Any]:
        """One JSON object; `first` and `last` are grasp files."""
        most = None if self.most is None else [self.most.lower, finite(self.most.upper)]
        return {
            "schema": "handfast/settled/1",
            **({"loading": self.loading} if self.loading != "together" else {}),
            "rest": str(self.rest),
            "grasp": self.first.name,
            "wrench": self.wrench.tolist(),
            "before": str(verdict_of(self.before)),
            "onset": self.onset,
            "onset_of": self.onset_of,
            "moved": self.moved,
            "turned": self.turned,
            "confirmed": self.confirmed,
            "after": None if self.last is None else str(verdict_of(self.after)),
            "last_wrench": None if self.last_wrench is None else self.last_wrench.tolist(),
            "most": most,
            "simulated": self.simulated or None,
            "notes": list(self.notes),
            "seconds": round(self.seconds, 6),
            "joints": list(self.joints),
            "path": [p.to_json() for p in self.path],
            "first": to_dict(self.first),
            "last": None if self.last is None else to_dict(self.last),
        }

    def save(self, folder: str | Path, *, force: bool = False) -> list[Path]:
        """Write what there is into a folder, which is made: the path and all else as `settled.json`, the grasps as
        `first.grasp.json` and `last.grasp.json`, where the last one stands as `last.configuration.json`.

        Returns:
            The files.

        Raises:
            InputError: one of them exists and `force` is not set, or cannot be written; then none is.
        """
        from handfast.readers.configuration_file import save_configuration

        there = Path(folder)
        names = ["settled.json", "first.grasp.json"]
        names += ["last.configuration.json", "last.grasp.json"] if self.moved_on else []
        files = [there / name for name in names]
        for file in files:
            refuse_existing(file, force=force)
        write_text(files[0], json.dumps(self.to_json(), indent=1, allow_nan=False) + "\n", force=force)
        save_grasp(self.first, files[1], force=force)
        if self.moved_on and self.last is not None and self.placed is not None:
            save_configuration(self.placed, files[2], force=force)
            save_grasp(self.last.from_configuration(files[2]), files[3], force=force)
        return files

    @property
    def moved_on(self) -> bool:
        """Is there a grasp at rest that was followed to where it is?"""
        return self.last is not None and self.placed is not None


def verdict_of(answer: CheckAnswer | None) -> Verdict:
    """SLIPS where no forces whatever balance the load."""
    return Verdict.SLIPS if answer is None else answer.verdict


COURSE_NOT_REPLAYED = "path, moved, turned, onset: a computation in steps; nor that the last grasp is where they end"
SIMULATED = "simulated, notes, seconds: recorded, and nothing rests on it"
COURSE_FIELDS = "onset", "onset_of", "moved", "turned", "simulated", "notes", "seconds", "joints", "path", "grasp"


def replay_settled(data: Any, how: Asking) -> Replay:
    """What `check` and `maximum` said of the grasps, asked again. Raises `BadFile` and `InputError`."""
    f = Fields(data)
    f.text("schema", among=[SETTLED_SCHEMA])
    rest = Rest(f.text("rest", among=[str(r) for r in Rest]))
    first, wrench = grasp_of(f, "first"), f.numbers("wrench", (6,))
    before, confirmed = f.text("before", among=VERDICTS), f.flag("confirmed")
    has_last = f.has("last")
    for name in ("after", "last_wrench"):
        if f.has(name) != has_last:
            raise BadFile("is there with `last`, and only then", name)
    last = grasp_of(f, "last") if has_last else None
    after = f.text("after", among=VERDICTS) if has_last else None
    last_wrench = f.numbers("last_wrench", (6,)) if has_last else np.zeros(6)
    most = f.take("most", None)
    loading: Loading = "together"
    if f.has("loading"):
        loading = f.text("loading", among=["preload-first"])  # type: ignore[assignment]
    for name in (*COURSE_FIELDS, "last", "after", "last_wrench"):
        f.take(name, None)
    f.done()

    terms = AskedWith(loading=loading)
    claims: dict[str, list[Claim]] = {"first": [], "last": []}
    if before != Verdict.UNDECIDED:
        claims["first"].append(VerdictClaim("before", first, wrench, terms, before))
    if last is not None and after is not None:
        if after != Verdict.UNDECIDED:
            claims["last"].append(VerdictClaim("after", last, last_wrench, terms, after))
        if most is not None:
            claims["last"].append(_most(most, BoundsClaim("most[0]", last, last_wrench, terms, 0.0, INF)))
    faults = _contradictions(rest, before, after, confirmed)
    if most is not None and last is None:
        raise BadFile("is there with `last`, and only then", "most")
    done = asked([c for of in claims.values() for c in of], how)
    parts, begin = [], 0
    for name, of in claims.items():
        told = [part for parts_of in done[begin : begin + len(of)] for part in parts_of]
        begin += len(of)
        if of:
            parts.append(together(name, f"what is said of the {name} grasp under its load", told))
    return Replay("settle", parts=(*faults, *parts), not_replayed=(COURSE_NOT_REPLAYED, SIMULATED))


def _most(most: Any, claim: BoundsClaim) -> BoundsClaim:
    """How much of the load the last grasp resists: two numbers, the second null for none."""
    if not isinstance(most, list) or len(most) != 2:
        raise BadFile("is no pair of bounds", "most")
    lower = float(numbers([most[0]], (1,), "most[0]")[0])
    upper = INF if most[1] is None else float(numbers([most[1]], (1,), "most[1]")[0])
    return BoundsClaim(claim.place, claim.grasp, claim.load, claim.terms, lower, upper, False, "most[1]")


def _contradictions(rest: Rest, before: str, after: str | None, confirmed: bool) -> list[Replay]:
    """What of the answer contradicts itself."""
    out = []
    claim = "it is what the verdicts say"
    due = {Rest.HOLDS: before == Verdict.HOLDS, Rest.SETTLES: after == Verdict.HOLDS}
    due |= {Rest.RESTS: after != Verdict.HOLDS, Rest.LEAVES: after is None, Rest.UNDECIDED: after is None}
    if not due[rest]:
        out.append(Replay("rest", claim, f"is '{rest}'; before is '{before}', after is '{after}'"))
    if confirmed != (after == Verdict.HOLDS):
        out.append(Replay("confirmed", claim, f"is {str(confirmed).lower()}; after is '{after}'"))
    return out
