// Sum of Gaussian spots on a sensor: spots.py, one row at a time.
//
// Each pixel's sum is in float64 and in the order of the spots, as in the reference.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace {

constexpr double REACH = 8.0, PER_SIGMA = 512.0;
constexpr int LAST = 8192;  // of the distribution function's table

double distribution(const double *phi, double z) {
    const double place = std::min(std::max((z + REACH) * PER_SIGMA, 0.0), (double)LAST);
    const int piece = std::min((int)place, LAST - 1);
    const double level = phi[piece];
    return level + (place - piece) * (phi[piece + 1] - level);
}

// Share of a spot in each of 2 * half + 1 pixels around the nearest one.
void put_shares(const double *phi, double offset, double sigma_px, int half, double *shares) {
    double below = distribution(phi, (-half - 0.5 - offset) / sigma_px);
    for (int n = 0; n <= 2 * half; ++n) {
        const double above = distribution(phi, (n - half + 0.5 - offset) / sigma_px);
        shares[n] = above - below;
        below = above;
    }
}

}  // namespace

// Fills ``image`` (rows, columns); ``pixels`` (count, 2) are within ``half`` of it.
extern "C" void light_spots(const double *pixels, const double *electrons, int64_t count,
                            double sigma_px, int32_t half, const double *phi, int32_t rows,
                            int32_t columns, float *image) {
    const int size = 2 * half + 1;
    std::vector<double> across(count * size), down(count * size), sums(columns);
    std::vector<int> left(count), top(count);
    // The spots of each row, in their order.
    std::vector<int64_t> ends(rows + 1, 0);
    for (int64_t n = 0; n < count; ++n) {
        const double x = std::nearbyint(pixels[2 * n]), y = std::nearbyint(pixels[2 * n + 1]);
        put_shares(phi, pixels[2 * n] - x, sigma_px, half, &across[n * size]);
        put_shares(phi, pixels[2 * n + 1] - y, sigma_px, half, &down[n * size]);
        for (int k = 0; k < size; ++k) down[n * size + k] *= electrons[n];
        left[n] = (int)x - half;
        top[n] = (int)y - half;
        for (int r = std::max(top[n], 0); r < std::min(top[n] + size, rows); ++r) ++ends[r + 1];
    }
    for (int r = 0; r < rows; ++r) ends[r + 1] += ends[r];
    std::vector<int64_t> spots(ends[rows]), next(ends.begin(), ends.end());
    for (int64_t n = 0; n < count; ++n)
        for (int r = std::max(top[n], 0); r < std::min(top[n] + size, rows); ++r)
            spots[next[r]++] = n;
    for (int r = 0; r < rows; ++r) {
        float *row = image + (int64_t)r * columns;
        if (ends[r] == ends[r + 1]) {
            std::fill(row, row + columns, 0.0f);
            continue;
        }
        std::fill(sums.begin(), sums.end(), 0.0);
        for (int64_t k = ends[r]; k < ends[r + 1]; ++k) {
            const int64_t n = spots[k];
            const double charge = down[n * size + r - top[n]];
            const double *shares = &across[n * size];
            const int last = std::min(left[n] + size, columns);
            for (int x = std::max(left[n], 0); x < last; ++x)
                sums[x] += charge * shares[x - left[n]];
        }
        for (int x = 0; x < columns; ++x) row[x] = (float)sums[x];
    }
}
