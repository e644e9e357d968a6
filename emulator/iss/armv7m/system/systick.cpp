#include "armv7m/system/systick.h"

namespace armv7m {

void SysTick::reset() {
    control = reload = base_value = 0;
    base_tick = 0;
    count_flag = false;
    wrap = INT64_MAX;
}

int64_t SysTick::tick(int64_t cycle) const {
    if (!by_reference()) return cycle;
    return (int64_t)((__int128)cycle * reference_ticks / reference_cycles);
}

int64_t SysTick::cycle_of(int64_t tick) const {
    if (!by_reference()) return tick;
    return (int64_t)(((__int128)tick * reference_cycles + reference_ticks - 1) / reference_ticks);
}

uint32_t SysTick::value(int64_t now) const {
    if (!counts()) return base_value;
    const int64_t passed = tick(now) - base_tick;
    if (passed <= base_value) return base_value - (uint32_t)passed;
    if (!reload) return 0;    // stays at 0, B3.3.1
    return reload - (uint32_t)((passed - base_value - 1) % ((int64_t)reload + 1));
}

int64_t SysTick::next_zero() const {
    if (!counts()) return INT64_MAX;
    if (base_value) return base_tick + base_value;
    return reload ? base_tick + reload + 1 : INT64_MAX;
}

void SysTick::find_wrap() {
    const int64_t zero = next_zero();
    wrap = zero == INT64_MAX || !(control & TICKINT) ? INT64_MAX : cycle_of(zero);
}

bool SysTick::advance(int64_t now) {
    const int64_t zero = next_zero();
    if (zero == INT64_MAX || tick(now) < zero) return false;
    count_flag = true;
    // Count on from the last zero.
    const int64_t period = (int64_t)reload + 1;
    base_tick = zero + (reload ? (tick(now) - zero) / period * period : 0);
    base_value = 0;
    find_wrap();
    return (control & TICKINT) != 0;
}

uint32_t SysTick::peek(uint32_t offset, int64_t now) const {
    switch (offset) {
    case CSR: return control | (reference_cycles ? 0u : CLKSOURCE) | (count_flag ? COUNTFLAG : 0u);
    case RVR: return reload;
    case CVR: return value(now);
    default: return calibration;
    }
}

uint32_t SysTick::read(uint32_t offset, int64_t now) {
    const uint32_t result = peek(offset, now);
    if (offset == CSR) count_flag = false;
    return result;
}

void SysTick::write(uint32_t offset, uint32_t value, int64_t now) {
    base_value = this->value(now);
    base_tick = tick(now);
    if (offset == CSR) {
        control = value & (ENABLE | TICKINT | CLKSOURCE);
        base_tick = tick(now);    // of the clock now selected
    } else if (offset == RVR) {
        reload = value & 0xFFFFFF;
    } else if (offset == CVR) {
        base_value = 0;    // whatever is written; no exception
        count_flag = false;
    }
    find_wrap();
}

}  // namespace armv7m
