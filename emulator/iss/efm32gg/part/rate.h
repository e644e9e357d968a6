// An even clock: edge k is at origin + floor(k * numerator / denominator) picoseconds.
#pragma once

#include "efm32gg/part/schedule.h"

namespace efm32gg {

class Rate {
public:
    Rate() = default;

    // `hertz` / `divider` edges per second, edge 0 at `origin`; 0 hertz: stopped.
    Rate(int64_t hertz, int64_t divider, int64_t origin)
        : origin(origin), hertz(hertz), divider(divider) {
        if (!hertz) return;
        numerator = (__int128)SECOND * divider;
        const int64_t common = (int64_t)gcd(numerator, hertz);
        numerator /= common;
        denominator = hertz / common;
        short_reach = (int64_t)(INT64_MAX / numerator) - 1;
    }

    bool runs() const { return hertz != 0; }
    double frequency() const { return (double)hertz / (double)divider; }
    int64_t whole_hertz() const { return hertz / divider; }

    // Time of edge k; NEVER if the clock is stopped.
    int64_t time(int64_t k) const {
        if (!hertz) return NEVER;
        if (k >= 0 && k < short_reach)
            return origin + k * (int64_t)numerator / denominator;
        return origin + (int64_t)((__int128)numerator * k / denominator);
    }

    // Number of edges after the origin, up to and including `time`.
    int64_t edges(int64_t time) const {
        if (!hertz || time < origin) return 0;
        return (int64_t)((((__int128)(time - origin) + 1) * denominator - 1) / numerator);
    }

    // The first edge at or after `time`.
    int64_t edge_at_or_after(int64_t time) const {
        if (!hertz || time <= origin) return 0;
        return edges(time - 1) + 1;
    }

    // Picoseconds of n periods, rounded down; NEVER if the clock is stopped.
    int64_t span(int64_t n) const {
        return hertz ? (int64_t)((__int128)numerator * n / denominator) : NEVER;
    }

    // The clock after a divider that starts at `start`.
    Rate divided(int64_t by, int64_t start) const { return {hertz, divider * by, start}; }

    bool same_frequency(const Rate &other) const {
        return (__int128)hertz * other.divider == (__int128)other.hertz * divider;
    }

    int64_t origin = 0;

private:
    int64_t hertz = 0, divider = 1;
    __int128 numerator = 1;
    int64_t denominator = 1, short_reach = 0;

    static __int128 gcd(__int128 a, __int128 b) {
        while (b) {
            const __int128 rest = a % b;
            a = b;
            b = rest;
        }
        return a;
    }
};

}  // namespace efm32gg
