"""How a simulation ends, judged by the motion's rate; what is between the engine's floor and a slip stays open."""

from __future__ import annotations

from enum import StrEnum

# Grasp sizes per second, measured by benchmarks/simulation_floor.py on a slope and a pinch (docs/simulation.md): what
# is 2 % or more below the threshold moves at 3.2e-7 at most, what is 2 % or more above it at 4.7e-5 at least.
REST = 2.5e-7  # ten times the fastest that rests
SLIP = 4.6e-5  # the slowest that slips
EVIDENT = 5e-4  # what a hundredth of the force unit drives: what gives way in step with the load is slower
CREEPS = 0.5  # of what creep grows by as friction is made softer; a slip does not heed it
LOST = 0.5  # [grasp sizes] beyond it the contacts are others
LEAST = 1e-4  # [force units] a smaller load that nothing resists would drift hardly faster than what rests
FAR = 10.0  # times what the contacts give way: a grasp that jerked and moved less than this has not slipped


class Ending(StrEnum):
    """What became of the grasp. `ILL_POSED` and `UNDECIDED` are no agreement with anything."""

    HOLDS = "holds"
    SETTLES = "settles"
    SLIPS = "slips"
    UNDECIDED = "undecided"
    ILL_POSED = "ill-posed"


def judge(
    rate: float,
    fastest: float,
    moved: float,
    yielded: float,
    *,
    broken: bool,
    faint: bool = False,
    creeping: bool = False,
) -> Ending:
    """The ending of a simulation.

    Args:
        rate: of the fastest contact at the end [grasp sizes/s].
        fastest: largest rate since the load began to grow.
        moved: of the contact that moved farthest, since then [grasp sizes].
        yielded: how far the contacts gave way at most [grasp sizes].
        broken: whether the engine's numbers ran away.
        faint: whether the load is too small beside the commands to be seen.
        creeping: whether that rate is the engine's own, which grows as its friction is made softer.
    """
    if broken:
        return Ending.ILL_POSED
    if moved > LOST or rate > SLIP:
        return Ending.SLIPS
    if (rate > REST and not creeping) or faint:
        return Ending.UNDECIDED
    return Ending.SETTLES if fastest > EVIDENT and moved > FAR * yielded else Ending.HOLDS
