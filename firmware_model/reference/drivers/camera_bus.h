/* SPDX-License-Identifier: BSD-2-Clause */
/* The camera's control bus: the processor is the I2C master. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

void camera_bus_start(void);

/* Writes bytes to the image sensor; false if it did not acknowledge. */
bool camera_bus_write(const uint8_t *data, int count);

/* Writes, then reads a byte. */
bool camera_bus_read(const uint8_t *data, int count, uint8_t *byte);
