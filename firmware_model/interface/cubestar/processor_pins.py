"""Wiring of CubeStar's EFM32GG280F1024 (LQFP100), for a user's own firmware.

The thesis prints no schematic of the processor's pins: this wiring is assumed. It follows the
part's alternate functions (see ``efm32gg.pins``), leaves the external bus (PE8..PE15, PA15,
PA0..PA6, PD9..PD12, PF3..PF5), the crystals (PB7, PB8, PB13, PB14) and the debug pins (PF0..PF2)
free, and has the eight data pins of the FPGA side by side, so that a byte is one read of a port.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from cubestack.firmware_model.interface.cubestar import INTERFACE, pins
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.pins import ROUTES, pin_number
from cubestack.firmware_model.interface.efm32gg.table import Processor

#: Pins to the FPGA board of the published layout, by the FPGA's names; for DATA, its bit 0.
FPGA = {
    pins.ENABLE: "PA8",
    pins.RNW: "PA9",
    pins.DCLK: "PA10",
    pins.BANK: "PA11",
    pins.ACK: "PA12",
    pins.DATA: "PE0",
}

CAMERA_RESET = "PA7"  #: reset of the image sensor, active low, pulled up

#: Load switches by supply channel: high is on, pulled up.
SWITCHES = {"memory": "PC6", "imager": "PC7"}

LEDS = ("PB3", "PB4")
"""High is on. Their current is constant: the published figures have both on all the time."""


@dataclass(frozen=True)
class Unit:
    """A peripheral of the part with connections to the outside."""

    name: str  #: of the peripheral
    location: int  #: value for its ROUTE register
    signals: tuple[str, ...]  #: used ones, without the peripheral's name

    def pin(self, signal: str) -> int:
        """A signal's pin: port times 16 plus bit."""
        return ROUTES[f"{self.name}_{signal}"][self.location]


SATELLITE_UART = Unit("USART1", 1, ("TX", "RX"))  # PD0, PD1
SATELLITE_I2C = Unit("I2C0", 1, ("SDA", "SCL"))  # PD6, PD7; slave
CAMERA_I2C = Unit("I2C1", 1, ("SDA", "SCL"))  # PB11, PB12; master


@dataclass(frozen=True)
class Monitor:
    """A current monitor of a supply channel, at an ADC and a comparator input."""

    adc_channel: int  #: of ADC0, whose channels are at PD0..PD7
    comparator: int  #: number of the ACMP
    comparator_channel: int  #: ACMP0 has its channels at PC0..PC7, ACMP1 at PC8..PC15
    volts_per_a: float  #: output voltage per current; it saturates at ``SUPPLY_VOLTS``


MONITORS = {"memory": Monitor(4, 0, 4, 50.0), "imager": Monitor(5, 1, 0, 5.0)}

SUPPLY_VOLTS = 3.3

EXTERNAL_RAM = 0x8000_0000
"""Address of the external bus' first bank: the SRAM of the published layout, chip select EBI_CS0.

Bus mode D8A24ALE, address latch and strobes at location 0. The other layouts have the FPGA there.
"""


def port_pin(name: str) -> tuple[int, int]:
    """Port number and bit of a pin, by its name."""
    return divmod(pin_number(name), 16)


_UNITS = {
    "SATELLITE_UART": SATELLITE_UART,
    "SATELLITE_I2C": SATELLITE_I2C,
    "CAMERA_I2C": CAMERA_I2C,
}


def pins_header() -> str:
    """The header's text, which must follow the header of the part's registers."""
    return "\n".join(["/* What the processor is connected to. */", *_lines(), ""])


def _lines() -> Iterator[str]:
    for name, pin in FPGA.items():
        yield _pin(f"FPGA_{name}", pin)
    yield _pin("CAMERA_RESET", CAMERA_RESET)
    for number, pin in enumerate(LEDS):
        yield _pin(f"LED{number}", pin)
    for title, unit in _UNITS.items():
        yield from _unit(title, unit)
    yield f"#define SATELLITE_BAUD {INTERFACE.baud}u"
    yield f"#define SATELLITE_ADDRESS 0x{INTERFACE.i2c_address:02X}u"
    for channel, monitor in MONITORS.items():
        title = channel.upper()
        yield _pin(f"{title}_SWITCH", SWITCHES[channel])
        yield f"#define {title}_ADC_CHANNEL {monitor.adc_channel}u"
        yield f"#define {title}_COMPARATOR ACMP{monitor.comparator}"
        yield f"#define {title}_COMPARATOR_CHANNEL {monitor.comparator_channel}u"
        yield f"#define {title}_MA_PER_VOLT {1000 / monitor.volts_per_a!r}f"
    yield f"#define SUPPLY_VOLTS {SUPPLY_VOLTS!r}f"
    yield f"#define EXTERNAL_RAM 0x{EXTERNAL_RAM:08X}u"


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
