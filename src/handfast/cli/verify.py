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

    Proves that an exact state is near its witness and replays its certificate, the proofs that its configurations
    exist, or both for each grasp, without the engine and without any solver. Geometry is measured anew.
    Exit status: 0 all is proved, 1 something is refused, 2 bad input.
    """

    result: Annotated[Positional[str], arg(metavar="RESULT")]
    """a file that --save wrote, a handfast/certificate/1 file, or the folder of a plan"""
    json: bool = False
    """print one JSON object instead of a table"""

    def run(self) -> int:
        import time

        from handfast.cli import question_tables, tables
        from handfast.saved import stated, verify

        start = time.monotonic()
        done, data = verify(self.result), stated(self.result)
        seconds = time.monotonic() - start
        if self.json:
            said = {"schema": "handfast/verification/1", "seconds": round(seconds, 6)} | done.to_json()
            console.print_json(said | {"question": question_tables.question_json(data)})
        else:
            out = console.out()
            word = tables.show_replay(out, question_tables.head(data), done)
            question_tables.show_question(out, data, proved=word == "PROVED")
            out.print(f"{tables.num(seconds, 2)} s, without any search and without any solver", style="dim")
        return console.ANSWERED if done.ok else console.REFUSED
