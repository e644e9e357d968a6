// The circuit at the part's pins and external bus, when it is simulated in C++ and called directly.
#pragma once

#include <cstdint>

namespace efm32gg {

class AttachedCircuit {
public:
    static constexpr int PORTS = 6;

    virtual ~AttachedCircuit() = default;

    // Pins that the circuit drives, and pins whose changes it receives in place of the outbox.
    uint32_t part_inputs[PORTS] = {}, part_outputs[PORTS] = {};

    // Levels of `port` at `now`; only bits in `part_inputs` count.
    virtual uint32_t input_levels(int port, int64_t now) = 0;

    // Outputs in `changed`, all in `part_outputs`, took `levels` at `now`.
    virtual void outputs_changed(int port, uint32_t changed, uint32_t levels, int64_t now) = 0;

    // Access to one byte of the external bus beyond the part's own arrays; false: no answer.
    virtual bool bus_access(int bank, uint32_t address, uint8_t &value, bool write, int64_t now) = 0;
};

}  // namespace efm32gg
