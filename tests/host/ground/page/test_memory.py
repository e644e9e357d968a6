"""Memory of the page and of its server during two simulated hours, on each seventh day eight.

Each is tested alone, because both together mostly wait for each other: the server sends to
programs, and the page receives from a WebSocket in its own browser.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from websockets.sync.client import connect

from ..browser import shown
from ..conftest import SOON_S

pytestmark = [pytest.mark.xdist_group("page hours"), pytest.mark.slow, pytest.mark.weekly]

TABS = 8
FRAMES = ["AttitudeQuaternion", "TaskStatus", "PerformanceParameters"]

END_S = 8 * 3600
BEGIN_S = 2880

MOST_GROWTH = 1 << 20
"""Bytes, of the page's heap and of the server's memory."""

FED = """
window.WebSocket = class {
  static OPEN = 1;
  readyState = 1;
  constructor() {
    window.hear = (message) => this.onmessage({ data: JSON.stringify(message) });
  }
  send() {}
  close() {}
};
"""
"""A WebSocket that is fed by the test."""

SECONDS = """async ([told, from, to, tasks]) => {
  for (let second = from; second < to; second++) {
    told.emulation.time_s = second;
    told.emulation.truth.ra_deg = second % 360;
    told.results.ra_deg = (second + 0.01) % 360;
    told.results.task = `TASK ${second % 9}`;
    told.values.TaskStatus.taskStatus = second % tasks;
    told.values.AttitudeQuaternion.Q2 = Math.sin(second);
    told.link.sent = told.results_logged = second;
    told.log = [`${second} s something happened`];
    told.pictures.SRAM.changed_s = Math.floor(second / 10);
    window.hear(told);
  }
  await new Promise(requestAnimationFrame);
}"""
"""Sends the messages of the given seconds."""

AT_ONCE = 50


class Page(NamedTuple):
    heap: int
    nodes: int
    listeners: int


@pytest.fixture
def server() -> Iterator[Any]:
    call = [sys.executable, "-m", "tests.host.ground.fast_server"]
    root, pipe = Path(__file__).parents[4], subprocess.PIPE
    with subprocess.Popen(call, cwd=root, stdin=pipe, stdout=pipe, text=True) as process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


def live(address: str) -> Any:
    url = address.replace("http:", "ws:").partition("?")[0] + "targets/0/live"
    headers = {"Authorization": "Bearer token"}
    return connect(url, additional_headers=headers, open_timeout=SOON_S)


def told(address: str, until_s: int) -> dict[str, Any]:
    """The first message to a tab at or after ``until_s``."""
    with live(address) as socket:
        socket.send(json.dumps({"show": FRAMES, "results": True, "every_s": 0}))
        while True:
            message: dict[str, Any] = json.loads(socket.recv(SOON_S))
            if message["emulation"]["time_s"] >= until_s and "values" in message:
                return message


def resident(process: Any) -> int:
    lines = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith("VmRSS"))


def test_server_memory_does_not_grow(server: Any) -> None:
    address = server.stdout.readline().strip()
    with ThreadPoolExecutor(TABS) as pool:
        [*pool.map(lambda _tab: told(address, BEGIN_S), range(TABS))]
        early = resident(server)
        [last, *_] = pool.map(lambda _tab: told(address, END_S), range(TABS))
        late = resident(server)
    print(f"server: {early} bytes at {BEGIN_S} s, {late} at {END_S} s")
    assert last["results_logged"] > 0.9 * END_S
    assert last["link"]["failed"] == 0
    assert late - early < MOST_GROWTH


def measured(page: Any) -> Page:
    session = page.context.new_cdp_session(page.page)
    session.send("Performance.enable")
    session.send("HeapProfiler.collectGarbage")
    session.send("HeapProfiler.collectGarbage")
    metrics = session.send("Performance.getMetrics")["metrics"]
    found = {one["name"]: int(one["value"]) for one in metrics}
    session.detach()
    return Page(found["JSHeapUsedSize"], found["Nodes"], found["JSEventListeners"])


def test_page_memory_does_not_grow(chromium: Any, server: Any) -> None:
    address = server.stdout.readline().strip()
    message = told(address, 1)
    with shown(chromium, address, alone=True) as page:
        page.context.add_init_script(FED)
        page.reload()
        page.wait_for_function("() => window.hear")
        page.select_option("#frame", "AttitudeQuaternion")
        page.check("[title='plot Q2']")
        page.select_option("#band", "TaskStatus.taskStatus")
        page.click("#add-band")

        def seconds(begin: int, end: int) -> Page:
            for first in range(begin, end, AT_ONCE):
                page.evaluate(SECONDS, [message, first, min(first + AT_ONCE, end), 20])
            return measured(page)

        early = seconds(0, BEGIN_S)
        late = seconds(BEGIN_S, END_S)
        newest = page.locator("#lines li").first.inner_text()
        fetched = page.evaluate(
            "performance.getEntriesByType('resource').some((e) => e.name.includes('/pictures/'))"
        )
    print(f"page: {early} at {BEGIN_S} s, {late} at {END_S} s")
    assert fetched
    assert f"{END_S - 1} s something happened" in newest
    assert late.nodes <= early.nodes + 100
    assert late.listeners <= early.listeners
    assert late.heap - early.heap < MOST_GROWTH
