"""What a search tells while it goes on, and the folder that keeps what it found, from which a search can go on."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from handfast.core.errors import InputError

PAUSE = 2.0  # [s] between two notes of how far a search has come, where nothing was found

State = TypeVar("State")


class Journal(Generic[State]):
    """Hears how far a search has come. This one keeps nothing.

    Args:
        on_note: called after each unit of work with the answer so far.
    """

    def __init__(self, on_note: Callable[[State], None] | None = None) -> None:
        self.on_note = on_note

    def earlier(self, question: Any) -> Any:
        """What to go on from; None to begin.

        Raises:
            InputError: what was kept is broken, or of another question.
        """
        return None

    def note(self, state: State, *, new: bool) -> None:
        """The search goes on; `new`: something was found."""
        if self.on_note:
            self.on_note(state)

    def close(self, state: State) -> None:
        """The search has ended."""


class SearchFolder(Journal[State]):
    """Files that are written as grasps are found, each at once or not at all.

    Args:
        path: of the folder.
        resume: go on from what it holds.
    """

    holds: ClassVar[str]  # what stands in a folder that was begun
    files: ClassVar[tuple[str, ...]]  # patterns of its files

    def __init__(self, path: Path, *, resume: bool = False, on_note: Callable[[State], None] | None = None) -> None:
        super().__init__(on_note)
        self.path, self.resume, self._when = path, resume, -PAUSE

    @classmethod
    def refuse(cls, path: Path | None, *, resume: bool, force: bool) -> None:
        """`InputError` for a folder that could not be filled, before the work that would fill it."""
        if path is None:
            if resume:
                raise InputError("needs the folder to go on from; give --output FOLDER", field="--resume")
            return
        if path.exists() and not path.is_dir():
            raise InputError("is a file; a folder is needed", source=str(path))
        if resume and force:
            raise InputError("give either --resume or --force")
        if any(any(path.glob(file)) for file in cls.files) and not (force or resume):
            problem = f"holds {cls.holds} already; give --resume to go on, or --force to write over it"
            raise InputError(problem, source=str(path))

    def note(self, state: State, *, new: bool) -> None:
        """Write what is new: a grasp at once, anything else now and then."""
        super().note(state, new=new)
        if new or time.monotonic() > self._when + PAUSE:
            self.close(state)

    def close(self, state: State) -> None:
        self.write(state)
        self._when = time.monotonic()

    @abstractmethod
    def write(self, state: State) -> None:
        """Bring the folder up to date."""
