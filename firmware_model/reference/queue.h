/* Telecommands that wait: interrupts put them in, the main loop takes them out.
 *
 * As firmware_model/node/queue.py.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef QUEUE_H
#define QUEUE_H

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

struct queued_command {
    const struct telecommand *command;
    uint8_t parameters[LONGEST_TELECOMMAND];
};

/* Whether a telecommand waits; the oldest one, which stays in its place until it is taken. */
bool queue_waiting(void);
const struct queued_command *queue_first(void);
void queue_taken(void);

/* Puts in a telecommand with the parameters of its length; false: there is no room. */
bool queue_put(const struct telecommand *command, const uint8_t *parameters);

#endif
