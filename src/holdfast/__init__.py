"""Holdfast: will this grasp hold, and can the hand take that hold? With proofs, for real hands.

The names below load on first use, so that `import holdfast` stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from holdfast.answer import Reach as Reach
    from holdfast.answer import Stop as Stop
    from holdfast.answer import Verdict as Verdict
    from holdfast.body import Body as Body
    from holdfast.body import load_body as load_body
    from holdfast.configuration import Configuration as Configuration
    from holdfast.configuration import load_configuration as load_configuration
    from holdfast.contacts import contact_grasp as contact_grasp
    from holdfast.contacts import find_contacts as find_contacts
    from holdfast.errors import InputError as InputError
    from holdfast.grasp import Contact as Contact
    from holdfast.grasp import Grasp as Grasp
    from holdfast.grasp import GraspJoint as GraspJoint
    from holdfast.grasp_file import load_grasp as load_grasp
    from holdfast.grasp_file import save_grasp as save_grasp
    from holdfast.hand import Hand as Hand
    from holdfast.hand import load_hand as load_hand
    from holdfast.mechanism import Mechanism as Mechanism
    from holdfast.planning.close import close as close
    from holdfast.planning.closing.plan import plan as plan
    from holdfast.planning.regions.propose import propose as propose
    from holdfast.planning.tasks.grasp_for import grasp_for as grasp_for
    from holdfast.region import Bezier as Bezier
    from holdfast.region import Cap as Cap
    from holdfast.replay import verify as verify
    from holdfast.stability.hold import hold as hold
    from holdfast.stability.loads import Loads as Loads
    from holdfast.stability.loads_file import load_loads as load_loads
    from holdfast.stability.many import max_many as max_many
    from holdfast.stability.maps import force_map as force_map
    from holdfast.stability.maps import sweep as sweep
    from holdfast.stability.margin import Margin as Margin
    from holdfast.stability.margin import margin as margin
    from holdfast.stability.queries import check as check
    from holdfast.stability.queries import maximum as maximum
    from holdfast.stability.queries import torques as torques
    from holdfast.stability.settings import Settings as Settings
    from holdfast.synthesis.queries import synthesize as synthesize
    from holdfast.synthesis.task import PoseBounds as PoseBounds
    from holdfast.synthesis.task import Task as Task
    from holdfast.synthesis.task import Touch as Touch
    from holdfast.synthesis.task_file import load_task as load_task

_HOME = {
    "Reach": "answer",
    "Stop": "answer",
    "Verdict": "answer",
    "Body": "body",
    "load_body": "body",
    "Configuration": "configuration",
    "load_configuration": "configuration",
    "contact_grasp": "contacts",
    "find_contacts": "contacts",
    "InputError": "errors",
    "Contact": "grasp",
    "Grasp": "grasp",
    "GraspJoint": "grasp",
    "load_grasp": "grasp_file",
    "save_grasp": "grasp_file",
    "Hand": "hand",
    "load_hand": "hand",
    "Mechanism": "mechanism",
    "close": "planning.close",
    "grasp_for": "planning.tasks.grasp_for",
    "plan": "planning.closing.plan",
    "propose": "planning.regions.propose",
    "Bezier": "region",
    "Cap": "region",
    "verify": "replay",
    "hold": "stability.hold",
    "Loads": "stability.loads",
    "load_loads": "stability.loads_file",
    "max_many": "stability.many",
    "force_map": "stability.maps",
    "sweep": "stability.maps",
    "Margin": "stability.margin",
    "margin": "stability.margin",
    "check": "stability.queries",
    "maximum": "stability.queries",
    "torques": "stability.queries",
    "Settings": "stability.settings",
    "synthesize": "synthesis.queries",
    "PoseBounds": "synthesis.task",
    "Task": "synthesis.task",
    "Touch": "synthesis.task",
    "load_task": "synthesis.task_file",
}

__all__ = sorted(_HOME)
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'holdfast' has no attribute '{name}'")
    return getattr(importlib.import_module(f"holdfast.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
