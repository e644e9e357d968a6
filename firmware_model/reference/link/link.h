/* SPDX-License-Identifier: BSD-2-Clause */
/* The node's link to the satellite: frames over UART, messages over I2C, in interrupt context.
 *
 * As firmware_model/node/link.py: a telecommand is checked, acknowledged and queued for the main
 * loop; telemetry is answered at once. */
#pragma once

#include <stdbool.h>

/* True if a reset would interrupt neither a message nor an answer. */
bool link_idle(void);
