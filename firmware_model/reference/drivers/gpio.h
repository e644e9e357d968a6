/* Port pins. EFM32GG Reference Manual, chapter 32.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef GPIO_H
#define GPIO_H

#include <stdbool.h>
#include <stdint.h>

#include "efm32gg.h"
#include "pins.h"

/* Modes of a pin, MODEL and MODEH. */
enum pin_mode {
    PIN_DISABLED = 0, /* pulled up where DOUT is 1 */
    PIN_INPUT = 1,
    PIN_PULLED = 2, /* up where DOUT is 1, else down */
    PIN_OUTPUT = 4,
    PIN_OPEN_DRAIN = 8, /* wired-and */
};

/* All ports have the same registers. */
struct port {
    volatile uint32_t CTRL, MODEL, MODEH, DOUT, DOUTSET, DOUTCLR, DOUTTGL;
    volatile const uint32_t DIN;
    volatile uint32_t PINLOCKN;
};

#define PORT(number) ((struct port *)GPIO + (number))

/* The level is that of an output, or of a pull. */
static inline void pin_set_up(struct pin pin, enum pin_mode mode, bool level)
{
    struct port *port = PORT(pin.port);
    if (level)
        port->DOUTSET = 1u << pin.bit;
    else
        port->DOUTCLR = 1u << pin.bit;
    volatile uint32_t *modes = pin.bit < 8 ? &port->MODEL : &port->MODEH;
    unsigned shift = 4u * (pin.bit % 8u);
    *modes = (*modes & ~(0xFu << shift)) | (uint32_t)mode << shift;
}

static inline void pin_write(struct pin pin, bool level)
{
    if (level)
        PORT(pin.port)->DOUTSET = 1u << pin.bit;
    else
        PORT(pin.port)->DOUTCLR = 1u << pin.bit;
}

static inline bool pin_read(struct pin pin)
{
    return PORT(pin.port)->DIN >> pin.bit & 1;
}

#endif
