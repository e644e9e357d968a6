/* SPDX-License-Identifier: BSD-2-Clause */
/* The SRAM on the external bus. EFM32GG Reference Manual, chapter 14.
 *
 * Eight data lines and 24 address lines, latched in two steps, for an SRAM of 55 ns. */
#include "memories.h"

#include "efm32gg.h"
#include "gpio.h"

#define MODE_D8_A24_ALE 2u
#define ALE_HIGH_ACTIVE EBI_POLARITY_ALEPOL

/* Alternate functions of the EBI at location 0: address and data lines, ALE, WEn, REn, CS0. */
#define PIN(port, bit) (16 * ((port) - 'A') + (bit))
static const uint8_t lines[] = {
    PIN('E', 8),  PIN('E', 9),  PIN('E', 10), PIN('E', 11), PIN('E', 12),
    PIN('E', 13), PIN('E', 14), PIN('E', 15), PIN('A', 15), PIN('A', 0),
    PIN('A', 1),  PIN('A', 2),  PIN('A', 3),  PIN('A', 4),  PIN('A', 5),
    PIN('A', 6),  PIN('F', 3),  PIN('F', 4),  PIN('F', 5),  PIN('D', 9),
};

void external_ram_start(void)
{
    for (unsigned i = 0; i < sizeof lines / sizeof *lines; i++)
        pin_set_up(lines[i], PIN_OUTPUT, 1);
    EBI->ADDRTIMING = 1u << EBI_ADDRTIMING_ADDRSETUP_SHIFT;
    EBI->RDTIMING = 1u << EBI_RDTIMING_RDSETUP_SHIFT | 3u << EBI_RDTIMING_RDSTRB_SHIFT;
    EBI->WRTIMING = 1u << EBI_WRTIMING_WRSETUP_SHIFT | 3u << EBI_WRTIMING_WRSTRB_SHIFT;
    EBI->POLARITY = ALE_HIGH_ACTIVE;
    EBI->ROUTE = EBI_ROUTE_EBIPEN | EBI_ROUTE_CS0PEN | EBI_ROUTE_ALEPEN;
    EBI->CTRL = MODE_D8_A24_ALE << EBI_CTRL_MODE_SHIFT | EBI_CTRL_BANK0EN;
}
