// Instrumentation trace macrocell: its stimulus ports carry printf (ARMv7-M Architecture
// Reference Manual C1.7).

#pragma once

#include <cstdint>

namespace armv7m {

class Itm {
public:
    void reset();
    bool enabled(int port) const { return (control & 1) && (ports >> port & 1); }
    uint32_t read(uint32_t offset) const;    // offset from 0xE0000000
    void write(uint32_t offset, uint32_t value);

private:
    uint32_t control = 0, ports = 0, privilege = 0;
};

}  // namespace armv7m
