/* Clocks of the part, the free-running timer, and sleep.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_HZ 48000000u
#define FOR_EVER UINT64_MAX

/* 48 MHz from the crystal, and clocks of all peripherals in use. */
void clock_start(void);

/* Starts the free-running timer; the retention registers must be restored. */
void timer_start(void);

/* Microseconds since power-up; resets do not stop it. */
uint64_t time_us(void);

/* Remembers the time for the program after a reset. */
void timer_retain(void);

/* Sleeps until `due_us`, or, if `wakeable`, until `wake` is called; a call that came before is not
 * lost. True: it was woken. The watchdog is fed. */
bool sleep_until(uint64_t due_us, bool wakeable);
void wake(void);

/* Sleeps for a time, whatever happens meanwhile. */
void pause_us(uint32_t us);

/* Stays awake for about so long. */
void spin_us(uint32_t us);

/* From `started_us` until now, in us. */
uint32_t since(uint64_t started_us);

#endif
