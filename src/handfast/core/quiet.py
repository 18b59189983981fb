"""Silence of mujoco, which would write its warnings to standard error and to a file in the current folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quiet() -> Iterator[None]:
    """Without warnings of mujoco: what is wrong with a model is found by those who read it."""
    import mujoco  # slow to import

    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)
