/* SPDX-License-Identifier: BSD-2-Clause */
/* Resets and their causes: bits stay in RSTCAUSE until the program clears them.
 *
 * A rise of the supply hides all other causes; two pairs of causes have separate numbers, as in
 * firmware_model/cubestar/reset_cause.py. */
#include "reset.h"

#include "core.h"
#include "cubestar.h"
#include "efm32gg.h"

#define CAUSES                                                                                     \
    (RMU_RSTCAUSE_PORST | RMU_RSTCAUSE_BODUNREGRST | RMU_RSTCAUSE_BODREGRST |                       \
     RMU_RSTCAUSE_EXTRST | RMU_RSTCAUSE_WDOGRST | RMU_RSTCAUSE_LOCKUPRST | RMU_RSTCAUSE_SYSREQRST)

static const struct {
    uint32_t mask, bits;
    uint8_t cause;
} meanings[] = {
    {RMU_RSTCAUSE_PORST, RMU_RSTCAUSE_PORST, CUBESTAR_RESET_CAUSE_POWER_ON},
    {RMU_RSTCAUSE_BODUNREGRST, RMU_RSTCAUSE_BODUNREGRST,
     CUBESTAR_RESET_CAUSE_BROWN_OUT_UNREGULATED},
    {RMU_RSTCAUSE_BODREGRST, RMU_RSTCAUSE_BODREGRST, CUBESTAR_RESET_CAUSE_BROWN_OUT_REGULATED},
    {CAUSES, RMU_RSTCAUSE_EXTRST | RMU_RSTCAUSE_WDOGRST, CUBESTAR_RESET_CAUSE_EXTERNAL_OR_WATCHDOG},
    {CAUSES, RMU_RSTCAUSE_EXTRST, CUBESTAR_RESET_CAUSE_EXTERNAL_PIN},
    {CAUSES, RMU_RSTCAUSE_WDOGRST, CUBESTAR_RESET_CAUSE_WATCHDOG},
    {CAUSES, RMU_RSTCAUSE_LOCKUPRST | RMU_RSTCAUSE_SYSREQRST,
     CUBESTAR_RESET_CAUSE_LOCKUP_OR_SYSTEM_REQUEST},
    {CAUSES, RMU_RSTCAUSE_LOCKUPRST, CUBESTAR_RESET_CAUSE_LOCKUP},
    {CAUSES, RMU_RSTCAUSE_SYSREQRST, CUBESTAR_RESET_CAUSE_SYSTEM_REQUEST},
};

uint8_t reset_cause_taken(void)
{
    uint32_t bits = RMU->RSTCAUSE;
    RMU->CMD = RMU_CMD_RCCLR;
    EMU->AUXCTRL |= EMU_AUXCTRL_HRCCLR; /* some bits need this too */
    EMU->AUXCTRL &= ~EMU_AUXCTRL_HRCCLR;
    for (unsigned i = 0; i < sizeof meanings / sizeof *meanings; i++)
        if ((bits & meanings[i].mask) == meanings[i].bits)
            return meanings[i].cause;
    return CUBESTAR_RESET_CAUSE_UNDETERMINED;
}

void reset_processor(void)
{
    barrier();
    SCB_AIRCR = SCB_AIRCR_RESET;
    for (;;)
        ;
}
