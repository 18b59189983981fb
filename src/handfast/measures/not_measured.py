"""Why a measure has no value for a grasp."""

from __future__ import annotations


class NotMeasured(Exception):
    """A measure is not to be had here: what computes it is not installed, or the grasp is too large for it.

    Its text is one line that says why and what would help.
    """
