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

/* Whether nothing is under way that a reset would cut short: a message or an answer. */
bool link_idle(void);

#endif
