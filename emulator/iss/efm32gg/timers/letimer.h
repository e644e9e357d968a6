// LETIMER: counts down in EM2, repeats, drives two outputs. EFM32GG Reference Manual, chapter 23.
#pragma once

#include "efm32gg/part/low_energy.h"

namespace efm32gg {

class LeTimer : public LowEnergy {
public:
    LeTimer(Part &part, const Instance &instance);

    void reset() override;
    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changing() override { fold(); }
    void clocks_changed() override;

    // The RTC's compare matches may start it.
    void compare_matched(int compare);
    bool awaits(int compare) const;

private:
    static constexpr int64_t FAR = INT64_MAX;

    Rate ticks;
    int64_t counted = 0;
    uint32_t value = 0;
    bool running = false, buffered = false, outputs[2] = {}, pulsing[2] = {};
    Event due = Event::of<&LeTimer::on_due>(this);

    uint32_t busy_bit(uint32_t offset) const override;
    bool immediate() const override { return true; }
    void apply(uint32_t offset, uint32_t value) override;
    uint32_t top() const;
    uint32_t repeat_mode() const { return take(reg(letimer::CTRL), letimer::CTRL_REPMODE); }
    uint32_t action(int output) const;
    int64_t steps() const;
    void fold();
    void pass(int64_t passed);
    void underflow();
    void count_down(int which);
    int64_t until(uint32_t wanted) const;
    bool outputs_matter() const;
    void plan();
    void on_due(int64_t time);
    void start();
    void show();
    int pin(int output) const;
};

}  // namespace efm32gg
