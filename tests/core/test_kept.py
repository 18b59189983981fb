"""Arrays in the user's folder: what is found again, and what is not."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from handfast.core import kept

PIECES = [np.arange(6.0).reshape(2, 3), np.ones((4, 3))]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))
    return tmp_path / "handfast" / "pieces"


def test_what_is_kept_is_found_again(folder: Path) -> None:
    assert kept.recalled("a") is None
    kept.keep("a", PIECES)
    found = kept.recalled("a")
    assert found is not None
    for one, other in zip(found, PIECES, strict=True):
        np.testing.assert_array_equal(one, other)
    assert [p.name for p in folder.iterdir()] == ["a.npz"]


def test_a_name_tells_apart_method_shape_and_numbers() -> None:
    a = np.arange(6.0)
    names = [kept.digest("m", a), kept.digest("n", a), kept.digest("m", a.reshape(2, 3)), kept.digest("m", a + 1)]
    assert len({*names, kept.digest("m", a)}) == 4


@pytest.mark.parametrize("whole", [0.0, 0.5, 0.98])
def test_a_damaged_file_is_not_found(folder: Path, whole: float) -> None:
    kept.keep("a", PIECES)
    data = (folder / "a.npz").read_bytes()
    (folder / "a.npz").write_bytes(data[: int(whole * len(data))])
    assert kept.recalled("a") is None


def test_whichever_byte_is_damaged_it_is_not_found(folder: Path) -> None:
    """Of the archive by itself one bit less makes a list that is shorter by a part, or empty."""
    kept.keep("a", PIECES)
    data = (folder / "a.npz").read_bytes()
    for at in range(len(data)):
        (folder / "a.npz").write_bytes(data[:at] + bytes([data[at] ^ 128]) + data[at + 1 :])
        assert kept.recalled("a") is None


@pytest.mark.skipif(sys.platform == "win32", reason="Windows guards a user's folders by itself")
def test_nothing_is_found_or_kept_where_others_can_write(folder: Path) -> None:
    kept.keep("a", PIECES)
    folder.chmod(0o777)
    kept.keep("b", PIECES)
    assert kept.recalled("a") is None
    assert [p.name for p in folder.iterdir()] == ["a.npz"]


def test_a_folder_that_cannot_be_made_is_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path / "file"))
    kept.keep("a", PIECES)
    assert kept.recalled("a") is None


def test_the_oldest_go(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    monkeypatch.setattr(kept, "MAX_KEPT_FILES", 2)
    folder.mkdir(parents=True)
    (folder / "z.123").touch()  # of a program that was ended
    os.utime(folder / "z.123", (0, 0))
    for when, name in enumerate("abc"):
        kept.keep(name, PIECES)
        os.utime(folder / f"{name}.npz", (when + 1, when + 1))
    kept.keep("d", PIECES)
    assert sorted(p.stem for p in folder.iterdir()) == ["c", "d"]
