import contextlib
import http.client
import json
import resource
import socket
from collections.abc import Iterator
from http import HTTPStatus

import pytest
from websockets.exceptions import ConnectionClosedError, InvalidStatus

from cubestack.host.errors import PortOpenError
from cubestack.host.ground.guard import LARGEST_BODY
from cubestack.host.ground.serving import MOST_CONNECTIONS, Serving, loopback_name
from tests.tiers import quick

from .conftest import BEARER, SOON_S, TOKEN, Controlled, listening


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 401),
        ({"Authorization": "Bearer "}, 401),
        ({"Authorization": "Bearer wrong"}, 401),
        ({"Authorization": f"Basic {TOKEN}"}, 401),
        ({"Cookie": "cubestack=wrong"}, 401),
        (BEARER, 200),
        (BEARER | {"Origin": "http://evil.example"}, 403),
        (BEARER | {"Origin": "null"}, 403),
        (BEARER | {"Host": "evil.example"}, 421),
        (BEARER | {"Host": "evil.example:8700"}, 421),
        (BEARER | {"Host": "localhost:1"}, 200),
        (BEARER | {"Host": "[::1]"}, 200),
    ],
)
def test_requests_need_token_origin_and_host(
    controlled: Controlled, headers: dict[str, str], status: int
) -> None:
    held = controlled.state()["held"]
    assert controlled.ask("POST", "/pause", headers=headers)[0] == status
    assert controlled.state()["held"] == (held or status == 200)


def test_address_with_token_sets_a_cookie(controlled: Controlled) -> None:
    connection = http.client.HTTPConnection(*controlled.serving.address, timeout=SOON_S)
    connection.request("GET", f"/?token={TOKEN.replace(' ', '%20')}")
    answer = connection.getresponse()
    cookie = answer.getheader("set-cookie", "")
    assert (answer.status, answer.getheader("location")) == (303, "/")
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    answer.read()
    assert controlled.ask("GET", "/state", headers={"Cookie": cookie.split(";")[0]})[0] == 200
    connection.request("GET", "/?token=guess")
    assert connection.getresponse().status == 401
    connection.close()


@pytest.mark.parametrize("headers", [{}, BEARER | {"Origin": "http://evil.example"}])
def test_websocket_needs_token_and_origin(controlled: Controlled, headers: dict[str, str]) -> None:
    with pytest.raises(InvalidStatus, match="403"):
        listening(controlled.serving, "/events", headers)


def test_upgrade_that_is_no_websocket_ends_its_connection(controlled: Controlled) -> None:
    """Its header is longer than the parser of WebSockets takes; nobody answers."""
    with socket.create_connection(controlled.serving.address, SOON_S) as raw:
        raw.sendall(
            b"GET /events HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\n"
            b"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            b"Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
            b"Sec-WebSocket-Protocol: " + b"a," * 5000 + b"\r\n\r\n"
        )
        with contextlib.suppress(ConnectionResetError):
            assert raw.recv(1) == b""


def test_websocket_rejects_messages_above_1_mib(controlled: Controlled) -> None:
    with listening(controlled.serving, "/events") as opened:
        opened.send(bytes(1 << 20))
        assert opened.ping().wait(SOON_S)
        opened.send(bytes((1 << 20) + 1))
        with pytest.raises(ConnectionClosedError, match="1009"):
            [opened.recv(SOON_S) for _ in range(20)]
    assert controlled.ask("GET", "/state")[0] == 200


