"""What Handfast says when its input is wrong: one line that a person can act on."""

from __future__ import annotations


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


def unknown_name(kind: str, name: str, known: object, *, field: str | None = None) -> InputError:
    """`InputError` for a name that does not exist, listing the names that do."""
    names = ", ".join(str(k) for k in known) or "none"  # type: ignore[attr-defined]
    return InputError(f"unknown {kind} '{name}'; known: {names}", field=field)
