"""What an answer is: a verdict, and why the search stopped."""

from __future__ import annotations

from enum import StrEnum


class Verdict(StrEnum):
    """Does the grasp resist?"""

    HOLDS = "holds"  # an exact solution of the model was found and checked
    SLIPS = "slips"  # no solution exists
    UNDECIDED = "undecided"  # neither was shown; a limit was hit or the numbers did not suffice


class Reach(StrEnum):
    """Can the hand take the hold?"""

    FOUND = "found"  # a configuration was found and proved to exist
    NONE = "none"  # every part of the space was discarded by verified arithmetic
    UNDECIDED = "undecided"  # neither was shown; a limit was hit


class Stop(StrEnum):
    """Why the search ended."""

    COMPLETE = "complete"  # it answered as precisely as it was asked
    TIME = "time"  # the time limit
    NODES = "nodes"  # the node limit
    INTERRUPTED = "interrupted"  # Ctrl-C
    # of Algorithm 1: the finest sectors were reached and the bounds are still apart; of many configurations: no
    # further ones were met that differ
    RESOLUTION = "resolution"
    NUMERICAL = "numerical"  # rounding left a case open, or a solver's answer did not stand up to the check
