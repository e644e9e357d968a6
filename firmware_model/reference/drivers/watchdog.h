/* Watchdog, EFM32GG Reference Manual, chapter 12.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef WATCHDOG_H
#define WATCHDOG_H

/* Resets the processor when it is not fed for two seconds. */
void watchdog_start(void);
void watchdog_feed(void);

#endif
