// USART and UART. EFM32GG Reference Manual, chapter 17.
//
// A character is sent as one message with its duration, and received at the end of its stop bit. As
// SPI master each word is sent likewise; the line from the slave is idle high, or the master's own
// output with LOOPBK. Not modelled: SPI slave, I2S, IrDA, smart card mode, collisions.
#pragma once

#include "efm32gg/part/part.h"
#include "efm32gg/serial/frame_queue.h"
#include "efm32gg/serial/frame_timing.h"

namespace efm32gg {

class Usart : public Peripheral {
public:
    // `source`: of its DMA requests; `reflex`: of its PRS signals; `signals`: of its TX pin, the RX
    // pin's follows.
    Usart(Part &part, const Instance &instance, int source, int reflex, int signals)
        : Peripheral(part, instance), source(source), reflex(reflex), signals(signals) {}

    void reset() override;
    uint32_t read(uint32_t offset) override;
    void write(uint32_t offset, uint32_t value) override;
    uint32_t peek(uint32_t offset) const override;
    void clocks_changed() override;

    // A character is complete. `rate`: bits per second of the line, 0: not checked.
    void receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate);

    // The port pins that it sends and receives on; -1: none.
    int transmit_pin() const;
    int receive_pin() const;

private:
    const int source, reflex, signals;
    FrameQueue<2> transmit_buffer;
    FrameQueue<3> receive_buffer;  // two entries and the shift register
    bool shifting = false, stalled = false;
    uint32_t shifted = 0;
    FrameTiming timing;
    Event sent = Event::of<&Usart::on_sent>(this);

    bool synchronous() const { return reg(usart::CTRL) & usart::CTRL_SYNC; }
    int data_bits() const;
    int64_t bit_units() const;
    int64_t frame_units() const;
    void command(uint32_t value);
    void enqueue(uint32_t frame);
    void start(bool follows = false);
    void on_sent(int64_t time);
    void accept(uint32_t frame);
    uint32_t take_received();
    void follow();
    void update_interrupts() override;
};

}  // namespace efm32gg
