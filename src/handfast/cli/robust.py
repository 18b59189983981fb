"""`handfast robust`: how the largest disturbance is spread over grasps that are a little off."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import arg

from handfast.cli import console
from handfast.cli.console import table
from handfast.cli.load_options import LoadDirection
from handfast.cli.options import EndsIn, GraspOptions, Reported, Wrench, write_as
from handfast.core.errors import InputError
from handfast.pictures import Entry
from handfast.pictures.words import direction_text, magnitude, num
from handfast.stability.problem.settings import Settings
from handfast.stability.studies.sampled_maximum import Perturbation, SampledMaximum, sampled_maximum


@dataclass(kw_only=True)
class Robust(LoadDirection, GraspOptions, Reported):
    """How large a disturbance do grasps resist that are off by no more than stated bounds?

    Contacts, normals, friction and commands are drawn at random within them, each by itself. Beside the spread stands
    what equation (17) promises for normals that are off: the maximum with --eta.
    """

    base: Wrench = ()
    """a constant load beside it, such as the weight"""
    positions: Annotated[float, arg(metavar="MM")] = 0.0
    """how far each contact may be off [mm], uniform in a ball"""
    normals: Annotated[float, arg(metavar="DEG")] = 0.0
    """how far each normal may be off [degrees], uniform in a cone"""
    frictions: Annotated[float, arg(metavar="SHARE")] = 0.0
    """share by which each contact's friction may be larger or smaller; 0.1 is ten per cent"""
    commands: Annotated[float, arg(metavar="SHARE")] = 0.0
    """share by which each command may be larger or smaller"""
    samples: Annotated[int, arg(metavar="N")] = 200
    """how many grasps are drawn"""
    seed: Annotated[int, arg(metavar="S")] = 0
    """of the samples: the same seed gives the same grasps"""
    timeout: Annotated[float, arg(metavar="S")] = 10.0
    """seconds for each grasp"""
    output: Annotated[Path | None, arg(metavar="FILE", aliases=["-o"]), EndsIn((".png", ".svg", ".json"))] = None
    """picture (.png, .svg) or numbers (.json)"""

    def run(self) -> int:
        grasp, bounds = self.load(), self._bounds()
        direction = self.one_wrench(self.direction, self.gravity, grasp, self.grasp)
        with console.watch("robust") as watch:
            found = sampled_maximum(
                grasp, direction, bounds, samples=self.samples, seed=self.seed, base=self.base or None,
                settings=Settings(timeout=self.timeout), on_progress=watch.item,
            )  # fmt: skip
        if self.output:
            save(found, self.output, force=self.force)
        if self.report:
            self._report(found)
        if self.json:
            console.print_json(found.to_json())
        else:
            show_sampled(found)
            console.say_written(console.out(), self.output, self.report)
        return console.status(found.nominal.verdict, found.stop)

    def _report(self, found: SampledMaximum) -> None:
        from handfast.pictures.sampled_picture import bounds_text, conclusion, draw_sampled

        direction = found.direction.tolist()
        entry = Entry(
            f"How much {direction_text(direction)} does it resist as it stands?", found.nominal, direction=direction
        )
        picture = draw_sampled(found), f"The largest disturbance of {len(found.lower)} grasps that are off."
        notes = [bounds_text(found), *conclusion(found)]
        self.write_page(found.grasp, [entry], notes=notes, gallery=[picture])

    def _bounds(self) -> Perturbation:
        for name in ("positions", "normals", "frictions", "commands"):
            value = getattr(self, name)
            most = {"positions": np.inf, "normals": 45.0}.get(name, 1.0)
            if not (
                np.isfinite(value) and 0 <= value <= most and not (name in ("commands", "normals") and value == most)
            ):
                right = {
                    "positions": "0 mm or more",
                    "normals": "0 to below 45 degrees",
                    "frictions": "a share from 0 to 1",
                }
                text = right.get(name, "a share from 0 to below 1")
                raise InputError(f"is {value:g}; {text} is needed", field=f"--{name}")
        if not (self.positions or self.normals or self.frictions or self.commands):
            raise InputError("nothing is off: give at least one of --positions, --normals, --frictions and --commands")
        return Perturbation(1e-3 * self.positions, float(np.radians(self.normals)), self.frictions, self.commands)


def save(found: SampledMaximum, path: Path, *, force: bool = False) -> None:
    """Write the picture or the numbers, by the file's ending."""
    from handfast.pictures.sampled_picture import draw_sampled

    write_as(path, found, lambda: draw_sampled(found), force=force)


def show_sampled(found: SampledMaximum) -> None:
    """The spread in words and a table."""
    from handfast.pictures.sampled_picture import bound_text, bounds_text, conclusion

    out = console.out()
    factor, unit = magnitude(found.direction)
    name, what = found.grasp.name, direction_text(found.direction)
    out.print(f"{name}: largest {what} of {len(found.lower)} grasps that are off", style="bold")
    out.print(f"  {bounds_text(found)}")
    rows = [("the grasp as it stands", bound_text(found.nominal, factor))]
    if found.uncertain is not None:
        eta = num(float(found.bounds.normals) * 57.29577951308232)
        rows.append((f"with eta = {eta}°, equation (17)", bound_text(found.uncertain, factor)))
    for share, value in found.quantiles.items():
        word = "the worst sample" if share == 0 else f"{num(100 * share)} % of the samples at most"
        rows.append((word, "any size" if value == float("inf") else num(factor * value)))
    out.print(table(["", f"resisted [{unit}]"], rows))
    for line in conclusion(found):
        out.print(f"  {line}")
