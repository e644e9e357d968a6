#include "efm32gg/memory/dma.h"

#include <algorithm>

namespace efm32gg {

using namespace dma;

namespace {

constexpr uint32_t ALL = (1u << Dma::CHANNELS) - 1;
constexpr uint32_t ALTERNATE = 0x100;  // bytes from the primary to the alternate descriptors

// Cycles: arbitration with three descriptor words read and one written; an item read and written.
constexpr int64_t ROUND = 6, ITEM = 4;

// Time to leave EM2 for a transfer (t_EM20 of the data sheet).
constexpr int64_t WAKE_UP = 2 * MICROSECOND;

// Cycle types and fields of a descriptor's control word (8.4.3.3).
enum Cycle : uint32_t { STOP, BASIC, AUTO, PING_PONG, MEMORY, MEMORY_ALTERNATE, PERIPHERAL,
                        PERIPHERAL_ALTERNATE };
constexpr uint32_t CYCLE = 7, COUNT = 0x3FF << 4, POWER = 0xF << 14, SOURCE_SIZE = 3 << 24,
                   SOURCE_STEP = 3 << 26, TARGET_STEP = 3u << 30;
constexpr int NO_STEP = 3;

// Units with buffers of two frames: USART, LEUART, I2C, UART.
constexpr bool single(int source) {
    return (source >= 12 && source <= 21) || source == 44 || source == 45;
}

}  // namespace

void Dma::reset() {
    Peripheral::reset();
    part.cancel(serve);
    std::fill(std::begin(pulses), std::end(pulses), (uint8_t)0);
    enabled_channels = alternates = bursts = masked = high = software = continued = done = 0;
    failed = false;
}

// -- registers --

// Registers that set and clear bits by channel.
const Dma::ChannelBits Dma::CHANNEL_BITS[] = {
    {CHUSEBURSTS, CHUSEBURSTC, &Dma::bursts}, {CHREQMASKS, CHREQMASKC, &Dma::masked},
    {CHENS, CHENC, &Dma::enabled_channels},   {CHALTS, CHALTC, &Dma::alternates},
    {CHPRIS, CHPRIC, &Dma::high},
};

uint32_t Dma::peek(uint32_t offset) const {
    uint32_t status = 0;
    for (const ChannelBits &one : CHANNEL_BITS)
        if (offset == one.set) return this->*one.bits;
    switch (offset) {
    case ALTCTRLBASE: return reg(CTRLBASE) + ALTERNATE;
    case CHREQSTATUS: case CHSREQSTATUS:
        for (int n = 0; n < CHANNELS; n++)
            status |= (uint32_t)requested(n) << n;
        return status;
    }
    return Peripheral::peek(offset);
}

void Dma::write(uint32_t offset, uint32_t value) {
    const uint32_t bits = value & ALL;
    for (const ChannelBits &one : CHANNEL_BITS)
        if (offset == one.set || offset == one.clear) {
            set_bits(this->*one.bits, bits, offset == one.set);
            if (offset == CHENC)
                software &= ~bits, continued &= ~bits;
            return consider();
        }
    switch (offset) {
    case CONFIG:
        reg(STATUS) = (reg(STATUS) & ~STATUS_EN) | (value & CONFIG_EN ? STATUS_EN : 0);
        break;
    case CTRLBASE: reg(CTRLBASE) = value & ~(2 * ALTERNATE - 1); break;
    case CHSWREQ: software |= bits & enabled_channels; break;
    case ERRORC:
        if (value & ERRORC_ERRORC)
            reg(ERRORC) = 0;
        break;
    default: Peripheral::write(offset, value);
    }
    consider();
}

// -- requests --

int Dma::source(int channel) const {
    return (int)field(reg(CH0_CTRL + 4 * (uint32_t)channel), CH0_CTRL_SOURCESEL);
}

bool Dma::requested(int channel) const {
    const uint32_t control = reg(CH0_CTRL + 4 * (uint32_t)channel);
    const uint32_t signal = field(control, CH0_CTRL_SIGSEL);
    const int from = source(channel);
    return from && signal < 8 && (levels[from] | pulses[from]) >> signal & 1;
}

bool Dma::listens(int from, int signal) const {
    for (int n = 0; n < CHANNELS; n++)
        if (enabled_channels >> n & 1 && source(n) == from &&
            (int)field(reg(CH0_CTRL + 4 * (uint32_t)n), CH0_CTRL_SIGSEL) == signal)
            return true;
    return false;
}

void Dma::request(int from, int signal, bool on) {
    const uint8_t bit = (uint8_t)(1 << signal);
    const bool was = levels[from] & bit;
    levels[from] = (uint8_t)(on ? levels[from] | bit : levels[from] & ~bit);
    if (on && !was)
        consider();
}

void Dma::pulse(int from, int signal) {
    if (!listens(from, signal)) return;
    pulses[from] = (uint8_t)(pulses[from] | 1 << signal);
    consider();
}

void Dma::wakes(int from, bool on) {
    const uint64_t bit = 1ull << from;
    waking = on ? waking | bit : waking & ~bit;
}

bool Dma::wants(int channel) const {
    if (!(enabled_channels >> channel & 1) || !(reg(STATUS) & STATUS_EN)) return false;
    if (part.mode > 1 && !(waking >> source(channel) & 1)) return false;
    return (software | continued) >> channel & 1 ||
           (!(masked >> channel & 1) && requested(channel));
}

// High priority first, then the lowest number (8.4.2.2).
int Dma::next() const {
    for (const bool urgent : {true, false})
        for (int n = 0; n < CHANNELS; n++)
            if ((high >> n & 1) == urgent && wants(n)) return n;
    return -1;
}

int64_t Dma::delay(int64_t cycles) const {
    const Rate rate = part.unit_rate(instance);
    return part.mode > 1 || !rate.runs() ? WAKE_UP : rate.span(cycles);
}

void Dma::consider() {
    if (serve.pending() || !part.enabled(instance) || next() < 0) return;
    part.schedule_after(serve, delay(ROUND));
}

// Ends the previous round and begins the next.
void Dma::on_serve(int64_t time) {
    if (done) {
        reg(IF) |= done;
        done = 0;
        update_interrupts();
    }
    const int channel = next();
    if (channel < 0) return;
    const int64_t cycles = round(channel);
    if (failed) {
        failed = false;
        reg(ERRORC) = ERRORC_ERRORC;
        raise(IF_ERR);
    }
    if (done || next() >= 0)
        part.schedule(serve, later(time, delay(cycles)));
}

// -- one arbitration --

int64_t Dma::round(int channel) {
    const uint32_t bit = 1u << channel;
    const bool by_unit = !((software | continued) & bit);
    const bool alternate = alternates & bit;
    const uint32_t at = reg(CTRLBASE) + (alternate ? ALTERNATE : 0) + 16 * (uint32_t)channel;
    software &= ~bit;
    continued &= ~bit;
    if (by_unit)
        pulses[source(channel)] &=
            (uint8_t)~(1 << field(reg(CH0_CTRL + 4 * (uint32_t)channel), CH0_CTRL_SIGSEL));
    int64_t wait = 0;
    uint32_t from_end = 0, to_end = 0, control = 0;
    if (!part.load(at, 4, from_end, wait) || !part.load(at + 4, 4, to_end, wait) ||
        !part.load(at + 8, 4, control, wait)) {
        error(channel);
        return ROUND;
    }
    const uint32_t cycle = control & CYCLE;
    if (cycle == STOP) {
        enabled_channels &= ~bit;
        return ROUND;
    }
    const uint32_t left = field(control, COUNT) + 1;
    uint32_t count = 1u << std::min(field(control, POWER), 10u);
    if (by_unit && single(source(channel)) && !(bursts & bit) && cycle <= PING_PONG &&
        cycle != AUTO)
        count = 1;
    count = std::min(count, left);
    const int size = 1 << field(control, SOURCE_SIZE);
    const int from_step = (int)field(control, SOURCE_STEP);
    const int to_step = (int)field(control, TARGET_STEP);
    for (uint32_t n = 0; n < count; n++) {
        const uint32_t back = left - 1 - n;
        // Four words at a time go to the same alternate descriptor.
        const uint32_t to_back = cycle == MEMORY || cycle == PERIPHERAL ? back & 3 : back;
        const uint32_t from = from_step == NO_STEP ? from_end : from_end - (back << from_step);
        const uint32_t to = to_step == NO_STEP ? to_end : to_end - (to_back << to_step);
        uint32_t value = 0;
        if (size > 4 || !part.load(from, size, value, wait) || !part.store(to, size, value, wait)) {
            error(channel);
            return ROUND + ITEM * n;
        }
    }
    const uint32_t rest = left - count;
    control &= ~(COUNT | (rest ? 0 : CYCLE));
    control |= to_field(rest ? rest - 1 : 0, COUNT);
    if (!part.store(at + 8, 4, control, wait))
        error(channel);
    switch (cycle) {
    case BASIC:
        if (!rest)
            finish(channel);
        break;
    case AUTO:
        if (rest)
            continued |= bit;
        else
            finish(channel);
        break;
    case PING_PONG:
        if (!rest) {
            alternates ^= bit;
            done |= bit;
        }
        break;
    case MEMORY:
    case PERIPHERAL:  // four words are the alternate descriptor, which is used next
        alternates |= bit;
        if (cycle == MEMORY || by_unit)
            continued |= bit;
        break;
    case MEMORY_ALTERNATE:
        continued |= bit;
        if (!rest)
            alternates &= ~bit;
        break;
    case PERIPHERAL_ALTERNATE:
        if (!rest) {
            alternates &= ~bit;
            continued |= bit;
        }
        break;
    }
    return ROUND + ITEM * count + wait;
}

void Dma::finish(int channel) {
    enabled_channels &= ~(1u << channel);
    alternates &= ~(1u << channel);
    done |= 1u << channel;
}

void Dma::error(int channel) {
    enabled_channels &= ~(1u << channel);
    failed = true;
}

}  // namespace efm32gg
