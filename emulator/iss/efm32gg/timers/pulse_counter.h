// PCNT: counts edges at its first input, with the direction of CTRL or of its second input.
// EFM32GG Reference Manual, chapter 24. Not modelled: quadrature, filter, auxiliary counter.
#pragma once

#include "efm32gg/part/low_energy.h"

namespace efm32gg {

class PulseCounter : public LowEnergy {
public:
    PulseCounter(Part &part, const Instance &instance, int signals);

    void reset() override;
    void pin_changed(int port, int bit, bool level) override;
    void prs_changed(int channel, bool level) override;

private:
    const int signals;
    bool listening = false;

    uint32_t busy_bit(uint32_t offset) const override;
    void apply(uint32_t offset, uint32_t value) override;
    int pin(int signal) const;
    void edge(bool rising);
};

}  // namespace efm32gg
