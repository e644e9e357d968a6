/* Supply hardware: load switches, current monitors, comparators; the on-chip temperature.
 *
 * CubeStar thesis, section 5.2.3.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef SUPPLY_H
#define SUPPLY_H

#include <stdbool.h>

/* The processor's SRAM; the boards of FPGA and image sensor. */
enum channel { CHANNEL_MEMORY, CHANNEL_IMAGER, CHANNELS };

/* Switches are closed but for the `open` channels, a bit for each. */
void supply_start(unsigned open);

void supply_switch(enum channel channel, bool closed);
float supply_current_ma(enum channel channel);
float temperature_c(void);

/* Given by the program, called by an interrupt: the comparator of a channel tripped. */
void supply_overcurrent(enum channel channel);

#endif
