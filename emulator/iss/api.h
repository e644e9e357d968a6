// The part of the C interface (api.cpp) that other C++ of this library uses.
#pragma once

#include <cstdint>

namespace armv7m {
class Cpu;
class System;
}

struct IssMachine;

extern "C" int64_t iss_now(const IssMachine *machine);
armv7m::Cpu *iss_cpu(IssMachine *machine);
armv7m::System *iss_system(IssMachine *machine);
