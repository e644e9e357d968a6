/* SPDX-License-Identifier: BSD-2-Clause */
/* Clocks of the part, the free-running timer, and sleep. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_HZ 48000000u
#define FOR_EVER UINT64_MAX

/* 48 MHz from the crystal, and clocks of all peripherals in use. */
void clock_start(void);

/* Starts the free-running timer; the retention registers must be restored. */
void timer_start(void);

/* Microseconds since power-up, resets included. */
uint64_t time_us(void);

/* Stores the time for the program after a reset. */
void timer_retain(void);

/* Sleeps until `due_us`, or, if `wakeable`, until `wake` is called; an earlier call is not lost.
 * Returns true if woken. Feeds the watchdog. */
bool sleep_until(uint64_t due_us, bool wakeable);
void wake(void);

/* Sleeps for a time, even if woken. */
void pause_us(uint32_t us);

/* Busy-waits for approximately `us`. */
void spin_us(uint32_t us);

/* Time from `started_us` until now, in us. */
uint32_t since(uint64_t started_us);
