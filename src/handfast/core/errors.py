"""What Handfast says when its input is wrong: one line that a person can act on."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


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
