/* Signal processing in integers: FIR, biquad, and a cosine transform of 4 x 4. */

#include "load.inc"

enum { SAMPLES = 128, TAPS = 16 };

static int16_t samples[SAMPLES + TAPS], filtered[SAMPLES];
static int16_t taps[TAPS];

static uint32_t fir(void) {
    uint32_t sum = 0;
    for (int i = 0; i < SAMPLES; i++) {
        int32_t total = 0;
        for (int k = 0; k < TAPS; k++) total += samples[i + k] * taps[k];
        filtered[i] = (int16_t)(total >> 12), sum = mix(sum, (uint32_t)total);
    }
    return sum;
}

static uint32_t biquad(void) {
    int32_t x1 = 0, x2 = 0, y1 = 0, y2 = 0;
    for (int i = 0; i < SAMPLES; i++) {
        const int32_t x = filtered[i];
        const int64_t y = (int64_t)3000 * x + (int64_t)5000 * x1 + (int64_t)2900 * x2 +
                          (int64_t)9000 * y1 - (int64_t)4000 * y2;
        x2 = x1, x1 = x, y2 = y1, y1 = (int32_t)(y >> 14);
        if (y1 > 32767) y1 = 32767;
        if (y1 < -32768) y1 = -32768;
    }
    return (uint32_t)y1;
}

static uint32_t cosine(void) {
    static const int16_t basis[4][4] = {
        {64, 64, 64, 64}, {83, 36, -36, -83}, {64, -64, -64, 64}, {36, -83, 83, -36}};
    uint32_t sum = 0;
    for (int at = 0; at + 16 <= SAMPLES; at += 16) {
        int32_t half[4][4];
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 4; k++) {
                int32_t total = 0;
                for (int j = 0; j < 4; j++) total += basis[i][j] * filtered[at + 4 * j + k];
                half[i][k] = total >> 6;
            }
        for (int i = 0; i < 4; i++)
            for (int k = 0; k < 4; k++) {
                int32_t total = 0;
                for (int j = 0; j < 4; j++) total += half[i][j] * basis[k][j];
                sum = mix(sum, (uint32_t)(total / (3 + i + k)));
            }
    }
    return sum;
}

uint32_t load(uint32_t seed, uint32_t rounds) {
    uint32_t sum = 0;
    for (int i = 0; i < TAPS; i++) taps[i] = (int16_t)((draw(&seed) & 0x3FF) - 0x200);
    for (uint32_t round = 0; round < rounds; round++) {
        for (int i = 0; i < SAMPLES + TAPS; i++) samples[i] = (int16_t)((draw(&seed) & 0xFFF) - 0x800);
        sum = mix(sum, fir());
        sum = mix(sum, biquad());
        sum = mix(sum, cosine());
    }
    return sum;
}
