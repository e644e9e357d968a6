// Energy management unit: sleep modes. EFM32GG Reference Manual, chapter 10.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Emu : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;

    // The mode that WFI and WFE enter. `deep`: the core's SLEEPDEEP bit. Without a low-frequency
    // oscillator EM2 is EM3 (10.3.4).
    int sleeping_mode(bool deep) const;

    // Wakes the part from EM4 by a reset.
    void wake_from_em4();

private:
    int em4_steps = 0;

    void em4_written(uint32_t value);
};

}  // namespace efm32gg
