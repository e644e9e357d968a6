// Connects port pins of a part to an FPGA, so that a loop over pins makes no callbacks.
//
// With a compiled design, `set`, `get` and `burst` are functions of its driver (driver.cpp of the
// compiled engine). While no camera runs, the FPGA needs no clocks. While one runs, an access to a
// pin first makes the clocks up to that time; if a burst ends for another reason than time,
// `attend` handles it, advances everything to `now` and returns the cameras that then run.
//
// Any other FPGA is accessed through `slow_get` and `slow_set`, which advance it themselves.

#pragma once

#include "efm32gg/pins/gpio.h"

#include <cstdint>
#include <vector>

extern "C" {

struct FpgaDriver {
    void *driver;
    void (*set)(void *driver, int32_t pin, uint32_t value, int64_t now);
    uint32_t (*get)(const void *driver, int32_t pin);
    int32_t (*burst)(void *driver, int64_t until, uint32_t running, int64_t *reached,
                     int32_t *camera);
    uint32_t (*attend)(int64_t reached, int32_t outcome, int32_t camera, int64_t now);
    uint32_t (*slow_get)(int32_t pin, int64_t now);
    void (*slow_set)(int32_t pin, uint32_t value, int64_t now);
    int32_t (*slow_external)(int32_t bank, uint32_t address, int32_t value, int64_t now);
};

// `width` bits from `bit` of `port` are connected to the FPGA's pin number `pin`. `input`: the FPGA
// drives them; `alert`: they also raise the part's pin interrupts.
struct FpgaWire {
    int32_t port, bit, width, pin;
    int32_t input, alert;
};
}

class FpgaLink : public efm32gg::AttachedCircuit {
public:
    // Pin interrupts come at the multiple of this time after a change of a pin.
    static constexpr int64_t POLL_INTERVAL = efm32gg::MICROSECOND;

    FpgaLink(efm32gg::Part &part, const FpgaDriver &fpga, const FpgaWire *given, int32_t count)
        : part(part), fpga(fpga), wires(given, given + count), reported(count) {
        for (const FpgaWire &wire : wires) {
            (wire.input ? part_inputs : part_outputs)[wire.port] |= mask_of(wire) << wire.bit;
            (wire.input ? inputs : outputs)[wire.port].push_back(wire);
        }
    }

    ~FpgaLink() { part.cancel(polling); }

    uint32_t input_levels(int port, int64_t now) override {
        advance(now);
        uint32_t levels = 0;
        for (const FpgaWire &wire : inputs[port])
            levels |= (level(wire, now) & mask_of(wire)) << wire.bit;
        return levels;
    }

    void outputs_changed(int port, uint32_t changed, uint32_t levels, int64_t now) override {
        for (const FpgaWire &wire : outputs[port]) {
            if (!(changed >> wire.bit & mask_of(wire))) continue;
            const uint32_t driven = levels >> wire.bit & mask_of(wire);
            advance(now);
            if (compiled())
                fpga.set(fpga.driver, wire.pin, driven, now);
            else
                fpga.slow_set(wire.pin, driven, now);
        }
    }

    bool bus_access(int bank, uint32_t address, uint8_t &value, bool write, int64_t now) override {
        if (!fpga.slow_external) return false;
        const int32_t answer = fpga.slow_external(bank, address, write ? value : -1, now);
        if (answer >= 0 && !write)
            value = (uint8_t)answer;
        return answer >= 0;
    }

    void heed_changing(int64_t now) override {
        if (running && !polling.pending())
            advance(now - now % POLL_INTERVAL);
    }

    void heed_changed(int64_t now) override { schedule_poll(now); }

    // Running cameras, one bit each.
    void set_running(uint32_t mask) {
        running = mask;
        schedule_poll(part.now());
        report(part.now());
    }

    // Brings the levels of the part's pins up to date, which without polls are those of the last
    // access.
    void show() {
        advance(part.now());
        report(part.now());
    }

private:
    static constexpr int32_t TIME_REACHED = 0;  // an outcome of the driver's burst

    efm32gg::Part &part;
    const FpgaDriver fpga;
    std::vector<FpgaWire> wires;
    std::vector<FpgaWire> inputs[PORTS], outputs[PORTS];    // by port, in their order
    std::vector<uint32_t> reported;  // by wire: level last reported to the part
    uint32_t running = 0;
    efm32gg::Event polling = efm32gg::Event::of<&FpgaLink::poll>(this);

    static uint32_t mask_of(const FpgaWire &wire) { return (1u << wire.width) - 1; }
    bool compiled() const { return fpga.driver != nullptr; }

    uint32_t level(const FpgaWire &wire, int64_t now) {
        return compiled() ? fpga.get(fpga.driver, wire.pin) : fpga.slow_get(wire.pin, now);
    }

    // Makes the clocks of running cameras. Engines that are not compiled do so themselves.
    void advance(int64_t now) {
        if (!running || !compiled()) return;
        int64_t reached = now;
        int32_t camera = 0;
        const int32_t outcome = fpga.burst(fpga.driver, now, running, &reached, &camera);
        if (outcome != TIME_REACHED)
            running = fpga.attend(reached, outcome, camera, now);
        report(now);
    }

    // Reports changes of pins with `alert` to the part's pin interrupts.
    void report(int64_t now) {
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

    void poll(int64_t now) {
        advance(now);
        report(now);
        schedule_poll(now);
    }

    // Polls only while a change of a pin does more than what the program sees when it reads it.
    void schedule_poll(int64_t now) {
        if (running && heeded())
            part.schedule(polling, now - now % POLL_INTERVAL + POLL_INTERVAL);
        else
            part.cancel(polling);
    }

    bool heeded() const {
        for (const FpgaWire &wire : wires)
            for (int bit = 0; bit < wire.width && wire.alert; bit++)
                if (part.gpio->heeds(wire.port, wire.bit + bit)) return true;
        return false;
    }
};
