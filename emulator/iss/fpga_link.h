// Connects port pins of a part to an FPGA, so that a loop over pins makes no callbacks.
//
// With a compiled design, `set`, `get` and `burst` are functions of its driver (driver.cpp of the
// compiled engine). While no camera runs, the FPGA needs no clocks. While one runs, an access to a
// pin first makes the clocks up to that time; if a burst ends for another reason than time,
// `attend` handles it, advances everything to `now` and returns the cameras that then run.
//
// Any other FPGA is accessed through `slow_get` and `slow_set`, which advance it themselves.

#pragma once

#include "efm32gg/part/attached_circuit.h"
#include "efm32gg/part/schedule.h"

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

namespace efm32gg {
class Part;
}

class FpgaLink : public efm32gg::AttachedCircuit {
public:
    // Delay of pin interrupts after a change of a pin.
    static constexpr int64_t POLL_INTERVAL = efm32gg::MICROSECOND;

    FpgaLink(efm32gg::Part &part, const FpgaDriver &fpga, const FpgaWire *wires, int32_t count);
    ~FpgaLink();

    uint32_t input_levels(int port, int64_t now) override;
    void outputs_changed(int port, uint32_t changed, uint32_t levels, int64_t now) override;
    bool bus_access(int bank, uint32_t address, uint8_t &value, bool write, int64_t now) override;

    // Running cameras, one bit each.
    void set_running(uint32_t mask);

private:
    efm32gg::Part &part;
    const FpgaDriver fpga;
    std::vector<FpgaWire> wires;
    std::vector<uint32_t> driven;    // by wire: level of the FPGA's pin
    std::vector<uint32_t> reported;  // by wire: level last reported to the part
    uint32_t running = 0;
    efm32gg::Event polling = efm32gg::Event::of<&FpgaLink::poll>(this);

    bool compiled() const { return fpga.driver != nullptr; }
    uint32_t level(const FpgaWire &wire, int64_t now);
    void advance(int64_t now);
    void report(int64_t now);
    void poll(int64_t now);
    void schedule_poll(int64_t now);
};
