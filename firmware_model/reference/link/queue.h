/* SPDX-License-Identifier: BSD-2-Clause */
/* Waiting telecommands: interrupts add them, the main loop removes them.
 *
 * As firmware_model/node/queue.py. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

struct queued_command {
    const struct telecommand *command;
    uint8_t parameters[LONGEST_TELECOMMAND];
};

/* Whether a telecommand waits; the oldest one; its removal. */
bool queue_waiting(void);
const struct queued_command *queue_first(void);
void queue_taken(void);

/* Adds a telecommand with its parameters; false if there is no room. */
bool queue_put(const struct telecommand *command, const uint8_t *parameters);
