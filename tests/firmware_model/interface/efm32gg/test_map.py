"""Where the part has its registers and interrupts: beside the reference manual's memory map and
vector table, and the device header of the simulator's test programs, which is of the manual too."""

import re
from pathlib import Path

from cubestack.firmware_model.interface.efm32gg import LAYOUTS, register_at
from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.interface.efm32gg.table import Instance, peripheral
from tests.together import together

#: EFM32GG Reference Manual, figure 5.2 (memory map); the device information is in table 5.4.
BASES = {
    "VCMP": 0x40000000, "ACMP0": 0x40001000, "ACMP1": 0x40001400, "ADC0": 0x40002000,
    "DAC0": 0x40004000, "GPIO": 0x40006000, "EBI": 0x40008000, "I2C0": 0x4000A000,
    "I2C1": 0x4000A400, "USART0": 0x4000C000, "USART1": 0x4000C400, "USART2": 0x4000C800,
    "UART0": 0x4000E000, "UART1": 0x4000E400, "TIMER0": 0x40010000, "TIMER1": 0x40010400,
    "TIMER2": 0x40010800, "TIMER3": 0x40010C00, "RTC": 0x40080000, "BURTC": 0x40081000,
    "LETIMER0": 0x40082000, "LEUART0": 0x40084000, "LEUART1": 0x40084400, "PCNT0": 0x40086000,
    "PCNT1": 0x40086400, "PCNT2": 0x40086800, "WDOG": 0x40088000, "LCD": 0x4008A000,
    "LESENSE": 0x4008C000, "MSC": 0x400C0000, "DMA": 0x400C2000, "USB": 0x400C4000,
    "EMU": 0x400C6000, "CMU": 0x400C8000, "RMU": 0x400CA000, "PRS": 0x400CC000,
    "AES": 0x400E0000, "DEVINFO": 0x0FE081B0,
}  # fmt: skip

#: The same, table 4.1 (interrupt request lines): by number.
LINES = [
    "DMA", "GPIO_EVEN", "TIMER0", "USART0_RX", "USART0_TX", "USB", "ACMP0", "ADC0", "DAC0", "I2C0",
    "I2C1", "GPIO_ODD", "TIMER1", "TIMER2", "TIMER3", "USART1_RX", "USART1_TX", "LESENSE",
    "USART2_RX", "USART2_TX", "UART0_RX", "UART0_TX", "UART1_RX", "UART1_TX", "LEUART0", "LEUART1",
    "LETIMER0", "PCNT0", "PCNT1", "PCNT2", "RTC", "BURTC", "CMU", "VCMP", "LCD", "MSC", "AES",
    "EBI", "EMU",
]  # fmt: skip

HEADER = Path(__file__).parents[3] / "emulator/iss/programs/device.h"
TEXT = HEADER.read_text("utf-8")
LAYOUT_OF = {instance.name: layout for layout in LAYOUTS for instance in layout.instances}


def test_peripherals_have_the_documented_addresses() -> None:
    found = {one.name: one.base for layout in LAYOUTS for one in layout.instances}
    assert found == {name: base for name, base in BASES.items() if name in found}
    for instance in (one for layout in LAYOUTS for one in layout.instances):
        first = LAYOUT_OF[instance.name].registers[0]
        assert register_at(instance.base + first.offset + 3) == (instance, first)
    assert register_at(0x4000_5000) is None


def test_peripheral_interrupts_have_the_documented_numbers() -> None:
    for layout in LAYOUTS:
        for instance in layout.instances:
            for line, number in instance.interrupts.items():
                assert LINES[number] == line


def structs() -> dict[str, list[tuple[str, int]]]:
    found: dict[str, list[tuple[str, int]]] = {}
    sizes = {"uint32_t": 4}
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", TEXT, re.DOTALL):
        found[name], offset = [], 0
        for kind, declared in re.findall(r"(uint32_t|\w+_TypeDef) ([^;]+);", body):
            for member in declared.split(","):
                one, _, count = member.strip().rstrip("]").partition("[")
                if kind == "uint32_t" and not count:
                    found[name].append((one, offset))
                offset += sizes.get(kind, 0) * int(count or "1")
        sizes[name] = offset
    return found


@together(("kind", "address"), re.findall(r"#define \w+ \(\((\w+) \*\)(0x4\w+)UL\)", TEXT))
def test_efm32gg_registers_match_the_addresses_of_the_vendor_header(
    kind: str, address: str
) -> None:
    base = int(address, 16)
    compared = 0
    for member, offset in structs()[kind]:
        found = register_at(base + offset)
        if found is not None:
            assert found[1].name == member, hex(base + offset)
            compared += 1
    assert compared >= 2


REGISTERS = """
    004 CTRL   rw 00000000  EN:0 MODE:4:3
    010 STATUS r  00000000  *
"""

EXPECTED = """\
/* Lamp (chapter 9) */
typedef struct {
    uint32_t reserved_0[1];
    volatile uint32_t CTRL;
    uint32_t reserved_8[2];
    volatile const uint32_t STATUS;
} LAMP_Registers;
#define LAMP_CTRL_EN 0x00000001u
#define LAMP_CTRL_MODE 0x00000070u
#define LAMP_CTRL_MODE_SHIFT 4
#define LAMP0 ((LAMP_Registers *)0x40005000u)
#define LAMP1 ((LAMP_Registers *)0x40005400u)

/* Interrupt numbers */
#define LAMP1_OFF_IRQ 3
#define LAMP0_ON_IRQ 12
#define LAMP1_ON_IRQ 20

#endif
"""


def test_c_header_declares_struct_masks_addresses_and_interrupts() -> None:
    lamp = peripheral(
        "LAMP",
        "Lamp (chapter 9)",
        REGISTERS,
        Instance("LAMP0", 0x4000_5000, {"LAMP0_ON": 12}),
        Instance("LAMP1", 0x4000_5400, {"LAMP1_ON": 20, "LAMP1_OFF": 3}),
    )
    _, _, declared = c_header([lamp]).partition("#include <stdint.h>\n\n")
    assert declared == EXPECTED
