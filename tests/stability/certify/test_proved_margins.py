"""Margins of leaves without caps: in what order, how many at a time, what is known before, and until when."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handfast.model.grasp import Contact, Grasp
from handfast.stability.certify import checker, farkas
from handfast.stability.certify.certificate import Certificate, Question, Row
from handfast.stability.certify.leaf_systems import LeafSystems
from tests.support.certificates import OPEN, STICK, TURN, empty

CASES = np.zeros((6, 2, 3), dtype=np.int64)
CASES[4, :, 0] = STICK
CASES[5, 0, 0] = OPEN


def pair(load: float = 1.0) -> Question:
    """Two fixed frictionless contacts on the x axis, pushed across: no force along y is balanced."""
    contacts = [Contact([x, 0.0, 0.0], [-np.sign(x), 0.0, 0.0], 0.0) for x in (-0.03, 0.03)]
    return Question(Grasp(contacts), wrench=load * np.eye(6)[1], force_limit=2.0)


def six() -> Certificate:
    """Leaves of unlike length. Without friction c_t . y >= 0 of both contacts: the load (y) is not balanced.

    Leaves 0 and 3 cite that. In leaf 5 a contact is open, and the equalities alone contradict each other.
    """
    frames = [contact.frame.T[1:] @ [0.0, -1.0, 0.0] for contact in pair().grasp.contacts]
    ends = [int(np.round(np.arctan2(v, u) / (2 * np.pi) * TURN)) for u, v in frames]
    good = [(Row.TANGENT, i, end, 0) for i, end in enumerate(ends)]
    leaves = [good, [], [(Row.CN_UP, 0, 0, 0)], [*good, (Row.CN_UP, 0, 0, 0)], [(Row.CN_UP, 1, 0, 0)] * 4, good[:1]]
    names = [name for rows in leaves for name in rows]
    one = empty(pair(), None, names, np.linspace(1.0, 2.0, len(names)))
    start = np.cumsum([0, *map(len, leaves)])
    return replace(one, leaves=np.zeros(6, dtype=np.int64), start=start)


def margins(c: Certificate, cases: np.ndarray = CASES, **more: Any) -> np.ndarray:
    with np.errstate(all="ignore"):
        return farkas.proved_margins(c, cases, **more)


def near(values: list[float]) -> Any:
    """But for rounding."""
    return pytest.approx(values, rel=1e-9)


def test_each_leaf_has_its_own_margin(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever their order, and however many are in memory at a time."""
    c = six()
    together = margins(c)
    alone = [float(margins(c.some(np.array([k])), CASES[k : k + 1])[0]) for k in range(6)]
    assert together.tolist() == near(alone)
    assert [x > 0 for x in alone] == [True, False, False, True, False, True]
    back = np.arange(6)[::-1]
    assert margins(c.some(back), CASES[back]).tolist() == near(alone[::-1])
    for chunk, numbers in ((1, 10**6), (2, 10**6), (4, 10**6), (256, 1), (256, 400)):
        monkeypatch.setattr(farkas, "CHUNK", chunk)
        monkeypatch.setattr(farkas, "NUMBERS", numbers)
        assert margins(c).tolist() == near(alone)


def sizes_of_chunks(monkeypatch: pytest.MonkeyPatch, c: Certificate, known: Any = None) -> list[list[int]]:
    """How many rows the leaves have that are worked out together."""
    seen, original = [], LeafSystems.of

    def of(some: Certificate, *more: Any, **named: Any) -> LeafSystems:
        seen.append(np.diff(some.start).tolist())
        return original(some, *more, **named)

    with monkeypatch.context() as patch:
        patch.setattr(LeafSystems, "of", of)
        margins(c, known=known)
    return seen


