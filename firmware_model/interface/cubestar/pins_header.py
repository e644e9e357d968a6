"""The processor's pins as a C header, for firmware of the board."""

from cubestack.firmware_model.interface.cubestar import processor_pins
from cubestack.firmware_model.interface.cubestar.processor_pins import Unit, port_pin


def pins_header() -> str:
    """Pins as ``struct pin``, units of the part with their locations, and constants."""
    lines = [
        "/* Pins of CubeStar's EFM32GG280; made of the board's table, not to be edited. */",
        "#ifndef PINS_H",
        "#define PINS_H",
        "",
        "#include <stdint.h>",
        "",
        "struct pin {",
        "    uint8_t port, bit;",
        "};",
        "",
    ]
    lines += [f"#define FPGA_{name} {_pin(pin)}" for name, pin in processor_pins.FPGA.items()]
    lines += [f"#define CAMERA_RESET {_pin(processor_pins.CAMERA_RESET)}"]
    lines += [f"#define LED_{n} {_pin(pin)}" for n, pin in enumerate(processor_pins.LEDS)]
    lines += _unit("SATELLITE_UART", processor_pins.SATELLITE_UART, "_RX", "_TX")
    lines += _unit("SATELLITE_I2C", processor_pins.SATELLITE_I2C, "")
    lines += _unit("CAMERA_I2C", processor_pins.CAMERA_I2C, "")
    for channel, monitor in processor_pins.MONITORS.items():
        upper = channel.upper()
        lines += [
            "",
            f"#define {upper}_SWITCH {_pin(processor_pins.SWITCHES[channel])}",
            f"#define {upper}_ADC_CHANNEL {monitor.adc_channel}u",
            f"#define {upper}_COMPARATOR ACMP{monitor.comparator}",
            f"#define {upper}_COMPARATOR_CHANNEL {monitor.comparator_channel}u",
            f"#define {upper}_MA_PER_VOLT {1000 / monitor.volts_per_a!r}f",
        ]
    lines += ["", f"#define SUPPLY_VOLTS {processor_pins.SUPPLY_VOLTS!r}f"]
    lines += [f"#define EXTERNAL_RAM_ADDRESS 0x{processor_pins.EXTERNAL_RAM:08X}u"]
    return "\n".join([*lines, "", "#endif", ""])


def _pin(name: str) -> str:
    port, bit = port_pin(name)
    return f"((struct pin){{{port}, {bit}}})"


def _unit(title: str, unit: Unit, *interrupts: str) -> list[str]:
    pins = {signal: divmod(unit.pin(signal), 16) for signal in unit.signals}
    return [
        "",
        f"#define {title} {unit.name}",
        f"#define {title}_LOCATION {unit.location}u",
        *(
            f"#define {title}_{signal}_PIN ((struct pin){{{port}, {bit}}})"
            for signal, (port, bit) in pins.items()
        ),
        *(f"#define {title}{way}_IRQ {unit.name}{way}_IRQ" for way in interrupts),
        *(f"#define {title}{way}_handler {unit.name}{way}_handler" for way in interrupts),
    ]
