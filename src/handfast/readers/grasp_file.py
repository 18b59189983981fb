"""The `handfast/grasp/1` file: a grasp at contact level, for anyone who has no hand model."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core.arrays import Array
from handfast.core.errors import FaultsOf, kinds_checked, unknown_name
from handfast.core.files import Strict, Vector, parse_json, read_named, validate, write_text
from handfast.core.schema import LEFT_OUT, InFiles, written
from handfast.model.grasp import Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.model.provenance import Provenance
from handfast.proofs.constants import MAX_GRASP_SIZE

Many = Field(max_length=MAX_GRASP_SIZE)  # what is longer is refused before anything is made of it; `Grasp` looks closer


@dataclass(frozen=True)
class ActuatorEntry(InFiles):
    """A row of R by joint, and what its motor is."""

    name: str
    joints: dict[str, float]
    tendon: bool = False
    backdrivable: bool = field(default=False, metadata=LEFT_OUT)


class MechanismEntry(Strict):
    actuators: Annotated[list[ActuatorEntry], Many]
    couplings: Annotated[list[dict[str, float]], Many] = Field(default_factory=list)


class GraspFile(Strict):
    """The file as it stands on disk; see the documentation page on file formats."""

    format: Literal["handfast/grasp/1"] = Field(alias="schema")
    name: str | None = None
    contacts: Annotated[list[Contact], Many]
    joints: Annotated[list[GraspJoint], Many] = Field(default_factory=list)
    mechanism: MechanismEntry | None = None
    preload: dict[str, float] = Field(default_factory=dict)
    mass: Annotated[float, Field(ge=0)] | None = None
    center_of_mass: Vector | None = None
    provenance: Provenance | None = None


def load_grasp(path: str | Path) -> Grasp:
    """Read a `handfast/grasp/1` file, or a bundled grasp by name.

    Raises:
        InputError: one line with file, field, fault and what would be right: missing file, no JSON,
            unknown or missing field, a normal that is zero or not of unit length, NaN, negative
            friction, `moves` out of range, an unknown joint or actuator, no contacts, too many of them.
    """
    return read_named("grasps", path, "grasp", lambda data, at: from_dict(data, name=at.stem, folder=at.parent))


def from_dict(data: Any, *, name: str = "grasp", folder: str | Path | None = None) -> Grasp:
    """The grasp in a parsed `handfast/grasp/1` object; raises `InputError` as `load_grasp` does.

    `folder` is where its file is: paths of its provenance are relative to it.
    """
    entry = validate(GraspFile, data)
    mechanism = None
    if entry.mechanism is not None:
        names = [j.name for j in entry.joints]
        A = [_row(c, names, f"mechanism.couplings[{i}]") for i, c in enumerate(entry.mechanism.couplings)]
        couplings = np.array(A).reshape(len(A), len(names))
        mechanism = mechanism_of(entry.mechanism.actuators, couplings, names, "mechanism.actuators")
    provenance = entry.provenance
    return Grasp(
        entry.contacts,
        entry.joints,
        mechanism,
        entry.preload,
        entry.name or name,
        mass=entry.mass,
        center_of_mass=entry.center_of_mass,
        provenance=provenance.resolved_from(folder) if provenance and folder is not None else provenance,
    )


def to_dict(grasp: Grasp) -> dict[str, Any]:
    """What the equations know of a grasp, as a `handfast/grasp/1` object; `from_dict` restores that exactly.

    Questions and proofs hold it: what they claim depends on nothing else. A load states its wrench, so that mass
    and centre of mass are not in it; `file_dict` has them.
    """
    names = [j.name for j in grasp.joints]
    mech = grasp.mechanism
    data: dict[str, Any] = {
        "schema": "handfast/grasp/1",
        "name": grasp.name,
        "contacts": written(grasp.contacts),
        "joints": [{"name": j.name, "type": j.type} | written(j) for j in grasp.joints],
        "mechanism": {
            "actuators": actuators_to_dict(mech, names),
            "couplings": [by_joint(row, names) for row in mech.A],
        },
        "preload": grasp.preload,
    }
    return data


def file_dict(grasp: Grasp, folder: str | Path = ".") -> dict[str, Any]:
    """The whole `handfast/grasp/1` object: `to_dict`, and what is known of the object and of where the grasp came
    from, with paths relative to `folder`."""
    data = to_dict(grasp)
    if grasp.mass is not None:
        data["mass"] = grasp.mass
    if grasp.center_of_mass is not None:
        data["center_of_mass"] = grasp.center_of_mass.tolist()
    if grasp.provenance:
        data["provenance"] = written(grasp.provenance.relative_to(folder))
    return data


@kinds_checked
def save_grasp(grasp: Grasp, path: str | Path, *, force: bool = False) -> None:
    """Write a `handfast/grasp/1` file.

    Raises:
        InputError: it exists and `force` is not set; a number that no file may have.
    """
    text = json.dumps(file_dict(grasp, Path(path).parent), indent=1) + "\n"
    with FaultsOf(path):
        parse_json(text)  # what could not be read again is not written
    write_text(path, text, force=force)


def mechanism_of(actuators: list[ActuatorEntry], couplings: Array, names: Sequence[str], field: str) -> Mechanism:
    """The mechanism of actuators in a file, which stand at `field`, and rows of couplings (k, l) of named joints."""
    R = [_row(a.joints, names, f"{field}[{i}].joints") for i, a in enumerate(actuators)]
    return Mechanism(
        tuple(a.name for a in actuators),
        np.array(R).reshape(len(R), len(names)),
        couplings,
        tuple(a.tendon for a in actuators),
        tuple(a.backdrivable for a in actuators),
    )


def actuators_to_dict(mechanism: Mechanism, names: Sequence[str]) -> list[dict[str, Any]]:
    """The actuators as files have them; `mechanism_of` reads them."""
    each = zip(mechanism.actuators, mechanism.R, mechanism.tendon, mechanism.backdrivable, strict=True)
    return [written(ActuatorEntry(n, by_joint(row, names), *flags)) for n, row, *flags in each]


def _row(weights: dict[str, float], names: Sequence[str], field: str) -> list[float]:
    for name in weights:
        if name not in names:
            raise unknown_name("joint", name, names, field=field)
    return [weights.get(n, 0.0) for n in names]


def by_joint(row: Any, names: Sequence[str]) -> dict[str, float]:
    """The numbers (l,) that are not 0, by the joint's name."""
    return {n: float(v) for n, v in zip(names, row, strict=True) if v != 0}
