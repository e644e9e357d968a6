#include "efm32gg/serial/leuart.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"

namespace efm32gg {

using namespace leuart;

Leuart::Leuart(Part &part, const Instance &instance, int unit, int source, int signals)
    : LowEnergy(part, instance, FREEZE, SYNCBUSY, CMD), unit(unit), source(source),
      signals(signals) {}

void Leuart::reset() {
    LowEnergy::reset();
    part.cancel(sent);
    shifting = stalled = false;
    transmit_buffer.clear();
    receive_buffer.clear();
    follow();
}

int Leuart::pin(int signal, uint32_t enable) const {
    const uint32_t location = take(reg(ROUTE), ROUTE_LOCATION);
    return reg(ROUTE) & enable && location < LOCATIONS ? ROUTES[signal][location] : -1;
}

int Leuart::transmit_pin() const {
    const int at = pin(signals, ROUTE_TXPEN);
    return at >= 0 && part.gpio->drives(at) ? at : -1;
}

int Leuart::receive_pin() const {
    const int at = pin(signals + 1, ROUTE_RXPEN);
    return at >= 0 && part.gpio->senses(at) ? at : -1;
}

// -- registers --

uint32_t Leuart::busy_bit(uint32_t offset) const {
    switch (offset) {
    case CTRL: return SYNCBUSY_CTRL;
    case CMD: return SYNCBUSY_CMD;
    case CLKDIV: return SYNCBUSY_CLKDIV;
    case STARTFRAME: return SYNCBUSY_STARTFRAME;
    case SIGFRAME: return SYNCBUSY_SIGFRAME;
    case TXDATAX: return SYNCBUSY_TXDATAX;
    case TXDATA: return SYNCBUSY_TXDATA;
    case PULSECTRL: return SYNCBUSY_PULSECTRL;
    }
    return 0;
}

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
        // The buffer takes it now; the shift register when it is synchronized.
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

// Enabling and disabling are neighbours in CMD: the newer one counts.
uint32_t Leuart::both(uint32_t older, uint32_t newer) const {
    const uint32_t pairs = newer & 0x3F;
    return (older & ~((pairs & 0x15) << 1 | (pairs & 0x2A) >> 1)) | newer;
}

void Leuart::command(uint32_t value) {
    uint32_t &status = reg(STATUS);
    const auto change = [&](uint32_t on, uint32_t off, uint32_t bit) {
        if (value & off)
            status &= ~bit;
        else if (value & on)
            status |= bit;
    };
    change(CMD_RXEN, CMD_RXDIS, STATUS_RXENS);
    change(CMD_TXEN, CMD_TXDIS, STATUS_TXENS);
    change(CMD_RXBLOCKEN, CMD_RXBLOCKDIS, STATUS_RXBLOCK);
    if (value & CMD_CLEARTX)
        transmit_buffer.clear();
    if (value & CMD_CLEARRX)
        receive_buffer.clear();
    start();
}

// -- transmitter: a bit is 1 + CLKDIV / 256 clocks (19.3.3), so a unit is 1/256 clock --

void Leuart::start(bool behind_another) {
    constexpr uint32_t waiting = SYNCBUSY_TXDATA | SYNCBUSY_TXDATAX;
    const Rate rate = part.unit_rate(instance);
    if (shifting || transmit_buffer.empty() || !(reg(STATUS) & STATUS_TXENS) || !rate.runs() ||
        reg(SYNCBUSY) & waiting)
        return;
    const uint32_t frame = transmit_buffer.pop();
    const int64_t halves = take(reg(CTRL), CTRL_STOPBITS) ? 2 : 1;
    const bool parity = take(reg(CTRL), CTRL_PARITY) & 2;
    const int64_t units = (1 + data_bits() + parity + halves) * (256 + (int64_t)reg(CLKDIV));
    timing.append(rate, units, 256, behind_another, part.now());
    shifting = true;
    shifted = frame;
    const int64_t data = frame & ((1u << data_bits()) - 1);
    if (const int to = transmit_pin(); to >= 0)
        part.send(Kind::UART, unit | to << 8, frame & TXDATAX_TXBREAK ? 0x10000 : data,
                  timing.end - timing.begin).time = timing.begin;
    part.schedule(sent, timing.end);
}

void Leuart::on_sent(int64_t) {
    if (!part.unit_rate(instance).runs()) {
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
    if (stalled && part.unit_rate(instance).runs()) {
        stalled = false;
        part.schedule(sent, part.now());
    }
    start();
    follow();
}

// -- receiver --

void Leuart::receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate) {
    const Rate clock = part.unit_rate(instance);
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
            const uint32_t first = receive_buffer.pop(), second = receive_buffer.pop();
            receive_buffer.clear();
            receive_buffer.push(first);
            receive_buffer.push(second);
        }
        receive_buffer.push(frame);
    }
    reg(IF) |= flags;
}

void Leuart::follow() {
    uint32_t &status = reg(STATUS), &flags = reg(IF);
    put(status, STATUS_TXBL, transmit_buffer.empty());
    put(flags, IF_TXBL, transmit_buffer.empty());
    put(status, STATUS_RXDATAV, !receive_buffer.empty());
    put(flags, IF_RXDATAV, !receive_buffer.empty());
    const bool stopped = reg(CTRL) & CTRL_ERRSDMA && flags & (IF_FERR | IF_PERR);
    Dma &dma = *part.dma;
    dma.wakes(source, reg(CTRL) & (CTRL_RXDMAWU | CTRL_TXDMAWU));
    dma.request(source, 0, !receive_buffer.empty() && !stopped);
    dma.request(source, 1, transmit_buffer.empty());
    dma.request(source, 2, transmit_buffer.empty() && !shifting);
    update_interrupts();
}

}  // namespace efm32gg
