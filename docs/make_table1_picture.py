"""Draw the eleven hands of the synthesis paper's Table 1, half closed: docs/img/table1.png.

python docs/make_table1_picture.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from handfast import load_hand
from handfast.core.files import write_bytes
from handfast.model.hand.structures import TABLE_1
from handfast.pictures.drawing import INK, picture, solids
from handfast.pictures.scene import Mesh
from handfast.readers.load_hand import TABLE_1_PREFIX

IMAGE = Path(__file__).parent / "img" / "table1.png"
COLUMNS, ROWS = 6, 2
CLOSED = 0.3  # of the range of joints that close
FROM, UP = np.array([0.75, -0.55, 0.35]), np.array([0.0, 0.0, 1.0])  # where the eye is, palm frame


def main() -> None:
    """Make the picture."""
    z = FROM / np.linalg.norm(FROM)
    x = np.cross(UP, z) / np.linalg.norm(np.cross(UP, z))
    V = np.array([x, np.cross(z, x), z])
    figure = Figure(figsize=(9, 3.6))
    for k, (name, design) in enumerate(TABLE_1.items()):
        ax = figure.add_subplot(ROWS, COLUMNS, k + 1)
        hand = load_hand(TABLE_1_PREFIX + name)
        lower, upper = hand.limits.T
        bent = lower + CLOSED * (upper - lower)
        q = np.where(hand.closing > 0, bent, np.clip(0.0, lower, upper))
        meshes = [
            Mesh(*shape.placed(pose).triangles(), "hand")
            for link, pose in zip(hand.links, hand.link_poses(q), strict=True)
            for shape in link.shapes
        ]
        corners = np.vstack(solids(ax, meshes, V))
        middle = (corners[:, :2].min(axis=0) + corners[:, :2].max(axis=0)) / 2
        ax.set_xlim(middle[0] - 0.1, middle[0] + 0.1)
        ax.set_ylim(middle[1] - 0.1, middle[1] + 0.1)
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set_title(f"{name}\n{design.dof} motors", fontsize=8, color=INK)
    figure.subplots_adjust(0.01, 0.01, 0.99, 0.9, 0.02, 0.25)
    write_bytes(IMAGE, picture(figure, "png", dpi=100), force=True)
    print(IMAGE)


if __name__ == "__main__":
    main()
