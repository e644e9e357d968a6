// The cipher of FIPS 197 on one block, with the key in the form that the accelerator holds: the
// words of the key schedule that the next operation begins with. Encryption takes the first words
// (the key) and leaves the last ones; decryption takes the last ones and leaves the first.
#pragma once

#include <cstdint>

namespace efm32gg::aes_rounds {

// Sixteen bytes in the order of FIPS 197: column by column.
struct Block {
    uint8_t bytes[16];

    uint8_t &operator[](int n) { return bytes[n]; }
    uint8_t operator[](int n) const { return bytes[n]; }
};

struct Tables {
    uint8_t forward[256], inverse[256];

    Tables() {
        // `p` runs through all powers of 3, `q` through their inverses (FIPS 197, 5.1.1).
        uint8_t p = 1, q = 1;
        do {
            p = (uint8_t)(p ^ p << 1 ^ (p & 0x80 ? 0x1B : 0));
            q ^= (uint8_t)(q << 1);
            q ^= (uint8_t)(q << 2);
            q ^= (uint8_t)(q << 4);
            q ^= q & 0x80 ? 0x09 : 0;
            uint8_t s = 0x63;
            for (int n = 0; n < 5; n++)
                s ^= (uint8_t)(q << n | q >> (8 - n));
            forward[p] = s;
        } while (p != 1);
        forward[0] = 0x63;
        for (int n = 0; n < 256; n++)
            inverse[forward[n]] = (uint8_t)n;
    }
};

inline const Tables &tables() {
    static const Tables made;
    return made;
}

constexpr uint8_t twice(uint8_t a) { return (uint8_t)(a << 1 ^ (a & 0x80 ? 0x1B : 0)); }

constexpr uint8_t product(uint8_t a, uint8_t b) {
    uint8_t sum = 0;
    for (; b; b >>= 1, a = twice(a))
        if (b & 1)
            sum ^= a;
    return sum;
}

// The key schedule for keys of `length` words, 4 or 8; words are big-endian.
class Schedule {
public:
    explicit Schedule(int length) : length(length), rounds(length + 6) {}

    // Expands from the first words, or back from the last ones.
    void expand(const uint32_t *first) {
        for (int n = 0; n < length; n++)
            words[n] = first[n];
        for (int n = length; n < count(); n++)
            words[n] = words[n - length] ^ change(n);
    }
    void expand_back(const uint32_t *last) {
        for (int n = 0; n < length; n++)
            words[count() - length + n] = last[n];
        for (int n = count() - 1; n >= length; n--)
            words[n - length] = words[n] ^ change(n);
    }

    const uint32_t *first() const { return words; }
    const uint32_t *last() const { return words + count() - length; }

    Block encrypt(Block state) const {
        add(state, 0);
        for (int round = 1; round <= rounds; round++) {
            substitute(state, tables().forward);
            shift(state, 1);
            if (round < rounds)
                mix(state, 2, 3, 1, 1);
            add(state, round);
        }
        return state;
    }

    Block decrypt(Block state) const {
        add(state, rounds);
        for (int round = rounds - 1; round >= 0; round--) {
            shift(state, 3);
            substitute(state, tables().inverse);
            add(state, round);
            if (round)
                mix(state, 14, 11, 13, 9);
        }
        return state;
    }

private:
    const int length, rounds;
    uint32_t words[60] = {};

    int count() const { return 4 * (rounds + 1); }

    static uint32_t substituted(uint32_t word) {
        uint32_t result = 0;
        for (int n = 0; n < 32; n += 8)
            result |= (uint32_t)tables().forward[word >> n & 0xFF] << n;
        return result;
    }

    // What word n differs by from the one `length` before it (FIPS 197, 5.2).
    uint32_t change(int n) const {
        const uint32_t before = words[n - 1];
        if (n % length == 0) {
            uint8_t constant = 1;
            for (int k = length; k < n; k += length)
                constant = twice(constant);
            return substituted(before << 8 | before >> 24) ^ (uint32_t)constant << 24;
        }
        return length == 8 && n % 8 == 4 ? substituted(before) : before;
    }

    void add(Block &state, int round) const {
        for (int n = 0; n < 16; n++)
            state[n] ^= (uint8_t)(words[4 * round + n / 4] >> (24 - n % 4 * 8));
    }

    static void substitute(Block &state, const uint8_t *table) {
        for (uint8_t &one : state.bytes)
            one = table[one];
    }

    // Rotates row r to the left by `step` * r columns.
    static void shift(Block &state, int step) {
        const Block old = state;
        for (int n = 0; n < 16; n++)
            state[n] = old[(n / 4 + step * (n % 4)) % 4 * 4 + n % 4];
    }

    static void mix(Block &state, uint8_t a, uint8_t b, uint8_t c, uint8_t d) {
        const Block old = state;
        const uint8_t row[] = {a, b, c, d};
        for (int n = 0; n < 16; n++) {
            uint8_t sum = 0;
            for (int k = 0; k < 4; k++)
                sum ^= product(old[n / 4 * 4 + k], row[(k - n % 4 + 4) % 4]);
            state[n] = sum;
        }
    }
};

}  // namespace efm32gg::aes_rounds
