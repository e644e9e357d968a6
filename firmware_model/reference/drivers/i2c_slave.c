/* SPDX-License-Identifier: BSD-2-Clause */
/* The satellite's I2C bus. EFM32GG Reference Manual, chapter 16.
 *
 * The clock is held low from each address, byte and acknowledge until the handler has answered. */
#include "i2c_slave.h"

#include "core.h"
#include "cubestar.h"
#include "efm32gg.h"
#include "gpio.h"
#include "pins.h"

#define READ_BIT 1u
#define WHOLE_ADDRESS 0x7Fu

void i2c_slave_start(void)
{
    pin_set_up(SATELLITE_I2C_SDA_PIN, PIN_OPEN_DRAIN, 1);
    pin_set_up(SATELLITE_I2C_SCL_PIN, PIN_OPEN_DRAIN, 1);
    SATELLITE_I2C->ROUTE = I2C_ROUTE_SDAPEN | I2C_ROUTE_SCLPEN |
                      SATELLITE_I2C_LOCATION << I2C_ROUTE_LOCATION_SHIFT;
    SATELLITE_I2C->SADDR = CUBESTAR_I2C_ADDRESS << I2C_SADDR_ADDR_SHIFT;
    SATELLITE_I2C->SADDRMASK = WHOLE_ADDRESS << I2C_SADDRMASK_MASK_SHIFT;
    SATELLITE_I2C->CTRL = I2C_CTRL_EN | I2C_CTRL_SLAVE;
    SATELLITE_I2C->CMD = I2C_CMD_ABORT; /* marks the bus as idle */
    SATELLITE_I2C->IEN = I2C_IEN_ADDR | I2C_IEN_RXDATAV | I2C_IEN_ACK | I2C_IEN_SSTOP;
    interrupt_enable(SATELLITE_I2C_IRQ);
}

static void addressed(void)
{
    uint32_t address = SATELLITE_I2C->RXDATA;
    SATELLITE_I2C->CMD = I2C_CMD_CLEARTX;
    i2c_slave_started(address & READ_BIT);
    SATELLITE_I2C->CMD = I2C_CMD_ACK;
    if (address & READ_BIT)
        SATELLITE_I2C->TXDATA = i2c_slave_wanted();
}

static void written(void)
{
    bool taken = i2c_slave_received((uint8_t)SATELLITE_I2C->RXDATA);
    SATELLITE_I2C->CMD = taken ? I2C_CMD_ACK : I2C_CMD_NACK;
}

void i2c_slave_handler(void)
{
    uint32_t flags = SATELLITE_I2C->IF;
    SATELLITE_I2C->IFC = flags & (I2C_IF_ADDR | I2C_IF_ACK | I2C_IF_SSTOP);
    if (flags & I2C_IF_SSTOP)
        i2c_slave_stopped();
    if (flags & I2C_IF_ADDR)
        addressed();
    else if (flags & I2C_IF_RXDATAV)
        written();
    else if (flags & I2C_IF_ACK)
        SATELLITE_I2C->TXDATA = i2c_slave_wanted();
}
