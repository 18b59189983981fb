"""`handfast simulate`: what a dynamics engine says of a grasp under a load."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import arg

from handfast.cli import console
from handfast.cli.load_options import Load
from handfast.cli.options import GraspOptions, Reported, check_writable

if TYPE_CHECKING:
    from handfast.simulation.result import SimulationResult


@dataclass(kw_only=True)
class Simulate(GraspOptions, Load, Reported):
    """What happens to the grasp under this load in a dynamics engine (mujoco)?

    Its contacts as stiff points with friction on its joints, or with --bodies hand and object themselves; geared motors
    that do not turn back, the load growing slowly. The ending is judged by how fast the object still moves: holds,
    settles, slips, undecided or ill-posed.
    """

    bodies: bool = False
    """simulate hand and object, read from the files that the grasp names: where they touch is found as they move"""
    loading: Literal["preload-first", "together"] = "preload-first"
    """the commands first and then the load, as with a real hand, or both in proportion, as the model has it"""
    ramp: Annotated[float, arg(metavar="S")] = 8.0
    """simulated seconds over which the load grows"""
    json: bool = False
    """print one JSON object instead of a table"""
    save: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """write the result with its history"""
    series: Annotated[Path | None, arg(metavar="FILE.csv")] = None
    """write the history as a table"""
    strip: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """write a strip of pictures"""
    film: Annotated[Path | None, arg(metavar="FILE.gif")] = None
    """write an animation"""
    force: bool = False
    """write over files that exist"""

    def run(self) -> int:
        from handfast.simulation.result import Ending
        from handfast.simulation.simulate import simulate, simulate_bodies

        for path, ending in ((self.save, ".json"), (self.series, ".csv"), (self.strip, ".png"), (self.film, ".gif")):
            check_writable(path, self.force, (ending,))
        self.check_report()
        grasp = self.load()
        wrench = self.disturbance(grasp, self.grasp)
        with console.watch("simulate") as watch:
            found = (simulate_bodies if self.bodies else simulate)(
                grasp, wrench, loading=self.loading, ramp=self.ramp,
                on_progress=lambda now, end: watch.item(round(now), round(end), " simulated seconds"),
            )  # fmt: skip
        self._write(found)
        if self.json:
            console.print_json(found.to_json())
        else:
            show_simulation(found, self.report)
        open_ = found.ending in (Ending.UNDECIDED, Ending.ILL_POSED)
        return console.UNDECIDED if open_ else console.ANSWERED

    def _write(self, found: SimulationResult) -> None:
        from handfast.core.files import write_bytes, write_text

        if self.save:
            found.save(self.save, force=self.force)
        if self.series:
            write_text(self.series, found.series_csv(), force=self.force)
        if self.strip or self.film or self.report:
            from handfast.pictures import motion_picture
            from handfast.pictures.drawing import picture
            from handfast.pictures.scene import moving_scene

            scene, _ = moving_scene(found.grasp)
            if self.strip:
                write_bytes(self.strip, picture(motion_picture.strip(found, scene)), force=self.force)
            if self.film:
                write_bytes(self.film, motion_picture.film(found, scene), force=self.force)
            if self.report:
                shown = motion_picture.strip(found, scene), "Moments of the simulation, in order."
                self.write_page(found.grasp, notes=lines(found), gallery=[shown])


def show_simulation(found: SimulationResult, *written: Path | None) -> None:
    """The ending in words."""
    head, *rest = lines(found)
    console.out().print(head, style="bold")
    for line in rest:
        console.out().print(f"  {line}")
    console.say_written(console.out(), *written)


def lines(found: SimulationResult) -> list[str]:
    """The ending in a headline, and what there is to know beside it."""
    from handfast.pictures.words import load_text
    from handfast.simulation.result import Ending

    moved = f"{1e3 * found.motion[-1]:.3g} mm"
    touching = ", ".join(str(i) for i in found.touching) or "none"
    rate = f"{1e3 * found.rate:.2g} mm/s"
    said = {
        Ending.HOLDS: f"at rest after {moved}; contacts that carry: {touching}",
        Ending.SETTLES: f"slipped, and came to rest after {moved}; contacts that carry: {touching}",
        Ending.SLIPS: f"moving at {rate} after {moved}",
        Ending.UNDECIDED: found.why or f"creeping at {rate} after {moved}: neither at rest nor slipping",
        Ending.ILL_POSED: f"the simulation broke down: {found.why}",
    }
    onset = [] if found.onset is None else [f"it began to slip at {100 * found.onset:.3g} % of the load"]
    simulated = "its contacts are points on flat faces"
    if found.bodies:
        simulated = f"hand and object touch at {found.points[-1]} point{'' if found.points[-1] == 1 else 's'}"
    return [
        f"{str(found.ending).upper()}  {found.grasp.name} under {load_text(found.wrench)}",
        said[found.ending],
        *onset,
        f"{found.steps} steps of the engine in {found.seconds:.2g} s; {simulated}",
    ]
