"""The page itself: served on loopback, driven as the mouse drives it, ended by Ctrl-C."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import handfast
from handfast.core.errors import InputError
from handfast.core.transforms import matrix_quaternion
from handfast.pictures.live.open_page import LivePage, free_port
from handfast.readers.grasp_file import save_grasp
from tests.support.interruptions import LONGEST
from tests.support.viewed import jaws, until

viser = pytest.importorskip("viser", reason="pip install 'handfast[view]'")


@pytest.fixture
def page() -> Iterator[LivePage]:
    with handfast.view([jaws(), jaws(preload=20.0)], port=0, browser=False) as page:
        yield page


def dragged(page: Any, start: list[float], end: list[float], phase: str = "start") -> Any:
    """An event of the mouse; the viewer looks along -y."""
    camera = SimpleNamespace(position=np.array([0, -1.0, 0]) + start)
    return SimpleNamespace(
        phase=phase, start_position=start, end_position=end, client=SimpleNamespace(camera=camera), target=page
    )


def drive(callback: Any, event: Any) -> None:
    """Run one of the page's callbacks to its end, as viser does."""
    with pytest.raises(StopIteration):
        callback(event).send(None)


def test_page_and_socket_are_served(page: LivePage) -> None:
    from websockets.sync.client import connect

    with urllib.request.urlopen(page.url, timeout=LONGEST) as got:
        text = got.read()
    assert b"<html" in text[:2000].lower()
    head = text[: text.index(b"<meta")]  # before all of viser's own
    assert b'matchMedia("(prefers-color-scheme: dark)")' in head
    assert b"@media (max-width: 36em)" in head
    assert b"<title>handfast view</title>" in text
    assert page.url.startswith("http://127.0.0.1:")
    with connect(page.url.replace("http", "ws"), subprotocols=[f"viser-v{viser.__version__}"], max_size=None) as ws:
        sent = b"".join(ws.recv(timeout=LONGEST) for _ in range(2))
    assert sent


def answered(page: LivePage, *headers: str, upgrade: bool) -> int:
    """The status with which the running server answers a request of just these headers, byte by byte as given."""
    asked = ["GET / HTTP/1.1", *headers]
    if upgrade:
        key, protocol = (
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
            f"Sec-WebSocket-Protocol: viser-v{viser.__version__}",
        )
        asked += ["Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13", key, protocol]
    with socket.create_connection(("127.0.0.1", page.port), timeout=30) as line:
        line.sendall(("\r\n".join(asked) + "\r\n\r\n").encode())
        first, got = line.makefile("rb"), b""
        got = first.readline()
    return int(got.split()[1])


@pytest.mark.parametrize("upgrade", [False, True])
@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "LocalHost", "[::1]"])
def test_its_own_page_and_programs_that_are_no_browsers_are_answered(page: LivePage, name: str, upgrade: bool) -> None:
    good = 101 if upgrade else 200
    host = f"{name}:{page.port}"
    assert answered(page, f"Host: {host}", upgrade=upgrade) == good  # no browser: no origin
    assert answered(page, f"Host: {host}", f"Origin: http://{host}", upgrade=upgrade) == good


@pytest.mark.parametrize("upgrade", [False, True])
def test_the_pages_of_others_are_refused(page: LivePage, upgrade: bool) -> None:
    p = page.port
    own = f"Host: 127.0.0.1:{p}"
    for host in (
        "evil.example",
        f"evil.example:{p}",
        "127.0.0.1",
        f"127.0.0.1:{p + 1}",
        f"127.0.0.1.evil.example:{p}",
        "",
    ):
        assert answered(page, f"Host: {host}", upgrade=upgrade) == 403
        assert (
            answered(page, f"Host: {host}", f"Origin: http://{host}", upgrade=upgrade) == 403
        )  # rebound to this machine
    for origin in (
        *("http://evil.example", f"http://evil.example:{p}", "null", "", f"https://127.0.0.1:{p}", "http://127.0.0.1"),
        *(f"http://127.0.0.1:{p + 1}", f"http://localhost:{p}", f"http://127.0.0.1:{p}.evil.example", "file://"),
    ):
        assert answered(page, own, f"Origin: {origin}", upgrade=upgrade) == 403
    assert answered(page, upgrade=upgrade) == 403  # no host
    assert answered(page, own, "Host: evil.example", upgrade=upgrade) == 403
    assert answered(page, own, f"Origin: http://127.0.0.1:{p}", "Origin: http://evil.example", upgrade=upgrade) == 403


