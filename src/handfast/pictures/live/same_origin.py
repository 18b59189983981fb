"""Who may use a page that has no password: requests for the address it serves on, and from its own page.

A browser opens a websocket to any address for whatever page it shows, and tells that page's address as `Origin`. By a
name that its owner lets point to this machine, a page can even pass for ours; but then the browser sends that name as
`Host`. Programs that are no browsers send what they like, and have to reach the address first.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

LOOPBACK_HOSTS = ("localhost", "127.0.0.1", "::1")
EVERYWHERE = ("0.0.0.0", "::", "")  # as the host that is asked for: all addresses of this machine
_starting = threading.Lock()


@dataclass(frozen=True)
class Doorkeeper:
    """Which requests a server answers.

    Attributes:
        host: that was asked for: a name or an address of this machine.
    """

    host: str

    def refusal(self, hosts: list[str], origins: list[str], address: str, port: int) -> str | None:
        """Why a request is refused, one line; None: it is answered.

        Args:
            hosts: values of all its `Host` headers.
            origins: values of all its `Origin` headers; none, as of programs that are no browsers, is right.
            address, port: at which it came in.
        """
        names = {*LOOPBACK_HOSTS, self.host.lower(), address.lower()}
        if self.host in EVERYWHERE:
            names.add(socket.gethostname().lower())
        known = {f"[{name}]" if ":" in name else name for name in names - set(EVERYWHERE)}
        right = {f"{name}:{port}" for name in known} | (known if port == 80 else set())
        if len(hosts) != 1 or hosts[0].lower() not in right:
            return f"this page is served at {LOOPBACK_HOSTS[0]}:{port}; the request is for {_said(hosts) or 'no host'}"
        if origins and (len(origins) > 1 or origins[0].lower() != f"http://{hosts[0].lower()}"):
            return f"this page is for http://{hosts[0]} alone; the request comes from {_said(origins)}"
        return None

    def wrapped(self, process: Any) -> Any:
        """`process_request` of a server of the library websockets that comes after the look at who asks."""

        def process_request(connection: Any, request: Any) -> Any:
            address, port, *_ = connection.local_address
            headers = request.headers
            why = self.refusal(headers.get_all("Host"), headers.get_all("Origin"), address, port)
            return process(connection, request) if why is None else connection.respond(403, why + "\n")

        return process_request

    @contextmanager
    def at_the_door(self, inside: Callable[[Any], Any]) -> Iterator[list[Any]]:
        """Within it viser begins a server that asks this doorkeeper about all requests; it is then in the list.

        viser has no setting for it, so that the class of its servers is another one meanwhile.

        Args:
            inside: changes the server's own `process_request`, which answers those that are not refused.
        """
        library: Any = import_module("websockets.asyncio.server")
        begun: list[Any] = []
        wrapped = self.wrapped

        class Guarded(library.serve):
            def __init__(self, *arguments: Any, process_request: Any, **options: Any) -> None:
                begun.append(self)
                super().__init__(*arguments, process_request=wrapped(inside(process_request)), **options)

        with _starting:
            usual, library.serve = library.serve, Guarded
            try:
                yield begun
            finally:
                library.serve = usual


def _said(values: list[str]) -> str:
    return " and ".join(repr(v[:80]) for v in values)
