// Peripheral reflex system: connects signals of peripherals to other peripherals. EFM32GG Reference
// Manual, chapter 13. Consumers are notified by Peripheral::prs_changed.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Prs : public Peripheral {
public:
    static constexpr int CHANNELS = 12;

    using Peripheral::Peripheral;

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;

    // Sets a producer's signal, or pulses it for one clock. Sources and signals have the numbers
    // of SOURCESEL and SIGSEL.
    void set(int source, int signal, bool level);
    void pulse(int source, int signal);
    // Whether a channel selects that signal; units that count lazily schedule events for it.
    bool listens(int source, int signal) const;
    bool level(int channel) const { return levels >> channel & 1; }

private:
    uint8_t signals[64] = {};    // levels by source, one bit per signal
    uint32_t levels = 0;

    bool selects(int channel, int source, int signal) const;
    bool input(int channel) const;
    void update(int channel, bool was);
    void output(int channel, bool level);
    void output_pulse(int channel);
};

}  // namespace efm32gg
