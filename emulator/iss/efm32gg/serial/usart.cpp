// USART and UART. EFM32GG Reference Manual, chapter 17.
//
// A character is sent as one message with its duration, and received at the end of its stop bit. As
// SPI master each word is sent likewise; the line from the slave is idle high, or the master's own
// output with LOOPBK. Not modelled: SPI slave, I2S, IrDA, smart card mode, collisions.
#include "efm32gg/pins/prs.h"
#include "efm32gg/serial/serial_port.h"

namespace efm32gg {

namespace {

using namespace usart;

// Durations are counted in units of 1/512 HFPERCLK cycle, so that half a bit is a whole number.
constexpr int64_t UNITS = 512;
// Control bits of TXDATAX beside the data.
constexpr uint32_t CONTROLS = 0xF800;
constexpr uint32_t RX_FLAGS = IF_RXDATAV | IF_RXFULL | IF_RXOF | IF_RXUF | IF_PERR | IF_FERR |
                              IF_MPAF | IF_SSM;
constexpr int OVERSAMPLING[] = {16, 8, 6, 4};
constexpr SerialBits BITS = {CTRL_LOOPBK, CTRL_MPM, CTRL_MPAB, CTRL_ERRSDMA, STATUS_RXBLOCK,
                             STATUS_TXC, STATUS_TXBL, STATUS_RXDATAV, IF_TXOF, IF_RXOF, IF_RXUF,
                             IF_PERR, IF_FERR, IF_MPAF};

class Usart : public SerialPort<Peripheral, 2> {
public:
    // `reflex`: of its PRS signals.
    Usart(Part &part, const Instance &instance, int source, int reflex, int signals)
        : SerialPort(part, instance, STATUS, BITS, instance.index, source, signals),
          reflex(reflex) {}

    uint32_t read(uint32_t offset) override {
        switch (offset) {
        case RXDATA: return take_received() & 0xFF;
        case RXDATAX: return take_received();
        case RXDOUBLE: {
            const uint32_t first = take_received() & 0xFF;
            return first | (take_received() & 0xFF) << 8;
        }
        case RXDOUBLEX: {
            const uint32_t first = take_received();
            return first | take_received() << 16;
        }
        }
        return peek(offset);
    }

    uint32_t peek(uint32_t offset) const override {
        const uint32_t first = receive_buffer.front(0), second = receive_buffer.front(1);
        switch (offset) {
        case RXDATA: return first & 0xFF;
        case RXDATAX: case RXDATAXP: return first;
        case RXDOUBLE: return (first & 0xFF) | (second & 0xFF) << 8;
        case RXDOUBLEX: case RXDOUBLEXP: return first | second << 16;
        }
        return Peripheral::peek(offset);
    }

    void write(uint32_t offset, uint32_t value) override {
        const uint32_t eighth = reg(CTRL) & CTRL_BIT8DV ? 0x100 : 0;
        switch (offset) {
        case CMD: return command(value);
        case TXDATA: return put((value & 0xFF) | eighth);
        case TXDATAX: return put(value & 0xF9FF);
        case TXDOUBLE:
            put((value & 0xFF) | eighth);
            return put((value >> 8 & 0xFF) | eighth);
        case TXDOUBLEX:
            put(value & 0xF9FF);
            return put(value >> 16 & 0xF9FF);
        }
        Peripheral::write(offset, value);
        if (offset == I2SCTRL && value & I2SCTRL_EN)
            part.log_once("%s: I2S is not modelled", instance.name);
        if (offset == CTRL || offset == IFC)
            follow();
    }

private:
    const int reflex;

    bool synchronous() const override { return reg(CTRL) & CTRL_SYNC; }
    double clocks_per_bit() const override { return 2.0 * (double)bit_units() / UNITS; }
    bool room() const override {
        return reg(CTRL) & CTRL_TXBIL ? !transmit_buffer.full() : transmit_buffer.empty();
    }

    int data_bits() const override {
        const int code = (int)field(reg(FRAME), FRAME_DATABITS);
        return code >= 1 && code <= 13 ? code + 3 : 8;
    }

    // Half a bit, in units: a bit takes oversampling * (1 + CLKDIV / 256) cycles (17.3.2.3), or
    // twice the factor in synchronous mode (17.3.3.1).
    int64_t bit_units() const {
        const int64_t divided = 256 + reg(CLKDIV);
        return synchronous() ? 2 * divided : OVERSAMPLING[field(reg(CTRL), CTRL_OVS)] * divided;
    }

