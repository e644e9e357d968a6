"""Connections of CubeStar's processor as C, for firmware: pins, units and their numbers.

A pin's number is its port times 16 plus its bit.
"""

from collections.abc import Iterator

from cubestack.firmware_model.interface.cubestar import INTERFACE, processor_pins
from cubestack.firmware_model.interface.cubestar.processor_pins import Unit
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.pins import pin_number
from cubestack.firmware_model.interface.efm32gg.table import Processor

_UNITS = {
    "SATELLITE_UART": processor_pins.SATELLITE_UART,
    "SATELLITE_I2C": processor_pins.SATELLITE_I2C,
    "CAMERA_I2C": processor_pins.CAMERA_I2C,
}


def pins_header() -> str:
    """The header's text, which must follow the header of the part's registers."""
    return "\n".join(["/* What the processor is connected to. */", *_lines(), ""])


def _lines() -> Iterator[str]:
    for name, pin in processor_pins.FPGA.items():
        yield _pin(f"FPGA_{name}", pin)
    yield _pin("CAMERA_RESET", processor_pins.CAMERA_RESET)
    for number, pin in enumerate(processor_pins.LEDS):
        yield _pin(f"LED{number}", pin)
    for title, unit in _UNITS.items():
        yield from _unit(title, unit)
    yield f"#define SATELLITE_BAUD {INTERFACE.baud}u"
    yield f"#define SATELLITE_ADDRESS 0x{INTERFACE.i2c_address:02X}u"
    for channel, monitor in processor_pins.MONITORS.items():
        title = channel.upper()
        yield _pin(f"{title}_SWITCH", processor_pins.SWITCHES[channel])
        yield f"#define {title}_ADC_CHANNEL {monitor.adc_channel}u"
        yield f"#define {title}_COMPARATOR ACMP{monitor.comparator}"
        yield f"#define {title}_COMPARATOR_CHANNEL {monitor.comparator_channel}u"
        yield f"#define {title}_MA_PER_VOLT {1000 / monitor.volts_per_a!r}f"
    yield f"#define SUPPLY_VOLTS {processor_pins.SUPPLY_VOLTS!r}f"
    yield f"#define EXTERNAL_RAM 0x{processor_pins.EXTERNAL_RAM:08X}u"


def _unit(title: str, unit: Unit) -> Iterator[str]:
    yield f"#define {title} {unit.name}"
    yield f"#define {title}_LOCATION {unit.location}u"
    yield f"#define {title}_CLOCK CMU_HFPERCLKEN0_{unit.name}"
    for signal in unit.signals:
        yield f"#define {title}_{signal}_PIN {unit.pin(signal)}u"
    for way in ("_RX", "_TX") if "TX" in unit.signals else ("",):
        yield f"#define {title}{way}_IRQ {unit.name}{way}_IRQ"


def _pin(name: str, pin: str) -> str:
    return f"#define {name} {pin_number(pin)}u /* {pin} */"


PROCESSOR = Processor("EFM32GG280F1024", LAYOUTS, pins_header)
