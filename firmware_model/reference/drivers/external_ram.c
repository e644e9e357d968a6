/* The SRAM on the external bus. EFM32GG Reference Manual, chapter 14.
 *
 * Eight data lines and 24 address lines, latched in two steps; a load or store takes eight clocks on
 * the bus (an SRAM of 55 ns).
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#include "external_ram.h"

#include "efm32gg.h"
#include "gpio.h"

#define MODE_D8_A24_ALE 1u
#define ALE_HIGH_ACTIVE EBI_POLARITY_ALEPOL

/* Alternate functions of the EBI at location 0: address and data lines, ALE, WEn, REn, CS0. */
static const struct pin lines[] = {
    {4, 8},  {4, 9},  {4, 10}, {4, 11}, {4, 12}, {4, 13}, {4, 14}, {4, 15}, {0, 15}, {0, 0},
    {0, 1},  {0, 2},  {0, 3},  {0, 4},  {0, 5},  {0, 6},  {5, 3},  {5, 4},  {5, 5},  {3, 9},
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
