/* What the node remembers: in RAM, in the retention registers, and in flash.
 *
 * CubeStar thesis, sections 5.3.4 to 5.3.6, appendix E. The RAM is lost in the software reset that
 * ends every iteration.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef STATE_H
#define STATE_H

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

/* Counters, times and settings that survive a software reset: words, as the retention registers
 * are. Times are those of the free-running timer, in us. */
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
    uint64_t clock_us; /* the time at which BURTC had counted `clock_ticks`; see drivers/clock.c */
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

/* The latest good attitude, as flash keeps it. */
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

/* Parameter of a setting telecommand, by the names of the interface. */
#define SETTING(type, command, parameter)                                                          \
    cubestar_get_##type(retained.settings,                                                         \
                        SETTING_##command + CUBESTAR_TC_##command##_##parameter##_OFFSET)

/* After a reset: RAM is as the retention registers have it, else as the flash has it. */
void state_restore(void);

/* Brings the retention registers up to date; main program and interrupts call it. */
void state_retain(void);

/* The values after power-up; supplies that were cut are still to be restored. */
void state_forget(void);

void raise_flag(uint8_t flag);
bool flag_raised(uint8_t flag);
void clear_flags(void);

/* The mode flag, in flash; lost in space when it was never written. */
uint8_t mode(void);
void set_mode(uint8_t mode);

/* Stores an attitude in flash as well. */
void set_attitude(const struct attitude *latest);

void load_config(void);
void save_config(void);
void erase_config(void);

#endif
