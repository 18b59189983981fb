"""A task as groups of arrays, which the compiled kernels take.

There are b contacts, n coordinates and k joints in the longest chain. One unit of length is `Problem.unit`.
"""

from __future__ import annotations

from typing import NamedTuple

from handfast.core.groups import RealArrays4, RealMatrices, RealMatrix, Reals, WholeMatrix, Wholes

CAP_REGION, PATCH_REGION, SIDE_REGION = 0, 1, 2  # kinds of regions
REVOLUTE, PRISMATIC = 0, 1  # kinds of joints
POSE = 7  # coordinates of the object's pose, the last before the region parameters
QUATERNION = 4  # of these that turn it, the last


class Chains(NamedTuple):
    """The joints between the palm and the link of each contact."""

    joints: Wholes  # (b,) how many
    rotation: (
        RealArrays4  # (b, k+1, 3, 3) of the motion before each joint, whose axis is then z, and after the last one
    )
    translation: RealMatrices  # (b, k+1, 3) [unit] of the same motions
    kind: WholeMatrix  # (b, k) REVOLUTE or PRISMATIC
    coordinate: WholeMatrix  # (b, k) that moves the joint; -1 where there is no joint
    ratio: RealMatrix  # (b, k) the joint's value [rad or unit] is ratio x[coordinate] + offset
    offset: RealMatrix  # (b, k)


class Regions(NamedTuple):
    """What touches. Surfaces have parameters: first the object regions of all contacts, then the hand's."""

    hand: Wholes  # (b,) its kind; a CAP rolls: it has no parameters, but what follows
    object: Wholes  # (b,) its kind
    center: RealMatrix  # (b, 3) [unit] of the hand's cap, in its link
    axis: RealMatrix  # (b, 3) of the hand's cap, unit vector in its link
    radius: Reals  # (b,) [unit] of the hand's cap, negative if its normals are reversed
    cone: Reals  # (b,) cosine of the hand's cap's half angle; -2 if it is a whole sphere
    sign: Reals  # (b,) 1, or -1 if the normals of the hand's cap are reversed
    degree: WholeMatrix  # (2b, 2) of each patch
    first: Wholes  # (2b,) its first control point in `points`
    points: RealMatrix  # (., 3) [unit] control points of all patches
    numbers: RealMatrix  # (2b, 19) of each surface that is no patch, as `task_problem.py` lists them
    face: Reals  # (2b,) 1, or -1 if the surface's normals are reversed


class Coordinates(NamedTuple):
    """Where equations and coordinates of each contact begin, and what bounds there are."""

    row: Wholes  # (b,) first equation
    parameter: Wholes  # (b,) first region parameter among the coordinates
    axes: RealMatrix  # (9, 2) bounds of R[i, k] of the object's rotation at 3k+i
    lower: Reals  # (n,) bounds of the coordinates
    upper: Reals  # (n,)


class Flat(NamedTuple):
    """A task."""

    chains: Chains
    regions: Regions
    coordinates: Coordinates
