"""Make the pictures of the bundled tasks, docs/img/task-*.png, from the configurations that the tests keep.

python docs/make_tasks_pictures.py [TASK ...]
"""

from __future__ import annotations

import io
import json
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from handfast.core import bundled
from handfast.core.transforms import quaternion_matrix, transform
from handfast.pictures.depth_buffer import PIXELS_PER_INCH
from handfast.pictures.drawing import picture
from handfast.pictures.task_picture import draw_task
from handfast.synthesis.task import Task
from handfast.synthesis.task_file import load_task

Array = NDArray[np.float64]
IMAGES = Path(__file__).parent / "img"
STORED = Path(__file__).parents[1] / "tests" / "data" / "feasible.json"


@dataclass(frozen=True, eq=False)
class Stored:
    """A stored configuration as `draw_task` takes it."""

    q: Array
    pose: Array
    points: Array
    normals: Array


def stored(task: Task) -> Stored:
    """The configuration that the tests keep of a bundled task."""
    data = json.loads(STORED.read_text())["tasks"][task.name]
    pose = transform(data["position"], quaternion_matrix(data["quaternion"]))
    points, normals = [], []
    for pair, parameters in zip(task.contact_pairs, data["parameters"], strict=True):
        normal = pair.object.normal(*parameters[:2])
        points.append(pose[:3, :3] @ pair.object.at(*parameters[:2]) + pose[:3, 3])
        normals.append(-pose[:3, :3] @ normal / np.linalg.norm(normal))
    return Stored(task.hand.configuration(data["joints"]), pose, np.array(points), np.array(normals))


def small(png: bytes) -> bytes:
    """The picture in 160 colours."""
    data = io.BytesIO()
    image = Image.open(io.BytesIO(png)).convert("RGB")
    image.quantize(160, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(data, "png", optimize=True)
    return data.getvalue()


def main() -> None:
    for name in sys.argv[1:] or bundled.names("tasks"):
        task = load_task(name)
        data = small(picture(draw_task(task, stored(task)), dpi=PIXELS_PER_INCH))
        (IMAGES / f"task-{name}.png").write_bytes(data)
        print(f"task-{name}.png  {len(data)} bytes", flush=True)


if __name__ == "__main__":
    main()
