import json
import re
import shutil
import subprocess
from pathlib import Path

import cmsis_svd
import pytest
from cmsis_svd.model import SVDDevice
from cmsis_svd.parser import SVDParser
from lxml import etree

from cubestack.firmware_model.interface.cubestar.processor_pins import PROCESSOR
from cubestack.host.devices.registry import devices
from cubestack.host.export.processor import processor_header, render_processor, svd

ROOT = Path(__file__).parents[3]


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
def test_c_header_compiles(tmp_path: Path) -> None:
    (tmp_path / "processor.h").write_text(processor_header(PROCESSOR), encoding="utf-8")
    source = '#include "processor.h"\n_Static_assert(FPGA_DATA % 16 == 0, "a byte");\n'
    source += "unsigned baud(void) { return SATELLITE_UART->CLKDIV & USART_CLKDIV_DIV; }\n"
    (tmp_path / "main.c").write_text(source, encoding="utf-8")
    flags = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wno-int-to-pointer-cast"]
    subprocess.run(["cc", *flags, "-fsyntax-only", "main.c"], cwd=tmp_path, check=True)


def test_c_header_defines_the_names_of_the_reference_firmware() -> None:
    defined = dict(re.findall(r"^#define (\w+) (\S+)", processor_header(PROCESSOR), re.MULTILINE))
    text = "".join(
        path.read_text("utf-8") for path in (ROOT / "firmware_model/reference").rglob("*.[ch]")
    )
    units = "(?:SATELLITE|CAMERA|MEMORY|IMAGER)_(?:UART|I2C|SWITCH|ADC|COMPARATOR|MA_PER_VOLT)"
    used = set(re.findall(rf"\b(?:FPGA_(?!H\b)[A-Z]+|LED\d|{units}\w*|SUPPLY_VOLTS)\b", text))
    assert len(used) > 25
    assert used - {"CAMERA_I2C_ADDRESS"} <= defined.keys()
    for unit in ("SATELLITE_UART", "SATELLITE_I2C", "CAMERA_I2C"):
        assert defined[f"{unit}_CLOCK"] == f"CMU_HFPERCLKEN0_{defined[unit]}"
        assert defined[f"{unit}_CLOCK"] in defined
    pins = {"FPGA_ENABLE": "PA8", "FPGA_DATA": "PE0", "CAMERA_RESET": "PA7", "MEMORY_SWITCH": "PC6"}
    pins |= {"SATELLITE_UART_TX_PIN": "PD0", "CAMERA_I2C_SCL_PIN": "PB12", "LED1": "PB4"}
    for name, pin in pins.items():
        assert defined[name] == f"{16 * (ord(pin[1]) - ord('A')) + int(pin[2:])}u", name


TABLES = [device.processor() for device in devices() if device.processor is not None]
EACH = pytest.mark.parametrize("tables", TABLES, ids=lambda tables: tables.name)


@pytest.fixture
def device(tables, tmp_path: Path) -> SVDDevice:
    (tmp_path / "part.svd").write_text(svd(tables))
    return SVDParser.for_xml_file(str(tmp_path / "part.svd")).get_device()


@EACH
def test_exported_svd_is_valid_against_its_schema(tables) -> None:
    folder = Path(cmsis_svd.__file__).parent / "schemas"
    schema = etree.XMLSchema(etree.parse(str(folder / "CMSIS-SVD_1_3_9.xsd")))
    document = etree.fromstring(svd(tables).encode())
    assert schema.validate(document), schema.error_log.filter_from_errors()[:3]


@EACH
def test_svd_describes_the_core(device) -> None:
    assert (str(device.cpu.name), device.cpu.revision, device.cpu.nvic_prio_bits) == (
        str(type(device.cpu.name)("CM3")),
        "r2p1",
        3,
    )
    assert device.cpu.mpu_present
    assert not device.cpu.fpu_present


@EACH
def test_parser_finds_every_register(tables, device) -> None:
    found = {
        (peripheral.name, register.name): (
            peripheral.base_address + register.address_offset,
            register.reset_value,
            {(field.name, field.bit_offset, field.bit_width) for field in register.fields or ()},
        )
        for peripheral in device.peripherals
        for register in peripheral.registers or ()
    }
    expected = {
        (instance.name, register.name): (
            instance.base + register.offset,
            register.reset,
            {(field.name, field.lsb, field.width) for field in register.fields if field.name},
        )
        for layout in tables.layouts
        for instance in layout.instances
        for register in layout.registers
    }
    assert found == expected
    lines = {one.value for peripheral in device.peripherals for one in peripheral.interrupts or ()}
    assert lines == {
        number
        for layout in tables.layouts
        for instance in layout.instances
        for number in instance.interrupts.values()
    }


@EACH
def test_parser_finds_part_and_access_rights(tables, device) -> None:
    assert device.name == tables.name
    assert (device.address_unit_bits, device.width, device.size) == (8, 32, 32)
    layouts = {one.name: layout for layout in tables.layouts for one in layout.instances}
    for peripheral in device.peripherals:
        layout = layouts[peripheral.name]
        assert peripheral.description == layout.title
        (block,) = peripheral.address_blocks or ()
        ends = [register.offset + 4 for register in layout.registers]
        assert (block.offset, block.size) == (0, max(ends, default=4))
        known = {register.name: register for register in layout.registers}
        for register in peripheral.registers or ():
            wanted = known[register.name]
            assert register.size == 32
            assert str(register.access.value) == access(wanted.readable, wanted.writable)
            assert ("only keeps it" in register.description) == (not wanted.modelled)
            assert (register.read_action is not None) == bool(wanted.action)
            fields = {field.name: field for field in wanted.fields}
            for field in register.fields or ():
                own = fields[field.name]
                groups = field.enumerated_values or ()
                found = [
                    (one.value, one.name) for group in groups for one in group.enumerated_values
                ]
                assert found == list(own.values)
                assert str(field.access.value) == access(own.readable, own.writable)


def access(readable: object, writable: object) -> str:
    names = {(True, True): "read-write", (False, True): "write-only"}
    return names.get((bool(readable), bool(writable)), "read-only")
