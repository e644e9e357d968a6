// Loops of sampled.py and of detect_stars; shapes and rules are those of the Python form.

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

namespace sampled {

struct Config {
    int64_t step, x_start, x_end, y_start, y_end, seed_threshold, star_threshold, min_pixels,
        max_pixels, half, max_stars, max_invalid, max_noise, floor;
};

struct Counts {
    int64_t end, invalid, noise, stars, read, background, total, visited, tests, areas, star_pixels;
};

enum End { COMPLETE, STARS, INVALID, NOISE };

struct Search {
    uint8_t* pixels;
    int64_t rows, columns;
    const Config& config;
    std::vector<int64_t> offsets, stack;
    std::vector<int64_t> values;

    void join(int64_t place) {
        offsets.push_back(place);
        values.push_back(pixels[place]);
        pixels[place] = 0;
        const int64_t column = place % columns;
        if (place + columns < columns * rows) stack.push_back(place + columns);
        if (place >= columns) stack.push_back(place - columns);
        if (column < columns - 1) stack.push_back(place + 1);
        if (column > 0) stack.push_back(place - 1);
    }

    // Collects the seed's area; returns whether it is complete.
    bool grow(int64_t seed, int64_t& tests) {
        offsets.clear(), values.clear(), stack.clear();
        join(seed);
        while (!stack.empty()) {
            const int64_t place = stack.back();
            stack.pop_back();
            tests++;
            if (pixels[place] <= config.star_threshold) continue;
            if (int64_t(offsets.size()) == config.max_pixels) return false;
            join(place);
        }
        return true;
    }

    void centroid(float* place) const {
        const int64_t peak = *std::max_element(values.begin(), values.end());
        int64_t tied = 0, all_y = 0, all_x = 0, sum_x = 0, sum_y = 0, weight = 0;
        for (size_t n = 0; n < values.size(); n++) {
            if (values[n] != peak) continue;
            tied++;
            all_y += offsets[n] / columns;
            all_x += offsets[n] % columns;
        }
        const int64_t middle_y = (2 * all_y + tied) / (2 * tied);
        const int64_t middle_x = (2 * all_x + tied) / (2 * tied);
        for (size_t n = 0; n < values.size(); n++) {
            const int64_t y = offsets[n] / columns - middle_y, x = offsets[n] % columns - middle_x;
            if (std::abs(y) > config.half || std::abs(x) > config.half) continue;
            const int64_t above = values[n] - config.floor;
            sum_x += above * x;
            sum_y += above * y;
            weight += above;
        }
        place[0] = float(middle_x) + float(sum_x) / float(weight);
        place[1] = float(middle_y) + float(sum_y) / float(weight);
    }
};

}  // namespace sampled

extern "C" {

// The whole search. `pixels` is changed; centroids (max_stars, 2), sizes and sums (max_stars,).
int64_t sampled_search(uint8_t* pixels, int64_t rows, int64_t columns, const int64_t* settings,
                       float* centroids, int64_t* sizes, int64_t* sums, int64_t* counted) {
    using namespace sampled;
    const Config& config = *reinterpret_cast<const Config*>(settings);
    Counts& count = *reinterpret_cast<Counts*>(counted);
    Search search{pixels, rows, columns, config, {}, {}, {}};
    count = {};
    for (int64_t y = config.y_start; y < config.y_end; y += config.step)
        for (int64_t x = config.x_start; x < config.x_end; x += config.step) {
            const int64_t place = y * columns + x, value = pixels[place];
            count.read++;
            if (value <= config.seed_threshold) {
                count.total += value;
                count.background++;
                continue;
            }
            const bool complete = search.grow(place, count.tests);
            const int64_t size = search.offsets.size();
            count.areas++;
            count.visited += size;
            if (!complete) {
                count.invalid++;
            } else if (size < config.min_pixels) {
                count.noise++;
            } else {
                search.centroid(centroids + 2 * count.stars);
                sizes[count.stars] = size;
                sums[count.stars] = 0;
                for (const int64_t one : search.values) sums[count.stars] += one;
                count.stars++;
                count.star_pixels += size;
            }
            if (count.stars == config.max_stars) count.end = STARS;
            else if (count.invalid > config.max_invalid) count.end = INVALID;
            else if (count.noise > config.max_noise) count.end = NOISE;
            if (count.end != COMPLETE) return 0;
        }
    return 0;
}

// Values of pixels up to and including the first above `above`; returns their number.
int64_t look_at(const uint8_t* pixels, const int32_t* offsets, int64_t count, int64_t above,
                uint8_t* values) {
    if (above >= 255) {
        for (int64_t n = 0; n < count; n++) values[n] = pixels[offsets[n]];
        return count;
    }
    for (int64_t n = 0; n < count; n++)
        if ((values[n] = pixels[offsets[n]]) > above) return n + 1;
    return count;
}

}
