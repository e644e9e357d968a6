/* A generator of numbers, and a running sum of results that a program prints at its end. */

#include <stdint.h>
#include <stdio.h>
#include <string.h>

static uint32_t seed = 12345;
static inline uint32_t draw(void) {
    seed ^= seed << 13, seed ^= seed >> 17, seed ^= seed << 5;
    return seed;
}
static uint32_t sum = 2166136261u;
static inline void note(uint32_t value) { sum = (sum ^ value) * 16777619u; }
static inline void note_64(uint64_t value) { note((uint32_t)value), note((uint32_t)(value >> 32)); }
static inline void note_double(double value) {
    uint64_t bits;
    memcpy(&bits, &value, 8);
    note_64(bits);
}
static inline void note_float(float value) {
    uint32_t bits;
    memcpy(&bits, &value, 4);
    note(bits);
}
static inline int report(const char *name) { return printf("%s %08lx\n", name, (unsigned long)sum) < 0; }
