// When characters are on the wire: those back to back share one beginning, so that rounding to
// picoseconds does not add up.
#pragma once

#include "efm32gg/part/rate.h"

namespace efm32gg {

class FrameTiming {
public:
    int64_t begin = 0, end = 0;  // of the latest frame

    // A frame of `units`, `per_clock` of which are a period of `clock`; it begins at the end of
    // the one before when it is `behind` that, else at the first edge from `now` on.
    void append(const Rate &clock, int64_t units, int64_t per_clock, bool behind, int64_t now) {
        if (!behind || rate.origin != clock.origin || !rate.same_frequency(clock)) {
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
