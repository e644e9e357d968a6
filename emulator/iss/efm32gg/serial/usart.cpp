#include "efm32gg/serial/usart.h"

#include "efm32gg/memory/dma.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/pins/prs.h"

namespace efm32gg {

using namespace usart;

namespace {

// Of an entry in a buffer: its data bits, and what TXDATAX and RXDATAX have beside them.
constexpr uint32_t DATA = 0x1FF;

// Bits of a duration are counted in units of 1/512 HFPERCLK cycle and half bits, so every frame
// is a whole number of them.
constexpr int64_t UNITS = 512;

constexpr uint32_t RX_FLAGS = IF_RXDATAV | IF_RXFULL | IF_RXOF | IF_RXUF | IF_PERR | IF_FERR |
                              IF_MPAF | IF_SSM;

constexpr int OVERSAMPLING[] = {16, 8, 6, 4};

}  // namespace

Usart::Usart(Part &part, const Instance &instance, const Place &place)
    : Peripheral(part, instance), place(place) {}

void Usart::reset() {
    Peripheral::reset();
    part.cancel(sent);
    shifting = stalled = false;
    transmit_buffer.clear();
    receive_buffer.clear();
    follow();
}

int Usart::data_bits() const {
    const int code = (int)take(reg(FRAME), FRAME_DATABITS);
    return code >= 1 && code <= 13 ? code + 3 : 8;
}

// Half a bit, in units: oversampling times (1 + CLKDIV / 256) cycles are a bit (17.3.2.3); of the
// synchronous clock, two times (17.3.3.1).
int64_t Usart::bit_units() const {
    const int64_t divided = 256 + reg(CLKDIV);
    return synchronous() ? 2 * divided : OVERSAMPLING[take(reg(CTRL), CTRL_OVS)] * divided;
}

int64_t Usart::frame_units() const {
    if (synchronous())
        return 2 * data_bits() * bit_units();
    const bool parity = take(reg(FRAME), FRAME_PARITY) & 2;
    const int64_t stop_halves = 1 + take(reg(FRAME), FRAME_STOPBITS);
    return (2 * (1 + data_bits() + parity) + stop_halves) * bit_units();
}

int Usart::transmit_pin() const {
    if (!(reg(ROUTE) & ROUTE_TXPEN))
        return -1;
    const uint32_t location = take(reg(ROUTE), ROUTE_LOCATION);
    const int pin = location < LOCATIONS ? ROUTES[place.signals][location] : -1;
    return pin >= 0 && part.gpio->drives(pin) ? pin : -1;
}

int Usart::receive_pin() const {
    if (!(reg(ROUTE) & ROUTE_RXPEN))
        return -1;
    const uint32_t location = take(reg(ROUTE), ROUTE_LOCATION);
    const int pin = location < LOCATIONS ? ROUTES[place.signals + 1][location] : -1;
    return pin >= 0 && part.gpio->senses(pin) ? pin : -1;
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
    const auto change = [&](uint32_t on, uint32_t off, uint32_t bit) {
        if (value & off)
            status &= ~bit;
        else if (value & on)
            status |= bit;
    };
    change(CMD_RXEN, CMD_RXDIS, STATUS_RXENS);
    change(CMD_TXEN, CMD_TXDIS, STATUS_TXENS);
    change(CMD_MASTEREN, CMD_MASTERDIS, STATUS_MASTER);
    change(CMD_RXBLOCKEN, CMD_RXBLOCKDIS, STATUS_RXBLOCK);
    change(CMD_TXTRIEN, CMD_TXTRIDIS, STATUS_TXTRI);
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

void Usart::start(bool behind_another) {
    if (shifting || transmit_buffer.empty() || !(reg(STATUS) & STATUS_TXENS))
        return;
    if (synchronous() && !(reg(STATUS) & STATUS_MASTER))
        return;
    const int bits = data_bits();
    if (bits > 9 && transmit_buffer.size() < 2)
        return;
    const Rate rate = part.unit_rate(instance);
    if (!rate.runs())
        return;
    const uint32_t frame = transmit_buffer.pop();
    shifted = frame & DATA;
    if (bits > 9)
        shifted = (frame & 0xFF) | (transmit_buffer.pop() & 0xFF) << 8;
    const uint32_t controls = frame & 0xF800;
    shifting = true;
    timing.append(rate, frame_units(), UNITS, behind_another, part.now());
    const uint32_t sent_bits = shifted & ((1u << bits) - 1);
    const int to = transmit_pin();
    const bool driven = to >= 0 && !(reg(STATUS) & STATUS_TXTRI);
    const bool breaks = controls & TXDATAX_TXBREAK && !synchronous();
    if (driven)
        part.send(synchronous() ? Kind::SPI : Kind::UART, place.unit | to << 8,
                  breaks ? 0x10000 : sent_bits, timing.end - timing.begin).time = timing.begin;
    shifted = sent_bits | controls;
    part.schedule(sent, timing.end);
}

void Usart::on_sent(int64_t time) {
    const Rate rate = part.unit_rate(instance);
    if (!rate.runs()) {  // asleep or without clock: it is over when that is back
        stalled = true;
        return;
    }
    (void)time;
    shifting = false;
    uint32_t &status = reg(STATUS);
    const uint32_t data = shifted & ~(data_bits() > 9 ? 0u : 0xF800u);
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
        part.prs->pulse(place.reflex, 1);
    }
    start(true);
    follow();
}

void Usart::clocks_changed() {
    if (stalled && part.unit_rate(instance).runs()) {
        stalled = false;
        part.schedule(sent, part.now());
    }
    start();
    follow();
}

// -- receiver --

void Usart::receive(uint32_t data, bool framing_error, bool parity_error, uint32_t rate) {
    const Rate clock = part.unit_rate(instance);
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
                flags |= IF_RXOF;  // what waits in the shift register is lost
                FrameQueue<3> kept = receive_buffer;
                receive_buffer.clear();
                receive_buffer.push(kept.pop());
                receive_buffer.push(kept.pop());
            }
            receive_buffer.push(entry);
            if (receive_buffer.size() == 2)
                flags |= IF_RXFULL;
        }
        part.prs->pulse(place.reflex, 2);
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

// -- flags that follow the buffers --

void Usart::follow() {
    uint32_t &status = reg(STATUS), &flags = reg(IF);
    const bool room = reg(CTRL) & CTRL_TXBIL ? !transmit_buffer.full() : transmit_buffer.empty();
    put(status, STATUS_TXBL, room);
    put(flags, IF_TXBL, room);
    put(status, STATUS_RXDATAV, !receive_buffer.empty());
    put(flags, IF_RXDATAV, !receive_buffer.empty());
    put(status, STATUS_RXFULL, receive_buffer.size() >= 2);
    const bool stopped = reg(CTRL) & CTRL_ERRSDMA && flags & (IF_FERR | IF_PERR);
    Dma &dma = *part.dma;
    dma.request(place.source, 0, !receive_buffer.empty() && !stopped);
    dma.request(place.source, 1, room);
    dma.request(place.source, 2, transmit_buffer.empty() && !shifting);
    update_interrupts();
}

void Usart::update_interrupts() {
    const uint32_t pending = reg(IF) & reg(IEN);
    line(0, pending & RX_FLAGS);
    line(1, pending & ~RX_FLAGS);
}

}  // namespace efm32gg
