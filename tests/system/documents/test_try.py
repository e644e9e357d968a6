"""The page that runs a CubeStar in the browser, beside the emulator."""

import functools
import http.server
import importlib.util
import re
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

import cubestack
from cubestack.emulator.scene.sky import PictureScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from docs import make_try
from tests.tiers import todays

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("try")]

LARGEST = 1_500_000
MOST_S = 2.5
"""Processor time to the first picture in s: half of the 5 s in which users must have it."""
SKIES, TURNS = 10, 3
SOON_MS = 120_000

LINE = re.compile(r"([\d.]+) ms (to|from) the sensor: ([0-9a-f ]+)")
WATCH = """() => {
  window.lines = [];
  const seen = (all) => all.flatMap((one) => [...one.addedNodes]).map((one) => one.textContent);
  const watcher = new MutationObserver((all) => lines.push(...seen(all)));
  watcher.observe(document.querySelector("#log"), { childList: true });
}"""


class Frame(NamedTuple):
    ms: str
    data: bytes


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if importlib.util.find_spec("ziglang") is None:
        pytest.skip(
            "the extra `compiler` is not installed, and no other compiler makes WebAssembly"
        )
    folder = tmp_path_factory.mktemp("try")
    make_try.build(folder)
    return folder


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    handler = functools.partial(Silent, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        yield f"http://127.0.0.1:{server.server_port}/index.html"
        server.shutdown()


class Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture
def page(chromium: Any, address: str) -> Iterator[Any]:
    """Loaded, then cut off from the network; fails on script errors and refused contents."""
    context = chromium.new_context()
    page = context.new_page()
    page.set_default_timeout(SOON_MS)
    wrong = list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda one: wrong.append(one.text) if one.type == "error" else None)
    page.goto(address)
    page.wait_for_selector("#status >> text=/^Ready/")
    context.set_offline(True)
    yield page
    context.close()
    assert not wrong, wrong


def take(page: Any) -> str:
    """Takes a picture by keyboard; returns what the page says of it."""
    page.evaluate("document.querySelector('#result').textContent = ''")
    page.focus("#take")
    page.keyboard.press("Enter")
    page.wait_for_selector("#result >> text=/detected/")
    page.wait_for_selector("#status >> text=/^Ready/")
    return str(page.inner_text("#result"))


def frames(lines: list[str], way: str) -> list[Frame]:
    found = [match.groups() for match in map(LINE.fullmatch, lines) if match]
    return [Frame(ms, bytes.fromhex(data)) for ms, sense, data in found if sense == way]


@pytest.mark.parametrize("turn", range(TURNS))
def test_serial_port_sends_the_bytes_of_the_emulator_at_the_same_time(
    page: Any, folder: Path, turn: int
) -> None:
    sky = todays(turn, TURNS, SKIES)
    page.evaluate(WATCH)
    page.select_option("#sky", str(sky))
    results = [take(page), take(page)]  # the second one by tracking
    lines = page.evaluate("lines")
    heard, told = frames(lines, "to"), frames(lines, "from")
    assert len(told) == len(heard) > 40
    assert told == emulated(folder / f"sky-{sky:02}.png", heard)
    for result in results:
        off = re.search(r": (\d+) arcsec", result)
        assert int(off[1]) < 60 if off else "3 stars detected" in result


def emulated(sky: Path, heard: list[Frame]) -> list[Frame]:
    """What the emulator answers to the same bytes at the same times; frames with their ends."""
    found, data = list[Frame](), bytearray()

    def sent(part: bytes, first_ps: int, byte_ps: int) -> None:
        for n, byte in enumerate(part):
            data.append(byte)
            if data.replace(b"\x1f\x1f", b"").endswith(b"\x1f\xff"):
                found.append(Frame(f"{(first_ps + n * byte_ps) / PS_PER_MS:.3f}", bytes(data)))
                data.clear()

    with cubestack.open_device("cubestar", PictureScene(sky), firmware="reference") as device:
        uart, kernel = device.board.uart, device.board.kernel
        uart.line = sent
        for frame in heard:
            kernel.advance_to(round(float(frame.ms)) * PS_PER_MS)
            uart.host_writes(frame.data)
        kernel.advance_to(kernel.now + 100 * PS_PER_MS)
    return found


