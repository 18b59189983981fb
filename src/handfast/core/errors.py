"""What Handfast says when its input is wrong: one line that a person can act on."""

from __future__ import annotations

import difflib
import functools
import inspect
from collections.abc import Callable, Iterable
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
KINDS = {  # classes of arguments: what is needed, and where it comes from
    "Grasp": "a grasp is needed, such as load_grasp(NAME) reads",
    "Hand": "a hand is needed, such as load_hand(NAME) reads",
    "Body": "an object is needed, such as load_body(NAME) reads",
    "Task": "a task is needed, such as load_task(NAME) reads",
    "Loads": "loads are needed, such as Loads.gravity(body) or Loads.wrench(w)",
    "MapAnswer": "what force_map answers is needed",
    "SweepAnswer": "what sweep answers is needed",
}


class InputError(ValueError):
    """Bad input: the message is one line that names the place, the fault and what would be right.

    The command line prints it and exits with status 2; in Python it is a `ValueError`.
    """

    def __init__(self, problem: str, *, source: str | None = None, field: str | None = None) -> None:
        self.source, self.field, self.problem = source, field, problem
        message = ": ".join(part for part in (source, field, problem) if part)
        # names come from files: what would break the line, or speak to the terminal, is spelt out
        super().__init__("".join(c if c.isprintable() else repr(c)[1:-1] for c in message))

    def at(self, source: str) -> InputError:
        """The same error, said to come from `source` (a file) unless it already names one."""
        return InputError(self.problem, source=self.source or source, field=self.field)

    def within(self, field: str) -> InputError:
        """The same error of a part, said of the whole that has it at `field`."""
        return InputError(self.problem, source=self.source, field=f"{field}.{self.field}" if self.field else field)


def unknown_name(kind: str, name: str, known: Iterable[object], *, field: str | None = None) -> InputError:
    """`InputError` for a name that does not exist: the nearest of the names that do, and all of them."""
    names = [str(k) for k in known]
    return InputError(
        f"unknown {kind} '{name}'; known: {', '.join(names) or 'none'}{nearest(name, names)}", field=field
    )


def nearest(name: str, known: Iterable[str]) -> str:
    """The known name that is most like a mistyped one, or begins like it: "; did you mean 'fig1'?"; '' if none is."""
    names = list(known)
    near = difflib.get_close_matches(name, names, 1) or [k for k in names if len(name) > 2 and k.startswith(name)]
    return f"; did you mean '{near[0]}'?" if near else ""


def kinds_checked(function: Callable[P, R]) -> Callable[P, R]:
    """A function that tells in words of arguments that are no grasp, hand, object, task, loads or answer.

    It looks at the parameters whose annotation begins with one of `KINDS` and names classes alone.
    """
    wanted = []
    for place, (name, parameter) in enumerate(inspect.signature(function).parameters.items()):
        kinds = str(parameter.annotation).split(" | ")
        if kinds[0] in KINDS and all(kind.isidentifier() for kind in kinds):
            positional = parameter.kind is not parameter.KEYWORD_ONLY
            wanted.append((place if positional else None, name, ["NoneType" if k == "None" else k for k in kinds]))

    @functools.wraps(function)
    def told(*args: P.args, **kwargs: P.kwargs) -> R:
        for place, name, kinds in wanted:
            if place is not None and place < len(args):
                value = args[place]
            elif name in kwargs:
                value = kwargs[name]
            else:
                continue
            if not any(c.__name__ in kinds for c in type(value).__mro__):
                given = f"'{value}'" if isinstance(value, str) else f"of type {type(value).__name__}"
                raise InputError(f"is {given}; {KINDS[kinds[0]]}", field=name)
        return function(*args, **kwargs)

    return told
