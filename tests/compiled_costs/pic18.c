/* SPDX-License-Identifier: BSD-2-Clause */
/* Operations of the PIC18's cost table and the routines that the CubeSense thesis prints, counted.
 *
 * Timer 0 counts instruction cycles. Each operation is counted on its own for every operand, so the
 * cost of counting is that of an empty or plain operation, and pic18.py subtracts it. Results are
 * in `counts`, in the order of the names after COUNT, which pic18.py reads from this file. */
#include <math.h>
#include <stdint.h>

#include "operands.h" /* generated: left, right, square, angle, whole, other, bytes, columns, lines,
                         differences */

__sfr __at(0xFD5) T0CON;
__sfr __at(0xFD6) TMR0L;
__sfr __at(0xFD7) TMR0H;
__sfr __at(0xFF2) INTCON;
__sfr __at(0xF82) PORTC;
__sfr __at(0xF83) PORTD;
__sfr __at(0xF8B) LATC;
__sfr __at(0xF95) TRISD;
__sfr __at(0xF8C) LATD;

#define CLOCK 1 /* bits of port C */
#define MODE 2

uint32_t counts[NAMES];
static uint8_t next;
volatile uint8_t done;

/* Operands and results. */
static float x, y, s, u, f;
static int16_t w, v, k;
static uint8_t a, b, c, turn;
static uint8_t row[64];
static uint8_t queue[32], head;

static void stop(void) {
    uint16_t ticks = TMR0L;
    ticks |= (uint16_t)TMR0H << 8;
    counts[next] += ticks;
}

static void load(void) {
    x = left[turn], y = right[turn], s = square[turn], u = angle[turn];
    w = whole[turn], v = other[turn], k = turn;
    a = bytes[turn], b = bytes[OPERANDS - 1 - turn];
}

#define COUNT(name, ...)                      \
    for (turn = 0; turn < OPERANDS; turn++) { \
        load();                               \
        TMR0H = 0, TMR0L = 0;                 \
        __VA_ARGS__;                          \
        stop();                               \
    }                                         \
    next++;

/* A byte of a serial port, queued. */
void interrupted(void) __interrupt 1 {
    INTCON &= ~2;
    queue[head++ & 31] = PORTD;
}

static void callee(int16_t one, int16_t two) {
    (void)one, (void)two;
}

static void strobe(uint8_t byte) {
    LATD = byte;
    LATC |= CLOCK;
    LATC &= ~CLOCK;
}

/* Read one pixel by its address: three bytes, then its value. */
static uint8_t addressed(int16_t column, int16_t line) {
    uint8_t value;
    LATC |= MODE;
    TRISD = 0;
    strobe(line >> 1);
    strobe((uint8_t)(line << 7) | (uint8_t)(column >> 3));
    strobe(column << 5);
    TRISD = 0xFF;
    LATC &= ~MODE;
    LATC |= CLOCK;
    value = PORTD;
    LATC &= ~CLOCK;
    return value;
}

/* The window's bytes, as section 6.6.2 reads them. */
static void read_window(int16_t size) {
    uint16_t at;
    for (at = 0; at < (uint16_t)size; at++) {
        LATC |= CLOCK;
        c = PORTD;
        LATC &= ~CLOCK;
    }
}

/* The pixels between two samples, as appendix C.3 reads them. */
static void read_line(__data uint8_t *line, int16_t size) {
    int16_t at;
    for (at = 0; at < size; at++) {
        LATC |= CLOCK;
        line[at] = PORTD;
        LATC &= ~CLOCK;
    }
}

/* Binary search of an edge, appendix C.4. */
static uint8_t find_edge(__data uint8_t *line, uint8_t bright, uint8_t dark, uint8_t steps) {
    for (; steps; steps--) {
        uint8_t middle = (bright + dark) >> 1;
        if (line[middle] >= 70) bright = middle;
        else dark = middle;
    }
    return bright;
}

/* Distance from the rim's centre, equation 6.5.1; an int is converted for each factor. */
static uint8_t beyond_rim(int16_t column, int16_t line) {
    return sqrtf((float)(column - 371) * (float)(column - 371) +
                 (float)(line - 236) * (float)(line - 236)) >= 226.0f;
}

/* Equations 6.3.7 to 6.3.9: the corrected point in 1/100 px. */
static int16_t moved_x, moved_y;
static void undistort(int16_t column, int16_t line) {
    float dx = (float)(column - 371), dy = (float)(line - 236);
    float radius = sqrtf(dx * dx + dy * dy), difference, longer;
    uint8_t index = (uint8_t)radius;
    if (index > 225) index = 225;
    difference = differences[index] +
        (float)(differences[index + 1] - differences[index]) * (radius - (float)index);
    longer = (float)index + difference;
    if (radius == 0.0f) radius = 1.0f;
    moved_x = (int16_t)(longer * dx / radius * 100.0f);
    moved_y = (int16_t)(longer * dy / radius * 100.0f);
}

