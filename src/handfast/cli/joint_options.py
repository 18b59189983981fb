"""What of a hand's joints counts beside their motors, as the options of every command that makes grasps of a hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from tyro.conf import UseAppendAction, arg

from handfast.core.errors import InputError

if TYPE_CHECKING:
    from handfast.model.hand import Hand


# What a search for grasps counts unless asked: the friction in models of hands is often there to calm a simulator, and
# no grasp is to be found, or missed, for such a number.
SOLID = "stops,springs"


@dataclass(kw_only=True)
class JointLawOptions:
    """Laws of the joints."""

    joint_laws: Annotated[str, arg(metavar="LAWS")] = "all"
    """what counts of the joints' stops, friction and springs in the hand's file: all, none, or names with commas"""
    backdrivable: UseAppendAction[tuple[Annotated[str, arg(metavar="ACTUATOR")], ...]] = ()
    """a motor that gives what it is commanded and no more, whichever way it is turned; repeatable"""

    def lawful(self, hand: Hand) -> Hand:
        """A hand as these options want it."""
        from handfast.model.hand.joint_law import laws_named

        laws_named(self.joint_laws, "--joint-laws")
        try:
            return hand.with_laws(self.joint_laws).with_backdrivable(self.backdrivable)
        except InputError as fault:
            raise InputError(fault.problem, field="--backdrivable") from None