def test_leaves_of_like_size_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """The shortest first; as many as fit: (rows + equalities) x unknowns are 10 x 12 numbers for the longest leaf."""
    c = six()
    for chunk, numbers, expected in (
        (256, 10**6, [[0, 1, 1, 2, 3, 4]]),
        (4, 10**6, [[0, 1, 1, 2], [3, 4]]),
        (256, 3 * 120, [[0, 1, 1], [2, 3, 4]]),
        (256, 3 * 120 - 1, [[0, 1], [1, 2], [3, 4]]),
        (256, 119, [[0], [1], [1], [2], [3], [4]]),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(farkas, "CHUNK", chunk)
            patch.setattr(farkas, "NUMBERS", numbers)
            assert sizes_of_chunks(patch, c) == expected


def test_what_is_known_is_not_judged_again(monkeypatch: pytest.MonkeyPatch) -> None:
    c, known = six(), {}
    first = margins(c, known=known)
    assert len(known) == 6
    assert sorted(known.values()) == sorted(x for x in known.values() if isinstance(x, float))
    with monkeypatch.context() as patch:
        patch.setattr(LeafSystems, "of", None)
        assert margins(c, known=known).tolist() == first.tolist()
    # half of it: the others are judged, and what is known is believed
    names = [farkas._name(c, CASES, k) for k in range(6)]
    half = {names[k]: 0.25 for k in (1, 4)}
    again = margins(c, known=half)
    assert again.tolist() == near([0.25 if k in (1, 4) else x for k, x in enumerate(first)])
    assert half.keys() == known.keys()
    assert sizes_of_chunks(monkeypatch, c, {names[k]: 0.25 for k in (1, 4)}) == [[1, 1, 2, 3]]


def test_a_slight_contradiction_is_one_of_rounding() -> None:
    """1e-10 of its terms, and no less than a float more."""
    c = six()
    names = [farkas._name(c, CASES, k) for k in range(6)]
    for margin, kept in ((1e-10, False), (np.nextafter(1e-10, 1.0), True), (-1.0, False), (np.nan, False)):
        found = margins(c, known=dict.fromkeys(names, margin))
        assert (found == (margin if kept else -np.inf)).all()


def test_a_name_is_all_that_a_proof_is_made_of() -> None:
    """A change of the case, a kind, an index, a direction or a multiplier makes another leaf; of another leaf, none."""
    c = six()
    names = [farkas._name(c, CASES, k) for k in range(6)]
    assert len(set(names)) == 6
    for field in ("kind", "index", "a", "b", "multiplier"):
        value = getattr(c, field).copy()
        value[3] += 1  # a row of leaf 3
        other = replace(c, **{field: value})
        changed = [farkas._name(other, CASES, k) != names[k] for k in range(6)]
        assert changed == [False] * 3 + [True] + [False] * 2, field
    cases = CASES.copy()
    cases[2, 1, 0] = OPEN
    assert [farkas._name(c, cases, k) != names[k] for k in range(6)] == [False] * 2 + [True] + [False] * 3


def test_references_are_part_of_a_name_wherever_they_stand() -> None:
    """Of the rows that cite one; their place in the list is none of the proof."""
    energy, other = (Row.ENERGY, 0, 0, 0), (Row.CN_UP, 1, 0, 0)
    lists = np.array([[1.0, 2.0, 0.0], [3.0, 4.0, 0.0]])
    case = CASES[:1]

    def name(place: int, references: np.ndarray, row: tuple[int, int, int, int] = other) -> bytes:
        c = empty(pair(), None, [row, (energy[0], place, 0, 0)], [1.0, 2.0], references)
        return farkas._name(c, case, 0)

    assert name(0, lists) == name(1, lists[::-1])
    assert name(0, lists) != name(1, lists)
    assert name(0, lists) != name(0, lists, (Row.CN_UP, 0, 0, 0))
    far = [empty(pair(), None, [(Row.BOUND_UP, 100_000, 0, 0)], [1.0]) for _ in range(2)]
    assert farkas._name(far[0], case, 0) == farkas._name(far[1], case, 0)  # by value, however large
    plain = empty(pair(), None, [other], [1.0], lists)
    assert farkas._name(plain, case, 0) == farkas._name(replace(plain, references=lists[::-1]), case, 0)


def test_there_is_an_end_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first leaves are judged in any case; then time is looked at before others, and before exact arithmetic."""
    c, past = six(), time.monotonic() - 1.0
    quick = np.array([5, 5])  # needs no exact arithmetic
    good = c.some(quick), CASES[quick]
    assert (margins(*good, until=past) > 0).all()
    with pytest.raises(farkas.Late):
        margins(c, until=past)
    monkeypatch.setattr(farkas, "CHUNK", 1)
    with pytest.raises(farkas.Late):
        margins(*good, until=past)
    assert (margins(*good, until=np.inf) > 0).all()
    answer = checker.verify(empty(pair(), None, [(Row.CN_UP, 0, 0, 0)], [1.0]), until=past)
    assert (answer.ok, answer.reason, answer.leaves) == (False, "there was no time to check it all", 1)
