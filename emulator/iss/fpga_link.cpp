#include "fpga_link.h"

#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"

using efm32gg::Event;

namespace {

constexpr int32_t TIME_REACHED = 0;  // of the driver's outcomes

uint32_t mask_of(const FpgaWire &wire) { return (1u << wire.width) - 1; }

}  // namespace

FpgaLink::FpgaLink(efm32gg::Part &part, const FpgaDriver &fpga, const FpgaWire *given,
                   int32_t count)
    : part(part), fpga(fpga), wires(given, given + count), driven(count), seen(count),
      looking(Event::of<&FpgaLink::look>(this)) {
    for (const FpgaWire &wire : wires)
        (wire.input ? part_inputs : part_outputs)[wire.port] |= mask_of(wire) << wire.bit;
}

FpgaLink::~FpgaLink() { part.cancel(looking); }

uint32_t FpgaLink::input_levels(int port, int64_t now) {
    advance(now);
    uint32_t levels = 0;
    for (const FpgaWire &wire : wires)
        if (wire.port == port && wire.input)
            levels |= (level(wire, now) & mask_of(wire)) << wire.bit;
    return levels;
}

void FpgaLink::outputs_changed(int port, uint32_t changed, uint32_t levels, int64_t now) {
    for (std::size_t n = 0; n < wires.size(); n++) {
        const FpgaWire &wire = wires[n];
        if (wire.port != port || wire.input || !(changed >> wire.bit & mask_of(wire)))
            continue;
        driven[n] = levels >> wire.bit & mask_of(wire);
        advance(now);
        if (compiled())
            fpga.set(fpga.driver, wire.pin, driven[n], now);
        else
            fpga.slow_set(wire.pin, driven[n], now);
    }
}

bool FpgaLink::bus_access(int bank, uint32_t address, uint8_t &value, bool write, int64_t now) {
    if (!fpga.slow_external)
        return false;
    const int32_t answer = fpga.slow_external(bank, address, write ? value : -1, now);
    if (answer >= 0 && !write)
        value = (uint8_t)answer;
    return answer >= 0;
}

void FpgaLink::set_running(uint32_t mask) {
    running = mask;
    watch(part.now());
    tell(part.now());
}

uint32_t FpgaLink::level(const FpgaWire &wire, int64_t now) {
    return compiled() ? fpga.get(fpga.driver, wire.pin) : fpga.slow_get(wire.pin, now);
}

// Makes the clocks of the cameras that run. An engine that is not compiled does so when asked.
void FpgaLink::advance(int64_t now) {
    if (!running || !compiled())
        return;
    int64_t reached = now;
    int32_t camera = 0;
    const int32_t outcome = fpga.burst(fpga.driver, now, running, &reached, &camera);
    if (outcome != TIME_REACHED)
        running = fpga.attend(reached, outcome, camera, now);
    tell(now);
}

// Tells the part's pin interrupts what became of the pins that alert.
void FpgaLink::tell(int64_t now) {
    for (std::size_t n = 0; n < wires.size(); n++) {
        const FpgaWire &wire = wires[n];
        if (!wire.alert)
            continue;
        const uint32_t value = level(wire, now) & mask_of(wire);
        const uint32_t changed = value ^ seen[n];
        seen[n] = value;
        for (int bit = 0; bit < wire.width; bit++)
            if (changed >> bit & 1)
                part.gpio->drive_from_outside(wire.port, wire.bit + bit, value >> bit & 1);
    }
}

void FpgaLink::look(int64_t now) {
    advance(now);
    tell(now);
    watch(now);
}

void FpgaLink::watch(int64_t now) {
    if (running)
        part.schedule(looking, now + LOOK);
    else
        part.cancel(looking);
}
