"""Make the pictures of the documentation with the program itself.

    python docs/make_pictures.py [--only NAME ...] [--numbers FOLDER]

Writes docs/img/*.png. `--only` makes one picture, `--numbers` also keeps the numbers behind the maps and
the sweep as JSON.
"""

from __future__ import annotations

import argparse
import io
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from handfast import Settings, check, force_map, load_grasp, sweep
from handfast.papers.stability_figures import FIGURE_COMMANDS, FORCE_Z, HELD_WRENCH, MOMENT_X, UNHELD, placed
from handfast.pictures.drawing import picture
from handfast.pictures.grasp_picture import draw_grasp
from handfast.pictures.map_picture import draw_map, draw_sweep
from handfast.stability.problem.grasp_limits import GraspLimits
from handfast.stability.problem.witness import Witness

IMAGES = Path(__file__).parent / "img"
STEPS = 48  # directions of a map
ROBUST = float(np.radians(2.5))  # the uncertainty of normals of the paper's maps
PATIENCE = 20.0  # [s] for a direction; what is open then is drawn hatched


def scene(name: str, witness: Witness | None = None, count: int = 3) -> Any:
    """The bundled hand and object of a paper grasp from some sides."""
    grasp, meshes = placed(name)
    return draw_grasp(grasp, witness, meshes, count=count)


def holding(settings: Settings, count: int = 3) -> Any:
    """Fig. 1 under 2.2 N along +y, with the forces that hold it."""
    return scene("fig1", check(load_grasp("fig1"), HELD_WRENCH, settings=settings).witness, count)


def unreal(settings: Settings) -> Any:
    """The same grasp without preload under 1 N, if friction need not oppose the motion."""
    grasp = load_grasp("fig1").with_preload(None)
    return draw_grasp(grasp, check(grasp, UNHELD, mdp=False, settings=settings).witness)


def beside(left: Any, right: Any, height: int) -> bytes:
    """Two figures side by side, scaled to a height in pixels, as PNG."""
    images = [Image.open(io.BytesIO(picture(f, "png", dpi=180))).convert("RGB") for f in (left, right)]
    scaled = [i.resize((round(i.width * height / i.height), height), Image.Resampling.LANCZOS) for i in images]
    both = Image.new("RGB", (sum(i.width for i in scaled), height), "white")
    both.paste(scaled[0], (0, 0))
    both.paste(scaled[1], (scaled[0].width, 0))
    data = io.BytesIO()
    both.save(data, "png", optimize=True)
    return data.getvalue()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--numbers", type=Path)
    asked = parser.parse_args()
    exact, quick = Settings(), Settings(timeout=PATIENCE)

    def force(name: str, eta: float) -> Callable[[], Any]:
        def draw() -> Any:
            answer = force_map(load_grasp(name), "xy", steps=STEPS, limits=GraspLimits(eta=eta), settings=quick)
            keep(f"{name}-{eta:.3f}", answer.to_json())
            return draw_map(answer)

        return draw

    def preloads() -> Any:
        directions = [FORCE_Z, MOMENT_X]
        answer = sweep(
            load_grasp("fig11"), "finger_3_prox", np.linspace(0, 0.1, FIGURE_COMMANDS), directions, settings=quick
        )
        keep("fig11-sweep", answer.to_json())
        return draw_sweep(answer)

    def keep(name: str, numbers: dict[str, Any]) -> None:
        if asked.numbers:
            (asked.numbers / f"{name}.json").write_text(json.dumps(numbers))

    pictures: dict[str, Callable[[], Any]] = {
        "demo": lambda: beside(holding(exact, 1), force("fig1", 0.0)(), 600),
        "fig1-scene": lambda: scene("fig1"),
        "fig7-scene": lambda: scene("fig7"),
        "fig9-scene": lambda: scene("fig9"),
        "fig11-scene": lambda: scene("fig11"),
        "fig1-holds": lambda: holding(exact),
        "fig1-without-dissipation": lambda: unreal(exact),
        "fig1-map": force("fig1", 0.0),
        "fig1-map-robust": force("fig1", ROBUST),
        "fig11-sweep": preloads,
        "fig7-map": force("fig7", 0.0),
        "fig7-map-robust": force("fig7", ROBUST),
        "fig9-map-robust": force("fig9", ROBUST),
    }
    IMAGES.mkdir(exist_ok=True)
    for name, draw in pictures.items():
        if asked.only and name not in asked.only:
            continue
        start = time.monotonic()
        drawn = draw()
        (IMAGES / f"{name}.png").write_bytes(drawn if isinstance(drawn, bytes) else picture(drawn, "png"))
        print(f"{name}.png  {time.monotonic() - start:.1f} s", flush=True)


if __name__ == "__main__":
    main()
