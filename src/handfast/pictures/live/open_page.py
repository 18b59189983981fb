"""The Python door: a live page of one grasp or of several."""

from __future__ import annotations

import errno
import socket
import threading
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType

from handfast.core.errors import InputError
from handfast.model.grasp import Grasp
from handfast.pictures.live.live_session import Album

PORT, PORT_TRIES = 8080, 100  # the first port that is tried, and how many are
LOOPBACK_ADDRESS = "127.0.0.1"


class LivePage:
    """A page that is being served. Close it, or use it in a `with` statement.

    Attributes:
        url: where it is.
        port: at which it listens.
    """

    def __init__(self, album: Album, host: str, port: int) -> None:
        from handfast.pictures.live.live_session import LiveSession
        from handfast.pictures.live.page_server import PageServer

        session = LiveSession(album)
        try:
            self._server = PageServer(session, host, port)
        except BaseException:
            session.close()
            raise
        self._closed = threading.Event()
        self.url, self.port = self._server.url, self._server.port
        session.start(self._server)

    def wait(self) -> None:
        """Serve until Ctrl-C comes or another thread closes the page."""
        try:
            while not self._closed.wait(0.5):
                pass
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """End the server and its threads."""
        if not self._closed.is_set():
            self._closed.set()
            self._server.stop()

    def __enter__(self) -> LivePage:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def view(
    grasp: Grasp | Sequence[Grasp] | str | Path,
    *,
    host: str = LOOPBACK_ADDRESS,
    port: int | None = None,
    browser: bool = True,
) -> LivePage:
    """Serve a live page on which a grasp is loaded with the mouse, and every load is answered at once.

    It returns at once and serves until it is closed: `page.wait()` waits for Ctrl-C. Needs viser: `pip install
    'handfast[view]'`.

    Args:
        grasp: a grasp, several, a grasp file, the name of a bundled grasp, or a folder of grasp files.
        host: the address to listen at. Whoever reaches it can use the page; the default is this machine alone.
        port: 8080 or the next that is free, unless given; 0 takes any.
        browser: open the page in the browser.

    Raises:
        InputError: viser is not installed, an address of another machine, a port that is taken, no grasps, a file as
            `load_grasp`.
    """
    page = LivePage(Album.of(grasp), host, free_port(host, port))
    if browser:
        import webbrowser

        webbrowser.open(page.url)
    return page


def free_port(host: str, port: int | None = None) -> int:
    """A port at which one can listen: the given one, any for 0, or else the first free one from 8080.

    Raises:
        InputError: it is taken or no port, or this machine does not have the address.
    """
    if port is not None and not 0 <= port <= 65535:
        raise InputError(f"is {port}; 0 to 65535 is possible", field="port")
    try:
        family, *_, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
    except OSError as fault:
        raise InputError(f"'{host}' is no address ({fault.strerror})", field="host") from None
    except UnicodeError:  # parts of a name that are empty or too long
        raise InputError(f"'{host[:40]}' is no address", field="host") from None
    for tried in range(PORT, PORT + PORT_TRIES) if port is None else (port,):
        with socket.socket(family, socket.SOCK_STREAM) as listener:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                listener.bind((address[0], tried))
            except PermissionError:
                raise InputError(f"is {tried}, which needs rights that you do not have", field="port") from None
            except OSError as fault:
                if fault.errno != errno.EADDRINUSE:
                    raise InputError(f"cannot listen at '{host}' ({fault.strerror})", field="host") from None
                continue
            return int(listener.getsockname()[1])
    taken = f"is {port}, which is taken" if port is not None else f"{PORT} to {PORT + PORT_TRIES - 1} are all taken"
    raise InputError(f"{taken}; give another one, 0 for any", field="port")
