/* SPDX-License-Identifier: BSD-2-Clause */
/* Resets and their causes. EFM32GG Reference Manual, chapter 9. */
#pragma once

#include <stdint.h>

/* Reset cause for telemetry; clears the part's register. */
uint8_t reset_cause_taken(void);

_Noreturn void reset_processor(void);
