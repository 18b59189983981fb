"""Who is answered at which address: the names of a host that was asked for, and of all addresses of a machine."""

from __future__ import annotations

import socket

import pytest

from handfast.pictures.live.same_origin import Doorkeeper


@pytest.mark.parametrize(
    ("asked", "address", "port", "host", "right"),
    [
        ("127.0.0.1", "127.0.0.1", 8080, "localhost:8080", True),
        ("127.0.0.1", "127.0.0.1", 8080, "192.168.1.5:8080", False),
        ("127.0.0.1", "127.0.0.1", 80, "localhost", True),  # browsers leave 80 out
        ("127.0.0.1", "127.0.0.1", 8080, "localhost", False),
        ("::1", "::1", 8080, "[::1]:8080", True),
        ("::1", "::1", 8080, "::1:8080", False),
        ("Lab-PC.local", "192.168.1.5", 8080, "lab-pc.local:8080", True),
        ("Lab-PC.local", "192.168.1.5", 8080, "192.168.1.5:8080", True),
        ("Lab-PC.local", "192.168.1.5", 8080, "evil.example:8080", False),
        ("0.0.0.0", "192.168.1.5", 8080, "192.168.1.5:8080", True),
        ("0.0.0.0", "192.168.1.5", 8080, "192.168.1.6:8080", False),
        ("0.0.0.0", "192.168.1.5", 8080, "0.0.0.0:8080", False),
        ("0.0.0.0", "192.168.1.5", 8080, f"{socket.gethostname()}:8080", True),
        ("192.168.1.5", "192.168.1.5", 8080, f"{socket.gethostname()}x:8080", False),
        ("::", "2001:db8::5", 8080, "[2001:DB8::5]:8080", True),
    ],
)
def test_hosts(asked: str, address: str, port: int, host: str, right: bool) -> None:
    for origins in ([], [f"http://{host}"]):
        assert (Doorkeeper(asked).refusal([host], origins, address, port) is None) == right


def test_what_is_said() -> None:
    keeper = Doorkeeper("127.0.0.1")
    why = keeper.refusal(["evil.example:8080"], [], "127.0.0.1", 8080)
    assert why == "this page is served at localhost:8080; the request is for 'evil.example:8080'"
    why = keeper.refusal([], [], "127.0.0.1", 8080)
    assert why == "this page is served at localhost:8080; the request is for no host"
    why = keeper.refusal(["localhost:8080"], ["http://evil.example"], "127.0.0.1", 8080)
    assert why == "this page is for http://localhost:8080 alone; the request comes from 'http://evil.example'"
