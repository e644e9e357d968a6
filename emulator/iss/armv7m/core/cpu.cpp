// The outer loop, reset, breakpoints, special registers.

#include "armv7m/core/cpu.h"

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
        const bool aside = aside_ready && r[15] == code_base;
        aside_ready = false;
        if (!aside && !find_code(r[15])) {
            fetch_failed();
            continue;
        }
        arrive();
        if (tracer != nullptr || steps_left != 0 || guarded)
            loop<true>();
        else
            loop<false>();
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

// -- special registers: MRS, MSR, CPS (ARMv7-M ARM B5.1.1, B5.2) --

uint32_t Cpu::read_special(uint32_t number) const {
    if (number < 8) {    // combinations of APSR (bit 2 clear), IPSR (bit 0), EPSR (reads as 0)
        return (number & 4 ? 0 : apsr()) | (number & 1 ? ipsr : 0);
    }
    if (number != 20 && !privileged()) return 0;
    switch (number) {
    case 8: return main_sp();
    case 9: return process_sp();
    case 16: return primask;
    case 17: case 18: return basepri;
    case 19: return faultmask;
    case 20: return control;
    default: return 0;    // UNPREDICTABLE
    }
}

void Cpu::write_special(uint32_t number, uint32_t mask, uint32_t value) {
    if (number < 4) {    // bit 1 of the mask: the flags; IPSR and EPSR ignore writes
        if (mask & 2) set_apsr(value);
        return;
    }
    if (!privileged()) return;
    const uint8_t priority = (uint8_t)(value & 0xFF00u >> system->parameters.priority_bits);
    switch (number) {
    case 8: set_main_sp(value); break;
    case 9: set_process_sp(value); break;
    case 16: primask = value & 1; break;
    case 17: basepri = priority; break;
    case 18:
        if (priority != 0 && (priority < basepri || basepri == 0)) basepri = priority;
        break;
    case 19:
        // It can always be cleared, as by CPSIE; only NMI and HardFault cannot set it.
        if (!(value & 1) || system->execution_priority() > -1) faultmask = value & 1;
        break;
    case 20:    // SPSEL can only be changed in thread mode
        set_control(handler_mode() ? (uint8_t)((control & 2) | (value & 1)) : (uint8_t)value);
        break;
    default: break;
    }
    system->priority_changed();
}

void Cpu::change_masks(uint32_t value) {
    if (!privileged()) return;
    const uint8_t on = value >> 4 & 1;
    if (value & 2) primask = on;
    if (value & 1 && (!on || system->execution_priority() > -1)) faultmask = on;
    system->priority_changed();
}

uint32_t Cpu::debug_register(int number) const {
    switch (number) {
    case 16: return xpsr();
    case 17: return main_sp();
    case 18: return process_sp();
    case 19: return primask;
    case 20: return basepri;
    case 21: return faultmask;
    case 22: return control;
    default: return number >= 0 && number < 16 ? r[number] : 0;
    }
}

void Cpu::set_debug_register(int number, uint32_t value) {
    switch (number) {
    case 13: r[13] = value & ~3u; break;
    case 15: r[15] = value & ~1u; break;
    case 16: set_xpsr(value); break;
    case 17: set_main_sp(value); break;
    case 18: set_process_sp(value); break;
    case 19: primask = value & 1, system->priority_changed(); break;
    case 20: basepri = (uint8_t)value, system->priority_changed(); break;
    case 21: faultmask = value & 1, system->priority_changed(); break;
    case 22: set_control(value & 3); break;
    default:
        if (number >= 0 && number < 16)
            r[number] = value;
    }
}

}  // namespace armv7m
