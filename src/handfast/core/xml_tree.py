"""XML from strangers: parsed within limits, and without entities of its own."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from handfast.core.errors import InputError

LARGEST = 1 << 25  # [bytes]
DEEPEST = 500  # elements in each other


def read_tree(path: Path) -> Element:
    """The root element of an XML file.

    Raises:
        InputError: larger than `LARGEST`, elements more than `DEEPEST` deep in each other, a document type, which could
            define entities that expand without end.
        xml.etree.ElementTree.ParseError, LookupError, ValueError, OSError: no XML, an unknown encoding, no such file.
    """
    if path.stat().st_size > LARGEST:
        raise InputError(f"is larger than {LARGEST >> 20} MiB", source=str(path))
    data = path.read_bytes()
    try:
        _refuse(data)
    except InputError as fault:
        raise fault.at(str(path)) from None
    return ElementTree.fromstring(data)


def _refuse(data: bytes) -> None:
    depth = 0

    def doctype(*_: object) -> None:
        raise InputError("has a document type (<!DOCTYPE ...>), which is not read; leave it out")

    def start(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise InputError(f"has elements more than {DEEPEST} deep in each other")

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
