"""All registers against their tables: reset values, reserved bits; the C header's offsets."""

import subprocess
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.interface.efm32gg.table import (
    Instance,
    Layout,
    RegisterTableError,
    peripheral,
)
from tests.emulator.iss.cross_compiler import compile_for_m3, needs_compiler
from tests.tiers import DAY
from tests.together import together

from .bench import Bench

UNITS = [(layout, instance) for layout in LAYOUTS for instance in layout.instances]
LIVE = {"RMU.RSTCAUSE": 1}
"""Values after power-on of registers that differ from their reset values."""

PLAIN_UNITS = ("CMU", "GPIO", "EBI", "PRS", "EMU", "USART1", "I2C1", "TIMER2", "ADC0", "DAC0",
               "ACMP1", "VCMP")  # fmt: skip
SPECIAL = {"LOCK", "DTLOCK", "FREEZE", "AUXCTRL", "HFRCOCTRL", "OSCENCMD", "EM4CONF",
           "HFCORECLKDIV", "CTRL"}  # fmt: skip
"""Registers of these units whose writes have side effects."""


@together(("layout", "instance"), UNITS, ids=lambda one: one.name)
def test_reset_values_are_those_of_the_table(layout: Layout, instance: Instance) -> None:
    machine = Bench().machine
    for register in layout.registers:
        value = machine.peek(instance.base + register.offset, 4)
        expected = LIVE.get(f"{instance.name}.{register.name}", register.reset) & register.readable
        assert int.from_bytes(value, "little") == expected, register.name


@together(("layout", "instance"), UNITS, ids=lambda one: one.name)
def test_reserved_bits_read_0(layout: Layout, instance: Instance) -> None:
    """Of every third register, on another day of the others."""
    for register in layout.registers[DAY % 3 :: 3]:
        bench = Bench()
        bench["CMU.HFPERCLKEN0"] = bench["CMU.HFCORECLKEN0"] = 0xFFFF_FFFF
        bench.machine.write(instance.base + register.offset, 0xFFFF_FFFF)
        value = bench.machine.read(instance.base + register.offset)
        assert value is not None
        assert value & ~register.readable == 0, register.name


@together("pattern", [0x5555_5555, 0xAAAA_AAAA])
@together("name", PLAIN_UNITS)
def test_writable_bits_keep_their_values(name: str, pattern: int) -> None:
    layout, instance = next(unit for unit in UNITS if unit[1].name == name)
    for register in layout.registers:
        if register.readable != register.writable or register.name in SPECIAL:
            continue
        bench = Bench()
        if name != "CMU":
            bench["CMU.HFPERCLKEN0"] = bench["CMU.HFCORECLKEN0"] = 0xFFFF_FFFF
        bench.machine.write(instance.base + register.offset, pattern)
        value = bench.machine.read(instance.base + register.offset)
        assert value == pattern & register.writable, register.name


def test_registers_accept_byte_and_halfword_accesses() -> None:
    bench = Bench().clock("GPIO")
    assert bench.machine.write(0x4000_6004, 0x12, 1)
    assert bench.machine.write(0x4000_6006, 0x3456, 2)
    assert bench["GPIO.PA_MODEL"] == 0x3456_0012
    assert bench.machine.read(0x4000_6007, 1) == 0x34


def test_unit_without_clock_reads_0_and_ignores_writes() -> None:
    bench = Bench()
    bench["GPIO.PA_MODEL"] = 0x4
    assert bench["GPIO.INSENSE"] == 0
    assert "GPIO is accessed without its clock" in bench.log()
    bench.clock("GPIO")
    assert (bench["GPIO.PA_MODEL"], bench["GPIO.INSENSE"]) == (0, 3)
    assert bench.log() == ""


@pytest.mark.parametrize(
    ("unit", "key", "register", "value"),
    [
        ("EMU", 0xADE8, "CTRL", 2),
        ("CMU", 0x580E, "HFPERCLKEN0", 1),
        ("CMU", 0x580E, "LFACLKEN0", 1),
        ("GPIO", 0xA534, "PA_MODEL", 4),
    ],
)
def test_locked_register_keeps_its_value_until_the_key_is_written(
    unit: str, key: int, register: str, value: int
) -> None:
    bench = Bench()
    if unit == "GPIO":
        bench.clock("GPIO")
    for lock, expected in ((0, (1, 0)), (key, (0, value))):
        bench.load(unit, **{"LOCK": lock, register: value})
        assert (bench[f"{unit}.LOCK"], bench[f"{unit}.{register}"]) == expected


