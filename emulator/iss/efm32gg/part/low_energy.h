// Peripherals of the low-frequency domain: a write takes effect some of their clocks later.
// EFM32GG Reference Manual, 5.3.1.
#pragma once

#include "efm32gg/part/synchronizer.h"

#include <algorithm>
#include <utility>

namespace efm32gg {

class LowEnergy : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override {
        Peripheral::reset();
        synchronizing.clear();
        count = 0;
    }

    void write(uint32_t offset, uint32_t value) override {
        const Register *written = described(offset);
        if (!written || !written->busy) {
            const bool was_frozen = frozen();
            Peripheral::write(offset, value);
            if (frozen())
                synchronizing.clear();
            else if (was_frozen && count)
                synchronizing.start(synchronizer());
            return;
        }
        reg((uint32_t)layout.syncbusy) |= written->busy;
        const bool at_once = immediate() && !frozen();
        Write *place = waiting;
        while (place < waiting + count && place->offset != offset)
            place++;
        if (place == waiting + MOST) return;
        if (place == waiting + count) {
            *place = {offset, 0, false};
            count++;
        }
        // A newer value replaces the older one; commands are merged.
        const bool merges = (int32_t)offset == layout.cmd && !place->applied;
        *place = {offset, merges ? merge_commands(place->value, value) : value, at_once};
        if (at_once)
            apply(offset, value);
        if (!frozen())
            synchronizing.start(synchronizer());
    }

    void clocks_changed() override { synchronizing.follow(synchronizer()); }

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
    // An edge of a clock that has no rate.
    void clock_edge() {
        if (synchronizing.tick())
            on_synchronized(part.now());
    }

private:
    static constexpr int MOST = 24;
    struct Write {
        uint32_t offset, value;
        bool applied;
    };

    Write waiting[MOST];
    int count = 0;
    Synchronizer synchronizing{part, Event::of<&LowEnergy::on_synchronized>(this)};

    bool frozen() const { return layout.freeze >= 0 && reg((uint32_t)layout.freeze) & 1; }

    void on_synchronized(int64_t) {
        synchronizing.clear();
        Write done[MOST];
        const int number = std::exchange(count, 0);
        std::copy(waiting, waiting + number, done);
        reg((uint32_t)layout.syncbusy) = 0;
        for (int n = 0; n < number; n++)
            if (!done[n].applied)
                apply(done[n].offset, done[n].value);
    }
};

// A counter of a low-energy unit, computed from the time when it is accessed. An event is scheduled
// only for ticks that have an effect beyond the counter.
//
// The rule of all counters: a compare flag is set by the clock edge that ends the period in which
// the counter equals the compare value, so with that value as top the counter reads 0 (LETIMER: the
// next lower value) when the flag comes, and an equal value at the start matches. The manual says
// "when equal" and does not show the edge; software of the vendor and of two RTOS depends on it, and
// TIMER of a later part of the same family was measured to behave so.
class LowEnergyCounter : public LowEnergy {
public:
    LowEnergyCounter(Part &part, const Instance &instance, uint32_t count_register)
        : LowEnergy(part, instance), count_register(count_register) {}

    uint32_t read(uint32_t offset) override {
        if (ticks()) {
            fold();
            plan();
        }
        return peek(offset);
    }

    uint32_t peek(uint32_t offset) const override {
        return offset == count_register ? after(ticks()) : LowEnergy::peek(offset);
    }

    void clocks_changing() override { fold(); }

    void clocks_changed() override {
        LowEnergy::clocks_changed();
        follow_clock();
        plan();
    }

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

    void clear_count() {
        part.cancel(due);
        value = 0;
        rate = Rate();
        counted = 0;
    }

    // Updates the counter to now.
    void fold() {
        const int64_t passed = ticks();
        if (passed <= 0) return;
        counted += passed;
        pass(passed);
    }

    void plan() {
        part.cancel(due);
        if (!counts() || !rate.runs()) return;
        const int64_t next = next_effect();
        if (next != FAR)
            part.schedule(due, rate.time(counted + next));
    }

    void follow_clock() {
        const Rate wanted = clock();
        if (wanted.runs() != rate.runs() || wanted.origin != rate.origin ||
            !wanted.same_frequency(rate))
            restart_clock();
    }

    // Counts from now on, at the unit's clock.
    void restart_clock() {
        rate = clock();
        counted = rate.edges(part.now());
    }

    uint32_t value = 0;

private:
    const uint32_t count_register;
    Rate rate;
    int64_t counted = 0;    // edges of `rate` that `value` includes
    Event due = Event::of<&LowEnergyCounter::on_due>(this);

    int64_t ticks() const {
        return counts() && rate.runs() ? rate.edges(part.now()) - counted : 0;
    }

    void on_due(int64_t) {
        fold();
        plan();
    }
};

}  // namespace efm32gg
