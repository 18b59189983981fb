"""What `handfast` is asked about one grasp, each question a line on a prepared grasp: `check`, `maximum` and so on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from handfast.core.arrays import Array
from handfast.core.errors import InputError, kinds_checked
from handfast.model.grasp import Grasp
from handfast.stability.answers import CheckAnswer, MaxAnswer, TorquesAnswer
from handfast.stability.problem.grasp_limits import NO_LIMITS, GraspLimits
from handfast.stability.problem.loads import Loads
from handfast.stability.problem.objective import Effort
from handfast.stability.problem.settings import Loading, OnStep, Settings
from handfast.stability.studies.batch import OnItem, is_table
from handfast.stability.studies.hold import HoldAnswer, OnSample
from handfast.stability.studies.maps import MapAnswer, Plane
from handfast.stability.studies.prepared import PreparedGrasp, prepare


@kinds_checked
def check(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    loading: Loading = "together",
    settings: Settings | None = None,
    on_progress: OnStep | None = None,
) -> CheckAnswer:
    """Does the grasp resist a disturbance passively? Stability paper, section VII-A, (20)-(22).

    Args:
        grasp: with the preload in force; an actuator without a command is locked.
        wrench: (6,) force [N] and torque [N m] on the object, object frame, at its origin; three numbers are a
            force. Many are for `check_many`, or for `prepare(grasp).check`.
        limits: uncertainty of the contact normals, largest forces of actuators and at contacts.
        mdp: False leaves out the maximum dissipation principle (the friction of the grasp-force
            literature), for comparison only: it creates energy out of nothing.
        loading: "together" is the paper's question, commands and load at once; "preload-first" asks for a path on which
            the load grows after the commands alone are in balance: `CheckAnswer.path`, docs/load-path.md.
        settings: precision, limits.
        on_progress: called while it runs, with the bounds so far.

    Raises:
        InputError: see `handfast.stability.problem.scaled_problem.build`.
    """
    prepared = prepare(grasp, limits=limits, settings=settings, loading=loading)
    return prepared.check(_one(wrench, "check"), mdp=mdp, on_progress=on_progress)


@kinds_checked
def maximum(
    grasp: Grasp,
    direction: Sequence[float] | Array,
    *,
    base: Sequence[float] | Array | None = None,
    limits: GraspLimits = NO_LIMITS,
    mdp: bool = True,
    interval: bool = False,
    loading: Loading = "together",
    settings: Settings | None = None,
    on_progress: OnStep | None = None,
) -> MaxAnswer:
    """The largest s such that the disturbance base + s direction is resisted: section VII-B, (23)-(25).

    The resisted magnitudes need not be an interval: a smaller one may slip.

    Args:
        direction: (6,) force [N] and torque [N m]; s multiplies it as given, normalise it yourself. Three numbers
            are a force at the object's origin.
        base: (6,) a constant load such as gravity, or (3,) a force.
        interval: show which smaller magnitudes are resisted, too, see `search/interval_search`.
        loading: as of `check`; with "preload-first" the load grows from 0 on a path, `lower` is the last magnitude that
            it reaches and `upper` one that cannot be reached from there. Larger ones may be resisted on other ways.

    The other arguments and errors are those of `check`.
    """
    prepared = prepare(grasp, limits=limits, settings=settings, loading=loading)
    one = _one(direction, "max", "direction")
    return prepared.maximum(one, base=base, mdp=mdp, interval=interval, on_progress=on_progress)


@kinds_checked
def torques(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    objective: Effort = "max",
    actuators: Sequence[str] | None = None,
    limits: GraspLimits = NO_LIMITS,
    loading: Loading = "together",
    settings: Settings | None = None,
    on_progress: OnStep | None = None,
) -> TorquesAnswer:
    """The commands that resist a disturbance with the least effort: section VII-C, (26)-(27).

    An actuator that need not turn is locked and costs nothing, whatever passive load its gearing
    carries: that is (8), tau free where the command is zero.

    Args:
        wrench: (6,) force [N] and torque [N m] on the object, or (3,) a force at its origin.
        objective: "max", the largest single command, or "sum".
        actuators: whose commands are sought, each in the sense in which the grasp commands it, or else positive; by
            default those that the grasp commands now, or all.
            The others stay locked; backdrivable motors stay as the grasp commands them.
        loading: "preload-first" asks for commands that hold on the load's path: some that were found, and a bound that
            is true of all paths, see docs/load-path.md.

    The other arguments and errors are those of `check`.

    Raises:
        InputError: also for an unknown objective or actuator, and for a backdrivable one.
    """
    prepared = prepare(grasp, limits=limits, settings=settings, loading=loading)
    one = _one(wrench, "torques")
    return prepared.torques(one, objective=objective, actuators=actuators, on_progress=on_progress)


@kinds_checked
def hold(
    grasp: Grasp,
    loads: Loads,
    *,
    on_progress: OnSample | None = None,
    **options: Any,
) -> HoldAnswer:
    """One preload that resists every load, each on its own.

    Args:
        on_progress: told in words what is asked next.
        options: of `HoldOptions`, by name: `hold(grasp, loads, margins=True, timeout=10)`.

    The errors are those of `check` and `torques`.
    """
    return _prepared(grasp, options).hold(loads, on_progress=on_progress, **options)


@kinds_checked
def force_map(
    grasp: Grasp,
    plane: Plane = "xy",
    *,
    at: Sequence[float] | Array = (0.0, 0.0, 0.0),
    steps: int = 360,
    interval: bool = False,
    on_progress: OnItem | None = None,
    **options: Any,
) -> MapAnswer:
    """The largest resisted force in every direction of a plane: stability paper, Figs 6, 8 and 10.

    Args:
        plane: of the object frame; directions run from its first axis towards its second.
        at: (3,) [m] the point of the object at which the forces act, object frame: the disturbance is
            (f, at x f). With the centre of mass it is a map of weights, one for every way to hold the object.
        steps: number of directions, evenly spaced.
        interval: show which smaller forces are resisted, too, in every direction; it takes many times as long.
        on_progress: called with (done, total).
        options: of `BatchOptions`, by name: `limits`, `settings`, `jobs`, `loading`. No proof is replayed.

    Ctrl-C returns what was reached.

    Raises:
        InputError: what `maximum` refuses; an unknown plane, no directions, a point that is not three finite numbers.
    """
    how: dict[str, Any] = {"at": at, "steps": steps, "interval": interval, "on_progress": on_progress}
    return _prepared(grasp, options).map(plane, **how, **options)


def _one(wrench: Any, query: str, field: str = "wrench") -> Any:
    """One load, or `InputError` for several."""
    if is_table(wrench):
        raise InputError(f"is several loads; {query}_many takes them, or a grasp that is prepared", field=field)
    return wrench


def _prepared(grasp: Grasp, options: dict[str, Any]) -> PreparedGrasp:
    """The grasp prepared with those of the options that are its own, which are taken out of them."""
    return prepare(grasp, **{name: options.pop(name) for name in ("limits", "settings", "loading") if name in options})