def test_register_without_behaviour_keeps_its_value_and_is_reported_once() -> None:
    bench = Bench().clock("DAC0")
    for _ in range(3):
        bench["DAC0.OPACTRL"] = 1
        assert bench["DAC0.OPACTRL"] == 1
    assert bench.log().count("DAC0.OPACTRL is kept, but does nothing") == 1


def test_access_to_an_unused_address_is_a_bus_fault() -> None:
    machine = Bench().machine
    for address in (0x0010_0000, 0x2002_0000, 0x4000_F000, 0x6000_0000, 0xC000_0000):
        assert machine.read(address) is None, hex(address)
        assert not machine.write(address, 0), hex(address)


def test_ram_has_an_alias_in_the_code_space() -> None:
    machine = Bench().machine
    assert machine.write(0x1000_0010, 0xDEAD_BEEF)
    assert machine.read(0x2000_0010) == 0xDEAD_BEEF


def test_device_information_identifies_the_part() -> None:
    machine = Bench().machine
    assert machine.read(0x0FE0_81FC) == 0x2448_0118  # GG, number 280
    assert machine.read(0x0FE0_81F8) == 128 << 16 | 1024  # sizes in kB
    assert machine.read(0x0FE0_0000) == 0xFFFF_FFFF  # user data


def test_c_header_has_the_offsets_of_the_table(tmp_path: Path) -> None:
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("no C++ compiler")
    (tmp_path / "efm32gg.h").write_text(c_header(LAYOUTS))
    lines = ['#include "efm32gg.h"', "#include <cstddef>"]
    lines += [
        f"static_assert(offsetof({layout.name}_Registers, {one.name}) == {one.offset}, "
        f'"{layout.name} {one.name}");'
        for layout in LAYOUTS
        for one in layout.registers
    ]
    source = tmp_path / "check.cpp"
    source.write_text("\n".join(lines) + "\n")
    call = [*compiler.command, "-c", str(source), "-o", str(tmp_path / "check.o")]
    subprocess.run(call, check=True)


@needs_compiler
def test_c_header_compiles_as_c(tmp_path: Path) -> None:
    source = tmp_path / "check.c"
    source.write_text(c_header(LAYOUTS) + "int read(void) { return (int)CMU->STATUS; }\n")
    options = "-std=c99 -Wall -Wextra -Wpedantic -Werror -fsyntax-only"
    compile_for_m3(*options.split(), source)


def test_instances_do_not_overlap_and_names_are_unique() -> None:
    words = [
        instance.base + register.offset
        for layout, instance in UNITS
        for register in layout.registers
    ]
    assert len(set(words)) == len(words)
    assert len({instance.name for _, instance in UNITS}) == len(UNITS)
    lines = [number for _, instance in UNITS for number in instance.interrupts.values()]
    assert {number for number in lines if lines.count(number) > 1} == {6}  # both comparators
    assert max(lines) == 38


@pytest.mark.parametrize(
    "line",
    [
        "000 CTRL rw 0",
        "002 CTRL rw 0 EN:0",
        "000 CTRL rw 0 EN:0 ON:0",
        "000 CTRL rw 2 EN:0",
        "000 CTRL rw 0 EN:32",
        "000 CTRL rw 0 EN:0\n000 CMD w 0 GO:0",
        "xyz CTRL rw 0 EN:0",
    ],
)
def test_error_names_the_wrong_line(line: str) -> None:
    with pytest.raises(RegisterTableError, match=line.splitlines()[-1][:4]):
        peripheral("UNIT", "", line)


def test_braces_expand_registers_and_fields() -> None:
    layout = peripheral("UNIT", "", "010/8 CC{0-2}_CTRL rw 0 M{AB}:0:4\n+ X:31:1:r")
    assert [(one.name, one.offset) for one in layout.registers] == [
        ("CC0_CTRL", 0x10), ("CC1_CTRL", 0x18), ("CC2_CTRL", 0x20)
    ]  # fmt: skip
    assert [(f.name, f.lsb) for f in layout["CC1_CTRL"].fields] == [("MA", 0), ("MB", 4), ("X", 31)]
    assert layout["CC1_CTRL"].writable == 0xFF
