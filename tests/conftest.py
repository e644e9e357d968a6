"""The command as a shell sees it; properties are tested with the same examples everywhere."""

import gc
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import pytest
from hypothesis import HealthCheck, settings

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE

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
        """The one line that was said of what is wrong, and nothing else."""
        assert self.out == ""
        (line,) = self.err.splitlines()
        return line


Run = Callable[..., Outcome]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests that share a fixture of their module stay in one process, so that it is made once."""
    for item in items:
        shared = getattr(item, "_fixtureinfo", None)
        found = shared.name2fixturedefs.values() if shared else ()
        of_module = any(fixtures[-1].scope == "module" for fixtures in found)
        if of_module and item.get_closest_marker("xdist_group") is None:
            item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))


def pytest_collection_finish() -> None:
    """What was collected stays: no need to look through it for garbage again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def profile() -> str:
    """Profile of what is tested; a test about one of them is parametrized with its name."""
    return DEFAULT_PROFILE


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs the command with arguments, as the shell would see it on a machine that is quick."""
    from cubestack.host import terminal
    from cubestack.host.cli.main import main

    monkeypatch.setattr(terminal, "EVERY_S", 3600.0)  # else it tells how long something takes

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:  # argparse's way out
            code = int(end.code or 0)
        return Outcome(code, *capsys.readouterr())

    return call


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    """A real browser, without a window; skips where there is none."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        pytest.skip("chromium is not installed")
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    # Its own program may lack a library of the system, such as libatomic1.
    call = [sys.executable, "-m", "playwright", "--version"]
    tried = subprocess.run(call, capture_output=True, text=True)
    if tried.returncode != 0:
        pytest.skip(f"playwright does not start: {tried.stderr.strip()}")
    with api.sync_playwright() as playwright:
        # In a container there is no sandbox to be had, and only our own pages are opened.
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        yield browser
        browser.close()
