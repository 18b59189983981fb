"""`handfast view`: a live page on which a grasp is loaded with the mouse."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional, arg

from handfast.cli import console
from handfast.cli.options import Command


@dataclass(kw_only=True)
class ViewGrasps(Command):
    """Look at a grasp, turn and drag its load with the mouse, and see at once whether it holds: a live page.

    Ctrl-C ends it. Needs pip install 'handfast[view]'.
    """

    grasps: Annotated[Positional[str], arg(metavar="GRASP|FOLDER")]
    """a handfast/grasp/1 file, the name of a bundled grasp, or a folder of grasp files to leaf through"""
    port: Annotated[int | None, arg(metavar="N")] = None
    """where the page is served; by default 8080 or the next that is free"""
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    """the address to listen at; whoever reaches it can use the page, and the default is this machine alone"""
    browser: bool = True
    """do not open the page in a browser"""

    def run(self) -> int:
        from handfast.pictures.live.open_page import view

        page = view(self.grasps, host=self.host, port=self.port, browser=self.browser)
        with page, suppress(KeyboardInterrupt):  # which may come as soon as it is said
            console.out().print(f"{page.url}  (Ctrl-C ends it)", soft_wrap=True)
            page.wait()
        return console.ANSWERED
