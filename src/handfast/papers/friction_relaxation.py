"""The relaxations of Algorithm 1: friction sectors, and the model over them as a mixed-integer program, (9) to (19).

Source: stability paper, sections IV to VI. A sector of level p spans gamma / 2^(p-1) [rad]; its two friction edges have
length l_p, (14) and (16), so that every finer level lies inside the coarser one. Errata: (17) unloads the contact, the
factor of (19) is cos(half the sector angle). Two departures, both because the paper's text asks for a relaxation
that contains every exact solution and its formula does not give one:

- (19) is a lower estimate of |d_t|, used in the equality (4); an exact solution then drops out when
  its true |d_t| is larger. Here |d_t| may lie anywhere between (19) and its upper estimate, the sum
  of edge-length weights (18). `printed_robustness=True` restores the formula as printed.
- The maximum (23) is posed as its homogeneous twin, see `goal`.

Virtual motions are searched up to `MOTION_BOUND`: beyond it a solver's tolerance times the motion is a force, and
coplanar contacts, about whose line the object turns for nothing, would be held by rounding errors. So the bounds of
Algorithm 1 hold for motions up to there only; the engine knows no such end.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from handfast.core.arrays import Array, Indices, Mask
from handfast.papers.mixed_integer import INF, MixedIntegerProgram, Term
from handfast.stability.problem.objective import Objective
from handfast.stability.problem.scaled_problem import ScaledPoint, ScaledProblem

GAMMA = np.pi / 2  # the initial angle between edges
MOTION_BOUND = 1e4  # (scaled) largest virtual motion of a program
ACTIVE = 1e-7  # (scaled) motions and forces below this do not make a sector active
POLYGON_EDGES = 256  # edges of the polygon that stands for the cone when the dissipation principle is left out


@lru_cache(maxsize=256)
def edge_length(p: int, q: int) -> float:
    """l_p = product over r = p .. q+1 of sec(gamma / 2^r): equations (14) for p = 1 and (16)."""
    return float(np.prod([1.0 / np.cos(GAMMA / 2**r) for r in range(p, q + 2)]))


@dataclass(frozen=True, order=True)
class Sector:
    """Angles from `index` to `index + 1`, in steps of gamma / 2^(level - 1)."""

    start: float  # in turns, exact in floating point; sorts sectors around the circle
    level: int

    @property
    def width(self) -> float:
        """In turns."""
        return 0.25 / 2 ** (self.level - 1)

    def halves(self) -> tuple[Sector, Sector]:
        return Sector(self.start, self.level + 1), Sector(self.start + self.width / 2, self.level + 1)


@dataclass(frozen=True, eq=False)
class Edges:
    """The friction edges d_1 .. d_k of one contact and the order in which they are neighbours.

    Attributes:
        D: (2, k) edge vectors, length l_p.
        length: (k,) l_p, the vector f of equation (15).
        midpoint: (k,) cos of half the sector angle, the factor l_{p+1} / l_p of (19), erratum applied.
        chain: indices into the edges in ring order; the first edge stands again at the end where the
            ring closes. Consecutive entries are a sector (or a zero-width step between levels).
        sectors: for each consecutive pair of the chain, the sector it belongs to.
    """

    D: Array
    length: Array
    midpoint: Array
    chain: tuple[int, ...]
    sectors: tuple[Sector, ...]


@dataclass(frozen=True)
class Discretisation:
    """All sectors of one contact, in order; `q` is the finest level of refinement (gamma / 2^q)."""

    q: int
    sectors: tuple[Sector, ...]

    @classmethod
    def coarse(cls, q: int) -> Discretisation:
        """Four sectors."""
        return cls(q, tuple(Sector(0.25 * i, 1) for i in range(4)))

    @classmethod
    def full(cls, q: int) -> Discretisation:
        """Every sector at the finest level: 4 * 2^q of them."""
        n = 4 * 2**q
        return cls(q, tuple(Sector(i / n, q + 1) for i in range(n)))

    def finest(self, sector: Sector) -> bool:
        """Is the sector as narrow as gamma / 2^q?"""
        return sector.level >= self.q + 1

    def refined(self, sector: Sector) -> Discretisation:
        """The sector bisected. Edges that lie between identical ones vanish with the sectors that needed them."""
        others = [s for s in self.sectors if s != sector]
        return Discretisation(self.q, tuple(sorted([*others, *sector.halves()])))

    def edges(self) -> Edges:
        """The edges of all sectors; neighbours of the same level share one."""
        ring: list[tuple[float, int]] = []  # direction and level
        owners: list[Sector] = []
        for s in self.sectors:
            for turn in (s.start, s.start + s.width):
                key = (turn % 1.0, s.level)
                if ring and ring[-1] == key:
                    continue
                if ring:
                    # a zero-width step between two levels belongs to the coarser one, which is the looser
                    step = ring[-1][0] == key[0]
                    owners.append(min(s, owners[-1], key=lambda o: o.level) if step else s)
                ring.append(key)
        keys = {key: i for i, key in enumerate(dict.fromkeys(ring))}
        angle = 2 * np.pi * np.array([k[0] for k in keys])
        length = np.array([edge_length(k[1], self.q) for k in keys])
        midpoint = np.array([np.cos(GAMMA / 2 ** k[1]) for k in keys])
        D = length * np.vstack([np.cos(angle), np.sin(angle)])
        return Edges(D, length, midpoint, tuple(keys[key] for key in ring), tuple(owners))


def polygon() -> Edges:
    angle = 2 * np.pi * np.arange(POLYGON_EDGES) / POLYGON_EDGES
    long = np.full(POLYGON_EDGES, 1.0 / np.cos(np.pi / POLYGON_EDGES))  # circumscribed: contains the cone
    return Edges(long * np.vstack([np.cos(angle), np.sin(angle)]), long, long, (), ())


@dataclass(eq=False)
class Relaxation:
    """The program of one relaxation and where the model's unknowns are in it."""

    program: MixedIntegerProgram
    p: ScaledProblem
    edges: Sequence[Edges]
    still: Mask
    r: Indices
    q: Indices
    cn: Indices
    f: Indices
    coupling: Indices
    beta: list[Indices]
    alpha: list[Indices]
    sigma: int | None

    def read(self, x: Array) -> ScaledPoint:
        """The relaxation's solution in the model's unknowns."""
        c = np.zeros((len(self.cn), 3))
        c[:, 0] = x[self.cn]
        for i, e in enumerate(self.edges):
            c[i, 1:] = e.D @ x[self.beta[i]]
        f = x[self.f]
        for j in np.flatnonzero(self.still):  # (2), left out of the program
            i = int(np.flatnonzero(self.p.R[:, j])[0])
            f[i] = self.p.J[:, j] @ c.reshape(-1) / self.p.R[i, j]
        sigma = float(x[self.sigma]) if self.sigma is not None else 0.0
        return ScaledPoint(x[self.r], x[self.q], c.reshape(-1), f, x[self.coupling], sigma)

    def active(self, x: Array | None) -> list[Sector | None]:
        """Per contact the sector in which friction and motion lie; None if both vanish."""
        assert x is not None
        out: list[Sector | None] = []
        for e, beta, alpha in zip(self.edges, self.beta, self.alpha, strict=True):
            weight = np.zeros(len(e.length))
            for part in (x[alpha], x[beta]):
                if part.sum() > ACTIVE:
                    weight += part / part.sum()
            if not weight.any():
                out.append(None)
                continue
            w = weight[list(e.chain)]
            pairs = w[:-1] + w[1:]
            best = pairs.max()
            # an edge between two sectors belongs to both: take the coarser, which still has to be refined
            candidates = [s for s, value in zip(e.sectors, pairs, strict=True) if value >= best - 1e-6]
            out.append(min(candidates, key=lambda s: s.level))
        return out


