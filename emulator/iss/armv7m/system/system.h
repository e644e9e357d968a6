// The parts of an ARMv7-M processor beside instruction execution: exceptions, NVIC, system control
// block, SysTick, MPU, DWT, ITM, debug registers, semihosting. Differences between parts are in
// SystemParameters.
//
// Source: ARMv7-M Architecture Reference Manual (DDI 0403E), B1.5 (exception model), B3 (system
// address map), C1 (debug); Cortex-M3 Technical Reference Manual r2p1 (DDI 0337) for implementation
// choices and cycles.
//
// How the instruction loop and the system work together:
//  - An exception that can be taken calls cpu.attention(), which ends the inner loop after the
//    running instruction. The outer loop then calls service(), which takes at most one exception.
//  - An instruction that cannot complete calls fault() and leaves the program counter on itself;
//    SVC calls svc() with the program counter after itself. Both end in service().
//  - SysTick wraps at next_cycle(): the inner loop must not run beyond it.

#pragma once

#include "armv7m/debug/dwt.h"
#include "armv7m/debug/itm.h"
#include "armv7m/exceptions/nvic.h"
#include "armv7m/memory/mpu.h"
#include "armv7m/system/systick.h"

#include <cstdint>

namespace armv7m {

class Cpu;
enum class Result : uint8_t;    // cpu.h

struct SystemParameters {
    uint32_t cpuid = 0x412FC231;         // Cortex-M3 r2p1
    int interrupts = 39;                 // external interrupts
    int priority_bits = 3;               // implemented bits of a priority
    int mpu_regions = 8;                 // 0: no MPU
    int comparators = 4;                 // of the DWT
    uint32_t systick_calibration = 0xC0000000u;    // SYST_CALIB as it reads: NOREF, SKEW
    // Core cycles and ticks of SysTick's reference clock in the same time. 0: no reference clock,
    // CLKSOURCE reads 1.
    int64_t reference_cycles = 0, reference_ticks = 1;
    bool semihosting = false;            // BKPT 0xAB is a call, not a fault; see set_semihosting
    bool trace_probe = true;             // the ITM is on after reset, as a trace probe leaves it
};

// Causes that stop an instruction. B1.5.14.
enum class Fault : uint8_t {
    Undefined,        // UsageFault UNDEFINSTR
    InvalidState,     // UsageFault INVSTATE: T bit clear, or ICI/IT bits where none may be
    InvalidReturn,    // UsageFault INVPC
    NoCoprocessor,    // UsageFault NOCP
    Unaligned,        // UsageFault UNALIGNED: the trap is on, or the instruction never allows it
    DivideByZero,     // UsageFault DIVBYZERO: ask divide_trap() first
    FetchViolation,   // MemManage IACCVIOL: MPU, or execute-never memory
    DataViolation,    // MemManage DACCVIOL
    FetchBus,         // BusFault IBUSERR
    LoadBus,          // BusFault PRECISERR
    StoreBus,         // BusFault IMPRECISERR through the write buffer, else PRECISERR
    Breakpoint,       // BKPT without a debugger: HardFault DEBUGEVT
};

// Bits of the fault status registers: B3.2.15 to B3.2.17.
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

enum class Sleep : uint8_t { Awake, Wfi, Wfe, OnExit };

// Callbacks to the part around the system. They must not call the instruction loop; they may stop
// it.
class SystemListener {
public:
    virtual ~SystemListener() = default;
    virtual void reset_requested() {}                              // AIRCR.SYSRESETREQ, VECTRESET
    virtual void locked_up() {}                                    // until a reset (or an NMI)
    // In the middle of an exception's entry or return: perform all events up to cpu.cycles, so that
    // a late interrupt is seen.
    virtual void catch_up() {}
    virtual void itm(int port, uint32_t value, int bytes) { (void)port, (void)value, (void)bytes; }
    // A call of the host by BKPT 0xAB. True: it will be answered, in r0, before the next
    // instruction runs. False: the BKPT is an ordinary one.
    virtual bool semihosting(uint32_t operation, uint32_t parameter) {
        return (void)operation, (void)parameter, false;
    }
    virtual void unmodelled(const char *what) { (void)what; }
};

// The last fault (or lock-up, then `exception` is 0), for a report. `pc`: the faulting instruction;
// `frame`: start of the stack frame (r0-r3, r12, lr, pc, xPSR), 0 if stacking failed.
struct FaultRecord {
    uint32_t exception, cfsr, hfsr, dfsr, mmfar, bfar, pc, frame, exc_return;
    uint32_t count;    // of faults since power-on
    int64_t cycle;
};

class System {
public:
    System(Cpu &cpu, const SystemParameters &parameters, SystemListener &listener);

    // Resets core and system; SP and PC are read from the vector table at 0. A power-on reset also
    // clears the debug registers.
    void reset(bool power_on);

    // --- for the instruction loop -------------------------------------------------------------

    // Updates SysTick, wakes a sleeping processor, and takes the pending exception of the highest
    // priority if possible. Called whenever the inner loop ends.
    void service();

    // The cycle of the system's next own event; INT64_MAX if none.
    int64_t next_cycle() const { return systick.next_wrap(); }

