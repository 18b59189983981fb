"""`handfast verify`: replays what backs a saved answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.options import Command


@dataclass(kw_only=True)
class Verify(Command):
    """Is everything that a saved answer claims proved? Prints what: the question, and the grasp or hand it is about.

    Replays its witness in the equations and its certificate, the proofs that its configurations exist, or both for
    each grasp of a task, without the engine and without any solver.
    Exit status: 0 all is proved, 1 something is refused, 2 bad input.
    """

    result: Annotated[Positional[str], arg(metavar="RESULT")]
    """a file that --save wrote, or a handfast/certificate/1 file"""
    json: bool = False
    """print one JSON object instead of a table"""

    def run(self) -> int:
        from handfast.cli import grasp_tables, synthesis_tables, tables
        from handfast.cli.question_tables import question_json, task_json
        from handfast.planning.results.verify_grasps import ReplayedGrasps
        from handfast.saved import load, verify
        from handfast.stability.verification import Verified
        from handfast.synthesis.synthesis_answer import ReplayedSynthesis

        what = load(self.result)
        done = verify(what)
        if self.json:
            said = done.to_json()
            if isinstance(done, Verified):
                said["question"] = question_json(what.question)
            elif isinstance(done, ReplayedSynthesis):
                said["question"] = task_json(what.synthesis.task)
            console.print_json(said)
        elif isinstance(done, ReplayedSynthesis):
            synthesis_tables.show_replayed(console.out(), what, done)
        elif isinstance(done, ReplayedGrasps):
            grasp_tables.show_replayed_grasps(console.out(), what, done)
        else:
            tables.show_verified(console.out(), what, done)
        return console.ANSWERED if done.ok else console.REFUSED
