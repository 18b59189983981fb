"""What every answer about one disturbance has: verdict, witness, proof, cost; it saves and checks itself."""

from __future__ import annotations

import json
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, TypeVar

import numpy as np

from handfast.core.answer import Stop, Verdict, header
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.files import write_text
from handfast.core.presented import Presented
from handfast.proofs import answers, path_steps
from handfast.proofs.certificate import Certificate, proof_to_dict
from handfast.proofs.existence import MODE_TRIES, Proved, exactly, prove
from handfast.proofs.grasp import GraspData
from handfast.proofs.question import Question
from handfast.proofs.replay import Replay
from handfast.proofs.states import Problem, State
from handfast.stability.problem.bound_problem import BoundProblem
from handfast.stability.problem.grasp_data import grasp_data
from handfast.stability.problem.objective import ANY_STATE, INF
from handfast.stability.problem.scaled_problem import ScaledProblem
from handfast.stability.problem.settings import OnStep, Settings
from handfast.stability.problem.witness import Witness
from handfast.stability.search.solve import clock_of, solve

if TYPE_CHECKING:
    from handfast.stability.search.proof import Proof


class Pathed(Protocol):
    """The steps of a load's path, as far as every answer has to know them."""

    @property
    def exact(self) -> bool | None: ...
    @property
    def motion(self) -> float | None: ...
    @property
    def shown(self) -> tuple[Witness, Proved | None] | None: ...
    def said(self) -> dict[str, Any]: ...
    def to_file(self, answer: dict[str, Any]) -> dict[str, Any]: ...


Kind = TypeVar("Kind", bound="Answer")


