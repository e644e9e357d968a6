/* Telemetry of single stars.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef STAR_REPORTS_H
#define STAR_REPORTS_H

#include <stdint.h>

/* Fills a message that is all zero; does nothing for one that is not about single stars. */
void star_report_fill(uint8_t id, uint8_t *data);

#endif
