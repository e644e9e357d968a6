// RTC and BURTC: low-frequency counters that count up to compare values, and the retention
// registers. EFM32GG Reference Manual, chapters 21 and 22.
//
// Not modelled of BURTC: low power mode, time stamps, failure detection of the LFXO.
#pragma once

#include "efm32gg/part/low_energy.h"

namespace efm32gg {

class CompareCounter : public LowEnergyCounter {
public:
    struct Shape {
        uint32_t count, compare[2];  // offsets; the second may be NONE
        uint32_t last, overflow, compared[2];
        int reflex;                  // PRS source: overflow, then compares
    };
    static constexpr uint32_t NONE = ~0u;

    CompareCounter(Part &part, const Instance &instance, const Shape &shape)
        : LowEnergyCounter(part, instance, shape.count), shape(shape) {}

    void write(uint32_t offset, uint32_t value) override;

protected:
    virtual bool compare_is_top() const = 0;
    // A compare matched, and whether that has an effect beyond the flag.
    virtual void matched(int compare) { (void)compare; }
    virtual bool watched(int compare) const { return (void)compare, false; }
    virtual void flagged() {}  // IF changed

    uint32_t after(int64_t ticks) const override;
    void pass(int64_t ticks) override;
    int64_t next_effect() const override;
    void apply(uint32_t offset, uint32_t value) override;

private:
    const Shape shape;

    uint32_t top() const { return compare_is_top() ? reg(shape.compare[0]) : shape.last; }
    int64_t until_zero() const {
        return (int64_t)(value <= top() ? top() : shape.last) - value + 1;
    }
    int64_t until(uint32_t wanted) const;
};

class LeTimer;

class Rtc : public CompareCounter {
public:
    Rtc(Part &part, const Instance &instance);
    void reset() override;

    LeTimer *letimer = nullptr;  // compare matches may start it

private:
    bool immediate() const override { return true; }
    void apply(uint32_t offset, uint32_t value) override;
    bool counts() const override { return reg(rtc::CTRL) & rtc::CTRL_EN; }
    bool compare_is_top() const override { return reg(rtc::CTRL) & rtc::CTRL_COMP0TOP; }
    void matched(int compare) override;
    bool watched(int compare) const override;
};

// Lives in the backup domain: only a power-on reset or RMU's BURSTEN resets it.
class Burtc : public CompareCounter {
public:
    Burtc(Part &part, const Instance &instance);
    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;

private:
    int64_t oscillator_hertz = 0;  // of the oscillator that it keeps running
    int64_t oscillator_origin = 0;

    Rate clock() const override;
    Rate synchronizer() const override;
    bool counts() const override;
    void flagged() override;
    bool compare_is_top() const override { return reg(burtc::CTRL) & burtc::CTRL_COMP0TOP; }
    void take_oscillator();
};

}  // namespace efm32gg
