// The ARMv7-M core of a Cortex-M3: registers, memory access, and the loop that runs instructions.
//
// Sources: ARMv7-M Architecture Reference Manual (ARM DDI 0403), Cortex-M3 Technical Reference
// Manual r2p0 (ARM DDI 0337).
//
// Contract of the loop. run() executes whole instructions while cycles < deadline, and returns why
// it stopped. It calls System::service before the first instruction, when System::next_cycle() is
// reached and after attention(). During a call to Bus, System or Tracer all public members are
// current, and r[15] is the address of the running instruction; for System::svc, wfi and wfe it is
// the address of the next one, and execution continues at whatever the callee writes to r[15]. In
// exception_return and service the callee sets r[15]. Callees may call stop(), attention(),
// set_deadline() and invalidate(), which take effect after the running instruction. Nothing throws,
// and nothing is allocated while the loop runs.

#pragma once

#include "armv7m/decode/codes.h"
#include "armv7m/memory/bus.h"

#include <cstdint>
#include <memory>
#include <vector>

namespace armv7m {

class System;
class Cpu;

enum class Fault : uint8_t;    // system.h

// How an access ended.
enum class Result : uint8_t { Done, BusError, Violation, Unaligned, Watched };

// Why run() returned; several bits may be set.
enum Exit : uint32_t {
    ExitDeadline = 1,       // cycles >= deadline
    ExitStop = 2,           // stop() was called
    ExitSleep = 4,          // asleep (System::sleep)
    ExitLockup = 8,         // System::locked_up
    ExitBreakpoint = 16,    // r[15] has a breakpoint; it was not executed
    ExitWatchpoint = 32,    // the instruction at r[15] is about to hit one: see watch_hit
    ExitStep = 64,          // the instructions of steps() are executed
};

// Observes execution while it is set (Cpu::set_tracer).
class Tracer {
public:
    virtual ~Tracer() = default;
    // An instruction was executed, or skipped by its condition. `before` and `after` are cycles
    // without the entry of an exception.
    virtual void instruction(uint32_t pc, uint32_t next, int64_t before, int64_t after,
                             Cpu &cpu) = 0;
    // Called by System; `returns_to`: the stacked address.
    virtual void exception_entry(int number, uint32_t returns_to, Cpu &cpu) = 0;
    virtual void exception_return(uint32_t exc_return, Cpu &cpu) = 0;
};

struct Watch {
    uint32_t address, size;
    bool on_read, on_write;
};

class Cpu {
public:
    Cpu(Bus &bus) : bus(bus) {}
    Cpu(const Cpu &) = delete;

    Bus &bus;
    System *system = nullptr;          // must be set before run()

    // Registers. r[13] is the stack pointer in use; `other_sp` is the other one.
    uint32_t r[16] = {};
    uint32_t other_sp = 0;
    uint64_t nz = 0;                   // Z: the low word is 0. N: any bit from 31 upwards
    uint8_t carry = 0, overflow = 0, saturated = 0;
    uint8_t it = 0;                    // ITSTATE as in EPSR, 0 outside of a block
    uint8_t thumb = 1;                 // EPSR.T; 0: the next instruction faults (InvalidState)
    uint16_t ipsr = 0;                 // number of the active exception
    uint8_t primask = 0, faultmask = 0, basepri = 0;
    uint8_t control = 0;               // bit 0: nPRIV, bit 1: SPSEL; changed by set_control

    // Time and the end of the loop.
    int64_t cycles = 0;
    int64_t deadline = 0;              // changed by set_deadline
    bool exclusive = false;            // the local monitor; exception entry and return clear it

    // Flags.
    bool n() const { return nz >> 31 != 0; }
    bool z() const { return (uint32_t)nz == 0; }
    void set_nz(bool n, bool z) { nz = z ? (uint64_t)n << 32 : n ? 0x80000000u : 1; }
    uint32_t apsr() const {
        return (uint32_t)n() << 31 | (uint32_t)z() << 30 | (uint32_t)carry << 29 |
               (uint32_t)overflow << 28 | (uint32_t)saturated << 27;
    }
    void set_apsr(uint32_t value) {
        set_nz(value >> 31, value >> 30 & 1);
        carry = value >> 29 & 1, overflow = value >> 28 & 1, saturated = value >> 27 & 1;
    }
    // All of xPSR, with IT and T bits (as it is stacked).
    uint32_t xpsr() const {
        return apsr() | (uint32_t)(it & 3) << 25 | (uint32_t)thumb << 24 |
               (uint32_t)(it & 0xFC) << 8 | ipsr;
    }
    void set_xpsr(uint32_t value) {
        set_apsr(value);
        it = (uint8_t)((value >> 8 & 0xFC) | (value >> 25 & 3));
        thumb = value >> 24 & 1, ipsr = value & 0x1FF;
    }

