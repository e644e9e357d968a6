// Leads port pins of a part to an FPGA, so that a loop over pins calls nobody outside.
//
// With a compiled design, `set`, `get` and `burst` are functions of its driver (driver.cpp of the
// compiled engine). While no camera runs, time passes for the FPGA by itself. While one runs, its
// clocks are made up to a pin's access first; a burst that ends for another reason than time is
// handed to `attend`, which brings everything to `now` and tells who runs from then on.
//
// Any other FPGA is reached through `slow_get` and `slow_set`, which advance it by themselves.

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

// `width` bits from `bit` of `port` are those of the FPGA's pin number `pin`. Those the FPGA drives
// are inputs of the part; those of `alert` raise the part's pin interrupts, too.
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
    // How late a pin that changes by itself is seen by pin interrupts.
    static constexpr int64_t LOOK = efm32gg::MICROSECOND;

    FpgaLink(efm32gg::Part &part, const FpgaDriver &fpga, const FpgaWire *wires, int32_t count);
    ~FpgaLink();

    uint32_t input_levels(int port, int64_t now) override;
    void outputs_changed(int port, uint32_t changed, uint32_t levels, int64_t now) override;
    bool bus_access(int bank, uint32_t address, uint8_t &value, bool write, int64_t now) override;

    // Cameras that run, one bit each, as the engine has it.
    void set_running(uint32_t mask);

private:
    efm32gg::Part &part;
    const FpgaDriver fpga;
    std::vector<FpgaWire> wires;
    std::vector<uint32_t> driven;    // by wire: what the FPGA's pin has
    std::vector<uint32_t> seen;      // by wire: what the part was told
    uint32_t running = 0;
    efm32gg::Event looking;

    bool compiled() const { return fpga.driver != nullptr; }
    uint32_t level(const FpgaWire &wire, int64_t now);
    void advance(int64_t now);
    void tell(int64_t now);
    void look(int64_t now);
    void watch(int64_t now);
};
