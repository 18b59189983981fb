"""What joins state, answers and drawing: every change of a control makes a new state, asks about it and is drawn.

And the grasps that it is about: one, several, or the files of a folder.
"""

from __future__ import annotations

import json
import re
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.pictures.live.answering import Reply, answer, replay
from handfast.pictures.live.shown_state import GREYING_DELAY, Shown, SlipMotion, shown
from handfast.pictures.live.view_state import Stage, ViewState, stage_of
from handfast.readers.grasp_file import load_grasp

FRAME = 1 / 25  # [s] between two pictures
T = TypeVar("T")
Work = Callable[[T, Callable[[], bool]], None]
REPLAY_DELAY = 0.3  # [s] without a change after which proofs are replayed


class Canvas(Protocol):
    """What draws. It is called by one thread at a time."""

    def put(self, state: ViewState, stage: Stage) -> None:
        """Another grasp."""

    def draw(self, state: ViewState, stage: Stage, reply: Reply | None, what: Shown, source: str) -> None:
        """Another state or reply; `source` names the control that changed last, which is left as it is."""

    def move(self, motion: SlipMotion | None, seconds: float) -> None:
        """The object after this time of its motion; None puts it back."""

    def say(self, text: str) -> None:
        """A message that is not about the grasp shown."""


class LiveSession:
    """A state that controls change from any thread; threads that answer, replay proofs and draw.

    Args:
        album: the grasps.

    Raises:
        InputError: no grasp can be read; it is about the first.
    """

    def __init__(self, album: Album) -> None:
        self.album = album
        number, grasp, self._messages = first_that_reads(album)
        self.state = ViewState.of(grasp, number)
        self.stage = stage_of(grasp)
        self.reply: Reply | None = None
        self.moving = True
        self._lock = threading.Lock()
        self._dirty = True
        self._source = ""
        self._fault = ""
        self._over = threading.Event()
        self._painter: threading.Thread | None = None
        self._asked: LatestRequest[ViewState] = LatestRequest(self._answer, self._failed)
        self._replays: LatestRequest[Reply] = LatestRequest(self._replay, self._failed)

    def start(self, canvas: Canvas) -> None:
        """Draw, and ask about the first state."""
        self._painter = threading.Thread(target=self._paint, args=(canvas,), name="handfast-draw", daemon=True)
        self._painter.start()
        self._asked.ask(self.state)

    def close(self) -> None:
        """End the threads."""
        self._over.set()
        self._asked.close()
        self._replays.close()
        if self._painter and self._painter is not threading.current_thread():
            self._painter.join(timeout=5.0)

    def change(self, how: Callable[[ViewState], ViewState], source: str = "") -> None:
        """Change the state; returns at once. `source` names the control that did it."""
        with self._lock:
            self.state = how(self.state)
            self._source, self._dirty, self._fault = source, True, ""
            state = self.state
        self._asked.ask(state)

    def leaf(self, number: int, step: int = 0) -> None:
        """Look at another grasp, counted around. A file that cannot be read is told; then the grasp stays, or the next
        one by `step` (1 or -1) is looked at."""
        number %= len(self.album)
        for _ in range(len(self.album) if step else 1):
            try:
                grasp = self.album.read(number)
                stage = stage_of(grasp)
                break
            except InputError as fault:
                self._say(str(fault))
                number = (number + step) % len(self.album)
        else:
            self.redraw()  # the panel goes back to the grasp that stays
            return
        with self._lock:
            self.stage = stage
            self.state = state = self.state.leafed(grasp, number)
            self._source, self._dirty, self._fault = "", True, ""
        self._asked.ask(state)

    def redraw(self) -> None:
        """Draw once more: something that is no part of the state changed."""
        with self._lock:
            self._dirty = True

    def _answer(self, state: ViewState, outdated: Callable[[], bool]) -> None:
        answer(state, self.reply, outdated, self._tell)
        reply = self.reply
        if reply and reply.state is state and not outdated():
            self._replays.ask(reply)

    def _replay(self, reply: Reply, outdated: Callable[[], bool]) -> None:
        right = not self._over.wait(REPLAY_DELAY) and not outdated() and self.reply is reply and replay(reply)
        with self._lock:
            if right and self.reply is reply:
                self.reply, self._dirty = replace(reply, replayed=True), True

    def _tell(self, reply: Reply) -> None:
        with self._lock:
            self.reply, self._dirty = reply, True
        self._asked.answered()

    def _failed(self, fault: Exception) -> None:
        with self._lock:
            self._fault, self._dirty = " ".join(str(fault).split()) or type(fault).__name__, True

    def _say(self, text: str) -> None:
        with self._lock:
            self._messages.append(text)

    def _paint(self, canvas: Canvas) -> None:
        put: Stage | None = None
        late = False
        motion: SlipMotion | None = None
        since = time.monotonic()
        while not self._over.wait(FRAME):
            what = None
            waited = self._asked.waited
            with self._lock:
                messages, self._messages = self._messages, []
                if self._dirty or (waited > GREYING_DELAY and not late):
                    state, stage, reply, source = self.state, self.stage, self.reply, self._source
                    what = shown(state, stage, reply, waited, self._fault)
                    self._dirty, late = False, what.grey
            for text in messages:
                canvas.say(text)
            if what is not None:
                if stage is not put:
                    canvas.put(state, stage)
                    put = stage
                canvas.draw(state, stage, reply, what, source)
                if what.motion is None or motion is None:
                    since = time.monotonic()
                motion = what.motion
            canvas.move(motion if self.moving else None, time.monotonic() - since)


