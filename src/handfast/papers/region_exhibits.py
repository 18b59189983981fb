"""The figures and tables of the paper on contact regions: its configurations, polytopes, hands, tasks."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from handfast.core.answer import Reach, uninterrupted
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.hand.structures import TABLE_1
from handfast.papers.canonical_equations import canonical
from handfast.papers.canonical_system import Expanded, Patch
from handfast.papers.exhibits import MakingOptions, TextTable
from handfast.papers.linear_programs import polytopes
from handfast.pictures.drawing import BLUE, INK
from handfast.pictures.hand_facts import facts_of, shown_hand
from handfast.pictures.hand_picture import draw_hand
from handfast.pictures.task_picture import draw_task
from handfast.readers.load_hand import load_hand
from handfast.synthesis.query import synthesize
from handfast.synthesis.task_file import load_task

SCALPEL = "scalpel-incision"
BOX = np.array([[0.2, 0.3], [0.9, 0.8]])  # of x_i and x_j in Fig. 5
BICUBIC = np.array([[0.1, 0.5, 0.3], [0.7, 0.9, 0.2], [0.3, 0.6, 0.8]])  # Bernstein coefficients of f in Fig. 5c


def fig1(options: MakingOptions) -> Figure:
    """A hand on the scalpel: four regions of the one on four of the other."""
    task = load_task(SCALPEL)
    answer = uninterrupted(synthesize(task, timeout=options.timeout))
    if not answer.solutions:
        raise InputError(f"no configuration was found in {options.timeout:g} s", field=SCALPEL)
    return draw_task(task, answer.solutions[0])


def fig5(_: MakingOptions) -> Figure:
    """The triangle about x^2, the tetrahedron about a product, and the hull of control points about a patch."""
    figure = Figure(figsize=(9.6, 3.6))
    (li, lj), (ui, uj) = BOX
    t = np.linspace(0, 1, 40)
    ax: Any = figure.add_subplot(1, 3, 1)
    corners = _vertices(_form([(1, 0)], [], []), np.array([li, 0.0]), np.array([ui, 1.0]))
    ring = corners[ConvexHull(corners).vertices]
    ax.fill(*ring.T, fc=BLUE, alpha=0.3, ec=BLUE)
    x = li + t * (ui - li)
    ax.plot(x, x * x, color=INK)
    ax.set_title("(a) x_k = x_i²", fontsize=10)
    product = _form([], [(2, 0, 1)], [])
    patch = _form([], [], [Patch("(24)", "patch", 2, 0, 1, BICUBIC)])
    for k, (form, title) in enumerate(((product, "(b) x_k = x_i x_j"), (patch, "(c) x_k = f(x_i, x_j)"))):
        space: Any = figure.add_subplot(1, 3, k + 2, projection="3d")
        corners = _vertices(form, np.array([li, lj, -1.0]), np.array([ui, uj, 2.0]))
        for face in ConvexHull(corners).simplices:
            closed = corners[[*face, face[0]]]
            space.plot(*closed.T, color=BLUE, lw=0.8)
        u, v = np.meshgrid(li + t * (ui - li), lj + t * (uj - lj))
        w = u * v if k == 0 else _bernstein(BICUBIC, u, v)
        space.plot_surface(u, v, w, color=INK, alpha=0.35, linewidth=0)
        space.set_title(title, fontsize=10)
    figure.subplots_adjust(0.06, 0.1, 0.97, 0.9, 0.15)
    return figure


def _form(squares: list[tuple[int, int]], products: list[tuple[int, int, int]], patches: list[Patch]) -> Expanded:
    """An expanded system of one form alone."""
    from scipy import sparse

    n = 2 if squares else 3
    names = tuple("ijk"[:n])
    zeros, none = np.zeros(n), np.zeros(0)
    return Expanded(
        names, zeros, zeros + 1, sparse.csr_array((0, n)), none,
        np.array(squares, dtype=np.intp).reshape(-1, 2), np.array(products, dtype=np.intp).reshape(-1, 3),
        tuple(patches), np.zeros(0, dtype=np.intp),
    )  # fmt: skip


def _vertices(form: Expanded, lower: Array, upper: Array) -> Array:
    """(., n) corners of the polytope about a form over a box, from the rows that the solver is given."""
    rows = polytopes(form, lower, upper, 0.0)
    A = rows.A.toarray()
    G = np.vstack([A, -A])
    h = np.concatenate([rows.hi, -rows.lo])
    G, h = G[np.isfinite(h)], h[np.isfinite(h)]
    inside = np.eye(len(lower))[: len(lower) - 1]  # the box of x_i and x_j bounds the patch's hull, too
    G = np.vstack([G, inside, -inside])
    h = np.concatenate([h, upper[:-1], -lower[:-1]])
    found = []
    for chosen in combinations(range(len(h)), len(lower)):
        M = G[list(chosen)]
        if abs(np.linalg.det(M)) > 1e-9:
            x = np.linalg.solve(M, h[list(chosen)])
            if (G @ x <= h + 1e-7).all():
                found.append(x)
    return np.unique(np.round(found, 9), axis=0)


def _bernstein(points: Array, u: Array, v: Array) -> Array:
    from handfast.model.bernstein import evaluate

    flat = [float(evaluate(points[:, :, None], a, b)[0]) for a, b in zip(u.ravel(), v.ravel(), strict=True)]
    return np.array(flat).reshape(u.shape)


def fig6(_: MakingOptions) -> Figure:
    """The Schunk hand with all joints at their reference."""
    hand = load_hand("schunk-sah")
    facts = facts_of(hand)
    return draw_hand(shown_hand(facts, q=np.clip(0.0, *hand.limits.T)))


# --- the tables ---


@dataclass(frozen=True)
class PrintedTask:
    """A column of Table 2: n_v, n_e and d of (26), and seconds to one configuration on 64 cores, sigma = 0.1."""

    n_v: int
    n_e: int
    d: int
    seconds: int


PRINTED_TASKS = {
    "scalpel-upholding": PrintedTask(219, 209, 17, 106),
    "scalpel-handling": PrintedTask(243, 235, 19, 255),
    "scalpel-incision": PrintedTask(331, 324, 18, 418),
    "teapot-lid-lifting": PrintedTask(219, 209, 17, 114),
    "teapot-service": PrintedTask(288, 278, 19, 262),
    "teapot-transportation": PrintedTask(312, 305, 17, 375),
    "guitar-tuning": PrintedTask(219, 209, 17, 68),
    "guitar-playing": PrintedTask(307, 298, 19, 229),
    "guitar-holding": PrintedTask(331, 324, 18, 664),
}
# of the authors' own search
PRINTED_BOXES = {"scalpel-upholding": 2003, "scalpel-handling": 3211, "teapot-service": 1739}


def table1(_: MakingOptions) -> TextTable:
    """Eleven hands: degrees of freedom and the structure of each finger, and what `handfast show` calls them."""
    fingers = ("little", "ring", "middle", "index", "thumb")
    rows = [
        (d.title, str(d.dof), *(d.fingers.get(f, "–") for f in fingers), f"table1:{name}")
        for name, d in TABLE_1.items()
    ]
    note = "Joints in parentheses move as one. Dimensions are nominal: the paper gives none."
    return TextTable(("hand", "DOF", *fingers, "here"), tuple(rows), (note,))


def table2(options: MakingOptions) -> TextTable:
    """Nine tasks: the size of the canonical system beside the paper's, the time to a proved configuration."""
    rows = []
    synthesize(load_task("scalpel-upholding"), timeout=options.timeout)  # loads machine code
    for name, printed in PRINTED_TASKS.items():
        task = load_task(name)
        system = canonical(task, unit=0.001)
        answer = uninterrupted(synthesize(task, timeout=options.timeout))
        took = f"{1e3 * answer.seconds:.0f}" if answer.verdict is Reach.FOUND else str(answer.verdict)
        sizes = f"{system.n_v}, {system.n_e}, {system.d}", f"{printed.n_v}, {printed.n_e}, {printed.d}"
        rows.append((name, str(len(task.contact_pairs)), *sizes, took, str(printed.seconds)))
    heads = ("task", "contacts", "n_v, n_e, d", "paper", "time [ms]", "paper, 64 cores [s]")
    note = "Tasks are rebuilt after the paper's words: the authors' own regions are not published for all of them."
    return TextTable(heads, tuple(rows), (note,))


def table3(_: MakingOptions) -> TextTable:
    """Joints of the Schunk hand: where they are on the link before them [mm], their axes there, their limits."""
    hand = load_hand("schunk-sah")
    rows = []
    for link in hand.links:
        for j in link.joints:
            joint = hand.joints[j]
            at = link.pose[:3, :3] @ joint.anchor + link.pose[:3, 3]
            axis = link.pose[:3, :3] @ joint.axis
            low, high = np.degrees([joint.lower, joint.upper])
            where = ", ".join(f"{1e3 * x:.4g}" for x in at + 0.0)
            along = ", ".join(f"{x:.3g}" for x in np.round(axis, 9) + 0.0)
            rows.append((joint.name, f"({where})", f"({along})", f"{low:.0f}° to {high:.0f}°"))
    heads = ("joint", "point p [mm]", "axis u", "range")
    note = "Frames are those of the bundled file; a universal joint is two rows, whose link between has no solid."
    return TextTable(heads, tuple(rows), (note,))
