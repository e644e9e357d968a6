// PCNT: counts edges at its first input, in the direction given by CTRL or by its second input.
// EFM32GG Reference Manual, chapter 24. Not modelled: quadrature, filter, auxiliary counter.
#pragma once

#include "efm32gg/part/low_energy.h"

namespace efm32gg {

class PulseCounter : public LowEnergy {
public:
    // `signals`: route::Signal of its first input; the second one follows.
    PulseCounter(Part &part, const Instance &instance, int signals)
        : LowEnergy(part, instance), signals(signals) {}

    void pin_changed(int port, int bit, bool level) override;
    void prs_changed(int channel, bool level) override;

private:
    const int signals;
    bool listening = false;

    void apply(uint32_t offset, uint32_t value) override;
    int pin(int signal) const;
    void edge(bool rising);
};

}  // namespace efm32gg
