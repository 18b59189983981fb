"""The queries are found by their modules: a new one is one new file."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from handfast import verify
from handfast.core.errors import InputError
from handfast.stability import queries
from tests.support.places import ROOT
from tests.support.problems import bell, nest

EXAMPLE = re.compile(r'```python title="axis_query.py"\n(.*?)```', re.DOTALL)


def test_every_query_of_one_disturbance_is_known() -> None:
    assert set(queries.known()) == {"check", "max", "torques"}
    assert all(query.name == name for name, query in queries.known().items())
    answers = queries.CheckAnswer, queries.MaxAnswer, queries.TorquesAnswer
    assert {type(queries.known()[a.query.name]) for a in answers} == {type(a.query) for a in answers}


@pytest.fixture
def axis_query(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The example of the docs, as a file beside the other queries."""
    found = EXAMPLE.search((ROOT / "docs" / "architecture.md").read_text("utf-8"))
    assert found is not None
    (tmp_path / "axis_query.py").write_text(found[1], "utf-8")
    monkeypatch.setattr(queries, "__path__", [*queries.__path__, str(tmp_path)])
    queries.known.cache_clear()
    name = f"{queries.__name__}.axis_query"
    yield import_module(name)
    queries.known.cache_clear()
    sys.modules.pop(name)


@pytest.mark.parametrize("grasp", [bell(), nest()], ids=["with preload", "without"])
def test_a_new_query_is_one_new_file(axis_query: ModuleType, grasp, tmp_path: Path) -> None:
    answer = axis_query.about_axis(grasp, [0, 0, 2])
    path = tmp_path / "axis.json"
    answer.save(path)
    done = verify(path)
    assert done.ok, done.reason
    assert done.to_json() | {"seconds": 0} == answer.verify().to_json() | {"seconds": 0}
    data = json.loads(path.read_text())
    assert (data["answer"]["query"], data["answer"]["axis"]) == ("axis", [0, 0, 1])
    data["answer"]["axis"] = [0, 1, 0]
    path.write_text(json.dumps(data))
    assert verify(path).reason == "answer: its question is about another axis"


def test_an_unknown_query_is_refused(axis_query: ModuleType, tmp_path: Path) -> None:
    path = tmp_path / "axis.json"
    axis_query.about_axis(bell(), [0, 0, 1]).save(path)
    path.write_text(path.read_text().replace('"query": "axis"', '"query": "axes"'))
    with pytest.raises(InputError, match="answer: input tag 'axes' found using 'query' does not match"):
        verify(path)
