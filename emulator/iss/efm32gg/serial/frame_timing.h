// Times of characters on the wire: back-to-back characters are timed from a common start, so that
// rounding to picoseconds does not accumulate.
#pragma once

#include "efm32gg/part/rate.h"

namespace efm32gg {

class FrameTiming {
public:
    int64_t begin = 0, end = 0;  // of the latest frame

    // Adds a frame of `units`, with `per_clock` units per period of `clock`. It begins at the end
    // of the previous one if it `follows` that, else at the first edge at or after `now`.
    void append(const Rate &clock, int64_t units, int64_t per_clock, bool follows, int64_t now) {
        if (!follows || rate.origin != clock.origin || !rate.same_frequency(clock)) {
            rate = clock;
            start = clock.time(clock.edge_at_or_after(now));
            passed = 0;
        }
        begin = start + rate.span(passed) / per_clock;
        passed += units;
        end = start + rate.span(passed) / per_clock;
    }

private:
    Rate rate;
    int64_t start = 0, passed = 0;
};

}  // namespace efm32gg
