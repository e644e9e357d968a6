import hashlib
import json
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosedError

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.ground.page_app import PAGE
from cubestack.host.ground.serving import Serving
from cubestack.host.ground.session import LONGEST_LINE, TargetSession
from cubestack.host.targets import open_target

from .conftest import SOON_S, listening, request, serving_pages


@pytest.fixture(scope="module")
def served() -> Iterator[Serving]:
    session = TargetSession(open_target("emulated:cubestar"))
    with serving_pages(session) as serving:
        yield serving
    session.close()


def ask(served: Serving, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
    answer, content = request(served, method, path, body)
    return answer.status, content


def do(served: Serving, line: str) -> tuple[int, Any]:
    status, told = ask(served, "POST", "/targets/0/shell", {"line": line})
    return status, json.loads(told)


def test_page_and_its_files_are_served(served: Serving) -> None:
    status, page = ask(served, "GET", "/")
    assert status == 200
    assert b"/page/main.js" in page
    vendored = ("vendor/uPlot.iife.min.js", "vendor/uPlot.LICENSE")
    for part in ("main.js", "style.css", "scene/scene.css", *vendored):
        assert ask(served, "GET", f"/page/{part}")[0] == 200


@pytest.mark.parametrize(
    "path", ["/page/../session.py", "/page/%2e%2e/session.py", "/page/none", "/x"]
)
def test_server_returns_404_for_other_paths(served: Serving, path: str) -> None:
    assert ask(served, "GET", path)[0] == 404


def test_targets_lists_messages_and_missing_features(served: Serving) -> None:
    (about,) = json.loads(ask(served, "GET", "/targets")[1])
    assert [one["name"] for one in about["telecommands"]] == [
        one.name for one in INTERFACE.telecommands
    ]
    assert [one["id"] for one in about["telemetries"]] == [one.id for one in INTERFACE.telemetries]
    assert about["missing"]["bench"] == "no line with the bench protocol is open"


def test_page_executes_shell_commands(served: Serving) -> None:
    status, told = do(served, "read Identification")
    assert status == 200
    assert ["NodeType", str(told["data"]["values"]["NodeType"])] in told["rows"]
    assert do(served, "write setDetectionThresholds 30 31")[0] == 200
    values = do(served, "read DetectionThresholdValues")[1]["data"]["values"]
    assert (values["DetectionThreshold"], values["StarThreshold"]) == (30, 31)


def test_detections_list_the_stars_of_the_device(served: Serving) -> None:
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
        ("image a.png", 400, "image is not available here"),
        ("'image' a.png", 400, "image is not available here"),
        ('"scene" /etc/passwd', 400, "scene is not available here"),
        ("scene /etc/passwd", 400, "scene is not available here"),
        ("watch Identification 9999", 400, "watch is not available here"),
        ("read '", 400, "No closing quotation"),
        ("read " + "x" * LONGEST_LINE, 400, "characters at most"),
    ],
)
def test_rejects_invalid_shell_commands(
    served: Serving, line: str, status: int, error: str
) -> None:
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
def test_rejects_invalid_requests(served: Serving, path: str, body: Any, status: int) -> None:
    found, told = ask(served, "POST", path, body)
    assert found == status
    assert json.loads(told)["error"]


@pytest.mark.parametrize("what", ["scene", "scene/keys", "stars"])
def test_scene_needs_a_control_port(served: Serving, what: str) -> None:
    status, told = ask(served, "GET", f"/targets/0/{what}")
    assert status == 400
    assert json.loads(told)["error"] == "emulated:cubestar has no control port"


def test_results_are_downloaded_as_csv(served: Serving) -> None:
    answer, content = request(served, "GET", "/targets/0/results/csv")
    assert answer.status == 200
    assert answer.headers.get_content_type() == "text/csv"
    assert answer.headers.get_filename() == "cubestar.csv"
    assert content.startswith(b"utc")


def test_shown_frames_are_read_repeatedly(served: Serving) -> None:
    with listening(served, "/targets/0/live") as socket:
        assert "values" not in json.loads(socket.recv(SOON_S))
        show = ["Identification", "<script>", "TaskStatus"]
        socket.send(json.dumps({"show": show, "every_s": 0.2}))
        while "values" not in (told := json.loads(socket.recv(SOON_S))):
            pass
        assert list(told["values"]) == ["Identification", "TaskStatus"]
        assert json.loads(socket.recv(SOON_S))["link"]["sent"] > told["link"]["sent"]


@pytest.mark.parametrize(
    "nonsense",
    [
        *("[]", "{", '{"every_s": "often"}', '{"every_s": NaN}', '{"every_s": Infinity}'),
        *('{"every_s": ' + "9" * 400 + "}", '{"show": 3}', '{"show": ["\\ud800"]}', "[" * 100),
    ],
)
def test_invalid_message_closes_the_websocket(served: Serving, nonsense: str) -> None:
    with listening(served, "/targets/0/live") as socket:
        socket.send(nonsense)
        with pytest.raises(ConnectionClosedError, match="1003"):
            [*iter(lambda: socket.recv(SOON_S), None)]
    assert do(served, "read Identification")[0] == 200


VENDOR = PAGE / "vendor"


def test_vendored_files_match_their_listed_sources() -> None:
    sources = tomllib.loads((VENDOR / "sources.toml").read_text(encoding="utf-8"))
    sums = {name: one for source in sources.values() for name, one in source["sha256"].items()}
    found = {path.name: path.read_bytes() for path in VENDOR.iterdir()}
    del found["sources.toml"]
    assert {name: hashlib.sha256(text).hexdigest() for name, text in found.items()} == sums
    version = sources["uplot"]["version"]
    assert f"(v{version})".encode() in found["uPlot.iife.min.js"]
    assert f"-{version}.tgz" in sources["uplot"]["package"]
    assert b"The MIT License" in found["uPlot.LICENSE"]
