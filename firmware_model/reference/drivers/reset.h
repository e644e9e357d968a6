/* SPDX-License-Identifier: BSD-2-Clause */
/* Resets and their causes, and the watchdog. EFM32GG Reference Manual, chapters 9 and 12. */
#pragma once

#include <stdint.h>

/* Reset cause for telemetry; clears the part's register. */
uint8_t reset_cause_taken(void);

_Noreturn void reset_processor(void);

/* Resets the processor if it is not fed for two seconds. */
void watchdog_start(void);
void watchdog_feed(void);
