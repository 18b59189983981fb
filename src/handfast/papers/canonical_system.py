"""The canonical system of a task: named variables with boxes, equations by the paper's numbers, both forms.

Source: synthesis paper, 3.1 to 3.5 and 4.1. The original system Phi(q) = 0 (26) has n_v variables and n_e
equations, each either a polynomial of degree two at most or a patch x_k = f(x_i, x_j). The expanded one (29)
has a new variable for every square (27) and product (28), so that all polynomials become linear equations
Lambda and what is left are the forms Psi: x_k = x_i^2 (30), x_k = x_i x_j (31), x_k = f(x_i, x_j) (32).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse

from handfast.core.arrays import Array, Indices
from handfast.model.region import evaluate
from handfast.papers.kinematic_loops import Angle, Kind, Loops
from handfast.papers.patch_form import PatchForm
from handfast.synthesis.task import Task

Polynomial = dict[tuple[int, ...], float]  # (): constant, (i,): of q_i, (i, j) with i <= j: of q_i q_j


def monomial(i: int | np.intp, j: int | np.intp, value: float = 1.0) -> Polynomial:
    """value q_i q_j."""
    return {(min(int(i), int(j)), max(int(i), int(j))): float(value)}


def scaled(p: Polynomial, value: float) -> Polynomial:
    """value p."""
    return {m: value * v for m, v in p.items()}


def total(*terms: Polynomial) -> Polynomial:
    """Their sum."""
    out: Polynomial = {}
    for term in terms:
        for m, v in term.items():
            out[m] = out.get(m, 0.0) + float(v)
    return out


def multiplied(p: Polynomial, q: Polynomial) -> Polynomial:
    """Their product; each of degree one at most."""
    return total(*({tuple(sorted(m + n)): v * w} for m, v in p.items() for n, w in q.items()))


@dataclass(frozen=True, eq=False)
class Quadratic:
    """0 = the polynomial.

    Attributes:
        number: of the equation in the paper, "(8)"; "coupling" has none there.
        of: what it is about: a link, a joint, a contact.
        terms: see `Polynomial`.
    """

    number: str
    of: str
    terms: Polynomial


@dataclass(frozen=True, eq=False)
class Patch:
    """q_k = f(q_i, q_j) for q_i, q_j in [0, 1].

    Attributes:
        number, of: see `Quadratic`.
        k, i, j: variables.
        points: (M+1, N+1) Bernstein coefficients of f.
    """

    number: str
    of: str
    k: int
    i: int
    j: int
    points: Array


class Side(NamedTuple):
    """Variables of one region of a contact: h or o, m or n, the unit normal, mu or nu, u and v or s and t."""

    point: Indices
    normal: Indices
    unit: Indices
    norm: int
    parameters: tuple[int, int]
    body: int
    form: PatchForm


class Limit(NamedTuple):
    """Variables of one joint angle with limits: a, b and their cosine c, with the bodies they are fixed to."""

    angle: Angle
    parent: int
    child: int
    a: Indices
    b: Indices
    c: int


@dataclass(frozen=True, eq=False)
class VariableLayout:
    """Where things are in q: positions (L, 3), axes (L, 3, 3) with axes[l, i, k] component i of column k of R_l.

    Links are the bodies of the loops, palm first, and the object last.
    """

    links: tuple[str, ...]
    position: Indices
    axes: Indices
    limits: tuple[Limit, ...]
    slides: tuple[tuple[int, int], ...]  # joint, variable
    sides: tuple[tuple[Side, Side], ...]  # per contact: hand, object


@dataclass(frozen=True, eq=False)
class Expanded:
    """The system (29) over x: the variables q first, then one per monomial.

    Attributes:
        names: n_x.
        lower, upper: (n_x,) the initial box.
        A, b: Lambda: A x = b, sparse (rows, n_x) and (rows,).
        squares: (., 2) of (k, i): x_k = x_i^2 (30).
        products: (., 3) of (k, i, j): x_k = x_i x_j (31).
        patches: x_k = f(x_i, x_j) (32).
        rows: indices in `Canonical.equations` of the rows of A.
    """

    names: tuple[str, ...]
    lower: Array
    upper: Array
    A: sparse.csr_array
    b: Array
    squares: Indices
    products: Indices
    patches: tuple[Patch, ...]
    rows: Indices

    @property
    def n(self) -> int:
        """n_x."""
        return len(self.names)

    def lift(self, q: Array) -> Array:
        """(n_x,) the x of a q (n_v,)."""
        x = np.zeros(self.n)
        x[: len(q)] = q
        x[self.squares[:, 0]] = q[self.squares[:, 1]] ** 2
        x[self.products[:, 0]] = q[self.products[:, 1]] * q[self.products[:, 2]]
        return x

    def linear(self, x: Array) -> Array:
        """(rows,) A x - b."""
        return self.A @ x - self.b

    def forms(self, x: Array) -> Array:
        """(n_psi,) left minus right hand sides of all Psi: squares, products, patches."""
        (k, i), (kk, ii, jj) = self.squares.T, self.products.T
        patches = [x[p.k] - float(evaluate(p.points[:, :, None], x[p.i], x[p.j])[0]) for p in self.patches]
        return np.concatenate([x[k] - x[i] ** 2, x[kk] - x[ii] * x[jj], patches])


@dataclass(frozen=True, eq=False)
class Canonical:
    """The original system (26) of a task, made by `canonical_equations.canonical`.

    Attributes:
        task: as given.
        unit: [m] lengths are counted in it.
        names: n_v.
        lower, upper: (n_v,) the initial box: every solution lies in it.
        equations: n_e.
        redundant: equations that do not lower the dimension of the solution set: one per revolute and
            cylindrical joint, three per prismatic joint (9), one per contact (16).
        loops: bodies and joints.
        layout: where things are in q.
    """

    task: Task
    unit: float
    names: tuple[str, ...]
    lower: Array
    upper: Array
    equations: tuple[Quadratic | Patch, ...]
    redundant: int
    loops: Loops
    layout: VariableLayout

    @property
    def n_v(self) -> int:
        """Number of variables."""
        return len(self.names)

    @property
    def n_e(self) -> int:
        """Number of equations."""
        return len(self.equations)

    @property
    def d(self) -> int:
        """Predicted dimension of the solution set (5.2)."""
        return self.n_v - self.n_e + self.redundant

    @cached_property
    def expanded(self) -> Expanded:
        """The system (29)."""
        names, lower, upper = list(self.names), [*self.lower], [*self.upper]
        found: dict[tuple[int, int], int] = {}
        entries: list[tuple[int, int, float]] = []
        b: list[float] = []
        rows: list[int] = []
        for e, equation in enumerate(self.equations):
            if isinstance(equation, Patch):
                continue
            for monomial, value in equation.terms.items():
                if len(monomial) == 2:
                    i, j = monomial
                    if (i, j) not in found:
                        found[i, j] = len(names)
                        names.append(f"{names[i]}^2" if i == j else f"{names[i]}*{names[j]}")
                        low, high = _product(lower[i], upper[i], lower[j], upper[j], i == j)
                        lower.append(low)
                        upper.append(high)
                    entries.append((len(rows), found[i, j], value))
                elif monomial:
                    entries.append((len(rows), monomial[0], value))
            b.append(-equation.terms.get((), 0.0))
            rows.append(e)
        r, c, values = zip(*entries, strict=True)
        A = sparse.csr_array((values, (r, c)), shape=(len(rows), len(names)))
        squares = [(k, i) for (i, j), k in found.items() if i == j]
        products = [(k, i, j) for (i, j), k in found.items() if i != j]
        return Expanded(
            tuple(names),
            np.array(lower),
            np.array(upper),
            A,
            np.array(b),
            np.array(squares, dtype=np.intp).reshape(-1, 2),
            np.array(products, dtype=np.intp).reshape(-1, 3),
            tuple(e for e in self.equations if isinstance(e, Patch)),
            np.array(rows, dtype=np.intp),
        )

    def residual(self, q: Array) -> Array:
        """(n_e,) left minus right hand sides of the original equations at a point (n_v,)."""
        x = self.expanded
        out = np.empty(self.n_e)
        out[x.rows] = x.linear(x.lift(q))
        patches = [e for e, equation in enumerate(self.equations) if isinstance(equation, Patch)]
        forms = x.forms(x.lift(q))
        out[patches] = forms[len(forms) - len(patches) :]
        return out

    @cached_property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Indices of the equations by number, in the paper's order, couplings last."""
        found: dict[str, list[int]] = {}
        for e, equation in enumerate(self.equations):
            found.setdefault(equation.number, []).append(e)
        order = sorted(found, key=lambda n: (n[0] != "(", len(n), n))
        return {number: tuple(found[number]) for number in order}

    def write(self, e: int) -> str:
        """An equation for reading: "(13) l: 0 = +1 c[palm].x -1 a[l].x"."""
        equation, names = self.equations[e], self.names
        if isinstance(equation, Patch):
            degree = "x".join(str(n - 1) for n in equation.points.shape)
            right = f"f({names[equation.i]}, {names[equation.j]}) of degree {degree}"
            return f"{equation.number} {equation.of}: {names[equation.k]} = {right}"
        terms = [f"{v:+.6g}" + "".join(f" {names[i]}" for i in m) for m, v in equation.terms.items()]
        return f"{equation.number} {equation.of}: 0 = {' '.join(terms)}"

    def outside(self, q: Array) -> Array:
        """(n_v,) by how much each variable lies outside of its box; 0 within."""
        return np.maximum(0.0, np.maximum(self.lower - q, q - self.upper))

    def describe(self) -> str:
        """The sizes, what they are made of, and the bodies, joints and contacts, for reading."""
        x, at = self.expanded, self.layout
        variables = {
            f"poses of {len(at.links)} links": 12 * len(at.links),
            f"{len(at.limits)} joint angles": 7 * len(at.limits),
            f"{len(at.slides)} slides": len(at.slides),
            f"{len(at.sides)} contacts": 24 * len(at.sides),
        }
        lines = [
            f"canonical system{' of ' + self.task.name if self.task.name else ''}, lengths in units of {self.unit:g} m",
            f"n_v = {self.n_v}: " + ", ".join(f"{n} {what}" for what, n in variables.items() if n),
            f"n_e = {self.n_e}: " + ", ".join(f"{n} x {len(e)}" for n, e in self.groups.items()),
            f"d = {self.n_v} - {self.n_e} + {self.redundant} = {self.d}",
            f"expanded: n_x = {x.n}, Lambda {len(x.b)} linear equations, Psi {len(x.squares)} squares (30), "
            f"{len(x.products)} products (31), {len(x.patches)} patches (32)",
            "links: " + ", ".join(at.links),
        ]
        counts = {kind: self.loops.count(kind) for kind in Kind}
        lines.append("joints: " + ", ".join(f"{n} {kind}" for kind, n in counts.items() if n))
        names = self.task.hand.joint_names
        for a in self.loops.assemblies:
            joints = " + ".join(names[m.joint] for m in a.motions)
            lines.append(f"  {a.kind}: {joints}, {at.links[a.parent]} to {at.links[a.child]}")
        for j, k, ratio, offset in self.loops.coupled:
            shift = f" {offset:+g}" if offset else ""
            lines.append(f"  coupling: {names[j]} = {ratio:g} {names[k]}{shift}")
        for n, (hand, obj) in enumerate(at.sides):
            what = (f"{side.form.name} on {at.links[side.body]}" for side in (hand, obj))
            lines.append(f"  contact {n}: {', '.join(what)}")
        return "\n".join(lines)


def _product(a: float, b: float, c: float, d: float, square: bool) -> tuple[float, float]:
    """Bounds of [a, b] [c, d], or of the square of [a, b], rounded outwards."""
    ends = [a * c, a * d, b * c, b * d]
    low = 0.0 if square and a <= 0 <= b else min(a * a, b * b) if square else min(ends)
    return float(np.nextafter(low, -np.inf)) if low else 0.0, float(np.nextafter(max(ends), np.inf))
