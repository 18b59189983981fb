"""Files that were written under the first name, Holdfast, are read as today's, with their digests."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast import check, load_grasp, load_loads, load_task, save_grasp, synthesize, verify
from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.synthesis.embedded import digest
from handfast.synthesis.task_file import save_task


def aged(path: Path) -> Path:
    """The same file as the first version wrote it."""
    text = path.read_text("utf-8")
    assert '"handfast/' in text
    path.write_text(text.replace('"handfast/', '"holdfast/'), "utf-8")
    return path


def test_a_grasp(tmp_path: Path) -> None:
    save_grasp(load_grasp("fig1"), tmp_path / "g.json")
    assert load_grasp(aged(tmp_path / "g.json")).m == load_grasp("fig1").m


def test_a_task(tmp_path: Path) -> None:
    save_task(load_task("scalpel-upholding"), tmp_path / "t.json")
    assert len(load_task(aged(tmp_path / "t.json")).contact_pairs) == len(load_task("scalpel-upholding").contact_pairs)


def test_loads(tmp_path: Path) -> None:
    (tmp_path / "l.json").write_text('{"schema": "handfast/loads/1", "loads": {"up": [0, 0, 1, 0, 0, 0]}}')
    assert load_loads(aged(tmp_path / "l.json")).names == ("up",)


@pytest.mark.parametrize("verdict", ["holds", "slips"])
def test_an_answer_is_verified(tmp_path: Path, verdict: str) -> None:
    answer = check(load_grasp("fig1"), [0, {"holds": 2.0, "slips": 2.5}[verdict], 0, 0, 0, 0])
    assert str(answer.verdict) == verdict
    answer.save(tmp_path / "r.json")
    assert verify(aged(tmp_path / "r.json")).ok


def test_a_synthesis_is_verified(tmp_path: Path) -> None:
    synthesize(load_task("scalpel-upholding"), seed=1).save(tmp_path / "s.json")
    assert verify(aged(tmp_path / "s.json")).ok


def test_digests_are_those_of_the_first_name() -> None:
    data = json.loads((bundled.folder("grasps") / "fig1.json").read_text("utf-8"))
    former = data | {"schema": data["schema"].replace("handfast/", "holdfast/")}
    assert data != former
    assert digest(data) == digest(former)
    assert digest(data) != digest(data | {"schema": "handfast/grasp/2"})
    assert digest(data | {"name": '"schema":"handfast/'}) != digest(data | {"name": '"schema":"holdfast/'})


@pytest.mark.parametrize(
    "schema", ["hold/grasp/1", "Holdfast/grasp/1", "holdfast/holdfast/grasp/1", "holdfast/grasp/9"]
)
def test_other_names_are_none(tmp_path: Path, schema: str) -> None:
    data = json.loads((bundled.folder("grasps") / "fig1.json").read_text("utf-8"))
    (tmp_path / "g.json").write_text(json.dumps(data | {"schema": schema}))
    with pytest.raises(InputError, match=r"schema: input should be 'handfast/grasp/1'"):
        load_grasp(tmp_path / "g.json")
