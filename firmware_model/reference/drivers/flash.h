/* Flash pages of the program, each with a check word.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef FLASH_H
#define FLASH_H

#include <stdbool.h>
#include <stdint.h>

/* Pages from the end of the flash. */
enum flash_page { PAGE_CONFIG, PAGE_ATTITUDE, PAGE_MODE };

/* Reads whole words; false when the page has none that were stored whole. */
bool flash_load(enum flash_page page, void *words, unsigned size);

/* Erases and programs the page; interrupts are served meanwhile. */
void flash_store(enum flash_page page, const void *words, unsigned size);

void flash_erase(enum flash_page page);

#endif
