// Bits of the fault status registers: ARMv7-M Architecture Reference Manual, B3.2.15 to B3.2.17.
#pragma once

#include <cstdint>

namespace armv7m {

enum : uint32_t {
    IACCVIOL = 1u << 0, DACCVIOL = 1u << 1, MUNSTKERR = 1u << 3, MSTKERR = 1u << 4,
    MMARVALID = 1u << 7,
    IBUSERR = 1u << 8, PRECISERR = 1u << 9, IMPRECISERR = 1u << 10, UNSTKERR = 1u << 11,
    STKERR = 1u << 12, BFARVALID = 1u << 15,
    UNDEFINSTR = 1u << 16, INVSTATE = 1u << 17, INVPC = 1u << 18, NOCP = 1u << 19,
    UNALIGNED = 1u << 24, DIVBYZERO = 1u << 25,
    VECTTBL = 1u << 1, FORCED = 1u << 30, DEBUGEVT = 1u << 31,    // HFSR
    DFSR_BKPT = 1u << 1, DFSR_VCATCH = 1u << 3,
};

}  // namespace armv7m
