"""XML from strangers: parsed within limits, and without entities of its own."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from handfast.core.errors import InputError

MAX_XML_BYTES = 1 << 25  # [bytes]
MAX_XML_DEPTH = 500  # elements in each other
XACRO = ("{http://www.ros.org/wiki/xacro}", "{http://ros.org/wiki/xacro}", "{http://wiki.ros.org/xacro}")


def read_xml(path: Path, right: str = "") -> Element:
    """The root element of an XML file.

    Args:
        right: what kind of file is needed, for the message.

    Raises:
        InputError: no such file, no XML, an unknown encoding, larger than `MAX_XML_BYTES`, elements more than
            `MAX_XML_DEPTH` deep in each other, a document type, which could define entities that expand without end.
            One line, naming the file.
    """
    try:
        if path.stat().st_size > MAX_XML_BYTES:
            raise InputError(f"is larger than {MAX_XML_BYTES >> 20} MiB")
        data = path.read_bytes()
        _refuse(data)
        return ElementTree.fromstring(data)
    except ElementTree.ParseError as fault:
        problem = f"is not XML ({fault})" + (f"; {right} is needed" if right else "")
    except InputError as fault:  # a ValueError, too
        raise fault.at(str(path)) from None
    except (LookupError, ValueError) as fault:  # an encoding that it declares
        problem = f"has an encoding that cannot be read ({fault}); UTF-8 is right"
    except OSError as fault:
        problem = f"cannot be read ({fault.strerror})"
    raise InputError(problem, source=str(path))


def read_robot_xml(path: Path) -> Element:
    """As `read_xml`, of a hand or an object; `InputError` for a file with xacro macros, too."""
    root = read_xml(path, "a URDF or MJCF file")
    if any(e.tag.startswith(XACRO) for e in root.iter()):
        problem = f"has xacro macros, which are not read; `xacro {path.name} > hand.urdf` makes a URDF file of it"
        raise InputError(problem, source=str(path))
    return root


def numbers_in(text: str, n: int, field: str, name: str = "") -> list[float]:
    """The n finite numbers of a text; `InputError` that calls it `name` if it has others."""
    try:
        values = [float(t) for t in text.split()]
    except ValueError:
        values = []
    if len(values) != n or not all(map(math.isfinite, values)):
        need = "a finite number is" if n == 1 else f"{n} finite numbers are"
        raise InputError(f"{name}is '{text}'; {need} needed", field=field)
    return values


def _refuse(data: bytes) -> None:
    depth = 0

    def doctype(*_: object) -> None:
        raise InputError("has a document type (<!DOCTYPE ...>), which is not read; leave it out")

    def start(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_XML_DEPTH:
            raise InputError(f"has elements more than {MAX_XML_DEPTH} deep in each other")

    def end(_: object) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler, parser.StartElementHandler, parser.EndElementHandler = doctype, start, end
    try:
        parser.Parse(data, True)
    except InputError:
        raise
    except (expat.ExpatError, LookupError, ValueError):
        pass  # what is no XML is told by the parser that reads it next
