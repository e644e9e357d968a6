/* The SRAM on the external bus: the picture, and the search's list behind it.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef EXTERNAL_RAM_H
#define EXTERNAL_RAM_H

#include <stdint.h>

#include "pins.h"

#define EXTERNAL_MEMORY ((uint8_t *)EXTERNAL_RAM)
#define EXTERNAL_RAM_BYTES 0x100000u

void external_ram_start(void);

#endif
