/* SPDX-License-Identifier: BSD-2-Clause */
/* Operations of the cost table, as compiled code.
 *
 * Each function repeats one operation on changing operands. It is called with two numbers of turns,
 * which cancels the cost of the call itself, and compared with a `plain_` function that does
 * everything but the operation. */
#include <math.h>
#include <stdint.h>

#include "efm32gg.h" /* generated */
#include "float_functions.h"

#define OPERANDS 64 /* a power of two */
#define OPERAND(turn) ((turn) % OPERANDS)

/* Filled from outside: floats of any sign, floats of -1 to 1, integers. */
volatile float left[OPERANDS], right[OPERANDS], unit[OPERANDS], result[OPERANDS];
volatile int32_t whole[OPERANDS], other[OPERANDS], answer[OPERANDS];
volatile uint8_t bytes[OPERANDS];

#define EXTERNAL ((volatile uint8_t *)0x80000000u)
#define PORT (&GPIO->PD_DIN)
#define PORT_SET (&GPIO->PD_DOUTSET)
#define PORT_CLEAR (&GPIO->PD_DOUTCLR)

#define REPEATED(name, ...)                             \
    void name(uint32_t turns) {                         \
        for (uint32_t turn = 0; turn < turns; turn++) { \
            __VA_ARGS__;                                \
        }                                               \
    }

/* Eight additions and multiplications in turn, and an operation after each pair: more code than the
 * flash cache holds, as in a formula. One operand is read from RAM. */
#define STEP(n, operation) x = x + left[n]; x = x * right[n]; operation(n);
#define NONE(n)
#define ADD(n) x = x + right[n]
#define MULTIPLY(n) x = x * left[n]
#define DIVIDE(n) x = x / right[n]
#define FORMULA(operation)                                                              \
    float x = left[OPERAND(turn)];                                                      \
    STEP(0, operation) STEP(1, operation) STEP(2, operation) STEP(3, operation)         \
    STEP(4, operation) STEP(5, operation) STEP(6, operation) STEP(7, operation)         \
    result[OPERAND(turn)] = x

#define UNITS(expression)                \
    float x = unit[OPERAND(turn)];       \
    result[OPERAND(turn)] = (expression)

#define WHOLES(expression)                                             \
    int32_t x = whole[OPERAND(turn)], y = other[OPERAND(turn)];        \
    answer[OPERAND(turn)] = (expression);                              \
    (void)y

REPEATED(plain_formula, FORMULA(NONE))
REPEATED(f32_add, FORMULA(ADD))
REPEATED(f32_mul, FORMULA(MULTIPLY))
REPEATED(f32_div, FORMULA(DIVIDE))

REPEATED(plain_units, UNITS(x))
REPEATED(f32_sqrt, UNITS(sqrtf(x)))
REPEATED(f32_acos, UNITS(arc_cosine(x)))
REPEATED(f32_sin, UNITS(sine(x)))
REPEATED(f32_atan2, UNITS(arc_tangent(x, 0.3f)))

/* A comparison decides a branch, as in a search; the plain function compares integers. */
REPEATED(plain_compare, {
    float x = left[OPERAND(turn)], y = right[OPERAND(turn)];
    int32_t decided = whole[OPERAND(turn)];
    answer[OPERAND(turn)] = decided < 0 ? 1 : 2;
    (void)x, (void)y;
})
REPEATED(f32_compare, {
    float x = left[OPERAND(turn)], y = right[OPERAND(turn)];
    int32_t decided = whole[OPERAND(turn)];
    answer[OPERAND(turn)] = x < y ? 1 : 2;
    (void)decided;
})
REPEATED(plain_convert, {
    int32_t x = whole[OPERAND(turn)];
    answer[OPERAND(turn)] = x;
})
REPEATED(f32_convert, {
    int32_t x = whole[OPERAND(turn)];
    result[OPERAND(turn)] = (float)x;
})

REPEATED(plain_wholes, WHOLES(x))
REPEATED(i32_add, WHOLES(x + y))
REPEATED(i32_mul, WHOLES(x * y))
REPEATED(i32_div, WHOLES(x / y))

/* An entry of a table of bytes, at a computed index. */
REPEATED(table_byte, WHOLES(x + bytes[OPERAND(x)]))

REPEATED(plain_loop, __asm volatile(""))
REPEATED(plain_twice, __asm volatile(""); __asm volatile(""))

/* A function that saves four registers and the return address. */
__attribute__((noinline)) static void callee(void) {
    __asm volatile("" : : : "r4", "r5", "r6", "r8", "lr");
}

REPEATED(call, callee())

REPEATED(ram_read, (void)left[0])
REPEATED(ram_write, answer[0] = 0)

/* Words of a memory, far from each other, so that no cache holds them. */
void read_words(uint32_t turns, const volatile uint32_t *memory) {
    for (uint32_t turn = 0; turn < turns; turn++) {
        (void)memory[turn * 67 % 8192];
    }
}

REPEATED(ebi_read, (void)*EXTERNAL)
REPEATED(ebi_write, *EXTERNAL = 0)
REPEATED(port_read, (void)*PORT)
REPEATED(port_write, *PORT_SET = 1)

/* One turn of the copy loop: clock high, a byte, clock low; see drivers/fpga.c. */
REPEATED(transfer_byte, {
    *PORT_SET = 1;
    __asm volatile("nop\n nop\n nop");
    EXTERNAL[turn] = (uint8_t)*PORT;
    *PORT_CLEAR = 1;
})

/* An interrupt that queues a byte; the program itself makes it pending. */
static volatile uint8_t queue[OPERANDS], received;
static volatile uint32_t head;

void byte_interrupt(void) {
    uint8_t byte = received;
    queue[OPERAND(head)] = byte;
    head = head + 1;
}

#define SET_PENDING ((volatile uint32_t *)0xE000E200u)

REPEATED(byte_interrupt_taken, *SET_PENDING = 1; __asm volatile("dsb\n isb"))
