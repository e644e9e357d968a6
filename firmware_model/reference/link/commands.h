/* SPDX-License-Identifier: BSD-2-Clause */
/* Effects of the telecommands, which the main loop executes one after the other. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "link/queue.h"

extern volatile bool command_running; /* including a requested reset */
extern uint8_t memory_test;           /* result of the last TestSRAM */
extern uint16_t next_block, blocks_received;
extern bool second_half; /* the next ImageBlock of 256 bytes is the second half */

/* Returns true if the program must reset. */
bool command_execute(const struct queued_command *queued);
