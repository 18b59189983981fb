"""Draws the two pictures of docs/architecture.md: data's way from file to verdict, and from task to FOUND.

python docs/make_architecture_pictures.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

IMAGES = Path(__file__).parent / "img"
ROOMS = {"in": "#e8e8e8", "ours": "#d6e4f5", "proof": "#d9efd9", "out": "#f6e7c8"}
VERDICT = [
    ("in", "grasp file, hand + object", "readers/grasp_file.py\ngeometry/contacts.py"),
    ("in", "Grasp, load", "model/grasp.py\nstability/problem/loads.py"),
    ("ours", "ScaledProblem and Goal", "stability/problem/scaled_problem.py\nstability/problem/objective.py"),
    ("ours", "Reduced: equations\neliminated", "search/reduced.py"),
    ("ours", "tree of contact states", "search/search.py\nsearch/kernel/tree.py"),
    ("proof", "a witness, proved\nto be near a state", "proofs/existence.py"),
    ("proof", "or a certificate,\nchecked leaf by leaf", "proofs/checker.py\nproofs/leaves.py"),
    ("out", "HOLDS, SLIPS,\nUNDECIDED", "queries/*_query.py"),
]
FOUND = [
    ("in", "task file: hand, regions", "synthesis/task_file.py"),
    ("in", "Task: contact pairs, bounds", "synthesis/task.py"),
    ("ours", "TaskProblem: minimal\ncoordinates", "synthesis/task_problem.py"),
    ("ours", "random starts,\nGauss-Newton", "search/starts.py\nkernel/local_search.py"),
    ("ours", "Krawczyk test in balls", "search/kernel/krawczyk.py"),
    ("ours", "or every box discarded", "search/prover.py\nsearch/boxes.py"),
    ("proof", "existence, checked\nin intervals", "proofs/configurations.py"),
    ("out", "FOUND, NONE,\nUNDECIDED", "synthesis/query.py\nsynthesis_answer.py"),
]


def draw(steps: list[tuple[str, str, str]], name: str) -> None:
    """Steps in two rows of four, each a box with what it is and the files that make it."""
    figure, ax = plt.subplots(figsize=(11, 3.2))
    for k, (room, what, files) in enumerate(steps):
        x, y = 2.8 * (k % 4), -1.7 * (k // 4)
        ax.add_patch(plt.Rectangle((x, y), 2.4, 1.1, facecolor=ROOMS[room], edgecolor="#555555", linewidth=0.8))
        ax.text(x + 1.2, y + 0.76, what, ha="center", va="center", fontsize=8.5, weight="bold")
        ax.text(x + 1.2, y + 0.33, files, ha="center", va="center", fontsize=7, family="monospace")
        if k % 4 < 3:
            ax.annotate("", (x + 2.8, y + 0.55), (x + 2.4, y + 0.55), arrowprops={"arrowstyle": "->"})
        elif k + 1 < len(steps):
            ax.plot([x + 1.2, x + 1.2, 1.2], [0, -0.3, -0.3], color="black", linewidth=1.0)
            ax.annotate("", (1.2, -0.6), (1.2, -0.29), arrowprops={"arrowstyle": "->"})
    ax.set_xlim(-0.1, 10.9)
    ax.set_ylim(-1.8, 1.2)
    ax.axis("off")
    figure.savefig(IMAGES / name, dpi=130, bbox_inches="tight", metadata={"Software": "Handfast"})
    plt.close(figure)


if __name__ == "__main__":
    draw(VERDICT, "architecture-verdict.png")
    draw(FOUND, "architecture-found.png")
