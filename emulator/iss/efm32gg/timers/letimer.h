// LETIMER: counts down in EM2, repeats, drives two outputs. EFM32GG Reference Manual, chapter 23.
#pragma once

#include "efm32gg/part/low_energy.h"

namespace efm32gg {

class LeTimer : public LowEnergyCounter {
public:
    LeTimer(Part &part, const Instance &instance)
        : LowEnergyCounter(part, instance, letimer::CNT) {}

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;

    // The RTC's compare matches may start it.
    void compare_matched(int compare);
    bool awaits(int compare) const;

private:
    bool running = false, buffered = false, outputs[2] = {}, pulsing[2] = {};

    bool immediate() const override { return true; }
    void apply(uint32_t offset, uint32_t value) override;
    bool counts() const override { return running; }
    uint32_t after(int64_t ticks) const override;
    void pass(int64_t ticks) override;
    int64_t next_effect() const override;
    uint32_t top() const;
    uint32_t repeat_mode() const { return field(reg(letimer::CTRL), letimer::CTRL_REPMODE); }
    uint32_t action(int output) const;
    void underflow();
    void count_down(int which);
    // Ticks until the counter reaches and leaves `wanted`; FAR if it does not.
    int64_t until(uint32_t wanted) const;
    int64_t until_left(uint32_t wanted) const;
    bool outputs_matter() const;
    void start();
    void stop();
    void show_outputs();
    int pin(int output) const;
};

}  // namespace efm32gg
