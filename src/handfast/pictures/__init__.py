"""Reports: one self-contained HTML page with the verdict, the pictures and the numbers behind them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handfast.core.errors import kinds_checked

if TYPE_CHECKING:
    from handfast.model.grasp import Grasp
    from handfast.pictures.scene import Mesh
    from handfast.stability.answers.answer import Answer
    from handfast.stability.studies.maps import MapAnswer, SweepAnswer


@dataclass(frozen=True, eq=False)
class Entry:
    """A question and its answer.

    Attributes:
        title: the question in words, the heading.
        answer: of `check`, `maximum`, `torques`, `force_map` or `sweep`.
        eta: uncertainty of the contact normals it was asked with [rad].
        mdp: was the maximum dissipation principle part of the model?
        direction: (6,) of a `maximum`.
        objective: of `torques`.
        limit: radius of a map's picture [N].
        weight: of the object [N], a circle in a map's picture.
    """

    title: str
    answer: Answer | MapAnswer | SweepAnswer
    eta: float = 0.0
    mdp: bool = True
    direction: Sequence[float] | None = None
    objective: str = "max"
    limit: float | None = None
    weight: float | None = None


@kinds_checked
def write_report(
    path: str | Path,
    grasp: Grasp,
    entries: Sequence[Entry],
    *,
    meshes: Sequence[Mesh] = (),
    force: bool = False,
    **parts: Any,
) -> None:
    """Write a page that works offline: no entry is possible, then it shows the grasp alone.

    A view in three dimensions shows the grasp with the forces of each entry, in a browser with WebGL. Still
    pictures show the same; with more than three checks only those of the first that holds.

    Args:
        grasp: the grasp that was asked about.
        entries: questions with answers, in the order of the page.
        meshes: hand and object to draw behind the contacts, see `handfast.pictures.scene.scene_meshes`.
        force: write over a file that exists.
        parts: of the page, by name: `settings`, `notes`, `facts`, `gallery`, see `handfast.pictures.page.render`.

    Raises:
        InputError: the file exists and `force` is not set, or cannot be written.
    """
    from handfast.core.files import write_text
    from handfast.pictures.page import render, shown_loads
    from handfast.pictures.scene import DrawnScene

    scene = DrawnScene.of(grasp, shown_loads(entries), meshes)
    write_text(path, render(scene, entries, **parts), force=force)
