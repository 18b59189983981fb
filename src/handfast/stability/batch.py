"""Many questions at once, arrays in and arrays out: `check_many`, `max_many`, `torques_many`.

Questions about one grasp share what belongs to it (`search/template.py`), and the compiled kernel goes from one to the
next by itself (`search/batch_search.py`). What holds is judged by the equations, all rows together (`batch_judge.py`).
A row is asked by itself, as `check`, `maximum` and `torques` do it, where its search does not end within a budget,
where its programs break down, where nothing holds and that is to be replayed, or where whole answers are wanted.

A check is answered without any search where Newton's method arrives at an exact state from rest, or from the states of
the loads nearest to it that were asked before. That is sufficient, since the model asks for the existence of a state: a
state that solves (1) to (8) is a proof whatever it was guessed from. Friction inside the cones that balances the load
would not do, as normal forces are those of springs: c_n = max(0, -d_n) ties every force to a motion.

What lies between loads with witnesses mostly holds by one step of that method. Let states x, x' solve the model under
loads w, w' and the same commands, every contact being open in both, sticking in both or sliding in the same direction
in both, and every actuator turning in both or in neither. Then (1 - s) x + s x' solves it under (1 - s) w + s w' for
0 <= s <= 1: (1) to (3) are linear; where a contact is open or closed in both, so is (4), with d_n >= 0 and c_n >= 0
kept (exact normals); the cone (5) is convex; (7) says c_t = -mu c_n u and d_t = |d_t| u with a fixed u, which is
linear, or d_t = 0; (8) says f = f_c, t >= 0 or t = 0, f >= f_c. And where nothing is commanded and nothing limits
forces, s x solves it under s w for all s >= 0.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from handfast.core import parallel
from handfast.core.answer import Verdict
from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.parallel import WorkerPool, default_jobs
from handfast.model.grasp import Grasp
from handfast.stability import scaled_problem
from handfast.stability.answers import Answer
from handfast.stability.batch_answer import BatchAnswer
from handfast.stability.equivalent_grasp import equivalent_of
from handfast.stability.goal import ANY_STATE, LARGEST, SMALLEST_PRELOAD, Effort, Goal
from handfast.stability.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.loads import Loads
from handfast.stability.queries import CheckAnswer, check, maximum, torques
from handfast.stability.queries.max_query import MaxAnswer
from handfast.stability.row_kernel import RowKernel
from handfast.stability.settings import Settings

OnItem = Callable[[int, int], None]  # done, total
BLOCK = 125  # questions that are answered together: each begins with what those before it showed
FEW = 2  # questions about one grasp from which on it pays to prepare it
FORK = 500  # questions from which on processes pay
COLUMNS = ("lower", "upper", "unbounded", "residual", "verified", "nodes", "seconds")
INTERRUPTED = "was not asked: Ctrl-C came first"
NUMERIC = {"unbounded": np.bool_, "verified": np.bool_, "nodes": np.int64}


@dataclass(frozen=True, eq=False)
class BatchOptions:
    """What all questions share."""

    query: Literal["check", "max", "torques"]
    limits: GraspLimits = NO_LIMITS
    mdp: bool = True
    settings: Settings = field(default_factory=Settings)
    objective: Effort = "max"
    actuators: Sequence[str] | None = None
    answers: bool = False


class _RowBlock(dict[str, Any]):
    """The columns of some rows about one grasp, and their whole answers."""

    def __init__(self, wrenches: Array, base: Array, error: str = "") -> None:
        k = len(wrenches)
        super().__init__({name: np.zeros(k, NUMERIC.get(name, np.float64)) for name in COLUMNS})
        self["lower"][:] = self["upper"][:] = self["residual"][:] = np.nan
        self["verdict"], self["stop"], self["error"] = np.zeros(k, "U9"), np.zeros(k, "U11"), np.zeros(k, object)
        self["error"][:] = error
        self.wrenches, self.base = wrenches, base
        self.answers: list[Answer | None] = [None] * k

    def put(self, i: int, answer: Answer) -> None:
        """A whole answer."""
        self["verdict"][i], self["nodes"][i], self["verified"][i] = str(answer.verdict), answer.nodes, answer.verified
        self["stop"][i], self["seconds"][i] = str(answer.stop), answer.seconds
        if answer.found:
            self["residual"][i] = answer.found.residuals.worst
        if not isinstance(answer, CheckAnswer):
            self["lower"][i], self["upper"][i] = answer.lower, answer.upper  # type: ignore[attr-defined]
        if isinstance(answer, MaxAnswer):
            self["unbounded"][i] = answer.unbounded


def check_many(
    grasps: Grasp | Sequence[Grasp],
    wrenches: Any,
    *,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    settings: Settings | None = None,
    jobs: int | None = None,
    answers: bool = False,
    on_item: OnItem | None = None,
) -> BatchAnswer:
    """Which of these disturbances does each grasp resist? `check` for many.

    Args:
        grasps: one, or g of them.
        wrenches: (n, 6) forces [N] and torques [N m], object frame, or (n, 3) forces, asked of every grasp; or
            (g, n, 6), (g, n, 3), own ones for each; or `Loads`.
        jobs: cores to use; by default all. Answers do not depend on it.
        answers: keep whole answers, with witness and certificate; each is then asked by itself.
        on_item: called with (done, total).

    The other arguments are those of `check`; `settings.verify` says whether what slips is replayed by the checker.

    Returns:
        Arrays (n,) for one grasp, (g, n) for several. A row whose question is refused has the reason in `error`.

    After Ctrl-C so have those that were not asked.

    Raises:
        InputError: wrenches of another shape; no grasps.
    """
    options = BatchOptions("check", limits, mdp, settings or Settings(), answers=answers)
    return _ask(grasps, wrenches, None, options, jobs, on_item)


def max_many(
    grasps: Grasp | Sequence[Grasp],
    directions: Any,
    *,
    base: Any = None,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    settings: Settings | None = None,
    jobs: int | None = None,
    answers: bool = False,
    on_item: OnItem | None = None,
) -> BatchAnswer:
    """How large a disturbance along each of these directions does each grasp resist? `maximum` for many.

    Args:
        directions: as `wrenches` of `check_many`.
        base: (6,) or (3,) a constant load, the same for all; or one for each direction, shaped like `directions`.
        answers: keep whole answers, with witness and certificate, and replay every bound. Without, upper bounds are
            those of searches that ended as they should, and `verified` is False where a bound stands behind the row.

    The other arguments, what is returned and raised are those of `check_many` and `maximum`.
    """
    options = BatchOptions("max", limits, mdp, settings or Settings(), answers=answers)
    return _ask(grasps, directions, np.zeros(6) if base is None else base, options, jobs, on_item)


def torques_many(
    grasps: Grasp | Sequence[Grasp],
    wrenches: Any,
    *,
    objective: Effort = "max",
    actuators: Sequence[str] | None = None,
    limits: GraspLimits = NO_LIMITS,
    settings: Settings | None = None,
    jobs: int | None = None,
    answers: bool = False,
    on_item: OnItem | None = None,
) -> BatchAnswer:
    """The least commands under which each grasp resists each of these disturbances: `torques` for many.

    Each is asked by itself, on all cores: raising commands that are the smallest to the last bit takes another check,
    whose actuators may be others than those of the question before.

    The arguments are those of `torques` and `check_many`.
    """
    options = BatchOptions("torques", limits, True, settings or Settings(), objective, actuators, answers)
    return _ask(grasps, wrenches, None, options, jobs, on_item)


# --- from arrays to rows, and back --------------------------------------------------------------


def _ask(
    grasps: Grasp | Sequence[Grasp],
    wrenches: Any,
    base: Any,
    options: BatchOptions,
    jobs: int | None,
    on_item: OnItem | None,
) -> BatchAnswer:
    """All rows, in blocks."""
    each = (grasps,) if isinstance(grasps, Grasp) else tuple(grasps)
    if not each:
        raise InputError("is empty; a grasp is needed", field="grasps")
    field_ = "directions" if options.query == "max" else "wrenches"
    W = _table(wrenches, len(each), field_)
    B = np.zeros(W.shape) if base is None else np.broadcast_to(_base(base, len(each)), W.shape)
    g, n = W.shape[:2]
    pieces = [(i, a, min(a + BLOCK, n)) for i in range(g) for a in range(0, n, BLOCK)]
    total, done = g * n, 0
    options = replace(options, settings=replace(options.settings, workers=1))  # cores are for rows
    forked = parallel.START == "fork" and (total > FORK or options.query == "torques" or options.answers)
    parts: list[_RowBlock] = []
    jobs = min(jobs or default_jobs(), max(len(_chunks(pieces)), 1))
    with WorkerPool((each, W, B, options), jobs, threads=not forked) as pool:
        try:
            for some in pool.map(_chunk, _chunks(pieces)):
                parts += some
                done += sum(len(part.wrenches) for part in some)
                if on_item:
                    on_item(done, total)
        except KeyboardInterrupt:
            parts += [_RowBlock(W[i, a:b], B[i, a:b], INTERRUPTED) for i, a, b in pieces[len(parts) :]]
    shape = (n,) if isinstance(grasps, Grasp) else (g, n)
    return _answered(options, W, parts, shape)


def _answered(options: BatchOptions, W: Array, parts: list[_RowBlock], shape: tuple[int, ...]) -> BatchAnswer:
    """The columns of all parts in this shape."""

    def whole(name: str) -> Any:
        return np.concatenate([part[name] for part in parts]).reshape(shape) if parts else np.zeros(shape)

    answers = tuple(a for part in parts for a in part.answers) if options.answers else None
    attained = None
    if answers is not None and options.query == "max":
        attained = np.array([isinstance(a, MaxAnswer) and a.attained for a in answers], bool).reshape(shape)
    columns = {name: whole(name) for name in (*COLUMNS, "verdict", "stop", "error")}
    return BatchAnswer(options.query, W.reshape(*shape, 6), answers=answers, attained=attained, **columns)


def _table(wrenches: Any, g: int, field_: str) -> Array:
    """(g, n, 6) of whatever shape was given; nothing is said of its numbers yet."""
    needed = f"(n, 6) or (n, 3) for all grasps, ({g}, n, 6) or ({g}, n, 3) with own ones for each"
    try:
        W = np.array(wrenches.wrenches if isinstance(wrenches, Loads) else wrenches, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"must be numbers, {needed}", field=field_) from None
    W = W[None] if W.ndim == 1 else W
    if W.ndim not in (2, 3) or W.shape[-1] not in (3, 6) or (W.ndim == 3 and len(W) != g):
        raise InputError(f"has shape {W.shape}; {needed}", field=field_)
    if W.shape[-1] == 3:
        W = np.concatenate([W, np.zeros(W.shape)], axis=-1)
    return np.ascontiguousarray(np.broadcast_to(W, (g, *W.shape[-2:])))


def _base(base: Any, g: int) -> Array:
    return scaled_problem.as_wrench(base, "base") if np.ndim(base) == 1 else _table(base, g, "base")


def _chunks(pieces: list[tuple[int, int, int]]) -> list[list[tuple[int, int, int]]]:
    """Pieces of grasps with few rows together, as a worker takes them."""
    out: list[list[tuple[int, int, int]]] = []
    size = BLOCK
    for piece in pieces:
        if size >= BLOCK:
            out.append([])
            size = 0
        out[-1].append(piece)
        size += piece[2] - piece[1]
    return out


def _chunk(
    shared: tuple[tuple[Grasp, ...], Array, Array, BatchOptions], pieces: Sequence[tuple[int, int, int]]
) -> list[_RowBlock]:
    grasps, W, B, options = shared
    return [_part(grasps[i], W[i, a:b], B[i, a:b], options) for i, a, b in pieces]


# --- the rows of one grasp ----------------------------------------------------------------------


def _part(
    grasp: Grasp, wrenches: Array, base: Array, options: BatchOptions, kernel: RowKernel | None = None
) -> _RowBlock:
    """Some rows about one grasp: together where that may be, the rest one by one.

    kernel: what was prepared for rows about this grasp before.
    """
    part = _RowBlock(wrenches, base)
    left = np.ones(len(wrenches), bool)
    if not options.answers and options.query != "torques" and options.mdp and options.settings.method == "engine":
        for rows, goal in _goals(grasp, part, options):
            if len(rows) < FEW and kernel is None:
                continue
            kernel = kernel or RowKernel(grasp, options.limits)
            found = kernel.ask(goal, part.wrenches[rows], part.base[rows], options.settings)
            if found is None:
                continue
            columns, settled = found
            for name, values in columns.items():
                part[name][rows[settled]] = values[settled]
            left[rows] = ~settled
    for i in np.flatnonzero(left):
        start = time.monotonic()
        try:
            answer = _alone(grasp, part, int(i), options)
        except InputError as error:
            part["error"][i] = str(error)
            continue
        part.put(int(i), answer)
        part["seconds"][i] = time.monotonic() - start
        part.answers[i] = answer if options.answers else None
    return part


def _goals(grasp: Grasp, part: _RowBlock, options: BatchOptions) -> Iterator[tuple[Any, Goal]]:
    """Rows that are asked in the same way, and how; those that are none of these are refused, or special."""
    W, B = part.wrenches, part.base
    with np.errstate(invalid="ignore"):
        sound = (np.abs(W).max(axis=1) <= scaled_problem.MOST) & (np.abs(B).max(axis=1) <= scaled_problem.MOST)
    if options.query == "check":
        yield np.flatnonzero(sound), ANY_STATE
        return
    sound &= np.abs(W).max(axis=1) >= scaled_problem.LEAST
    beside = B.any(axis=1)
    commanded = bool(grasp.command.any())
    given = equivalent_of(grasp).is_given
    grows = (commanded or given) and not options.limits.limits_forces
    homogeneous = sound & ~beside if grows else np.zeros(len(W), bool)
    yield np.flatnonzero(homogeneous), SMALLEST_PRELOAD
    yield np.flatnonzero(sound & ~homogeneous & (beside | commanded | given)), LARGEST


class GraspBatch:
    """`check_many` and `max_many` of one grasp in several calls, for which what belongs to the grasp is made once.

    Attributes:
        grasp: with the preload in force.
    """

    def __init__(self, grasp: Grasp, *, limits: GraspLimits = NO_LIMITS) -> None:
        self.grasp = grasp
        self._options = BatchOptions("check", limits)
        self._kernel = RowKernel(grasp, self._options.limits)

    def checks(self, wrenches: Any, settings: Settings) -> BatchAnswer:
        """Which of these disturbances (n, 6) or (n, 3) are resisted?"""
        return self._asked(_table(wrenches, 1, "wrenches")[0], replace(self._options, settings=settings))

    def maxima(self, directions: Any, settings: Settings) -> BatchAnswer:
        """How large a disturbance along each of these directions (n, 6) or (n, 3) is resisted?"""
        options = replace(self._options, query="max", settings=settings)
        return self._asked(_table(directions, 1, "directions")[0], options)

    def _asked(self, W: Array, options: BatchOptions) -> BatchAnswer:
        B, options = np.zeros(W.shape), replace(options, settings=replace(options.settings, workers=1))
        try:
            part = _part(self.grasp, W, B, options, self._kernel)
        except KeyboardInterrupt:
            part = _RowBlock(W, B, INTERRUPTED)
        return _answered(options, W, [part], (len(W),))


def _alone(grasp: Grasp, part: _RowBlock, i: int, options: BatchOptions) -> Answer:
    """A row by itself; bounds are replayed where whole answers are wanted, verdicts that nothing holds in any case."""
    settings, limits = options.settings, options.limits
    w = part.wrenches[i]
    if options.query == "check":
        return check(grasp, w, mdp=options.mdp, settings=settings, limits=limits)
    if options.query == "torques":
        sought: dict[str, Any] = {"objective": options.objective, "actuators": options.actuators}
        return torques(grasp, w, limits=limits, settings=settings, **sought)
    ask: dict[str, Any] = {"base": part.base[i], "mdp": options.mdp, "limits": limits}
    if options.answers or not settings.verify:
        return maximum(grasp, w, settings=settings, **ask)
    quick = maximum(grasp, w, settings=replace(settings, verify=False), **ask)
    return maximum(grasp, w, settings=settings, **ask) if quick.verdict is Verdict.SLIPS else quick
