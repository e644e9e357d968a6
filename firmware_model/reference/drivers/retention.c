/* SPDX-License-Identifier: BSD-2-Clause */
/* Retention registers of BURTC; they take whole words only. */
#include "memories.h"

#include <stdint.h>

#include "efm32gg.h"

#define REGISTERS ((volatile uint32_t *)&BURTC->RET0_REG)

/* A system reset does not change the backup domain; power-on holds it in reset until this. */
static void release(void)
{
    if (RMU->CTRL & RMU_CTRL_BURSTEN)
        RMU->CTRL &= ~RMU_CTRL_BURSTEN;
}

void retention_read(void *words, unsigned size)
{
    release();
    for (unsigned i = 0; i < size / 4; i++)
        ((uint32_t *)words)[i] = REGISTERS[i];
}

void retention_write(const void *words, unsigned size)
{
    for (unsigned i = 0; i < size / 4; i++) {
        uint32_t word = ((const uint32_t *)words)[i];
        if (REGISTERS[i] != word)
            REGISTERS[i] = word;
    }
}
