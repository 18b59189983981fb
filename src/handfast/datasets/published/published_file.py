"""One door for published files: the bytes by their kind, the layout by its keys."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from handfast.core.errors import InputError
from handfast.core.files import read_json
from handfast.datasets.published.array_file import read_array_file
from handfast.datasets.published.recorded import PublishedLayout, Rows

LAYOUTS = (
    *("dexgraspnet", "bodex", "dexonomy", "dexgraspbench", "graspqp"),
    *("multidex", "mj_grasp_sim", "graspgen", "isaac_grasp"),
)
ENDINGS = (".npy", ".npz", ".pt", ".pth", ".pkl", ".pickle", ".json", ".yaml", ".yml")


def layout_named(name: str) -> PublishedLayout:
    """A layout by its name; `InputError` listing the known ones."""
    if name not in LAYOUTS:
        raise InputError(f"unknown layout '{name}'; known: {', '.join(LAYOUTS)}", field="--layout")
    found: PublishedLayout = importlib.import_module(f"handfast.datasets.published.layouts.{name}").LAYOUT
    return found


def published_files(paths: Sequence[Path]) -> list[Path]:
    """Files as they are, folders as what is in them and below that can hold published grasps, in order.

    JSON has too many other uses to be taken from a folder.
    """
    found: list[Path] = []
    for path in paths:
        inside = path.rglob("*") if path.is_dir() else ()
        files = sorted(f for f in inside if f.suffix.lower() in ENDINGS and f.suffix.lower() != ".json" and f.is_file())
        if path.is_dir() and not files:
            raise InputError("has no files of published grasps in it or below", source=str(path))
        found += files or [path]
    return found


def read_published(path: str | Path, layout: str | None = None) -> tuple[PublishedLayout, Rows]:
    """The layout of a file and its grasps, one by one; a broken one is a `BrokenRow`.

    Args:
        path: `.npy`, `.npz`, `.pt`, `.pth`, `.pkl`, `.json` or `.yaml`.
        layout: one of `LAYOUTS`, in place of what the keys say.

    Raises:
        InputError: no such file, another kind of file, data that no layout has, a pickle that names what is no plain
            data, keys that are missing for the layout. One line, naming the file.
    """
    file = Path(path)
    chosen = None if layout is None else layout_named(layout)
    try:
        data = _data(file)
        if chosen is None:
            chosen = next((known for known in map(layout_named, LAYOUTS) if _recognised(known, data)), None)
        if chosen is None:
            raise InputError(f"is of no known layout: it holds {_described(data)}; give --layout if you know better")
        return chosen, chosen.read(data, _stem(file))
    except InputError as fault:
        raise fault.at(str(path)) from None
    except MemoryError:
        raise InputError("takes more memory than there is", source=str(path)) from None
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError):
        name = chosen.name if chosen else "any"
        raise InputError(
            f"does not fit the layout {name}; {chosen and chosen.keys} is needed", source=str(path)
        ) from None


def _recognised(layout: PublishedLayout, data: Any) -> bool:
    """Whether data are of a layout; what a test of the keys stumbles over is not."""
    try:
        return bool(layout.recognises(data))
    except (TypeError, ValueError, LookupError, AttributeError):
        return False


def _stem(path: Path) -> str:
    """The file's name without its endings; a dot in an object's own name stays."""
    name = path.name
    for ending in (*ENDINGS, ".dexgrasp"):
        name = name.removesuffix(ending)
    return name


def _data(path: Path) -> Any:
    if not path.is_file():
        raise InputError("no such file; a file of published grasps is needed")
    match path.suffix.lower():
        case ".json":
            return read_json(path, "published grasps")
        case ".yaml" | ".yml":
            return read_yaml(path)
        case ending if ending in ENDINGS:
            return read_array_file(path)
    raise InputError(f"ends in '{path.suffix}'; known are {', '.join(ENDINGS)}")


def read_yaml(path: Path) -> Any:
    """Plain YAML: no tags beyond the standard ones, no references, which could grow without end.

    Raises:
        InputError: PyYAML is not installed, or the file is no such YAML.
    """
    try:
        import yaml
    except ImportError:
        raise InputError("is YAML, which needs PyYAML: pip install 'handfast[published]'") from None

    class PlainLoader(yaml.SafeLoader):
        def compose_node(self, parent: Any, index: Any) -> Any:
            if self.check_event(yaml.AliasEvent):
                raise InputError("has a reference (*name); write it out")
            return super().compose_node(parent, index)

    try:
        return yaml.load(path.read_text("utf-8"), PlainLoader)
    except yaml.YAMLError as fault:
        raise InputError(f"is no plain YAML: {' '.join(str(fault).split())[:120]}") from None
    except (UnicodeDecodeError, RecursionError, ValueError) as fault:
        if isinstance(fault, InputError):
            raise
        raise InputError("is no plain YAML: no text, or nested too deeply") from None


def _described(data: Any) -> str:
    """What data are, for someone who has to find out why they are not recognised."""
    if isinstance(data, dict):
        keys = [str(k) for k in list(data)[:6]]
        return f"a dictionary with {', '.join(keys) or 'nothing'}{', ...' if len(data) > 6 else ''}"
    shape = getattr(data, "shape", None)
    return f"a {type(data).__name__}" + (f" of shape {shape}" if shape is not None else "")