    // An instruction failed. True: it is abandoned, the program counter stays on it. False: it
    // completes (a store through the write buffer; its fault comes later).
    bool fault(Fault kind, uint32_t address = 0);

    void svc();                                    // the program counter is after the SVC
    bool bkpt(uint32_t immediate);                 // true: done (semihosting), continue after it
    void exception_return(uint32_t exc_return);    // written to PC in Handler mode
    void wfi();
    void wfe();
    void sev();
    void priority_changed();                       // PRIMASK, FAULTMASK or BASEPRI written

    bool divide_trap() const { return (ccr & CCR_DIV_0_TRP) != 0; }
    bool unaligned_trap() const { return (ccr & CCR_UNALIGN_TRP) != 0; }

    // Private peripheral bus, 0xE0000000 to 0xE00FFFFF; size 1, 2 or 4. False: bus fault.
    bool read(uint32_t address, int size, uint32_t &value);
    bool write(uint32_t address, int size, uint32_t value);
    uint32_t peek(uint32_t address);               // a debugger's read of a word: no side effects

    // --- for the part -------------------------------------------------------------------------

    void set_interrupt_line(int interrupt, bool level);   // level-sensitive: re-pends while high
    void pend_interrupt(int interrupt);                   // a pulse
    void pend_nmi();
    Sleep sleep() const { return sleeping; }
    bool deep_sleep() const { return (scr & SCR_SLEEPDEEP) != 0; }
    bool wakes() const;                            // asleep, but service() will wake it
    bool locked_up() const { return lockup; }

    // --- for debuggers and reports ------------------------------------------------------------

    // With a debugger or a semihosting host DHCSR.C_DEBUGEN reads 1. With a debugger BKPT and the exceptions selected in
    // `catches` (as DEMCR.VC_*) stop the core; stopped_by() has the reason.
    void set_debugger(bool attached, uint32_t catches = 0);
    enum class DebugStop : uint8_t { None, Breakpoint, VectorCatch };
    DebugStop stopped_by() const { return debug_stop; }
    void set_semihosting(bool on) { semihosting = on; }
    void clear_debug_stop() { debug_stop = DebugStop::None; }

    int execution_priority() const;                // lower is more urgent; 256: Thread
    const FaultRecord &last_fault() const { return record; }

    const SystemParameters parameters;
    Nvic nvic;
    SysTick systick;
    Mpu mpu;
    Dwt dwt;
    Itm itm;

private:
    enum : uint32_t {
        CCR_NONBASETHRDENA = 1, CCR_USERSETMPEND = 2, CCR_UNALIGN_TRP = 8, CCR_DIV_0_TRP = 16,
        CCR_BFHFNMIGN = 256, CCR_STKALIGN = 512,
        SCR_SLEEPONEXIT = 2, SCR_SLEEPDEEP = 4, SCR_SEVONPEND = 16,
        ACTLR_DISDEFWBUF = 2,
        DEMCR_MON_EN = 1u << 16, DEMCR_TRCENA = 1u << 24,
    };

    // exceptions/pending.cpp
    void pend(int number);                         // asynchronous
    void pend_synchronous(int number, bool derived = false);
    bool escalates(int number) const;
    bool takeable() const;
    int boosted_priority(bool with_primask) const;
    void lock_up();
    void note_fault(int number, uint32_t exc_return);

    // exceptions/entry_and_return.cpp
    void enter();
    bool push_frame(uint32_t &exc_return);
    bool stack_failed(Result result, uint32_t violation, uint32_t bus_error, bool derived);
    void take(uint32_t exc_return, int64_t begin, uint32_t returns_to);
    void exception_taken(uint32_t exc_return);
    void chain(uint32_t exc_return);
    void deactivate(int number);
    bool pop_frame(uint32_t exc_return, uint32_t (&words)[8]);
    bool fetch_vector(int number, uint32_t &vector);

    // system.cpp
    void fall_asleep(Sleep how);

    // control_space.cpp
    bool read_word(uint32_t address, bool look, uint32_t &value);
    bool write_word(uint32_t address, uint32_t value, uint32_t lanes);
    uint32_t read_scb(uint32_t offset) const;
    void write_scb(uint32_t offset, uint32_t value, uint32_t lanes);
    uint32_t icsr() const;
    void write_icsr(uint32_t value);
    uint32_t shcsr() const;
    void write_shcsr(uint32_t value);
    void write_demcr(uint32_t value);
    bool user_may(uint32_t address, bool write) const;

    Cpu &cpu;
    SystemListener &listener;
    Sleep sleeping = Sleep::Awake;
    int64_t asleep_since = 0;
    bool event = false, lockup = false, debugger = false, frame_stacked = false;
    bool semihosting;
    DebugStop debug_stop = DebugStop::None;
    uint32_t catch_mask = 0;
    uint32_t actlr = 0, vtor = 0, prigroup = 0, scr = 0, ccr = CCR_STKALIGN;
    uint32_t cfsr = 0, hfsr = 0, dfsr = 0, mmfar = 0, bfar = 0, demcr = 0, dcrdr = 0;
    uint32_t patch_control = 0, patch_remap = 0, patch[8] = {};    // FPB, plain registers
    uint32_t fault_pc = 0;
    FaultRecord record{};
};

}  // namespace armv7m
