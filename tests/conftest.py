"""The command as a shell sees it; properties are tested with the same examples everywhere."""

from collections.abc import Callable
from typing import NamedTuple

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


@pytest.fixture
def profile() -> str:
    """Profile of what is tested; a test about one of them is parametrized with its name."""
    return DEFAULT_PROFILE


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs the command with arguments, as the shell would see it."""
    from cubestack.host.cli.main import main

    def call(*arguments: object) -> Outcome:
        capsys.readouterr()
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:  # argparse's way out
            code = int(end.code or 0)
        return Outcome(code, *capsys.readouterr())

    return call
