// ADC: single conversions and scans. EFM32GG Reference Manual, chapter 28.
//
// Conversions are ideal: no noise, offset or gain error. DAC outputs read 0 V.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Adc : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override;
    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;
    void prs_changed(int channel, bool level) override;

private:
    bool single_wanted = false, scanning = false, converting = false, stalled = false;
    bool single_running = false;   // the running conversion is a single one, not of a scan
    uint32_t to_scan = 0;          // channels of the scan still to be converted
    int scan_channel = 0;
    bool warm = false;             // reference and converter, from an earlier conversion
    uint32_t warm_reference = ~0u;
    Event converted = Event::of<&Adc::on_converted>(this);

    double volts(int input) const;
    double reference(uint32_t control) const;
    double input_volts(uint32_t selected, bool difference, double reference) const;
    uint32_t result(uint32_t control, uint32_t selected) const;
    int64_t warm_up(uint32_t control);
    int64_t cycles(uint32_t control) const;
    void begin();
    void start_scan();
    void on_converted(int64_t time);
    void follow();
};

}  // namespace efm32gg
