/* SPDX-License-Identifier: BSD-2-Clause */
/* Times of the steps, by the core's cycle counter. */
#include "phases.h"

#include "core.h"
#include "drivers/clock.h"

uint32_t latest_us[STEPS], longest_us[STEPS];

static uint32_t cycles[PHASES];
static int running = PHASES; /* the innermost phase; PHASES: none */
static int outer[PHASES];
static uint32_t began;

static void change_to(int phase)
{
    uint32_t now = DWT_CYCCNT;
    if (running < PHASES)
        cycles[running] += now - began;
    running = phase;
    began = now;
}

void phase_begin(enum phase phase)
{
    outer[phase] = running;
    change_to(phase);
}

void phase_end(enum phase phase)
{
    change_to(outer[phase]);
}

void phases_clear(void)
{
    for (int i = 0; i < PHASES; i++)
        cycles[i] = 0;
}

void phases_record(void)
{
    for (int i = 0; i < PHASES; i++)
        if (cycles[i] && i != PHASE_PREDICTION)
            step_took((enum step)i, cycles[i] / (CLOCK_HZ / 1000000u));
}

void step_took(enum step step, uint32_t us)
{
    latest_us[step] = us;
    if (us > longest_us[step])
        longest_us[step] = us;
}
