"""Folders and files from which code may be loaded: those that nobody else could have written or exchanged.

A file is safe only if every folder on the way to it is: whoever can write to a folder above can put another one in the
place of what is below. Links are followed one by one, since whoever can exchange a link chooses what it leads to.
"""

from __future__ import annotations

import os
import stat
import sys
from pathlib import Path

LINKS = 40  # on the way to a file; Linux follows as many


def trusted(status: os.stat_result) -> bool:
    """Whether nobody but the user, and root, can write to it. Windows guards a user's folders by itself."""
    if sys.platform == "win32":
        return True
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def exposed(path: Path) -> Path | None:
    """The first place on the way to `path`, itself included, where others could exchange what is found; None: nowhere.

    Where others may write to a folder but not remove what is another's (the sticky bit, as `/tmp` has it), the next
    step is safe if it belongs to the user or to root: nobody else can rename or replace it, so that a folder of one's
    own in `/tmp` is as good as any. `path` itself has to be `trusted` without that: to a folder with the sticky bit
    others may add files. On Windows nothing is exposed.

    Args:
        path: absolute, of a folder or file.

    Raises:
        OSError: it is not there, or cannot be reached.
    """
    if sys.platform == "win32":
        return None
    at, left, links = Path(path.anchor), list(path.parts[1:]), 0
    while left:
        name = left.pop(0)
        if name == "..":  # `at` holds no links any more
            at = at.parent
            continue
        step = at / name
        status = step.lstat()
        if not _kept_by(at.stat(), status):
            return at
        if not stat.S_ISLNK(status.st_mode):
            at = step
            continue
        links += 1
        if links > LINKS:
            raise OSError(f"{path}: more than {LINKS} links")
        target = step.readlink()
        left = [*target.parts[target.is_absolute() :], *left]
        at = Path(target.anchor) if target.is_absolute() else at
    return None if trusted(at.stat()) else at


def _kept_by(folder: os.stat_result, entry: os.stat_result) -> bool:
    """Whether nobody but the user and root can put something else in the place of an entry of a folder."""
    ours = (0, os.geteuid())
    return trusted(folder) or bool(folder.st_uid in ours and folder.st_mode & stat.S_ISVTX and entry.st_uid in ours)


def user_cache() -> Path:
    """The folder `handfast` in the user's cache: of `XDG_CACHE_HOME`, `~/.cache`, or on Windows `LOCALAPPDATA`.

    A variable that is relative is ignored, as the XDG specification asks: what the current folder holds is anybody's.
    """
    variable, usual = ("LOCALAPPDATA", "AppData/Local") if sys.platform == "win32" else ("XDG_CACHE_HOME", ".cache")
    user = Path(os.environ.get(variable, ""))
    return (user if user.is_absolute() else Path(os.path.expanduser("~")) / usual) / "handfast"
