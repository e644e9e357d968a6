/* SPDX-License-Identifier: BSD-2-Clause */
/* Port pins. EFM32GG Reference Manual, chapter 32. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "efm32gg.h"

/* Modes of a pin, MODEL and MODEH. Pins are numbered as in pins.h: port times 16 plus bit. */
enum pin_mode {
    PIN_DISABLED = 0, /* pulled up if DOUT is 1 */
    PIN_INPUT = 1,
    PIN_PULLED = 2, /* up if DOUT is 1, else down */
    PIN_OUTPUT = 4,
    PIN_OPEN_DRAIN = 8, /* wired-and */
};

/* All ports have the same registers. */
struct port {
    volatile uint32_t CTRL, MODEL, MODEH, DOUT, DOUTSET, DOUTCLR, DOUTTGL;
    volatile const uint32_t DIN;
    volatile uint32_t PINLOCKN;
};

#define PORT_OF(pin) ((struct port *)GPIO + (pin) / 16u)
#define BIT_OF(pin) (1u << (pin) % 16u)

/* `level` is that of an output, or of a pull resistor. */
static inline void pin_set_up(unsigned pin, enum pin_mode mode, bool level)
{
    struct port *port = PORT_OF(pin);
    if (level)
        port->DOUTSET = BIT_OF(pin);
    else
        port->DOUTCLR = BIT_OF(pin);
    volatile uint32_t *modes = pin % 16u < 8 ? &port->MODEL : &port->MODEH;
    unsigned shift = 4u * (pin % 8u);
    *modes = (*modes & ~(0xFu << shift)) | (uint32_t)mode << shift;
}

static inline void pin_write(unsigned pin, bool level)
{
    if (level)
        PORT_OF(pin)->DOUTSET = BIT_OF(pin);
    else
        PORT_OF(pin)->DOUTCLR = BIT_OF(pin);
}

static inline bool pin_read(unsigned pin)
{
    return PORT_OF(pin)->DIN >> pin % 16u & 1;
}
