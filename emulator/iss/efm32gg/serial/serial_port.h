// Common to USART and LEUART: buffers, pins and the receiver.
#pragma once

#include "efm32gg/memory/dma.h"
#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"

namespace efm32gg {

// A buffer of N frames, the oldest first.
template <int N> class FrameQueue {
public:
    bool empty() const { return !count; }
    bool full() const { return count == N; }
    int size() const { return count; }
    uint32_t front(int index = 0) const { return index < count ? entries[index] : 0; }
    void clear() { count = 0; }
    void push(uint32_t entry) { entries[count++] = entry; }
    // Replaces the newest entry.
    void replace_last(uint32_t entry) { entries[count - 1] = entry; }

    uint32_t pop() {
        const uint32_t entry = front();
        for (int n = 1; n < count; n++)
            entries[n - 1] = entries[n];
        count -= count > 0;
        return entry;
    }

private:
    uint32_t entries[N] = {};
    int count = 0;
};

// Times of characters on the wire: back-to-back characters are timed from a common start, so that
// rounding to picoseconds does not accumulate.
class FrameTiming {
public:
    int64_t begin = 0, end = 0;  // of the latest frame

    // Adds a frame of `units`, with `per_clock` units per period of `clock`. It begins at the end
    // of the previous one if it `follows` that, else at the first edge at or after `now`.
    void append(const Rate &clock, int64_t units, int64_t per_clock, bool follows, int64_t now) {
        if (!follows || rate.origin != clock.origin || !rate.same_frequency(clock)) {
            rate = clock;
            start = clock.time(clock.edge_at_or_after(now));
            passed = 0;
        }
        begin = later(start, rate.span(passed) / per_clock);
        passed += units;
        end = later(start, rate.span(passed) / per_clock);
    }

private:
    Rate rate;
    int64_t start = 0, passed = 0;
};

// The interface of both for characters from outside.
class SerialReceiver {
public:
    virtual ~SerialReceiver() = default;
    // The port pin that it receives on; -1: none.
    virtual int receive_pin() const = 0;
    // A character is complete. `rate`: bits per second of the line, 0: not checked.
    virtual void receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate) = 0;
};

// Bits that have different places in USART and LEUART; those of CTRL, then STATUS, then IF.
struct SerialBits {
    uint32_t loopback, address_mode, address_value, stops_dma;
    uint32_t blocked, complete, level, data_valid;
    uint32_t tx_overflow, rx_overflow, rx_underflow, parity_error, framing_error, address;
};

// The same in both.
enum : uint32_t { SERIAL_CTRL = usart::CTRL, SERIAL_ROUTE = usart::ROUTE };
static_assert(+usart::CTRL == +leuart::CTRL && +usart::ROUTE == +leuart::ROUTE &&
              +usart::ROUTE_TXPEN == +leuart::ROUTE_TXPEN &&
              +usart::ROUTE_RXPEN == +leuart::ROUTE_RXPEN &&
              +usart::ROUTE_LOCATION == +leuart::ROUTE_LOCATION &&
              +usart::STATUS_RXENS == +leuart::STATUS_RXENS &&
              +usart::RXDATAX_FERR == +leuart::RXDATAX_FERR &&
              +usart::RXDATAX_PERR == +leuart::RXDATAX_PERR && +usart::IF_TXC == +leuart::IF_TXC &&
              +usart::IF_TXBL == +leuart::IF_TXBL && +usart::IF_RXDATAV == +leuart::IF_RXDATAV);

// `Base`: Peripheral or LowEnergy.
template <class Base, int TRANSMIT_ENTRIES> class SerialPort : public Base, public SerialReceiver {
public:
    // `unit`: its number in messages; `source`: of its DMA requests; `signals`: of its TX pin, the RX
    // pin's follows.
    SerialPort(Part &part, const Instance &instance, uint32_t status, const SerialBits &bits,
               int unit, int source, int signals)
        : Base(part, instance), status_register(status), bits(bits), unit(unit), source(source),
          signals(signals) {}

    void reset() override {
        Base::reset();
        part.cancel(sent);
        shifting = stalled = false;
        transmit_buffer.clear();
        receive_buffer.clear();
        follow();
    }

    void clocks_changed() override {
        Base::clocks_changed();
        if (stalled && clock_now().runs()) {
            stalled = false;
            part.schedule(sent, part.now());
        }
        start();
        follow();
    }

    int receive_pin() const override {
        const bool routed = reg(SERIAL_ROUTE) & usart::ROUTE_RXPEN;
        return routed ? part.gpio->readable(ROUTES[signals + 1][location()]) : -1;
    }

    void receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate) override {
        const Rate clock = clock_now();
        if (!clock.runs() || !(status() & usart::STATUS_RXENS) || synchronous() ||
            reg(SERIAL_CTRL) & bits.loopback || receive_pin() < 0)
            return;
        if (rate) {
            const double own = clock.frequency() / clocks_per_bit();
            framing_error |= own < 0.96 * rate || own > 1.04 * rate;
        }
        data &= (1u << data_bits()) - 1;
        accept(data | (framing_error ? usart::RXDATAX_FERR : 0) |
               (parity_error ? usart::RXDATAX_PERR : 0));
        follow();
    }

