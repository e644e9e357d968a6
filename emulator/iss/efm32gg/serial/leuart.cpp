#include "efm32gg/serial/leuart.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"

namespace efm32gg {

using namespace leuart;

void Leuart::reset() {
    LowEnergy::reset();
    part.cancel(sent);
    shifting = stalled = false;
    transmit_buffer.clear();
    receive_buffer.clear();
    follow();
}

int Leuart::transmit_pin() const {
    const int location = (int)field(reg(ROUTE), ROUTE_LOCATION);
    return reg(ROUTE) & ROUTE_TXPEN ? part.gpio->drivable(ROUTES[signals][location]) : -1;
}

int Leuart::receive_pin() const {
    const int location = (int)field(reg(ROUTE), ROUTE_LOCATION);
    return reg(ROUTE) & ROUTE_RXPEN ? part.gpio->readable(ROUTES[signals + 1][location]) : -1;
}

// -- registers --

uint32_t Leuart::peek(uint32_t offset) const {
    switch (offset) {
    case RXDATA: return receive_buffer.front() & 0xFF;
    case RXDATAX:
    case RXDATAXP: return receive_buffer.front();
    }
    return Peripheral::peek(offset);
}

uint32_t Leuart::read(uint32_t offset) {
    if (offset != RXDATA && offset != RXDATAX)
        return peek(offset);
    if (receive_buffer.empty()) {
        raise(IF_RXUF);
        return 0;
    }
    const uint32_t entry = receive_buffer.pop();
    follow();
    return offset == RXDATA ? entry & 0xFF : entry;
}

void Leuart::write(uint32_t offset, uint32_t value) {
    if (offset == TXDATA || offset == TXDATAX) {
        // It enters the buffer now, and the shift register once it is synchronised.
        const uint32_t eighth = reg(CTRL) & CTRL_BIT8DV ? 0x100 : 0;
        if (transmit_buffer.full()) {
            raise(IF_TXOF);
        } else {
            transmit_buffer.push(offset == TXDATA ? (value & 0xFF) | eighth : value & 0xE1FF);
            reg(STATUS) &= ~STATUS_TXC;
        }
    }
    LowEnergy::write(offset, value);
    follow();
}

void Leuart::apply(uint32_t offset, uint32_t value) {
    if (offset == CMD)
        command(value);
    else if (offset == TXDATA || offset == TXDATAX)
        start();
    else
        LowEnergy::apply(offset, value);
    follow();
}

// Bits that enable and disable the same thing are neighbours in CMD; the newer command wins.
uint32_t Leuart::merge_commands(uint32_t older, uint32_t newer) const {
    const uint32_t pairs = newer & 0x3F;
    return (older & ~((pairs & 0x15) << 1 | (pairs & 0x2A) >> 1)) | newer;
}

void Leuart::command(uint32_t value) {
    uint32_t &status = reg(STATUS);
    command_bit(status, STATUS_RXENS, value, CMD_RXEN, CMD_RXDIS);
    command_bit(status, STATUS_TXENS, value, CMD_TXEN, CMD_TXDIS);
    command_bit(status, STATUS_RXBLOCK, value, CMD_RXBLOCKEN, CMD_RXBLOCKDIS);
    if (value & CMD_CLEARTX)
        transmit_buffer.clear();
    if (value & CMD_CLEARRX)
        receive_buffer.clear();
    start();
}

// -- transmitter: a bit takes 1 + CLKDIV / 256 clocks (19.3.3), so durations are in 1/256 clock --

void Leuart::start(bool follows) {
    constexpr uint32_t waiting = SYNCBUSY_TXDATA | SYNCBUSY_TXDATAX;
    const Rate rate = clock_now();
    if (shifting || transmit_buffer.empty() || !(reg(STATUS) & STATUS_TXENS) || !rate.runs() ||
        reg(SYNCBUSY) & waiting)
        return;
    const uint32_t frame = transmit_buffer.pop();
    const int64_t halves = field(reg(CTRL), CTRL_STOPBITS) ? 2 : 1;
    const bool parity = field(reg(CTRL), CTRL_PARITY) & 2;
    const int64_t units = (1 + data_bits() + parity + halves) * (256 + (int64_t)reg(CLKDIV));
    timing.append(rate, units, 256, follows, part.now());
    shifting = true;
    shifted = frame;
    const int64_t data = frame & ((1u << data_bits()) - 1);
    if (const int to = transmit_pin(); to >= 0)
        part.send(Kind::UART, (FIRST_UNIT + instance.index) | to << 8,
                  frame & TXDATAX_TXBREAK ? 0x10000 : data,
                  timing.end - timing.begin).time = timing.begin;
    part.schedule(sent, timing.end);
}

void Leuart::on_sent(int64_t) {
    if (!clock_now().runs()) {
        stalled = true;
        return;
    }
    shifting = false;
    uint32_t &status = reg(STATUS);
    if (shifted & TXDATAX_TXDISAT)
        status &= ~STATUS_TXENS;
    if (reg(CTRL) & CTRL_LOOPBK && status & STATUS_RXENS)
        accept(shifted & ((1u << data_bits()) - 1));
    if (shifted & TXDATAX_RXENAT)
        status |= STATUS_RXENS;
    if (transmit_buffer.empty()) {
        status |= STATUS_TXC;
        reg(IF) |= IF_TXC;
    }
    start(true);
    follow();
}

void Leuart::clocks_changed() {
    LowEnergy::clocks_changed();
    if (stalled && clock_now().runs()) {
        stalled = false;
        part.schedule(sent, part.now());
    }
    start();
    follow();
}

// -- receiver --

void Leuart::receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate) {
    const Rate clock = clock_now();
    if (!clock.runs() || !(reg(STATUS) & STATUS_RXENS) || reg(CTRL) & CTRL_LOOPBK ||
        receive_pin() < 0)
        return;
    if (rate) {
        const double own = clock.frequency() * 256.0 / (256.0 + reg(CLKDIV));
        framing_error |= own < 0.96 * rate || own > 1.04 * rate;
    }
    data &= (1u << data_bits()) - 1;
    accept(data | (framing_error ? RXDATAX_FERR : 0) | (parity_error ? RXDATAX_PERR : 0));
    follow();
}

