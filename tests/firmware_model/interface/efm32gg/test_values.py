"""Names of field values: every line is of use, and they agree with other tables of the part."""

import re
from fnmatch import fnmatchcase

import pytest

from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.pins import ROUTES
from cubestack.firmware_model.interface.efm32gg.table import (
    Instance,
    RegisterTableError,
    peripheral,
)
from cubestack.firmware_model.interface.efm32gg.values import value_names, with_values
from tests.together import together

FIELDS = {
    f"{layout.name}.{register.name}.{field.name}": field
    for layout in LAYOUTS
    for register in layout.registers
    for field in register.fields
}
UNITS = {instance.name for layout in LAYOUTS for instance in layout.instances}


def values(name: str) -> dict[str, int]:
    return {text: number for number, text in FIELDS[name].values}


@together("pattern", [pattern for pattern, _ in value_names()])
def test_line_names_values_of_a_field(pattern: str) -> None:
    assert any(field.values for name, field in FIELDS.items() if fnmatchcase(name, pattern))


@together("pattern", [pattern for pattern, _ in value_names()])
def test_line_is_not_hidden_by_an_earlier_one(pattern: str) -> None:
    own = dict(value_names())[pattern]
    found = [field for name, field in FIELDS.items() if fnmatchcase(name, pattern)]
    assert any(field.values == own[: len(field.values)] for field in found)


def test_values_fit_their_fields_and_have_different_names() -> None:
    for name, field in FIELDS.items():
        names = [text for _, text in field.values]
        assert len(set(names)) == len(names), name
        assert all(0 <= number < 1 << field.width for number, _ in field.values), name


@pytest.mark.parametrize("register", ["PRS.CH0_CTRL.SOURCESEL", "DMA.CH0_CTRL.SOURCESEL"])
def test_sources_are_units_of_the_part(register: str) -> None:
    for name in values(register).keys() - {"NONE"}:
        assert name in UNITS or re.fullmatch("GPIO[LH]|LESENSE[LHD]", name)


def test_locations_are_those_that_have_pins() -> None:
    assert len(values("USART.ROUTE.LOCATION")) == len(ROUTES["USART0_TX"])
    assert len(values("I2C.ROUTE.LOCATION")) == len(ROUTES["I2C0_SDA"])
    assert list(values("ACMP.ROUTE.LOCATION")) == ["LOC0", "LOC1", "LOC2"]


@pytest.mark.parametrize(
    ("field", "name", "number"),
    [
        ("GPIO.PC_MODEH.MODE9", "WIREDANDPULLUPFILTER", 11),
        ("CMU.AUXHFRCOCTRL.BAND", "21MHZ", 7),
        ("TIMER.CTRL.PRESC", "DIV1024", 10),
        ("CMU.LFAPRESC0.LCD", "DIV128", 3),
        ("USART.FRAME.DATABITS", "EIGHT", 5),
        ("ADC.CTRL.OVSRSEL", "X4096", 11),
        ("EMU.MEMCTRL.POWERDOWN", "BLK123", 7),
        ("LESENSE.CH15_INTERACT.EXCLK", "AUXHFRCO", 1),
    ],
)
def test_names_have_the_numbers_of_the_manual(field: str, name: str, number: int) -> None:
    assert values(field)[name] == number


def test_narrow_field_selects_from_the_first_reflex_channels() -> None:
    assert len(values("USART.IRCTRL.IRPRSSEL")) == 8
    assert len(values("DAC.CH1CTRL.PRSSEL")) == 12


def test_too_many_names_are_an_error() -> None:
    narrow = peripheral("EBI", "", "000 ROUTE rw 0 ALB:16:1", Instance("EBI", 0))
    with pytest.raises(RegisterTableError, match=r"EBI\.ROUTE\.ALB.* 1 bits"):
        with_values([narrow])
