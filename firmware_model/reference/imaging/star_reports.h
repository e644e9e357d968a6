/* SPDX-License-Identifier: BSD-2-Clause */
/* Telemetry of single stars. */
#pragma once

#include <stdint.h>

/* Fills a message that is all zero; ignores one that is not about single stars. */
void star_report_fill(uint8_t id, uint8_t *data);