@dataclass(frozen=True, eq=False)
class Answer(Presented, ABC):
    """What every query answers.

    Attributes:
        query: its name in JSON.
        verdict: HOLDS with a valid witness; SLIPS if every case is refuted; else UNDECIDED.
        stop: why the search ended.
        seconds, nodes: its cost: wall time, nodes of the tree.
        found: the exact solution behind `verdict` or `lower`, as it was found; see `witness`.
        proof: what the other bound rests on; None without one.
        posed: the problem and the goal of the search; of a load's path that of the last step.
        path: the states from rest to there, where the load comes after the commands; see `load_path.LoadPath`.
        verified: was everything that it says replayed, the proof by the independent checker?
    """

    query: ClassVar[str]

    verdict: Verdict
    stop: Stop
    seconds: float
    nodes: int
    found: Witness | None
    proof: Proof | None = field(repr=False)
    posed: BoundProblem | None = field(default=None, kw_only=True, repr=False)
    path: Pathed | None = field(default=None, kw_only=True, repr=False)
    verified: bool = field(default=False, kw_only=True)

    @property
    def witness(self) -> Witness | None:
        """The solution that is shown, drawn and saved: `least_motion` of the one that was found, where it is proved."""
        return self._shown[0] if self._shown else None

    @property
    def proved(self) -> Proved | None:
        """What is proved of the witness; None without one, or without a question."""
        return self._shown[1] if self._shown else None

    @cached_property
    def _shown(self) -> tuple[Witness, Proved | None] | None:
        if self.found is not None and self.path is not None:
            return self.path.shown
        if self.found is None or self._of_found is None or self.posed is None:
            return None if self.found is None else (self.found, None)
        if self.path is not None:  # its last state, as it stands in the chain
            return self.found, self._of_found
        least = self._least
        known = self._of_found if least is self.found else self._proved(least)
        as_good = known.exact or (known.tolerant and not self._of_found.exact)
        return (least, known) if as_good and self._reaches(known) else (self.found, self._of_found)

    @cached_property
    def _least(self) -> Witness:
        """The state of least motion that is found from the one of the search."""
        from handfast.stability.search.least_motion import (
            least_motion,  # needs the engine, and only what is shown needs it
        )

        assert self.found is not None
        assert self.posed is not None
        return least_motion(self.found, self.posed.problem.limits)

    @cached_property
    def _of_found(self) -> Proved | None:
        """What is proved of the state that was found."""
        return None if self.found is None or self.posed is None else self._proved(self.found)

    def _reaches(self, proved: Proved) -> bool:
        """Is what is proved of a state all that the answer says?"""
        return True

    @cached_property
    def certificate(self) -> Certificate | None:
        """The proof of SLIPS, or of the bound that no state was found for, for `verify`; None without."""
        return self.proof.certificate if self.proof else None

    @cached_property
    def question(self) -> Question | None:
        """What was asked, as proofs take it."""
        return self.posed.question if self.posed else None

    def _proved(self, w: Witness, least: float = -np.inf, tries: int = MODE_TRIES) -> Proved:
        """What is proved of a state, however long it takes, so that `verify` finds the same; see `prove`."""
        assert self.posed is not None
        p, x = self._problem(w), w.state
        return prove(p, x, least, self._within(p, x), tries)

    def _within(self, p: Problem, x: State) -> float | None:
        """[N] how near to a state x what is proved has to be; of a path as near as each of its steps."""
        return None if self.path is None else path_steps.near_enough(p, x)

    def _problem(self, w: Witness) -> Problem:
        """What a state has to solve."""
        assert self.posed is not None
        (p, goal), question, along = self.posed, self.posed.question, self._along
        command = w.grasp.command if goal.seeks_commands else p.grasp.command
        if along is None:  # of the load as it was asked, from which that of the state may be off by rounding
            return Problem.of(question, command, p.wrench)
        base = p.wrench if goal.maximised else np.zeros(6)
        magnitude = float((w.wrench - base) @ along / (along @ along))
        return Problem.of(question, command, base, along, magnitude)

    def settled(self, until: float = np.inf) -> Self:
        """UNDECIDED if its witness cannot be proved to be one, or if it slips up to motions that are too small only.

        A bound that is proved for motions inside a small cap is none that is complete: `proofs.answers.cap_fault`.
        until: [s] of `time.monotonic`, from which on none is looked for in place of a witness that is not exact.
        """
        return self._with_proof()._exactly(until)._judged(until)

    def _judged(self, until: float) -> Self:
        """What is left of it, with what is proved of what was found as it is."""
        out, cap = self, self.proof.cap if self.proof else None
        # what is shown may move far less than what was found
        if (
            cap is not None
            and self._too_small(cap, self.found)
            and (not self.found or self._too_small(cap, self.witness))
        ):
            out = replace(out, stop=Stop.NUMERICAL if self.stop is Stop.COMPLETE else self.stop)
            if self.verdict is Verdict.SLIPS:
                out = replace(out, verdict=Verdict.UNDECIDED, proof=None)
        if out.verdict is not Verdict.HOLDS or out.certain:
            return out
        stop = Stop.TIME if time.monotonic() > until else Stop.NUMERICAL
        return replace(out, verdict=Verdict.UNDECIDED, stop=stop, found=None)

    def _exactly(self, until: float) -> Self:
        """With a state that exists exactly, where one is near, or differs by motions that nothing determines."""
        known, w = self._of_found, self.found
        if known is None or w is None or known.exact or not self._may_move_less:
            return self
        x = exactly(self._problem(w), w.state)[1]
        at = replace(w, state=x)
        return replace(self, found=at) if self._proved(at).exact else self

    def _with_proof(self) -> Self:
        """Itself, with what is proved of the state that was found.

        Of the state that moves least instead, where that one is proved in its likeliest modes and the other is not.
        """
        if self.found is None or self.posed is None or "_of_found" in self.__dict__ or not self._may_move_less:
            return self
        known = self._proved(self.found, tries=1)
        if not known.exact:
            least = self._proved(self._least, tries=1)
            if least.exact and self._reaches(least):
                out = replace(self, found=self._least)
                out.__dict__.update(_of_found=least, _shown=(self._least, least))  # kept as `cached_property` does
                return out
        if known.exact and self._reaches(known):
            self.__dict__["_of_found"] = known  # else it is asked for again, in all modes
        return self

    def _too_small(self, cap: float, shown: Witness | None) -> bool:
        """Is a bound for motions up to a cap [N] not complete beside this witness?"""
        motion = None if shown is None else shown.state.motion
        return self.question is not None and bool(answers.cap_fault(self.question, cap, self._bound, motion))

    @property
    def motion_cap(self) -> float | None:
        """[N] up to which virtual motions its bound is proved, of `max` for each time of the direction if nothing of it
        is resisted; None without an end.
        """
        cap = self.proof.cap if self.proof else None
        return cap if cap is None or self.question is None else answers.told_cap(self.question, cap, self._bound)

    @property
    def reaches_far(self) -> bool:
        """Is its bound proved for motions of any size, or up to far more than all forces in play?"""
        cap = self.proof.cap if self.proof else None
        return cap is None or not self._too_small(cap, None)

    @property
    def _bound(self) -> float:
        """The magnitude of the direction, or the commands, that the proof bounds."""
        return 0.0

    @property
    def certain(self) -> bool:
        """Is a witness proved to be one, exactly or to 1e-9 of the load?"""
        known = self._of_found
        return known is not None and (known.exact or known.tolerant)

    @property
    def _may_move_less(self) -> bool:
        """May a state that moves less stand for the one that was found?"""
        return self.path is None

    @property
    def _along(self) -> Array | None:
        """(6,) the direction whose magnitude is unknown in what is to be proved of the witness; None for none."""
        return None

    def state_json(self) -> dict[str, Any]:
        """The witness by key, as `check` prints it; null without one that is proved."""
        if self.witness is None or self.posed is None or self.proved is None:
            return dict(answers.UNPROVED_STATE)
        return answers.described(_grasp(self.posed, self.witness), self.witness.state, self.proved)

    @property
    def exact(self) -> bool | None:
        """Is an exact state proved to exist, for the numbers as they are? None without a witness."""
        if self.path is not None:
            return self.path.exact
        return None if self.proved is None else self.proved.exact

    @property
    def motion(self) -> float | None:
        """[N] how large the virtual motions of the state that is proved are, see `tolerance.motion_size`; or None."""
        if self.path is not None:
            return self.path.motion
        return None if self.proved is None else self.proved.motion

    @abstractmethod
    def said(self) -> dict[str, Any]:
        """The keys of its query's JSON."""

    def proof_json(self) -> dict[str, Any]:
        """Keys of every answer: is there a certificate, was all replayed, up to which motions [N] if not all?"""
        known = {"certified": self.certificate is not None, "verified": self.verified, "motion_cap": self.motion_cap}
        return known | {"exact": self.exact, "motion": self.motion}

    def to_json(self) -> dict[str, Any]:
        """The object that the command line prints."""
        path = self.path.said() if self.path is not None else {}
        return header(self, self.query) | self.proof_json() | self.said() | path

    def to_file(self) -> dict[str, Any]:
        """The `handfast/result/1` object: question, answer, witness, certificate. `InputError` without a question.

        Of a load's path a `handfast/path/1` object.
        """
        if self.posed is None:
            raise InputError("does not know its question; save what a query returned", field="answer")
        if self.path is not None:
            return self.path.to_file(self.to_json())
        return {
            "schema": answers.SCHEMA,
            "question": self.posed.to_json(),
            "answer": self.to_json(),
            "witness": None if self.witness is None else witness_json(self.witness),
            "certificate": None if self.certificate is None else proof_to_dict(self.certificate),
        }

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write a `handfast/result/1` file, or a `handfast/path/1` file. For `handfast.verify`.

        Raises:
            InputError: the file exists and `force` is not set, or cannot be written.
        """
        write_text(path, json.dumps(self.to_file(), allow_nan=False) + "\n", force=force)

    def verify(self) -> Replay:
        """Is everything that it claims proved? Replayed without the engine and without any solver.

        Raises:
            InputError: it does not know its question.
        """
        if self.path is not None:
            return path_steps.replay(path_steps.read_path(self.to_file()))
        return answers.replay(answers.read_answer(self.to_file()))


def any_state(
    kind: Callable[..., Kind], p: ScaledProblem, settings: Settings, on_progress: OnStep | None = None, **hints: Any
) -> Kind:
    """Is there any state of a problem, as an answer of a kind that needs no more? hints: as of `solve`."""
    limits = clock_of(settings)
    found = solve(p, ANY_STATE, settings, on_progress, **hints)
    verdict = Verdict.SLIPS if found.bound == INF else Verdict.HOLDS if found.witness else Verdict.UNDECIDED
    backing: dict[str, Any] = {"posed": BoundProblem(p, ANY_STATE), "verified": found.backed}
    answer = kind(verdict, found.stop, *found.cost, found.witness, found.proof, **backing)
    return answer.settled(limits.end) if settings.verify else answer


def _grasp(posed: BoundProblem, w: Witness) -> GraspData:
    """The grasp with the commands of a witness."""
    return grasp_data(posed.problem.grasp).with_command(w.grasp.command)


def state_json(s: State) -> dict[str, Any]:
    """A state as files have it: `reaction` and `torsion` only where joints and contacts have one."""
    arrays = {"r": s.r, "q": s.q, "c": s.c, "f": s.f, "coupling": s.coupling}
    arrays |= {name: x for name, x in (("reaction", s.reaction), ("torsion", s.torsion)) if x.any()}
    return {name: value.tolist() for name, value in arrays.items()}


def witness_json(w: Witness) -> dict[str, Any]:
    """A witness as files have it."""
    commands = dict(zip(w.grasp.mechanism.actuators, w.grasp.command.tolist(), strict=True))
    return {"wrench": np.asarray(w.wrench).tolist(), "command": commands, **state_json(w.state)}


def finite(x: float) -> float | None:
    """JSON has no infinity: None."""
    return float(x) if np.isfinite(x) else None
