/* SPDX-License-Identifier: BSD-2-Clause */
/* Supply hardware: load switches, current monitors, comparators; the on-chip temperature.
 *
 * CubeStar thesis, section 5.2.3. */
#pragma once

#include <stdbool.h>

/* The processor's SRAM; the boards of FPGA and image sensor. */
enum channel { CHANNEL_MEMORY, CHANNEL_IMAGER, CHANNELS };

/* Closes all switches except the `open` channels, one bit each. */
void supply_start(unsigned open);

void supply_switch(enum channel channel, bool closed);
float supply_current_ma(enum channel channel);
float temperature_c(void);

/* Implemented by the program, called by an interrupt: the comparator of a channel tripped. */
void supply_overcurrent(enum channel channel);