    int64_t frame_units() const {
        if (synchronous()) return 2 * data_bits() * bit_units();
        const bool parity = field(reg(FRAME), FRAME_PARITY) & 2;
        const int64_t stop_halves = 1 + field(reg(FRAME), FRAME_STOPBITS);
        return (2 * (1 + data_bits() + parity) + stop_halves) * bit_units();
    }

    void command(uint32_t value) {
        command_bit(status(), STATUS_RXENS, value, CMD_RXEN, CMD_RXDIS);
        command_bit(status(), STATUS_TXENS, value, CMD_TXEN, CMD_TXDIS);
        command_bit(status(), STATUS_MASTER, value, CMD_MASTEREN, CMD_MASTERDIS);
        command_bit(status(), STATUS_RXBLOCK, value, CMD_RXBLOCKEN, CMD_RXBLOCKDIS);
        command_bit(status(), STATUS_TXTRI, value, CMD_TXTRIEN, CMD_TXTRIDIS);
        clear_buffers(value & CMD_CLEARTX, value & CMD_CLEARRX);
        follow();
    }

    void put(uint32_t frame) {
        if (!enqueue(frame)) return;
        start();
        follow();
    }

    void start(bool follows = false) override {
        if (shifting || transmit_buffer.empty() || !(status() & STATUS_TXENS)) return;
        if (synchronous() && !(status() & STATUS_MASTER)) return;
        const int bits = data_bits();
        if (bits > 9 && transmit_buffer.size() < 2) return;
        const Rate rate = clock_now();
        if (!rate.runs()) return;
        const uint32_t frame = transmit_buffer.pop();
        uint32_t data = frame & TXDATAX_TXDATAX;
        if (bits > 9)
            data = (frame & 0xFF) | (transmit_buffer.pop() & 0xFF) << 8;
        data &= (1u << bits) - 1;
        shifted = data | (frame & CONTROLS);
        const bool breaks = frame & TXDATAX_TXBREAK && !synchronous();
        send(synchronous() ? Kind::SPI : Kind::UART, breaks ? 0x10000 : data, rate, frame_units(),
             UNITS, follows, !(status() & STATUS_TXTRI));
    }

    void finished() override {
        const uint32_t data = shifted & ~(data_bits() > 9 ? 0 : CONTROLS);
        if (synchronous()) {
            if (status() & STATUS_RXENS)
                accept(reg(CTRL) & CTRL_LOOPBK ? data : (1u << data_bits()) - 1);
            return;
        }
        if (shifted & TXDATAX_UBRXAT)
            status() &= ~STATUS_RXBLOCK;
        if (shifted & TXDATAX_TXTRIAT)
            status() |= STATUS_TXTRI;
        if (shifted & TXDATAX_TXDISAT)
            status() &= ~STATUS_TXENS;
        if (reg(CTRL) & CTRL_LOOPBK && status() & STATUS_RXENS)
            accept(data);
        if (shifted & TXDATAX_RXENAT)
            status() |= STATUS_RXENS;
    }

    void completed() override { part.prs->pulse(reflex, 1); }

    void accept(uint32_t frame) override {
        const uint32_t control = reg(CTRL);
        const bool address = set_frame_flags(frame);
        const bool error = frame & (RXDATAX_FERR | RXDATAX_PERR);
        if (error && control & CTRL_ERRSRX)
            status() &= ~STATUS_RXENS;
        if (error && control & CTRL_ERRSTX)
            status() &= ~STATUS_TXENS;
        if ((status() & STATUS_RXBLOCK && !address) ||
            (frame & RXDATAX_PERR && control & CTRL_SKIPPERRF))
            return;
        const int entries = data_bits() > 9 ? 2 : 1;
        for (int n = 0; n < entries; n++) {
            store_received(entries == 1 ? frame : frame >> 8 * n & 0xFF);
            if (receive_buffer.size() == 2)
                flags() |= IF_RXFULL;
        }
        part.prs->pulse(reflex, 2);
    }

    void follow() override {
        set_bits(status(), STATUS_RXFULL, receive_buffer.size() >= 2);
        SerialPort::follow();
    }

    void update_interrupts() override {
        line(0, pending() & RX_FLAGS);
        line(1, pending() & ~RX_FLAGS);
    }
};

}  // namespace

void add_usart(Part &part, const Instance &instance, int source, int reflex, int signals) {
    part.receivers.push_back(part.add(new Usart(part, instance, source, reflex, signals)));
}

}  // namespace efm32gg
