"""Installs plug-in devices for a test without pip, by writing their metadata."""

import os
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from configparser import ConfigParser
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from cubestack.host.devices import registry

from ..conftest import Run

ROOT = Path(__file__).parents[2]
TIMEOUT_S = 120
PLUGIN = "cubestack.host.pytest_plugin"


@dataclass(frozen=True)
class Installed:
    """A distribution in folders ``paths``, visible to this process and its children."""

    paths: tuple[Path, ...]

    @property
    def environment(self) -> dict[str, str]:
        return {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, self.paths))}

    def run(self, *command: str | Path) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [str(word) for word in command],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )


@contextmanager
def installed(project: Path, site: Path) -> Iterator[Installed]:
    """Installs the distribution of folder ``project`` with its metadata in ``site``."""
    told = tomllib.loads((project / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = site / f"{told['name'].replace('-', '_')}-{told['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {told['name']}\nVersion: {told['version']}\n"
    )
    groups = ConfigParser()
    groups.read_dict(told["entry-points"])
    with (info / "entry_points.txt").open("w") as file:
        groups.write(file)
    distribution = Installed((site, project))
    folders = [str(path) for path in distribution.paths]
    loaded = set(sys.modules)
    sys.path[:0] = folders
    _forget()
    try:
        yield distribution
    finally:
        sys.path[:] = [path for path in sys.path if path not in folders]
        for name in set(sys.modules) - loaded:
            file = getattr(sys.modules[name], "__file__", None)
            if file and Path(file).is_relative_to(project):
                del sys.modules[name]
        _forget()


def plugins() -> tuple[str, ...]:
    """Options for pytest, needed by installations older than the entry point."""
    known = any(entry.value == PLUGIN for entry in entry_points(group="pytest11"))
    return () if known else ("-p", PLUGIN)


def _forget() -> None:
    registry._entries.cache_clear()
    registry.device.cache_clear()


@pytest.fixture
def cubestack(run: Run) -> Callable[..., str]:
    """Runs a command in this process; returns its output."""

    def call(*words: str | Path, code: int = 0) -> str:
        outcome = run(*words)
        assert outcome.code == code, outcome.err
        return outcome.out

    return call
