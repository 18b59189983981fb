"""The `handfast/grasp/1` file: a grasp at contact level, for anyone who has no hand model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from handfast.core import bundled
from handfast.core.errors import InputError, kinds_checked, unknown_name
from handfast.core.files import Strict, Vector, parse_json, read_json, validate, write_text
from handfast.core.schema import written
from handfast.model.grasp import LARGEST, Contact, Grasp, GraspJoint
from handfast.model.mechanism import Mechanism
from handfast.model.provenance import Provenance

Many = Field(max_length=LARGEST)  # what is longer is refused before anything is made of it; `Grasp` looks closer


class ActuatorEntry(Strict):
    name: str
    joints: dict[str, float]
    tendon: bool = False
    backdrivable: bool = False


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
    file = bundled.resolve("grasps", str(path))
    data = read_json(file, "grasp")
    try:
        return from_dict(data, name=Path(file).stem, folder=Path(file).parent)
    except InputError as error:
        raise error.at(str(path)) from None


def from_dict(data: Any, *, name: str = "grasp", folder: str | Path | None = None) -> Grasp:
    """The grasp in a parsed `handfast/grasp/1` object; raises `InputError` as `load_grasp` does.

    `folder` is where its file is: paths of its provenance are relative to it.
    """
    entry = validate(GraspFile, data)
    mechanism = None
    if entry.mechanism is not None:
        names = [j.name for j in entry.joints]
        acts = entry.mechanism.actuators
        R = [_row(a.joints, names, f"mechanism.actuators[{i}].joints") for i, a in enumerate(acts)]
        A = [_row(c, names, f"mechanism.couplings[{i}]") for i, c in enumerate(entry.mechanism.couplings)]
        mechanism = Mechanism(
            tuple(a.name for a in acts),
            np.array(R).reshape(len(R), len(names)),
            np.array(A).reshape(len(A), len(names)),
            tuple(a.tendon for a in acts),
            tuple(a.backdrivable for a in acts),
        )
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
            "actuators": [
                {"name": n, "joints": _sparse(row, names), "tendon": t} | ({"backdrivable": True} if free else {})
                for n, row, t, free in zip(mech.actuators, mech.R, mech.tendon, mech.backdrivable, strict=True)
            ],
            "couplings": [_sparse(row, names) for row in mech.A],
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
    try:
        parse_json(text)  # what could not be read again is not written
    except InputError as error:
        raise error.at(str(path)) from None
    write_text(path, text, force=force)


def _row(weights: dict[str, float], names: list[str], field: str) -> list[float]:
    for name in weights:
        if name not in names:
            raise unknown_name("joint", name, names, field=field)
    return [weights.get(n, 0.0) for n in names]


def _sparse(row: Any, names: list[str]) -> dict[str, float]:
    return {n: float(v) for n, v in zip(names, row, strict=True) if v != 0}
