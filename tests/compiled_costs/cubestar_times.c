/* SPDX-License-Identifier: BSD-2-Clause */
/* Ways to write the loop of CubeStar's imageTransfer (CubeStar thesis, appendices C and D), each for
 * `count` bytes, a multiple of 8: the clock's edge, a byte from eight pins, a store on the external
 * bus, the clock's other edge. Aligned, so that other code does not change their cycles. */
#include <stdint.h>

#include "efm32gg.h" /* generated */

#define LOOP __attribute__((aligned(64))) void
#define IMAGE ((volatile uint8_t *)0x80000000u)
#define IMAGE_WORDS ((volatile uint32_t *)0x80000000u)
#define COLUMNS 1024u
#define DATA 3u      /* port D: data on pins 0 to 7, the clock on pin 8 */
#define CLOCK_PIN 8u

struct port {
    volatile uint32_t CTRL, MODEL, MODEH, DOUT, DOUTSET, DOUTCLR, DOUTTGL, DIN, PINLOCKN;
};
#define PORTS ((struct port *)GPIO)
#define RISE PORTS[DATA].DOUTSET = 1u << CLOCK_PIN
#define FALL PORTS[DATA].DOUTCLR = 1u << CLOCK_PIN
#define BYTE ((uint8_t)PORTS[DATA].DIN)

/* As in drivers/fpga.c, with the wait that optimised code needs. */
LOOP waiting(uint32_t count) {
    volatile uint8_t *to = IMAGE;
    for (uint32_t i = 0; i < count; i++) {
        RISE;
        __asm volatile("nop\n nop\n nop");
        *to++ = BYTE;
        FALL;
    }
}

LOOP pointer(uint32_t count) {
    volatile uint8_t *to = IMAGE;
    for (uint32_t i = 0; i < count; i++) {
        RISE;
        *to++ = BYTE;
        FALL;
    }
}

LOOP registers(uint32_t count) {
    register volatile uint8_t *to = IMAGE;
    for (register uint32_t i = 0; i < count; i++) {
        RISE;
        *to++ = BYTE;
        FALL;
    }
}

LOOP unrolled(uint32_t count) {
    volatile uint8_t *to = IMAGE;
    for (uint32_t i = 0; i < count; i += 4) {
        RISE, *to++ = BYTE, FALL;
        RISE, *to++ = BYTE, FALL;
        RISE, *to++ = BYTE, FALL;
        RISE, *to++ = BYTE, FALL;
    }
}

LOOP indexed(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        RISE;
        IMAGE[i] = BYTE;
        FALL;
    }
}

LOOP output(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        PORTS[DATA].DOUT |= 1u << CLOCK_PIN;
        IMAGE[i] = BYTE;
        PORTS[DATA].DOUT &= ~(1u << CLOCK_PIN);
    }
}

/* Functions of a port and a pin, in the manner of a vendor's library. */
static inline void pin_set(unsigned port, unsigned pin) {
    PORTS[port].DOUTSET = 1u << pin;
}

static inline void pin_clear(unsigned port, unsigned pin) {
    PORTS[port].DOUTCLR = 1u << pin;
}

static inline uint32_t port_read(unsigned port) {
    return PORTS[port].DIN;
}

static inline unsigned pin_read(unsigned port, unsigned pin) {
    return PORTS[port].DIN >> pin & 1u;
}

LOOP functions(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        pin_set(DATA, CLOCK_PIN);
        IMAGE[i] = (uint8_t)port_read(DATA);
        pin_clear(DATA, CLOCK_PIN);
    }
}

LOOP rows(uint32_t count) {
    for (uint32_t row = 0; row < count / 8; row++) {
        for (uint32_t column = 0; column < 8; column++) {
            pin_set(DATA, CLOCK_PIN);
            IMAGE[row * COLUMNS + column] = (uint8_t)port_read(DATA);
            pin_clear(DATA, CLOCK_PIN);
        }
    }
}

LOOP words(uint32_t count) {
    for (uint32_t i = 0; i < count / 4; i++) {
        uint32_t word = 0;
        for (unsigned shift = 0; shift < 32; shift += 8) {
            pin_set(DATA, CLOCK_PIN);
            word |= (port_read(DATA) & 0xFFu) << shift;
            pin_clear(DATA, CLOCK_PIN);
        }
        IMAGE_WORDS[i] = word;
    }
}

LOOP bits(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        pin_set(DATA, CLOCK_PIN);
        unsigned byte = 0;
        for (unsigned pin = 0; pin < 8; pin++)
            byte |= pin_read(DATA, pin) << pin;
        IMAGE[i] = (uint8_t)byte;
        pin_clear(DATA, CLOCK_PIN);
    }
}

/* The same functions from another file, so that no compiler inlines them. */
__attribute__((noinline)) static void far_set(unsigned port, unsigned pin) {
    pin_set(port, pin);
    __asm volatile("");
}

__attribute__((noinline)) static void far_clear(unsigned port, unsigned pin) {
    pin_clear(port, pin);
    __asm volatile("");
}

__attribute__((noinline)) static uint32_t far_port(unsigned port) {
    __asm volatile("");
    return port_read(port);
}

__attribute__((noinline)) static unsigned far_pin(unsigned port, unsigned pin) {
    __asm volatile("");
    return pin_read(port, pin);
}

LOOP calls(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        far_set(DATA, CLOCK_PIN);
        IMAGE[i] = (uint8_t)far_port(DATA);
        far_clear(DATA, CLOCK_PIN);
    }
}

LOOP bit_calls(uint32_t count) {
    for (uint32_t i = 0; i < count; i++) {
        far_set(DATA, CLOCK_PIN);
        unsigned byte = 0;
        for (unsigned pin = 0; pin < 8; pin++)
            byte |= far_pin(DATA, pin) << pin;
        IMAGE[i] = (uint8_t)byte;
        far_clear(DATA, CLOCK_PIN);
    }
}
