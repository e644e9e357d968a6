// The error of a lens over its field: lens_curve.py, all points at once.

#include <algorithm>
#include <cstdint>

// A lens: angles of the nodes, errors and slopes there; the rim's angle; Brown's p1 and p2.
struct LensCurve {
    const double *nodes, *values, *slopes;
    int64_t count;
    double rim, p1, p2;
};

// Fills ``to_x`` and ``to_y`` (count,) with where the lens displaces ``x`` and ``y`` (count,), whose
// distances from the axis are ``theta``.
extern "C" void light_displaced(const LensCurve *lens, const double *theta, const double *xs,
                                const double *ys, int64_t count, double *__restrict to_x,
                                double *__restrict to_y) {
    const double p1 = lens->p1, p2 = lens->p2, rim = lens->rim;
    const double *nodes = lens->nodes, *values = lens->values, *slopes = lens->slopes;
    const int64_t inner = lens->count - 1;
    for (int64_t n = 0; n < count; ++n) {
        const double angle = theta[n];
        int64_t k = 0;
        for (int64_t node = 1; node < inner; ++node) k += nodes[node] <= angle;
        const double width = nodes[k + 1] - nodes[k];
        const double s = std::min(std::max((angle - nodes[k]) / width, 0.0), 1.0);
        const double begins = (1 + 2 * s) * values[k] + s * width * slopes[k];
        const double ends = (3 - 2 * s) * values[k + 1] - (1 - s) * width * slopes[k + 1];
        const double radial = (1 - s) * (1 - s) * begins + s * s * ends;
        const double stretch = 1 + radial / (angle == 0 ? 1 : angle);
        const double x = xs[n] / rim, y = ys[n] / rim, square = x * x + y * y;
        const double fading = std::max(1 - square, 0.0);
        to_x[n] = xs[n] * stretch + fading * (p2 * (square + 2 * x * x) + 2 * p1 * x * y);
        to_y[n] = ys[n] * stretch + fading * (p1 * (square + 2 * y * y) + 2 * p2 * x * y);
    }
}
