/* A load is a function of a seed and a number of rounds; the sum it returns depends on every step. Each
   compiles for the part and for the machine at hand, where the sum must be the same. */

#include <stdint.h>

uint32_t load(uint32_t seed, uint32_t rounds);

static inline uint32_t draw(uint32_t *state) {    /* xorshift; the state is never 0 */
    uint32_t x = *state;
    x ^= x << 13, x ^= x >> 17, x ^= x << 5;
    return *state = x;
}
static inline uint32_t mix(uint32_t sum, uint32_t value) { return (sum ^ value) * 16777619u; }
