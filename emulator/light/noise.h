// Normal numbers from counters, as noise.py defines them.
//
// Salmon et al., "Parallel random numbers: as easy as 1, 2, 3" (SC11), section 3.3: Philox4x64-10.

#pragma once

#include <cstdint>
#include <cstring>

namespace light {

// Level and slope of a linear piece of the inverse distribution function.
struct Piece {
    float level, slope;
};

struct NoiseSource {
    uint64_t key[2];
    const Piece *pieces;
    int32_t shift, first;  // from the bits of a tail's float to the number of its piece
};

constexpr int NUMBERS_OF_BLOCK = 8;

// The eight numbers of 32 bits of a block; NumPy's stream begins with counter 1.
inline void philox(const NoiseSource &source, uint64_t block, uint32_t *numbers) {
    uint64_t a = block + 1, b = 0, c = 0, d = 0;
    uint64_t key_0 = source.key[0], key_1 = source.key[1];
    for (int round = 0; round < 10; ++round) {
        const unsigned __int128 of_a = (unsigned __int128)0xD2E7470EE14C6C93 * a;
        const unsigned __int128 of_c = (unsigned __int128)0xCA5A826395121157 * c;
        a = (uint64_t)(of_c >> 64) ^ b ^ key_0;
        b = (uint64_t)of_c;
        c = (uint64_t)(of_a >> 64) ^ d ^ key_1;
        d = (uint64_t)of_a;
        key_0 += 0x9E3779B97F4A7C15;  // the golden ratio
        key_1 += 0xBB67AE8584CAA73B;  // the root of three, minus one
    }
    const uint64_t words[] = {a, b, c, d};
    for (int n = 0; n < 4; ++n) {
        numbers[2 * n] = (uint32_t)words[n];
        numbers[2 * n + 1] = (uint32_t)(words[n] >> 32);
    }
}

// The normal number of 32 uniform bits.
inline float normal(const NoiseSource &source, uint32_t number) {
    const float tail = (float)(int32_t)(number & 0x7FFFFFFF) + 0.5f;
    int32_t bits;
    std::memcpy(&bits, &tail, sizeof bits);
    const Piece piece = source.pieces[(bits >> source.shift) - source.first];
    const float size = piece.slope * tail + piece.level;
    uint32_t value;
    std::memcpy(&value, &size, sizeof value);
    value ^= number & 0x80000000;
    float signed_size;
    std::memcpy(&signed_size, &value, sizeof signed_size);
    return signed_size;
}

}  // namespace light
