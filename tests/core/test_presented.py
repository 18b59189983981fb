"""A base of dataclasses that print in a few lines."""

from __future__ import annotations

from dataclasses import dataclass

from handfast.core.presented import Presented


@dataclass(frozen=True)
class Long(Presented):
    """A dataclass whose own `repr` would print all of it."""

    numbers: tuple[int, ...]


@dataclass(frozen=True)
class Longer(Long):
    more: int = 0


class Own(Presented):
    def __repr__(self) -> str:
        return "own"


def test_a_dataclass_does_not_write_a_repr_of_its_own() -> None:
    for thing in (Long(tuple(range(1000))), Longer(tuple(range(1000)))):
        assert repr(thing) == f"{type(thing).__name__} without a summary"
        assert f"<b>{type(thing).__name__} without a summary</b>" in thing._repr_html_()
    assert repr(Own()) == "own"
