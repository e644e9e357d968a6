// Instrumentation trace macrocell: its stimulus ports carry printf; ARMv7-M Architecture Reference
// Manual C1.7. A port is always ready: what is written leaves at once.

#pragma once

#include <cstdint>

namespace armv7m {

class Itm {
public:
    void reset();
    // As a trace probe leaves it: unlocked, on, all ports on. Programs that print but leave the
    // set-up to the probe are heard then.
    void enable_all();

    // Whether what is written to a port is heard.
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
