"""`handfast verify`: replays what backs a saved answer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, UseAppendAction, arg

from handfast.cli import console
from handfast.cli.options import Command


@dataclass(kw_only=True)
class Verify(Command):
    """Is everything that a saved answer claims proved? Prints what: the question, and the grasp or hand it is about.

    Proves that an exact state is near its witness and replays its certificate, the proofs that its configurations
    exist, or both for each grasp, without the engine and without any solver. Geometry is measured anew.
    Maps, sweeps, settled grasps and tables of labels keep no proofs: --replay asks all of it again, now with them.
    Exit status: 0 all is proved, 1 something is refused, 2 bad input, 3 with --replay: something stayed undecided.
    """

    result: Annotated[Positional[str], arg(metavar="RESULT")]
    """a file that --save wrote, a handfast/certificate/1 file, the folder of a plan; with --replay also an answer of
    map or sweep (.json), a settled.json, or a table of labels (.jsonl, .parquet)"""
    replay: bool = False
    """ask again what keeps no proofs: each of its numbers and verdicts, with proofs that are replayed"""
    dataset: Annotated[Path | None, arg(metavar="DATASET")] = None
    """of a table of labels: what was labelled"""
    row: Annotated[UseAppendAction[tuple[int, ...]], arg(metavar="N")] = ()
    """of a table of labels: the number of a row, from 0; once for each; all unless given"""
    question_timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds for each question that is asked again"""
    timeout: Annotated[float, arg(metavar="S")] = float("inf")
    """seconds for all of them"""
    json: bool = False
    """print one JSON object instead of a table"""

    def run(self) -> int:
        import time

        from handfast.cli import question_tables, tables
        from handfast.saved import stated, verify

        start = time.monotonic()
        with console.watch("verify") as watch:
            done = verify(
                self.result, replay=self.replay, dataset=self.dataset, rows=self.row,
                question_timeout=self.question_timeout, timeout=self.timeout, on_progress=watch.item,
            )  # fmt: skip
        data, seconds = stated(self.result), time.monotonic() - start
        again = question_tables.is_asked_again(data)
        if self.json:
            said = {"schema": "handfast/verification/1", "seconds": round(seconds, 6)} | done.to_json()
            console.print_json(said | {"question": question_tables.question_json(data)})
        else:
            out = console.out()
            word = tables.show_replay(out, question_tables.head(data), done)
            question_tables.show_question(out, data, proved=word == "PROVED")
            how = (
                "asked again; witnesses and certificates replayed"
                if again
                else "without any search and without any solver"
            )
            out.print(f"{tables.num(seconds, 2)} s, {how}", style="dim")
        if done.fault:
            return console.REFUSED
        return console.UNDECIDED if done.open else console.ANSWERED
