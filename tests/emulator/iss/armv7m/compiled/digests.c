/* CRC-32, SHA-256, RC4, Adler, base 64, run lengths: loops over bytes and words. */
#include "report.h"

static uint8_t data[700];
static uint32_t rotate(uint32_t x, int n) { return x >> n | x << (32 - n); }

static void sha_256(const uint8_t *message, unsigned length, uint32_t h[8]) {
    static uint32_t k[64];
    unsigned found = 0;
    for (unsigned n = 2; found < 64; n++) {
        unsigned d = 2;
        while (d * d <= n && n % d) d++;
        if (d * d <= n) continue;
        /* fractional bits of the cube root of n, by bisection in 64 bits */
        uint64_t low = 0, high = (uint64_t)1 << 35;
        while (high - low > 1) {
            const uint64_t middle = (low + high) / 2;
            const double r = (double)middle / 4294967296.0;
            if (r * r * r <= n) low = middle; else high = middle;
        }
        k[found++] = (uint32_t)low;
    }
    for (int i = 0; i < 8; i++) h[i] = 0x6A09E667u * (uint32_t)(i + 1);
    for (unsigned block = 0; block + 64 <= length; block += 64) {
        uint32_t w[64], s[8];
        for (int i = 0; i < 16; i++) memcpy(&w[i], message + block + 4 * i, 4), w[i] = __builtin_bswap32(w[i]);
        for (int i = 16; i < 64; i++)
            w[i] = w[i - 16] + w[i - 7] + (rotate(w[i - 15], 7) ^ rotate(w[i - 15], 18) ^ w[i - 15] >> 3) +
                   (rotate(w[i - 2], 17) ^ rotate(w[i - 2], 19) ^ w[i - 2] >> 10);
        memcpy(s, h, sizeof s);
        for (int i = 0; i < 64; i++) {
            const uint32_t t = s[7] + (rotate(s[4], 6) ^ rotate(s[4], 11) ^ rotate(s[4], 25)) +
                               ((s[4] & s[5]) ^ (~s[4] & s[6])) + k[i] + w[i];
            const uint32_t u = (rotate(s[0], 2) ^ rotate(s[0], 13) ^ rotate(s[0], 22)) +
                               ((s[0] & s[1]) ^ (s[0] & s[2]) ^ (s[1] & s[2]));
            memmove(s + 1, s, 28);
            s[4] += t, s[0] = t + u;
        }
        for (int i = 0; i < 8; i++) h[i] += s[i];
    }
}

int main(void) {
    for (unsigned i = 0; i < sizeof data; i++) data[i] = (uint8_t)(draw() >> (i % 24));
    uint32_t crc = ~0u, a = 1, b = 0, h[8];
    for (unsigned i = 0; i < sizeof data; i++) {
        crc ^= data[i];
        for (int k = 0; k < 8; k++) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
        a = (a + data[i]) % 65521, b = (b + a) % 65521;
    }
    printf("%08lx %08lx\n", (unsigned long)~crc, (unsigned long)(b << 16 | a));
    sha_256(data, 640, h);
    for (int i = 0; i < 8; i++) printf("%08lx", (unsigned long)h[i]);
    uint8_t s[256], j = 0;
    for (int i = 0; i < 256; i++) s[i] = (uint8_t)i;
    for (int i = 0; i < 256; i++) { j = (uint8_t)(j + s[i] + data[i % 16]); const uint8_t t = s[i]; s[i] = s[j], s[j] = t; }
    uint8_t x = 0, y = 0;
    for (unsigned i = 0; i < sizeof data; i++) {
        x++, y = (uint8_t)(y + s[x]);
        const uint8_t t = s[x];
        s[x] = s[y], s[y] = t;
        data[i] ^= s[(uint8_t)(s[x] + s[y])];
        note(data[i]);
    }
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    putchar('\n');
    for (unsigned i = 0; i < 60; i += 3) {
        const uint32_t v = (uint32_t)data[i] << 16 | data[i + 1] << 8 | data[i + 2];
        for (int k = 18; k >= 0; k -= 6) putchar(letters[v >> k & 63]);
    }
    putchar('\n');
    return report("digests");
}
