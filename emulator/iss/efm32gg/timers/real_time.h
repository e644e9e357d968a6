// RTC and BURTC: low frequency counters that count up to compare values, and the retention
// registers. EFM32GG Reference Manual, chapters 21 and 22.
//
// Not modelled of BURTC: low power mode, time stamps, failure detection of the LFXO.
#pragma once

#include "efm32gg/part/low_energy.h"

namespace efm32gg {

// What both have: a counter of some bits, compares, an overflow, computed when looked at.
class CompareCounter : public LowEnergy {
public:
    struct Shape {
        uint32_t count, compare[2];  // offsets; the second may be NONE
        uint32_t last, overflow, compared[2];
        int reflex;                  // PRS source: overflow, then compares
    };
    static constexpr uint32_t NONE = ~0u;

    CompareCounter(Part &part, const Instance &instance, const Shape &shape, uint32_t freeze,
                   uint32_t synchronizing);

    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changing() override { fold(); }
    void clocks_changed() override;

protected:
    virtual Rate clock() const = 0;
    virtual bool counts() const = 0;
    virtual bool compare_is_top() const = 0;
    virtual void matched(int compare) { (void)compare; }
    virtual bool watched(int compare) const { return (void)compare, false; }
    virtual void flagged() {}  // IF has changed

    void apply(uint32_t offset, uint32_t value) override;
    void clear_count();
    void fold();
    void plan();

private:
    static constexpr int64_t FAR = INT64_MAX;

    const Shape shape;
    Rate ticks;
    int64_t counted = 0;
    uint32_t value = 0;
    Event due = Event::of<&CompareCounter::on_due>(this);

    uint32_t top() const { return compare_is_top() ? reg(shape.compare[0]) : shape.last; }
    int64_t steps() const;
    int64_t until_zero() const {
        return (int64_t)(value <= top() ? top() : shape.last) - value + 1;
    }
    int64_t until(uint32_t wanted) const;
    uint32_t after(int64_t passed) const;
    void on_due(int64_t time);
    void follow_clock();
};

class LeTimer;

class Rtc : public CompareCounter {
public:
    Rtc(Part &part, const Instance &instance);
    void reset() override;

    LeTimer *started = nullptr;  // by compare matches, when it asks for that

private:
    uint32_t busy_bit(uint32_t offset) const override;
    bool immediate() const override { return true; }
    void apply(uint32_t offset, uint32_t value) override;
    Rate clock() const override { return part.unit_rate(instance); }
    bool counts() const override { return reg(rtc::CTRL) & rtc::CTRL_EN; }
    bool compare_is_top() const override { return reg(rtc::CTRL) & rtc::CTRL_COMP0TOP; }
    void matched(int compare) override;
    bool watched(int compare) const override;
};

// Lives in the backup domain: nothing but a power-on reset, or RMU's BURSTEN, resets it.
class Burtc : public CompareCounter {
public:
    Burtc(Part &part, const Instance &instance);
    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;

private:
    int64_t oscillator_hertz = 0;  // of the one that it keeps running
    int64_t oscillator_origin = 0;

    uint32_t busy_bit(uint32_t offset) const override;
    Rate clock() const override;
    Rate synchronizer() const override;
    bool counts() const override;
    void flagged() override;
    bool compare_is_top() const override { return reg(burtc::CTRL) & burtc::CTRL_COMP0TOP; }
    void take_oscillator();
};

}  // namespace efm32gg
