/* The image sensor as the program uses it: set-up for stars, enable, single registers.
 *
 * CubeStar thesis, appendix D.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef IMAGE_SENSOR_H
#define IMAGE_SENSOR_H

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

/* Address and value of the register that was read last; invalid without an answer. */
extern uint16_t selected_address;
extern uint8_t selected_value;
extern bool selected_valid;

/* Waits after power-up; the registers are at their reset values. */
void sensor_power_up(void);

/* Something failed: set it up again before the next picture. */
void sensor_forget_set_up(void);

/* Sets it up unless that is done; returns the flag of an unanswered write, or NO_FLAG. */
uint8_t sensor_configure(void);

/* The same, and raises the flag; false when there was no answer. */
bool sensor_apply_settings(void);

/* Lets it gather images, or rest; false when it does not answer. */
bool sensor_enable(bool on);

/* Any byte. */
void sensor_write_byte(uint16_t address, uint8_t value);
void sensor_select_register(uint16_t address);

/* From the mid-exposure of the middle row to the end of a frame's read-out. */
uint32_t sensor_age_at_frame_end_us(void);

#endif
