// Watchdog timer. EFM32GG Reference Manual, chapter 12.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Wdog : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changing() override;
    void clocks_changed() override;

private:
    Event timeout = Event::of<&Wdog::on_timeout>(this);
    Event synchronised = Event::of<&Wdog::on_synchronised>(this);
    uint32_t effective = 0;   // CTRL as it acts
    bool clearing = false;
    int64_t counted = 0;      // periods of the clock, up to `since`
    int64_t since = 0;
    Rate clock;

    int64_t period() const { return ((int64_t)8 << field(effective, wdog::CTRL_PERSEL)) + 1; }
    Rate source(uint32_t control) const;
    void synchronise();
    void restart();
    void on_timeout(int64_t time);
    void on_synchronised(int64_t time);
};

}  // namespace efm32gg
