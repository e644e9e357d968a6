#include "efm32gg/pins/gpio.h"

#include "efm32gg/clocks/emu.h"
#include "efm32gg/pins/prs.h"

namespace efm32gg {

using namespace gpio;

// Modes of a pin (32.3.1).
enum PinMode : uint32_t {
    DISABLED, INPUT, INPUTPULL, INPUTPULLFILTER, PUSHPULL, PUSHPULLDRIVE, WIREDOR, WIREDORPULLDOWN,
    WIREDAND  // and all modes above it, of which 0xA, 0xB, 0xE and 0xF pull up
};
static constexpr uint32_t GPIO_UNLOCK = 0xA534;
static constexpr uint32_t PORT_SIZE = 0x24;
// Pins that wake from EM4, in the order of EM4WUEN: data sheet, table of alternate functions.
static constexpr int EM4_PINS[] = {0 * 16 + 0, 0 * 16 + 6, 2 * 16 + 9,
                                   5 * 16 + 1, 5 * 16 + 2, 4 * 16 + 13};
static constexpr int PRS_SOURCE = Prs::PINS;

void Gpio::reset() {
    const uint32_t cause = reg(EM4WUCAUSE);
    Peripheral::reset();
    if (part.reset_cause & rmu::RSTCAUSE_EM4WURST)
        reg(EM4WUCAUSE) = cause;
    for (auto &owner : owners)
        owner = nullptr;
    interrupts_selected();
    for (int port = 0; port < PORTS; port++) {
        ports[port].functions = ports[port].function_levels = 0;
        modes_changed(port);
        refresh(port, 0xFFFF);
    }
}

void Gpio::interrupts_selected() {
    for (int port = 0; port < PORTS; port++) {
        uint32_t &selected = ports[port].interrupting;
        selected = 0;
        for (int bit = 0; bit < PINS; bit++)
            selected |= (uint32_t)(interrupting_port(bit) == port) << bit;
    }
}

uint32_t Gpio::mode(int port, int bit) const {
    return reg(at(port, bit < 8 ? PA_MODEL : PA_MODEH)) >> 4 * (bit % 8) & 0xF;
}

void Gpio::modes_changed(int port) {
    uint32_t &enabled = ports[port].enabled, &pushing = ports[port].pushing;
    enabled = pushing = 0;
    for (int bit = 0; bit < PINS; bit++) {
        const uint32_t pin_mode = mode(port, bit);
        enabled |= (uint32_t)(pin_mode != DISABLED) << bit;
        pushing |= (uint32_t)(pin_mode == PUSHPULL || pin_mode == PUSHPULLDRIVE) << bit;
    }
}

uint32_t Gpio::peek(uint32_t offset) const {
    if (offset < PORTS * PORT_SIZE && offset % PORT_SIZE == PA_DIN) {
        const uint32_t port = offset / PORT_SIZE;
        return levels[port] & ports[port].enabled;
    }
    return Peripheral::peek(offset);
}

uint32_t Gpio::read(uint32_t offset) {
    if (offset < PORTS * PORT_SIZE && offset % PORT_SIZE == PA_DIN) {
        const int port = (int)(offset / PORT_SIZE);
        if (part.attached && part.attached->part_inputs[port]) {
            const uint32_t sensed = part.attached->part_inputs[port];
            const uint32_t now = part.attached->input_levels(port, part.now());
            set_levels(port, (levels[port] & ~sensed) | (now & sensed));
        }
    }
    return Gpio::peek(offset);
}

bool Gpio::locked(uint32_t offset) const {
    if (!reg(LOCK)) return false;
    if (offset < PORTS * PORT_SIZE) {
        const uint32_t in_port = offset % PORT_SIZE;
        return in_port <= PA_MODEH || in_port == PA_PINLOCKN;
    }
    return offset == EXTIPSELL || offset == EXTIPSELH || offset == INSENSE || offset == ROUTE;
}

void Gpio::write(uint32_t offset, uint32_t value) {
    if (offset == LOCK) {
        lock(LOCK, value, GPIO_UNLOCK);
    } else if (locked(offset)) {
        report_locked();
    } else if (offset < PORTS * PORT_SIZE) {
        write_port((int)(offset / PORT_SIZE), offset % PORT_SIZE, value);
    } else if (offset == CMD) {
        if (value & CMD_EM4WUCLR)
            reg(EM4WUCAUSE) = 0;
    } else {
        change_heed([&] {
            Peripheral::write(offset, value);
            interrupts_selected();
        });
    }
}

// A pin locked by PINLOCKN keeps its mode and output until a reset (32.3.1.4).
void Gpio::write_port(int port, uint32_t offset, uint32_t value) {
    const uint32_t free = reg(at(port, PA_PINLOCKN));
    uint32_t &out = reg(at(port, PA_DOUT));
    uint32_t wanted = out;
    switch (offset) {
    case PA_DOUT: wanted = value; break;
    case PA_DOUTSET: wanted = out | value; break;
    case PA_DOUTCLR: wanted = out & ~value; break;
    case PA_DOUTTGL: wanted = out ^ value; break;
    case PA_MODEL:
    case PA_MODEH: {
        uint32_t mask = 0;
        for (int bit = 0; bit < 8; bit++)
            if (free >> (bit + (offset == PA_MODEH ? 8 : 0)) & 1)
                mask |= 0xFu << 4 * bit;
        uint32_t &modes = reg(at(port, offset));
        modes = (modes & ~mask) | (value & mask);
        modes_changed(port);
        refresh(port, offset == PA_MODEH ? 0xFF00 : 0x00FF);
        return;
    }
    case PA_PINLOCKN:
        reg(at(port, PA_PINLOCKN)) &= value;
        return;
    default:
        store(at(port, offset), value);
        return;
    }
    wanted = (out & ~free) | (wanted & free & 0xFFFF);
    const uint32_t changed = out ^ wanted;
    out = wanted;
    if (changed)
        refresh(port, changed);
}

void Gpio::function(int pin, const Peripheral *owner, bool driven, bool level) {
    if (pin < 0) return;
    Port &one = ports[pin / PINS];
    const uint32_t mask = 1u << pin % PINS;
    if (driven && owners[pin] && owners[pin] != owner)
        part.log_once("pin P%c%d is driven by %s and by %s", 'A' + pin / PINS, pin % PINS,
                      owners[pin]->instance.name, owner->instance.name);
    if (!driven && owners[pin] != owner) return;
    owners[pin] = driven ? owner : nullptr;
    set_bits(one.functions, mask, driven);
    set_bits(one.function_levels, mask, level);
    refresh(pin / PINS, mask);
}

void Gpio::release(int signal, const Peripheral *owner) {
    for (const int pin : ROUTES[signal])
        function(pin, owner, false, false);
}

void Gpio::drive_from_outside(int port, int bit, int level) {
    if (port < 0 || port >= PORTS || bit < 0 || bit >= PINS) return;
    Port &one = ports[port];
    const uint32_t mask = 1u << bit;
    set_bits(one.outside, mask, level >= 0);
    set_bits(one.outside_levels, mask, level > 0);
    refresh(port, mask);
}

// Updates the levels of these pins from their modes, outputs and the outside.
void Gpio::refresh(int port, uint32_t pins) {
    Port &one = ports[port];
    const uint32_t dout = reg(at(port, PA_DOUT));
    const uint32_t simple = pins & one.pushing & ~one.functions;
    uint32_t driven = (one.driven & ~pins) | simple;
    uint32_t out = (one.driven_levels & ~pins) | (dout & simple);
    uint32_t seen = (levels[port] & ~pins) | (dout & simple);
    for (uint32_t rest = pins & ~simple; rest; rest &= rest - 1) {
        const uint32_t mask = rest & -rest;
        const uint32_t pin_mode = mode(port, __builtin_ctz(mask));
        const bool set = (one.functions & mask ? one.function_levels : dout) & mask;
        const bool drives = pin_mode == PUSHPULL || pin_mode == PUSHPULLDRIVE ||
                            ((pin_mode == WIREDOR || pin_mode == WIREDORPULLDOWN) && set) ||
                            (pin_mode >= WIREDAND && !set);
        bool level;
        if (drives)
            level = set;
        else if (one.outside & mask)
            level = one.outside_levels & mask;
        else if (pin_mode == INPUTPULL || pin_mode == INPUTPULLFILTER || pin_mode == DISABLED)
            level = dout & mask;
        else
            level = pin_mode == 0xA || pin_mode == 0xB || pin_mode >= 0xE;  // pull-up; else low
        if (drives) {
            driven |= mask;
            out |= level ? mask : 0;
        }
        seen |= level ? mask : 0;
    }
    const uint32_t changed = (driven ^ one.driven) | (out ^ one.driven_levels);
    one.driven = driven;
    one.driven_levels = out;
    if (changed) {
        const uint32_t direct = part.attached ? part.attached->part_outputs[port] & changed : 0;
        if (direct)
            part.attached->outputs_changed(port, direct, out, part.now());
        for (uint32_t rest = changed & ~direct; rest; rest &= rest - 1) {
            const int bit = __builtin_ctz(rest);
            part.send(Kind::PIN, port * PINS + bit,
                      driven >> bit & 1 ? (int64_t)(out >> bit & 1) : -1,
                      field(reg(at(port, PA_CTRL)), PA_CTRL_DRIVEMODE));
        }
    }
    set_levels(port, seen);
}

void Gpio::set_levels(int port, uint32_t now_levels) {
    const uint32_t changed = levels[port] ^ now_levels;
    levels[port] = now_levels;
    if (changed && !heeded(changed)) {
        const Port &one = ports[port];
        if (reg(INSENSE) & INSENSE_PRS)
            part.prs->note_pins(changed & one.enabled & one.interrupting, now_levels);
        return;
    }
    for (uint32_t rest = changed; rest; rest &= rest - 1) {
        const int bit = __builtin_ctz(rest);
        edge(port, bit, now_levels >> bit & 1);
    }
}

void Gpio::edge(int port, int bit, bool level) {
    check_em4(port, bit, level);
    if (mode(port, bit) == DISABLED) return;
    if (interrupting_port(bit) == port) {
        if (reg(INSENSE) & INSENSE_INT && reg(level ? EXTIRISE : EXTIFALL) >> bit & 1)
            raise(1u << bit);
        if (reg(INSENSE) & INSENSE_PRS)
            part.prs->set(PRS_SOURCE + bit / 8, bit % 8, level);
    }
    for (Peripheral *one : listeners)
        one->pin_changed(port, bit, level);
}

bool Gpio::heeded(uint32_t changed) const {
    return part.mode == 4 || !listeners.empty() || changed & (reg(EXTIRISE) | reg(EXTIFALL)) ||
           part.prs->listens_to_pins();
}

int Gpio::interrupting_port(int bit) const {
    return (int)(reg(bit < 8 ? EXTIPSELL : EXTIPSELH) >> 4 * (bit % 8) & 7);
}

bool Gpio::heeds(int port, int bit) const {
    const bool interrupts = (reg(EXTIRISE) | reg(EXTIFALL)) >> bit & 1;
    return !listeners.empty() || reg(EM4WUEN) ||
           (interrupting_port(bit) == port &&
            (interrupts || part.prs->listens(PRS_SOURCE + bit / 8, bit % 8)));
}

void Gpio::update_interrupts() {
    const uint32_t flags = reg(IF) & reg(IEN);
    line(0, flags & 0x5555);
    line(1, flags & 0xAAAA);
}

void Gpio::check_em4(int port, int bit, bool level) {
    if (part.mode != 4) return;
    for (uint32_t n = 0; n < 6; n++) {
        if (EM4_PINS[n] == port * PINS + bit && reg(EM4WUEN) >> n & 1 &&
            (reg(EM4WUPOL) >> n & 1) == (uint32_t)level) {
            reg(EM4WUCAUSE) |= 1u << n;
            part.emu->wake_from_em4();
        }
    }
}

}  // namespace efm32gg
