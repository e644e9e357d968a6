// Instrumentation trace macrocell, whose stimulus ports carry printf. ARMv7-M Architecture
// Reference Manual C1.7. A port is always ready.

#pragma once

#include <cstdint>

namespace armv7m {

class Itm {
public:
    void reset() {
        control = ports = privilege = 0;
        unlocked = false;
    }

    // Sets it up as a trace probe does: unlocked, on, all ports on. For programs that leave this to
    // the probe.
    void enable_all() {
        control = 1;
        ports = ~0u;
        unlocked = true;
    }

    // Whether writes to a port are forwarded.
    bool enabled(uint32_t port) const { return (control & 1) && (ports >> port & 1); }
    bool user_may_write(uint32_t port) const { return !(privilege >> (port / 8) & 1); }

    // Offsets from 0xE0000000. Reads include the stimulus ports, writes do not.
    uint32_t read(uint32_t offset) const {
        if (offset < 0x80) return 1;    // FIFOREADY
        switch (offset) {
        case TER: return ports;
        case TPR: return privilege;
        case TCR: return control;
        case LSR: return unlocked ? 1 : 3;
        default: return 0;
        }
    }

    void write(uint32_t offset, uint32_t value) {
        if (offset == LAR) unlocked = value == 0xC5ACCE55;
        if (!unlocked) return;
        switch (offset) {
        case TER: ports = value; break;
        case TPR: privilege = value & 15; break;
        case TCR: control = value & 0x007F0F1F; break;
        }
    }

private:
    enum : uint32_t { TER = 0xE00, TPR = 0xE40, TCR = 0xE80, LAR = 0xFB0, LSR = 0xFB4 };

    uint32_t control = 0, ports = 0, privilege = 0;
    bool unlocked = false;
};

}  // namespace armv7m
