"""A preload for a grasp of many contacts: looked for with a part of them, then every load asked of all.

A pad on a mesh touches at every corner of every facet, and a query takes many times longer with twelve contacts than
with six. Passive stability is not monotone in the contacts: what holds with some of them may slip with all, since each
contact that is compressed pushes. So what is found with a part counts for nothing until every load was asked again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from handfast.core.answer import Stop, Verdict, uninterrupted
from handfast.core.arrays import Array
from handfast.core.transforms import normal_frame
from handfast.geometry.contact_patch import few, reduced_contacts
from handfast.model.body import Body
from handfast.model.grasp import Contact, Grasp
from handfast.planning.question import PlanLimits
from handfast.stability.answers import CheckAnswer
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.hold import MODERATE_COMMAND, HoldAnswer
from handfast.stability.studies.questions import check, hold

QUERY_NODES = 150_000  # of a query of one contact, over the square of the contacts
BOUNDING = 250_000  # of one for the least commands, whose proofs cost most, over the cube of the contacts
CHECKED = 9_000  # of a query under a preload that is known, at least
PRELOAD_TIMEOUT = 30.0  # [s] for all queries about a preload: a fuse, the nodes end them much earlier
MIN_PRELOAD_TIME = 0.1  # [s] of them, where the time for the whole plan is up
PART_CONTACTS = 6  # contacts: with more than these, a part is asked first
PART_TOLERANCE = 0.1  # of the wrenches that the part may miss, see `reduced_contacts`
PRELOAD_LEVELS = (1.0, 1.25)  # of the preload that holds with the part


@dataclass(frozen=True)
class SearchedContacts:
    """With which contacts a preload was looked for; its own schema in `plan.json`.

    Attributes:
        touching: contacts of hand and object; those of the grasp are the corners of their faces, see `spanning`.
        searched: how many of the grasp's the preload was looked for with.
        error: of the wrenches of the others, see `reduced_contacts`; 0 if there are none.
    """

    touching: Annotated[int, Field(ge=1)]
    searched: Annotated[int, Field(ge=1)]
    error: Annotated[float, Field(ge=0)]


@dataclass(frozen=True, eq=False)
class PreloadSearch:
    """Looks for one preload under which a grasp of a body holds its loads.

    Attributes:
        body: the object. loads: what is to be held. limits: within which; no `command_limit` is `MODERATE_COMMAND`
            times the largest load, no `settings` a number of nodes, so that the outcome does not hang on the machine.
        until: on the monotonic clock, when it has to end.
    """

    body: Body
    loads: Loads
    limits: PlanLimits
    until: float = np.inf

    def run(
        self, grasp: Grasp, touching: int, rebuilt: Callable[[Sequence[Contact]], Grasp], actuators: tuple[str, ...]
    ) -> tuple[HoldAnswer, SearchedContacts]:
        """Whether all contacts of a grasp hold the loads under one preload, and how that was looked for.

        They are asked themselves in the end where a part came to nothing, or to commands that are too large.

        Args:
            touching: how many contacts there were before any was left out.
            rebuilt: the same grasp with other contacts of the same links.
            actuators: that may be commanded.
        """
        tolerance = PART_TOLERANCE if grasp.m > PART_CONTACTS else 0.0
        part = reduced_contacts(grasp.contacts, self.body, tolerance)
        told = SearchedContacts(touching, len(part.contacts), part.error)
        if told.searched == grasp.m:
            return self.found(grasp, actuators), told
        answer = self.found(rebuilt(part.contacts), actuators)
        if answer.verdict is Verdict.HOLDS:
            answer = self.of_all(grasp, answer)
            if answer.verdict is Verdict.HOLDS and self.strength(grasp.with_preload(answer.preload)) <= 1:
                return answer, told
        return self.found(grasp, actuators), replace(told, searched=grasp.m, error=0.0)  # the part has shown nothing

    def found(self, grasp: Grasp, actuators: tuple[str, ...]) -> HoldAnswer:
        """What `hold` says of a grasp."""
        bounding = self.limits.settings or bounding_settings_for(grasp)
        left = min(PRELOAD_TIMEOUT, max(self.until - time.monotonic(), MIN_PRELOAD_TIME))
        how = {"actuators": actuators, "least": False, "timeout": left, "bounding": bounding}
        return held(grasp, self.loads, self.limits, settings_for(grasp), **how)

    def of_all(self, grasp: Grasp, part: HoldAnswer) -> HoldAnswer:
        """The answer for a grasp of whose contacts a part holds the loads: UNDECIDED if all of them do not."""
        for level in PRELOAD_LEVELS if part.upper > 0 else PRELOAD_LEVELS[:1]:
            answer = self.under(grasp, part, level)
            if answer:
                return answer
        return replace(part, verdict=Verdict.UNDECIDED, preload=None, upper=np.inf, checks=(), grasp=grasp)

    def under(self, grasp: Grasp, known: HoldAnswer, level: float) -> HoldAnswer | None:
        """The answer for a grasp under a multiple of a preload that is known; None if it does not hold every load, or
        takes larger commands than allowed.
        """
        preload = {name: level * value for name, value in (known.preload or {}).items()}
        loaded = grasp.with_preload(preload)
        if self.strength(loaded) > 1:
            return None
        asked = preload, 0.0, level * known.upper
        again = held_again(loaded, self.loads, self.limits, checking_settings_for(grasp), asked, known.nodes)
        nodes = known.nodes + sum(a.nodes for a in again.checks) if again else 0
        return again and replace(again, nodes=nodes, actuators=known.actuators)

    def strength(self, grasp: Grasp) -> float:
        """The largest command, as a share of what is allowed: a force for sliding joints and tendons, else a torque."""
        if self.limits.command_limit is not None:
            return float(np.abs(grasp.command).max(initial=0.0)) / self.limits.command_limit
        mechanism, w = grasp.mechanism, self.loads.wrenches
        load = float((np.linalg.norm(w[:, :3], axis=1) + np.linalg.norm(w[:, 3:], axis=1) / grasp.size).max())
        turns = np.array([joint.type == "revolute" for joint in grasp.joints])
        torque = (mechanism.R[:, turns] != 0).any(axis=1) & ~np.array(mechanism.tendon, dtype=bool)
        return float(np.max(np.abs(grasp.command) / np.where(torque, grasp.size, 1.0), initial=0.0)) / (
            MODERATE_COMMAND * load
        )


# --- asked within limits -----------------------------------------------------------------------------


def settings_for(grasp: Grasp) -> Settings:
    """Of a query about a grasp, where none were stated."""
    return Settings(nodes=QUERY_NODES / grasp.m**2)


def bounding_settings_for(grasp: Grasp) -> Settings:
    """Of a query for the least commands of a grasp, where none were stated."""
    return Settings(nodes=BOUNDING / grasp.m**3, verify=False)


def checking_settings_for(grasp: Grasp) -> Settings:
    """Of a query under a preload that is known, where none were stated."""
    return Settings(nodes=max(CHECKED, QUERY_NODES / grasp.m**2), verify=False)


def held(grasp: Grasp, loads: Loads, limits: PlanLimits, settings: Settings, **how: Any) -> HoldAnswer:
    """One preload for all loads; `settings` where the limits state none, `how` as in `hold`. Ctrl-C is raised."""
    how |= {"settings": limits.settings or settings, "limits": limits.of_grasp(grasp), "loading": limits.loading}
    return uninterrupted(hold(grasp, loads, **how))


def held_again(
    grasp: Grasp,
    loads: Loads,
    limits: PlanLimits,
    settings: Settings,
    known: tuple[dict[str, float], float, float],
    nodes: int,
) -> HoldAnswer | None:
    """What was found before, every load asked again under the preload of a grasp; None if one is not held.

    Args:
        known: preload, lower and upper bound of its largest command.
        nodes: of the search that found it.
    """
    how: dict[str, Any] = {"limits": limits.of_grasp(grasp), "settings": limits.settings or settings}
    how |= {"loading": limits.loading}
    checks: list[CheckAnswer] = []
    for wrench in loads.wrenches:
        checks.append(uninterrupted(check(grasp, wrench, **how)))
        if checks[-1].verdict is not Verdict.HOLDS:
            return None
    asked: dict[str, Any] = {"grasp": grasp, "limits": limits.of_grasp(grasp), "actuators": tuple(known[0])}
    asked |= {"loading": limits.loading}
    return HoldAnswer(Verdict.HOLDS, Stop.COMPLETE, 0.0, nodes, loads, *known, tuple(checks), **asked)


# --- contacts of a flat face -------------------------------------------------------------------------

NORMAL_ANGLE = 1e-3  # [rad] normals that differ by less are one
PLANE_TOLERANCE = 2e-5  # [m] points that are less out of a plane, or out of a line, are in it


def spanning(contacts: Sequence[Contact]) -> tuple[Contact, ...]:
    """Without those that lie between others of the same link, plane, normal and friction.

    A force at a point between others is a sum of parallel forces at these, each within its friction cone, with the same
    torque. Contacts of a pad that is made of many small solids, a dozen in a plane, would cost a search thousands of
    times more, and answer the same. Of more than four corners the four stay that are spread most, as of a single pair
    of solids: the others could do whatever these do, so that statics are judged too strictly, if anything.
    """
    left, kept = list(range(len(contacts))), set[int]()
    while left:
        lead = contacts[left[0]]
        face = [i for i in left if _one_face(contacts[i], lead)]
        left = [i for i in left if i not in face]
        flat = np.array([contacts[i].position for i in face]) @ normal_frame(lead.normal)[:, 1:]
        kept |= {face[k] for k in _corners(flat)}
    return tuple(contacts[i] for i in sorted(kept))


def _one_face(a: Contact, b: Contact) -> bool:
    """Whether two contacts press one plane of the object with one link."""
    apart = abs(float((a.position - b.position) @ b.normal))
    same = a.link == b.link and a.friction == b.friction
    return bool(same and a.normal @ b.normal >= np.cos(NORMAL_ANGLE) and apart <= PLANE_TOLERANCE)


def _corners(points: Array) -> list[int]:
    """Which of some points (n, 2) [m] span them: corners of their hull, four at most, ends of a line, or one alone."""
    from scipy.spatial import ConvexHull

    if len(points) < 3:
        return list(range(len(points)))
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]
    along, across = (points @ axes.T).T
    if np.ptp(across) <= PLANE_TOLERANCE:
        return sorted({int(along.argmin()), int(along.argmax())})
    hull = ConvexHull(points).vertices
    kept = few(points[hull])
    return sorted(int(k) for k in hull if (points[k] == kept).all(axis=1).any())
