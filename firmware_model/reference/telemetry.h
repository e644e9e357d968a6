/* Values of every telemetry frame, taken when it is asked for.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include "cubestar_tables.h"

/* Fills a message that is all zero; interrupt context, so nothing here waits. */
void telemetry_fill(const struct telemetry *message, uint8_t *data);

#endif
