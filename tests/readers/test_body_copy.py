"""Body files that say of an object what a command line said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from handfast import InputError, load_body
from handfast.readers.body_file import save_body_copy


@pytest.mark.parametrize("name", ["flask", "mug"])  # one of a mesh, one of shapes
def test_a_copy_elsewhere_is_the_same_object_with_another_mass(tmp_path: Path, name: str) -> None:
    save_body_copy(name, tmp_path / "deep" / "copy.json", mass=2.0)
    old, new = load_body(name), load_body(tmp_path / "deep" / "copy.json")
    assert (new.mass, new.friction, new.name) == (2.0, old.friction, old.name)
    assert np.allclose(new.vertices, old.vertices)
    assert np.allclose(new.center_of_mass, old.center_of_mass)
    with pytest.raises(InputError, match="exists already"):
        save_body_copy(name, tmp_path / "deep" / "copy.json")


def test_other_kinds_of_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"thing\.sdf: is neither a mesh nor a body file"):
        save_body_copy(tmp_path / "thing.sdf", tmp_path / "copy.json")
