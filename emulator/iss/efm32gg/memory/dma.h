// DMA controller: PL230 with 12 channels. EFM32GG Reference Manual, chapter 8; ARM DDI 0417.
//
// One arbitration moves up to 2^R items; it reads the channel's descriptor before and writes it
// back after. Its cost in HFCORECLK cycles is an estimate (the manuals give none); it delays the
// next arbitration and the interrupt, but does not slow the core. Requests of units with buffers of
// two entries count as single requests: one item each. Not modelled: loops and rectangles of
// channels 0 and 1.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Dma : public Peripheral {
public:
    static constexpr int CHANNELS = 12;

    using Peripheral::Peripheral;

    void reset() override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override { consider(); }

    // A unit's request, by the numbers of CHn_CTRL: a level, or a pulse that lasts until served.
    void request(int source, int signal, bool on);
    void pulse(int source, int signal);
    // Whether a unit's requests are served in EM2 too.
    void wakes(int source, bool on);
    // Whether a channel selects that request; units that count lazily schedule events for it.
    bool listens(int source, int signal) const;

private:
    static constexpr int SOURCES = 64;
    struct ChannelBits {
        uint32_t set, clear;
        uint32_t Dma::*bits;
    };
    static const ChannelBits CHANNEL_BITS[];

    uint8_t levels[SOURCES] = {}, pulses[SOURCES] = {};
    uint64_t waking = 0;
    uint32_t enabled_channels = 0, alternates = 0, bursts = 0, masked = 0, high = 0;
    uint32_t software = 0;   // requests by CHSWREQ
    uint32_t continued = 0;  // channels that continue without a request
    uint32_t done = 0;       // channels whose flag is raised at the end of the running round
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
};

}  // namespace efm32gg
