#include "fpga_link.h"

#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"

namespace {

constexpr int32_t TIME_REACHED = 0;  // an outcome of the driver's burst

uint32_t mask_of(const FpgaWire &wire) { return (1u << wire.width) - 1; }

}  // namespace

FpgaLink::FpgaLink(efm32gg::Part &part, const FpgaDriver &fpga, const FpgaWire *given,
                   int32_t count)
    : part(part), fpga(fpga), wires(given, given + count), driven(count), reported(count) {
    for (const FpgaWire &wire : wires)
        (wire.input ? part_inputs : part_outputs)[wire.port] |= mask_of(wire) << wire.bit;
}

FpgaLink::~FpgaLink() { part.cancel(polling); }

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
    if (!fpga.slow_external) return false;
    const int32_t answer = fpga.slow_external(bank, address, write ? value : -1, now);
    if (answer >= 0 && !write)
        value = (uint8_t)answer;
    return answer >= 0;
}

void FpgaLink::set_running(uint32_t mask) {
    running = mask;
    schedule_poll(part.now());
    report(part.now());
}

uint32_t FpgaLink::level(const FpgaWire &wire, int64_t now) {
    return compiled() ? fpga.get(fpga.driver, wire.pin) : fpga.slow_get(wire.pin, now);
}

// Makes the clocks of running cameras. Engines that are not compiled do so themselves.
void FpgaLink::advance(int64_t now) {
    if (!running || !compiled()) return;
    int64_t reached = now;
    int32_t camera = 0;
    const int32_t outcome = fpga.burst(fpga.driver, now, running, &reached, &camera);
    if (outcome != TIME_REACHED)
        running = fpga.attend(reached, outcome, camera, now);
    report(now);
}

// Reports changes of pins with `alert` to the part's pin interrupts.
void FpgaLink::report(int64_t now) {
    for (std::size_t n = 0; n < wires.size(); n++) {
        const FpgaWire &wire = wires[n];
        if (!wire.alert) continue;
        const uint32_t value = level(wire, now) & mask_of(wire);
        const uint32_t changed = value ^ reported[n];
        reported[n] = value;
        for (int bit = 0; bit < wire.width; bit++)
            if (changed >> bit & 1)
                part.gpio->drive_from_outside(wire.port, wire.bit + bit, value >> bit & 1);
    }
}

void FpgaLink::poll(int64_t now) {
    advance(now);
    report(now);
    schedule_poll(now);
}

void FpgaLink::schedule_poll(int64_t now) {
    if (running)
        part.schedule(polling, now + POLL_INTERVAL);
    else
        part.cancel(polling);
}
