"""Listings of a processor's registers."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.cubestar.processor_header import PROCESSOR
from cubestack.host.cli.main import main
from cubestack.host.export.processor import processor_header, render_processor


@pytest.mark.parametrize("format_name", ["table", "markdown", "json"])
def test_every_register_is_listed_at_its_address(format_name: str) -> None:
    text = render_processor(PROCESSOR, format_name)
    if format_name == "json":
        found = {
            f"{one['peripheral']}.{one['name']}": one["address"]
            for one in json.loads(text)["registers"]
        }
    else:
        rows = re.findall(r"^(?:\| )?([0-9A-F]{8}) (?:\| )?(\S+) ", text, re.MULTILINE)
        found = {name: int(address, 16) for address, name in rows}
    assert found["CMU.CTRL"] == 0x400C8000
    assert found["UART1.TXDATA"] == 0x4000E434
    registers = sum(len(one.registers) * len(one.instances) for one in PROCESSOR.layouts)
    assert len(found) == registers


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
def test_the_c_header_compiles_and_has_the_pins(tmp_path: Path) -> None:
    (tmp_path / "processor.h").write_text(processor_header(PROCESSOR), encoding="utf-8")
    source = '#include "processor.h"\n_Static_assert(FPGA_DATA % 16 == 0, "a byte");\n'
    source += "unsigned baud(void) { return SATELLITE_UART->CLKDIV & USART_CLKDIV_DIV; }\n"
    (tmp_path / "main.c").write_text(source, encoding="utf-8")
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-int-to-pointer-cast"]
    subprocess.run(["cc", *flags, "-fsyntax-only", "main.c"], cwd=tmp_path, check=True)


def test_a_device_without_firmware_of_one_s_own_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["registers", "aramis", "--processor"]) != 0
    assert "aramis runs no firmware of your own" in capsys.readouterr().err
