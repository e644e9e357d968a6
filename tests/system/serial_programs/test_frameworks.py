"""The examples for other emulators and test frameworks: QEMU, labgrid and NASA's hwlib."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.system.clients import FOLDER, built, python, tool
from tests.system.conftest import COMMAND, ROOT, Served

EXAMPLES = ROOT / "examples"
TIMEOUT_S = 120


def run(*words: str | Path, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        words,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        cwd=cwd,
        stdin=subprocess.DEVNULL,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
    )


@pytest.fixture(scope="module")
def qemu(tmp_path_factory: pytest.TempPathFactory) -> list[str | Path]:
    """QEMU with the example's firmware, and its first UART on standard output."""
    program, compiler = tool("qemu-system-arm"), tool("arm-none-eabi-gcc")
    source, built_image = EXAMPLES / "qemu_uart", tmp_path_factory.mktemp("qemu") / "main.elf"
    options = "-mcpu=cortex-m3 -mthumb -Os -Wall -Wextra -Werror -ffreestanding -nostdlib"
    files = ["-T", source / "lm3s6965.ld", source / "main.c", "-o", built_image]
    subprocess.run([*compiler, *options.split(), *files], check=True)
    options = "-M lm3s6965evb -display none -semihosting -serial stdio"
    return [*program, *options.split(), "-kernel", built_image]


@pytest.mark.slow
def test_firmware_in_qemu_reads_a_pseudo_terminal(qemu: list[str | Path]) -> None:
    port = ["-chardev", "serial,id=sensor,path={port}", "-serial", "chardev:sensor"]
    done = run(*COMMAND, "run", "--quiet", "--serial", "cubestar", "--", *qemu, *port)
    assert (done.returncode, done.stdout) == (0, "05030001\n"), done.stderr


@pytest.mark.slow
def test_firmware_in_qemu_reads_a_tcp_port(qemu: list[str | Path], tmp_path: Path) -> None:
    with Served(["cubestar", "--tcp", "0"], tmp_path) as served:
        done = run(*qemu, "-serial", served.port.replace("://", ":"))
    assert (done.returncode, done.stdout) == (0, "05030001\n"), done.stderr


@pytest.mark.slow
def test_labgrid_example_passes(tmp_path: Path) -> None:
    if not FOLDER.exists():
        pytest.skip("needs CUBESTACK_CLIENTS")
    source = EXAMPLES / "labgrid"
    command = python("labgrid", venv="labgrid")(source / "test_star_tracker.py", tmp_path)
    environment = tmp_path / "environment.yaml"
    with Served(["cubestar", "--rfc2217", "0"], tmp_path) as served:
        port = served.port.rpartition(":")[2]
        text = (source / environment.name).read_text().replace("port: 4000", f"port: {port}")
        environment.write_text(text)
        options = ["-m", "pytest", "-q", "-p", "no:cacheprovider", f"--rootdir={tmp_path}"]
        done = run(command[0], *options, "--lg-env", environment, command[1], cwd=tmp_path)
    assert "2 passed" in done.stdout, done.stdout + done.stderr


@pytest.fixture(scope="module")
def component(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example for hwlib, with its stand-in."""
    folder = tmp_path_factory.mktemp("hwlib")
    source = EXAMPLES / "hwlib"
    options = ("-std=c11", "-D_DEFAULT_SOURCE", "-Wall", "-Wextra", "-Werror")
    command = built("cc", *options, str(source / "stand_in.c"))
    (program,) = command(source / "star_tracker.c", folder / "built")
    return Path(program)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [("--serial", "cubestar", "--", "{port}"), ("--pace", "fast", "--", "7")]
)
def test_hwlib_example_reads_the_serial_line_and_the_bus(
    component: Path, options: tuple[str, ...]
) -> None:
    *before, last = options
    done = run(*COMMAND, "run", "--quiet", *before, component, last)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "node type 5, interface 3, firmware 0.1\n"


def test_hwlib_example_reports_a_missing_device(component: Path) -> None:
    for place in ("/dev/nowhere", "250"):
        done = run(component, place)
        assert (done.returncode, done.stderr) == (1, "star_tracker: no answer\n")
