"""The program `handfast`: one subcommand per question, one file per subcommand.

Here is nothing but the entry: the submodules `list`, `map` and `max` hide the built-ins of those names.
"""

from handfast.cli.app import main

__all__ = ["main"]
