// Peripherals of the low frequency domain: a write reaches them some of their clocks later.
// EFM32GG Reference Manual, 5.3.1.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class LowEnergy : public Peripheral {
public:
    LowEnergy(Part &part, const Instance &instance, uint32_t freeze, uint32_t synchronizing,
              uint32_t command);

    void reset() override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;

protected:
    // SYNCBUSY's bit for a register; 0 for one that is not synchronized.
    virtual uint32_t busy_bit(uint32_t offset) const = 0;
    // A write has arrived.
    virtual void apply(uint32_t offset, uint32_t value) { Peripheral::write(offset, value); }
    // Of units with immediate synchronization (RTC, LETIMER) a write arrives at once, and SYNCBUSY
    // shows that it happened.
    virtual bool immediate() const { return false; }
    // Commands that follow each other before they have arrived are not lost.
    virtual uint32_t both(uint32_t older, uint32_t newer) const { return older | newer; }
    // The clock that a write has to wait for.
    virtual Rate synchronizer() const { return part.unit_rate(instance); }

private:
    static constexpr int MOST = 8;
    struct Late {
        uint32_t offset, value;
        bool applied;
    };

    const uint32_t freeze, synchronizing, commands;
    Late late[MOST];
    int late_count = 0;
    Event arrived = Event::of<&LowEnergy::on_arrived>(this);

    void start();
    void on_arrived(int64_t time);
};

}  // namespace efm32gg
