"""Where the program speaks: answers on standard output, progress and complaints on standard error."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

from handfast.core.answer import Reach, Stop, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from handfast.stability.problem.settings import Progress

ANSWERED, REFUSED, BAD_INPUT, UNDECIDED = 0, 1, 2, 3
WRAP_LETTERS = 30  # letters of a cell beyond which it may be broken between words
PROGRESS_DELAY = 1.0  # [s] work shorter than this shows no progress


def complain(message: str) -> int:
    """One line on standard error; returns the exit status of bad input."""
    with suppress(OSError):  # nobody is left to tell
        print("handfast: " + " ".join(message.split()), file=sys.stderr)
    return BAD_INPUT


def warn(message: str) -> None:
    """One line on standard error about what is odd but not refused; nothing for an empty one."""
    if message:
        complain(f"warning: {message}")


def status(verdict: Verdict | Reach, stop: Stop) -> int:
    """Exit status of an answer. A limit that was hit leaves the question open, whatever is known by then."""
    cut_short = stop in (Stop.TIME, Stop.NODES, Stop.INTERRUPTED, Stop.FRUITLESS)
    return UNDECIDED if verdict in (Verdict.UNDECIDED, Reach.UNDECIDED) or cut_short else ANSWERED


def print_json(answer: dict[str, Any]) -> None:
    """One object on standard output."""
    print(json.dumps(answer, indent=1, allow_nan=False))


def out() -> Console:
    """Standard output for people."""
    from rich.console import Console

    width = None if sys.stdout.isatty() else 100
    return Console(highlight=False, markup=False, width=width)


def say_written(to: Console, *paths: Path | None) -> None:
    """Which files there are now; None: none was asked for."""
    for path in filter(None, paths):
        to.print(f"Written: {path}", soft_wrap=True)


class Watch:
    """Progress on standard error if that is a terminal."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.start = time.monotonic()
        self._bar: Any = None
        self._task: Any = None
        self._stream = sys.stderr
        self._shows = sys.stderr.isatty()

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.start

    def step(self, progress: Progress) -> None:
        """As one query goes on."""
        text = f"{progress.nodes} nodes"
        if 0 < progress.upper < float("inf"):
            text += f" · bounds {progress.lower:.5g} to {progress.upper:.5g}"
        self._show(text, None, None)

    def item(self, done: int, total: int, more: str = "") -> None:
        """After each case of a map or sweep; `more` to say."""
        self._show(f"{done} of {total}{more}", done, total)

    def say(self, text: str) -> None:
        """As anything else goes on."""
        self._show(text, None, None)

    def _show(self, text: str, done: int | None, total: int | None) -> None:
        if not self._shows or self.seconds < PROGRESS_DELAY:
            return
        if self._bar is None:
            # no refreshing thread: a solver may hold the interpreter, and workers are forked
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

            bar = [BarColumn()] if total else []
            self._bar = Progress(
                TextColumn("[bold]{task.description}"),
                *bar,
                TextColumn("{task.fields[text]}"),
                TimeElapsedColumn(),
                console=Console(file=self._stream),
                transient=True,
                auto_refresh=False,
                redirect_stdout=False,
                redirect_stderr=False,
            )
            self._bar.start()
            self._task = self._bar.add_task(self.what, total=total, text=text)
        self._bar.update(self._task, completed=done or 0, text=text)
        self._bar.refresh()

    def stop(self) -> None:
        if self._bar is not None:
            self._bar.stop()


@contextmanager
def watch(what: str) -> Iterator[Watch]:
    """A `Watch` during a query."""
    w = Watch(what)
    try:
        yield w
    finally:
        w.stop()


def table(heads: Sequence[str], rows: Iterable[Sequence[str | Text]], whole: int = 2) -> Table:
    """A table in the house style; columns with a unit hold numbers.

    The first columns, `whole` of them, keep their lines whole unless a cell of theirs is long: the others would be left
    with no room for a word.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    cells = list(rows)
    grid = Table(box=SIMPLE_HEAD, header_style="bold", pad_edge=False, show_edge=False, padding=(0, 1, 0, 0))
    for i, head in enumerate(heads):
        number = i > 0 and "[" in head and head not in ("force [N]", "position [mm]")
        short = i < whole and all(len(str(row[i])) <= WRAP_LETTERS for row in cells if i < len(row))
        grid.add_column(head, justify="right" if number else "left", overflow="fold", no_wrap=short)
    for row in cells:
        grid.add_row(*row)
    return grid


def print_table(out: Console, heads: Sequence[str], rows: Iterable[Sequence[str | Text]]) -> None:
    """The same below an empty line."""
    out.print()
    out.print(table(heads, rows))


def print_list(out: Console, rows: Iterable[tuple[str, ...]]) -> None:
    """Names, and what there is to say of each, without lines and heads."""
    from rich.box import SIMPLE
    from rich.table import Table

    grid = Table(box=SIMPLE, show_header=False, show_edge=False, pad_edge=False, padding=(0, 2, 0, 0))
    for name, *others in rows:
        grid.add_row(f"  {name}", *others)
    out.print(grid)
