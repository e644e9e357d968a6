#include "efm32gg/serial/usart.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

namespace efm32gg {

using namespace usart;

namespace {

// Durations are counted in units of 1/512 HFPERCLK cycle, so that half a bit is a whole number.
constexpr int64_t UNITS = 512;
// Control bits of TXDATAX beside the data.
constexpr uint32_t CONTROLS = 0xF800;

constexpr uint32_t RX_FLAGS = IF_RXDATAV | IF_RXFULL | IF_RXOF | IF_RXUF | IF_PERR | IF_FERR |
                              IF_MPAF | IF_SSM;

constexpr int OVERSAMPLING[] = {16, 8, 6, 4};

}  // namespace

void Usart::reset() {
    Peripheral::reset();
    part.cancel(sent);
    shifting = stalled = false;
    transmit_buffer.clear();
    receive_buffer.clear();
    follow();
}

int Usart::data_bits() const {
    const int code = (int)field(reg(FRAME), FRAME_DATABITS);
    return code >= 1 && code <= 13 ? code + 3 : 8;
}

// Half a bit, in units: a bit takes oversampling * (1 + CLKDIV / 256) cycles (17.3.2.3), or twice
// the factor in synchronous mode (17.3.3.1).
int64_t Usart::bit_units() const {
    const int64_t divided = 256 + reg(CLKDIV);
    return synchronous() ? 2 * divided : OVERSAMPLING[field(reg(CTRL), CTRL_OVS)] * divided;
}

int64_t Usart::frame_units() const {
    if (synchronous())
        return 2 * data_bits() * bit_units();
    const bool parity = field(reg(FRAME), FRAME_PARITY) & 2;
    const int64_t stop_halves = 1 + field(reg(FRAME), FRAME_STOPBITS);
    return (2 * (1 + data_bits() + parity) + stop_halves) * bit_units();
}

int Usart::transmit_pin() const {
    const int location = (int)field(reg(ROUTE), ROUTE_LOCATION);
    return reg(ROUTE) & ROUTE_TXPEN ? part.gpio->drivable(ROUTES[signals][location]) : -1;
}

int Usart::receive_pin() const {
    const int location = (int)field(reg(ROUTE), ROUTE_LOCATION);
    return reg(ROUTE) & ROUTE_RXPEN ? part.gpio->readable(ROUTES[signals + 1][location]) : -1;
}

// -- registers --

uint32_t Usart::read(uint32_t offset) {
    switch (offset) {
    case RXDATA:
        return take_received() & 0xFF;
    case RXDATAX:
        return take_received();
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

uint32_t Usart::peek(uint32_t offset) const {
    const uint32_t first = receive_buffer.front(0), second = receive_buffer.front(1);
    switch (offset) {
    case RXDATA:
        return first & 0xFF;
    case RXDATAX:
    case RXDATAXP:
        return first;
    case RXDOUBLE:
        return (first & 0xFF) | (second & 0xFF) << 8;
    case RXDOUBLEX:
    case RXDOUBLEXP:
        return first | second << 16;
    }
    return Peripheral::peek(offset);
}

void Usart::write(uint32_t offset, uint32_t value) {
    const uint32_t eighth = reg(CTRL) & CTRL_BIT8DV ? 0x100 : 0;
    switch (offset) {
    case CMD:
        return command(value);
    case TXDATA:
        return enqueue((value & 0xFF) | eighth);
    case TXDATAX:
        return enqueue(value & 0xF9FF);
    case TXDOUBLE:
        enqueue((value & 0xFF) | eighth);
        return enqueue((value >> 8 & 0xFF) | eighth);
    case TXDOUBLEX:
        enqueue(value & 0xF9FF);
        return enqueue(value >> 16 & 0xF9FF);
    }
    Peripheral::write(offset, value);
    if (offset == I2SCTRL && value & I2SCTRL_EN)
        part.log_once("%s: I2S is not modelled", instance.name);
    if (offset == CTRL || offset == IFC)
        follow();
}

void Usart::command(uint32_t value) {
    uint32_t &status = reg(STATUS);
    command_bit(status, STATUS_RXENS, value, CMD_RXEN, CMD_RXDIS);
    command_bit(status, STATUS_TXENS, value, CMD_TXEN, CMD_TXDIS);
    command_bit(status, STATUS_MASTER, value, CMD_MASTEREN, CMD_MASTERDIS);
    command_bit(status, STATUS_RXBLOCK, value, CMD_RXBLOCKEN, CMD_RXBLOCKDIS);
    command_bit(status, STATUS_TXTRI, value, CMD_TXTRIEN, CMD_TXTRIDIS);
    if (value & CMD_CLEARTX)
        transmit_buffer.clear();
    if (value & CMD_CLEARRX)
        receive_buffer.clear();
    start();
    follow();
}

// -- transmitter --

void Usart::enqueue(uint32_t frame) {
    if (transmit_buffer.full())
        return raise(IF_TXOF);
    transmit_buffer.push(frame);
    reg(STATUS) &= ~STATUS_TXC;
    start();
    follow();
}

void Usart::start(bool follows) {
    if (shifting || transmit_buffer.empty() || !(reg(STATUS) & STATUS_TXENS))
        return;
    if (synchronous() && !(reg(STATUS) & STATUS_MASTER))
        return;
    const int bits = data_bits();
    if (bits > 9 && transmit_buffer.size() < 2)
        return;
    const Rate rate = clock_now();
    if (!rate.runs())
        return;
    const uint32_t frame = transmit_buffer.pop();
    uint32_t data = frame & TXDATAX_TXDATAX;
    if (bits > 9)
        data = (frame & 0xFF) | (transmit_buffer.pop() & 0xFF) << 8;
    data &= (1u << bits) - 1;
    shifted = data | (frame & CONTROLS);
    shifting = true;
    timing.append(rate, frame_units(), UNITS, follows, part.now());
    const int to = transmit_pin();
    if (to >= 0 && !(reg(STATUS) & STATUS_TXTRI)) {
        const bool breaks = frame & TXDATAX_TXBREAK && !synchronous();
        part.send(synchronous() ? Kind::SPI : Kind::UART, instance.index | to << 8,
                  breaks ? 0x10000 : data, timing.end - timing.begin).time = timing.begin;
    }
    part.schedule(sent, timing.end);
}

void Usart::on_sent(int64_t) {
    if (!clock_now().runs()) {  // asleep or without clock: continues when that is back
        stalled = true;
        return;
    }
    shifting = false;
    uint32_t &status = reg(STATUS);
    const uint32_t data = shifted & ~(data_bits() > 9 ? 0 : CONTROLS);
    if (synchronous()) {
        if (status & STATUS_RXENS)
            accept(reg(CTRL) & CTRL_LOOPBK ? data : (1u << data_bits()) - 1);
    } else {
        if (shifted & TXDATAX_UBRXAT)
            status &= ~STATUS_RXBLOCK;
        if (shifted & TXDATAX_TXTRIAT)
            status |= STATUS_TXTRI;
        if (shifted & TXDATAX_TXDISAT)
            status &= ~STATUS_TXENS;
        if (reg(CTRL) & CTRL_LOOPBK && status & STATUS_RXENS)
            accept(data);
        if (shifted & TXDATAX_RXENAT)
            status |= STATUS_RXENS;
    }
    if (transmit_buffer.empty()) {
        status |= STATUS_TXC;
        reg(IF) |= IF_TXC;
        part.prs->pulse(reflex, 1);
    }
    start(true);
    follow();
}

void Usart::clocks_changed() {
    if (stalled && clock_now().runs()) {
        stalled = false;
        part.schedule(sent, part.now());
    }
    start();
    follow();
}

// -- receiver --

void Usart::receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate) {
    const Rate clock = clock_now();
    if (!clock.runs() || !(reg(STATUS) & STATUS_RXENS) || synchronous() ||
        reg(CTRL) & CTRL_LOOPBK || receive_pin() < 0)
        return;
    if (rate) {
        const double own = clock.frequency() * UNITS / (2.0 * (double)bit_units());
        framing_error |= own < 0.96 * rate || own > 1.04 * rate;
    }
    data &= (1u << data_bits()) - 1;
    accept(data | (framing_error ? RXDATAX_FERR : 0) | (parity_error ? RXDATAX_PERR : 0));
    follow();
}

void Usart::accept(uint32_t frame) {
    const uint32_t control = reg(CTRL);
    uint32_t &status = reg(STATUS);
    uint32_t flags = 0;
    const bool address = control & CTRL_MPM && !!(frame & 0x100) == !!(control & CTRL_MPAB);
    if (address)
        flags |= IF_MPAF;
    const bool error = frame & (RXDATAX_FERR | RXDATAX_PERR);
    if (frame & RXDATAX_FERR)
        flags |= IF_FERR;
    if (frame & RXDATAX_PERR)
        flags |= IF_PERR;
    if (error && control & CTRL_ERRSRX)
        status &= ~STATUS_RXENS;
    if (error && control & CTRL_ERRSTX)
        status &= ~STATUS_TXENS;
    const bool skipped = (status & STATUS_RXBLOCK && !address) ||
                         (frame & RXDATAX_PERR && control & CTRL_SKIPPERRF);
    if (!skipped) {
        const int entries = data_bits() > 9 ? 2 : 1;
        for (int n = 0; n < entries; n++) {
            const uint32_t entry = entries == 1 ? frame : frame >> 8 * n & 0xFF;
            if (receive_buffer.full()) {
                flags |= IF_RXOF;  // the entry in the shift register is lost
                receive_buffer.replace_last(entry);
            } else {
                receive_buffer.push(entry);
            }
            if (receive_buffer.size() == 2)
                flags |= IF_RXFULL;
        }
        part.prs->pulse(reflex, 2);
    }
    reg(IF) |= flags;
}

uint32_t Usart::take_received() {
    if (receive_buffer.empty()) {
        raise(IF_RXUF);
        return 0;
    }
    const uint32_t entry = receive_buffer.pop();
    follow();
    return entry;
}

// Updates flags, requests and interrupts from the buffers.
void Usart::follow() {
    uint32_t &status = reg(STATUS), &flags = reg(IF);
    const bool room = reg(CTRL) & CTRL_TXBIL ? !transmit_buffer.full() : transmit_buffer.empty();
    set_bits(status, STATUS_TXBL, room);
    set_bits(flags, IF_TXBL, room);
    set_bits(status, STATUS_RXDATAV, !receive_buffer.empty());
    set_bits(flags, IF_RXDATAV, !receive_buffer.empty());
    set_bits(status, STATUS_RXFULL, receive_buffer.size() >= 2);
    const bool stopped = reg(CTRL) & CTRL_ERRSDMA && flags & (IF_FERR | IF_PERR);
    Dma &dma = *part.dma;
    dma.request(source, 0, !receive_buffer.empty() && !stopped);
    dma.request(source, 1, room);
    dma.request(source, 2, transmit_buffer.empty() && !shifting);
    update_interrupts();
}

void Usart::update_interrupts() {
    line(0, pending() & RX_FLAGS);
    line(1, pending() & ~RX_FLAGS);
}

}  // namespace efm32gg
