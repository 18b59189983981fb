"""One door for checking answers: what a file, a folder or an answer claims is replayed by `handfast.proofs`."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

from handfast.core.errors import InputError
from handfast.core.files import ANSWER, SCHEMA_KINDS, read_json
from handfast.proofs import files
from handfast.proofs.fields import BadFile
from handfast.proofs.replay import Replay

PLAN_FILE, GRASPS_FILE = files.PLAN_FILE, "grasps.json"
LABEL_TABLE_ENDINGS = ".jsonl", ".parquet"  # how names of tables of labels end
How = dict[str, Any]  # arguments of `Asking`
SEALED = "handfast/synthesis/1", "handfast/grasps/1"  # schemas of files with a checksum


class Verifiable(Protocol):
    """Any answer."""

    def verify(self) -> Replay: ...


class Printed(Protocol):
    """An answer that keeps no proofs: a map, a sweep, what `settle` found."""

    def to_json(self) -> dict[str, Any]: ...


def verify(
    what: str | Path | Verifiable | Printed,
    *,
    replay: bool = False,
    dataset: str | Path | None = None,
    rows: Collection[int] = (),
    question_timeout: float = 60.0,
    timeout: float | None = None,
    jobs: int | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> Replay:
    """Is everything that an answer claims proved? Replayed without any search and without any solver.

    What is geometry, contacts and joints of a hand at a configuration, is measured anew, and said apart.

    Args:
        what: a file that `--save` wrote, the folder of a plan; or an answer of any kind. With `replay` also a map, a
            sweep, a settled grasp, or the file of one, or a table of labels.
        replay: what keeps no proofs is asked again, each of its numbers and verdicts, with proofs that are replayed.
        dataset: of a table of labels: what was labelled.
        rows: of a table of labels: numbers of rows, from 0; all unless given.
        question_timeout: [s] for each question that is asked again. timeout: [s] for all of them.
        jobs: cores to use for these; by default all.
        on_progress: called with (done, total) of these.

    Raises:
        InputError: the file cannot be read, or is none that can be verified; limits that are not positive.
    """
    how: dict[str, Any] = {"question_timeout": question_timeout, "jobs": jobs, "on_progress": on_progress}
    how |= {} if timeout is None else {"timeout": timeout}
    if not isinstance(what, str | Path):
        asks = _asks_again(what.to_json()) if replay and hasattr(what, "to_json") else None
        if not hasattr(what, "verify"):
            raise InputError(f"is of type {type(what).__name__}; a file, a folder or an answer is needed", field="what")
        return asks(what.to_json(), how) if asks else what.verify()  # type: ignore[union-attr]
    path = Path(what)
    if path.suffix.lower() in LABEL_TABLE_ENDINGS:
        try:
            return _labels(path, replay, dataset, rows, how)
        except InputError as fault:
            raise fault.at(str(what)) from None
    if dataset is not None or rows:
        field = "--row" if rows else "--dataset"
        raise InputError("is for tables of labels, .jsonl or .parquet", source=str(what), field=field)
    return _of_path(path, replay, how)


def _of_path(path: Path, replay: bool, how: How) -> Replay:
    """What a file or a folder claims; faults name the file, or the folder of the plan, in which they are."""
    try:
        if _is_folder(path) and not (path / PLAN_FILE).exists():
            parts = ((file, _of_path(file, replay, how)) for file in answers_in(path))
            return Replay("folder", parts=tuple(replace(part, name=_below(path, file)) for file, part in parts))
        return _of_one(path, replay, how)
    except BadFile as fault:
        raise InputError(fault.problem, source=str(path), field=fault.field or None) from None
    except InputError as fault:
        raise fault.at(str(path)) from None


def _of_one(path: Path, replay: bool, how: How) -> Replay:
    """What a file or the folder of a plan claims. Raises `BadFile` and `InputError`."""
    if _is_folder(path):
        from handfast.planning.results.verify import measured_plan

        proved = files.verify_path(path)
        return replace(proved, parts=(*proved.parts, measured_plan(path)))
    data = files.read_json(path)
    asks = _asks_again(data) if replay else None
    if asks:
        return asks(data, how)
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema in SEALED:  # before a proof that takes its time
        from handfast.synthesis.embedded_task import refuse_broken

        refuse_broken(data)
    try:
        proved = files.verify(data)
    except BadFile as fault:
        if fault.field == "schema" and isinstance(schema, str) and SCHEMA_KINDS.get(schema, ANSWER) != ANSWER:
            raise BadFile(f"{fault.problem}; this is {SCHEMA_KINDS[schema]}, which claims nothing", "schema") from None
        raise
    return _measured(data, proved)


def answers_in(folder: Path) -> list[Path]:
    """What of a folder without a plan of its own can be verified: what `grasp`, `hold --save` or `plan` of several
    objects wrote there.

    Raises:
        InputError: there is nothing.
    """
    found = [file for file in (folder / GRASPS_FILE, *sorted(folder.glob("*.hold.json"))) if file.exists()]
    below = [
        file.parent if file.name == PLAN_FILE else file
        for name in (PLAN_FILE, GRASPS_FILE)
        for file in folder.glob(f"*/{name}")
    ]
    if not (found or below):
        raise InputError("holds nothing to verify; a folder that plan, grasp or hold --save filled is needed")
    return [*found, *sorted(below)]


def _below(folder: Path, file: Path) -> str:
    return file.relative_to(folder).as_posix()


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):  # no name of a file: said when it is read
        return False


def _measured(data: Any, proved: Replay) -> Replay:
    """With what of a file is geometry, measured anew."""
    if data["schema"] == "handfast/grasps/1":
        from handfast.planning.results import grasps_file, verify

        return verify.with_geometry(proved, verify.measured(grasps_file.from_dict(data)))
    if data["schema"] == "handfast/synthesis/1":
        from handfast.synthesis import synthesis_file

        synthesis_file.from_dict(data)  # that it fits its task
    return proved


# --- answers that keep no proofs ------------------------------------------------------------------


def _asks_again(data: Any) -> Callable[[Any, How], Replay] | None:
    """What asks again what a parsed file says; None if it is none that keeps no proofs and says its question."""
    schema, query = (data.get("schema"), data.get("query")) if isinstance(data, dict) else (None, None)
    if schema == files.SETTLED_SCHEMA:
        return _settled
    if schema == "handfast/answer/1" and query in ("map", "sweep"):
        return _map_or_sweep
    return None


def _map_or_sweep(data: Any, how: How) -> Replay:
    from handfast.stability.studies import verify_maps
    from handfast.stability.studies.ask_again import Asking

    replay = verify_maps.replay_map if data["query"] == "map" else verify_maps.replay_sweep
    return replay(data, Asking(**how))


def _settled(data: Any, how: How) -> Replay:
    from handfast.simulation.settled import replay_settled
    from handfast.stability.studies.ask_again import Asking

    return replay_settled(data, Asking(**how))


def _labels(path: Path, replay: bool, dataset: str | Path | None, rows: Collection[int], how: How) -> Replay:
    from handfast.datasets.labels.verify_labels import replay_labels
    from handfast.stability.studies.ask_again import Asking

    if not replay:
        ask = f"{files.REPLAY_COMMAND} --dataset DATASET"
        raise InputError(f"is a table of labels, which keeps no proofs; ask again: {ask}")
    return replay_labels(path, dataset, Asking(**how), rows)


def stated(path: str | Path) -> Any:
    """What `verify` was given, parsed: of the folder of a plan its `plan.json`, of a table of labels what it is about.

    Of another folder what is in it, by name, under `answers`.

    Raises:
        InputError: it cannot be read.
    """
    path = Path(path)
    if path.suffix.lower() in LABEL_TABLE_ENDINGS:
        from handfast.datasets.labels.verify_labels import about_labels

        return about_labels(path)
    if _is_folder(path) and not (path / PLAN_FILE).exists():
        return {"answers": {_below(path, file): stated(file) for file in answers_in(path)}}
    return read_json(path / PLAN_FILE if _is_folder(path) else path, "result")
