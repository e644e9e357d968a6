// Loops of regions.py; shapes are those of the Python form.

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <vector>

namespace regions {

int64_t root_of(std::vector<int64_t>& parents, int64_t run) {
    while (parents[run] != run) run = parents[run] = parents[parents[run]];
    return run;
}

}  // namespace regions

extern "C" {

// First places of marks and places behind them, in turn, as if `gap` dark pixels followed each row;
// at most `most` of them. Returns their number, also if there are more.
int64_t runs_of(const uint8_t* bright, int64_t rows, int64_t columns, int64_t gap, int64_t* edges,
                int64_t most) {
    int64_t found = 0;
    const auto note = [&](int64_t place) {
        if (found < most) edges[found] = place;
        found++;
    };
    for (int64_t row = 0; row < rows; row++, bright += columns) {
        const int64_t first = row * (columns + gap);
        uint8_t before = 0;
        for (int64_t at = 0; at < columns;) {
            uint64_t eight;
            if (at + 8 <= columns) {
                std::memcpy(&eight, bright + at, 8);
                if (eight == before * 0x0101010101010101u) {
                    at += 8;
                    continue;
                }
            }
            for (const int64_t end = std::min(at + 8, columns); at < end; at++) {
                if (bright[at] == before) continue;
                before = bright[at];
                note(first + at);
            }
        }
        if (before) note(first + columns);
    }
    return found;
}

// Region of each run, in the order of their first runs; returns the number of touching pairs.
int64_t runs_join(const int64_t* begins, const int64_t* ends, int64_t count, int64_t width,
                  int64_t* labels) {
    std::vector<int64_t> parents(count);
    std::iota(parents.begin(), parents.end(), 0);
    int64_t touching = 0, first = 0;
    for (int64_t run = 0; run < count; run++) {
        while (first < count && ends[first] < begins[run] + width) first++;
        for (int64_t below = first; below < count && begins[below] <= ends[run] + width; below++) {
            const int64_t one = regions::root_of(parents, run);
            const int64_t other = regions::root_of(parents, below);
            parents[std::max(one, other)] = std::min(one, other);
            touching++;
        }
    }
    int64_t named = 0;
    for (int64_t run = 0; run < count; run++) {
        const int64_t root = regions::root_of(parents, run);  // never behind the run
        labels[run] = root == run ? named++ : labels[root];
    }
    return touching;
}

}
