"""Libraries and languages on the emulated bus, by both routes: the table of docs/how-to/i2c.md."""

from pathlib import Path

import pytest

from tests.system.clients import ENVIRONMENT, Client, built, interpreter, node, perl, python, table
from tests.system.conftest import ROOT

from ...conftest import Run
from .conftest import ROUTES

PROGRAMS = Path(__file__).with_name("programs")

HEADERS = ("-idirafter", "/usr/include", "-idirafter", "/usr/include/x86_64-linux-gnu")
STATIC = (("preload", "linked statically"),)

CLIENTS = (
    Client("i2c-tools 4.3", "i2c_tools.sh", interpreter("sh")),
    Client("Python smbus2 0.6", "smbus.py", python("smbus2", "smbus2")),
    Client("Python smbus3 0.5", "smbus.py", python("smbus3", "smbus3")),
    Client("python-periphery 2.4", "periphery_i2c.py", python("periphery")),
    Client("Adafruit Blinka 10.0", "blinka.py", python("adafruit_blinka")),
    Client("npm i2c-bus 5.2 (Node.js 20)", "i2c_bus.js", node("i2c-bus")),
    Client("Perl 5.36 without modules", "plain.pl", interpreter("perl")),
    Client("Perl Device::I2C 0.06", "device_i2c.pl", perl("Device::I2C")),
    Client("C, glibc", "plain.c", built("cc")),
    Client("C, glibc, static", "plain.c", built("cc", "-static"), STATIC),
    Client("C, musl 1.2", "plain.c", built("musl-gcc", *HEADERS), (("preload", "needs glibc"),)),
    Client("C, musl 1.2, static", "plain.c", built("musl-gcc", "-static", *HEADERS), STATIC),
    Client("Rust 1.95", "plain.rs", built("rustc")),
    Client("Go 1.19", "plain.go", built("go", "build"), STATIC),
)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Each program is built there once."""
    return tmp_path_factory.mktemp("clients")


@pytest.mark.slow
@pytest.mark.parametrize("client", CLIENTS, ids=lambda client: client.name)
def test_program_reads_the_bus_by_each_route(
    run: Run, route: str, client: Client, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CGO_ENABLED", "0")
    command = client.command(PROGRAMS / client.source, folder / client.name.replace("/", "-"))
    outcome = run("env", f"NODE_PATH={ENVIRONMENT['NODE_PATH']}", *command, "/dev/i2c-7")
    if client.reason(route):
        assert "05030001" not in outcome.out
    else:
        assert outcome == (0, "05030001 01 absent\n", "")


def test_page_has_the_table_of_clients() -> None:
    page = (ROOT / "docs" / "how-to" / "i2c.md").read_text(encoding="utf-8")
    shown = page.split("<!-- table: generated from tests/system/i2c_programs/test_clients.py -->\n")
    assert shown[1].split("\n<!-- end of table -->")[0] == table(CLIENTS, ROUTES)
