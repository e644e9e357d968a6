/* SPDX-License-Identifier: BSD-2-Clause */
/* Supply monitoring, as in firmware_model/cubestar/supply.py. */
#include "supply_monitor.h"

#include "core.h"
#include "drivers/clock.h"
#include "state.h"

#define OFF_TIME_US 100000u
#define UNDER_CURRENT_MA 0.5f

void supply_overcurrent(enum channel channel)
{
    supply_switch(channel, false);
    retained.cut |= 1u << channel;
    retained.latch_ups++;
    if (channel == CHANNEL_MEMORY)
        retained.image_present = 0;
    raise_flag(FLAG_OverCurrent);
    state_retain();
    wake();
}

bool supply_cut(void)
{
    return *(volatile uint32_t *)&retained.cut != 0;
}

static bool is_on(enum channel channel)
{
    bool off = channel == CHANNEL_IMAGER && retained.imager_off;
    return !off && !(retained.cut >> channel & 1);
}

bool supply_imager_on(void)
{
    return is_on(CHANNEL_IMAGER);
}

float supply_sample(void)
{
    uint32_t masked = interrupts_off(); /* interrupts measure too */
    float current_ma[CHANNELS];
    for (int channel = 0; channel < CHANNELS; channel++) {
        current_ma[channel] = supply_current_ma((enum channel)channel);
        if (is_on((enum channel)channel) && current_ma[channel] < UNDER_CURRENT_MA)
            raise_flag(FLAG_UnderCurrent);
    }
    uint32_t present_ua = (uint32_t)(1000.0f * current_ma[CHANNEL_IMAGER] + 0.5f);
    bool first = retained.highest_ua == 0;
    if (first || present_ua < retained.lowest_ua)
        retained.lowest_ua = present_ua;
    if (present_ua > retained.highest_ua)
        retained.highest_ua = present_ua;
    interrupts_restore(masked);
    return current_ma[CHANNEL_IMAGER];
}

bool supply_toggle_imager(void)
{
    uint32_t masked = interrupts_off();
    retained.imager_off ^= 1;
    retained.cut &= ~(1u << CHANNEL_IMAGER);
    supply_switch(CHANNEL_IMAGER, !retained.imager_off);
    interrupts_restore(masked);
    return !retained.imager_off;
}

bool supply_restore(void)
{
    uint32_t channels = retained.cut;
    pause_us(OFF_TIME_US);
    for (int channel = 0; channel < CHANNELS; channel++) {
        if (!(channels >> channel & 1))
            continue;
        uint32_t masked = interrupts_off();
        retained.cut &= ~(1u << channel);
        retained.power_cycles++;
        supply_switch((enum channel)channel, true);
        interrupts_restore(masked);
    }
    return channels >> CHANNEL_IMAGER & 1;
}
