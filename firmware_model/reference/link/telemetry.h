/* SPDX-License-Identifier: BSD-2-Clause */
/* Values of every telemetry frame, computed at the request. */
#pragma once

#include "cubestar_tables.h"

/* Fills a message that is all zero; interrupt context, so nothing here waits. */
void telemetry_fill(const struct telemetry *message, uint8_t *data);
