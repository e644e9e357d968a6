/* SPDX-License-Identifier: BSD-2-Clause */
/* Retention registers in the backup power domain: kept over resets, not over power-off.
 *
 * EFM32GG Reference Manual, chapter on the backup RTC. */
#pragma once

#define RETENTION_BYTES 512

/* Whole words, from the first register on. */
void retention_read(void *words, unsigned size);
void retention_write(const void *words, unsigned size);
