"""State, answers and drawing together, without a page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from handfast.core.errors import InputError
from handfast.pictures.live.live_session import Album, LiveSession
from handfast.readers.grasp_file import save_grasp
from tests.support.viewed import KeptCanvas, jaws, until


@pytest.fixture
def session(tmp_path: Path) -> Iterator[LiveSession]:
    for k in range(2):
        save_grasp(jaws(preload=10.0 * (k + 1)), tmp_path / f"{k}.grasp.json")
    (tmp_path / "2.grasp.json").write_text("{}")
    session = LiveSession(Album.of(tmp_path))
    yield session
    session.close()


def test_every_change_is_answered_and_drawn(session: LiveSession) -> None:
    canvas = KeptCanvas()
    session.change(lambda x: x.with_plane("none").pulled(np.array([0, 0, -8.0])))
    session.start(canvas)

    def drawn(tone: str) -> bool:
        return bool(canvas.drawn) and canvas.drawn[-1][1].tone == tone and canvas.drawn[-1][0] is session.state

    until(lambda: drawn("holds"))
    for size in np.linspace(8.0, 12.0, 30):  # dragged faster than anything is answered
        session.change(lambda x, size=size: x.with_force(size), "tip")
    until(lambda: drawn("slips") and canvas.motion is not None)
    session.moving = False
    until(lambda: canvas.motion is None)
    session.leaf(1)
    until(lambda: len(canvas.stages) == 2 and canvas.drawn[-1][1].tone == "holds")
    session.leaf(2)
    until(lambda: canvas.said)
    assert "2.grasp.json" in canvas.said[0]
    assert session.state.number == 1
    session.leaf(2, 1)  # goes on past what cannot be read
    assert session.state.number == 0


def test_a_fault_is_shown_and_the_next_change_answered(session: LiveSession) -> None:
    canvas = KeptCanvas()
    session.change(lambda x: x.with_plane("none").with_normals(np.pi))  # no such uncertainty
    session.start(canvas)
    until(lambda: canvas.drawn and canvas.drawn[-1][1].headline == "NO ANSWER")
    session.change(lambda x: x.with_normals(0.0))
    until(lambda: canvas.drawn[-1][1].tone == "holds")


def test_a_broken_first_file_does_not_hide_the_others(tmp_path: Path) -> None:
    (tmp_path / "0.grasp.json").write_text("{}")
    with pytest.raises(InputError, match=r"0.grasp.json"):
        LiveSession(Album.of(tmp_path))
    save_grasp(jaws(preload=10.0), tmp_path / "1.grasp.json")
    session, canvas = LiveSession(Album.of(tmp_path)), KeptCanvas()
    session.start(canvas)
    until(lambda: canvas.said and canvas.drawn)
    session.close()
    assert session.state.number == 1
    assert "0.grasp.json" in canvas.said[0]