    bool handler_mode() const { return ipsr != 0; }
    bool privileged() const { return ipsr != 0 || !(control & 1); }
    // The stack pointers, whichever is in use. Their two low bits stay 0.
    bool process_stack_in_use() const { return control & 2; }
    uint32_t main_sp() const { return control & 2 ? other_sp : r[13]; }
    uint32_t process_sp() const { return control & 2 ? r[13] : other_sp; }
    void set_main_sp(uint32_t value) { (control & 2 ? other_sp : r[13]) = value & ~3u; }
    void set_process_sp(uint32_t value) { (control & 2 ? r[13] : other_sp) = value & ~3u; }
    void set_control(uint8_t value);   // switches r[13] when SPSEL changes
    // Registers for a debugger by number: r0..r15, then xpsr, msp, psp, primask, basepri,
    // faultmask, control.
    uint32_t debug_register(int number) const;
    void set_debug_register(int number, uint32_t value);

    // Sets the registers to their reset values, except those that System reads from the vector
    // table.
    void reset();

    // Deadline and stopping, from outside or from a callee.
    void set_deadline(int64_t cycle) { deadline = cycle, update_limit(); }
    void lower_deadline(int64_t cycle) { if (cycle < deadline) set_deadline(cycle); }
    void stop() { stop_requested = true, limit = INT64_MIN; }
    void attention() { attention_requested = true, limit = INT64_MIN; }

    // Returns Exit bits. A breakpoint at which the last run stopped does not stop this one again.
    uint32_t run();
    // The next run() ends after `count` instructions with ExitStep; those whose successor lies in
    // [low, high) are not counted.
    void steps(int64_t count, uint32_t low = 0, uint32_t high = 0);

    // Memory. Call regions_changed() after changing a region (waits, writable, host) or the MPU.
    // While mpu.enabled() every access and each fetch from another 32 bytes checks mpu.allows().
    std::vector<Region> regions;
    void add_region(const Region &region) { regions.push_back(region), regions_changed(); }
    void regions_changed();
    // The number of those calls, which take microseconds. At the second number run() ends, with
    // ExitDeadline.
    uint64_t changes = 0, most_changes = UINT64_MAX;
    // Call it after lines lost words other than by a fetch.
    void lines_changed();
    // Call it after code in a region was changed other than by the core's stores.
    void invalidate(uint32_t address, uint32_t size);

    // Accesses for System (stacking, vectors), with protection, watchpoints and waits. They raise
    // no fault. Unaligned ones are split.
    Result load(uint32_t address, uint32_t size, uint32_t &value, bool as_privileged = true);
    Result store(uint32_t address, uint32_t size, uint32_t value, bool as_privileged = true);
    // Accesses for a debugger: they take no time, and peeks have no side effects; poke also writes
    // read-only regions.
    bool peek(uint32_t address, uint32_t size, uint32_t &value);
    bool poke(uint32_t address, uint32_t size, uint32_t value);

    // Debugging; without break- and watchpoints it costs nothing.
    void set_breakpoint(uint32_t address);
    void clear_breakpoint(uint32_t address);
    void set_watches(const std::vector<Watch> &list) { watches = list, regions_changed(); }
    bool breakpoint_at(uint32_t address) const;
    void set_tracer(Tracer *listener) { tracer = listener; }
    Tracer *tracer = nullptr;
    struct {
        uint32_t pc, address, size, value;
        bool write;
    } watch_hit = {};
    uint64_t instructions = 0;         // executed since reset

private:
    static constexpr uint32_t NOWHERE = 1;    // an address that no instruction has

    // One megabyte of the address space. With a limit of 0 accesses take the slow path.
    struct Page {
        uint8_t *host = nullptr;
        uint8_t *marks = nullptr;      // one per 64 bytes: code was decoded there
        uint32_t read_limit = 0, write_limit = 0;    // bytes from the page's start
        uint8_t read_wait = 0, write_wait = 0;
        bool outside = false;          // nothing but Bus answers, and nothing watches
    };
    struct FreeCode {
        void operator()(Operation *operations) const;
    };
    // The decoded operations of a block of host memory.
    struct Code {
        uint8_t *host;
        uint32_t size;
        std::unique_ptr<Operation[], FreeCode> operations;
        std::unique_ptr<uint8_t[]> marks;
        // The region that it ran in last: Operation::entry depends on its lines.
        uint32_t base = 0;
        FetchLines *lines = nullptr;
    };

