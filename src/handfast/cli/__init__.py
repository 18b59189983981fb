"""The program `handfast`: one subcommand per question.

Here is nothing but the entry: the submodule `list` hides the built-in of that name.
"""

import os

for _library in ("OPENBLAS", "MKL"):  # matrices are small: threads for each of them only wait for each other
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")

from handfast.cli.app import main  # noqa: E402, numpy reads the environment when it is imported

__all__ = ["main"]
