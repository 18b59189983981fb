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
    from handfast.datasets.dataset_rows import GraspChanges as GraspChanges
    from handfast.datasets.labels.label_dataset import label_dataset as label_dataset
    from handfast.datasets.labels.label_files import load_labels as load_labels
    from handfast.datasets.labels.labeller import Labelling as Labelling
    from handfast.datasets.scene_source import SceneSource as SceneSource
    from handfast.geometry.contacts import contact_grasp as contact_grasp
    from handfast.geometry.contacts import find_contacts as find_contacts
    from handfast.geometry.scene import Scene as Scene
    from handfast.measures.measuring import measure as measure
    from handfast.measures.measuring import measure_columns as measure_columns
    from handfast.model.body import Body as Body
    from handfast.model.configuration import Configuration as Configuration
    from handfast.model.cylinder_side import ConeSide as ConeSide
    from handfast.model.cylinder_side import CylinderSide as CylinderSide
    from handfast.model.grasp import Contact as Contact
    from handfast.model.grasp import Grasp as Grasp
    from handfast.model.grasp import GraspJoint as GraspJoint
    from handfast.model.hand import Hand as Hand
    from handfast.model.mechanism import Mechanism as Mechanism
    from handfast.model.provenance import Provenance as Provenance
    from handfast.model.provenance import SourceFile as SourceFile
    from handfast.model.region import Bezier as Bezier
    from handfast.model.region import Cap as Cap
    from handfast.model.servo import servo_commands as servo_commands
    from handfast.pictures import Entry as Entry
    from handfast.pictures import write_report as write_report
    from handfast.pictures.data_frames import to_frame as to_frame
    from handfast.pictures.live.open_page import view as view
    from handfast.pictures.map_picture import draw_map as draw_map
    from handfast.pictures.map_picture import draw_sweep as draw_sweep
    from handfast.planning.closing import close as close
    from handfast.planning.grasp_for import grasp_for as grasp_for
    from handfast.planning.plan_grasps import plan as plan
    from handfast.planning.propose_tasks import propose as propose
    from handfast.planning.question import PlanLimits as PlanLimits
    from handfast.readers.configuration_file import load_configuration as load_configuration
    from handfast.readers.grasp_file import load_grasp as load_grasp
    from handfast.readers.grasp_file import save_grasp as save_grasp
    from handfast.readers.graspit.graspit_world import load_graspit_world as load_graspit_world
    from handfast.readers.load_body import load_body as load_body
    from handfast.readers.load_hand import load_hand as load_hand
    from handfast.readers.region_file import load_hand_regions as load_hand_regions
    from handfast.saved import verify as verify
    from handfast.simulation.beside_path import PathBeside as PathBeside
    from handfast.simulation.beside_path import beside_path as beside_path
    from handfast.simulation.result import SimulationResult as SimulationResult
    from handfast.simulation.settled import Settled as Settled
    from handfast.simulation.settling import GraspInScene as GraspInScene
    from handfast.simulation.settling import settle as settle
    from handfast.simulation.simulate import simulate as simulate
    from handfast.simulation.simulate import simulate_bodies as simulate_bodies
    from handfast.stability.answers import check as check
    from handfast.stability.answers import maximum as maximum
    from handfast.stability.answers import torques as torques
    from handfast.stability.answers.batch_answer import BatchAnswer as BatchAnswer
    from handfast.stability.answers.margin import Margin as Margin
    from handfast.stability.problem.grasp_limits import GraspLimits as GraspLimits
    from handfast.stability.problem.loads import Loads as Loads
    from handfast.stability.problem.loads import load_loads as load_loads
    from handfast.stability.problem.settings import Settings as Settings
    from handfast.stability.studies.batch import check_many as check_many
    from handfast.stability.studies.batch import max_many as max_many
    from handfast.stability.studies.batch import torques_many as torques_many
    from handfast.stability.studies.hold import hold as hold
    from handfast.stability.studies.maps import force_map as force_map
    from handfast.stability.studies.maps import sweep as sweep
    from handfast.stability.studies.margin_search import margin as margin
    from handfast.stability.studies.prepared import prepare as prepare
    from handfast.stability.studies.sampled_maximum import Perturbation as Perturbation
    from handfast.stability.studies.sampled_maximum import SampledMaximum as SampledMaximum
    from handfast.stability.studies.sampled_maximum import sampled_maximum as sampled_maximum
    from handfast.synthesis.query import synthesize as synthesize
    from handfast.synthesis.task import ContactPair as ContactPair
    from handfast.synthesis.task import PoseBounds as PoseBounds
    from handfast.synthesis.task import Task as Task
    from handfast.synthesis.task_file import load_task as load_task

_HOME = {
    "Scene": "geometry.scene",
    "servo_commands": "model.servo",
    "to_frame": "pictures.data_frames",
    "draw_map": "pictures.map_picture",
    "draw_sweep": "pictures.map_picture",
    "Provenance": "model.provenance",
    "load_hand_regions": "readers.region_file",
    "Entry": "pictures",
    "write_report": "pictures",
    "SourceFile": "model.provenance",
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
    "load_graspit_world": "readers.graspit.graspit_world",
    "load_hand": "readers.load_hand",
    "measure": "measures.measuring",
    "measure_columns": "measures.measuring",
    "Mechanism": "model.mechanism",
    "Bezier": "model.region",
    "Cap": "model.region",
    "ConeSide": "model.cylinder_side",
    "CylinderSide": "model.cylinder_side",
    "label_dataset": "datasets.labels.label_dataset",
    "load_labels": "datasets.labels.label_files",
    "Labelling": "datasets.labels.labeller",
    "GraspChanges": "datasets.dataset_rows",
    "SceneSource": "datasets.scene_source",
    "close": "planning.closing",
    "plan": "planning.plan_grasps",
    "propose": "planning.propose_tasks",
    "grasp_for": "planning.grasp_for",
    "PlanLimits": "planning.question",
    "GraspLimits": "stability.problem.grasp_limits",
    "verify": "saved",
    "SimulationResult": "simulation.result",
    "simulate": "simulation.simulate",
    "Settled": "simulation.settled",
    "GraspInScene": "simulation.settling",
    "settle": "simulation.settling",
    "simulate_bodies": "simulation.simulate",
    "PathBeside": "simulation.beside_path",
    "beside_path": "simulation.beside_path",
    "hold": "stability.studies.hold",
    "Loads": "stability.problem.loads",
    "load_loads": "stability.problem.loads",
    "BatchAnswer": "stability.answers.batch_answer",
    "check_many": "stability.studies.batch",
    "max_many": "stability.studies.batch",
    "torques_many": "stability.studies.batch",
    "force_map": "stability.studies.maps",
    "sweep": "stability.studies.maps",
    "Margin": "stability.answers.margin",
    "margin": "stability.studies.margin_search",
    "Perturbation": "stability.studies.sampled_maximum",
    "prepare": "stability.studies.prepared",
    "SampledMaximum": "stability.studies.sampled_maximum",
    "sampled_maximum": "stability.studies.sampled_maximum",
    "check": "stability.answers",
    "maximum": "stability.answers",
    "torques": "stability.answers",
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
