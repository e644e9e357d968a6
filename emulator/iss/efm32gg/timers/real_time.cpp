#include "efm32gg/timers/real_time.h"

#include "efm32gg/clocks/emu.h"
#include "efm32gg/clocks/rmu.h"
#include "efm32gg/pins/prs.h"
#include "efm32gg/timers/letimer.h"

#include <algorithm>
#include <array>

namespace efm32gg {

// Ticks until the counter reaches `wanted`, 1 or more; FAR if it never will.
int64_t CompareCounter::until(uint32_t wanted) const {
    const int64_t zero = until_zero();
    if (wanted > value && (int64_t)wanted - value < zero)
        return (int64_t)wanted - value;
    return wanted <= top() ? zero + wanted : FAR;
}

uint32_t CompareCounter::after(int64_t ticks) const {
    const int64_t zero = until_zero();
    if (ticks < zero)
        return (uint32_t)(value + ticks);
    return (uint32_t)((ticks - zero) % ((int64_t)top() + 1));
}

void CompareCounter::pass(int64_t ticks) {
    uint32_t flags = 0;
    const bool natural = value > top() || top() == shape.last;
    if (natural && ticks >= until_zero()) {
        flags |= shape.overflow;
        part.prs->pulse(shape.reflex, 0);
    }
    for (int n = 0; n < 2; n++)
        if (shape.compare[n] != NONE && ticks >= until(reg(shape.compare[n]))) {
            flags |= shape.compared[n];
            part.prs->pulse(shape.reflex, 1 + n);
            matched(n);
        }
    value = after(ticks);
    if (flags) {
        raise(flags);
        flagged();
    }
}

int64_t CompareCounter::next_effect() const {
    const uint32_t awaited = reg((uint32_t)layout.ien) & ~reg((uint32_t)layout.if_);
    int64_t next = FAR;
    if (awaited & shape.overflow || part.prs->listens(shape.reflex, 0))
        next = std::min(next, until_zero());
    for (int n = 0; n < 2; n++)
        if (shape.compare[n] != NONE && (awaited & shape.compared[n] || watched(n) ||
                                         part.prs->listens(shape.reflex, 1 + n)))
            next = std::min(next, until(reg(shape.compare[n])));
    return next;
}

void CompareCounter::write(uint32_t offset, uint32_t written) {
    fold();
    if (offset == shape.count)
        value = written & shape.last;
    LowEnergy::write(offset, written);
    plan();
}

void CompareCounter::apply(uint32_t offset, uint32_t written) {
    fold();
    const bool counted_before = counts();
    LowEnergy::apply(offset, written);
    if (!counted_before && counts())
        restart_clock();
    plan();
}

// -- RTC --

Rtc::Rtc(Part &part, const Instance &instance)
    : CompareCounter(part, instance,
                     {rtc::CNT, {rtc::COMP0, rtc::COMP1}, 0xFFFFFF, rtc::IF_OF,
                      {rtc::IF_COMP0, rtc::IF_COMP1}, 40}) {}

void Rtc::reset() {
    LowEnergy::reset();
    clear_count();
}

void Rtc::apply(uint32_t offset, uint32_t value) {
    CompareCounter::apply(offset, value);
    if (offset == rtc::CTRL && !counts())  // disabling clears the counter
        clear_count();
}

void Rtc::matched(int compare) {
    if (letimer)
        letimer->compare_matched(compare);
}

bool Rtc::watched(int compare) const { return letimer && letimer->awaits(compare); }

// -- BURTC --

using namespace burtc;

static constexpr uint32_t RETAINED = 128;

Burtc::Burtc(Part &part, const Instance &instance)
    : CompareCounter(part, instance,
                     {CNT, {COMP0, NONE}, 0xFFFFFFFF, IF_OF, {IF_COMP0, 0}, 55}) {}

void Burtc::reset() {
    if (!(part.reset_cause & rmu::RSTCAUSE_PORST) && !part.rmu->backup_domain_resets())
        return update_interrupts();
    // The retention registers are memory: they keep their contents while there is power.
    std::array<uint32_t, RETAINED> retained = {};
    if (!(part.reset_cause & rmu::RSTCAUSE_PORST))
        std::copy_n(&reg(RET0_REG), RETAINED, retained.begin());
    LowEnergy::reset();
    std::copy(retained.begin(), retained.end(), &reg(RET0_REG));
    clear_count();
    oscillator_hertz = 0;
}

bool Burtc::counts() const {
    const uint32_t mode = field(reg(CTRL), CTRL_MODE);
    return mode && !(reg(CTRL) & CTRL_RSTEN) && part.mode <= (int)mode + 1;
}

// The selected oscillator keeps running through resets, if it was running when selected.
void Burtc::take_oscillator() {
    const uint32_t chosen = field(reg(CTRL), CTRL_CLKSEL);
    const Clock source = chosen == 1 ? Clock::LFRCO : chosen == 2 ? Clock::LFXO : Clock::ULFRCO;
    if (!chosen) {
        oscillator_hertz = 0;
    } else if (part.rate(source).runs()) {
        oscillator_hertz = part.hertz(source);
        oscillator_origin = part.rate(source).origin;
    }
}

Rate Burtc::clock() const {
    if (!oscillator_hertz || !counts())
        return Rate();
    return {oscillator_hertz, (int64_t)1 << field(reg(CTRL), CTRL_PRESC), oscillator_origin};
}

// Its own clock; without one, only the bus delays a write.
Rate Burtc::synchronizer() const {
    const Rate own = clock();
    return own.runs() ? own : part.rate(Clock::HFCORELE);
}

void Burtc::flagged() {
    if (part.mode == 4 && reg(IF) & reg(IEN) && part.emu->reg(emu::EM4CONF) & emu::EM4CONF_BURTCWU)
        part.emu->wake_from_em4();
}

void Burtc::write(uint32_t offset, uint32_t value) {
    if (part.rmu->reg(rmu::CTRL) & rmu::CTRL_BURSTEN)
        return part.log_once("BURTC is held in reset by RMU_CTRL.BURSTEN: a write is lost");
    if (offset == LOCK)
        return lock(LOCK, value, 0xAEE8);
    if (reg(LOCK) && offset < LOCK)
        return report_locked();
    if (offset == CTRL) {
        fold();
        const uint32_t chosen = reg(CTRL) & CTRL_CLKSEL;
        store(offset, value);
        if ((reg(CTRL) & CTRL_CLKSEL) != chosen)
            oscillator_hertz = 0;
        if (reg(CTRL) & CTRL_RSTEN)
            clear_count();
        clocks_changed();
        return;
    }
    if (offset >= RET0_REG && reg(POWERDOWN) & POWERDOWN_RAM)
        return;
    CompareCounter::write(offset, value);
    if (offset == POWERDOWN && reg(POWERDOWN) & POWERDOWN_RAM)
        for (uint32_t at = RET0_REG; at <= RET127_REG; at += 4)
            reg(at) = 0;
}

void Burtc::clocks_changed() {
    if (!oscillator_hertz)
        take_oscillator();
    CompareCounter::clocks_changed();
}

}  // namespace efm32gg
