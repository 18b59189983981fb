"""Which sets of contacts are worth searching for a contradiction: those of which no configuration is found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from handfast.synthesis.search.starts import Starts
from handfast.synthesis.task import PoseBounds, Task
from handfast.synthesis.task_problem import TaskProblem


def suspects(task: Task, subsets: Sequence[tuple[int, ...]]) -> dict[tuple[int, ...], bool]:
    """The sets of contacts that may be impossible, and of each whether it has no other of them within it.

    A set of which one block of local searches proves a configuration is left out: nothing can show it impossible. The
    last set is not looked for. This only says where to search; no proof rests on it.

    Args:
        subsets: smaller ones first, all contacts last; in them the number of contacts stands for the object's origin.
    """
    out: dict[tuple[int, ...], bool] = {}
    for subset in subsets:
        if any(set(other) <= set(subset) for other in out):
            out[subset] = False
        elif subset == subsets[-1] or not _possible(task, subset):
            out[subset] = True
    return out


def _possible(task: Task, subset: tuple[int, ...]) -> bool:
    """Do local searches find a configuration of these contacts alone?"""
    b = len(task.contact_pairs)
    position = task.pose.position if b in subset else PoseBounds.none().position
    pairs = tuple(task.contact_pairs[k] for k in subset if k < b)
    part = replace(task, contact_pairs=pairs, pose=PoseBounds(position, task.pose.axes))
    return bool(Starts(TaskProblem.of(part), 0).run(1))