/* All twelve sums of the normal equations for one edge, section 6.5.3.1. */
static float xx, xy, yx, yy, sx, sy, tx, ty, zx, zy, sz, n;
static void add_edge(int16_t hundredth_x, int16_t hundredth_y) {
    float px = (float)hundredth_x / 100.0f, py = (float)hundredth_y / 100.0f;
    float z = px * px + py * py;
    xx += 2.0f * px * px;
    xy += 2.0f * px * py;
    yx += 2.0f * py * px;
    yy += 2.0f * py * py;
    sx += px;
    sy += py;
    tx += 2.0f * px;
    ty += 2.0f * py;
    zx += z * px;
    zy += z * py;
    sz += z;
    n += 1.0f;
}

/* The centre by the inverse's first two rows, equations 4.4.13 to 4.4.18. */
static float centre_x, centre_y;
static void solve(void) {
    float c00 = yy * n - sy * ty, c01 = sy * tx - yx * n, c02 = yx * ty - yy * tx;
    float c10 = sx * ty - xy * n, c11 = xx * n - sx * tx;
    float c20 = xy * sy - sx * yy, c21 = sx * yx - xx * sy;
    float det = xx * c00 + xy * c01 + sx * c02;
    centre_x = (c00 * zx + c10 * zy + c20 * sz) / det;
    centre_y = (c01 * zx + c11 * zy + c21 * sz) / det;
}

/* A pixel of the Sun, appendix C.6: weighted sums of the coordinates. */
static float sun_x, sun_y;
static uint16_t weight;
static void add_pixel(int16_t column, int16_t line, uint8_t value) {
    sun_x += (float)column * (float)value;
    sun_y += (float)line * (float)value;
    weight += value;
}

void main(void) {
    T0CON = 0x88; /* on, 16 bits, instruction clock, no prescaler */
    INTCON = 0x10;
    for (turn = 0; turn < sizeof row; turn++) row[turn] = turn < 30 ? 34 : 150;
    COUNT(nothing, )
    COUNT(plain_float, f = x)
    COUNT(f32_add, f = x + y)
    COUNT(f32_mul, f = x * y)
    COUNT(f32_div, f = x / y)
    COUNT(f32_sqrt, f = sqrtf(s))
    COUNT(f32_atan2, f = atan2f(x, y))
    COUNT(f32_tan, f = tanf(u))
    COUNT(f32_compare, if (x < y) c = 1; else c = 2)
    COUNT(plain_branch, if (turn & 1) c = 1; else c = 2)
    COUNT(int_to_float, f = (float)w)
    COUNT(float_to_int, k = (int16_t)y)
    COUNT(i8_store, c = a + b)
    COUNT(i8_branch, if (a < b) c = 1)
    COUNT(i16_add, k = w + v)
    COUNT(i16_div, k = w / v)
    COUNT(table_byte, c = differences[a])
    COUNT(array_byte, c = row[k])
    COUNT(loop_10, for (c = 0; c < 10; c++) __asm__("nop"))
    COUNT(loop_20, for (c = 0; c < 20; c++) __asm__("nop"))
    COUNT(loop16_10, for (k = 0; k < 10; k++) __asm__("nop"))
    COUNT(loop16_20, for (k = 0; k < 20; k++) __asm__("nop"))
    COUNT(call, callee(w, v))
    COUNT(port_read, c = PORTD)
    COUNT(port_write, LATC |= CLOCK)
    COUNT(window_10, read_window(10))
    COUNT(window_20, read_window(20))
    COUNT(line_10, read_line(row, 10))
    COUNT(line_20, read_line(row, 20))
    COUNT(addressed, c = addressed(w, v))
    COUNT(not_interrupted, INTCON |= 2; __asm__("nop"); INTCON &= ~2)
    INTCON = 0x90;
    COUNT(interrupted, INTCON |= 2; __asm__("nop"); INTCON &= ~2)
    INTCON = 0;
    COUNT(find_edge, c = find_edge(row, 63, 0, 6))
    COUNT(beyond_rim, c = beyond_rim(columns[turn], lines[turn]))
    COUNT(undistort, undistort(columns[turn], lines[turn]))
    COUNT(add_edge, add_edge(columns[turn] * 50, lines[turn] * 50))
    COUNT(solve, solve())
    COUNT(add_pixel, add_pixel(columns[turn], lines[turn], a))
    done = 1;
    for (;;) {
    }
}