    // Memory (memory/accesses.cpp).
    Code &code_of(const Region &region);
    const Region *find_region(uint32_t address, uint32_t size) const;
    void written(const uint8_t *host, uint32_t size);
    bool note_watch(uint32_t address, uint32_t size, uint32_t value, bool write);
    bool stops_at_watch(uint32_t address, uint32_t size, uint32_t value, bool write,
                        uint64_t executed);
    Result load_data(uint32_t address, uint32_t size, uint32_t &value, bool as_privileged,
                     uint64_t executed);
    Result store_data(uint32_t address, uint32_t size, uint32_t value, bool as_privileged,
                      uint64_t executed);
    Result access(uint32_t address, uint32_t size, uint32_t &value, bool write, bool privileged);
    Result load_slowly(uint32_t address, uint32_t size, uint32_t &value, bool as_privileged,
                       uint64_t executed);
    Result store_slowly(uint32_t address, uint32_t size, uint32_t value, bool as_privileged,
                        uint64_t executed);
    Result access_bit(uint32_t address, uint32_t size, uint32_t &value, bool write);
    Result access_pieces(uint32_t address, uint32_t size, uint32_t &value, bool write,
                         bool as_privileged);

    // Code (memory/fetch.cpp).
    bool find_code(uint32_t pc);
    bool fetch_half(uint32_t address, uint32_t &value);
    void fetch_failed();
    bool decode_at(uint32_t pc, Operation *op);
    bool run_aside(uint32_t pc);
    bool may_fetch(uint32_t pc, uint32_t halves);
    bool fetch(uint32_t pc, uint32_t halves, int64_t &now);
    void fetch_again(Code &code);
    void fetch_again(uint32_t line, uint32_t shift);
    void arrive();

    // Execution (execute/loop.cpp, cpu.cpp).
    template <bool Checked> void loop();
    bool condition(uint32_t number) const;
    bool abandon(const Operation *op, Fault kind, uint32_t address);
    bool abandon(const Operation *op, Result result, bool write);
    uint32_t read_special(uint32_t number) const;
    void write_special(uint32_t number, uint32_t mask, uint32_t value);
    void change_masks(uint32_t value);
    bool stepped(uint32_t next);
    void update_limit();

    std::vector<Page> pages;
    std::vector<Code> codes;
    std::vector<uint32_t> breakpoints;
    std::vector<Watch> watches;
    int64_t limit = 0;                 // the loop runs while cycles < limit
    bool stop_requested = false, attention_requested = false;
    uint32_t exits = 0;
    uint32_t fault_address = 0;        // of the last access
    uint32_t stopped_at = NOWHERE, resume_at = NOWHERE;
    // The instruction that a watchpoint stopped, and the number of those before it: when it runs
    // again, it makes its accesses.
    uint32_t watched_at = NOWHERE;
    uint64_t watched_count = 0;
    int64_t steps_left = 0;
    uint32_t step_low = 0, step_high = 0;

    // The code that the loop executes: operations[0] is at code_base.
    Operation *operations = nullptr;
    uint32_t code_base = 0, code_size = 0;
    // The same of the code found last, while one instruction runs aside.
    Operation *home = nullptr;
    uint32_t home_base = 0, home_size = 0;
    Operation aside[3] = {};           // an instruction outside all regions, or at a breakpoint
    FetchLines *lines = nullptr;
    bool guarded = false;              // the MPU checks fetches
    uint32_t fetched = NOWHERE;        // the line, or block, of the last fetch
    Fault fetch_fault = {};            // why find_code found nothing
    bool aside_ready = false;          // aside[0] is to run next
    // A branch left the loop; ArrivingOdd: to the second half-word of a word.
    enum : uint8_t { NotArriving, Arriving, ArrivingOdd } arriving = NotArriving;

    // Pipeline (cycles.h).
    int64_t load_end = -1, bus_free = 0;
    uint32_t loaded = 0;

    // The last instruction that ran under IT, and the state before it.
    const Operation *it_operation = nullptr;
    uint8_t it_before = 0;
};

}  // namespace armv7m
