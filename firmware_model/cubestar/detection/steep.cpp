// Loop of steep.py; shapes and units are those of the Python form.

#include <algorithm>
#include <cmath>
#include <cstdint>

extern "C" {

// Marked pixels that exceed their row, with level and noise there; returns their number.
int64_t steep_along_rows(const uint8_t* picture, const uint8_t* marks, int64_t height,
                         int64_t width, int64_t reach, int64_t unit, int64_t sigmas, double per_dn,
                         int64_t blind, int64_t dark, int64_t least, int64_t* places,
                         int64_t most) {
    int64_t found = 0;
    for (int64_t y = 0; y < height; y++) {
        const uint8_t* row = picture + y * width;
        const uint8_t* marked = marks + y * width;
        for (int64_t x = 0; x < width; x++) {
            if (!marked[x]) continue;
            const int64_t one = row[std::max(x - reach, int64_t(0))];
            const int64_t other = row[std::min(x + reach, width - 1)];
            const int64_t level = (one + other + 1) / 2 * unit, signal = unit * row[x] - level;
            if (signal <= least || level >= blind) continue;
            const double light = double(unit * level) / per_dn;
            const int64_t noise = int64_t(std::sqrt(1.5 * (double(dark * dark) + light)));
            if (signal <= sigmas * noise) continue;
            places[found] = y;
            places[most + found] = x;
            places[2 * most + found] = level;
            places[3 * most + found] = noise;
            found++;
        }
    }
    return found;
}

}
