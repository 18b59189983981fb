"""Is JSON that was read what it should be? Numbers within rounding, everything else to the letter."""

from __future__ import annotations

from typing import Any

from handfast.core.files import SAME


def matches(said: Any, shown: Any) -> bool:
    """The same JSON; numbers within `SAME` of the largest under the same key, a number alone of at least 1."""
    if isinstance(shown, list) and shown and isinstance(shown[0], dict):  # an object for each contact: key by key
        if not isinstance(said, list) or [x.keys() for x in said if isinstance(x, dict)] != [x.keys() for x in shown]:
            return False
        return all(matches([x[key] for x in said], [x[key] for x in shown]) for key in shown[0])
    size = _largest(shown)
    return _alike(said, shown, SAME * (size if isinstance(shown, list | dict) else max(1.0, size)))


def is_number(x: Any) -> bool:
    """A number, no truth value."""
    return isinstance(x, int | float) and not isinstance(x, bool)


def _alike(said: Any, shown: Any, within: float) -> bool:
    """The same JSON, numbers within a tolerance; neither texts nor truth values are numbers."""
    if isinstance(shown, dict):
        there = isinstance(said, dict) and said.keys() == shown.keys()
        return there and all(_alike(said[key], shown[key], within) for key in shown)
    if isinstance(shown, list):
        there = isinstance(said, list) and len(said) == len(shown)
        return there and all(_alike(x, y, within) for x, y in zip(said, shown, strict=True))
    if is_number(shown):
        return is_number(said) and bool(abs(said - shown) <= within)
    return type(said) is type(shown) and bool(said == shown)


def _largest(x: Any) -> float:
    """The largest number in some JSON, without its sign; 0 if there is none."""
    parts = x.values() if isinstance(x, dict) else x if isinstance(x, list) else ()
    return abs(x) if is_number(x) else max(map(_largest, parts), default=0.0)
