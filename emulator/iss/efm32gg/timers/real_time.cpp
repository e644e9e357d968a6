#include "efm32gg/timers/real_time.h"

#include "efm32gg/clocks/emu.h"
#include "efm32gg/clocks/rmu.h"
#include "efm32gg/pins/prs.h"
#include "efm32gg/timers/letimer.h"

#include <algorithm>
#include <array>

namespace efm32gg {

CompareCounter::CompareCounter(Part &part, const Instance &instance, const Shape &shape,
                               uint32_t freeze, uint32_t synchronizing)
    : LowEnergy(part, instance, freeze, synchronizing, NONE), shape(shape) {}

void CompareCounter::clear_count() {
    value = 0;
    part.cancel(due);
    ticks = Rate();
    counted = 0;
}

// -- the counter as arithmetic --

int64_t CompareCounter::steps() const {
    return counts() && ticks.runs() ? ticks.edges(part.now()) - counted : 0;
}

// Ticks until the counter has `wanted`, 1 or more; FAR when it never will.
int64_t CompareCounter::until(uint32_t wanted) const {
    const int64_t zero = until_zero();
    if (wanted > value && (int64_t)wanted - value < zero)
        return (int64_t)wanted - value;
    return wanted <= top() ? zero + wanted : FAR;
}

uint32_t CompareCounter::after(int64_t passed) const {
    const int64_t zero = until_zero();
    if (passed < zero)
        return (uint32_t)(value + passed);
    return (uint32_t)((passed - zero) % ((int64_t)top() + 1));
}

void CompareCounter::fold() {
    const int64_t passed = steps();
    if (passed <= 0)
        return;
    uint32_t flags = 0;
    const bool natural = value > top() || top() == shape.last;
    if (natural && passed >= until_zero()) {
        flags |= shape.overflow;
        part.prs->pulse(shape.reflex, 0);
    }
    for (int n = 0; n < 2; n++)
        if (shape.compare[n] != NONE && passed >= until(reg(shape.compare[n]))) {
            flags |= shape.compared[n];
            part.prs->pulse(shape.reflex, 1 + n);
            matched(n);
        }
    value = after(passed);
    counted += passed;
    if (flags) {
        raise(flags);
        flagged();
    }
}

void CompareCounter::plan() {
    part.cancel(due);
    if (!counts() || !ticks.runs())
        return;
    const uint32_t awaited = reg((uint32_t)layout.ien) & ~reg((uint32_t)layout.if_);
    int64_t next = FAR;
    if (awaited & shape.overflow || part.prs->listens(shape.reflex, 0))
        next = std::min(next, until_zero());
    for (int n = 0; n < 2; n++)
        if (shape.compare[n] != NONE && (awaited & shape.compared[n] || watched(n) ||
                                         part.prs->listens(shape.reflex, 1 + n)))
            next = std::min(next, until(reg(shape.compare[n])));
    if (next != FAR)
        part.schedule(due, ticks.time(counted + next));
}

void CompareCounter::on_due(int64_t) {
    fold();
    plan();
}

// -- clock and registers --

void CompareCounter::follow_clock() {
    const Rate wanted = clock();
    if (wanted.runs() == ticks.runs() && wanted.origin == ticks.origin &&
        wanted.same_frequency(ticks))
        return;
    ticks = wanted;
    counted = ticks.edges(part.now());
}

void CompareCounter::clocks_changed() {
    LowEnergy::clocks_changed();
    follow_clock();
    plan();
}

uint32_t CompareCounter::peek(uint32_t offset) const {
    return offset == shape.count ? after(steps()) : LowEnergy::peek(offset);
}

uint32_t CompareCounter::read(uint32_t offset) {
    if (steps()) {
        fold();
        plan();
    }
    return peek(offset);
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
    if (!counted_before && counts()) {
        ticks = Rate();
        follow_clock();
    }
    plan();
}

// -- RTC --

Rtc::Rtc(Part &part, const Instance &instance)
    : CompareCounter(part, instance,
                     {rtc::CNT, {rtc::COMP0, rtc::COMP1}, 0xFFFFFF, rtc::IF_OF,
                      {rtc::IF_COMP0, rtc::IF_COMP1}, 40},
                     rtc::FREEZE, rtc::SYNCBUSY) {}

void Rtc::reset() {
    LowEnergy::reset();
    clear_count();
}

uint32_t Rtc::busy_bit(uint32_t offset) const {
    switch (offset) {
    case rtc::CTRL: return rtc::SYNCBUSY_CTRL;
    case rtc::COMP0: return rtc::SYNCBUSY_COMP0;
    case rtc::COMP1: return rtc::SYNCBUSY_COMP1;
    }
    return 0;
}

void Rtc::apply(uint32_t offset, uint32_t value) {
    CompareCounter::apply(offset, value);
    if (offset == rtc::CTRL && !counts())  // disabled: it begins at 0 again
        clear_count();
}

void Rtc::matched(int compare) {
    if (started)
        started->compare_matched(compare);
}

bool Rtc::watched(int compare) const { return started && started->awaits(compare); }

// -- BURTC --

using namespace burtc;

static constexpr uint32_t RETAINED = 128;

Burtc::Burtc(Part &part, const Instance &instance)
    : CompareCounter(part, instance,
                     {CNT, {COMP0, NONE}, 0xFFFFFFFF, IF_OF, {IF_COMP0, 0}, 55}, FREEZE,
                     SYNCBUSY) {}

void Burtc::reset() {
    if (!(part.reset_cause & rmu::RSTCAUSE_PORST) && !part.rmu->backup_domain_resets())
        return update_interrupts();
    // The retention registers are memory: they keep what they have as long as there is power.
    std::array<uint32_t, RETAINED> retained = {};
    if (!(part.reset_cause & rmu::RSTCAUSE_PORST))
        for (uint32_t n = 0; n < RETAINED; n++)
            retained[n] = reg(RET0_REG + 4 * n);
    LowEnergy::reset();
    for (uint32_t n = 0; n < RETAINED; n++)
        reg(RET0_REG + 4 * n) = retained[n];
    clear_count();
    oscillator_hertz = 0;
}

uint32_t Burtc::busy_bit(uint32_t offset) const {
    switch (offset) {
    case LPMODE: return SYNCBUSY_LPMODE;
    case COMP0: return SYNCBUSY_COMP0;
    }
    return 0;
}

bool Burtc::counts() const {
    const uint32_t mode = take(reg(CTRL), CTRL_MODE);
    return mode && !(reg(CTRL) & CTRL_RSTEN) && part.mode <= (int)mode + 1;
}

// The oscillator that was chosen goes on through resets, when it was running at first.
void Burtc::take_oscillator() {
    const uint32_t chosen = take(reg(CTRL), CTRL_CLKSEL);
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
    return {oscillator_hertz, (int64_t)1 << take(reg(CTRL), CTRL_PRESC), oscillator_origin};
}

// Its own clock; while it has none, nothing is to be waited for but the bus.
Rate Burtc::synchronizer() const {
    const Rate own = clock();
    return own.runs() ? own : part.rate(Clock::HFCORELE);
}

void Burtc::flagged() {
    if (part.mode == 4 && reg(IF) & reg(IEN) && part.emu->reg(emu::EM4CONF) & emu::EM4CONF_BURTCWU)
        part.emu->wake_from_em4(0);
}

void Burtc::write(uint32_t offset, uint32_t value) {
    if (part.rmu->reg(rmu::CTRL) & rmu::CTRL_BURSTEN)
        return part.log_once("BURTC is held in reset by RMU_CTRL.BURSTEN: a write is lost");
    if (offset == LOCK)
        return (void)(reg(LOCK) = (value & 0xFFFF) != 0xAEE8);
    if (reg(LOCK) && offset < LOCK)
        return part.log_once("BURTC is locked: a write to its registers is lost");
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
