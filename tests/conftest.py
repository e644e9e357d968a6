"""Runs the command in-process; Hypothesis uses the same examples everywhere."""

import contextlib
import gc
import importlib
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest
from hypothesis import HealthCheck, settings

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from tests import tiers

settings.register_profile(
    "repeatable", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("repeatable")


class Outcome(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def line(self) -> str:
        """The only line of output, on standard error."""
        assert self.out == ""
        (line,) = self.err.splitlines()
        return line


Run = Callable[..., Outcome]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    if config.option.dist != "loadgroup":
        return None
    from tests.scheduling import Groups

    return Groups(config, log)


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Each worker compiles another part of the tests first, so that none is compiled by all.

    In a fresh clone pytest's rewriting of assertions takes longer than all other collection.
    """
    worker = getattr(session.config, "workerinput", None)
    if worker is None or sys.dont_write_bytecode:
        return
    root = session.config.rootpath
    places = [root / argument.partition("::")[0] for argument in session.config.args]
    files = sorted({file for place in places for file in place.rglob("test_*.py")})
    first = len(files) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
    for file in files[first:] + files[:first]:
        with contextlib.suppress(Exception, pytest.skip.Exception):  # reported when it is collected
            importlib.import_module(".".join(file.relative_to(root).with_suffix("").parts))


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "days in which each slow test has one turn, a weekly one in at least seven; 0: all run"
    parser.addoption("--days", type=int, default=0, help=text)


def pytest_report_header(config: pytest.Config) -> str:
    days = config.getoption("--days")
    return f"slow tests: each on one day in {days or 1}, TESTS_DAY={tiers.DAY}"


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out slow tests of other days, and marks groups.

    Tests that share a module fixture run in one process, so that it is made once.
    """
    days = config.getoption("--days")
    slow = [item for item in items if item.get_closest_marker("slow")]
    turns = [tiers.turns(item, days) for item in slow]
    today = tiers.of_day([item.nodeid for item in slow], tiers.DAY, turns)
    others = {item for item, runs in zip(slow, today, strict=True) if not runs}
    config.hook.pytest_deselected(items=[*others])
    items[:] = [item for item in items if item not in others]
    for item in items:
        shared = getattr(item, "_fixtureinfo", None)
        found = shared.name2fixturedefs.values() if shared else ()
        of_module = any(fixtures[-1].scope == "module" for fixtures in found)
        if of_module and item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))


def pytest_collection_finish() -> None:
    """Excludes the collected tests from garbage collection."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[Any]:
    """Excludes what a module has imported and cached, too, or each collection would take longer."""
    ended = yield
    if nextitem is None or nextitem.path != item.path:
        gc.collect()
        gc.freeze()
    return ended


@pytest.fixture
def profile() -> str:
    """Profile of the devices; tests of one profile are parametrised with its name."""
    return DEFAULT_PROFILE


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs the command with arguments, without progress lines."""
    from cubestack.host import terminal
    from cubestack.host.cli.main import main

    monkeypatch.setattr(terminal, "EVERY_S", 3600.0)

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:  # raised by argparse
            code = int(end.code or 0)
        return Outcome(code, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A headless browser; skips if there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("chromium is not installed")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    # Its driver may lack a system library such as libatomic1.
    call = [sys.executable, "-m", "playwright", "--version"]
    tried = subprocess.run(call, capture_output=True, text=True)
    if tried.returncode != 0:
        pytest.skip(f"playwright does not start: {tried.stderr.strip()}")
    with api.sync_playwright() as playwright:
        # Containers have no sandbox, and only our own pages are opened.
        words = ["--no-sandbox", "--process-per-site"]
        browser = playwright.chromium.launch(executable_path=program, args=words)
        browser.new_context()  # which pages share that need none of their own
        yield browser
        browser.close()
