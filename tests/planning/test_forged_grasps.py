"""Forged `handfast/grasps/1` files: what they say is computed again from what it rests on, and refused."""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from handfast import InputError, Task
from handfast.planning.evaluation.evaluator import Derived, contacts_at, grasp_at
from handfast.planning.question import Requirements
from handfast.planning.results import grasps_file
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.verify import difference, question_of
from handfast.proofs import grasps
from handfast.stability.problem.loads import Loads
from handfast.synthesis.embedded_task import task_to_dict
from handfast.synthesis.solution import Solution
from tests.support.forged_grasps import (
    FORGED,
    LIMITS,
    NO_STATE,
    Data,
    at,
    refusals,
    renew,
    scalpel_file,
    scalpel_grasps,
)

pytestmark = pytest.mark.slow  # the search for the grasps and their proofs take seconds; `test_grasps_file.py` is quick


@pytest.fixture(scope="module")
def found() -> Grasps:
    return scalpel_grasps()


@pytest.fixture(scope="module")
def saved() -> Data:
    return scalpel_file()


@pytest.mark.parametrize("name", FORGED)
@pytest.mark.usefixtures("proved_once")
def test_a_forged_file_is_refused(saved: Data, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    change, match = FORGED[name]
    if NO_STATE not in match:  # what is wrong is found without a proof: most modes that a state may have are left out
        monkeypatch.setattr(grasps, "prove", partial(grasps.prove, tries=1))
    else:
        saved = first_alone(saved)
    data = copy.deepcopy(saved)
    change(data)
    assert data != saved
    with pytest.raises(InputError, match="checksum: does not fit"):
        grasps_file.from_dict(data)
    lines = refusals(renew(data))
    assert any(re.search(match, line) for line in lines), lines
    assert not any("\n" in line for line in lines)


def test_a_question_is_not_changed_alone(saved: Data) -> None:
    """Where every number still fits, the answer's own word of what it answers does not."""
    data = copy.deepcopy(saved)
    data["question"]["force_limit"] *= 2
    (line,) = refusals(renew(data, question=False))
    assert "the answer is to another question" in line
    assert not refusals(renew(data))  # the weaker claim holds as well, and is what is printed
    assert question_of(grasps_file.from_dict(data))["force_limit"] == 2 * LIMITS["force_limit"]


def test_an_old_file_is_none(saved: Data) -> None:
    with pytest.raises(InputError, match="schema: input should be 'handfast/grasps/1'"):
        grasps_file.from_dict(saved | {"schema": "handfast/grasps/0"})


def test_differences_are_told_one_by_one() -> None:
    due = {"a": [1.0, 1e-20, None], "b": {"c": "x", "d": True}}
    assert difference(due, {"a": [1.0, -1e-20, None], "b": {"d": True, "c": "x"}}, "it") == ""
    assert difference(due, due | {"a": [1.0, 1e-8, None]}, "it").startswith("it.a[1] is 1e-08; of hand")
    assert difference(due, due | {"a": [1.0, 0.0]}, "it") == "it.a has 2 entries, not 3"
    assert difference(due, due | {"b": {"c": "x"}}, "it") == "it.b.d is missing"
    assert difference(due, due | {"b": {"c": "x", "d": 1}}, "it").startswith("it.b.d is 1; ")
    assert difference(due, due | {"e": 0}, "it") == "it.e follows from nothing in the file"
    assert difference(1e-9, 1.001e-9, "it") == ""
    assert difference(1e-9, 1.001e-9, "it", small=0.0).startswith("it is 1.001e-09; ")
    assert difference("x" * 99, "y" * 99, "it").count("x") < 60


# --- changed everywhere -----------------------------------------------------------------------------


def rebuilt(found: Grasps, task: Task, loads: Loads, asked: Requirements, preload: Callable[[float], float]) -> Data:
    """The file of a forger who computes again all that is computed, and keeps the witnesses."""
    every = []
    for g in found.grasps[:1]:
        solution = Solution.of(task, g.solution.existence)
        bare = grasp_at(solution, g.q, contacts_at(solution, asked.friction))
        commands = {n: preload(v) for n, v in (g.answer.preload or {}).items()}
        grasp = bare.with_preload(commands)
        f = Derived.of(solution, g.q, grasp, commands, loads)
        answer = replace(g.answer, preload=commands, loads=loads, upper=f.command)
        parts = {"friction_margin": f.friction_margin, "curvatures": f.curvatures, "dexterity": f.dexterity}
        every.append(replace(g, solution=solution, grasp=grasp, answer=answer, **parts))
    forged = replace(found, task=task, loads=loads, requirements=asked, grasps=tuple(every))
    return json.loads(json.dumps(grasps_file.to_dict(forged.saved)))


def geared(task: Task) -> Task:
    mechanism = replace(task.hand.mechanism, R=2 * task.hand.mechanism.R)
    return replace(task, hand=replace(task.hand, mechanism=mechanism))


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({}, id="nothing"),
        pytest.param({"preload": lambda v: 0.5 * v}, id="preload"),
        pytest.param({"task": geared}, id="gearing"),
        pytest.param({"loads": lambda x: x.scaled(1.5)}, id="loads"),
        pytest.param({"asked": lambda a: replace(a, friction=0.1)}, id="friction"),
        pytest.param({"asked": lambda a: replace(a, eta=0.3)}, id="normals"),
    ],
)
def test_what_is_changed_everywhere_does_not_balance(found: Grasps, change: dict[str, Any]) -> None:
    def same(x: Any) -> Any:
        return x

    parts = {"task": found.task, "loads": found.loads, "asked": found.requirements}
    changed = {name: change.get(name, same)(value) for name, value in parts.items()}
    lines = refusals(rebuilt(found, **changed, preload=change.get("preload", same)))
    assert any(re.search(NO_STATE, line) for line in lines) == bool(change), lines
    assert bool(lines) == bool(change)


