"""What prints in a few lines and shows itself in a notebook: grasps, hands, objects, answers, maps, plans.

`handfast.pictures.notebook` has the words and the pictures of all of them. It is far above this module, so it is loaded
by its name, when something is shown.
"""

from __future__ import annotations

import importlib
from typing import Any

PRESENTER = "handfast.pictures.notebook"  # has `lines` and `html`


class Presented:
    """A base of dataclasses: `repr` is a few lines instead of every array, notebooks show words and a picture.

    A class with a `__repr__` of its own keeps it.
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "__repr__" not in vars(cls):
            cls.__repr__ = Presented.__repr__  # type: ignore[method-assign]  # here, for `dataclass` to write none

    def __repr__(self) -> str:
        return "\n".join(importlib.import_module(PRESENTER).lines(self))

    def _repr_html_(self) -> str:
        return str(importlib.import_module(PRESENTER).html(self))
