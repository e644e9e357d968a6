// RTC and BURTC: low-frequency counters that count up to compare values, and the retention
// registers. EFM32GG Reference Manual, chapters 21 and 22.
//
// Not modelled of BURTC: low power mode, failure detection of the LFXO.
#include "efm32gg/clocks/emu.h"
#include "efm32gg/clocks/rmu.h"
#include "efm32gg/part/low_energy.h"
#include "efm32gg/pins/prs.h"
#include "efm32gg/timers/letimer.h"

#include <algorithm>
#include <array>

namespace efm32gg {

namespace {

// The same in both.
constexpr uint32_t CTRL = rtc::CTRL;
static_assert(+rtc::CTRL == +burtc::CTRL);

class CompareCounter : public LowEnergyCounter {
public:
    struct Shape {
        uint32_t count, compare[2];  // offsets; the second may be NONE
        uint32_t last, top, overflow, compared[2];  // `top`: bit of CTRL that makes COMP0 the top
        int reflex;                  // PRS source: overflow, then compares
    };
    static constexpr uint32_t NONE = ~0u;

    CompareCounter(Part &part, const Instance &instance, const Shape &shape)
        : LowEnergyCounter(part, instance, shape.count), shape(shape) {}

    void write(uint32_t offset, uint32_t written) override {
        fold();
        if (offset == shape.count)
            value = written & shape.last;
        LowEnergy::write(offset, written);
        plan();
    }

protected:
    // A compare matched, and whether that has an effect beyond the flag.
    virtual void matched(int compare) { (void)compare; }
    virtual bool watched(int compare) const { return (void)compare, false; }
    virtual void flagged() {}  // IF changed

    uint32_t after(int64_t ticks) const override {
        const int64_t zero = until_zero();
        if (ticks < zero) return (uint32_t)(value + ticks);
        return (uint32_t)((ticks - zero) % ((int64_t)top() + 1));
    }

