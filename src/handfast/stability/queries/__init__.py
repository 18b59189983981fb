"""The queries about one disturbance, a module each: what is asked, its answer, its JSON and its replay.

A new query is a new module here that ends in `_query`, with a `Query` in it: see docs/architecture.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from handfast.stability.queries.check_query import CheckAnswer as CheckAnswer
from handfast.stability.queries.check_query import check as check
from handfast.stability.queries.max_query import MaxAnswer as MaxAnswer
from handfast.stability.queries.max_query import maximum as maximum
from handfast.stability.queries.torques_query import TorquesAnswer as TorquesAnswer
from handfast.stability.queries.torques_query import torques as torques
from handfast.stability.query import Query


@cache
def known() -> Mapping[str, Query[Any]]:
    """Every query by its name, as answers say it: of all modules here."""
    modules = [import_module(f"{__name__}.{m.name}") for m in iter_modules(__path__) if m.name.endswith("_query")]
    kinds = {x for module in modules for x in vars(module).values() if isinstance(x, type) and issubclass(x, Query)}
    return {kind.name: kind() for kind in sorted(kinds - {Query}, key=lambda kind: kind.name)}
