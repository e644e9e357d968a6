/* SPDX-License-Identifier: BSD-2-Clause */
/* Operations of the Blackfin's cost table, counted with the processor's register CYCLES.
 *
 * Each operation is counted on its own for every operand, so the cost of counting is that of an
 * empty or plain operation, and blackfin.py subtracts it. The program prints names and sums. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "operands.h" /* generated: left, right, square, unit, whole, other, bytes, checks */

static volatile float x, y, s, u, f;
static volatile int32_t w, v, k;
static volatile uint8_t a;
static uint8_t word[9], image[64];
static uint8_t queue[32];
static volatile uint32_t head;

static inline uint32_t now(void) {
    uint32_t cycles;
    __asm__ volatile("%0 = CYCLES;" : "=d"(cycles) : : "memory");
    return cycles;
}

static void load(int turn) {
    x = left[turn], y = right[turn], s = square[turn], u = unit[turn];
    w = whole[turn], v = other[turn], a = bytes[turn];
}

#define COUNT(name, ...)                              \
    {                                                 \
        uint32_t sum = 0;                             \
        for (int turn = 0; turn < OPERANDS; turn++) { \
            load(turn);                               \
            uint32_t before = now();                  \
            __VA_ARGS__;                              \
            sum += now() - before;                    \
        }                                             \
        printf("%s %lu\n", #name, (unsigned long)sum); \
    }

/* A function that saves four registers and the return address. */
__attribute__((noinline)) static void callee(void) {
    __asm__ volatile("" : : : "R4", "R5", "R6", "R7", "RETS");
}

/* A byte of a serial port, queued by a driver's function. */
__attribute__((noinline)) static void put(uint8_t byte) {
    queue[head++ % sizeof queue] = byte;
}

__attribute__((interrupt_handler)) void interrupted(void) {
    put(image[0]);
}

/* A frame's end: the channel's status is read and cleared, the program told. */
static volatile uint16_t status, woken;
__attribute__((noinline)) static void end_frame(void) {
    uint16_t found = status;
    status = found & 3;
    woken++;
}

__attribute__((interrupt_handler)) void frame_interrupted(void) {
    end_frame();
}

/* Check byte of 64 data bits by table, and its comparison. */
__attribute__((noinline)) static int decode(const uint8_t *coded) {
    uint8_t check = coded[8];
#pragma GCC unroll 8
    for (int place = 0; place < 8; place++) {
        check ^= checks[256 * place + coded[place]];
    }
    return check;
}

/* The wrong bit by the syndrome, flipped. */
__attribute__((noinline)) static void correct(uint8_t *coded, uint8_t syndrome) {
    int bit = checks[syndrome];
    if (bit < 64) {
        coded[bit >> 3] ^= 1 << (bit & 7);
    }
}

/* Call a handler as an interrupt does: it returns to the address in RETI. */
static void interrupt(void (*handler)(void)) {
    __asm__ volatile("P1 = %0; P0.H = 1f; P0.L = 1f; R0 = P0; RETI = R0; JUMP (P1); 1:"
                     : : "a"(handler) : "P0", "P1", "R0", "memory");
}

int main(void) {
    __asm__ volatile("R0 = SYSCFG; BITSET(R0, 1); SYSCFG = R0;" : : : "R0"); /* count */
    COUNT(nothing, )
    COUNT(plain_float, f = x)
    COUNT(f32_add, f = x + y)
    COUNT(f32_mul, f = x * y)
    COUNT(f32_div, f = x / y)
    COUNT(f32_sqrt, f = sqrtf(s))
    COUNT(f32_atan2, f = atan2f(x, y))
    COUNT(f32_acos, f = acosf(u))
    COUNT(f32_sin, f = sinf(u))
    COUNT(f32_compare, if (x < y) k = 1; else k = 2)
    COUNT(plain_compare, if (w < v) k = 1; else k = 2)
    COUNT(f32_convert, f = (float)w)
    COUNT(plain_whole, (void)v; k = w)
    COUNT(i32_add, k = w + v)
    COUNT(i32_mul, k = w * v)
    COUNT(i32_div, k = w / v)
    COUNT(table_byte, k = checks[a])
    COUNT(plain_byte, k = a)
    COUNT(loop_10, for (int n = 0; n < 10; n++) __asm__ volatile("nop;"))
    COUNT(loop_20, for (int n = 0; n < 20; n++) __asm__ volatile("nop;"))
    COUNT(call, callee())
    COUNT(coded_word, k = decode(word))
    COUNT(correction, correct(word, a))
    COUNT(uart_interrupt, interrupt(interrupted))
    COUNT(frame_interrupt, interrupt(frame_interrupted))
    return 0;
}
