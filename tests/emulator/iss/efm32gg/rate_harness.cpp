// Clocks of time.h, called by test_rate.py.
#include "efm32gg/part/time.h"

using efm32gg::Rate;

extern "C" int64_t rate_time(int64_t hertz, int64_t divider, int64_t origin, int64_t edge) {
    return Rate(hertz, divider, origin).time(edge);
}

extern "C" int64_t rate_edges(int64_t hertz, int64_t divider, int64_t origin, int64_t time) {
    return Rate(hertz, divider, origin).edges(time);
}
