// A write that takes effect some clocks later. The clocks that have passed stay counted while the
// part changes other clocks or energy modes; without its clock it waits.
// EFM32GG Reference Manual, 5.3.1.
#pragma once

#include "efm32gg/part/part.h"

#include <algorithm>

namespace efm32gg {

class Synchronizer {
public:
    static constexpr int64_t CLOCKS = 3;  // two to three, as the first edge may come at once

    // `event` acts when the write takes effect.
    Synchronizer(Part &part, const Event &event) : part(part), event(event) {}

    void start(const Rate &clock) {
        if (left) return;
        left = CLOCKS;
        count(clock);
    }

    // The clock may be another one, stopped or running.
    void follow(const Rate &clock) {
        if (!left || (clock.runs() == rate.runs() && clock.origin == rate.origin &&
                      clock.same_frequency(rate)))
            return;
        if (rate.runs())
            left = std::max<int64_t>(1, last - rate.edges(part.now()));
        count(clock);
    }

    // An edge of a clock without a rate. Returns whether it was the last one to wait for.
    bool tick() { return left && !rate.runs() && --left == 0; }

    // Forgets the write, or reports that it took effect.
    void clear() {
        part.cancel(event);
        left = 0;
    }

private:
    Part &part;
    Event event;
    Rate rate;
    int64_t left = 0, last = 0;  // edges to wait for, and the number of the last of them

    void count(const Rate &clock) {
        rate = clock;
        last = rate.edges(part.now()) + left;
        part.schedule(event, rate.time(last));
    }
};

}  // namespace efm32gg
