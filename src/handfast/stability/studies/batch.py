"""Many questions at once, arrays in and arrays out: `check_many`, `max_many`, `torques_many`.

Questions about one grasp share what belongs to it (`search/load_rows.py`), and the compiled kernel goes from one to the
next by itself (`row_kernel.py`). Grasps with a few questions each are scaled, reduced and judged together with all
others of their shape (`grasp_rows.py`). What holds is judged by the equations, all rows together (`judge.py`).
A row is asked by itself, as `check`, `maximum` and `torques` do it, where its search does not end within a budget,
where its programs break down, where nothing holds and that is to be replayed, or where whole answers are wanted. Where
programs break down in the search of a maximum, too, it is asked again from the states of the nearest directions.

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
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from handfast.core import parallel
from handfast.core.answer import Stop, Verdict
from handfast.core.arrays import Array, Mask
from handfast.core.errors import InputError, kinds_checked, refuse_other_kinds
from handfast.core.parallel import WorkerPool, default_jobs
from handfast.model.grasp import Grasp
from handfast.stability.answers import CheckAnswer, MaxAnswer
from handfast.stability.answers.answer import Answer
from handfast.stability.answers.batch_answer import INTERRUPTED, AnswerRows, BatchAnswer
from handfast.stability.answers.check_query import ask as check
from handfast.stability.answers.check_query import check_along
from handfast.stability.answers.load_path import PathsFromRest, comes_after
from handfast.stability.answers.max_query import Near, largest, largest_along
from handfast.stability.answers.torques_query import ask as torques
from handfast.stability.problem import scaled_problem
from handfast.stability.problem.equivalent_grasp import equivalent_of
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.grasp_rows import GraspRows, shape_of
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.objective import ANY_STATE, LARGEST_MAGNITUDE, SMALLEST_PRELOAD, Effort, Objective
from handfast.stability.problem.scaled_problem import as_direction
from handfast.stability.problem.settings import Loading, Settings
from handfast.stability.search.reduced import Uneven

if TYPE_CHECKING:
    from handfast.stability.studies.row_kernel import RowKernel

OnItem = Callable[[int, int], None]  # done, total
Query = Literal["check", "max", "torques"]
QUESTION_BLOCK = 125  # questions that are answered together: each begins with what those before it showed
NEAREST_ROWS = 3  # answered rows from whose states the search of a row begins
FOLLOWED = 12  # loads that are followed on their paths together
FEW_QUESTIONS = 3  # questions about one grasp up to which it is prepared together with the others of its shape
FORK, FORK_ALONE = 500, 60  # questions from which on processes pay, of the kernel and of those that are asked alone


@dataclass(frozen=True, eq=False, kw_only=True)
class BatchOptions:
    """What all questions about many loads and grasps can be asked with.

    Attributes:
        limits: as in `check`.
        settings: as in `check`; `settings.verify` says whether what slips is replayed by the checker.
        jobs: cores to use; None for all. Answers do not depend on it.
        loading: as in `check`. On paths each load is followed by itself, from a state of the commands alone that is
            found once for up to `FOLLOWED` loads.
    """

    limits: GraspLimits = NO_LIMITS
    settings: Settings = field(default_factory=Settings)
    jobs: int | None = None
    loading: Loading = "together"

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        comes_after(self.loading)


@dataclass(frozen=True, eq=False, kw_only=True)
class RowQuestion(BatchOptions):
    """What is asked of rows; answers: are whole ones wanted? mdp, interval, objective, actuators: of the query."""

    query: Query
    mdp: bool = True
    answers: bool = False
    interval: bool = False
    objective: Effort = "max"
    actuators: Sequence[str] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        comes_after(self.loading, self.mdp, interval=self.interval)
        if self.query == "torques" and self.along_paths:
            right = "ask torques of one load after the other"
            raise InputError(f"least commands of many loads cannot be asked with it; {right}", field="loading")

    @property
    def along_paths(self) -> bool:
        """Do loads come after the commands?"""
        return self.loading != "together"

    def of_rows(self) -> RowQuestion:
        """The same for searches with one thread each: cores are for rows."""
        return replace(self, settings=replace(self.settings, jobs=1))

    def together(self, grasp: Grasp) -> bool:
        """Are rows about a grasp for the kernel?"""
        if self.answers or self.interval or self.query == "torques" or not self.mdp or self.along_paths:
            return False
        return self.query == "check" or bool(grasp.command.any()) or equivalent_of(grasp).is_given

    def shape(self, grasp: Grasp) -> Hashable | None:
        """What grasps have to share so that their rows are for the kernel together; None where that may not be."""
        if self.limits.limits_forces or not self.together(grasp):
            return None
        return shape_of(grasp) if self.query == "check" or grasp.command.any() else None


@kinds_checked
def check_many(
    grasps: Grasp | Sequence[Grasp],
    wrenches: Any,
    *,
    mdp: bool = True,
    answers: bool = False,
    on_progress: OnItem | None = None,
    **options: Any,
) -> BatchAnswer:
    """Which of these disturbances does each grasp resist? `check` for many.

    Args:
        grasps: one, or g of them.
        wrenches: (n, 6) forces [N] and torques [N m], object frame, or (n, 3) forces, asked of every grasp; or
            (g, n, 6), (g, n, 3), own ones for each; or `Loads`.
        mdp: as in `check`.
        answers: keep whole answers, with witness and certificate; each is then asked by itself.
        on_progress: called with (done, total).
        options: of `BatchOptions`, by name: `limits`, `settings`, `jobs`, `loading`.

    Returns:
        Arrays (n,) for one grasp, (g, n) for several. A row whose question is refused has the reason in `error`.

    After Ctrl-C so have those that were not asked.

    Raises:
        InputError: wrenches of another shape; no grasps.
    """
    asked = RowQuestion(query="check", mdp=mdp, answers=answers, **vars(BatchOptions(**options)))
    return _ask(grasps, wrenches, None, asked, on_progress)


@kinds_checked
def max_many(
    grasps: Grasp | Sequence[Grasp],
    directions: Any,
    *,
    base: Any = None,
    interval: bool = False,
    mdp: bool = True,
    answers: bool = False,
    on_progress: OnItem | None = None,
    **options: Any,
) -> BatchAnswer:
    """How large a disturbance along each of these directions does each grasp resist? `maximum` for many.

    Args:
        directions: as `wrenches` of `check_many`.
        base: (6,) or (3,) a constant load, the same for all; or one for each direction, shaped like `directions`.
        interval: show which smaller magnitudes are resisted, too: `BatchAnswer.intervals`. It takes many times as long.
        answers: keep whole answers, with witness and certificate, and replay every bound. Without, upper bounds are
            those of searches that ended as they should, and `verified` is False where a bound stands behind the row.

    The other arguments, what is returned and raised are those of `check_many` and `maximum`.
    """
    shared = vars(BatchOptions(**options))
    asked = RowQuestion(query="max", mdp=mdp, answers=answers, interval=interval, **shared)
    return _ask(grasps, directions, base, asked, on_progress)


def torques_many(
    grasps: Grasp | Sequence[Grasp],
    wrenches: Any,
    *,
    objective: Effort = "max",
    actuators: Sequence[str] | None = None,
    answers: bool = False,
    on_progress: OnItem | None = None,
    **options: Any,
) -> BatchAnswer:
    """The least commands under which each grasp resists each of these disturbances: `torques` for many.

    Each is asked by itself, on all cores: raising commands that are the smallest to the last bit takes another check,
    whose actuators may be others than those of the question before.

    The arguments are those of `torques` and `check_many`.
    """
    shared = vars(BatchOptions(**options))
    asked = RowQuestion(query="torques", objective=objective, actuators=actuators, answers=answers, **shared)
    return _ask(grasps, wrenches, None, asked, on_progress)


# --- from arrays to rows, and back --------------------------------------------------------------


def _ask(
    grasps: Grasp | Sequence[Grasp],
    wrenches: Any,
    base: Any,
    options: RowQuestion,
    on_progress: OnItem | None,
) -> BatchAnswer:
    """All rows, in blocks."""
    each = (grasps,) if isinstance(grasps, Grasp) else tuple(grasps)
    if not each:
        raise InputError("is empty; a grasp is needed", field="grasps")
    field_ = "directions" if options.query == "max" else "wrenches"
    W = as_rows(wrenches, len(each), field_)
    B, options = as_base(base, W), options.of_rows()
    after = comes_after(options.loading, base=base)
    (g, n), done = W.shape[:2], 0
    pieces = _pieces(g, n, FOLLOWED if after else QUESTION_BLOCK)
    many = g * n > (FORK if all(map(options.together, each)) else FORK_ALONE)
    forked = parallel.START == "fork" and (many or options.answers or options.query == "torques")
    jobs = min(options.jobs or default_jobs(), max(len(pieces), 1))
    parts: list[AnswerRows] = []
    with WorkerPool((each, W, B, options), jobs, threads=not forked) as pool:
        try:
            for some in pool.map(_chunk, pieces):
                parts += some
                for part in some:
                    for stop in part["stop"]:
                        done += 1
                        if on_progress:
                            on_progress(done, g * n)
                        if stop == Stop.INTERRUPTED:  # Ctrl-C during a search ends in an answer
                            raise KeyboardInterrupt
        except KeyboardInterrupt:
            left = [piece for chunk in pieces for piece in chunk][len(parts) :]
            parts += [AnswerRows(W[i, a:b], B[i, a:b], INTERRUPTED) for i, a, b in left]
    wanted = W[0] if isinstance(grasps, Grasp) else W
    return BatchAnswer.of(options.query, wanted, parts, answers=options.answers, interval=options.interval)


def is_table(wrench: Any) -> bool:
    """Are there several wrenches?"""
    try:
        return isinstance(wrench, Loads) or np.ndim(wrench) > 1
    except ValueError:  # rows of several lengths
        return True


def as_rows(wrenches: Any, g: int, field_: str) -> Array:
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


def as_base(base: Any, W: Array) -> Array:
    """(g, n, 6) base loads beside directions of that shape: none, one for all, or one for each."""
    if base is None:
        return np.zeros(W.shape)
    one = np.ndim(base) == 1
    return np.broadcast_to(scaled_problem.as_wrench(base, "base") if one else as_rows(base, len(W), "base"), W.shape)


_Piece = tuple[int, int, int]  # rows of one grasp: its number, the first of them, and the one behind the last


def _pieces(g: int, n: int, size: int) -> list[list[_Piece]]:
    """Rows of each of the grasps, those with few rows together, as a worker takes them."""
    out: list[list[_Piece]] = []
    room = 0
    for piece in [(i, a, min(a + size, n)) for i in range(g) for a in range(0, n, size)]:
        if room <= 0:
            out.append([])
            room = size
        out[-1].append(piece)
        room -= piece[2] - piece[1]
    return out


def _chunk(shared: tuple[tuple[Grasp, ...], Array, Array, RowQuestion], pieces: Sequence[_Piece]) -> list[AnswerRows]:
    grasps, W, B, options = shared
    parts = [AnswerRows(W[i, a:b], B[i, a:b]) for i, a, b in pieces]
    chosen = [grasps[i] for i, _, _ in pieces]
    _answer_across(chosen, parts, options)
    return [answer_rows(grasp, part, options) for grasp, part in zip(chosen, parts, strict=True)]


# --- rows of many grasps ------------------------------------------------------------------------


def _answer_across(grasps: Sequence[Grasp], parts: Sequence[AnswerRows], options: RowQuestion) -> None:
    """Answer the rows of grasps that have few of them, those of one shape together, as far as the kernel settles them.

    None knows of another: what is answered of a grasp is the same whichever others there are.
    """
    shapes: dict[Hashable, list[int]] = {}
    for k, (grasp, part) in enumerate(zip(grasps, parts, strict=True)):
        shape = options.shape(grasp) if len(part.wrenches) <= FEW_QUESTIONS else None
        if shape is not None:
            shapes.setdefault(shape, []).append(k)
    for some in shapes.values():
        whole = GraspRows.of([grasps[k] for k in some])
        for row in range(FEW_QUESTIONS):
            there = np.array([_is_plain(parts[k], row, options) for k in some])
            if there.any():
                chosen = [parts[k] for k, is_there in zip(some, there, strict=True) if is_there]
                _ask_across(whole if there.all() else whole.rows(there), chosen, row, options)


def _is_plain(part: AnswerRows, row: int, options: RowQuestion) -> bool:
    """Is there such a row, and is it one that the kernel is asked across grasps?"""
    if row >= len(part.wrenches):
        return False
    of_max = options.query == "max"
    return bool(_sound(part, of_max)[row] and not (of_max and part.base[row].any()))


def _ask_across(grasps: GraspRows, parts: Sequence[AnswerRows], row: int, options: RowQuestion) -> None:
    """One row of each grasp."""
    W, B = (np.array([rows[row] for rows in each]) for each in zip(*((p.wrenches, p.base) for p in parts), strict=True))
    goal = ANY_STATE if options.query == "check" else SMALLEST_PRELOAD
    try:
        found = kernel_of(options.limits).ask(grasps, goal, W, B, options.settings)
    except Uneven as uneven:
        others = [part for part, same in zip(parts, uneven.most, strict=True) if same]
        _ask_across(grasps.rows(uneven.most), others, row, options)
        return
    assert found is not None
    for k in np.flatnonzero(found.rows).tolist():
        for name, values in found.columns.items():
            parts[k][name][row] = values[k]


# --- the rows of one grasp ----------------------------------------------------------------------


def kernel_of(limits: GraspLimits) -> RowKernel:
    """What asks rows; the engine loads when it is asked first."""
    from handfast.stability.studies.row_kernel import RowKernel

    return RowKernel(limits)


def answer_rows(grasp: Grasp, part: AnswerRows, options: RowQuestion, kernel: RowKernel | None = None) -> AnswerRows:
    """The rows about one grasp that have no answer: together where that may be, the rest one by one, up to Ctrl-C.

    kernel: what was prepared for rows about this grasp before.
    """
    left, near = part["stop"] == "", dict[int, Near]()
    if not left.any():
        return part
    for rows, goal in _goals(grasp, part, options) if options.together(grasp) else ():
        rows = rows[left[rows]]
        if len(rows) <= FEW_QUESTIONS and kernel is None:
            continue
        kernel = kernel or kernel_of(options.limits)
        for farther in (True, False):
            W, B = part.wrenches[rows], part.base[rows]
            found = kernel.ask(grasp, goal, W, B, options.settings, farther=farther)
            if found is None:
                break
            for name, values in found.columns.items():
                part[name][rows[found.rows]] = values[found.rows]
            left[rows] = ~found.rows
            if options.query == "max":
                held = np.flatnonzero(found.rows & (found.columns["lower"] > 0))
                near |= {int(rows[k]): (found.states.row(int(k)), float(found.columns["lower"][k])) for k in held}
            rows = rows[found.endless]
    rows = np.flatnonzero(left).tolist()
    paths = kernel.paths if kernel else PathsFromRest(options.limits)
    known = dict.fromkeys(rows, 0)  # states that a row was asked with
    for k, i in enumerate(rows if options.along_paths else [*rows, *reversed(rows), *rows]):
        again = k >= len(rows)
        if again and (part["stop"][i] != Stop.NUMERICAL or known[i] == len(near)):
            continue
        known[i] = len(near) if again else 0
        start = time.monotonic()
        answer: Answer
        try:
            if options.along_paths:
                answer = _followed(grasp, part.wrenches[i], options, paths)
            else:
                answer = _alone(grasp, part, i, options, _nearest(part.wrenches, i, near) if again else ())
        except InputError as error:
            part["error"][i] = str(error)
            continue
        part.put(i, answer, keep=options.answers)
        part["seconds"][i] += time.monotonic() - start
        if isinstance(answer, MaxAnswer) and answer.found is not None and answer.lower > 0:
            near[i] = answer.found.state, answer.lower
        if answer.stop is Stop.INTERRUPTED:
            part["error"][left & (part["stop"] == "") & (part["error"] == "")] = INTERRUPTED
            break
    return part


def _followed(grasp: Grasp, w: Array, options: RowQuestion, paths: PathsFromRest) -> CheckAnswer | MaxAnswer:
    if options.query == "check":
        return paths.answer(check_along, grasp, w, options.settings)
    return paths.answer(largest_along, grasp, as_direction(w), options.settings)


def _nearest(W: Array, i: int, near: dict[int, Near]) -> tuple[Near, ...]:
    """The states of the `NEAREST_ROWS` other rows whose directions are nearest to that of row i."""
    rows = np.array([k for k in near if k != i], dtype=int)
    unit = W / np.linalg.norm(W, axis=1)[:, None].clip(min=1e-300)
    return tuple(near[int(k)] for k in rows[np.argsort(-(unit[rows] @ unit[i]), kind="stable")][:NEAREST_ROWS])


def _goals(grasp: Grasp, part: AnswerRows, options: RowQuestion) -> Iterator[tuple[Any, Objective]]:
    """Rows that are asked in the same way, and how; those that are none of these are refused, or special."""
    W, B = part.wrenches, part.base
    sound = _sound(part, options.query == "max")
    if options.query == "check":
        yield np.flatnonzero(sound), ANY_STATE
        return
    beside = B.any(axis=1)
    commanded = bool(grasp.command.any())
    given = equivalent_of(grasp).is_given
    grows = (commanded or given) and not options.limits.limits_forces
    homogeneous = sound & ~beside if grows else np.zeros(len(W), bool)
    yield np.flatnonzero(homogeneous), SMALLEST_PRELOAD
    yield np.flatnonzero(sound & ~homogeneous & (beside | commanded | given)), LARGEST_MAGNITUDE


def _sound(part: AnswerRows, of_max: bool) -> Mask:
    """(k,) bool: rows of finite numbers that are not too large, and no directions next to zero."""
    with np.errstate(invalid="ignore"):
        largest, base = np.abs(part.wrenches).max(axis=1), np.abs(part.base).max(axis=1)
        sound: Mask = (largest <= scaled_problem.MAX_DISTURBANCE) & (base <= scaled_problem.MAX_DISTURBANCE)
    return sound & (largest >= scaled_problem.MIN_DISTURBANCE) if of_max else sound


def _alone(grasp: Grasp, part: AnswerRows, i: int, options: RowQuestion, near: tuple[Near, ...]) -> Answer:
    """A row by itself; bounds are replayed where whole answers are wanted, verdicts that nothing holds in any case."""
    settings, limits = options.settings, options.limits
    w = part.wrenches[i]
    if options.query == "check":
        return check(grasp, w, mdp=options.mdp, settings=settings, limits=limits)
    if options.query == "torques":
        sought: dict[str, Any] = {"objective": options.objective, "actuators": options.actuators}
        return torques(grasp, w, limits=limits, settings=settings, **sought)
    p = scaled_problem.build(grasp, part.base[i], w, limits=limits, mdp=options.mdp)
    if options.answers or not settings.verify:
        return largest(p, settings, interval=options.interval, near=near)
    quick = largest(p, replace(settings, verify=False), interval=options.interval, near=near)
    return largest(p, settings, interval=options.interval) if quick.verdict is Verdict.SLIPS else quick
