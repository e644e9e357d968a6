// Loops of background.py; shapes and units are those of the Python form.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

namespace background {

constexpr int64_t CELL = 32, BLOCK = 8, UNIT = 16;

// The cell before a place, and the distance of the place from its middle.
struct Between {
    int64_t before, away;
    Between(int64_t place, int64_t count) {
        int64_t cell = (place - CELL / 2) >> 5;  // rounds down
        before = std::min(std::max(cell, int64_t(0)), count - 2);
        away = place - CELL / 2 - before * CELL;
    }
};

}  // namespace background

extern "C" {

// Pixels above the level by `sigmas` of the noise and by `least`; bright: (height, width).
int64_t sky_brighter(const uint8_t* picture, int64_t height, int64_t width, const int64_t* levels,
                     const int64_t* noises, int64_t down, int64_t across, double sigmas,
                     int64_t least, uint8_t* bright) {
    using namespace background;
    const int64_t blocks = (width + BLOCK - BLOCK / 2 + BLOCK - 1) / BLOCK;
    std::vector<Between> columns;
    for (int64_t block = 0; block < blocks; block++)
        columns.emplace_back(BLOCK / 2 + block * BLOCK, across);
    std::vector<int64_t> level(across), noise(across);
    std::vector<uint8_t> thresholds(blocks * BLOCK);
    for (int64_t y = 0; y < height; y++) {
        const Between row(y, down);
        const int64_t* upper_level = levels + row.before * across;
        const int64_t* upper_noise = noises + row.before * across;
        for (int64_t x = 0; x < across; x++) {
            level[x] = upper_level[x] * (CELL - row.away) + upper_level[across + x] * row.away;
            noise[x] = upper_noise[x] * (CELL - row.away) + upper_noise[across + x] * row.away;
        }
        for (int64_t block = 0; block < blocks; block++) {
            const Between& at = columns[block];
            const int64_t n = at.before;
            const int64_t sky = (level[n] * (CELL - at.away) + level[n + 1] * at.away) >> 10;
            const int64_t spread = (noise[n] * (CELL - at.away) + noise[n + 1] * at.away) >> 10;
            const double above = std::max(sigmas * double(spread), double(least));
            const double limit = std::floor((double(sky) + above) / double(UNIT));
            std::memset(&thresholds[block * BLOCK], int(std::min(std::max(limit, 0.0), 255.0)),
                        BLOCK);
        }
        const uint8_t* pixels = picture + y * width;
        uint8_t* marks = bright + y * width;
        for (int64_t x = 0; x < width; x++) marks[x] = pixels[x] > thresholds[x];
    }
    return 0;
}

// Sums of the middle half of each cell's samples, and of its smaller differences. `totals`: bins
// added up, and samples at the end of the scale.
int64_t sky_estimate(const uint8_t* samples, int64_t down, int64_t across, int64_t side,
                     int64_t* middle, int64_t* smaller, int64_t* totals) {
    const int64_t count = side * side, pairs = side * (side - 1), width = across * side;
    int64_t bins = 0, full = 0;
    for (int64_t cell = 0; cell < down * across; cell++) {
        const uint8_t* first = samples + cell / across * side * width + cell % across * side;
        uint32_t values[256] = {}, differences[256] = {};
        for (int64_t y = 0; y < side; y++, first += width) {
            values[first[0]]++;
            for (int64_t x = 1; x < side; x++) {
                values[first[x]]++;
                differences[std::abs(int(first[x]) - int(first[x - 1]))]++;
            }
        }
        // Sum of the sorted values from one place to another, and the values at places.
        int64_t at = 0, sum = 0, lowest = -1, quartile = -1;
        for (int64_t value = 0; value < 256; value++) {
            const int64_t next = at + values[value];
            const int64_t from = std::max(at, count / 4), to = std::min(next, 3 * count / 4);
            if (to > from) sum += (to - from) * value;
            if (lowest < 0 && next > 0) lowest = value;
            if (quartile < 0 && next > 3 * count / 4) quartile = value;
            at = next;
        }
        middle[cell] = sum;
        full += values[255];
        bins += quartile - lowest;
        at = sum = 0;
        quartile = -1;
        for (int64_t value = 0; value < 256 && quartile < 0; value++) {
            const int64_t next = at + differences[value], to = std::min(next, 3 * pairs / 4);
            if (to > at) sum += (to - at) * value;
            if (next > 3 * pairs / 4) quartile = value;
            at = next;
        }
        smaller[cell] = sum;
        bins += quartile;
    }
    totals[0] = bins + 2 * down * across;
    totals[1] = full;
    return 0;
}

}
