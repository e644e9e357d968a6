/* The satellite's side of the node: frames over UART and messages over I2C, in interrupt context.
 *
 * As firmware_model/node/link.py: a telecommand is checked, acknowledged and queued for the main
 * loop; telemetry is answered at once.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef LINK_H
#define LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

struct queued_command {
    const struct telecommand *command;
    uint8_t parameters[LONGEST_TELECOMMAND];
};

/* Whether a telecommand waits; the oldest one, which stays in its place until it is taken. */
bool link_waiting(void);
const struct queued_command *link_first(void);
void link_taken(void);

/* Whether nothing is under way that a reset would cut short: a message or an answer. */
bool link_idle(void);

#endif
