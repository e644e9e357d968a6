/* SPDX-License-Identifier: BSD-2-Clause */
/* Supply monitoring: on a latch-up a comparator's interrupt opens the load switch at once.
 *
 * CubeStar thesis, section 5.2.3. The main loop powers the channel up again later. */
#pragma once

#include <stdbool.h>

#include "drivers/supply.h"

bool supply_cut(void);
bool supply_imager_on(void);

/* Measures both channels and records the imager's extremes; returns its current in mA. */
float supply_sample(void);

/* Toggles the switch of FPGA and imager; returns whether it is closed now. */
bool supply_toggle_imager(void);

/* Closes the cut switches after a pause; true if the imager came back. */
bool supply_restore(void);
