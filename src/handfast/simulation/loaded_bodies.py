"""A load put on the hand and the object behind a grasp, in the same engine and the same way as on its twin."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from handfast.core.arrays import Array
from handfast.model.grasp import Grasp
from handfast.simulation.bodies import Bodies, BodyStepper, bodies_of, build_bodies
from handfast.simulation.loaded_twin import Loading, checked_times, checked_wrench, force_unit
from handfast.simulation.recording import HOLD, PRELOAD, Recording
from handfast.simulation.result import SimulationResult
from handfast.simulation.twin import STEP, STIFFNESS


def simulate_bodies(
    grasp: Grasp,
    wrench: Sequence[float] | Array,
    *,
    loading: Loading = "preload-first",
    ramp: float = 8.0,
    step: float = STEP,
    stiffness: float = STIFFNESS,
    on_time: Callable[[float, float], None] | None = None,
    bodies: Bodies | None = None,
) -> SimulationResult:
    """Do hand and object themselves resist the wrench? Where they touch is found by the engine as they move.

    They are `bodies`, or read from the files that the grasp's provenance names. Joints, couplings and gearings are
    those of the grasp; each contact point that the engine finds is as stiff as a contact of `simulate`, whose arguments
    these are.

    Raises:
        InputError: as `simulate` does; hand or object are not known or not those of this grasp.
    """
    w = checked_wrench(wrench)
    checked_times(ramp, step, stiffness, loading)
    twin = build_bodies(grasp, bodies or bodies_of(grasp), force_unit(grasp, w), step=step, stiffness=stiffness)
    first = loading == "preload-first"
    recording = Recording(BodyStepper(twin, grasp, twin.scaled(w)), step, ramp + HOLD + PRELOAD, on_time)
    recording.run(ramp, preload=first, commands=not first)
    return recording.result(grasp, w, loading, twin, stiffness, bodies=True)
