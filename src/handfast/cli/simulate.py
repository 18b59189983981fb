"""`handfast simulate` and `settle`: what a dynamics engine says of a grasp, and where one ends up that slips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from handfast.cli import console
from handfast.cli.load_options import Load
from handfast.cli.options import EndsIn, GraspOptions, LoadingOrder, Reported, check_folder
from handfast.core.answer import Verdict
from handfast.core.errors import InputError
from handfast.core.files import write_bytes, write_text
from handfast.model.grasp import Grasp
from handfast.pictures.scene import moving_scene
from handfast.pictures.words import load_text, sentence
from handfast.simulation.beside_path import beside_path
from handfast.simulation.result import Ending, SimulationResult
from handfast.simulation.settled import Rest, Settled, verdict_of
from handfast.simulation.settling import settle
from handfast.simulation.simulate import simulate, simulate_bodies
from handfast.stability.answers import MaxAnswer
from handfast.stability.answers.load_path import LoadPath
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.questions import maximum

SLOWLY = 4.0  # [s of the twin] for commands that a path is compared with


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
    closing: Annotated[float | None, arg(metavar="S")] = None
    """simulated seconds over which the commands grow before the load comes; unless given 0, at once, with --bodies 1.5,
    and with --path 4"""
    path: bool = False
    """follow the load's path as `max --loading preload-first` does, too, and compare contact forces load by load"""
    save: Annotated[Path | None, arg(metavar="FILE.json"), EndsIn((".json",))] = None
    """write the result with its history"""
    series: Annotated[Path | None, arg(metavar="FILE.csv"), EndsIn((".csv",))] = None
    """write the history as a table"""
    strip: Annotated[Path | None, arg(metavar="FILE.png"), EndsIn((".png",))] = None
    """write a strip of pictures"""
    film: Annotated[Path | None, arg(metavar="FILE.gif"), EndsIn((".gif",))] = None
    """write an animation"""

    def run(self) -> int:
        grasp = self.load()
        wrench = self.one_wrench(self.wrench, self.gravity, grasp, self.grasp)
        followed = self._followed(grasp, wrench) if self.path else None
        closing = SLOWLY if followed is not None and self.closing is None else self.closing
        with console.watch("simulate") as watch:
            found = (simulate_bodies if self.bodies else simulate)(
                grasp, wrench, loading=self.loading, ramp=self.ramp, closing=closing,
                on_progress=lambda now, end: watch.item(round(now), round(end), " simulated seconds"),
            )  # fmt: skip
        self._write(found)
        beside = None if followed is None else beside_path(followed, found)
        if self.json:
            console.print_json(found.to_json() | ({} if beside is None else {"path": beside.to_json()}))
        else:
            show_simulation(found, self.report)
            for line in [] if beside is None else beside.lines():
                console.out().print(f"  {line}")
        open_ = found.ending in (Ending.UNDECIDED, Ending.ILL_POSED)
        return console.UNDECIDED if open_ else console.ANSWERED

    def _followed(self, grasp: Grasp, wrench: Sequence[float]) -> MaxAnswer:
        """How far the load's path goes; `InputError` where it does not begin, or none can be followed."""
        if self.loading != "preload-first":
            raise InputError("has the commands first; leave out --loading together", field="--path")
        with console.watch("path"):
            answer = maximum(grasp, wrench, loading="preload-first", settings=Settings(gap=1e-2))
        if not isinstance(answer.path, LoadPath) or answer.path.reached is None:
            raise InputError("cannot begin: no state of the commands alone is shown", field="--path")
        return answer

    def _write(self, found: SimulationResult) -> None:
        if self.save:
            found.save(self.save, force=self.force)
        if self.series:
            write_text(self.series, found.series_csv(), force=self.force)
        if self.strip or self.film or self.report:
            from handfast.pictures import motion_picture
            from handfast.pictures.drawing import picture

            scene, _ = moving_scene(found.grasp)
            if self.strip:
                write_bytes(self.strip, picture(motion_picture.strip(found, scene)), force=self.force)
            if self.film:
                write_bytes(self.film, motion_picture.film(found, scene), force=self.force)
            if self.report:
                shown = motion_picture.strip(found, scene), "Moments of the simulation, in order."
                head, *rest = lines(found)
                said = sentence(head.replace("  ", ": ", 1)), " ".join(map(sentence, rest))
                self.write_page(found.grasp, notes=said, gallery=[shown])


