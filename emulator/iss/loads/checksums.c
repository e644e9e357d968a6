/* CRC-32 by table and SHA-256 blocks. */

#include "load.inc"

static uint32_t table[256];

static uint32_t turn(uint32_t x, int n) { return x >> n | x << (32 - n); }

static uint32_t constant(uint32_t i) {    /* any fixed words do for a load */
    uint32_t state = i * 2654435761u + 1;
    return draw(&state);
}

static void compress(uint32_t *h, const uint8_t *block) {
    uint32_t w[64], v[8];
    for (int i = 0; i < 16; i++)
        w[i] = (uint32_t)block[4 * i] << 24 | (uint32_t)block[4 * i + 1] << 16 |
               (uint32_t)block[4 * i + 2] << 8 | block[4 * i + 3];
    for (int i = 16; i < 64; i++)
        w[i] = w[i - 16] + (turn(w[i - 15], 7) ^ turn(w[i - 15], 18) ^ w[i - 15] >> 3) + w[i - 7] +
               (turn(w[i - 2], 17) ^ turn(w[i - 2], 19) ^ w[i - 2] >> 10);
    for (int i = 0; i < 8; i++) v[i] = h[i];
    for (int i = 0; i < 64; i++) {
        const uint32_t e = v[4], a = v[0];
        const uint32_t t = v[7] + (turn(e, 6) ^ turn(e, 11) ^ turn(e, 25)) +
                           ((e & v[5]) ^ (~e & v[6])) + constant((uint32_t)i & 3) + w[i];
        const uint32_t u = (turn(a, 2) ^ turn(a, 13) ^ turn(a, 22)) +
                           ((a & v[1]) ^ (a & v[2]) ^ (v[1] & v[2]));
        for (int k = 7; k > 0; k--) v[k] = v[k - 1];
        v[4] += t, v[0] = t + u;
    }
    for (int i = 0; i < 8; i++) h[i] += v[i];
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint32_t h[8] = {1, 2, 3, 4, 5, 6, 7, 8}, crc = ~0u;
    uint8_t block[64];
    for (uint32_t i = 0; i < 256; i++) {
        uint32_t c = i;
        for (int k = 0; k < 8; k++) c = c >> 1 ^ (c & 1 ? 0xEDB88320u : 0);
        table[i] = c;
    }
    for (uint32_t round = 0; round < rounds; round++) {
        for (int i = 0; i < 64; i++) block[i] = (uint8_t)draw(&seed);
        for (int k = 0; k < 8; k++)
            for (int i = 0; i < 64; i++) crc = crc >> 8 ^ table[(crc ^ block[i]) & 0xFF];
        compress(h, block);
    }
    return crc ^ h[0] ^ h[5];
}
