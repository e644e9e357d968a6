// Pending exceptions and priorities: ARMv7-M Architecture Reference Manual B1.5.4 (priorities),
// B1.5.11 (derived exceptions), B1.5.14 (faults), B1.5.15 (lock-up).

#include "armv7m/system/system.h"

#include "armv7m/core/cpu.h"

namespace armv7m {

namespace {

struct Cause { uint32_t bit; int exception; };

// In the order of Fault.
constexpr Cause CAUSES[] = {
    {UNDEFINSTR, USAGE_FAULT}, {INVSTATE, USAGE_FAULT}, {INVPC, USAGE_FAULT}, {NOCP, USAGE_FAULT},
    {UNALIGNED, USAGE_FAULT}, {DIVBYZERO, USAGE_FAULT},
    {IACCVIOL, MEM_MANAGE}, {DACCVIOL, MEM_MANAGE},
    {IBUSERR, BUS_FAULT}, {PRECISERR, BUS_FAULT}, {PRECISERR, BUS_FAULT},
    {DEBUGEVT, HARD_FAULT},
};

}  // namespace

// --- priorities -------------------------------------------------------------------------------

int System::boosted_priority(bool with_primask) const {
    int priority = nvic.active_priority();
    if (cpu.basepri) {
        const int base = nvic.group(cpu.basepri);
        if (base < priority) priority = base;
    }
    if (with_primask && cpu.primask && priority > 0) priority = 0;
    if (cpu.faultmask && priority > -1) priority = -1;
    return priority;
}

int System::execution_priority() const { return boosted_priority(true); }

bool System::takeable() const {
    const int number = nvic.first_pending();
    return number && nvic.group(nvic.priority(number)) < boosted_priority(true);
}

bool System::escalates(int number) const {
    return !nvic.enabled(number) || nvic.group(nvic.priority(number)) >= execution_priority();
}

void System::priority_changed() {
    if (mpu.set_negative_priority(cpu.faultmask || nvic.active_priority() < 0))
        cpu.regions_changed();
    if (takeable()) cpu.attention();
}

// --- pending ----------------------------------------------------------------------------------

void System::pend(int number) {
    if ((scr & SCR_SEVONPEND) && !nvic.pending(number)) event = true;
    nvic.set_pending(number, true);
    if (takeable() || wakes()) cpu.attention();
}

void System::set_interrupt_line(int interrupt, bool level) {
    if (interrupt < 0 || interrupt >= parameters.interrupts) return;
    const int number = FIRST_INTERRUPT + interrupt;
    if (level && !nvic.line(number) && !nvic.pending(number)) {
        nvic.set_line(number, true);
        nvic.set_pending(number, false);
        pend(number);
    } else {
        nvic.set_line(number, level);
    }
}

void System::pend_interrupt(int interrupt) {
    if (interrupt >= 0 && interrupt < parameters.interrupts) pend(FIRST_INTERRUPT + interrupt);
}

void System::pend_nmi() { pend(NMI); }

// An exception caused by the running instruction must be taken now, else it escalates to HardFault.
// A derived fault (of stacking) does not lock up: the handler that was due runs.
void System::pend_synchronous(int number, bool derived) {
    if (!escalates(number)) {
        pend(number);
    } else if (execution_priority() > -1 || derived) {
        if (number != HARD_FAULT) hfsr |= FORCED;
        pend(HARD_FAULT);
    } else {
        lock_up();
    }
}

bool System::fault(Fault kind, uint32_t address) {
    const Cause cause = CAUSES[(int)kind];
    fault_pc = cpu.r[15];
    switch (kind) {
    case Fault::StoreBus:
        if (!(actlr & ACTLR_DISDEFWBUF)) {    // from the write buffer, later
            cfsr |= IMPRECISERR;
            if (nvic.enabled(BUS_FAULT)) {
                pend(BUS_FAULT);
            } else {
                hfsr |= FORCED;
                pend(HARD_FAULT);
            }
            return false;
        }
        [[fallthrough]];
    case Fault::LoadBus:
        bfar = address;
        cfsr |= PRECISERR | BFARVALID;
        // The handler of a fault probes memory: the access is ignored (B3.2.8).
        if ((ccr & CCR_BFHFNMIGN) && execution_priority() < 0) return false;
        break;
    case Fault::DataViolation:
        mmfar = address;
        cfsr |= DACCVIOL | MMARVALID;
        break;
    case Fault::Breakpoint:
        hfsr |= DEBUGEVT;
        dfsr |= DFSR_BKPT;
        break;
    default:
        cfsr |= cause.bit;
    }
    pend_synchronous(cause.exception);
    return true;
}

void System::svc() { pend_synchronous(SVCALL); }

bool System::bkpt(uint32_t immediate) {
    if (semihosting && immediate == 0xAB && listener.semihosting(cpu.r[0], cpu.r[1])) {
        cpu.stop();
        return true;
    }
    if (debugger) {
        debug_stop = DebugStop::Breakpoint;
        cpu.stop();
    } else if (!escalates(DEBUG_MONITOR)) {
        dfsr |= DFSR_BKPT;
        pend(DEBUG_MONITOR);
    } else {
        fault(Fault::Breakpoint);
    }
    return false;
}

void System::lock_up() {
    lockup = true;
    note_fault(0, 0);
    cpu.attention();
    cpu.stop();
    listener.locked_up();
}

void System::note_fault(int number, uint32_t exc_return) {
    const uint32_t frame = exc_return & 4 ? cpu.process_sp() : cpu.main_sp();
    // A lock-up in a handler reports the frame of the preceding fault.
    const uint32_t shown = number           ? (frame_stacked ? frame : 0)
                           : cpu.ipsr != 0 ? record.frame
                                           : 0;
    record = {(uint32_t)number, cfsr, hfsr, dfsr, mmfar, bfar, fault_pc, shown,
              exc_return, record.count + 1, cpu.cycles};
}

}  // namespace armv7m