    void pass(int64_t ticks) override {
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

    int64_t next_effect() const override {
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

    void apply(uint32_t offset, uint32_t written) override {
        fold();
        const bool counted_before = counts();
        LowEnergy::apply(offset, written);
        if (!counted_before && counts())
            restart_clock();
        plan();
    }

private:
    const Shape shape;

    uint32_t top() const { return reg(CTRL) & shape.top ? reg(shape.compare[0]) : shape.last; }
    int64_t until_zero() const {
        return (int64_t)(value <= top() ? top() : shape.last) - value + 1;
    }

    // Ticks until the end of the next period in which the counter equals `wanted`; FAR if it never
    // will.
    int64_t until(uint32_t wanted) const {
        const int64_t zero = until_zero();
        if (wanted >= value && (int64_t)wanted - value < zero)
            return (int64_t)wanted - value + 1;
        return wanted <= top() ? zero + wanted + 1 : FAR;
    }
};

class Rtc : public CompareCounter {
public:
    // Compare matches may start `letimer`.
    Rtc(Part &part, LeTimer &letimer)
        : CompareCounter(part, instance::RTC,
                         {rtc::CNT, {rtc::COMP0, rtc::COMP1}, 0xFFFFFF, rtc::CTRL_COMP0TOP,
                          rtc::IF_OF, {rtc::IF_COMP0, rtc::IF_COMP1}, 40}),
          letimer(letimer) {}

    void reset() override {
        LowEnergy::reset();
        clear_count();
    }

private:
    LeTimer &letimer;

    bool immediate() const override { return true; }

    void apply(uint32_t offset, uint32_t value) override {
        CompareCounter::apply(offset, value);
        if (offset == CTRL && !counts())  // disabling clears the counter
            clear_count();
    }

    bool counts() const override { return reg(rtc::CTRL) & rtc::CTRL_EN; }
    void matched(int compare) override { letimer.compare_matched(compare); }
    bool watched(int compare) const override { return letimer.awaits(compare); }
};

using burtc::CMD, burtc::CMD_CLRSTATUS, burtc::CNT, burtc::COMP0, burtc::CTRL_BUMODETSEN,
    burtc::CTRL_CLKSEL, burtc::CTRL_COMP0TOP, burtc::CTRL_MODE, burtc::CTRL_PRESC,
    burtc::CTRL_RSTEN, burtc::IF_COMP0, burtc::IF_OF, burtc::LOCK, burtc::POWERDOWN,
    burtc::POWERDOWN_RAM, burtc::RET0_REG, burtc::RET127_REG, burtc::STATUS,
    burtc::STATUS_BUMODETS, burtc::TIMESTAMP;

// Lives in the backup domain: only the loss of its power or RMU's BURSTEN resets it.
class Burtc : public CompareCounter {
public:
    explicit Burtc(Part &part)
        : CompareCounter(part, instance::BURTC,
                         {CNT, {COMP0, NONE}, ~0u, CTRL_COMP0TOP, IF_OF, {IF_COMP0, 0}, 55}) {}

    void reset() override {
        const bool unpowered = part.reset_cause & rmu::RSTCAUSE_PORST || part.backup_lost;
        stamped = false;
        if (!unpowered && !part.rmu->backup_domain_resets()) return update_interrupts();
        // The retention registers are memory: they keep their contents while there is power.
        std::array<uint32_t, RETAINED> retained = {};
        if (!unpowered)
            std::copy_n(&reg(RET0_REG), RETAINED, retained.begin());
        LowEnergy::reset();
        std::copy(retained.begin(), retained.end(), &reg(RET0_REG));
        clear_count();
        oscillator_hertz = 0;
    }

    void write(uint32_t offset, uint32_t value) override {
        if (part.rmu->reg(rmu::CTRL) & rmu::CTRL_BURSTEN)
            return part.log_once("BURTC is held in reset by RMU_CTRL.BURSTEN: a write is lost");
        if (offset == LOCK) return lock(LOCK, value, 0xAEE8);
        if (reg(LOCK) && offset < LOCK) return report_locked();
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
        if (offset >= RET0_REG && reg(POWERDOWN) & POWERDOWN_RAM) return;
        CompareCounter::write(offset, value);
        if (offset == CMD && value & CMD_CLRSTATUS)
            reg(STATUS) = 0;
        if (offset == POWERDOWN && reg(POWERDOWN) & POWERDOWN_RAM)
            for (uint32_t at = RET0_REG; at <= RET127_REG; at += 4)
                reg(at) = 0;
    }

    void clocks_changed() override {
        if (!oscillator_hertz)
            take_oscillator();
        CompareCounter::clocks_changed();
        if (part.emu->in_backup() && !stamped && reg(CTRL) & CTRL_BUMODETSEN) {
            stamped = true;
            reg(TIMESTAMP) = value;
            reg(STATUS) |= STATUS_BUMODETS;
        }
    }

private:
    static constexpr uint32_t RETAINED = 128;
    enum Oscillator : uint32_t { NO_CLOCK, LFRCO, LFXO, ULFRCO };  // of CTRL_CLKSEL

    int64_t oscillator_hertz = 0;  // of the oscillator that it keeps running
    int64_t oscillator_origin = 0;
    bool stamped = false;          // in the present backup mode

    // ULFRCO is not divided: it gives 2 kHz with PRESC = DIV1 and 1 kHz with all other values
    // (emlib's BURTC_Init and BURTC_ClockFreqGet).
    Rate clock() const override {
        if (!oscillator_hertz || !counts() || !runs_in_em4()) return Rate();
        const uint32_t divider = field(reg(CTRL), CTRL_PRESC);
        if (field(reg(CTRL), CTRL_CLKSEL) == ULFRCO)
            return {oscillator_hertz * (divider ? 1 : 2), 1, oscillator_origin};
        return {oscillator_hertz, (int64_t)1 << divider, oscillator_origin};
    }

    // Its own clock; without one, only the bus delays a write.
    Rate synchronizer() const override {
        const Rate own = clock();
        return own.runs() ? own : part.rate(Clock::HFCORELE);
    }

    bool counts() const override {
        const uint32_t mode = field(reg(CTRL), CTRL_MODE);
        return mode && !(reg(CTRL) & CTRL_RSTEN) && part.mode <= (int)mode + 1 &&
               part.emu->backup_powered();
    }

    // In EM4 only ULFRCO and the oscillator that EM4CONF names run (10.5.5).
    bool runs_in_em4() const {
        const uint32_t chosen = field(reg(CTRL), CTRL_CLKSEL);
        return part.mode < 4 || chosen == ULFRCO ||
               chosen == field(part.emu->reg(emu::EM4CONF), emu::EM4CONF_OSC);
    }

    void flagged() override {
        if (part.mode == 4 && pending() && part.emu->reg(emu::EM4CONF) & emu::EM4CONF_BURTCWU)
            part.emu->wake_from_em4();
    }

    // The selected oscillator keeps running through resets, if it was running when selected.
    void take_oscillator() {
        const uint32_t chosen = field(reg(CTRL), CTRL_CLKSEL);
        const Clock source = chosen == LFRCO ? Clock::LFRCO
                             : chosen == LFXO ? Clock::LFXO : Clock::ULFRCO;
        if (chosen == NO_CLOCK) {
            oscillator_hertz = 0;
        } else if (part.rate(source).runs()) {
            oscillator_hertz = part.hertz(source);
            oscillator_origin = part.rate(source).origin;
        }
    }
};

}  // namespace

void add_low_energy_timers(Part &part) {
    auto *letimer = part.add(new LeTimer(part, instance::LETIMER0));
    part.add(new Rtc(part, *letimer));
    part.add(new Burtc(part));
}

}  // namespace efm32gg
