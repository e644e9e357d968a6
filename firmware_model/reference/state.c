/* SPDX-License-Identifier: BSD-2-Clause */
/* The node's memory. */
#include "state.h"

#include "core.h"
#include "drivers/memories.h"

#define MAGIC 0x52545343u /* "CSTR" */

struct retained retained;
volatile uint8_t task_status = CUBESTAR_TASK_STATUS_POWERING_UP;
uint8_t reset_cause = CUBESTAR_RESET_CAUSE_UNDETERMINED;
uint32_t startup_us;
struct attitude attitude;

_Static_assert(sizeof(struct retained) <= RETENTION_BYTES, "the retention registers are full");

static uint8_t mode_flag;

void state_restore(void)
{
    retention_read(&retained, sizeof retained);
    if (retained.magic != MAGIC) {
        memset(&retained, 0, sizeof retained);
        load_config();
        retained.magic = MAGIC;
    }
    uint32_t word;
    mode_flag = CUBESTAR_MATCH_MODE_LOST_IN_SPACE;
    if (flash_load(PAGE_MODE, &word, sizeof word) && word < CUBESTAR_MATCH_MODE_LOST_IN_SPACE)
        mode_flag = (uint8_t)word;
    if (!flash_load(PAGE_ATTITUDE, &attitude, sizeof attitude))
        attitude.present = 0;
}

void state_retain(void)
{
    uint32_t masked = interrupts_off();
    retention_write(&retained, sizeof retained);
    interrupts_restore(masked);
}

void state_forget(void)
{
    struct retained fresh = {
        .magic = MAGIC,
        .cut = retained.cut,
        .reset_us = retained.reset_us,
        .clock_us = retained.clock_us,
        .clock_ticks = retained.clock_ticks,
        .clock_runs = retained.clock_runs,
    };
    uint32_t masked = interrupts_off();
    retained = fresh;
    load_config();
    interrupts_restore(masked);
}

/* Interrupts raise flags too. */
void raise_flag(uint8_t flag)
{
    if (flag == NO_FLAG)
        return;
    uint32_t masked = interrupts_off();
    retained.flags[flag / 8] |= (uint8_t)(1u << flag % 8);
    interrupts_restore(masked);
}

bool flag_raised(uint8_t flag)
{
    return retained.flags[flag / 8] >> flag % 8 & 1;
}

void clear_flags(void)
{
    uint32_t masked = interrupts_off();
    memset(retained.flags, 0, sizeof retained.flags);
    interrupts_restore(masked);
}

uint8_t mode(void)
{
    return mode_flag;
}

void set_mode(uint8_t mode)
{
    if (mode == mode_flag)
        return;
    mode_flag = mode;
    uint32_t word = mode;
    flash_store(PAGE_MODE, &word, sizeof word);
}

void set_attitude(const struct attitude *latest)
{
    uint32_t masked = interrupts_off();
    attitude = *latest;
    interrupts_restore(masked);
    flash_store(PAGE_ATTITUDE, latest, sizeof *latest);
}

void load_config(void)
{
    if (!flash_load(PAGE_CONFIG, retained.setting_words, sizeof retained.setting_words))
        memcpy(retained.settings, settings_reset, SETTINGS_BYTES);
}

void save_config(void)
{
    flash_store(PAGE_CONFIG, retained.setting_words, sizeof retained.setting_words);
}

void erase_config(void)
{
    flash_erase(PAGE_CONFIG, sizeof retained.setting_words);
    memcpy(retained.settings, settings_reset, SETTINGS_BYTES);
}
