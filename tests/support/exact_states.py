"""Grasps and states of the package as the proofs know them, and states that are altered."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from handfast.model.grasp import Grasp
from handfast.proofs.grasp import GraspData, read_grasp
from handfast.proofs.states import Problem, State
from handfast.readers.grasp_file import to_dict


def data(grasp: Grasp) -> GraspData:
    """The grasp as its file says it, with its commands."""
    return read_grasp(to_dict(grasp), "grasp").with_command(np.array(grasp.command))


def problem(grasp: Grasp, wrench: Any, *, eta: float = 0.0, limits: Any = None, **rest: Any) -> Problem:
    """What a state has to solve. limits: torques by name."""
    g = data(grasp)
    most = np.array([(limits or {}).get(name, np.inf) for name in g.actuators])
    load = np.concatenate([wrench, np.zeros(6 - len(wrench))])
    return Problem(g, load, cos=float(np.cos(eta)), sin=float(np.sin(eta)), torque_limit=most, **rest)


def moved(x: State, name: str, i: int, by: float) -> State:
    """With one number changed."""
    value = np.array(getattr(x, name))
    value[i] += by
    return replace(x, **{name: value})
