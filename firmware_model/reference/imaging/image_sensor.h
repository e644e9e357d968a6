/* SPDX-License-Identifier: BSD-2-Clause */
/* The program's use of the image sensor: set-up for stars, enable, single registers.
 *
 * CubeStar thesis, appendix D. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

/* Address and value of the register read last; invalid without an answer. */
extern uint16_t selected_address;
extern uint8_t selected_value;
extern bool selected_valid;

/* Waits after power-up; the registers are at their reset values. */
void sensor_power_up(void);

/* After a failure: set the sensor up again before the next image. */
void sensor_forget_set_up(void);

/* Sets the sensor up if needed; returns the flag of an unanswered write, or NO_FLAG. */
uint8_t sensor_configure(void);

/* The same, and raises the flag; false if there was no answer. */
bool sensor_apply_settings(void);

/* Enables or disables image capture; false if the sensor does not answer. */
bool sensor_enable(bool on);

/* Access to any register byte. */
void sensor_write_byte(uint16_t address, uint8_t value);
void sensor_select_register(uint16_t address);

/* Time from the mid-exposure of the middle row to the end of a frame's read-out. */
uint32_t sensor_age_at_frame_end_us(void);
