// Loop of pair_triangles.py; names, shapes and units are those of the Python form.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace pair_triangles {

constexpr int64_t FACTORS = 6;  // of each row of charges: 1, older, walked, entries, wedges, found

// Arrays of a pass, in the order of the Python form.
struct Pass {
    const float* pair_angles;
    const int64_t* ends;  // (2, pairs)
    const float* star_cosines;
    const float *angles, *cosines, *sines;  // (centroids, centroids)
    const uint8_t* listed;                  // (stars,) or null
    const int64_t* charges;                 // (rows, FACTORS)
    int64_t pairs, stars, centroids, most_pairs, rows;
};

struct Entry {
    int64_t hub, rim, star;
    float apart;
};

struct Wedge {
    int64_t one, two, popularity;
    float misfit;
};

}  // namespace pair_triangles

extern "C" {

// A step: triangles (room, 6), centroids and stars; misfits (room,); charges (rows,). Returns the
// number of triangles, also if there is no room for them, or -1 where there are too many pairs.
int64_t pair_triangles_step(const int64_t* of_pass, int64_t newest, double tolerance_rad,
                            int64_t* triangles, float* misfits, int64_t room, int64_t* charged,
                            int64_t* entry_count) {
    using namespace pair_triangles;
    const Pass& pass = *reinterpret_cast<const Pass*>(of_pass);
    const float tolerance = float(tolerance_rad);
    const float* angles = pass.angles + newest * pass.centroids;
    std::vector<Entry> found;
    int64_t walked = 0;
    const float* last = pass.pair_angles + pass.pairs;
    std::vector<Entry> swapped;
    for (int64_t older = 0; older < newest; older++) {
        const float* start =
            std::lower_bound(pass.pair_angles, last, float(angles[older] - tolerance));
        const float* end =
            std::lower_bound(pass.pair_angles, last, float(angles[older] + tolerance));
        walked += end - start;
        for (const float* at = start; at < end; at++) {
            const int64_t entry = at - pass.pair_angles;
            const int64_t one = pass.ends[entry], other = pass.ends[pass.pairs + entry];
            if (pass.listed && !(pass.listed[one] && pass.listed[other])) continue;
            const float apart = std::fabs(*at - angles[older]);
            found.push_back({other, older, one, apart});
            swapped.push_back({one, older, other, apart});
        }
    }
    if (2 * int64_t(found.size()) > pass.most_pairs) return -1;
    found.insert(found.end(), swapped.begin(), swapped.end());

    // In the order of their hubs.
    std::vector<int64_t> firsts(pass.stars + 1);
    for (const Entry& entry : found) firsts[entry.hub + 1]++;
    for (int64_t star = 0; star < pass.stars; star++) firsts[star + 1] += firsts[star];
    std::vector<Entry> entries(found.size());
    std::vector<int64_t> next(firsts.begin(), firsts.end() - 1);
    for (const Entry& entry : found) entries[next[entry.hub]++] = entry;

    std::vector<Wedge> wedges;
    int64_t looks = 0;
    for (int64_t one = 0; one < int64_t(entries.size());) {
        const int64_t hub = entries[one].hub, first = firsts[hub], behind = firsts[hub + 1];
        const size_t before = wedges.size();
        for (; one < behind; one++) {
            const Entry& a = entries[one];
            looks += one - first;
            for (int64_t two = one - 1; two >= first; two--) {
                const Entry& b = entries[two];
                const float cosine = pass.star_cosines[a.star * pass.stars + b.star];
                const int64_t place = a.rim * pass.centroids + b.rim;
                const float third = std::fabs(cosine - pass.cosines[place]) / pass.sines[place];
                if (!(third <= tolerance) || a.rim == b.rim || a.star == b.star) continue;
                wedges.push_back({one, two, 0, std::max(std::max(a.apart, b.apart), third)});
            }
        }
        for (size_t n = before; n < wedges.size(); n++) wedges[n].popularity = wedges.size() - before;
    }
    std::stable_sort(wedges.begin(), wedges.end(), [](const Wedge& a, const Wedge& b) {
        return a.popularity > b.popularity;
    });
    const int64_t count = wedges.size(), size = entries.size();
    for (int64_t n = 0; n < std::min(count, room); n++) {
        const Entry &one = entries[wedges[n].one], &two = entries[wedges[n].two];
        const int64_t row[] = {one.rim, two.rim, newest, one.star, two.star, one.hub};
        std::copy(row, row + 6, triangles + 6 * n);
        misfits[n] = wedges[n].misfit;
    }
    const int64_t factors[FACTORS] = {1, newest, walked, size, looks, count};
    for (int64_t row = 0; row < pass.rows; row++) {
        charged[row] = 0;
        for (int64_t n = 0; n < FACTORS; n++)
            charged[row] += pass.charges[row * FACTORS + n] * factors[n];
    }
    *entry_count = size;
    return count;
}

}
