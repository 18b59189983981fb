"""What is printed and what a notebook shows: a few lines, and a picture."""

from __future__ import annotations

import importlib
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import handfast
from handfast import (
    Body,
    InputError,
    Loads,
    check,
    close,
    force_map,
    hold,
    load_body,
    load_configuration,
    load_grasp,
    load_hand,
    load_task,
    plan,
)
from handfast.core.presented import Presented
from handfast.model.shape import Shape
from handfast.pictures import notebook
from handfast.pictures.map_picture import draw_map

SOURCES = Path(handfast.__file__).parent


def planned() -> Any:
    ball = Body.of([Shape("sphere", 0.02)], mass=0.1, friction=0.8, name="ball")
    return plan(load_hand("parallel-gripper"), ball, count=2, seed=1, jobs=1, loads=Loads.gravity(ball, "-z"))


def slipping() -> Any:
    return check(load_grasp("fig1"), [0, 5, 0, 0, 0, 0])


def closed() -> Any:
    placed = load_configuration("barrett-can")
    return close(load_hand("barrett-bh8-280"), {}, load_body("can"), placed.pose)


SHOWN: dict[
    str, tuple[Callable[[], Any], str, bool]
] = {  # what, a part of its first line, and whether it has a picture
    "grasp": (lambda: load_grasp("fig1"), "4 contacts", True),
    "hand": (lambda: load_hand("parallel-gripper"), "3 links, 2 joints, 1 actuator", True),
    "object": (lambda: load_body("can"), "1 convex piece, 0.35 kg", False),
    "loads": (lambda: Loads.gravity(load_body("can")), "6 loads", False),
    "check": (lambda: check(load_grasp("fig1"), [0, 1, 0, 0, 0, 0]), "HOLDS  fig1", True),
    "slips": (slipping, "SLIPS  fig1", True),
    "map": (lambda: force_map(load_grasp("fig1"), "xy", steps=8), "forces in the xy plane", True),
    "hold": (lambda: hold(load_grasp("barrett-can"), Loads.wrench([0, 0, -3])), "One preload holds 1 load", True),
    "plan": (planned, "2 grasps of 2 asked for: parallel-gripper on ball", True),
    "configuration": (lambda: load_configuration("barrett-can"), "barrett-bh8-280 with can: 8 joints stated", False),
    "closed": (closed, "closed: ", False),
    "task": (lambda: load_task("scalpel-upholding"), "scalpel-upholding: schunk-sah", True),
}


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_shows_words_and_a_picture(name: str) -> None:
    make, first, pictured = SHOWN[name]
    thing = make()
    said = notebook.lines(thing)
    assert first in said[0]
    assert len(said) < 12
    assert len(repr(thing)) < 1200
    page = thing._repr_html_()
    assert page.count("<b>") == 1
    assert ("data:image/png;base64," in page) is pictured


def test_every_class_that_is_shown_has_words() -> None:
    for path in SOURCES.rglob("*.py"):
        if "(Presented)" in path.read_text("utf-8"):
            importlib.import_module(".".join(path.relative_to(SOURCES.parent).with_suffix("").parts))
    shown, left = set[type](), list[type]([Presented])
    while left:
        below = left.pop().__subclasses__()
        own = [kind for kind in below if kind.__module__.startswith("handfast.")]  # not those of other tests
        shown |= {kind for kind in own if not kind.__name__.startswith("_")}
        left += below
    assert len(shown) >= 20
    default = notebook.lines.dispatch(object)
    assert {kind.__name__ for kind in shown if notebook.lines.dispatch(kind) is default} == set()


def test_names_are_escaped() -> None:
    body = Body.of([Shape("sphere", [0.01])], name="<script>alert(1)</script>")
    assert "<script>" not in body._repr_html_()


def test_wrong_arguments_are_told_in_words() -> None:
    can = load_body("can")
    wrong: list[tuple[Callable[[], Any], str]] = [
        (lambda: Loads.gravity(0.1), r"^body: is of type float; an object is needed"),  # type: ignore[arg-type]
        (lambda: Loads.gravity(can, 3), r"^directions: is 3; all, "),  # type: ignore[arg-type]
        (lambda: Loads.wrench("down"), r"^wrench: is 'down'; six numbers"),
        (lambda: check("fig1", [0, 1, 0]), r"^grasp: is 'fig1'; a grasp is needed, such as load_grasp"),  # type: ignore[call-overload]
        (lambda: hold(load_grasp("fig1"), [0, 1, 0]), r"^loads: is of type list; loads are needed"),  # type: ignore[arg-type]
        (lambda: draw_map(can), r"^answer: is of type Body; what force_map answers"),  # type: ignore[arg-type]
        (lambda: handfast.view(3), r"^grasp: is of type int; grasps or the name of a file"),  # type: ignore[arg-type]
    ]
    for call, said in wrong:
        with pytest.raises(InputError, match=said):
            call()


def test_the_package_runs_as_a_program(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(sys, "argv", ["handfast", "list"])
    with pytest.raises(SystemExit) as over:
        runpy.run_module("handfast", run_name="__main__")
    assert not over.value.code
    assert "barrett-bh8-280" in capsys.readouterr().out
