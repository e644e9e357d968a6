/* SPDX-License-Identifier: BSD-2-Clause */
/* Memories beside the internal RAM: the SRAM on the external bus, flash pages, retention. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "pins.h"

/* The SRAM on the external bus: the image, followed by the search's list. */
#define EXTERNAL_MEMORY ((uint8_t *)EXTERNAL_RAM)
#define EXTERNAL_RAM_BYTES 0x100000u

void external_ram_start(void);

/* Flash pages of the program, each in three banks with a check word, from the end of the flash. What a
 * page had survives a cut of the power while it is stored anew. */
enum flash_page { PAGE_CONFIG, PAGE_ATTITUDE, PAGE_MODE };

/* Reads whole words; false if the page has none. */
bool flash_load(enum flash_page page, void *words, unsigned size);

/* Erases and programs another bank; interrupts are served meanwhile. */
void flash_store(enum flash_page page, const void *words, unsigned size);

/* `size`: as stored. */
void flash_erase(enum flash_page page, unsigned size);

/* Retention registers in the backup power domain: kept over resets, not over power-off.
 *
 * EFM32GG Reference Manual, chapter on the backup RTC. */
#define RETENTION_BYTES 512

/* Whole words, from the first register on. */
void retention_read(void *words, unsigned size);
void retention_write(const void *words, unsigned size);
