/* Numbers of many words: products modulo a 256-bit number in Montgomery's form, greatest common
   divisors in 64 bits, and a hash of four words with additions and rotations. */

#include "load.inc"

enum { WORDS = 8 };

static uint32_t modulus[WORDS];

static uint32_t negative_inverse(uint32_t odd) {    /* -1 / odd modulo 2^32, by Newton */
    uint32_t x = odd;
    for (int i = 0; i < 5; i++) x *= 2 - odd * x;
    return 0 - x;
}

static void multiply(uint32_t *result, const uint32_t *a, const uint32_t *b, uint32_t inverse) {
    uint32_t t[WORDS + 2] = {0};
    for (int i = 0; i < WORDS; i++) {
        uint64_t carry = 0;
        for (int k = 0; k < WORDS; k++) {
            carry += (uint64_t)a[i] * b[k] + t[k];
            t[k] = (uint32_t)carry, carry >>= 32;
        }
        carry += t[WORDS], t[WORDS] = (uint32_t)carry, t[WORDS + 1] = (uint32_t)(carry >> 32);
        const uint32_t factor = t[0] * inverse;
        carry = ((uint64_t)factor * modulus[0] + t[0]) >> 32;
        for (int k = 1; k < WORDS; k++) {
            carry += (uint64_t)factor * modulus[k] + t[k];
            t[k - 1] = (uint32_t)carry, carry >>= 32;
        }
        carry += t[WORDS], t[WORDS - 1] = (uint32_t)carry;
        t[WORDS] = t[WORDS + 1] + (uint32_t)(carry >> 32);
    }
    int64_t borrow = 0;
    uint32_t less[WORDS];
    for (int k = 0; k < WORDS; k++) {
        borrow += (int64_t)t[k] - modulus[k];
        less[k] = (uint32_t)borrow, borrow >>= 32;
    }
    const int below = borrow + (int64_t)t[WORDS] < 0;
    for (int k = 0; k < WORDS; k++) result[k] = below ? t[k] : less[k];
}

static uint32_t divisor(uint64_t a, uint64_t b) {
    while (b) {
        while (!(b & 1)) b >>= 1;
        if (a > b) {
            const uint64_t other = a;
            a = b, b = other;
        }
        b -= a;
    }
    return (uint32_t)a;
}

static void hash(uint32_t *h, const uint32_t *words) {
    uint32_t a = h[0], b = h[1], c = h[2], d = h[3];
    for (uint32_t i = 0; i < 48; i++) {
        const uint32_t chosen = i < 16 ? (b & c) | (~b & d) : i < 32 ? b ^ c ^ d : c ^ (b | ~d);
        const uint32_t x = a + chosen + words[(i * 5 + i / 16) & 15] + i * 0x9E3779B9u;
        const uint32_t turn = 5 + 4 * (i & 3);
        a = d, d = c, c = b, b += x << turn | x >> (32 - turn);
    }
    h[0] += a, h[1] += b, h[2] += c, h[3] += d;
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint32_t power[WORDS], words[16], h[4] = {1, 2, 3, 4}, sum = 0;
    for (int i = 0; i < WORDS; i++) modulus[i] = draw(&seed), power[i] = draw(&seed);
    modulus[0] |= 1, modulus[WORDS - 1] |= 1u << 31, power[WORDS - 1] >>= 1;
    const uint32_t inverse = negative_inverse(modulus[0]);
    for (uint32_t round = 0; round < rounds; round++) {
        for (int i = 0; i < 8; i++) multiply(power, power, power, inverse);
        for (int i = 0; i < 16; i++) words[i] = draw(&seed);
        hash(h, words);
        const uint64_t first = (uint64_t)words[0] << 32 | words[1] | 1;
        sum = mix(sum, divisor(first, (uint64_t)words[2] << 32 | words[3] | 1) ^ power[0] ^ h[0]);
    }
    return sum;
}
