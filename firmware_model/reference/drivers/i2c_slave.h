/* The satellite's I2C bus: this node is a slave, by interrupt.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef I2C_SLAVE_H
#define I2C_SLAVE_H

#include <stdbool.h>
#include <stdint.h>

void i2c_slave_start(void);

/* Given by the program, called by interrupts: a (repeated) start; a byte, and whether it is
 * acknowledged; the next byte for the master; the end of the transfer. */
void i2c_slave_started(bool read);
bool i2c_slave_received(uint8_t byte);
uint8_t i2c_slave_wanted(void);
void i2c_slave_stopped(void);

#endif
