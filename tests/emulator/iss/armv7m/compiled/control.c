/* setjmp, switch tables, recursion, pointers to functions, variable arguments, packed fields. */
#include "report.h"
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>

static jmp_buf place;
static int depth;

static void dive(int n) {
    volatile char room[40];
    room[n % 40] = (char)n, depth = n;
    if (n == 17) longjmp(place, n + room[17]);
    dive(n + 1);
    note((uint32_t)room[0]);
}
static uint32_t ackermann(uint32_t m, uint32_t n) {
    return m == 0 ? n + 1 : n == 0 ? ackermann(m - 1, 1) : ackermann(m - 1, ackermann(m, n - 1));
}
static uint32_t step(uint32_t state, uint32_t what) {
    switch (what) {
    case 0: return state + 1;
    case 1: return state * 3;
    case 2: return state ^ 0xFF00FF;
    case 3: return state >> 3;
    case 4: return ~state;
    case 5: return state - what;
    case 6: return state << 5 | state >> 27;
    case 7: state += 9; /* fall through */
    case 8: return state & 0x7FFFFFFF;
    case 100: return 1;
    case 1000: return state % 1000;
    case 10000: return state | 0x10101010;
    default: return state + what;
    }
}
static int64_t total(int count, ...) {
    va_list list;
    va_start(list, count);
    int64_t found = 0;
    for (int i = 0; i < count; i++) found += i & 1 ? va_arg(list, long long) : i % 3 ? (int64_t)va_arg(list, double) : va_arg(list, int);
    va_end(list);
    return found;
}
struct __attribute__((packed)) packed { uint8_t a; uint32_t b; uint16_t c; uint64_t d; };
struct fields { unsigned a : 3; int b : 7; unsigned c : 13; unsigned long long d : 40; };
static uint32_t twice(uint32_t x) { return 2 * x; }
static uint32_t square(uint32_t x) { return x * x; }
static uint32_t less(uint32_t x) { return x - 5; }
static uint32_t (*const table[])(uint32_t) = {twice, square, less, twice};
typedef struct { uint32_t words[9]; } big;
static big mixed(big in, uint8_t k) { for (int i = 0; i < 9; i++) in.words[i] += k * (uint32_t)i; return in; }

int main(void) {
    const int value = setjmp(place);
    if (value == 0) dive(0);
    note((uint32_t)value), note((uint32_t)depth), note(ackermann(2, 5));
    uint32_t state = 7;
    for (int i = 0; i < 600; i++) {
        const uint32_t what = draw() % 14;
        state = step(state, what > 11 ? (what == 12 ? 1000 : 10000) : what);
        note(table[state & 3](state));
    }
    note(state), note_64((uint64_t)total(6, 1, 2ll, 3.5, 4, 5.25, 6ll << 33));
    struct packed p = {1, 0x12345678, 0xABCD, 0x1122334455667788ull};
    volatile struct packed *q = &p;
    q->b += q->c, q->d ^= q->b;
    note(q->b), note_64(q->d);
    struct fields f = {5, -33, 4000, 0x123456789Aull};
    volatile struct fields *g = &f;
    g->b += 20, g->c ^= g->a, g->d += (unsigned)g->c;
    note((uint32_t)g->b), note(g->c), note_64(g->d);
    big start = {{1, 2, 3, 4, 5, 6, 7, 8, 9}};
    for (int i = 0; i < 20; i++) start = mixed(start, (uint8_t)draw());
    for (int i = 0; i < 9; i++) note(start.words[i]);
    int count = (int)(draw() % 30) + 5;
    uint16_t room[count];
    for (int i = 0; i < count; i++) room[i] = (uint16_t)(i * count);
    for (int i = 0; i < count; i++) note(room[count - 1 - i]);
    return report("control");
}