def show_simulation(found: SimulationResult, *written: Path | None) -> None:
    """The ending in words."""
    head, *rest = lines(found)
    console.out().print(head, style="bold")
    for line in rest:
        console.out().print(f"  {line}")
    console.say_written(console.out(), *written)


def lines(found: SimulationResult) -> list[str]:
    """The ending in a headline, and what there is to know beside it."""
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


@dataclass(kw_only=True)
class Settle(GraspOptions, Load, LoadingOrder, Reported):
    """Where does the grasp end up under a load that it does not resist?

    It is followed in slow steps, contacts found anew in the shapes of hand and object, until nothing moves or the
    object has left. The grasp at rest is asked about as any other. With --loading preload-first it goes on from where
    the load's path ends.
    """

    follow: bool = False
    """follow also a grasp that holds as it stands"""
    distance: Annotated[float | None, arg(metavar="M")] = None
    """beyond which the object has left [m]; the grasp's size unless given"""
    steps: Annotated[int, arg(metavar="N")] = 2000
    """the most steps"""
    judge: bool = True
    """do not ask how much of the load the grasp at rest resists, nor simulate it"""
    timeout: Annotated[float, arg(metavar="S")] = 20.0
    """seconds for each question about the grasps"""
    output: Annotated[Path | None, arg(metavar="FOLDER", aliases=["-o"])] = None
    """write both grasps, the configuration at rest and the path"""
    strip: Annotated[Path | None, arg(metavar="FILE.png"), EndsIn((".png",))] = None
    """write pictures of the path"""

    def run(self) -> int:
        self._check_output()
        grasp = self.load()
        wrench = self.one_wrench(self.wrench, self.gravity, grasp, self.grasp)
        if self.gravity:  # both grasps are written with the mass and the centre that were asked about
            grasp = self.weighed(grasp, self.grasp)
        centre = grasp.center_of_mass if self.gravity else None
        at = (0.0, 0.0, 0.0) if centre is None else tuple(centre.tolist())
        with console.watch("settle") as watch:
            found = settle(
                grasp, wrench, at=at, follow=self.follow, judge=self.judge, distance=self.distance, steps=self.steps,
                loading=self.loading, settings=Settings(timeout=self.timeout),
                on_progress=lambda share, moved: watch.say(f"{100 * share:.0f} % of the load, {1e3 * moved:.3g} mm"),
            )  # fmt: skip
        self._write(found)
        if self.json:
            console.print_json(found.to_json())
        else:
            self._show(found)
        rests_open = found.rest is Rest.RESTS and verdict_of(found.after) is Verdict.UNDECIDED
        return console.UNDECIDED if found.rest is Rest.UNDECIDED or rests_open else console.ANSWERED

    def _check_output(self) -> None:
        check_folder(self.output)
        there = self.output / "settled.json" if self.output else None
        if there is not None and there.exists() and not self.force:
            raise InputError("exists already; give --force to write over it", source=str(there))

    def _write(self, found: Settled) -> None:
        if self.output:
            found.save(self.output, force=self.force)
        if self.report:
            from handfast.pictures.motion_picture import report_settled

            report_settled(self.report, found, force=self.force)
        if self.strip:
            from handfast.pictures.drawing import picture
            from handfast.pictures.motion_picture import draw_settled

            write_bytes(self.strip, picture(draw_settled(found)), force=self.force)

    def _show(self, found: Settled) -> None:
        from handfast.pictures.motion_picture import details, headline

        out = console.out()
        out.print(f"{str(found.rest).upper()}  {found.first.name} {headline(found)}", style="bold")
        for line in details(found):
            out.print(f"  {line}")
        if found.path:
            out.print(f"  {len(found.path) - 1} steps in {found.seconds:.2g} s", style="dim")
        console.say_written(out, self.output, self.report, self.strip)
