"""Wrong kinds of arguments are told in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from handfast import (
    Loads,
    Settings,
    check,
    hold,
    load_body,
    load_grasp,
    load_hand,
    max_many,
    maximum,
    plan,
    verify,
)
from handfast.core.errors import InputError, kinds_checked, refuse_other_kinds
from handfast.stability.problem.grasp_limits import GraspLimits


class Grasp:
    """Stands for the class of this name."""


class Posed(Grasp):
    pass


@kinds_checked
def asked(first: object, grasp: Grasp | None, *, loads: Loads = "none") -> int:  # type: ignore[assignment, name-defined]
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


@dataclass(frozen=True)
class Numbers:
    """Fields of every kind of number."""

    share: float = 0.5
    count: int | None = 3
    by_name: Mapping[str, float] = field(default_factory=dict)
    anything: Any = None

    def __post_init__(self) -> None:
        refuse_other_kinds(self)


def test_numbers_may_be_of_numpy_and_no_text() -> None:
    Numbers(np.float32(1), np.int64(2), {"a": np.float64(1), "b": 2}, "text")  # type: ignore[arg-type, dict-item]
    Numbers(share=2, count=None)
    for given, said in (
        ({"share": "0.5"}, "^share: is '0.5'; a number is needed"),
        ({"share": None}, "^share: is of type NoneType; a number is needed"),
        ({"count": "3"}, "^count: is '3'; a whole number is needed"),
        ({"count": 3.5}, "^count: is of type float; a whole number is needed"),
        ({"by_name": [1.0]}, "^by_name: is of type list; numbers by name are needed"),
        ({"by_name": {"a": "1"}}, "^by_name: is of type dict; numbers by name are needed"),
    ):
        with pytest.raises(InputError, match=said):
            Numbers(**given)  # type: ignore[arg-type]


GRASP, HAND, BODY = load_grasp("fig1"), load_hand("parallel-gripper"), load_body("can")
LOAD = [0, 1, 0, 0, 0, 0]


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda: check(GRASP, LOAD, limits={"eta": 0.1}), "limits: is of type dict; limits are needed, such as GraspL"),
        (lambda: maximum(GRASP, LOAD, settings={"timeout": 1}), "settings: is of type dict; settings are needed"),
        (lambda: max_many(GRASP, [LOAD], settings={"timeout": 1}), "settings: is of type dict; settings are needed"),
        (lambda: hold(GRASP, Loads.wrench(LOAD), timeout="3"), "timeout: is '3'; a number is needed"),
        (lambda: Settings(timeout="5"), "timeout: is '5'; a number is needed"),
        (lambda: GraspLimits(torque_limits=[1]), "torque_limits: is of type list; numbers by name are needed"),
        (lambda: plan(HAND, BODY, count="3"), "count: is '3'; a whole number is needed"),
        (lambda: plan(HAND, BODY, limits={"eta": 1}), "limits: is of type dict; limits are needed, such as PlanLimits"),
        (lambda: GRASP.with_friction("a"), "friction: is 'a'; a number is needed"),
        (lambda: GRASP.with_preload({"finger_1_prox": "a"}), "preload: is of type dict; numbers by name are needed"),
        (lambda: load_body("can", mass="a"), "mass: is 'a'; a number is needed"),
        (lambda: load_body("can", scale=0), "scale: is 0; metres per unit of the mesh are needed"),
        (lambda: verify(3), "what: is of type int; a file, a folder or an answer is needed"),
    ],
)
def test_what_python_is_given_is_told_in_a_line(ask: Callable[[], object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        ask()