# --- any value ----------------------------------------------------------------------------------------

# What may be changed in an accepted file: nothing is claimed of it.
DESCRIPTIVE = ("record",)
# What is no claim but proof: another one will do as well.
PROOFS = ("existence", "witnesses")
MUTANTS = 25  # `tools/fuzz_files.py --kinds grasps` tries any number


def places(x: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The path of every value in a JSON object, leaves and branches."""
    for key, value in x.items() if isinstance(x, dict) else enumerate(x) if isinstance(x, list) else ():
        yield (*path, key)
        yield from places(value, (*path, key))


def mutated(x: Any, rng: np.random.Generator) -> Any:
    """Another value of the same kind; None where none is."""
    if isinstance(x, bool):
        return not x
    if isinstance(x, int | float):
        return x * float(rng.choice([-1.0, 0.5, 1.001, 2.0])) if x else float(rng.choice([1e-3, 1.0]))
    if isinstance(x, str):
        return x + "x" if rng.random() < 0.5 else x[1:]
    if isinstance(x, list) and len(x) > 1 and rng.random() < 0.5:
        i, j = rng.choice(len(x), 2, replace=False)
        return [x[j] if k == i else x[i] if k == j else y for k, y in enumerate(x)]
    if isinstance(x, list) and x:
        i = int(rng.integers(len(x)))
        return x[:i] + x[i + 1 :]
    if isinstance(x, dict) and x:
        gone = list(x)[int(rng.integers(len(x)))]
        return {k: v for k, v in x.items() if k != gone}
    return 1.0 if x is None else None


def claims(data: Data) -> dict[str, Any]:
    """All that a file says and `verify` prints as proved."""
    stated = {k: v for k, v in question_of(grasps_file.from_dict(data)).items() if k != "sha256"}
    answer = data["answer"] | {"question": ""}
    return {"question": stated, "answer": answer, "grasps": [g["grasp"] for g in data["grasps"]]}


def meaning(data: Data) -> Any:
    """What a file asks, once it is read: fields that may be left out are there."""
    what = grasps_file.from_dict(data)
    return task_to_dict(what.task), grasps_file.motors_to_dict(what.task.hand), data["question"]


def first_alone(saved: Data) -> Data:
    """A file without the grasps behind the first one, of which all is said in the same way."""
    data = copy.deepcopy(saved)
    del data["grasps"][1:], data["answer"]["grasps"][1:]
    return renew(data)


def test_accepted_mutants_claim_the_same(saved: Data) -> None:
    rng, saved = np.random.default_rng(14), first_alone(saved)
    assert not refusals(saved)
    all_places = [p for p in places(saved) if p[0] != "checksum"]
    own, accepted, refused = claims(saved), 0, 0
    for place in (all_places[int(k)] for k in rng.choice(len(all_places), MUTANTS, replace=False)):
        data, knows = copy.deepcopy(saved), bool(rng.random() < 0.5)
        old = _value(data, place)
        at(*place, to=lambda x: mutated(x, rng))(data)
        if _value(data, place) == old:
            continue
        lines = refusals(renew(data, question=knows))
        assert not any("\n" in line for line in lines)
        refused, accepted = refused + bool(lines), accepted + (not lines)
        if lines or place[0] in DESCRIPTIVE:
            continue
        other = difference(own, claims(data), "claims")
        if place[0] == "grasps" and place[2] in PROOFS:
            assert not other, (place, other)
        elif place[0] in ("task", "motors", "question"):  # another question, truly answered: then it says so
            assert knows, place
            assert other or meaning(data) == meaning(saved), place
        else:
            assert not other, (place, other)
    assert accepted >= 3
    assert refused >= MUTANTS // 2


def _value(data: Any, place: tuple[Any, ...]) -> Any:
    for key in place:
        data = data[key]
    return data