def test_files_are_small(folder: Path) -> None:
    assert sum(file.stat().st_size for file in folder.iterdir()) < LARGEST


def test_first_picture_comes_soon(chromium: Any, address: str) -> None:
    page = chromium.new_context().new_page()
    page.set_default_timeout(SOON_MS)
    session = page.context.new_cdp_session(page)
    session.send("Performance.enable")
    page.goto(address)
    page.wait_for_selector("#status >> text=/^Ready/")
    take(page)
    metrics = {
        one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]
    }
    page.context.close()
    assert 0.1 < metrics["ProcessTime"] < MOST_S


def entered(page: Any, line: str) -> list[str]:
    """Enters a line in the terminal; returns what it says, after ``WATCH``."""
    before = page.evaluate("lines.length")
    page.fill("#line", line)
    page.press("#line", "Enter")
    page.wait_for_selector("#line[aria-disabled=false]")
    return list(page.evaluate("lines"))[before:]


SESSION = """
ExtendedIdentification
CaptureAndProcess
wait 30
SupplyReport
wait 400
SupplyReport
wait 2000
PhaseTimes
TogglePowerSW
wait 300
SupplyReport
TogglePowerSW
wait 50
SetFrameRate 20
Exposure 100
SelectCameraRegister 0x851d
wait 50
CameraRegister
CaptureImage
wait 700
CameraTiming
SaveConfig
wait 200
Trigger
wait 4400
LoopStatus
AttitudeQuaternion
StopLoop
MCUReset
wait 50
ExtendedIdentification
LogStatus
ErrorFlags
"""


def test_session_at_the_terminal_is_that_of_the_emulator(page: Any, folder: Path) -> None:
    page.evaluate(WATCH)
    for line in SESSION.split("\n")[1:-1]:
        entered(page, line)
        assert page.inner_text("#status").startswith("Ready")
    lines = page.evaluate("lines")
    told, heard = frames(lines, "from"), frames(lines, "to")
    assert len(told) == len(heard) > 20
    assert told == emulated(folder / "sky-00.png", heard)


def test_terminal_sends_names_parameters_and_bytes(page: Any) -> None:
    page.evaluate(WATCH)
    assert entered(page, "setDetectionThresholds 31 30")[1].endswith("1f 7f 00 1f ff")
    shown = entered(page, "detectionThresholdValues")[-2:]
    assert shown == ["  DetectionThreshold 31", "  StarThreshold 30"]
    assert entered(page, "1f 7f 63 1f ff")[1].endswith("1f 7f 01 1f ff")
    assert entered(page, "1f 7f ee 1f ff")[1] == "no answer"
    assert entered(page, "Exposure 100")[1].endswith("1f 7f 00 1f ff")
    assert entered(page, "Exposure")[-1] == "  exposure 100"  # a frame has the same name
    entered(page, "wait 0")
    assert page.inner_text("#status") == "wait takes 1 to 60000 ms."
    entered(page, "<img src=x>")
    assert page.inner_text("#status") == "There is no message <img."
    entered(page, "setDetectionThresholds 31")
    assert "DetectionThreshold, StarThreshold" in page.inner_text("#status")


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_page_is_accessible(page: Any, scheme: str) -> None:
    axe = pytest.importorskip("axe_playwright_python.sync_playwright")
    page.emulate_media(color_scheme=scheme)
    take(page)
    page.click("summary")
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    found = axe.Axe().run(page)
    assert not found.response["violations"], found.generate_report()
    assert page.evaluate("document.querySelector('#picture').ariaLabel").startswith("Picture of")
