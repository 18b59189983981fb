"""Handfast: will this grasp hold, and can the hand take that hold? With proofs, for real hands.

The names below load on first use, so that `import handfast` stays quick.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from handfast.core.answer import Reach as Reach
    from handfast.core.answer import Stop as Stop
    from handfast.core.answer import Verdict as Verdict
    from handfast.core.errors import InputError as InputError
    from handfast.datasets.labels.label_dataset import label_dataset as label_dataset
    from handfast.geometry.contacts import contact_grasp as contact_grasp
    from handfast.geometry.contacts import find_contacts as find_contacts
    from handfast.geometry.scene import Scene as Scene
    from handfast.measures.measuring import measure as measure
    from handfast.model.body import Body as Body
    from handfast.model.configuration import Configuration as Configuration
    from handfast.model.cylinder_side import ConeSide as ConeSide
    from handfast.model.cylinder_side import CylinderSide as CylinderSide
    from handfast.model.grasp import Contact as Contact
    from handfast.model.grasp import Grasp as Grasp
    from handfast.model.grasp import GraspJoint as GraspJoint
    from handfast.model.hand import Hand as Hand
    from handfast.model.mechanism import Mechanism as Mechanism
    from handfast.model.region import Bezier as Bezier
    from handfast.model.region import Cap as Cap
    from handfast.pictures.live.open_page import view as view
    from handfast.planning.closing import close as close
    from handfast.planning.grasp_for import grasp_for as grasp_for
    from handfast.planning.plan_grasps import plan as plan
    from handfast.planning.propose_tasks import propose as propose
    from handfast.planning.question import PlanLimits as PlanLimits
    from handfast.readers.configuration_file import load_configuration as load_configuration
    from handfast.readers.grasp_file import load_grasp as load_grasp
    from handfast.readers.grasp_file import save_grasp as save_grasp
    from handfast.readers.load_body import load_body as load_body
    from handfast.readers.load_hand import load_hand as load_hand
    from handfast.readers.region_file import load_hand_regions as load_hand_regions
    from handfast.saved import verify as verify
    from handfast.simulation.settling import settle as settle
    from handfast.simulation.simulate import simulate as simulate
    from handfast.stability.problem.grasp_limits import GraspLimits as GraspLimits
    from handfast.stability.problem.loads import Loads as Loads
    from handfast.stability.problem.loads import load_loads as load_loads
    from handfast.stability.problem.settings import Settings as Settings
    from handfast.stability.studies.batch import check_many as check_many
    from handfast.stability.studies.batch import max_many as max_many
    from handfast.stability.studies.batch import torques_many as torques_many
    from handfast.stability.studies.maps import sweep as sweep
    from handfast.stability.studies.margin_search import margin as margin
    from handfast.stability.studies.prepared import prepare as prepare
    from handfast.stability.studies.questions import check as check
    from handfast.stability.studies.questions import force_map as force_map
    from handfast.stability.studies.questions import hold as hold
    from handfast.stability.studies.questions import maximum as maximum
    from handfast.stability.studies.questions import torques as torques
    from handfast.synthesis.query import synthesize as synthesize
    from handfast.synthesis.task import ContactPair as ContactPair
    from handfast.synthesis.task import PoseBounds as PoseBounds
    from handfast.synthesis.task import Task as Task
    from handfast.synthesis.task_file import load_task as load_task

_HOME = {
    "Scene": "geometry.scene",
    "load_hand_regions": "readers.region_file",
    "Reach": "core.answer",
    "Stop": "core.answer",
    "Verdict": "core.answer",
    "InputError": "core.errors",
    "contact_grasp": "geometry.contacts",
    "find_contacts": "geometry.contacts",
    "Body": "model.body",
    "load_body": "readers.load_body",
    "Configuration": "model.configuration",
    "load_configuration": "readers.configuration_file",
    "Contact": "model.grasp",
    "Grasp": "model.grasp",
    "GraspJoint": "model.grasp",
    "load_grasp": "readers.grasp_file",
    "save_grasp": "readers.grasp_file",
    "Hand": "model.hand",
    "load_hand": "readers.load_hand",
    "measure": "measures.measuring",
    "Mechanism": "model.mechanism",
    "Bezier": "model.region",
    "Cap": "model.region",
    "ConeSide": "model.cylinder_side",
    "CylinderSide": "model.cylinder_side",
    "label_dataset": "datasets.labels.label_dataset",
    "close": "planning.closing",
    "plan": "planning.plan_grasps",
    "propose": "planning.propose_tasks",
    "grasp_for": "planning.grasp_for",
    "PlanLimits": "planning.question",
    "GraspLimits": "stability.problem.grasp_limits",
    "verify": "saved",
    "simulate": "simulation.simulate",
    "settle": "simulation.settling",
    "hold": "stability.studies.questions",
    "Loads": "stability.problem.loads",
    "load_loads": "stability.problem.loads",
    "check_many": "stability.studies.batch",
    "max_many": "stability.studies.batch",
    "torques_many": "stability.studies.batch",
    "force_map": "stability.studies.questions",
    "sweep": "stability.studies.maps",
    "margin": "stability.studies.margin_search",
    "prepare": "stability.studies.prepared",
    "check": "stability.studies.questions",
    "maximum": "stability.studies.questions",
    "torques": "stability.studies.questions",
    "Settings": "stability.problem.settings",
    "synthesize": "synthesis.query",
    "PoseBounds": "synthesis.task",
    "Task": "synthesis.task",
    "ContactPair": "synthesis.task",
    "load_task": "synthesis.task_file",
    "view": "pictures.live.open_page",
}

__all__ = sorted(_HOME)
__version__ = "0.2.0"


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'handfast' has no attribute '{name}'")
    return getattr(importlib.import_module(f"handfast.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