def test_another_page_reads_no_scene_and_sets_no_load(page: LivePage) -> None:
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    address, protocols = page.url.replace("http", "ws"), [f"viser-v{viser.__version__}"]
    before = page._server.session.state
    with pytest.raises(InvalidStatus, match="HTTP 403"):
        connect(address, subprotocols=protocols, origin="http://evil.example")
    with connect(address, subprotocols=protocols, origin=page.url, max_size=None) as ws:
        assert ws.recv(timeout=30)
    assert page._server.session.state == before


def test_a_server_that_cannot_be_guarded_is_not_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    import websockets.asyncio.server as library
    from viser.infra import _infra

    usual, ended = library.serve, []
    monkeypatch.setattr(
        _infra, "websockets", SimpleNamespace(asyncio=SimpleNamespace(server=SimpleNamespace(serve=usual)))
    )
    stop = viser.ViserServer.stop
    monkeypatch.setattr(viser.ViserServer, "stop", lambda self: ended.append(1) or stop(self))
    with pytest.raises(InputError, match="cannot be kept from the pages of others"):
        handfast.view(jaws(), port=0, browser=False)
    assert ended == [1]
    assert library.serve is usual


def test_the_mouse_changes_the_load(page: LivePage) -> None:
    server = page._server
    session, stage = server.session, server.session.stage
    unit = stage.metres_per_newton
    until(lambda: server._preloads)  # the grasp stands there
    session.change(lambda x: x.with_plane("none"))
    drive(server._pull, dragged(server, [0.01, 0.004, 0], [0.01 + 3 * unit, 0.004, 0]))  # the far side is grabbed
    at = session.state.at
    assert at[[0, 2]] == pytest.approx([0.01, 0])
    assert at[1] == pytest.approx(stage.object[0][:, 1].min(), rel=0.2)  # at the near side the force acts
    assert session.state.force == pytest.approx([3 * (at[1] + 0.996), 0, 0])  # smaller than it looks from far away
    session.change(lambda x: x.moved(np.array([0.01, 0, 0])))
    drive(server._drag_tip, dragged(server, [0, 0, 0], [0.01, 0, -4 * unit]))
    assert session.state.force == pytest.approx([0, 0, -4])
    until(lambda: "HOLDS" in server._verdict.content)
    until(lambda: server._force.value == pytest.approx(4))
    frame = session.state.frame
    about_x = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) @ frame
    target = SimpleNamespace(wxyz=matrix_quaternion(about_x), position=(0, 0, 0))
    drive(server._turn, SimpleNamespace(target=target))
    assert session.state.force == pytest.approx([0, 4, 0])
    drive(server._twist, dragged(server, [0, -0.01, 0], [0.01, -0.01, 0]))  # the near side goes to +x
    assert session.state.force == pytest.approx([0, 0, 0])
    assert session.state.torque[2] > 0
    assert session.state.torque[:2] == pytest.approx([0, 0])
    session.change(lambda x: x.pulled(np.array([0, 0, -12.0])))
    until(lambda: "SLIPS" in server._verdict.content)
    until(lambda: abs(server._nodes["carrier"].position[2]) > 1e-4)  # it goes


def test_leafing_changes_controls_and_solids(page: LivePage) -> None:
    server = page._server
    until(lambda: server._preloads)
    ends = [slider.max for slider in server._preloads]
    server.session.leaf(1)
    until(lambda: [s.max for s in server._preloads] == [2 * e for e in ends])
    until(lambda: server._chosen.value == "2: jaws")


def test_no_link_beyond_this_machine(page: LivePage) -> None:
    assert page._server._server.request_share_url() is None


def test_ports() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        number = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"is {number}, which is taken"):
            handfast.view(jaws(), port=number, browser=False)
    assert free_port("127.0.0.1", 0) > 0
    with pytest.raises(InputError, match="0 to 65535"):
        free_port("127.0.0.1", 65536)
    with pytest.raises(InputError, match="host: cannot listen at"):
        free_port("192.0.2.1", 0)
    for name in ("a..b", "x" * 300):
        with pytest.raises(InputError, match=r"host: '[ax.b]+' is no address"):
            free_port(name, 0)


@pytest.mark.slow
def test_the_program_serves_until_ctrl_c(tmp_path: Path) -> None:
    save_grasp(jaws(), tmp_path / "jaws.json")
    asked = [sys.executable, "-m", "handfast.cli", "view", "jaws.json", "--port", "0", "--no-browser"]
    with subprocess.Popen(asked, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        said = program.stdout.readline()
        assert said.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(said.split()[0], timeout=LONGEST) as got:
            assert got.status == 200
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=LONGEST)
    assert (program.returncode, out, err) == (0, "", "")
