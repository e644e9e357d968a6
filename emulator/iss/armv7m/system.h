// Everything of an ARMv7-M processor that is not instruction execution: exceptions, NVIC, system
// control block, SysTick, MPU, DWT, ITM, debug registers, semihosting. Knows no part: what differs
// between parts is in SystemParameters.
//
// Source: ARMv7-M Architecture Reference Manual (DDI 0403E), B1.5 (exception model), B3 (system
// address map), C1 (debug); Cortex-M3 Technical Reference Manual r2p1 (DDI 0337) for what the
// architecture leaves open and for cycles.
//
// How the instruction loop and the system work together:
//  - An exception that becomes takeable calls cpu.attention(), which ends the inner loop after
//    the running instruction. The outer loop then calls service(), which takes at most one
//    exception, and goes on.
//  - An instruction that cannot complete calls fault() and leaves the program counter on itself;
//    SVC calls svc() with the program counter behind itself. Both end in service().
//  - SysTick wraps at next_cycle(): the inner loop must not run beyond it.

#pragma once

#include "dwt.h"
#include "itm.h"
#include "mpu.h"
#include "systick.h"

#include <cstdint>

namespace armv7m {

class Cpu;

struct SystemParameters {
    uint32_t cpuid = 0x412FC231;         // Cortex-M3 r2p1
    int interrupts = 39;                 // external interrupts
    int priority_bits = 3;               // implemented bits of a priority
    int mpu_regions = 8;                 // 0: no MPU
    int comparators = 4;                 // of the DWT
    uint32_t systick_calibration = 0;    // SYST_CALIB as it reads
    int64_t reference_cycles = 0;        // core cycles in one tick of SysTick's reference clock;
                                         // 0: no reference, CLKSOURCE reads 1
    bool semihosting = false;            // BKPT 0xAB is a call, not a fault
};

// What stops an instruction. B1.5.14.
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

enum class Sleep : uint8_t { Awake, Wfi, Wfe, OnExit };

// What the system says to the part around it. The part's implementation must not call back into
// the instruction loop; it may ask the core to stop.
class SystemListener {
public:
    virtual ~SystemListener() = default;
    virtual void reset_requested() {}                              // AIRCR.SYSRESETREQ, VECTRESET
    virtual void locked_up() {}                                    // until a reset (or an NMI)
    virtual void itm(int port, uint32_t value, int bytes) { (void)port, (void)value, (void)bytes; }
    virtual void semihosting_write(int handle, const uint8_t *text, int length) {
        (void)handle, (void)text, (void)length;
    }
    virtual int semihosting_read() { return -1; }                  // a character of the console
    virtual void semihosting_exit(uint32_t code) { (void)code; }   // the program has ended
    virtual void unmodelled(const char *what) { (void)what; }      // to be logged once
};

// One exception number's line in a fault report or a debugger.
struct ExceptionState {
    int number, priority;
    bool enabled, pending, active;
};

// What a fault report needs, beside the registers. `frame` is where the last fault's stack frame
// begins, 0 if there was none or stacking failed.
struct FaultRecord {
    uint32_t exception, cfsr, hfsr, dfsr, mmfar, bfar, frame, exc_return;
    int64_t cycle;
    uint32_t count;
};

class System {
public:
    static constexpr int MAX_EXCEPTIONS = 16 + 240;

    System(Cpu &cpu, const SystemParameters &parameters, SystemListener &listener);

    // Power-on (also debug and reset status) or system reset: registers only. The core then
    // loads SP and PC from the vector table.
    void reset(bool power_on);

    // --- for the instruction loop -------------------------------------------------------------

    // Brings SysTick up to now, takes the pending exception of the highest priority if it may
    // be taken, wakes a sleeping processor. To be called whenever the inner loop ends.
    void service();

    // The cycle at which the system itself changes something next; INT64_MAX if never.
    int64_t next_cycle() const { return systick.next_wrap(); }

    // An instruction failed. True: it is abandoned, the program counter must be left on it.
    // False: it goes on (a store through the write buffer; its fault comes later).
    bool fault(Fault kind, uint32_t address = 0);

    void svc();                                    // the program counter is behind the SVC
    bool bkpt(uint32_t immediate);                 // true: done (semihosting), go on behind it
    static bool is_exc_return(uint32_t value) { return value >= 0xF0000000u; }
    void exception_return(uint32_t exc_return);    // written to PC in Handler mode
    void wfi();
    void wfe();
    void sev() { event = true; }
    void boost_changed();                          // PRIMASK, FAULTMASK or BASEPRI written

    bool divide_trap() const { return (ccr & CCR_DIV_0_TRP) != 0; }
    bool unaligned_trap() const { return (ccr & CCR_UNALIGN_TRP) != 0; }

    // Private peripheral bus, 0xE0000000 to 0xE00FFFFF; size 1, 2 or 4. False: no such register
    // for this access, which is a bus fault. The caller has checked nothing.
    bool read(uint32_t address, int size, uint32_t &value);
    bool write(uint32_t address, int size, uint32_t value);
    uint32_t peek(uint32_t address) const;         // the debugger's read: no side effect

    // --- for the part -------------------------------------------------------------------------

    void set_interrupt_line(int interrupt, bool level);   // level-sensitive: re-pends while high
    void pend_interrupt(int interrupt);                   // a pulse
    void pend_nmi();
    Sleep sleep() const { return sleeping; }
    bool deep_sleep() const { return (scr & SCR_SLEEPDEEP) != 0; }
    bool locked_up() const { return lockup; }

    // --- for debuggers and reports ------------------------------------------------------------

    int execution_priority() const;                       // lower is more urgent; 256: Thread
    ExceptionState exception(int number) const;
    const FaultRecord &last_fault() const { return record; }
    uint32_t vector_table() const { return vtor; }

    const SystemParameters parameters;
    SysTick systick;
    Mpu mpu;
    Dwt dwt;
    Itm itm;

private:
    static constexpr uint32_t CCR_DIV_0_TRP = 1u << 4;
    static constexpr uint32_t CCR_UNALIGN_TRP = 1u << 3;
    static constexpr uint32_t SCR_SLEEPDEEP = 1u << 2;

    Cpu &cpu;
    SystemListener &listener;
    Sleep sleeping = Sleep::Awake;
    bool event = false, lockup = false;
    uint32_t ccr = 0, scr = 0, vtor = 0;
    FaultRecord record{};
};

}  // namespace armv7m
