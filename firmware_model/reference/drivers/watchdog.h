/* SPDX-License-Identifier: BSD-2-Clause */
/* Watchdog, EFM32GG Reference Manual, chapter 12. */
#pragma once

/* Resets the processor if it is not fed for two seconds. */
void watchdog_start(void);
void watchdog_feed(void);
