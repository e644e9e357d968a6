/* Values of every telemetry frame, taken when it is asked for.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef TELEMETRY_H
#define TELEMETRY_H

#include "cubestar_tables.h"

/* Fills a message that is all zero; interrupt context, so nothing here waits. */
void telemetry_fill(const struct telemetry *message, uint8_t *data);

/* The part of it about single stars, in star_reports.c; does nothing for other messages. */
void star_report_fill(uint8_t id, uint8_t *data);

#define PUT(message, name, value) put(data, F_##message##_##name, value)

#endif
