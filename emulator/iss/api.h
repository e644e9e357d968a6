// The C face of a machine: what machine.py calls. Nothing here throws; times are picoseconds.
//
// A machine is a core with a part around it. Made bare, it has memories only, for tests of the core.

#pragma once

#include "efm32gg/part/outbox.h"
#include "fpga_link.h"

#include <cstdint>

extern "C" {

// Why a run ended; StopReason in machine.py has the same order.
enum StopReason : int32_t {
    STOP_TIME,        // the wanted time is reached
    STOP_OUTBOX,      // something for the outside is in the outbox
    STOP_ASLEEP,      // the core fell asleep
    STOP_AWAKE,       // the core awoke
    STOP_BREAKPOINT,  // before the instruction at a breakpoint
    STOP_WATCHPOINT,  // after the instruction that made the access
    STOP_STEPPED,     // after one instruction
    STOP_HALTED,      // BKPT with a debugger, at that instruction
    STOP_LOCKED_UP,   // the core is locked up, until a reset
    STOP_FAULT,       // vector catch: at the first instruction of a handler
};

namespace armv7m {
class Cpu;
class System;
}

namespace efm32gg {
class Part;
}

struct IssMachine;

// Memories are the caller's and outlive the machine; sizes in bytes, powers of two. `analog` are
// volts by channel. `bare`: no part, flash at 0 and RAM at 0x20000000, one cycle of `hz` each.
IssMachine *iss_new(uint8_t *flash, int64_t flash_bytes, uint8_t *ram, int64_t ram_bytes,
                    uint8_t *external, int64_t external_bytes, uint8_t *information,
                    const double *analog, int32_t bare, int64_t hz);
void iss_delete(IssMachine *machine);

// Time and running.
void iss_reset(IssMachine *machine, int32_t cause);
// The reason, plus 256 if there is something in the outbox; `reached` is the time.
int32_t iss_run(IssMachine *machine, int64_t until_ps, int64_t *reached);
// One instruction, or more while the next one lies in [low, high).
int32_t iss_step(IssMachine *machine, int64_t until_ps, uint32_t low, uint32_t high,
                 int64_t *reached);
int64_t iss_now(const IssMachine *machine);
int64_t iss_cycles(const IssMachine *machine);
int64_t iss_next_event(const IssMachine *machine);  // INT64_MAX for none
int32_t iss_asleep(const IssMachine *machine);      // 0 awake, else 1 + energy mode
int64_t iss_instructions(const IssMachine *machine);
int64_t iss_hz(const IssMachine *machine);          // of the core now

// The outbox: moves up to `count` records to `out`, returns how many.
int64_t iss_take(IssMachine *machine, efm32gg::Outgoing *out, int64_t count);

// Registers by number: r0..r15, then xpsr, msp, psp, primask, basepri, faultmask, control.
uint32_t iss_register(const IssMachine *machine, int32_t number);
void iss_set_register(IssMachine *machine, int32_t number, uint32_t value);

// Memory: `peek` and `poke` as a debugger does, without side effects on reads; the others are
// accesses of the bus, 1, 2 or 4 bytes wide. Return how many bytes were done.
int64_t iss_peek(IssMachine *machine, uint32_t address, uint8_t *out, int64_t count);
int64_t iss_poke(IssMachine *machine, uint32_t address, const uint8_t *data, int64_t count);
int32_t iss_load(IssMachine *machine, uint32_t address, int32_t bytes, uint32_t *value);
int32_t iss_store(IssMachine *machine, uint32_t address, int32_t bytes, uint32_t value);
void iss_invalidate(IssMachine *machine, uint32_t address, int64_t count);

// Inputs; see machine.py.
void iss_pin(IssMachine *machine, int32_t port, int32_t bit, int32_t level);
int32_t iss_pin_level(const IssMachine *machine, int32_t port, int32_t bit);
void iss_uart_receive(IssMachine *machine, int32_t unit, uint32_t data, uint32_t flags);
int32_t iss_i2c_slave(IssMachine *machine, int32_t unit, int32_t what, int32_t byte);
void iss_i2c_answer(IssMachine *machine, int32_t unit, int32_t acknowledged, int32_t data);
void iss_analog_changed(IssMachine *machine);

// Debugging.
void iss_breakpoint(IssMachine *machine, uint32_t address, int32_t on);
void iss_watchpoint(IssMachine *machine, uint32_t address, uint32_t count, int32_t kind,
                    int32_t on);
void iss_watch_hit(const IssMachine *machine, uint32_t *hit);  // pc, address, size, value, write
// A debugger is there: BKPT stops, and so do the exceptions of `catches` (DEMCR.VC_*).
void iss_debugger(IssMachine *machine, int32_t attached, uint32_t catches);

// BKPT 0xAB is a call of semihosting (console, clock, exit); off, a breakpoint as any other.
void iss_semihosting(IssMachine *machine, int32_t on);
// The core executes nothing until a reset; time passes.
void iss_hang(IssMachine *machine);
// From another call within a run: it ends after the running instruction.
void iss_stop(IssMachine *machine);

// What other C++ of this library builds on; null for a bare machine's part.
armv7m::System *iss_system(IssMachine *machine);
armv7m::Cpu *iss_cpu(IssMachine *machine);
efm32gg::Part *iss_part(IssMachine *machine);

// The FPGA; see fpga_link.h.
void iss_fpga(IssMachine *machine, const FpgaDriver *driver, const FpgaWire *wires, int32_t count);
void iss_fpga_running(IssMachine *machine, uint32_t running);
}
