"""Grasps to leaf through."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from handfast.core.errors import InputError
from handfast.pictures.live.live_session import Album
from handfast.readers.grasp_file import save_grasp
from tests.support.viewed import jaws, two_fingers


def test_a_folder_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    for k in (10, 9, 1):
        save_grasp(jaws(preload=float(k)), tmp_path / f"{k}.grasp.json")
    (tmp_path / "plan.json").write_text("{}")
    save_grasp(jaws(), tmp_path / "other.json")  # does not end as the others do
    album = Album.of(tmp_path)
    assert album.names == ("1", "9", "10")
    assert album.read(2).preload["left"] == 10


def test_any_grasp_files_where_none_has_the_ending(tmp_path: Path) -> None:
    save_grasp(two_fingers(), tmp_path / "b.json")
    (tmp_path / "a.json").write_text(json.dumps({"schema": "handfast/grasp/1"}))
    (tmp_path / "c.json").write_text('{"schema": "handfast/body/1"}')
    album = Album.of(str(tmp_path))
    assert album.names == ("a", "b")
    with pytest.raises(InputError, match="contacts"):
        album.read(0)  # told when it is looked at


def test_grasps_and_names() -> None:
    assert len(Album.of([jaws(), two_fingers()])) == 2
    assert Album.of(jaws()).read(0).name == "jaws"
    assert Album.of("fig1").names == ("fig1",)


def test_nothing_to_look_at(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no grasp files"):
        Album.of(tmp_path)
    with pytest.raises(InputError, match="at least one"):
        Album.of([])
    with pytest.raises(InputError, match=r"grasps\[1\]: is str; a grasp is needed"):
        Album.of([jaws(), "fig1"])  # type: ignore[list-item]
    with pytest.raises(InputError, match="nowhere"):
        Album.of("nowhere.json")
