// Instrumentation trace macrocell, whose stimulus ports carry printf. ARMv7-M Architecture
// Reference Manual C1.7. A port is always ready.

#pragma once

#include <cstdint>

namespace armv7m {

class Itm {
public:
    void reset();
    // Sets it up as a trace probe does: unlocked, on, all ports on. For programs that leave this to
    // the probe.
    void enable_all();

    // Whether writes to a port are forwarded.
    bool enabled(uint32_t port) const { return (control & 1) && (ports >> port & 1); }
    bool user_may_write(uint32_t port) const { return !(privilege >> (port / 8) & 1); }

    uint32_t read(uint32_t offset) const;    // offset from 0xE0000000; stimulus ports included
    void write(uint32_t offset, uint32_t value);    // stimulus ports not

private:
    enum : uint32_t { TER = 0xE00, TPR = 0xE40, TCR = 0xE80, LAR = 0xFB0, LSR = 0xFB4 };

    uint32_t control = 0, ports = 0, privilege = 0;
    bool unlocked = false;
};

}  // namespace armv7m
