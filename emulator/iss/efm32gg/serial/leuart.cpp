// LEUART, which works down to EM2. EFM32GG Reference Manual, chapter 19.
#include "efm32gg/part/low_energy.h"
#include "efm32gg/serial/serial_port.h"

namespace efm32gg {

namespace {

using namespace leuart;

constexpr int FIRST_UNIT = 5;  // number of LEUART0 in messages
constexpr SerialBits BITS = {CTRL_LOOPBK, CTRL_MPM, CTRL_MPAB, CTRL_ERRSDMA, STATUS_RXBLOCK,
                             STATUS_TXC, STATUS_TXBL, STATUS_RXDATAV, IF_TXOF, IF_RXOF, IF_RXUF,
                             IF_PERR, IF_FERR, IF_MPAF};

class Leuart : public SerialPort<LowEnergy, 1> {
public:
    Leuart(Part &part, const Instance &instance, int source, int signals)
        : SerialPort(part, instance, STATUS, BITS, FIRST_UNIT + instance.index, source, signals) {}

    uint32_t peek(uint32_t offset) const override {
        switch (offset) {
        case RXDATA: return receive_buffer.front() & 0xFF;
        case RXDATAX:
        case RXDATAXP: return receive_buffer.front();
        }
        return Peripheral::peek(offset);
    }

    uint32_t read(uint32_t offset) override {
        switch (offset) {
        case RXDATA: return take_received() & 0xFF;
        case RXDATAX: return take_received();
        }
        return peek(offset);
    }

    void write(uint32_t offset, uint32_t value) override {
        // A frame enters the buffer now, and the shift register once it is synchronised.
        const uint32_t eighth = reg(CTRL) & CTRL_BIT8DV ? 0x100 : 0;
        if (offset == TXDATA)
            enqueue((value & 0xFF) | eighth);
        if (offset == TXDATAX)
            enqueue(value & 0xE1FF);
        LowEnergy::write(offset, value);
        follow();
    }

private:
    int data_bits() const override { return reg(CTRL) & CTRL_DATABITS ? 9 : 8; }
    // 1 + CLKDIV / 256 (19.3.3).
    double clocks_per_bit() const override { return (256.0 + reg(CLKDIV)) / 256.0; }

    void apply(uint32_t offset, uint32_t value) override {
        if (offset == CMD)
            command(value);
        else if (offset == TXDATA || offset == TXDATAX)
            start();
        else
            LowEnergy::apply(offset, value);
        follow();
    }

    // Bits that enable and disable the same thing are neighbours in CMD; the newer command wins.
    uint32_t merge_commands(uint32_t older, uint32_t newer) const override {
        const uint32_t pairs = newer & 0x3F;
        return (older & ~((pairs & 0x15) << 1 | (pairs & 0x2A) >> 1)) | newer;
    }

    void command(uint32_t value) {
        command_bit(status(), STATUS_RXENS, value, CMD_RXEN, CMD_RXDIS);
        command_bit(status(), STATUS_TXENS, value, CMD_TXEN, CMD_TXDIS);
        command_bit(status(), STATUS_RXBLOCK, value, CMD_RXBLOCKEN, CMD_RXBLOCKDIS);
        clear_buffers(value & CMD_CLEARTX, value & CMD_CLEARRX);
    }

    void start(bool follows = false) override {
        constexpr uint32_t waiting = SYNCBUSY_TXDATA | SYNCBUSY_TXDATAX;
        const Rate rate = clock_now();
        if (shifting || transmit_buffer.empty() || !(status() & STATUS_TXENS) || !rate.runs() ||
            reg(SYNCBUSY) & waiting)
            return;
        shifted = transmit_buffer.pop();
        const int64_t stop_bits = field(reg(CTRL), CTRL_STOPBITS) ? 2 : 1;
        const bool parity = field(reg(CTRL), CTRL_PARITY) & 2;
        const uint32_t data = shifted & ((1u << data_bits()) - 1);
        send(Kind::UART, shifted & TXDATAX_TXBREAK ? 0x10000 : data, rate,
             (1 + data_bits() + parity + stop_bits) * (256 + (int64_t)reg(CLKDIV)), 256, follows,
             true);
    }

    void finished() override {
        if (shifted & TXDATAX_TXDISAT)
            status() &= ~STATUS_TXENS;
        if (reg(CTRL) & CTRL_LOOPBK && status() & STATUS_RXENS)
            accept(shifted & ((1u << data_bits()) - 1));
        if (shifted & TXDATAX_RXENAT)
            status() |= STATUS_RXENS;
    }

    void accept(uint32_t frame) override {
        const uint32_t data = frame & 0x1FF;
        const bool address = set_frame_flags(frame);
        // Only frames without error are compared (19.3.5.5).
        const bool compared = !(frame & (RXDATAX_FERR | RXDATAX_PERR));
        if (compared && data == reg(STARTFRAME)) {
            flags() |= IF_STARTF;
            if (reg(CTRL) & CTRL_SFUBRX)
                status() &= ~STATUS_RXBLOCK;
        }
        const bool accepted = !(status() & STATUS_RXBLOCK) || address;
        if (compared && data == reg(SIGFRAME) && accepted)
            flags() |= IF_SIGF;
        if (accepted)
            store_received(frame);
    }

    void follow() override {
        part.dma->wakes(source, reg(CTRL) & (CTRL_RXDMAWU | CTRL_TXDMAWU));
        SerialPort::follow();
    }
};

}  // namespace

void add_leuart(Part &part, const Instance &instance, int source, int signals) {
    part.receivers.push_back(part.add(new Leuart(part, instance, source, signals)));
}

}  // namespace efm32gg
