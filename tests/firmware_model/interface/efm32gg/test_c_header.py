"""The C header of the registers: all of it, for a peripheral that is small enough to be read."""

from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.interface.efm32gg.table import Instance, peripheral

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


def test_a_peripheral_has_its_structure_its_masks_its_places_and_its_interrupts() -> None:
    lamp = peripheral(
        "LAMP",
        "Lamp (chapter 9)",
        REGISTERS,
        Instance("LAMP0", 0x4000_5000, {"LAMP0_ON": 12}),
        Instance("LAMP1", 0x4000_5400, {"LAMP1_ON": 20, "LAMP1_OFF": 3}),
    )
    _, _, declared = c_header([lamp]).partition("#include <stdint.h>\n\n")
    assert declared == EXPECTED
