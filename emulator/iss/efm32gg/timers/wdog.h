// Watchdog timer. EFM32GG Reference Manual, chapter 12.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Wdog : public Peripheral {
public:
    Wdog(Part &part, const Instance &instance)
        : Peripheral(part, instance), bite(Event::of<&Wdog::on_bite>(this)),
          synchronised(Event::of<&Wdog::on_synchronised>(this)) {}

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changing() override;
    void clocks_changed() override;

private:
    Event bite, synchronised;
    uint32_t effective = 0;   // CTRL as it acts
    bool clearing = false;
    int64_t counted = 0;      // periods of the clock, up to `since`
    int64_t since = 0;
    Rate clock;

    int64_t period() const { return ((int64_t)8 << take(effective, wdog::CTRL_PERSEL)) + 1; }
    Rate source(uint32_t control) const;
    void restart();
    void on_bite(int64_t time);
    void on_synchronised(int64_t time);
};

}  // namespace efm32gg