class LatestRequest(Generic[T]):
    """Work on what was asked last, in a thread of its own.

    Args:
        work: called with a request and with a function that says whether a newer one waits.
        failed: called with a fault that `work` raised; the thread goes on.
    """

    def __init__(self, work: Work[T], failed: Callable[[Exception], None]) -> None:
        self._work, self._failed = work, failed
        self._changed = threading.Condition()
        self._waiting: list[T] = []  # one at most
        self._since: float | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="handfast-view", daemon=True)
        self._thread.start()

    def ask(self, request: T) -> None:
        """Let it be the next; what waits is passed over."""
        with self._changed:
            self._waiting[:] = [request]
            self._since = self._since or time.monotonic()
            self._changed.notify()

    @property
    def waited(self) -> float:
        """[s] for which something has been asked without an answer; 0 if all is answered. `answered` ends it."""
        with self._changed:
            return 0.0 if self._since is None else time.monotonic() - self._since

    def answered(self) -> None:
        """What is worked at has a first answer."""
        with self._changed:
            self._since = time.monotonic() if self._waiting else None

    def outdated(self) -> bool:
        """Does a newer request wait, or is it over?"""
        with self._changed:
            return bool(self._waiting) or self._closed

    def close(self) -> None:
        """No more requests; what is worked at hears that it is outdated."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                request = self._waiting.pop()
            try:
                self._work(request, self.outdated)
            except Exception as fault:
                if not isinstance(fault, InputError):  # which says all there is to say
                    traceback.print_exc()
                self.answered()
                self._failed(fault)


# --- the grasps that a page leafs through ---

GRASP_GLOB = "*.grasp.json"  # as the programs of this package name them
SCHEMA = "handfast/grasp/1"
SCHEMA_BYTES = 4096  # bytes of a file in which its schema is looked for


@dataclass(frozen=True)
class Album:
    """Names; grasps, or their files, read when they are looked at."""

    names: tuple[str, ...]
    grasps: tuple[Grasp | Path, ...]

    def __len__(self) -> int:
        return len(self.names)

    def read(self, number: int) -> Grasp:
        """One grasp; `InputError` as `load_grasp`."""
        grasp = self.grasps[number]
        return load_grasp(grasp) if isinstance(grasp, Path) else grasp

    @classmethod
    def of(cls, source: Grasp | Sequence[Grasp] | str | Path) -> Album:
        """From grasps, a grasp file, the name of a bundled grasp, or a folder of grasp files.

        Raises:
            InputError: a folder without grasp files, no grasps, a file as `load_grasp`.
        """
        if isinstance(source, str | Path):
            if Path(source).is_dir():
                return cls.of_folder(Path(source))
            source = load_grasp(source)  # its faults are told before there is a page
        if isinstance(source, Grasp):
            return cls((source.name,), (source,))
        if not hasattr(source, "__iter__"):
            raise InputError(
                f"is of type {type(source).__name__}; grasps or the name of a file are needed", field="grasp"
            )
        grasps = tuple(source)
        if not grasps:
            raise InputError("is empty; at least one grasp is needed", field="grasps")
        for k, g in enumerate(grasps):
            if not isinstance(g, Grasp):
                raise InputError(f"is {type(g).__name__}; a grasp is needed", field=f"grasps[{k}]")
        return cls(tuple(g.name for g in grasps), grasps)

    @classmethod
    def of_folder(cls, path: Path) -> Album:
        """The files that end in .grasp.json, or else all JSON files that are grasps; numbers in their order."""
        files = sorted(path.glob(GRASP_GLOB), key=_natural)
        files = files or sorted((f for f in path.glob("*.json") if _is_grasp(f)), key=_natural)
        if not files:
            raise InputError(f"has no grasp files ({GRASP_GLOB}, or JSON of {SCHEMA})", source=str(path))
        return cls(tuple(_label(f) for f in files), tuple(files))


def first_that_reads(album: Album) -> tuple[int, Grasp, list[str]]:
    """The number of the first grasp that can be read, the grasp, and what is wrong with those before it.

    Raises:
        InputError: none can be read; it is about the first.
    """
    faults: list[InputError] = []
    for number in range(len(album)):
        try:
            return number, album.read(number), [str(fault) for fault in faults]
        except InputError as fault:
            faults.append(fault)
    raise faults[0]


def _natural(file: Path) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", file.name)]


def _label(file: Path) -> str:
    return file.name.removesuffix(".json").removesuffix(".grasp")


def _is_grasp(file: Path) -> bool:
    """Does its beginning name the schema? What else is wrong with it is told when it is read."""
    try:
        with file.open("rb") as f:
            return json.dumps(SCHEMA).encode() in f.read(SCHEMA_BYTES)
    except OSError:
        return False
