"""What the compiled kernels work in: groups of arrays, which their callers make, so that no kernel allocates.

There are b contacts, n coordinates, e equations and g inequalities, k joints in the longest chain, and d is the
highest degree of a patch. A ball is a middle and a radius, the last axis of an array of balls. Lengths are in units of
`TaskProblem.unit`. A workspace serves one call at a time.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from handfast.core.groups import (
    Layout,
    RealArrays4,
    RealArrays5,
    RealMatrices,
    RealMatrix,
    Reals,
    WholeMatrix,
    Wholes,
)
from handfast.synthesis.task_groups import Flat

CANDIDATE_MARGIN = 1e-4  # candidates keep this far inside every bound, so that strictness costs nothing
POSE_TRIES = 8  # random poses of which a start takes the one that violates the pose bounds least
PLACEMENT_NUMBERS = 8  # random numbers that place the object once
AXIS_INEQUALITIES = 18  # inequalities that bound the object's axes
MOST_LEFT = 48  # boxes of a contact's own coordinates that a box of poses hands on to its halves
DEEPEST_INNER = 400  # boxes on the stack of an inner search, of one contact in a box of poses
PROVED, USED, UNPROVED = 0, 1, 2  # places in `Found.counts`
LEFT, SMALL, NODES = 0, 1, 2  # places in `Stack.counts`

# --- the local search and its proofs --------------------------------------------------------------


class Interior(NamedTuple):
    """The bounds of the coordinates, drawn in by `CANDIDATE_MARGIN` or by a quarter of what there is between them."""

    lower: Reals  # (n,)
    upper: Reals  # (n,)


class Draws(NamedTuple):
    """In: random starts within the interior."""

    numbers: RealMatrix  # (s, n+1+ALIGNED*NUMBERS) uniform in [0, 1), one start a row
    lower: Reals  # (n,) as in `Interior`
    upper: Reals  # (n,)


class Departures(NamedTuple):
    """In: steps along the set of solutions, within the interior."""

    begin: RealMatrix  # (s, n) solutions
    direction: RealMatrix  # (s, n) in coordinates times the weight; its tangential part is gone along
    length: Reals  # (s,) in the norm of the coordinates times the weight
    weight: Reals  # (n,) positive
    lower: Reals  # (n,) as in `Interior`
    upper: Reals  # (n,)


class SystemValues(NamedTuple):
    """Equations, which must be zero, and inequalities, which must be positive, at a point or over a box: balls."""

    equation: RealMatrix  # (e, 2)
    equation_slope: RealMatrices  # (e, n, 2) derivatives
    inequality: RealMatrix  # (g, 2) one a contact: within its cone, or normals that oppose; then `AXIS_INEQUALITIES`
    inequality_slope: RealMatrices  # (g, n, 2) derivatives


class ContactBalls(NamedTuple):
    """One contact while its equations are evaluated: balls. Surfaces have nine rows, see `kinematics.surface`."""

    object_rotation: RealArrays4  # (5, 3, 3, 2) of the object, and its derivatives by the quaternion
    link_rotation: RealMatrices  # (3, 3, 2) of the contact's link in the palm
    link_position: RealMatrix  # (3, 2)
    next_rotation: RealMatrices  # (3, 3, 2) the same behind the next joint
    next_position: RealMatrix  # (3, 2)
    joint_axis: RealMatrices  # (k+1, 3, 2) unit vectors in the palm
    joint_point: RealMatrices  # (k+1, 3, 2) on the axes
    object_surface: RealMatrices  # (9, 3, 2) in the object
    hand_surface: RealMatrices  # (9, 3, 2) in the link
    raw_normal: RealMatrices  # (3, 3, 2) the normal, not normalised, and parts of its derivatives
    weights: RealArrays4  # (2, 3, d+1, 2) of the control points for the value and two derivatives, in both parameters
    lower_weights: RealMatrix  # (d+1, 2) of a lower degree
    hand_point: RealMatrix  # (3, 2) of the hand, or its cap's centre, in the palm
    hand_direction: RealMatrix  # (3, 2) the cap's axis, or the patch's normal, in the palm
    object_point: RealMatrix  # (3, 2) of the object, or of its surface moved out by the cap's radius
    turned_point: RealMatrix  # (3, 2) the same turned with the object
    turned_point_slope: RealMatrices  # (4, 3, 2) its derivatives by the quaternion
    turned_vector: RealMatrix  # (3, 2) a normal or tangent turned with the object
    turned_vector_slope: RealMatrices  # (4, 3, 2)
    tangent: RealMatrix  # (3, 2) in the object or the palm
    turned_tangent: RealMatrix  # (3, 2)
    moment_arm: RealMatrix  # (3, 2) from a joint to the contact
    velocity: RealMatrix  # (3, 2) of what a joint turns


class StepWork(NamedTuple):
    """A step of the local search: the rows that it is to meet, and their normal equations. m = e + g rows at most."""

    x: RealMatrix  # (n, 2) the candidate: balls, whose radii are zero
    trial: RealMatrix  # (n, 2) where the step leads
    held: Wholes  # (n,) 1: the coordinate stays
    step: Reals  # (n,)
    rows: RealMatrix  # (m, n) derivatives
    wanted: Reals  # (m,) the change that each row is to have
    normal: RealMatrix  # (m, m) rows times their transpose, then its Cholesky factor
    multiplier: Reals  # (m,)


class ProofWork(NamedTuple):
    """The Krawczyk test."""

    columns: RealMatrix  # (e, n) derivatives times the slack of the coordinate
    free: Wholes  # (n,) 1: the coordinate may become a dependent one
    matrix: RealMatrix  # (e, e) derivatives by the dependent coordinates
    inverse: RealMatrix  # (e, e) near the inverse of it
    moved: Reals  # (e,) bounds of the Newton step
    box: RealMatrix  # (n, 2) balls


class StartWork(NamedTuple):
    """A random start."""

    frames: RealMatrices  # (3, 3, 3) on the hand, on the object, and the rotation between them
    across: RealMatrix  # (2, 3) unit vectors across a frame's third axis
    inward: Reals  # (3,) the hand's direction, in its link
    spot: Reals  # (3,) the hand's point or centre, in its link
    opposite: Reals  # (3,) of the hand's direction, in the palm
    pose: Reals  # (7,) the best so far


class LocalWork(NamedTuple):
    """Workspace of the local search and of its proofs."""

    here: SystemValues  # at the candidate
    there: SystemValues  # where a step leads, or over a box
    contact: ContactBalls
    step: StepWork
    proof: ProofWork
    start: StartWork


class Found(NamedTuple):
    """Out: certified configurations, one a row."""

    x: RealMatrix  # (m, n)
    chosen: WholeMatrix  # (m, e) dependent coordinates
    radii: RealMatrix  # (m, e) of the box about them that holds an exact configuration
    counts: Wholes  # (3,) rows that are PROVED, starts USED, candidates UNPROVED


def interior(flat: Flat) -> Interior:
    """Of the coordinates of a task."""
    lower, upper = flat.coordinates.lower, flat.coordinates.upper
    drawn = np.minimum(CANDIDATE_MARGIN, 0.25 * (upper - lower))
    return Interior(lower + drawn, upper - drawn)


def local_work(flat: Flat, e: int) -> tuple[Layout[Any], ...]:
    """A `LocalWork` for a task of e equations, one layout a field."""
    n, g = len(flat.coordinates.lower), len(flat.chains.joints) + AXIS_INEQUALITIES
    m, joints, weights = e + g, flat.chains.kind.shape[1] + 1, _degree(flat) + 1
    system = {"equation": (e, 2), "equation_slope": (e, n, 2), "inequality": (g, 2), "inequality_slope": (g, n, 2)}
    contact: dict[str, tuple[int, ...]] = dict.fromkeys(ContactBalls._fields, (3, 2))
    contact |= dict.fromkeys(("link_rotation", "next_rotation", "raw_normal"), (3, 3, 2))
    contact |= dict.fromkeys(("turned_point_slope", "turned_vector_slope"), (4, 3, 2))
    contact |= dict.fromkeys(("object_surface", "hand_surface"), (9, 3, 2))
    contact |= dict.fromkeys(("joint_axis", "joint_point"), (joints, 3, 2))
    contact |= {"object_rotation": (5, 3, 3, 2), "weights": (2, 3, weights, 2), "lower_weights": (weights, 2)}
    step = {"x": (n, 2), "trial": (n, 2), "held": (n,), "step": (n,), "rows": (m, n)}
    step |= {"wanted": (m,), "normal": (m, m), "multiplier": (m,)}
    proof = {"columns": (e, n), "free": (n,), "matrix": (e, e), "inverse": (e, e), "moved": (e,), "box": (n, 2)}
    start: dict[str, tuple[int, ...]] = dict.fromkeys(StartWork._fields, (3,))
    start |= {"frames": (3, 3, 3), "across": (2, 3), "pose": (7,)}
    return (
        Layout(SystemValues, system),
        Layout(SystemValues, system),
        Layout(ContactBalls, contact),
        Layout(StepWork, step),
        Layout(ProofWork, proof),
        Layout(StartWork, start),
    )


def found(n: int, e: int, many: int) -> Layout[Found]:
    """Room for so many configurations."""
    return Layout(Found, {"x": (many, n), "chosen": (many, e), "radii": (many, e), "counts": (3,)})


# --- the searches for a contradiction -------------------------------------------------------------


class Stack(NamedTuple):
    """Boxes of a search, in and out: those that wait, and those that have come to the resolution."""

    box: RealMatrices  # (s, n, 2) in: the first one; out: those that wait
    share: Reals  # (s,) of the whole search
    small: RealMatrices  # (r, n, 2) out
    small_share: Reals  # (r,)
    counts: Wholes  # (3,) out: boxes LEFT, SMALL ones, NODES examined


class CenteredBox(NamedTuple):
    """A box about its middle."""

    middle: Reals  # (n,)
    half: Reals  # (n,) widths
    low: Reals  # (n,) ends about the middle, which rows narrow
    high: Reals  # (n,)


class Polynomials(NamedTuple):
    """Taylor polynomials of degree one over a box, of c contacts and cones, see `taylor.element`."""

    value: RealMatrices  # (c, 4, 3) in the middle: HAND_POINT, HAND_DIRECTION, OBJECT_POINT, OBJECT_DIRECTION
    slope: RealArrays4  # (c, 4, n, 3) derivatives
    remainder: RealMatrix  # (c, 4)
    bend: RealArrays4  # (c, k, k, 3) second derivatives of the hand's point by its joints, in the order of the chain
    rest: Reals  # (c,) what the polynomial of degree two of the hand's point leaves out
    swing: RealMatrix  # (c, 4) [rad] largest angle between a direction in the box and the middle one
    tolerance: Reals  # (c,) [rad] largest angle between the directions of hand and object


class TaylorWork(NamedTuple):
    """What `taylor.element` works in."""

    link_rotation: RealMatrix  # (3, 3) of the contact's link in the palm
    link_position: Reals  # (3,)
    next_rotation: RealMatrix  # (3, 3) the same behind the next joint
    next_position: Reals  # (3,)
    joint_axis: RealMatrix  # (k+1, 3) unit vectors in the palm
    joint_point: RealMatrix  # (k+1, 3) on the axes
    object_surface: RealMatrix  # (9, 3), see `kinematics.surface`
    hand_surface: RealMatrix  # (9, 3)
    raw_normal: RealMatrix  # (3, 3) the normal, not normalised, and parts of its derivatives
    weights: RealMatrices  # (2, 3, d+1) of the control points for the value and two derivatives, in both parameters
    lower_weights: Reals  # (d+1,) of a lower degree
    largest: Reals  # (10,) bounds of a surface's derivatives over a box
    arm: Reals  # (3,) from a joint to the hand's point


class SetQuestion(NamedTuple):
    """Can these contacts be made together?"""

    contacts: Wholes  # (c,); b stands for the object's origin
    use: Wholes  # (u,) the coordinates that concern them
    derivative_bounds: RealArrays5  # (b, 2, cells, cells, 10), see `taylor.worst`
    cones: (
        RealMatrix  # (a, 5) bounds of the object's axes: which axis, a direction of the palm, the angle from it [rad]
    )


class LineWork(NamedTuple):
    """The line between two contacts: on the hand, then on the object."""

    line: RealMatrix  # (2, 3)
    slope: RealMatrices  # (2, n, 3) derivatives
    gradient: Reals  # (n,) of the difference of its squared lengths
    form: RealMatrix  # (n, n) half of the second derivatives of its squared length on the hand
    unit: RealMatrix  # (2, 3) unit vectors along it
    unit_slope: RealMatrices  # (2, n, 3)
    unit_bound: RealMatrix  # (2, 2) remainder, and how far the unit vector strays
    across: RealMatrix  # (4, 3) unit vectors across it, two on each body
    arcs: RealMatrix  # (c, 5) spins about it, see `spins.spins`


class AngleTerms(NamedTuple):
    """Polynomials of numbers that conditions on angles are made of."""

    value: RealMatrix  # (16, 3) in the middle, remainder, how far it strays
    slope: RealMatrix  # (16, n)


class SetWork(NamedTuple):
    """Workspace of `set_search.explore_set`."""

    box: CenteredBox
    polynomials: Polynomials
    taylor: TaylorWork
    line: LineWork
    terms: AngleTerms


class PoseQuestion(NamedTuple):
    """Is there a pose of the object in which each contact can be made?"""

    use: WholeMatrix  # (b, u) the coordinates that concern each contact: first the shared ones, pose and joints
    sizes: Wholes  # (b,) how many these are
    derivative_bounds: RealArrays5  # (b, 2, cells, cells, 10), see `taylor.worst`
    middle: Reals  # (3,) the point of the object whose position is searched
    near: RealMatrix  # (3, 2) bounds of the origin's position
    shared: int  # coordinates that the search of the poses splits, the first in each row of `use`


class TurnWork(NamedTuple):
    """A contact for poses of the object in a box."""

    rotation: RealMatrix  # (3, 3) of the object
    turn: RealMatrix  # (4, 3) its angular velocities, by the components of the quaternion
    point: Reals  # (3,) the object's, from the middle, turned
    direction: Reals  # (3,) the object's, turned
    offset: Reals  # (3,) of a point from the middle
    gradient: RealMatrix  # (7, n) derivatives of rows
    step: Reals  # (n,) towards where the rows are nearest to zero
    side: Reals  # (n,) half widths


class InnerWork(NamedTuple):
    """The searches within a box of poses."""

    box: RealMatrices  # (., n, 2) that wait in an inner search
    newton: RealMatrix  # (6, 7) normal equations of a Newton step, and what it is to remove
    guess: RealMatrix  # (s, n) for each box of poses that waits, where contacts may be made
    last: Wholes  # (s,) the contact that discarded a box near by
    left: RealArrays5  # (s, b, m, u, 2) boxes of each contact's own coordinates that are left for a box of poses
    many: WholeMatrix  # (s, b) how many these are; 0: no search has come to an end yet, all of them are


class PoseWork(NamedTuple):
    """Workspace of `pose_search.explore_poses`."""

    box: CenteredBox
    polynomials: Polynomials  # of one contact; the tolerance of all
    taylor: TaylorWork
    turned: TurnWork
    inner: InnerWork


def stack(n: int, deepest: int, kept: int) -> Layout[Stack]:
    """Room for so many boxes that wait, and small ones."""
    shapes = {"box": (deepest, n, 2), "share": (deepest,), "small": (kept, n, 2), "small_share": (kept,)}
    return Layout(Stack, shapes | {"counts": (3,)})


def set_work(flat: Flat, question: SetQuestion) -> tuple[Layout[Any], ...]:
    """A `SetWork`, one layout a field."""
    n, many = len(flat.coordinates.lower), len(question.contacts) + len(question.cones)
    line = {"line": (2, 3), "slope": (2, n, 3), "gradient": (n,), "form": (n, n), "unit": (2, 3)}
    line |= {"unit_slope": (2, n, 3), "unit_bound": (2, 2), "across": (4, 3), "arcs": (many, 5)}
    terms = {"value": (16, 3), "slope": (16, n)}
    return *_taylor(flat, many), Layout(LineWork, line), Layout(AngleTerms, terms)


def pose_work(flat: Flat, question: PoseQuestion, deepest: int) -> tuple[Layout[Any], ...]:
    """A `PoseWork` for a stack of so many boxes, one layout a field."""
    n, b = len(flat.coordinates.lower), len(flat.chains.joints)
    turned = {"rotation": (3, 3), "turn": (4, 3), "gradient": (7, n), "step": (n,), "side": (n,)}
    turned |= dict.fromkeys(("point", "direction", "offset"), (3,))
    inner = {"box": (DEEPEST_INNER, n, 2), "newton": (6, 7), "guess": (deepest, n), "last": (deepest,)}
    own = question.use.shape[1] - question.shared
    inner |= {"left": (deepest, b, MOST_LEFT, own, 2), "many": (deepest, b)}
    return *_taylor(flat, b), Layout(TurnWork, turned), Layout(InnerWork, inner)


def _taylor(flat: Flat, many: int) -> tuple[Layout[Any], ...]:
    n, joints, weights = len(flat.coordinates.lower), flat.chains.kind.shape[1] + 1, _degree(flat) + 1
    polynomials = {"value": (many, 4, 3), "slope": (many, 4, n, 3), "remainder": (many, 4), "swing": (many, 4)}
    polynomials |= {"bend": (many, joints - 1, joints - 1, 3), "rest": (many,)}
    work: dict[str, tuple[int, ...]] = dict.fromkeys(("link_rotation", "next_rotation", "raw_normal"), (3, 3))
    work |= {"link_position": (3,), "next_position": (3,), "joint_axis": (joints, 3), "joint_point": (joints, 3)}
    work |= {"object_surface": (9, 3), "hand_surface": (9, 3), "largest": (10,), "arm": (3,)}
    work |= {"weights": (2, 3, weights), "lower_weights": (weights,)}
    return (
        Layout(CenteredBox, dict.fromkeys(CenteredBox._fields, (n,))),
        Layout(Polynomials, polynomials | {"tolerance": (many,)}),
        Layout(TaylorWork, work),
    )


def _degree(flat: Flat) -> int:
    """The highest of a patch."""
    return max(1, int(flat.regions.degree.max()))
