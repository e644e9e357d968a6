// The inverse of Brown's distortion: distortion.py, all points at once.

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

struct Brown {
    double k1, k2, p1, p2;
};

// Goes one step of Newton's method; returns how many of ``count`` points are found.
int64_t step(const Brown &lens, const double *wanted_x, const double *wanted_y, int64_t count,
             double small, double *__restrict xs, double *__restrict ys, int64_t *__restrict found) {
    const double k1 = lens.k1, k2 = lens.k2, p1 = lens.p1, p2 = lens.p2;
    for (int64_t n = 0; n < count; ++n) {
        const double x = xs[n], y = ys[n], r2 = x * x + y * y;
        const double radial = 1 + r2 * (k1 + k2 * r2);
        const double across = x * radial + p2 * (r2 + 2 * x * x) + 2 * p1 * x * y;
        const double down = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
        const double slope = 2 * (k1 + 2 * k2 * r2);
        const double jxx = radial + slope * x * x + 6 * p2 * x + 2 * p1 * y;
        const double jyy = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x;
        const double jxy = slope * x * y + 2 * p2 * y + 2 * p1 * x;
        const double ex = across - wanted_x[n], ey = down - wanted_y[n];
        const double determinant = jxx * jyy - jxy * jxy;
        const double step_x = (jyy * ex - jxy * ey) / determinant;
        const double step_y = (jxx * ey - jxy * ex) / determinant;
        xs[n] = x - step_x;
        ys[n] = y - step_y;
        found[n] = (std::fabs(step_x) < small) & (std::fabs(step_y) < small);
    }
    int64_t sum = 0;
    for (int64_t n = 0; n < count; ++n) sum += found[n];
    return sum;
}

}  // namespace

// Fills ``points`` (count, 2), whose images are ``targets`` (count, 2), after at most ``steps``.
extern "C" void light_undistorted(const Brown *lens, const double *targets, int64_t count,
                                  int32_t steps, double small, double *points) {
    std::vector<double> wanted_x(count), wanted_y(count);
    std::vector<int64_t> found(count);
    for (int64_t n = 0; n < count; ++n) {
        wanted_x[n] = targets[2 * n];
        wanted_y[n] = targets[2 * n + 1];
    }
    std::vector<double> x = wanted_x, y = wanted_y;
    for (int32_t k = 0; k < steps; ++k)
        if (step(*lens, wanted_x.data(), wanted_y.data(), count, small, x.data(), y.data(),
                 found.data()) == count)
            break;
    const double nowhere = std::numeric_limits<double>::quiet_NaN();
    for (int64_t n = 0; n < count; ++n) {
        points[2 * n] = found[n] ? x[n] : nowhere;
        points[2 * n + 1] = found[n] ? y[n] : nowhere;
    }
}
