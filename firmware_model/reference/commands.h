/* What each telecommand does, executed by the main loop one after the other.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef COMMANDS_H
#define COMMANDS_H

#include <stdbool.h>
#include <stdint.h>

#include "queue.h"

extern volatile bool command_running; /* the reset that it asked for included */
extern uint8_t memory_test;           /* result of the last TestSRAM */
extern uint16_t next_block, blocks_received;
extern bool second_half; /* the next ImageBlock of 256 bytes is the second half */

/* True: the program has to end in a reset. */
bool command_execute(const struct queued_command *queued);

#endif
