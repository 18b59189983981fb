"""What all GraspIt! files share: millimetres, degrees and grams, numbers and transforms.

GraspIt!: A. T. Miller and P. K. Allen, "GraspIt! A versatile simulator for robotic grasping" (2004), and its manual.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.core.transforms import quaternion_matrix, transform
from handfast.readers.xml_file import read_xml

MILLI = 1e-3  # [m/mm, kg/g]
FULL = re.compile(r"\(([^()\[\]]*)\)\s*\[([^()\[\]]*)\]")


def parse(path: Path, roots: Sequence[str]) -> Element:
    """The root element of a GraspIt! file, which is one of `roots`; `InputError` naming the file if not."""
    root = read_xml(path)
    if root.tag not in roots:
        wanted = " or ".join(f"<{r}>" for r in roots)
        raise InputError(f"has root element <{root.tag}>; {wanted} is needed", source=str(path))
    return root


def text_of(e: Element, tag: str) -> str:
    """The text of a child element, "" if there is none."""
    found = e.find(tag)
    return "" if found is None or found.text is None else found.text.strip()


def numbers_in(text: str, n: int, field: str) -> list[float]:
    """The n finite numbers of a text; `InputError` if it has others."""
    try:
        values = [float(t) for t in text.split()]
    except ValueError:
        values = []
    if len(values) != n or not np.isfinite(values).all():
        raise InputError(f"is '{text}'; {n} finite number{'s' * (n > 1)} needed", field=field)
    return values


def pose_of(e: Element, field: str) -> Array:
    """(4, 4) [m] of an element's <transform>, the identity without one: its parts multiplied in their order.

    Parts: translation (mm), rotation (degrees, axis x, y or z), rotationMatrix (nine numbers, column after column) and
    fullTransform "(w x y z)[x y z]" (mm).
    """
    pose, found = np.eye(4), e.find("transform")
    for part in () if found is None else found:
        text, where = (part.text or "").strip(), f"{field}.{part.tag}"
        if part.tag == "translation":
            pose = pose @ transform(MILLI * np.array(numbers_in(text, 3, where)))
        elif part.tag == "rotation":
            angle, _, axis = text.rpartition(" ")
            if axis not in ("x", "y", "z"):
                raise InputError(f"is '{text}'; an angle and x, y or z are needed", field=where)
            pose = pose @ transform(np.zeros(3), turned("xyz".index(axis), numbers_in(angle, 1, where)[0]))
        elif part.tag == "rotationMatrix":
            pose = pose @ transform(np.zeros(3), _orthonormal(numbers_in(text, 9, where), where))
        elif part.tag == "fullTransform":
            match = FULL.fullmatch(text)
            if not match:
                raise InputError(f"is '{text}'; (w x y z)[x y z] is needed", field=where)
            rotation = quaternion_matrix(numbers_in(match[1], 4, where))
            pose = pose @ transform(MILLI * np.array(numbers_in(match[2], 3, where)), rotation)
        else:
            raise InputError("is not a known part of a transform", field=where)
    return pose


def turned(axis: int, degrees: float) -> Array:
    """(3, 3) turn about axis 0, 1 or 2; exact at multiples of 90 degrees."""
    quarter = (degrees / 90) % 4
    c, s = ((1, 0), (0, 1), (-1, 0), (0, -1))[int(quarter)] if quarter.is_integer() else _cos_sin(degrees)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def _cos_sin(degrees: float) -> tuple[float, float]:
    return float(np.cos(np.radians(degrees))), float(np.sin(np.radians(degrees)))


def _orthonormal(numbers: list[float], field: str) -> Array:
    """The rotation next to nine numbers, which files round to a few digits."""
    R = np.array(numbers).reshape(3, 3).T
    U, s, V = np.linalg.svd(R)
    if np.abs(s - 1).max() > 1e-2 or np.linalg.det(R) < 0:
        raise InputError("is no rotation", field=field)
    return np.asarray(U @ V)
