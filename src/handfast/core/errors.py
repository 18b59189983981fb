"""What Handfast says when its input is wrong: one line that a person can act on."""

from __future__ import annotations

import difflib
import functools
import inspect
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
ARGUMENT_NEEDS = {  # classes of arguments: what is needed, and where it comes from
    "Grasp": "a grasp is needed, such as load_grasp(NAME) reads",
    "Hand": "a hand is needed, such as load_hand(NAME) reads",
    "Body": "an object is needed, such as load_body(NAME) reads",
    "Task": "a task is needed, such as load_task(NAME) reads",
    "Loads": "loads are needed, such as Loads.gravity(body) or Loads.wrench(w)",
    "MapAnswer": "what force_map answers is needed",
    "SweepAnswer": "what sweep answers is needed",
    "GraspLimits": "limits are needed, such as GraspLimits(eta=0.04, force_limit=5.0)",
    "PlanLimits": "limits are needed, such as PlanLimits(command_limit=0.5)",
    "Settings": "settings are needed, such as Settings(timeout=10.0)",
    "PlanOptions": "options are needed, such as PlanOptions(count=5)",
    "TaskGraspOptions": "options are needed, such as TaskGraspOptions(count=5)",
    "ProposeOptions": "options are needed, such as ProposeOptions(count=5)",
    "Perturbation": "bounds are needed, such as Perturbation(normals=0.04)",
    "float": "a number is needed",
    "int": "a whole number is needed",
    "Mapping[str, float]": "numbers by name are needed, such as {'motor': 0.5}",
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


class FaultsOf:
    """A context: an `InputError` in it is said of a file (`InputError.at`), or of the part at a field (`within`)."""

    def __init__(self, source: object = None, *, field: str = "") -> None:
        self.source, self.field = source, field

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, fault: BaseException | None, trace: object) -> None:
        if isinstance(fault, InputError):
            raise (fault.within(self.field) if self.field else fault.at(str(self.source))) from None


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


def require_positive(value: float, field: str, right: str = "a number above 0 is needed") -> None:
    """`InputError` unless a number is finite and above 0; `right` says what would be right."""
    if not 0 < value < math.inf:
        raise InputError(f"is {value:g}; {right}", field=field)


def require_not_negative(value: float, field: str, right: str = "0 or more is needed") -> None:
    """`InputError` unless a number is finite and not below 0; `right` says what would be right."""
    if not 0 <= value < math.inf:
        raise InputError(f"is {value:g}; {right}", field=field)


def kinds_checked(function: Callable[P, R]) -> Callable[P, R]:
    """A function that tells in words of arguments that are no grasp, hand, limits, number ... where one is needed.

    It looks at the parameters whose annotation is one of `ARGUMENT_NEEDS`, and what else it may be are classes.
    """
    wanted = []
    for place, (name, parameter) in enumerate(inspect.signature(function).parameters.items()):
        if kinds := _kinds(parameter.annotation):
            positional = parameter.kind is not parameter.KEYWORD_ONLY
            wanted.append((place if positional else None, name, kinds))

    @functools.wraps(function)
    def told(*args: P.args, **kwargs: P.kwargs) -> R:
        for place, name, kinds in wanted:
            if place is not None and place < len(args):
                value = args[place]
            elif name in kwargs:
                value = kwargs[name]
            else:
                continue
            _refuse_another_kind(value, kinds, name)
        return function(*args, **kwargs)

    return told


def refuse_other_kinds(options: Any) -> None:
    """The same of the fields of a dataclass: for its `__post_init__`."""
    of: Any = type(options)
    for name, kinds in _field_kinds(of):
        _refuse_another_kind(getattr(options, name), kinds, name)


@functools.cache
def _field_kinds(of: Any) -> list[tuple[str, tuple[str, ...]]]:
    return [(f.name, kinds) for f in fields(of) if (kinds := _kinds(f.type))]


def _kinds(annotation: object) -> tuple[str, ...]:
    """The kinds that an annotation allows; none where the first is not of `ARGUMENT_NEEDS`, or others are no
    classes."""
    first, *others = str(annotation).split(" | ")
    return (first, *others) if first in ARGUMENT_NEEDS and all(kind.isidentifier() for kind in others) else ()


def _refuse_another_kind(value: object, kinds: tuple[str, ...], name: str) -> None:
    if (value is None and "None" in kinds) or any(_is_of(value, kind) for kind in kinds):
        return
    given = f"'{value}'" if isinstance(value, str) else f"of type {type(value).__name__}"
    raise InputError(f"is {given}; {ARGUMENT_NEEDS[kinds[0]]}", field=name)


def _is_of(value: object, kind: str) -> bool:
    if kind in ("float", "int"):  # numbers of numpy are numbers, too, and an array of one has always been taken
        return hasattr(value, "__float__" if kind == "float" else "__index__")
    if kind == "Mapping[str, float]":
        return isinstance(value, Mapping) and all(_is_of(x, "float") for x in value.values())
    return any(c.__name__ == kind for c in type(value).__mro__)
