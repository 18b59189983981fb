"""`handfast propose`: tasks in which a hand holds an object, regions chosen automatically."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.console import table
from handfast.cli.load_options import ObjectOptions
from handfast.cli.options import Command, Reported, check_folder, check_writable
from handfast.core import bundled
from handfast.core.errors import require_positive
from handfast.planning.question import compared
from handfast.readers.body_file import save_body_copy
from handfast.readers.load_hand import load_hand
from handfast.readers.region_file import load_hand_regions

if TYPE_CHECKING:
    from handfast.planning.propose_tasks import Proposals


@dataclass(kw_only=True)
class Propose(ObjectOptions, Reported, Command):
    """Propose regions of an object to touch for a pinch, a tripod or a power grasp.

    A heuristic chooses the regions and pairs them with those of the hand; every task that is proposed has a certified
    configuration. What is not proposed may be possible all the same.
    """

    hand: Annotated[Positional[str], arg(metavar="HAND")]
    """a URDF or MJCF file (FILE#LINK: what hangs on that link), a bundled hand, menagerie:ROBOT or ..._description"""
    object: Annotated[Positional[str], arg(metavar="OBJECT")]
    """a mesh or handfast/body/1 file, or the name of a bundled object"""
    kind: Literal["pinch", "tripod", "power"] = "pinch"
    """two fingertips, three fingertips, or the palm and two fingers"""
    regions: Annotated[str | None, arg(metavar="FILE.json")] = None
    """the hand's regions, a handfast/hand-regions/1 file; bundled, or guessed from the hand's shapes, if absent"""
    count: Annotated[int, arg(metavar="N", aliases=["-n"])] = 5
    """proposals"""
    scale: Annotated[float, arg(metavar="M")] = 1.0
    """metres per unit of a mesh file"""
    unbalanced: bool = False
    """try regions, too, where no contact forces balance the object's weight from all six sides"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of everything that is drawn: the same seed gives the same proposals"""
    timeout: Annotated[float, arg(metavar="S")] = 1.0
    """seconds of synthesis for each candidate"""
    output: Annotated[Path | None, arg(metavar="FOLDER", aliases=["-o"])] = None
    """write one handfast/task/1 file for each proposal, for handfast synthesize and handfast grasp"""

    def run(self) -> int:
        from handfast.planning.propose_tasks import ProposeOptions, propose

        check_folder(self.output)
        require_positive(self.count, "count", "a positive number is needed")  # before a mesh is taken apart
        hand = load_hand(self.hand)
        body = self.load_object(self.object, self.scale)
        console.warn(compared(hand, body))
        regions = load_hand_regions(self.regions, hand) if self.regions else None
        named = self.object if self.object in bundled.names("objects") else str(Path(self.object))
        copy = self._copy(body.name)
        if copy:  # a task names a file, which has to say what was said here
            check_writable(copy, self.force, (".json",))
            named = str(copy)
        with console.watch("propose") as watch:
            options = self.made(ProposeOptions, object=named)
            found = propose(hand, regions, body, self.kind, options=options, on_progress=watch.say)
        written = found.save(self.output, force=self.force) if self.output else []
        if copy and written:
            said: dict[str, Any] = {"scale": self.scale, "center_of_mass": self.center_of_mass or None}
            save_body_copy(self.object, copy, mass=self.mass, friction=self.friction, **said, force=self.force)
            written = [*written, copy]
        if self.report and found.proposals:
            from handfast.pictures.found_page import report_proposals

            report_proposals(self.report, found, body, force=self.force)
            written = [*written, self.report]
        if self.json:
            console.print_json(found.to_json() | {"files": [str(path) for path in written]})
        else:
            self._show(found, written)
        return console.ANSWERED if found.proposals else console.UNDECIDED

    def _copy(self, name: str) -> Path | None:
        """The body file to write beside the tasks: needed where the object's own file does not say enough."""
        given = self.mass is not None or self.friction is not None or self.center_of_mass or self.scale != 1
        if self.output is None or not given:
            return None
        return self.output / f"{name}.body.json"

    def _show(self, found: Proposals, written: list[Path]) -> None:
        out = console.out()
        clear = sum(p.clear for p in found.proposals)
        what = f"{len(found.proposals)} of {found.tried} candidates certified and kept, {clear} of them clear"
        out.print(f"{found.kind}: {what}; {found.seconds:.1f} s", style="bold")
        if found.proposals:
            heads, rows = ("task", "regions of the hand", "score", "off centre", "clearance"), []
            for p in found.proposals:
                measured = f"{p.score:.2f}", f"{1e3 * p.off_centre:.0f} mm", f"{1e3 * p.clearance + 0.0:.1f} mm"
                rows.append((p.task.name, ", ".join(p.names), *measured))
            out.print(table(heads, rows))
        if found.tally.rejected:
            dropped = found.tally.rejected.items()
            told = [(str(reason), str(some.count), some.example) for reason, some in dropped]
            out.print(table(["dropped", "number", "for example"], told))
        console.say_written(out, *written)
        if self.report and not found.proposals:
            out.print(f"Not written: {self.report}; there is nothing to show", soft_wrap=True)
