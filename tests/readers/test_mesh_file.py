"""Mesh files of several formats read at once, and files that end the process that reads them."""

from __future__ import annotations

import os
import struct
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from handfast.core.errors import InputError
from handfast.core.limited import limited
from handfast.model.mesh_pieces import joined
from handfast.model.shape import volume_and_centroid
from handfast.readers import mesh_file
from handfast.readers.mesh_file import read_mesh, read_meshes


def test_several_files_are_read_as_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = [tmp_path / f"box.{kind}" for kind in ("obj", "stl", "ply", "off")]
    for k, file in enumerate(files):
        trimesh.creation.box((1, 2, 3 + k)).export(file)
    (tmp_path / "box.iv").write_text("#Inventor V2.1 ascii\nCube { width 1 height 2 depth 7 }")
    files.append(tmp_path / "box.iv")
    asked: list[Any] = []
    monkeypatch.setattr(mesh_file, "limited", lambda *given: asked.append(given) or limited(*given))
    together = read_meshes([*files, files[0]])
    assert list(map(len, together.values())) == [1] * 5
    assert len(asked) == 1  # process for all
    for k, file in enumerate(files):
        assert volume_and_centroid(*joined(together[file]))[0] == pytest.approx(6 + 2 * k)
        for (v, f), (w, g) in zip(together[file], read_mesh(file), strict=True):
            assert np.array_equal(v, w)
            assert np.array_equal(f, g)
    assert read_meshes([]) == {}


def test_the_file_that_is_wrong_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good, bad = tmp_path / "a.stl", tmp_path / "b.stl"
    trimesh.creation.box((1, 2, 3)).export(good)
    bad.write_bytes(bytes(80) + struct.pack("<I", 4_000_000_000) + bytes(100))
    with pytest.raises(InputError, match=r"b\.stl: (has no triangles|cannot be read as a mesh)"):
        read_meshes([good, bad])

    usual = mesh_file._loaded_one

    def crashes(library: Any, path: Path) -> Any:
        return os.abort() if path == bad else usual(library, path)

    monkeypatch.setattr(mesh_file, "_loaded_one", crashes)
    with pytest.raises(InputError, match=r"b\.stl: ends its process \(SIGABRT\)"):
        read_meshes([good, bad])


def test_a_pointer_of_git_lfs_and_an_unknown_format_are_told(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:61\nsize 7293684\n")
    with pytest.raises(InputError, match=r"a\.stl: is a Git LFS pointer, not the file itself; `git lfs pull`"):
        read_mesh(tmp_path / "a.stl")
    (tmp_path / "a.dae").write_text("<COLLADA/>")
    with pytest.raises(InputError, match=r"a\.dae: is no mesh file that can be read; known: \.obj, .*; convert it"):
        read_mesh(tmp_path / "a.dae")


def test_a_mesh_that_takes_too_much_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "box.ply"
    trimesh.creation.box((1, 2, 3)).export(file)
    usual = mesh_file._loaded_one

    def takes(library: Any, path: Path) -> Any:
        np.zeros(1 << 27)  # 1 GiB: more than is free inside a process that has run for long
        return usual(library, path)

    monkeypatch.setattr(mesh_file, "_loaded_one", takes)
    assert len(read_mesh(file)) == 1
    monkeypatch.setattr(mesh_file, "limited", partial(limited, memory=1 << 20))
    with pytest.raises(InputError, match=r"box\.ply: takes more than .* GiB of memory"):
        read_mesh(file)


def test_a_face_with_vertex_0_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "m.obj"
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    for face, line in (("f 0 0 0", 5), ("f 1 2 0/1", 5), ("f 1 2 3\nf 1/1 00/2 3/3", 6)):
        file.write_text(corners + face + "\n")
        with pytest.raises(
            InputError, match=rf"m\.obj: has a face with vertex 0 in line {line}; vertices count from 1$"
        ):
            read_mesh(file)
    file.write_text(corners + "vt 0 0\nf 1/1 2/1 3/1\nf -1 -2 -4\nf 1 2 4\n")
    ((_, faces),) = read_mesh(file)
    assert len(faces) == 3


def test_an_index_of_thousands_of_digits_is_refused(tmp_path: Path) -> None:
    """Python converts no more than 4300 digits to a whole number: `ValueError`, which nobody may see."""
    file = tmp_path / "long.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 " + "3" * 5000 + "\n")
    with pytest.raises(InputError, match=r"long\.obj"):
        read_mesh(file)
