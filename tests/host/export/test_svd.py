"""Oracles: the CMSIS schema and the parser cmsis_svd."""

from pathlib import Path

import cmsis_svd
import pytest
from cmsis_svd.parser import SVDParser
from lxml import etree

from cubestack.host.devices.registry import devices
from cubestack.host.export.processor import svd

TABLES = [device.processor() for device in devices() if device.processor is not None]
EACH = pytest.mark.parametrize("tables", TABLES, ids=lambda tables: tables.name)


@EACH
def test_svd_is_valid(tables) -> None:
    folder = Path(cmsis_svd.__file__).parent / "schemas"
    schema = etree.XMLSchema(etree.parse(str(folder / "CMSIS-SVD_1_3_9.xsd")))
    document = etree.fromstring(svd(tables).encode())
    assert schema.validate(document), schema.error_log.filter_from_errors()[:3]


@EACH
def test_parser_finds_every_register(tables, tmp_path: Path) -> None:
    path = tmp_path / "part.svd"
    path.write_text(svd(tables))
    device = SVDParser.for_xml_file(str(path)).get_device()
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
def test_parser_finds_part_and_access_rights(tables, tmp_path: Path) -> None:
    path = tmp_path / "part.svd"
    path.write_text(svd(tables))
    device = SVDParser.for_xml_file(str(path)).get_device()
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
                assert str(field.access.value) == access(own.readable, own.writable)


def access(readable: object, writable: object) -> str:
    names = {(True, True): "read-write", (False, True): "write-only"}
    return names.get((bool(readable), bool(writable)), "read-only")
