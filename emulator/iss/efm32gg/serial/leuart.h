// LEUART, which works down to EM2. EFM32GG Reference Manual, chapter 19.
#pragma once

#include "efm32gg/part/low_energy.h"
#include "efm32gg/serial/frame_queue.h"
#include "efm32gg/serial/frame_timing.h"

namespace efm32gg {

class Leuart : public LowEnergy {
public:
    static constexpr int FIRST_UNIT = 5;  // number of LEUART0 in messages

    // `source`: of its DMA requests; `signals`: of its TX pin, the RX pin's follows.
    Leuart(Part &part, const Instance &instance, int source, int signals)
        : LowEnergy(part, instance), source(source), signals(signals) {}

    void reset() override;
    uint32_t read(uint32_t offset) override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override;

    void receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate);
    int transmit_pin() const;
    int receive_pin() const;

private:
    const int source, signals;
    FrameQueue<1> transmit_buffer;
    FrameQueue<3> receive_buffer;  // two entries and the shift register
    bool shifting = false, stalled = false;
    uint32_t shifted = 0;
    FrameTiming timing;
    Event sent = Event::of<&Leuart::on_sent>(this);

    void apply(uint32_t offset, uint32_t value) override;
    uint32_t merge_commands(uint32_t older, uint32_t newer) const override;
    int data_bits() const { return reg(leuart::CTRL) & leuart::CTRL_DATABITS ? 9 : 8; }
    void command(uint32_t value);
    void start(bool follows = false);
    void on_sent(int64_t time);
    void accept(uint32_t frame);
    void follow();
};

}  // namespace efm32gg
