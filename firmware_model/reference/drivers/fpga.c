/* SPDX-License-Identifier: BSD-2-Clause */
/* The pins to the FPGA board. */
#include "fpga.h"

#include "gpio.h"
#include "pins.h"

#define DATA_PINS 8

void fpga_start(void)
{
    pin_set_up(FPGA_ENABLE, PIN_OUTPUT, 0);
    pin_set_up(FPGA_RNW, PIN_OUTPUT, 0);
    pin_set_up(FPGA_BANK, PIN_OUTPUT, 0);
    pin_set_up(FPGA_DCLK, PIN_OUTPUT, 0);
    pin_set_up(FPGA_ACK, PIN_INPUT, 0);
    for (unsigned i = 0; i < DATA_PINS; i++)
        pin_set_up(FPGA_DATA + i, PIN_INPUT, 0);
}

void fpga_enable(bool on)
{
    pin_write(FPGA_ENABLE, on);
}

void fpga_read_not_write(bool read)
{
    pin_write(FPGA_RNW, read);
}

void fpga_bank(bool bank)
{
    pin_write(FPGA_BANK, bank);
}

bool fpga_acknowledges(void)
{
    return pin_read(FPGA_ACK);
}

/* The byte is valid from the rising edge on; the port's synchroniser delays it by two clocks. */
void fpga_transfer(uint8_t *to, int count)
{
    struct port *clock = PORT_OF(FPGA_DCLK);
    const struct port *data = PORT_OF(FPGA_DATA);
    for (const uint8_t *end = to + count; to != end; to++) {
        clock->DOUTSET = BIT_OF(FPGA_DCLK);
        __asm volatile("nop\n nop\n nop");
        *to = (uint8_t)(data->DIN >> FPGA_DATA % 16u);
        clock->DOUTCLR = BIT_OF(FPGA_DCLK);
    }
}
