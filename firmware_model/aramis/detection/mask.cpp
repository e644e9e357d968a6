// Loops of mask.py; shapes are those of the Python form.

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

namespace mask {

constexpr int64_t WINDOW = 5, HALF = WINDOW / 2;

// Bright pixels that a window of `pixels` needs, where one of 25 needs `needed`.
int64_t least_of(int64_t pixels, int64_t needed) {
    return std::max((needed * pixels + WINDOW * WINDOW - 1) / (WINDOW * WINDOW), int64_t(0));
}

}  // namespace mask

extern "C" {

// Pixels of each grey level (256,) where the field is.
int64_t mask_levels(const uint8_t* picture, const uint8_t* field, int64_t size, int64_t* levels) {
    std::vector<int64_t> counts(4 * 256);
    int64_t at = 0;
    for (; at + 8 <= size; at += 8) {
        uint64_t inside;
        std::memcpy(&inside, field + at, 8);
        if (!inside) continue;
        for (int64_t n = 0; n < 8; n++) counts[n % 4 * 256 + picture[at + n]] += field[at + n];
    }
    for (; at < size; at++) counts[picture[at]] += field[at];
    for (int64_t level = 0; level < 256; level++) {
        levels[level] = 0;
        for (int64_t n = 0; n < 4; n++) levels[level] += counts[n * 256 + level];
    }
    return 0;
}

// Method 1: which pixels are the middle of a window with enough bright ones.
int64_t mask_centre(const uint8_t* bright, int64_t rows, int64_t columns, int64_t needed,
                    uint8_t* stars) {
    using namespace mask;
    std::vector<uint8_t> padded(columns + 2 * HALF), least(columns);
    uint8_t* down = padded.data() + HALF;
    int64_t before = -1;
    for (int64_t y = 0; y < rows; y++) {
        const int64_t top = std::max(y - HALF, int64_t(0)), end = std::min(y + HALF + 1, rows);
        if (end - top != before) {
            before = end - top;
            for (int64_t x = 0; x < columns; x++) {
                const int64_t wide =
                    std::min(x + HALF + 1, columns) - std::max(x - HALF, int64_t(0));
                least[x] = uint8_t(std::min(least_of(before * wide, needed), int64_t(255)));
            }
        }
        std::memset(down, 0, columns);
        for (int64_t row = top; row < end; row++) {
            const uint8_t* marks = bright + row * columns;
            for (int64_t x = 0; x < columns; x++) down[x] += marks[x];
        }
        uint8_t* found = stars + y * columns;
        for (int64_t x = 0; x < columns; x++) {
            const uint8_t sum = down[x - 2] + down[x - 1] + down[x] + down[x + 1] + down[x + 2];
            found[x] = sum >= least[x];
        }
    }
    return 0;
}

// Method 2: the bright pixels of windows with enough of them; returns the windows cleared.
int64_t mask_window(const uint8_t* bright, int64_t rows, int64_t columns, int64_t needed,
                    uint8_t* stars) {
    using namespace mask;
    int64_t cleared = 0;
    std::vector<uint8_t> down(columns);
    std::memcpy(stars, bright, rows * columns);
    for (int64_t top = 0; top < rows; top += WINDOW) {
        const int64_t end = std::min(top + WINDOW, rows);
        std::fill(down.begin(), down.end(), 0);
        for (int64_t y = top; y < end; y++)
            for (int64_t x = 0; x < columns; x++) down[x] += bright[y * columns + x];
        for (int64_t left = 0; left < columns; left += WINDOW) {
            const int64_t right = std::min(left + WINDOW, columns);
            int64_t sum = 0;
            for (int64_t x = left; x < right; x++) sum += down[x];
            if (!sum || sum >= least_of((end - top) * (right - left), needed)) continue;
            cleared++;
            for (int64_t y = top; y < end; y++)
                std::memset(stars + y * columns + left, 0, right - left);
        }
    }
    return cleared;
}

}
