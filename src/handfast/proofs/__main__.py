"""`python -m handfast.proofs FILE`: the claims of a saved answer, each proved or refused.

Exit status: 0 all is proved, 1 something is refused, 2 the file cannot be read.
"""

from __future__ import annotations

import os
import sys

for _library in ("OPENBLAS", "MKL"):  # matrices are small: threads for each of them only wait for each other
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

from handfast.proofs.fields import BadFile  # noqa: E402, numpy reads the environment when it is imported
from handfast.proofs.files import verify_path  # noqa: E402
from handfast.proofs.replay import Replay  # noqa: E402


def main(arguments: list[str]) -> int:
    """Print the verdict on a file or a folder."""
    if len(arguments) != 1:
        print("usage: python -m handfast.proofs FILE", file=sys.stderr)
        return 2
    try:
        done = verify_path(arguments[0])
    except BadFile as fault:
        print(f"{arguments[0]}: {fault}", file=sys.stderr)
        return 2
    _show(done, "")
    print("PROVED" if done.ok else f"REFUSED: {done.reason}")
    return 0 if done.ok else 1


def _show(done: Replay, indent: str) -> None:
    """A line for each claim, what it is made of below it."""
    if done.claim:
        figures = ", ".join(f"{name.replace('_', ' ')} {_text(x)}" for name, x in done.figures.items() if x is not None)
        print(f"{indent}{'refused' if done.reason else 'proved'}: {done.claim}" + (f" ({figures})" if figures else ""))
    elif done.parts:
        print(f"{indent}{done.name}")
    for part in done.parts:
        _show(part, indent + "  ")
    for line in done.not_replayed:
        print(f"{indent}  not shown here: {line}")


def _text(x: object) -> str:
    return f"{x:.6g}" if isinstance(x, float) else str(x)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