def relaxation(p: ScaledProblem, goal: Objective, edges: Sequence[Edges], printed_robustness: bool) -> Relaxation:
    """Equations (1)-(4), (8)-(12), (15), with (17), (19) if eta > 0, as a program with ordered sets."""
    m, l, a, k = p.sizes
    P = MixedIntegerProgram()
    cap = MOTION_BOUND
    if not p.mdp and np.isfinite(p.cn_max):
        cap = 2.0 * p.cn_max  # motions free of consequence only blur the picture of what is wrong
    still = _still(p)
    r, q = P.variables(6, -cap, cap), P.variables(l, -cap, cap)
    for j in np.flatnonzero(still):
        P.lower[q[j]] = P.upper[q[j]] = 0.0
    cn = P.variables(m, 0.0, p.cn_max)
    f = P.variables(a)
    coupling = P.variables(k)
    for i in range(a):
        P.lower[f[i]], P.upper[f[i]] = -p.f_max[i], p.f_max[i]
    beta = [P.variables(len(e.length), 0.0) for e in edges]
    alpha = [P.variables(len(e.length), 0.0) if p.mdp else np.zeros(0, int) for e in edges]

    sigma, w = _objective(P, p, goal), goal.scaled_load(p)
    for row in range(6):  # (1), with c_t = D beta, (9)
        terms: list[Term] = [(cn, p.G[row, 0::3])]
        terms += [(beta[i], p.G[row, 3 * i + 1 : 3 * i + 3] @ edges[i].D) for i in range(m)]
        if sigma is not None and w.w_b[row] != 0:
            terms.append((sigma, w.w_b[row]))
        P.row(terms, -w.w_a[row], -w.w_a[row])
    for j in np.flatnonzero(~still):  # (2)
        terms = [(cn, p.J[0::3, j]), (f, -p.R[:, j])]
        terms += [(beta[i], p.J[3 * i + 1 : 3 * i + 3, j] @ edges[i].D) for i in range(m)]
        if k:
            terms.append((coupling, -p.A[:, j]))
        P.row(terms, 0.0, 0.0)
    for i in range(k):
        P.row([(q, p.A[i])], 0.0, 0.0)

    cos, sin = np.cos(p.limits.eta), np.sin(p.limits.eta)
    for i, e in enumerate(edges):
        motion = [(r, p.G[:, 3 * i : 3 * i + 3].T), (q, -p.J[3 * i : 3 * i + 3])]  # d over (r, q), (3)
        gap = int(P.variables(1, 0.0)[0])  # c_n + d^_n >= 0
        normal = [(cn[i], 1.0), (gap, -1.0), *((v, cos * M[0]) for v, M in motion)]
        if p.mdp:
            for b in (0, 1):  # (10): D alpha = -d_t
                P.row([(alpha[i], e.D[b]), *((v, M[1 + b]) for v, M in motion)], 0.0, 0.0)
            z = P.variables(len(e.chain), 0.0)
            places: list[list[int]] = [[] for _ in e.length]
            for n, edge in enumerate(e.chain):
                places[edge].append(z[n])
            for edge, here in enumerate(places):  # (11), (12)
                P.row([(beta[i][edge], 1.0), (here, -1.0)], -INF, 0.0)
                P.row([(alpha[i][edge], 1.0), (here, -1.0)], -INF, 0.0)
            P.sos2.append(z.tolist())
            slide = int(P.variables(1, 0.0)[0])  # e^T alpha
            P.row([(alpha[i], 1.0), (slide, -1.0)], 0.0, 0.0)
            short = int(P.variables(1, 0.0)[0])  # >= mu c_n - f^T beta, (15)
            P.row([(short, 1.0), (beta[i], e.length), (cn[i], -p.mu[i])], 0.0, INF)
            P.sos1.append([slide, short])
            if sin > 0:  # (17) with |d_t| between (19) and (18)
                speed = int(P.variables(1, 0.0)[0])
                P.row(
                    [(speed, 1.0), (alpha[i], -e.midpoint * e.length)],
                    0.0,
                    0.0 if printed_robustness else INF,
                )
                P.row([(speed, 1.0), (alpha[i], -e.length)], -INF, 0.0)
                normal.append((speed, sin))
        P.row(normal, 0.0, 0.0)
        P.sos1.append([int(cn[i]), gap])  # (4)
        P.row([(beta[i], 1.0), (cn[i], -p.mu[i])], -INF, 0.0)  # (15), both cases

    if not goal.has_scalar and not p.mdp:
        # any solution will do; the one into which the disturbance puts the least work shows best what is wrong
        P.cost |= {int(i): float(force) for i, force in zip(r, p.w0, strict=True) if force}
    _actuators(P, p, goal, q, f, sigma)
    return Relaxation(P, p, edges, still, r, q, cn, f, coupling, beta, alpha, sigma)


