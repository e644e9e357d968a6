"""What a page can ask of its server, without a browser: of a device that is emulated in it."""

import http.client
import json
from collections.abc import Iterator
from concurrent.futures import Future
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosedError
from websockets.sync.client import connect

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.ground.guard import Guard
from cubestack.host.ground.page_app import page_app
from cubestack.host.ground.serving import Serving
from cubestack.host.ground.session import LONGEST_LINE, PAGE_COMMANDS, TargetSession
from cubestack.host.targets import open_target

from .conftest import SOON_S, TOKEN

HEADERS = {"Authorization": f"Bearer {TOKEN}"}


@pytest.fixture(scope="module")
def served() -> Iterator[Serving]:
    session = TargetSession(open_target("emulated:cubestar"))
    opened = Future[TargetSession]()
    opened.set_result(session)
    serving = Serving(Guard(page_app([opened]), TOKEN), "127.0.0.1", 0)
    with serving.running():
        yield serving
    session.close()


def ask(served: Serving, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(*served.address, timeout=SOON_S)
    try:
        text = body if isinstance(body, bytes) or body is None else json.dumps(body)
        connection.request(method, path, text, HEADERS)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def do(served: Serving, line: str) -> tuple[int, Any]:
    status, told = ask(served, "POST", "/targets/0/shell", {"line": line})
    return status, json.loads(told)


def test_the_page_and_its_parts_are_there(served: Serving) -> None:
    status, page = ask(served, "GET", "/")
    assert status == 200
    assert b"/page/main.js" in page
    for part in (
        "main.js",
        "style.css",
        "scene.css",
        "vendor/uPlot.iife.min.js",
        "vendor/uPlot.LICENSE",
    ):
        assert ask(served, "GET", f"/page/{part}")[0] == 200


@pytest.mark.parametrize(
    "path", ["/page/../session.py", "/page/%2e%2e/session.py", "/page/none", "/x"]
)
def test_nothing_else_is(served: Serving, path: str) -> None:
    assert ask(served, "GET", path)[0] == 404


def test_it_tells_all_messages_and_why_something_can_not_be(served: Serving) -> None:
    (about,) = json.loads(ask(served, "GET", "/targets")[1])
    assert [one["name"] for one in about["telecommands"]] == [
        one.name for one in INTERFACE.telecommands
    ]
    assert [one["id"] for one in about["telemetries"]] == [one.id for one in INTERFACE.telemetries]
    assert about["missing"]["bench"] == "no line with the bench protocol is open"


def test_the_shell_s_words_are_done(served: Serving) -> None:
    status, told = do(served, "read Identification")
    assert status == 200
    assert ["NodeType", str(told["data"]["values"]["NodeType"])] in told["rows"]
    assert do(served, "write setDetectionThresholds 30 31")[0] == 200
    values = do(served, "read DetectionThresholdValues")[1]["data"]["values"]
    assert (values["DetectionThreshold"], values["StarThreshold"]) == (30, 31)


def test_stars_are_those_that_the_device_found(served: Serving) -> None:
    assert do(served, "write CaptureAndProcess")[0] == 200
    status, told = ask(served, "GET", "/targets/0/detections/SRAM")
    stars = json.loads(told)["marks"]
    assert status == 200
    summary = do(served, "read DetectionSummary")[1]["data"]["values"]
    assert len(stars) == summary["NumStarsDetected"] > 3
    assert all(0 <= star["x"] < 1024 and 0 <= star["y"] < 512 for star in stars)
    (rigel,) = (star for star in stars if star["name"] == "Rigel")
    assert rigel["v_mag"] == pytest.approx(0.18, abs=0.1)  # V of the Hipparcos catalogue
    assert all((star["v_mag"] is None) == (star["name"] == "") for star in stars)


@pytest.mark.parametrize(
    ("line", "status", "error"),
    [
        ("read Nonsense", 400, "nothing is called 'Nonsense'"),
        ("write setDetectionThresholds 300 31", 400, "DetectionThreshold"),
        ("image a.png", 400, "image is not available on the page"),
        ("scene /etc/passwd", 400, "scene is not available on the page"),
        ("watch Identification 9999", 400, "watch is not available on the page"),
        ("read '", 400, "No closing quotation"),
        ("read " + "x" * LONGEST_LINE, 400, "characters at most"),
    ],
)
def test_what_can_not_be_is_told(served: Serving, line: str, status: int, error: str) -> None:
    found, told = do(served, line)
    assert found == status
    assert error in told["error"]


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/targets/1/shell", {"line": "help"}, 404),
        ("/targets/0/shell", {}, 400),
        ("/targets/0/shell", [], 400),
        ("/targets/0/shell", b"{", 400),
        ("/targets/0/pause", {}, 400),
        ("/targets/0/dance", {}, 400),
        ("/targets/0/scene", {"text": ""}, 400),
        ("/targets/0/scene", {"table": {"kind": "sky"}}, 400),
        ("/targets/0/scene", {"table": {"a": None}}, 400),
        ("/targets/0/scene", {"table": "text"}, 400),
        ("/targets/0/scene/look", {"table": {}}, 400),
    ],
)
def test_nonsense_is_refused(served: Serving, path: str, body: Any, status: int) -> None:
    found, told = ask(served, "POST", path, body)
    assert found == status
    assert json.loads(told)["error"]


@pytest.mark.parametrize("what", ["scene", "scene/keys", "stars"])
def test_without_a_control_port_there_is_no_scene(served: Serving, what: str) -> None:
    status, told = ask(served, "GET", f"/targets/0/{what}")
    assert status == 400
    assert json.loads(told)["error"] == "emulated:cubestar has no control port"


def test_a_table_of_results_is_saved_as_a_file(served: Serving) -> None:
    """Its first row names the columns."""
    connection = http.client.HTTPConnection(*served.address, timeout=SOON_S)
    try:
        connection.request("GET", "/targets/0/results/csv", headers=HEADERS)
        answer = connection.getresponse()
        first = answer.read().decode().splitlines()[0]
    finally:
        connection.close()
    assert answer.status == 200
    assert answer.headers.get_content_type() == "text/csv"
    assert answer.headers.get_filename() == "cubestar.csv"
    assert first.split(",")[0] == "utc"


def test_commands_from_a_page_touch_no_file() -> None:
    assert not {"image", "scene", "watch"} & set(PAGE_COMMANDS)


def test_what_a_tab_shows_is_read_again_and_again(served: Serving) -> None:
    address = served.url.replace("http:", "ws:") + "/targets/0/live"
    with connect(address, additional_headers=HEADERS, open_timeout=SOON_S) as socket:
        assert "values" not in json.loads(socket.recv(SOON_S))
        show = ["Identification", "<script>", "TaskStatus"]
        socket.send(json.dumps({"show": show, "every_s": 0.2}))
        while "values" not in (told := json.loads(socket.recv(SOON_S))):
            pass
        assert list(told["values"]) == ["Identification", "TaskStatus"]
        assert json.loads(socket.recv(SOON_S))["link"]["sent"] > told["link"]["sent"]


@pytest.mark.parametrize("nonsense", ["[]", "{", '{"every_s": "often"}', '{"show": 3}'])
def test_a_tab_that_talks_nonsense_is_left(served: Serving, nonsense: str) -> None:
    address = served.url.replace("http:", "ws:") + "/targets/0/live"
    with connect(address, additional_headers=HEADERS, open_timeout=SOON_S) as socket:
        socket.send(nonsense)
        with pytest.raises(ConnectionClosedError, match="1003"):
            [*iter(lambda: socket.recv(SOON_S), None)]
    assert do(served, "read Identification")[0] == 200
