"""The folder that `handfast grasp` fills as it finds grasps, and from which it can go on.

`grasps.json` for `handfast verify`, a grasp file and a configuration of each grasp, best first, and then `search.json`,
which says how far the search has come.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handfast.planning.journal import SearchFolder
from handfast.planning.results.grasps import Grasps
from handfast.planning.results.search_file import SavedSearch, load_search, save_search
from handfast.readers.configuration_file import save_configuration
from handfast.readers.grasp_file import save_grasp
from handfast.synthesis.task import Task

SEARCH, GRASPS = "search.json", "grasps.json"
FILES = "grasp-{}.json", "configuration-{}.json"


class GraspFolder(SearchFolder[Grasps]):
    """The files of the best grasps so far, and of the search.

    Attributes:
        written: the files of the grasps.
    """

    holds = "grasps"
    files = (SEARCH, GRASPS, *(file.format("[0-9]*") for file in FILES))

    def __init__(self, path: Path, **journal: Any) -> None:
        super().__init__(path, **journal)
        self.written: list[Path] = []

    def earlier(self, question: Task) -> SavedSearch | None:
        """How far the search that the folder holds has come; its proofs are not replayed."""
        file = self.path / SEARCH
        return load_search(file, question) if self.resume and file.exists() else None

    def write(self, state: Grasps) -> None:
        if state.grasps:
            self.written = [self.path / GRASPS]
            for k, g in enumerate(state.grasps, start=1):
                grasp, configuration = (self.path / file.format(k) for file in FILES)
                save_configuration(g.configuration, configuration, force=True)
                save_grasp(g.grasp.from_configuration(configuration), grasp, force=True)
                self.written += [grasp, configuration]
            state.save(self.written[0], force=True)
        save_search(state.search, self.path / SEARCH)
