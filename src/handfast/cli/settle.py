"""`handfast settle`: where a grasp ends up that slips."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from tyro.conf import arg

from handfast.cli import console
from handfast.cli.load_options import Load
from handfast.cli.options import GraspOptions, Reported, check_folder, check_writable
from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.simulation.settled import Settled


@dataclass(kw_only=True)
class Settle(GraspOptions, Load, Reported):
    """Where does the grasp end up under a load that it does not resist?

    It is followed in slow steps, contacts found anew in the shapes of hand and object, until nothing moves or the
    object has left. The grasp at rest is asked about as any other.
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
    strip: Annotated[Path | None, arg(metavar="FILE.png")] = None
    """write pictures of the path"""

    def run(self) -> int:
        from handfast.core.answer import Verdict
        from handfast.simulation.settled import Rest, verdict_of
        from handfast.simulation.settling import settle
        from handfast.stability.problem.settings import Settings

        self.check_report()
        check_writable(self.strip, self.force, (".png",))
        self._check_output()
        grasp = self.load()
        wrench = self.disturbance(grasp, self.grasp)
        if self.gravity:  # both grasps are written with the mass and the centre that were asked about
            grasp = self.weighed(grasp, self.grasp)
        centre = grasp.center_of_mass if self.gravity else None
        at = (0.0, 0.0, 0.0) if centre is None else tuple(centre.tolist())
        with console.watch("settle") as watch:
            found = settle(
                grasp, wrench, at=at, follow=self.follow, judge=self.judge, distance=self.distance, steps=self.steps,
                settings=Settings(timeout=self.timeout),
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
        from handfast.core.files import write_bytes

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
