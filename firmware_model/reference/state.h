/* SPDX-License-Identifier: BSD-2-Clause */
/* The node's memory: RAM, retention registers and flash.
 *
 * CubeStar thesis, sections 5.3.4 to 5.3.6, appendix E. The RAM is lost in the software reset that
 * ends every iteration. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

/* Counters, times and settings that survive a software reset: words, like the retention registers.
 * Times are those of the free-running timer, in us. */
struct retained {
    uint32_t magic;
    uint32_t telecommands, telemetry, watchdog_resets;
    uint32_t looping, delaying, iterations;
    uint32_t loop_us, longest_loop_us;
    uint32_t frame, image_ms, image_present, solved, hint_present;
    uint32_t cut, imager_off, latch_ups, power_cycles; /* cut: a bit for each channel */
    uint32_t lowest_ua, highest_ua;
    uint32_t camera_setup, camera_setup_us, exposure_setup_us;
    uint32_t idling_us, idle_us, discard_us, capture_us, transfer_us;
    uint32_t detect_us, match_us, attitude_us;
    uint64_t reset_us, loop_due_us;
    uint64_t clock_us; /* time at which BURTC was at `clock_ticks`; see drivers/clock.c */
    uint32_t clock_ticks, clock_runs;
    union {
        uint8_t settings[SETTINGS_BYTES];
        uint32_t setting_words[(SETTINGS_BYTES + 3) / 4];
    };
    union {
        uint8_t flags[FLAG_BYTES];
        uint32_t flag_words[(FLAG_BYTES + 3) / 4];
    };
};

/* The latest good attitude, as stored in flash. */
struct attitude {
    float rotation[3][3];
    float quaternion[4];
    uint32_t frame, image_ms;
    uint8_t matched, mode;
    uint16_t present;
};

extern struct retained retained;
extern volatile uint8_t task_status; /* value of telemetry TaskStatus */
extern uint8_t reset_cause;
extern uint32_t startup_us;
extern struct attitude attitude; /* `present` is 0 without one */

/* Parameter of a setting telecommand, by its names in the interface. */
#define SETTING(type, command, parameter)                                                          \
    cubestar_get_##type(retained.settings,                                                         \
                        SETTING_##command + CUBESTAR_TC_##command##_##parameter##_OFFSET)

/* After a reset: restores RAM from the retention registers, else from the flash. */
void state_restore(void);

/* Updates the retention registers; main program and interrupts call it. */
void state_retain(void);

/* Returns to the values after power-up; supplies that were cut must still be restored. */
void state_forget(void);

void raise_flag(uint8_t flag);
bool flag_raised(uint8_t flag);
void clear_flags(void);

/* The mode flag, in flash; lost in space if it was never written. */
uint8_t mode(void);
void set_mode(uint8_t mode);

/* Stores an attitude, in flash too. */
void set_attitude(const struct attitude *latest);

void load_config(void);
void save_config(void);
void erase_config(void);
