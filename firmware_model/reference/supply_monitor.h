/* Supply monitoring: a comparator's interrupt cuts the load switch at once (latch-up).
 *
 * CubeStar thesis, section 5.2.3. The main loop powers the channel up again later.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef SUPPLY_MONITOR_H
#define SUPPLY_MONITOR_H

#include <stdbool.h>

#include "drivers/supply.h"

bool supply_cut(void);
bool supply_imager_on(void);

/* Measures both channels and keeps the imager's extremes; its current in mA. */
float supply_sample(void);

/* Opens or closes the switch of FPGA and imager; whether it is closed now. */
bool supply_toggle_imager(void);

/* Closes what was cut, after a pause; true when the imager came back. */
bool supply_restore(void);

#endif
