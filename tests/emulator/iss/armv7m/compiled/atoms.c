/* C11 atomics (exclusive accesses), volatile and unaligned accesses, the heap, own vectors of bits. */
#include "report.h"
#include <stdatomic.h>
#include <stdlib.h>

static _Atomic uint32_t words[4];
static _Atomic uint16_t halves[4];
static _Atomic uint8_t bytes[4];
static atomic_flag lock = ATOMIC_FLAG_INIT;

int main(void) {
    for (int i = 0; i < 300; i++) {
        const uint32_t v = draw();
        const int k = i & 3;
        note(atomic_fetch_add(&words[k], v)), note(atomic_fetch_xor(&halves[k], (uint16_t)v));
        note(atomic_fetch_sub(&bytes[k], (uint8_t)v)), note(atomic_exchange(&words[k ^ 1], v >> 3));
        uint32_t expected = i & 4 ? words[k] : v;
        note(atomic_compare_exchange_strong(&words[k], &expected, ~v)), note(expected);
        note(atomic_flag_test_and_set(&lock));
        if (i % 3) atomic_flag_clear(&lock);
        atomic_thread_fence(memory_order_seq_cst);
    }
    static uint8_t buffer[64];
    for (int i = 0; i < 400; i++) {
        const unsigned at = draw() % 50;
        uint32_t w;
        uint16_t h;
        memcpy(&w, buffer + at, 4), memcpy(&h, buffer + at + 5, 2);
        w += draw(), h ^= (uint16_t)w;
        memcpy(buffer + at + 1, &w, 4), memcpy(buffer + at + 3, &h, 2);
        note(w ^ h);
    }
    void *blocks[24] = {0};
    for (int i = 0; i < 300; i++) {
        const unsigned k = draw() % 24;
        if (blocks[k]) { note(*(uint32_t *)blocks[k]), free(blocks[k]), blocks[k] = NULL; continue; }
        const unsigned size = 4 + draw() % 200;
        blocks[k] = i & 1 ? calloc(1, size) : malloc(size);
        note((uint32_t)(uintptr_t)blocks[k]);
        memset(blocks[k], (int)k, size);
        if (!(i % 7)) blocks[k] = realloc(blocks[k], size * 2);
    }
    static uint32_t sieve[64];
    for (unsigned n = 2; n < 2048; n++) {
        if (sieve[n / 32] >> n % 32 & 1) continue;
        note(n);
        for (unsigned k = n * n; k < 2048; k += n) sieve[k / 32] |= 1u << k % 32;
    }
    return report("atoms");
}
