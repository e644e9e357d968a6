from pathlib import Path

import pytest

from cubestack.host.emulation.emulated import open_device
from tests.emulator.boards.efm32gg.programs import application, needs_both_compilers, unit_tests

pytestmark = needs_both_compilers


def test_runs_to_the_exit_of_the_program(tmp_path: Path) -> None:
    elf = str(unit_tests(tmp_path))
    ends = []
    for _ in range(2):
        with open_device("efm32gg", firmware=elf, semihosting=True) as part:
            ends.append(part.run_to_exit(timeout_s=1))
    assert ends[0].status == 0
    assert ends[0].output.splitlines()[0] == "ok   nothing pressed"
    assert ends[0] == ends[1]  # the time too


def test_program_that_does_not_exit_times_out(tmp_path: Path) -> None:
    app, tests = str(application(tmp_path)), str(unit_tests(tmp_path))
    with (
        open_device("efm32gg", firmware=app, semihosting=True) as part,
        pytest.raises(TimeoutError, match=r"^no exit by semihosting within 0\.2 s$"),
    ):
        part.run_to_exit(timeout_s=0.2)
    with (  # without semihosting its first call is a fault, which is reported
        open_device("efm32gg", firmware=tests) as part,
        pytest.raises(TimeoutError, match=r"within 0\.2 s; it printed:\n[^\n]*fault"),
    ):
        part.run_to_exit(timeout_s=0.2)


def test_only_own_firmware_exits() -> None:
    with (
        open_device("cubestar") as star,
        pytest.raises(ValueError, match="only own firmware exits"),
    ):
        star.run_to_exit()
