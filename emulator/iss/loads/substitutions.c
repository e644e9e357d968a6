/* A block cipher of substitutions and mixed columns, there and back, with tables that it computes
   itself in the field of 256 elements. */

#include "load.inc"

enum { BLOCK = 16, STEPS = 10 };

static uint8_t box[256], unbox[256], keys[STEPS + 1][BLOCK];

static uint8_t doubled(uint8_t x) { return (uint8_t)(x << 1 ^ (x >> 7) * 0x1B); }

static uint8_t product(uint8_t x, uint8_t by) {
    uint8_t sum = 0;
    for (; by; by >>= 1, x = doubled(x))
        if (by & 1) sum ^= x;
    return sum;
}

static void make_boxes(void) {    /* powers of 3 reach all elements but 0 */
    uint8_t powers[256], x = 1;
    for (int i = 0; i < 255; i++) powers[i] = x, x ^= doubled(x);
    powers[255] = 1;
    for (int i = 0; i < 255; i++) {
        const uint8_t inverse = powers[255 - i];
        const uint8_t turned = (uint8_t)(inverse << 1 | inverse >> 7);
        const uint8_t twice = (uint8_t)(inverse << 2 | inverse >> 6);
        box[powers[i]] = inverse ^ turned ^ twice ^ 0x35;
    }
    box[0] = 0x35;
    for (int i = 0; i < 256; i++) unbox[box[i]] = (uint8_t)i;
}

static void mix_columns(uint8_t *block, const uint8_t factors[4]) {
    for (int column = 0; column < BLOCK; column += 4) {
        uint8_t mixed[4];
        for (int row = 0; row < 4; row++) {
            uint8_t sum = 0;
            for (int k = 0; k < 4; k++) sum ^= product(block[column + k], factors[(k - row) & 3]);
            mixed[row] = sum;
        }
        for (int row = 0; row < 4; row++) block[column + row] = mixed[row];
    }
}

static void encipher(uint8_t *block) {
    static const uint8_t factors[4] = {2, 3, 1, 1};
    for (int step = 0; step < STEPS; step++) {
        uint8_t moved[BLOCK];
        for (int i = 0; i < BLOCK; i++) moved[i] = box[block[i * 5 & 15] ^ keys[step][i * 5 & 15]];
        for (int i = 0; i < BLOCK; i++) block[i] = moved[i];
        mix_columns(block, factors);
    }
    for (int i = 0; i < BLOCK; i++) block[i] ^= keys[STEPS][i];
}

static void decipher(uint8_t *block) {
    static const uint8_t factors[4] = {14, 11, 13, 9};
    for (int i = 0; i < BLOCK; i++) block[i] ^= keys[STEPS][i];
    for (int step = STEPS - 1; step >= 0; step--) {
        uint8_t moved[BLOCK];
        mix_columns(block, factors);
        for (int i = 0; i < BLOCK; i++) moved[i * 5 & 15] = (uint8_t)(unbox[block[i]] ^ keys[step][i * 5 & 15]);
        for (int i = 0; i < BLOCK; i++) block[i] = moved[i];
    }
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint32_t sum = 0;
    make_boxes();
    for (int step = 0; step <= STEPS; step++)
        for (int i = 0; i < BLOCK; i++) keys[step][i] = (uint8_t)draw(&seed);
    for (uint32_t round = 0; round < rounds; round++) {
        uint8_t plain[BLOCK], block[BLOCK];
        for (int i = 0; i < BLOCK; i++) block[i] = plain[i] = (uint8_t)draw(&seed);
        encipher(block);
        for (int i = 0; i < BLOCK; i++) sum = mix(sum, block[i]);
        decipher(block);
        for (int i = 0; i < BLOCK; i++)
            if (block[i] != plain[i]) return 0;
    }
    return sum;
}
