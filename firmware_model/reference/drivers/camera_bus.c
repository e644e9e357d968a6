/* SPDX-License-Identifier: BSD-2-Clause */
/* The camera's control bus, 100 kHz. EFM32GG Reference Manual, chapter 16. */
#include "camera_bus.h"

#include "clock.h"
#include "cubestar_tables.h"
#include "efm32gg.h"
#include "gpio.h"
#include "pins.h"

#define BUS_HZ 100000u
#define DIVIDER ((CLOCK_HZ / BUS_HZ - 4u + 7u) / 8u - 1u) /* (4 + 4)(DIV + 1) + 4 clocks per bit */
#define LONGEST_WAIT_US 10000u

void camera_bus_start(void)
{
    pin_set_up(CAMERA_I2C_SDA_PIN, PIN_OPEN_DRAIN, 1);
    pin_set_up(CAMERA_I2C_SCL_PIN, PIN_OPEN_DRAIN, 1);
    CAMERA_I2C->ROUTE = I2C_ROUTE_SDAPEN | I2C_ROUTE_SCLPEN |
                        CAMERA_I2C_LOCATION << I2C_ROUTE_LOCATION_SHIFT;
    CAMERA_I2C->CLKDIV = DIVIDER;
    CAMERA_I2C->CTRL = I2C_CTRL_EN;
    CAMERA_I2C->CMD = I2C_CMD_ABORT;
}

/* Waits for one of `flags`; returns those that are set, none after the time-out. */
static uint32_t await(uint32_t flags)
{
    uint64_t started = time_us();
    uint32_t found;
    do {
        found = CAMERA_I2C->IF & flags;
    } while (!found && since(started) < LONGEST_WAIT_US);
    CAMERA_I2C->IFC = found;
    return found;
}

static bool acknowledged(void)
{
    return await(I2C_IF_ACK | I2C_IF_NACK | I2C_IF_ARBLOST | I2C_IF_BUSERR) & I2C_IF_ACK;
}

static bool stopped(bool good)
{
    CAMERA_I2C->CMD = I2C_CMD_STOP;
    if (await(I2C_IF_MSTOP))
        return good;
    CAMERA_I2C->CMD = I2C_CMD_ABORT;
    return false;
}

static bool written(const uint8_t *data, int count)
{
    CAMERA_I2C->IFC = I2C_IFC_ACK | I2C_IFC_NACK | I2C_IFC_MSTOP;
    CAMERA_I2C->TXDATA = CAMERA_I2C_ADDRESS << 1;
    CAMERA_I2C->CMD = I2C_CMD_START;
    if (!acknowledged())
        return false;
    for (int i = 0; i < count; i++) {
        CAMERA_I2C->TXDATA = data[i];
        if (!acknowledged())
            return false;
    }
    return true;
}

bool camera_bus_write(const uint8_t *data, int count)
{
    return stopped(written(data, count));
}

bool camera_bus_read(const uint8_t *data, int count, uint8_t *byte)
{
    if (!written(data, count))
        return stopped(false);
    CAMERA_I2C->CMD = I2C_CMD_START;
    CAMERA_I2C->TXDATA = CAMERA_I2C_ADDRESS << 1 | 1;
    if (!acknowledged() || !await(I2C_IF_RXDATAV))
        return stopped(false);
    *byte = (uint8_t)CAMERA_I2C->RXDATA;
    CAMERA_I2C->CMD = I2C_CMD_NACK;
    return stopped(true);
}
