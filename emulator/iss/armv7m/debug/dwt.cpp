#include "armv7m/debug/dwt.h"

namespace armv7m {

void Dwt::reset() {
    control = base = 0;
    traced = false;
    sleep = exception = 0;
    for (auto &each : comparator) each = {0, 0, 0};
}

void Dwt::set_trace_enabled(bool enabled, int64_t now) {
    const uint32_t cycles = read(CYCCNT, now);
    traced = enabled;
    write(CYCCNT, cycles, now);
}

uint32_t Dwt::read(uint32_t offset, int64_t now) const {
    switch (offset) {
    case CTRL: return (uint32_t)comparators << 28 | control;
    case CYCCNT: return counts() ? base + (uint32_t)now : base;
    case EXCCNT: return exception;
    case SLEEPCNT: return sleep;
    }
    const uint32_t index = (offset - COMPARATORS) / 16;
    if (offset < COMPARATORS || index >= (uint32_t)comparators) return 0;
    switch (offset & 15) {
    case 0: return comparator[index].value;
    case 4: return comparator[index].mask;
    case 8: return comparator[index].function;
    default: return 0;
    }
}

void Dwt::write(uint32_t offset, uint32_t value, int64_t now) {
    switch (offset) {
    case CTRL: {
        const uint32_t cycles = read(CYCCNT, now);
        const uint32_t enabled = ~control & value;    // a counter starts at 0, C1.8.7
        if (enabled >> 18 & 1) exception = 0;
        if (enabled >> 19 & 1) sleep = 0;
        control = value & 0x007F1FFF;
        write(CYCCNT, cycles, now);
        return;
    }
    case CYCCNT: base = counts() ? value - (uint32_t)now : value; return;
    case EXCCNT: exception = (uint8_t)value; return;
    case SLEEPCNT: sleep = (uint8_t)value; return;
    }
    const uint32_t index = (offset - COMPARATORS) / 16;
    if (offset < COMPARATORS || index >= (uint32_t)comparators) return;
    switch (offset & 15) {
    case 0: comparator[index].value = value; break;
    case 4: comparator[index].mask = value & 31; break;
    case 8: comparator[index].function = value & 0x000FFFAF; break;
    }
}

}  // namespace armv7m
