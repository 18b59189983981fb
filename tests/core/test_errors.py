"""Wrong kinds of arguments are told in words."""

from __future__ import annotations

import pytest

from handfast.core.errors import InputError, kinds_checked


class Grasp:
    """Stands for the class of this name."""


class Posed(Grasp):
    pass


@kinds_checked
def asked(first: int, grasp: Grasp | None, *, loads: Loads = "none") -> int:  # type: ignore[assignment, name-defined] # noqa: F821
    return first


def test_wrong_kinds_of_arguments_are_told_in_words() -> None:
    assert asked("of no kind", Posed()) == "of no kind"  # type: ignore[arg-type, comparison-overlap]
    assert asked(1, None) == asked(1, grasp=Grasp()) == 1
    for value, said in (("fig1", "'fig1'"), (0.1, "of type float")):
        with pytest.raises(InputError, match=rf"^grasp: is {said}; a grasp is needed, such as load_grasp"):
            asked(1, value)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"^loads: is of type NoneType; loads are needed, such as Loads\.gravity"):
        asked(1, None, loads=None)
    with pytest.raises(TypeError, match="missing 1 required"):
        asked(1)  # type: ignore[call-arg]
