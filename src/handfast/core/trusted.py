"""Folders and files from which code may be loaded: those that nobody else could have written."""

from __future__ import annotations

import os
import stat
import sys


def trusted(status: os.stat_result) -> bool:
    """Whether nobody but the user, and root, can write to it. Windows guards a user's folders by itself."""
    if sys.platform == "win32":
        return True
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