def _objective(P: MixedIntegerProgram, p: ScaledProblem, goal: Objective) -> int | None:
    """The scalar of the goal, with its cost and bounds."""
    if not goal.has_scalar:
        return None
    first, last = goal.scalar_range(*goal.search_range(p))
    low = first if goal.maximised or p.f_c.any() else 0.0
    sigma = int(P.variables(1, low, last if goal.maximised else INF)[0])
    P.cost[sigma] = goal.objective(1.0)
    return sigma


def _still(p: ScaledProblem) -> Mask:
    """(l,) bool: joints that cannot move and whose torque one locked actuator takes up, whatever it is.

    Their rows of (2) and the actuator's force are left out of the program and computed afterwards.
    """
    locked = ~p.moves & ~np.isfinite(p.f_max)
    alone = (np.count_nonzero(p.R, axis=0) == 1) & (np.count_nonzero(p.A, axis=0) == 0)
    own = np.count_nonzero(p.R, axis=1) == 1
    return alone & np.array([bool((locked & own)[np.flatnonzero(col)].all()) for col in p.R.T], dtype=bool)


def _actuators(
    P: MixedIntegerProgram, p: ScaledProblem, goal: Objective, q: Indices, f: Indices, sigma: int | None
) -> None:
    """Equation (8) on the actuators."""
    commands: dict[int, int] = {}  # driven actuator: the variable of its command
    for i in range(len(p.R)):
        drive = bool(p.driven[i])
        if not p.moves[i]:
            P.row([(q, p.R[i])], 0.0, 0.0)  # locked
            continue
        t = int(P.variables(1, 0.0)[0])
        P.row([(q, p.R[i]), (t, -1.0)], 0.0, 0.0)
        if drive:
            # commanded with e >= 0 where it moves (f = e); locked, hence free of any command, where not
            e, above, below = (int(v) for v in P.variables(3, 0.0))
            P.row([(f[i], 1.0), (e, -1.0), (above, -1.0), (below, 1.0)], 0.0, 0.0)
            P.sos1.append([t, above])
            P.sos1.append([t, below])
            commands[i] = e
            continue
        slack = int(P.variables(1, 0.0)[0])
        terms: list[Term] = [(f[i], 1.0), (slack, -1.0)]
        if goal.homogeneous:
            assert sigma is not None
            terms.append((sigma, -p.f_c[i]))
            P.row(terms, 0.0, 0.0)
        else:
            P.row(terms, p.f_c[i], p.f_c[i])
        P.sos1.append([t, slack])
    if commands:
        assert sigma is not None
        efforts = [(e, -p.command_units[i]) for i, e in commands.items()]
        if not goal.sums_commands:
            for effort in efforts:
                P.row([(sigma, 1.0), effort], 0.0, INF)
        else:
            P.row([(sigma, 1.0), *efforts], 0.0, INF)
