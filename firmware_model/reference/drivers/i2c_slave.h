/* SPDX-License-Identifier: BSD-2-Clause */
/* The satellite's I2C bus: this node is a slave, by interrupt. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

void i2c_slave_start(void);

/* Implemented by the program, called by interrupts: a (repeated) start; a byte, returns whether to
 * acknowledge it; the next byte for the master; the end of the transfer. */
void i2c_slave_started(bool read);
bool i2c_slave_received(uint8_t byte);
uint8_t i2c_slave_wanted(void);
void i2c_slave_stopped(void);
