// DMA controller: PL230 with 12 channels. EFM32GG Reference Manual, chapter 8; ARM DDI 0417.
//
// A channel's request is served as the controller does: one arbitration moves up to 2^R items,
// reads the descriptor before and writes it back after. What one costs in HFCORECLK cycles is an
// estimate (the manuals give none) and delays the next and the interrupt; the core is not slowed.
// Requests of units with buffers of two count as single requests: one item each.
// Not modelled: loops and rectangles of channels 0 and 1.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Dma : public Peripheral {
public:
    static constexpr int CHANNELS = 12;

    Dma(Part &part, const Instance &instance);

    void reset() override;
    uint32_t read(uint32_t offset) override { return peek(offset); }
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override { consider(); }

    // A unit's request, by the numbers of CHn_CTRL: as long as it lasts, or until it is served.
    void request(int source, int signal, bool on);
    void pulse(int source, int signal);
    // Whether a unit's requests are served in EM2 too.
    void wakes(int source, bool on);
    // Whether a channel has chosen that request: units that count lazily ask.
    bool listens(int source, int signal) const;

private:
    static constexpr int SOURCES = 64;

    uint8_t levels[SOURCES] = {}, pulses[SOURCES] = {};
    uint64_t waking = 0;
    uint32_t enabled_channels = 0, alternates = 0, bursts = 0, masked = 0, high = 0;
    uint32_t software = 0;   // requests by CHSWREQ
    uint32_t continued = 0;  // go on without a request
    uint32_t done = 0;       // raised when the running round is over
    bool failed = false;
    Event serve = Event::of<&Dma::on_serve>(this);

    int source(int channel) const;
    bool requested(int channel) const;
    bool wants(int channel) const;
    int next() const;
    void consider();
    int64_t delay(int64_t cycles) const;
    void on_serve(int64_t time);
    int64_t round(int channel);
    void finish(int channel);
    void error(int channel);
    void update_interrupts() override;
};

}  // namespace efm32gg
