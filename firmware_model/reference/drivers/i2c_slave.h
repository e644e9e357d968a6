/* The satellite's I2C bus: this node is a slave, by interrupt.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef I2C_SLAVE_H
#define I2C_SLAVE_H

void i2c_slave_start(void);

#endif