void Leuart::accept(uint32_t frame) {
    const uint32_t control = reg(CTRL);
    uint32_t &status = reg(STATUS), flags = 0;
    const uint32_t data = frame & 0x1FF;
    const bool address = control & CTRL_MPM && !!(frame & 0x100) == !!(control & CTRL_MPAB);
    if (address)
        flags |= IF_MPAF;
    if (frame & RXDATAX_FERR)
        flags |= IF_FERR;
    if (frame & RXDATAX_PERR)
        flags |= IF_PERR;
    // Only frames without error are compared (19.3.5.5).
    if (!(frame & (RXDATAX_FERR | RXDATAX_PERR))) {
        if (data == reg(STARTFRAME)) {
            flags |= IF_STARTF;
            if (control & CTRL_SFUBRX)
                status &= ~STATUS_RXBLOCK;
        }
        if (data == reg(SIGFRAME) && (!(status & STATUS_RXBLOCK) || address))
            flags |= IF_SIGF;
    }
    if (!(status & STATUS_RXBLOCK) || address) {
        if (receive_buffer.full()) {
            flags |= IF_RXOF;
            receive_buffer.replace_last(frame);
        } else {
            receive_buffer.push(frame);
        }
    }
    reg(IF) |= flags;
}

void Leuart::follow() {
    uint32_t &status = reg(STATUS), &flags = reg(IF);
    set_bits(status, STATUS_TXBL, transmit_buffer.empty());
    set_bits(flags, IF_TXBL, transmit_buffer.empty());
    set_bits(status, STATUS_RXDATAV, !receive_buffer.empty());
    set_bits(flags, IF_RXDATAV, !receive_buffer.empty());
    const bool stopped = reg(CTRL) & CTRL_ERRSDMA && flags & (IF_FERR | IF_PERR);
    Dma &dma = *part.dma;
    dma.wakes(source, reg(CTRL) & (CTRL_RXDMAWU | CTRL_TXDMAWU));
    dma.request(source, 0, !receive_buffer.empty() && !stopped);
    dma.request(source, 1, transmit_buffer.empty());
    dma.request(source, 2, transmit_buffer.empty() && !shifting);
    update_interrupts();
}

}  // namespace efm32gg
