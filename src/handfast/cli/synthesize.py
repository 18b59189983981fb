"""`handfast synthesize`: configurations that bring regions of the hand onto regions of the object."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.options import Command, Reported, check_writable, load_solvable
from handfast.core.errors import InputError


@dataclass(kw_only=True)
class Synthesize(Reported, Command):
    """Can the hand take that hold? Configurations in which every hand region touches its object region.

    Each one comes with a proof that an exact configuration exists. If there is none, that is shown too,
    where the limits allow. Ctrl-C ends the search; --save keeps where it stands, --resume goes on.
    """

    task: Annotated[Positional[str], arg(metavar="TASK")]
    """a handfast/task/1 file or the name of a bundled task"""
    count: Annotated[int, arg(metavar="N")] = 1
    """configurations that differ as much as possible"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of the random starts: the same seed gives the same configurations"""
    timeout: Annotated[float, arg(metavar="S")] = 60.0
    """seconds after start-up; inf: until it is answered"""
    nodes: Annotated[int | None, arg(metavar="N")] = None
    """boxes of the search for a contradiction"""
    resume: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """go on from an undecided answer that --save wrote"""
    save: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """write task, answer and proofs, for handfast verify and --resume"""
    configuration: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """write the configuration, for handfast contacts; several as FILE-1.json, FILE-2.json, ..."""
    output: Annotated[Path | None, arg(metavar="FILE.png", aliases=["-o"])] = None
    """picture of the first configuration (.png, .svg)"""

    def run(self) -> int:
        from handfast.cli import synthesis_tables
        from handfast.synthesis.query import synthesize

        task = load_solvable(self.task)
        if self.count < 1:
            raise InputError(f"is {self.count}; at least 1 is needed", field="--count")
        check_writable(self.save, self.force, (".json",))
        self.check_report()
        check_writable(self.output, self.force, (".png", ".svg"))
        for path in self._configurations(self.count):
            check_writable(path, self.force, (".json",))
        with console.watch("synthesize") as watch:
            answer = synthesize(
                task,
                count=self.count,
                seed=self.seed,
                timeout=None if self.timeout == float("inf") else self.timeout,
                nodes=self.nodes,
                resume=self.resume,
                on_progress=lambda progress: watch.say(synthesis_tables.progress_text(progress)),
            )
        written = []
        if self.save:
            answer.save(self.save, force=self.force)
            written.append(self.save)
        for path, solution in zip(self._configurations(len(answer.solutions)), answer.solutions, strict=False):
            from handfast.readers.configuration_file import save_configuration

            save_configuration(solution.configuration, path, force=self.force)
            written.append(path)
        if self.output and answer.solutions:
            from handfast.core.files import write_bytes
            from handfast.pictures.drawing import picture
            from handfast.pictures.task_picture import draw_task

            drawn = picture(draw_task(task, answer.solutions[0]), self.output.suffix.lower().removeprefix("."))
            write_bytes(self.output, drawn, force=self.force)
            written.append(self.output)
        if self.report and answer.solutions:
            from handfast.pictures.found_page import report_synthesis

            report_synthesis(self.report, answer, force=self.force)
            written.append(self.report)
        if self.json:
            console.print_json(answer.to_json())
        else:
            synthesis_tables.show_synthesis(console.out(), answer, self.count, written)
        enough = len(answer.solutions) == self.count
        return console.status(answer.verdict, answer.stop) if enough or not answer.solutions else console.UNDECIDED

    def _configurations(self, count: int) -> list[Path]:
        """Where `count` configurations are written, if they are."""
        if self.configuration is None or count == 0:
            return []
        if self.count == 1:
            return [self.configuration]
        stem, ending = self.configuration.stem, self.configuration.suffix
        return [self.configuration.with_name(f"{stem}-{k}{ending}") for k in range(1, count + 1)]