def test_rejects_a_huge_body(controlled: Controlled) -> None:
    with socket.create_connection(controlled.serving.address, SOON_S) as raw:
        raw.sendall(
            f"POST /step HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {TOKEN}\r\n"
            f"Content-Length: {100 * LARGEST_BODY}\r\n\r\n".encode()
        )
        try:
            for _ in range(2 * LARGEST_BODY // (1 << 16)):
                raw.sendall(bytes(1 << 16))
        except OSError:  # it is cut off while it sends
            pass
    assert controlled.ask("GET", "/state")[0] == 200


def test_server_survives_malformed_requests(controlled: Controlled) -> None:
    for noise in (b"\0" * 100_000, b"GET / HTTP/9\r\n\r\n", b"GET /" + b"a" * 1_000_000):
        with socket.create_connection(controlled.serving.address, SOON_S) as raw:
            try:
                raw.sendall(noise)
                raw.recv(100)
            except OSError:
                pass
    assert controlled.ask("GET", "/state")[0] == 200


@pytest.fixture
def many_files() -> Iterator[None]:
    """Allows many open files, because both ends of connections are in this process."""
    usual, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    enough = 65_536
    resource.setrlimit(resource.RLIMIT_NOFILE, (most if 0 < most < enough else enough, most))
    yield
    resource.setrlimit(resource.RLIMIT_NOFILE, (usual, most))


@pytest.mark.usefixtures("many_files")
@pytest.mark.parametrize("count", quick([300, 2_000], 1))
def test_many_connections_do_not_block_the_emulation(controlled: Controlled, count: int) -> None:
    kept = []
    with listening(controlled.serving, "/events?every_s=0.05") as watching:
        begun_s = json.loads(watching.recv(SOON_S))["state"]["time_s"]
        for number in range(count):
            raw = socket.create_connection(controlled.serving.address, SOON_S)
            if number % (count // 100):
                raw.close()
            else:
                kept.append(raw)
        while json.loads(watching.recv(SOON_S))["state"]["time_s"] <= begun_s + 0.5:
            pass
        while sum(not closed(raw) for raw in kept) > MOST_CONNECTIONS:
            watching.recv(SOON_S)
        for raw in kept:
            raw.close()
        for _ in range(100):  # until the server has seen that they are closed
            if answered(controlled):
                break
            watching.recv(SOON_S)
    assert answered(controlled)


@pytest.mark.parametrize(
    "request_head",
    [b"", b"POST /pause HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9999\r\n\r\n"],
)
def test_connections_without_the_token_keep_nobody_out(
    controlled: Controlled, request_head: bytes
) -> None:
    """More than the server accepts, each with a request that never ends."""
    held = []
    for _ in range(2 * MOST_CONNECTIONS):
        raw = socket.create_connection(controlled.serving.address, SOON_S)
        raw.sendall(request_head)
        held.append(raw)
        assert answered(controlled)
    for raw in held:
        raw.close()


def test_rejected_request_ends_its_connection(controlled: Controlled) -> None:
    with socket.create_connection(controlled.serving.address, SOON_S) as raw:
        raw.sendall(b"POST /pause HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9999\r\n\r\n")
        content = b""
        while data := raw.recv(1 << 16):
            content += data
    assert content.startswith(b"HTTP/1.1 401")
    assert b"content-security-policy" in content


@pytest.mark.parametrize("host", ["[", "[::1", "]", "localhost:99999999", "a b"])
def test_impossible_host_is_rejected_with_our_headers(controlled: Controlled, host: str) -> None:
    for headers in ({}, BEARER):
        connection = http.client.HTTPConnection(*controlled.serving.address, timeout=SOON_S)
        connection.request("GET", "/state", headers=headers | {"Host": host})
        answer = connection.getresponse()
        assert answer.status in (HTTPStatus.MISDIRECTED_REQUEST, HTTPStatus.OK, 400, 401)
        assert answer.getheader("x-content-type-options") == "nosniff"
        answer.read()
        connection.close()


@pytest.mark.parametrize("path", ["//evil.example/", "///evil.example", "/%5Cevil.example"])
def test_address_with_token_leads_to_this_server_only(controlled: Controlled, path: str) -> None:
    connection = http.client.HTTPConnection(*controlled.serving.address, timeout=SOON_S)
    connection.request("GET", f"{path}?token={TOKEN.replace(' ', '%20')}")
    location = connection.getresponse().getheader("location", "")
    assert location.startswith("/")
    assert location[1:2] not in ("/", "\\")
    connection.close()


def test_cookie_is_not_the_token(controlled: Controlled) -> None:
    connection = http.client.HTTPConnection(*controlled.serving.address, timeout=SOON_S)
    connection.request("GET", f"/?token={TOKEN.replace(' ', '%20')}")
    name, _, value = (
        connection.getresponse().getheader("set-cookie", "").partition(";")[0].partition("=")
    )
    connection.close()
    assert value != TOKEN
    assert controlled.ask("GET", "/state", headers={"Cookie": f"{name}={TOKEN}"})[0] == 401
    assert controlled.ask("GET", "/state", headers={"Authorization": f"Bearer {value}"})[0] == 401


def answered(controlled: Controlled) -> bool:
    try:
        return bool(controlled.ask("GET", "/state")[0] == 200)
    except ConnectionError:
        return False


def closed(raw: socket.socket) -> bool:
    raw.setblocking(False)
    try:
        return raw.recv(1) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


@pytest.mark.parametrize("address", ["0.0.0.0", "192.0.2.1"])
def test_rejects_addresses_of_other_machines(address: str) -> None:
    with pytest.raises(PortOpenError, match=f"{address} can be reached .* --allow-remote"):
        Serving(None, address, 0)  # type: ignore[arg-type]


def test_port_in_use_is_reported(controlled: Controlled) -> None:
    host, port = controlled.serving.address
    with pytest.raises(PortOpenError, match=f"can not listen on {host}:{port}: Address already"):
        Serving(None, host, port)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "own"),
    [("localhost", True), ("127.8.9.1", True), ("::1", True), ("", False), ("a", False)],
)
def test_loopback_addresses_are_recognised(name: str, own: bool) -> None:
    assert loopback_name(name) == own
