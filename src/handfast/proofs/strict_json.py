"""Strict JSON: numbers are finite and of a size that no product overflows, names are given once, texts are one line."""

from __future__ import annotations

import json
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator
from typing import Any

MAX_JSON_NUMBER = 1e50  # numbers in files are at most so large: no product of a few overflows
MAX_INTEGER_DIGITS = 50  # of a whole number
MAX_JSON_DEPTH = 50  # of lists and objects in each other; our own files need ten
CONTROL = re.compile("[\x7f-\x9f\u2028\u2029]")  # and ends of lines, that JSON itself lets pass
TOO_DEEP = f"is nested too deeply; at most {MAX_JSON_DEPTH} lists and objects may be in each other"


class BadFile(ValueError):
    """What is wrong with a file: the field, and what would be right."""

    def __init__(self, problem: str, field: str = "") -> None:
        super().__init__(f"{field}: {problem}" if field else problem)
        self.problem, self.field = problem, field


def parse(text: str) -> Any:
    """Parsed JSON, which any code may walk through and write again.

    Raises:
        BadFile: no JSON; NaN, infinity or a number beyond `MAX_JSON_NUMBER`; a name twice in one object; half a
            character, or a control character, which could fake lines of what is printed; more than `MAX_JSON_DEPTH`
            lists and objects in each other.
    """
    try:
        data = json.loads(text, parse_constant=_refused, parse_int=_whole, parse_float=_real, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise BadFile(f"is not valid JSON: {error.msg} (line {error.lineno}, column {error.colno})") from None
    except RecursionError:
        raise BadFile(TOO_DEEP) from None
    if _deeper(data, MAX_JSON_DEPTH):
        raise BadFile(TOO_DEEP)
    if "\\" in text or CONTROL.search(text):  # else every character is as it stands, and none that JSON refuses
        for word in _words(data):
            kinds = set(map(unicodedata.category, word))
            if kinds & {"Cc", "Zl", "Zp"}:
                raise BadFile(f"contains {word[:40]!r}; names and texts are one line without control characters")
            if "Cs" in kinds:
                raise BadFile("contains half a character (a lone surrogate such as \\ud800)")
    return data


def _words(data: Any) -> Iterator[str]:
    """All texts and names in parsed JSON."""
    if isinstance(data, str):
        yield data
    elif isinstance(data, dict):
        yield from data
        data = list(data.values())
    if isinstance(data, list):
        for x in data:
            yield from _words(x)


def _refused(constant: str) -> Any:
    raise BadFile(f"contains {constant}; finite numbers are needed")


def _whole(digits: str) -> int:
    if len(digits) > MAX_INTEGER_DIGITS:
        raise BadFile(f"contains a number of {len(digits)} digits; at most {MAX_INTEGER_DIGITS} are possible")
    return int(digits)


def _real(text: str) -> float:
    number = float(text)
    if abs(number) > MAX_JSON_NUMBER:
        shown = text if len(text) <= 20 else f"{text[:20]}..."
        raise BadFile(f"contains {shown}; numbers up to {MAX_JSON_NUMBER:g} are possible")
    return number


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out = dict(pairs)
    if len(out) < len(pairs):
        name, times = Counter(name for name, _ in pairs).most_common(1)[0]
        raise BadFile(f"has '{name}' {times} times in one object; once is enough")
    return out


def _deeper(data: Any, depth: int) -> bool:
    """Whether lists and objects are in each other more than `depth` times."""
    layer = [data]
    for _ in range(depth):
        inner = (x.values() if isinstance(x, dict) else x if isinstance(x, list) else () for x in layer)
        layer = [y for values in inner for y in values if isinstance(y, dict | list)]
        if not layer:
            return False
    return True
