"""Random starts of the local search, compiled: one contact placed exactly, with a random spin."""

from __future__ import annotations

import numpy as np

from handfast.core.compiled import inner
from handfast.synthesis.search.kernel.balls import get
from handfast.synthesis.search.kernel.contact_equations import chain, rotation, surface
from handfast.synthesis.search.kernel.kinematics import NORMAL
from handfast.synthesis.search.workspace import PLACEMENT_NUMBERS, POSE_TRIES
from handfast.synthesis.task_groups import CAP_REGION, POSE, QUATERNION


@inner
def start(numbers, task, interior, x, contact, place):
    """A random start into x (n, 2); contact: `ContactBalls`, place: `StartWork`.

    numbers: (n + 1 + ALIGNED * NUMBERS,) uniform in [0, 1). Of `POSE_TRIES` poses it takes the one that violates the
    bounds of the object's axes least.
    """
    kept, n, b = place.pose, x.shape[0], task.chains.joints.shape[0]
    first = task.coordinates.parameter[0] - POSE
    for i in range(n):
        x[i, 0] = interior.lower[i] + numbers[i] * (interior.upper[i] - interior.lower[i])
        x[i, 1] = 0.0
    for i in range(QUATERNION):
        x[first + 3 + i, 0] = 1.0 if i == 0 else 0.0
    k = min(int(numbers[n] * b), b - 1)
    chain(k, x, task.chains, contact)
    parameter = task.coordinates.parameter[k]
    surface(k, k, get(x, parameter), get(x, parameter + 1), task.regions, contact.object_surface, contact)
    best = np.inf
    for attempt in range(POSE_TRIES):
        at = n + 1 + attempt * PLACEMENT_NUMBERS
        _inward(k, numbers[at : at + PLACEMENT_NUMBERS], task.regions, task.coordinates.parameter[k], x, contact, place)
        _place(k, numbers[at + 2], task.regions, first, interior, x, contact, place)
        violation = 0.0
        for l in range(3):
            for i in range(3):
                value = contact.object_rotation[0, i, l, 0]
                bounds = task.coordinates.axes[3 * l + i]
                violation += max(0.0, bounds[0] - value) + max(0.0, value - bounds[1])
        if violation < best:
            best = violation
            for i in range(POSE):
                kept[i] = x[first + i, 0]
        if best == 0.0:
            break
    for i in range(POSE):
        x[first + i, 0] = kept[i]


@inner
def _inward(k, numbers, regions, first, x, contact, place):
    """The hand's point or centre, and its direction: the patch's normal, or a random one within the cap's cone.

    first: of the contact's parameters.
    """
    if regions.hand[k] != CAP_REGION:
        surface(
            regions.hand.shape[0] + k, k, get(x, first + 2), get(x, first + 3), regions, contact.hand_surface, contact
        )
        for i in range(3):
            place.inward[i] = contact.hand_surface[NORMAL, i, 0]
            place.spot[i] = contact.hand_surface[0, i, 0]
        return
    edge = max(regions.cone[k], -1.0)
    c = edge + (1 - edge) * numbers[0]
    s = np.sqrt(max(0.0, 1 - c * c))
    _frame(regions.axis[k], 2 * np.pi * numbers[1], place.frames[0], place.across)
    for i in range(3):
        place.inward[i] = regions.sign[k] * (c * regions.axis[k, i] + s * place.frames[0, i, 0])
        place.spot[i] = regions.center[k, i]


@inner
def _place(k, spin, regions, first, interior, x, contact, place):
    """Turn the object so that its normal opposes the hand's, with a spin [turns] about it; move it to the contact.

    first: coordinate of the pose.
    """
    on_hand, on_object, between = place.frames[0], place.frames[1], place.frames[2]
    R = contact.link_rotation
    for i in range(3):
        place.opposite[i] = 0.0
        for j in range(3):
            place.opposite[i] -= R[i, j, 0] * place.inward[j]
    _frame(place.opposite, 2 * np.pi * spin, on_hand, place.across)
    _frame(contact.object_surface[NORMAL, :, 0], 0.0, on_object, place.across)
    for i in range(3):
        for j in range(3):
            between[i, j] = 0.0
            for l in range(3):
                between[i, j] += on_hand[i, l] * on_object[j, l]
    _quaternion(between, x, first + 3)
    rotation(x, first + 3, contact.object_rotation)
    for i in range(3):
        value = contact.link_position[i, 0]
        for j in range(3):
            y = contact.object_surface[0, j, 0]
            if regions.hand[k] == CAP_REGION:
                y += regions.radius[k] * contact.object_surface[NORMAL, j, 0]
            value += R[i, j, 0] * place.spot[j] - contact.object_rotation[0, i, j, 0] * y
        x[first + i, 0] = min(max(value, interior.lower[first + i]), interior.upper[first + i])


@inner
def _frame(z, spin, out, across):
    """A rotation (3, 3) whose third column is the unit vector z, turned about it by `spin`; across (2, 3): work."""
    e1, e2 = across[0], across[1]
    l = 0
    for i in range(3):
        if abs(z[i]) < abs(z[l]):
            l = i
    for i in range(3):  # the unit vector l times z
        j, k = (i + 1) % 3, (i + 2) % 3
        e1[i] = (1.0 if j == l else 0.0) * z[k] - (1.0 if k == l else 0.0) * z[j]
    size = np.sqrt(e1[0] * e1[0] + e1[1] * e1[1] + e1[2] * e1[2])
    for i in range(3):
        e1[i] /= size
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        e2[i] = z[j] * e1[k] - z[k] * e1[j]
    c, s = np.cos(spin), np.sin(spin)
    for i in range(3):
        out[i, 0] = c * e1[i] + s * e2[i]
        out[i, 1] = c * e2[i] - s * e1[i]
        out[i, 2] = z[i]


@inner
def _quaternion(R, x, first):
    """Unit quaternion of a rotation (3, 3) into x[first:first+4]."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    l = 0
    for i in range(1, 3):
        if R[i, i] > R[l, l]:
            l = i
    if trace > 0:
        w = 0.5 * np.sqrt(1 + trace)
        x[first, 0] = w
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            x[first + 1 + i, 0] = (R[k, j] - R[j, k]) / (4 * w)
        return
    j, k = (l + 1) % 3, (l + 2) % 3
    v = 0.5 * np.sqrt(max(1e-300, 1 + R[l, l] - R[j, j] - R[k, k]))
    x[first, 0] = (R[k, j] - R[j, k]) / (4 * v)
    x[first + 1 + l, 0] = v
    x[first + 1 + j, 0] = (R[l, j] + R[j, l]) / (4 * v)
    x[first + 1 + k, 0] = (R[l, k] + R[k, l]) / (4 * v)
