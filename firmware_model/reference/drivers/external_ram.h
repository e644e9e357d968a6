/* SPDX-License-Identifier: BSD-2-Clause */
/* The SRAM on the external bus: the image, followed by the search's list. */
#pragma once

#include <stdint.h>

#include "pins.h"

#define EXTERNAL_MEMORY ((uint8_t *)EXTERNAL_RAM)
#define EXTERNAL_RAM_BYTES 0x100000u

void external_ram_start(void);
