"""The SVD, as its schema has it and as a parser of others reads it."""

from pathlib import Path

import cmsis_svd
import pytest
from cmsis_svd.parser import SVDParser
from lxml import etree

from cubestack.host.devices.registry import devices
from cubestack.host.export.svd import svd

TABLES = [device.processor() for device in devices() if device.processor is not None]
EACH = pytest.mark.parametrize("tables", TABLES, ids=lambda tables: tables.name)


@EACH
def test_it_is_what_the_schema_asks_for(tables) -> None:
    folder = Path(cmsis_svd.__file__).parent / "schemas"
    schema = etree.XMLSchema(etree.parse(str(folder / "CMSIS-SVD_1_3_9.xsd")))
    document = etree.fromstring(svd(tables).encode())
    assert schema.validate(document), schema.error_log.filter_from_errors()[:3]


@EACH
def test_a_parser_finds_every_register_where_it_is(tables, tmp_path: Path) -> None:
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
