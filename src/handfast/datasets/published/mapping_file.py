"""The `handfast/mapping/1` file: what published files leave unsaid about their hand.

{"schema": "handfast/mapping/1", "layouts": ["dexgraspbench"], "link": "rh_palm",
 "offset": {"position": [0, 0, 0.034]}, "joints": ["rh_FFJ4", "rh_FFJ3"],
 "names": {"robot0:FFJ3": "rh_FFJ4"}, "values": {"rh_WRJ1": 0}, "closed": {"rh_FFJ3": 1.2}}
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from handfast.core import bundled
from handfast.core.errors import InputError
from handfast.core.files import Finite, Strict, read_json, validate
from handfast.model.configuration import PoseFile
from handfast.model.hand.hand import Hand

KIND = "mappings"


class HandMapping(Strict):
    """The whole file.

    Attributes:
        layouts: for which layouts it is taken without being asked for.
        link: the hand's link whose pose `offset` gives; the base unless said.
        offset: of that link in the frame in which the file poses the hand.
        joints: the hand's joints in the order of the file's numbers, where it has no names.
        names: the hand's name of a joint, by the file's; one that is not here has the same name.
        reversed: joints of the hand that turn the other way than the file's do.
        values: of joints that the file says nothing about [rad, m].
        closed: where joints that the file says nothing about go when the hand closes [rad, m].
    """

    schema_: Literal["handfast/mapping/1"] = Field(alias="schema")
    layouts: list[str] = Field(default_factory=list)
    link: str | None = None
    offset: PoseFile = PoseFile()
    joints: list[str] | None = None
    names: dict[str, str] = Field(default_factory=dict)
    reversed: list[str] = Field(default_factory=list)
    values: dict[str, Finite] = Field(default_factory=dict)
    closed: dict[str, Finite] = Field(default_factory=dict)

    @property
    def mentioned(self) -> set[str]:
        """All joints of the hand that it names."""
        return {*(self.joints or ()), *self.names.values(), *self.reversed, *self.values, *self.closed}

    def fits(self, hand: Hand) -> bool:
        """Whether the hand has the link and all the joints."""
        known = self.link is None or self.link in hand.link_names
        return known and self.mentioned <= set(hand.joint_names)


def read_mapping(path: str | Path) -> HandMapping:
    """A mapping by path or bundled name, whatever the hand; `InputError` naming the first field that is wrong."""
    try:
        return validate(HandMapping, read_json(bundled.resolve(KIND, str(path)), "mapping"))
    except InputError as fault:
        raise fault.at(str(path)) from None


def load_mapping(path: str | Path, hand: Hand) -> HandMapping:
    """A mapping by path or bundled name; `InputError` naming what the hand has not got."""
    found = read_mapping(path)
    try:
        twice = [n for i, n in enumerate(found.joints or ()) if n in (found.joints or ())[:i]]
        if twice:
            raise InputError(f"has '{twice[0]}' twice; each number of a file is one joint's", field="joints")
        if found.link is not None:
            hand.link(found.link)
        for joint in sorted(found.mentioned):
            hand.joint(joint, field="joints")
    except InputError as fault:
        raise fault.at(str(path)) from None
    return found


def mapping_for(layout: str, hand: Hand) -> tuple[str, HandMapping]:
    """The bundled mapping of a layout that fits a hand, with its name.

    Raises:
        InputError: none does, or several do; the line says what to give.
    """
    names = bundled.names(KIND)
    known = {n: read_mapping(n) for n in names}
    fitting = [n for n in names if layout in known[n].layouts and known[n].fits(hand)]
    if len(fitting) == 1:
        return fitting[0], known[fitting[0]]
    if fitting:
        raise InputError(f"could be read with {' or '.join(fitting)}; choose by --mapping NAME", source=hand.source)
    others = [n for n in names if layout in known[n].layouts]
    right = f"bundled for {layout}: {', '.join(others)}" if others else f"none is bundled for {layout}"
    problem = f"is no hand that a bundled mapping knows ({right}); say in a file which joint is which: --mapping FILE"
    raise InputError(problem, source=hand.source or hand.name)
