/* 64-bit arithmetic, divisions, shifts, bit operations. */
#include "report.h"
#include <stdlib.h>

static uint64_t draw_64(void) {
    const uint64_t value = (uint64_t)draw() << 32 | draw();
    return value >> (draw() & 63);
}

int main(void) {
    for (int i = 0; i < 500; i++) {
        const uint64_t a = draw_64(), b = draw_64() | 1;
        const int64_t c = (int64_t)(draw() & 1 ? a : 0 - a), d = (int64_t)(draw() & 1 ? b : 0 - b);
        const unsigned n = draw() & 63;
        note_64(a / b), note_64(a % b), note_64(a * b), note_64((uint64_t)(c / d)), note_64((uint64_t)(c % d));
        note_64(a << n), note_64(a >> n), note_64((uint64_t)(c >> n)), note_64(a + b), note_64(a - b), note_64(0 - a);
        note((a < b) | (c < d) << 1 | (a == b) << 2 | (c >= d) << 3);
        const uint32_t e = (uint32_t)a, f = (uint32_t)b;
        note(e / f), note(e % f), note((uint32_t)((int32_t)e / ((int32_t)f | 2))), note(e / 10), note(e % 1000);
        note((uint32_t)((int32_t)e / 7)), note(e << (n & 31) | e >> (31 & (32 - n)));
        note_64((uint64_t)e * f), note_64((uint64_t)((int64_t)(int32_t)e * (int32_t)f) + a);
        note((uint32_t)__builtin_clz(f)), note((uint32_t)__builtin_ctz(f)), note((uint32_t)__builtin_popcountll(a));
        note(__builtin_bswap32(e)), note_64(__builtin_bswap64(a)), note((uint32_t)__builtin_parity(e));
        note((uint32_t)(int16_t)e), note((uint8_t)(e >> 8)), note((uint32_t)(int8_t)(e >> 16)), note((uint16_t)f);
        int32_t overflowed;
        note((uint32_t)__builtin_add_overflow((int32_t)e, (int32_t)f, &overflowed)), note((uint32_t)overflowed);
        note((uint32_t)__builtin_mul_overflow((int32_t)e, (int32_t)(f & 0xFFF), &overflowed));
        uint32_t saturated, reversed;
        __asm("ssat %0, #13, %1, asr #3" : "=r"(saturated) : "r"(e));
        __asm("rbit %0, %1" : "=r"(reversed) : "r"(f));
        note(saturated), note(reversed);
    }
    const div_t q = div(-1234567, 89);
    note((uint32_t)q.quot), note((uint32_t)q.rem);
    return report("wide");
}
