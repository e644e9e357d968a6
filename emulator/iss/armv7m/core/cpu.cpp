// The outer loop, reset, breakpoints.

#include "armv7m/core/cpu.h"

#include "armv7m/decode/codes.h"
#include "armv7m/system/system.h"

#include <algorithm>

namespace armv7m {

void Cpu::reset() {
    std::fill(std::begin(r), std::end(r), 0);
    r[14] = 0xFFFFFFFFu;    // B1.4.2
    other_sp = 0;
    set_apsr(0);
    it = 0, thumb = 1, ipsr = 0;
    primask = faultmask = basepri = control = 0;
    exclusive = false;
    stopped_at = NOWHERE;
}

void Cpu::set_control(uint8_t value) {
    if ((value ^ control) & 2) std::swap(r[13], other_sp);
    control = value & 3;
}

void Cpu::update_limit() {
    limit = stop_requested || attention_requested ? INT64_MIN : deadline;
    if (exits != 0) limit = INT64_MIN;
    if (system != nullptr) limit = std::min(limit, system->next_cycle());
}

uint32_t Cpu::run() {
    exits = 0;
    attention_requested = true;
    resume_at = r[15] == stopped_at ? stopped_at : NOWHERE;
    stopped_at = NOWHERE;
    for (;;) {
        if (attention_requested || cycles >= system->next_cycle()) {
            attention_requested = false, arriving = NotArriving;
            system->service();
        }
        if (stop_requested) exits |= ExitStop;
        if (system->locked_up()) exits |= ExitLockup;
        if (system->sleep() != Sleep::Awake) exits |= ExitSleep;
        if (cycles >= deadline) exits |= ExitDeadline;
        if (exits != 0) break;
        if (!thumb) {
            system->fault(Fault::InvalidState);
            attention_requested = true;
            continue;
        }
        update_limit();
        const bool watched = tracer != nullptr || steps_left != 0;
        const bool aside = aside_ready && r[15] == code_base;
        aside_ready = false;
        if (!aside && !find_code(r[15])) {
            fetch_failed();
            continue;
        }
        arrive();
        if (watched)
            fetch_costs ? loop<3>() : loop<1>();
        else
            fetch_costs ? loop<2>() : loop<0>();
    }
    stop_requested = false;
    if (exits & (ExitBreakpoint | ExitWatchpoint | ExitStep)) stopped_at = r[15];
    return exits;
}

void Cpu::steps(int64_t count, uint32_t low, uint32_t high) {
    steps_left = count;
    step_low = low, step_high = high;
}

void Cpu::set_breakpoint(uint32_t address) {
    if (breakpoint_at(address)) return;
    breakpoints.push_back(address);
    invalidate(address, 2);
}

void Cpu::clear_breakpoint(uint32_t address) {
    breakpoints.erase(std::remove(breakpoints.begin(), breakpoints.end(), address),
                      breakpoints.end());
    invalidate(address, 2);
}

bool Cpu::breakpoint_at(uint32_t address) const {
    return std::find(breakpoints.begin(), breakpoints.end(), address) != breakpoints.end();
}

}  // namespace armv7m
