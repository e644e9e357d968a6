/* Resets and their causes. EFM32GG Reference Manual, chapter 9.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef RESET_H
#define RESET_H

#include <stdint.h>

/* Why the processor started, as telemetry has it; the part's register is cleared. */
uint8_t reset_cause_taken(void);

_Noreturn void reset_processor(void);

#endif
