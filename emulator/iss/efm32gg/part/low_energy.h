// Peripherals of the low-frequency domain: a write takes effect some of their clocks later.
// EFM32GG Reference Manual, 5.3.1.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class LowEnergy : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;

protected:
    // A write takes effect.
    virtual void apply(uint32_t offset, uint32_t value) { Peripheral::write(offset, value); }
    // Units with immediate synchronization (RTC, LETIMER) apply a write at once; SYNCBUSY reports
    // it all the same.
    virtual bool immediate() const { return false; }
    // Merges two commands of which the older one has not taken effect yet.
    virtual uint32_t merge_commands(uint32_t older, uint32_t newer) const { return older | newer; }
    // The clock that synchronizes writes.
    virtual Rate synchronizer() const { return clock_now(); }

private:
    static constexpr int MOST = 8;
    struct Write {
        uint32_t offset, value;
        bool applied;
    };

    Write waiting[MOST];
    int count = 0;
    Event synchronized = Event::of<&LowEnergy::on_synchronized>(this);

    bool frozen() const { return reg((uint32_t)layout.freeze) & 1; }
    void start();
    void on_synchronized(int64_t time);
};

// A counter of a low-energy unit, computed from the time when it is accessed. An event is scheduled
// only for ticks that have an effect beyond the counter.
class LowEnergyCounter : public LowEnergy {
public:
    LowEnergyCounter(Part &part, const Instance &instance, uint32_t count_register)
        : LowEnergy(part, instance), count_register(count_register) {}

    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void clocks_changing() override { fold(); }
    void clocks_changed() override;

protected:
    static constexpr int64_t FAR = INT64_MAX;

    virtual Rate clock() const { return clock_now(); }
    virtual bool counts() const = 0;
    // The counter `ticks` from now.
    virtual uint32_t after(int64_t ticks) const = 0;
    // Performs that many ticks, 1 or more.
    virtual void pass(int64_t ticks) = 0;
    // Ticks until the next one with an effect; FAR for none.
    virtual int64_t next_effect() const = 0;

    void clear_count();
    // Updates the counter to now.
    void fold();
    void plan();
    void follow_clock();
    // Counts from now on, at the unit's clock.
    void restart_clock();

    uint32_t value = 0;

private:
    const uint32_t count_register;
    Rate rate;
    int64_t counted = 0;    // edges of `rate` that `value` includes
    Event due = Event::of<&LowEnergyCounter::on_due>(this);

    int64_t ticks() const;
    void on_due(int64_t time);
};

}  // namespace efm32gg
