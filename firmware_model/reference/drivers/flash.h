/* SPDX-License-Identifier: BSD-2-Clause */
/* Flash pages of the program, each with a check word. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

/* Pages from the end of the flash. */
enum flash_page { PAGE_CONFIG, PAGE_ATTITUDE, PAGE_MODE };

/* Reads whole words; false if the check word of the page is wrong. */
bool flash_load(enum flash_page page, void *words, unsigned size);

/* Erases and programs the page; interrupts are served meanwhile. */
void flash_store(enum flash_page page, const void *words, unsigned size);

void flash_erase(enum flash_page page);