protected:
    using Base::clock_now, Base::part, Base::reg;

    FrameQueue<TRANSMIT_ENTRIES> transmit_buffer;
    FrameQueue<3> receive_buffer;  // two entries and the shift register
    bool shifting = false;
    uint32_t shifted = 0;
    FrameTiming timing;
    Event sent = Event::of<&SerialPort::on_sent>(this);

    virtual bool synchronous() const { return false; }
    virtual int data_bits() const = 0;
    virtual double clocks_per_bit() const = 0;
    // Starts to send if possible; `follows`: directly after another frame.
    virtual void start(bool follows = false) = 0;
    // The frame in `shifted` was sent.
    virtual void finished() = 0;
    // A frame was received, with the error bits of RXDATAX.
    virtual void accept(uint32_t frame) = 0;
    // Whether the transmit buffer requests data.
    virtual bool room() const { return transmit_buffer.empty(); }

    uint32_t &status() { return reg(status_register); }
    uint32_t &flags() { return reg((uint32_t)this->layout.if_); }

    // Sends a frame: its message, and the event at its end.
    void send(Kind kind, int64_t data, const Rate &rate, int64_t units, int64_t units_per_clock,
              bool follows, bool driven) {
        timing.append(rate, units, units_per_clock, follows, part.now());
        shifting = true;
        const bool routed = reg(SERIAL_ROUTE) & usart::ROUTE_TXPEN;
        const int to = routed ? part.gpio->drivable(ROUTES[signals][location()]) : -1;
        if (to >= 0 && driven)
            part.send(kind, unit | to << 8, data, timing.end - timing.begin).time = timing.begin;
        part.schedule(sent, timing.end);
    }

    // Puts a frame into the transmit buffer; false: it is full.
    bool enqueue(uint32_t frame) {
        if (transmit_buffer.full()) {
            this->raise(bits.tx_overflow);
            return false;
        }
        transmit_buffer.push(frame);
        status() &= ~bits.complete;
        return true;
    }

    // Removes the oldest received frame.
    uint32_t take_received() {
        if (receive_buffer.empty()) {
            this->raise(bits.rx_underflow);
            return 0;
        }
        const uint32_t entry = receive_buffer.pop();
        follow();
        return entry;
    }

    // Sets the flags of errors and of an address; returns whether the frame is an address.
    bool set_frame_flags(uint32_t frame) {
        const uint32_t control = reg(SERIAL_CTRL);
        const bool address = control & bits.address_mode &&
                             !!(frame & 0x100) == !!(control & bits.address_value);
        flags() |= (address ? bits.address : 0) |
                   (frame & usart::RXDATAX_FERR ? bits.framing_error : 0) |
                   (frame & usart::RXDATAX_PERR ? bits.parity_error : 0);
        return address;
    }

    // Stores a received frame; if the buffer is full the frame in the shift register is lost.
    void store_received(uint32_t entry) {
        if (receive_buffer.full()) {
            flags() |= bits.rx_overflow;
            receive_buffer.replace_last(entry);
        } else {
            receive_buffer.push(entry);
        }
    }

    void clear_buffers(bool transmit, bool receive) {
        if (transmit)
            transmit_buffer.clear();
        if (receive)
            receive_buffer.clear();
        start();
    }

    // Updates flags, requests and interrupts from the buffers.
    virtual void follow() {
        set_bits(status(), bits.level, room());
        set_bits(flags(), usart::IF_TXBL, room());
        set_bits(status(), bits.data_valid, !receive_buffer.empty());
        set_bits(flags(), usart::IF_RXDATAV, !receive_buffer.empty());
        const bool stopped = reg(SERIAL_CTRL) & bits.stops_dma &&
                             flags() & (bits.framing_error | bits.parity_error);
        part.dma->request(source, 0, !receive_buffer.empty() && !stopped);
        part.dma->request(source, 1, room());
        part.dma->request(source, 2, transmit_buffer.empty() && !shifting);
        this->update_interrupts();
    }

    const uint32_t status_register;
    const SerialBits bits;
    const int unit, source, signals;

private:
    bool stalled = false;

    uint32_t location() const { return field(reg(SERIAL_ROUTE), usart::ROUTE_LOCATION); }

    void on_sent(int64_t) {
        if (!clock_now().runs()) {  // asleep or without clock: continues when that is back
            stalled = true;
            return;
        }
        shifting = false;
        finished();
        if (transmit_buffer.empty()) {
            status() |= bits.complete;
            flags() |= usart::IF_TXC;
            completed();
        }
        start(true);
        follow();
    }

    virtual void completed() {}
};

}  // namespace efm32gg
