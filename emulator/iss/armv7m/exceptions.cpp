// The exception model: ARMv7-M Architecture Reference Manual B1.5.4 (priorities), B1.5.6 (entry),
// B1.5.8 (return), B1.5.11 (derived exceptions), B1.5.14 (faults), B1.5.15 (lock-up). Cycles by the
// Cortex-M3 Technical Reference Manual, chapter 5.

#include "system.h"

#include "cpu.h"

namespace armv7m {

namespace {

// Entry: 12 cycles to the handler's first instruction, of which stacking hides the vector fetch up
// to the second half; an exception that arrives in the first half is late, and is taken instead.
constexpr int64_t STACKING_CYCLES = 6, VECTOR_CYCLES = 6;
constexpr int64_t TAIL_CHAIN_CYCLES = 6;
// Return: 10 cycles. Until the frame has been read a new exception chains instead.
constexpr int64_t UNSTACKING_CYCLES = 4, RESUME_CYCLES = 6;

constexpr uint32_t RETURN_TO_HANDLER = 0xFFFFFFF1u, RETURN_TO_MAIN = 0xFFFFFFF9u,
                   RETURN_TO_PROCESS = 0xFFFFFFFDu;

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

System::System(Cpu &cpu, const SystemParameters &parameters, SystemListener &listener)
    : parameters(parameters), nvic(parameters.interrupts, parameters.priority_bits),
      systick(parameters.systick_calibration, parameters.reference_cycles,
              parameters.reference_ticks),
      mpu(parameters.mpu_regions), dwt(parameters.comparators), cpu(cpu), listener(listener),
      semihosting(parameters.semihosting) {}

void System::reset(bool power_on) {
    const bool protected_before = mpu.enabled();
    cpu.reset();
    nvic.reset(), systick.reset(), mpu.reset();
    if (power_on) {
        dwt.reset(), itm.reset();
        if (parameters.trace_probe) itm.enable_all();
        demcr = dcrdr = dfsr = patch_control = patch_remap = 0;
        for (uint32_t &each : patch) each = 0;
        record = {};
    }
    sleeping = Sleep::Awake;
    event = lockup = false;
    actlr = vtor = prigroup = scr = cfsr = hfsr = mmfar = bfar = 0;
    ccr = CCR_STKALIGN;
    if (protected_before) cpu.protection_changed();
    uint32_t stack = 0, start = 0;
    if (!fetch_vector(0, stack) || !fetch_vector(RESET, start)) {
        hfsr |= VECTTBL;
        fault_pc = start;
        lock_up();
        return;
    }
    cpu.set_main_sp(stack);
    cpu.r[14] = 0xFFFFFFFFu;
    cpu.r[15] = start & ~1u;
    cpu.thumb = start & 1;
}

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

void System::boost_changed() { priority_changed(); }

void System::priority_changed() {
    if (mpu.set_negative_priority(cpu.faultmask || nvic.active_priority() < 0))
        cpu.protection_changed();
    if (takeable()) cpu.attention();
}

ExceptionState System::exception(int number) const {
    if (number < 1 || number >= nvic.count()) return {number, 0, false, false, false};
    return {number, nvic.priority(number), nvic.enabled(number), nvic.pending(number),
            nvic.active(number)};
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

// What the running instruction causes: it must be taken now, by HardFault if not by itself. A
// derived fault, of stacking, does not lock up: the handler that was due runs.
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
    if (semihosting && immediate == 0xAB) {
        semihost();
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
    // A lock-up in a handler: its frame is that of the fault before.
    const uint32_t shown = number           ? (frame_stacked ? frame : 0)
                           : cpu.ipsr != 0 ? record.frame
                                           : 0;
    record = {(uint32_t)number, cfsr, hfsr, dfsr, mmfar, bfar, fault_pc, shown,
              exc_return, record.count + 1, cpu.cycles};
}

// --- entry ------------------------------------------------------------------------------------

void System::service() {
    if (systick.advance(cpu.cycles)) pend(SYSTICK);
    if (lockup) {
        if (nvic.first_pending() != NMI || execution_priority() <= -2) return;
        lockup = false;
    }
    if (sleeping != Sleep::Awake) {
        if (!wakes()) return;
        dwt.count_sleep(cpu.cycles - asleep_since);
        if (sleeping == Sleep::Wfe) event = false;
        sleeping = Sleep::Awake;
    }
    if (takeable()) enter();
}

void System::enter() {
    const int64_t begin = cpu.cycles;
    const bool from_fault = nvic.first_pending() <= USAGE_FAULT;
    if (!from_fault) fault_pc = cpu.r[15];
    uint32_t exc_return;
    frame_stacked = push_frame(exc_return);
    cpu.cycles += STACKING_CYCLES;
    listener.catch_up();
    const uint32_t returns_to = cpu.r[15];
    cpu.cycles += VECTOR_CYCLES;
    take(exc_return);
    dwt.count_exception(cpu.cycles - begin);
    if (cpu.tracer && !lockup) cpu.tracer->exception_entry(cpu.ipsr, returns_to, cpu);
}

// PushStack(). An access that fails ends it; its fault competes with the exception being entered.
bool System::push_frame(uint32_t &exc_return) {
    exc_return = cpu.handler_mode()              ? RETURN_TO_HANDLER
                 : cpu.process_stack_in_use() ? RETURN_TO_PROCESS
                                              : RETURN_TO_MAIN;
    const bool privileged = cpu.privileged();
    const uint32_t before = cpu.r[13];
    const bool aligns = (ccr & CCR_STKALIGN) && (before & 4);
    const uint32_t frame = (before - 0x20) & ~(aligns ? 4u : 0u);
    const uint32_t words[8] = {
        cpu.r[0], cpu.r[1], cpu.r[2], cpu.r[3], cpu.r[12], cpu.r[14], cpu.r[15],
        (cpu.xpsr() & ~0x200u) | (aligns ? 0x200u : 0u),
    };
    cpu.r[13] = frame;
    for (uint32_t n = 0; n < 8; n++) {
        const Result result = cpu.store(frame + 4 * n, 4, words[n], privileged);
        if (result == Result::Done) continue;
        const bool violation = result == Result::Violation;
        cfsr |= violation ? MSTKERR : STKERR;
        pend_synchronous(violation ? MEM_MANAGE : BUS_FAULT, true);
        return false;
    }
    return true;
}

bool System::fetch_vector(int number, uint32_t &vector) {
    const uint32_t address = vtor + 4 * (uint32_t)number;
    const Result result = cpu.load(address, 4, vector);
    // The MPU does not guard vectors, B3.5.1.
    return result == Result::Done || (result == Result::Violation && cpu.peek(address, 4, vector));
}

// ExceptionTaken() for the pending exception of the highest priority.
void System::take(uint32_t exc_return) {
    int number = nvic.first_pending();
    uint32_t vector = 0;
    if (!fetch_vector(number, vector)) {
        hfsr |= VECTTBL;
        const bool last = number == HARD_FAULT || number == NMI || execution_priority() < 0;
        number = HARD_FAULT;
        if (last || !fetch_vector(number, vector)) {
            lock_up();
            return;
        }
    }
    nvic.set_pending(number, false);
    nvic.set_active(number, true);
    cpu.set_control(cpu.control & 1);
    cpu.ipsr = (uint16_t)number;
    cpu.it = 0;
    cpu.thumb = vector & 1;
    cpu.r[14] = exc_return;
    cpu.r[15] = vector & ~1u;
    cpu.exclusive = false;
    event = true;
    if (number >= HARD_FAULT && number <= USAGE_FAULT) note_fault(number, exc_return);
    priority_changed();
    // DEMCR.VC_*, C1.6.5: by exception; INTERR and the UsageFault kinds are taken together.
    const uint32_t catching = number == HARD_FAULT    ? 1u << 10
                              : number == MEM_MANAGE  ? 1u << 4
                              : number == BUS_FAULT   ? 1u << 8
                              : number == USAGE_FAULT ? 7u << 5
                                                      : 0;
    if (debugger && (catch_mask & catching)) {
        debug_stop = DebugStop::VectorCatch;
        dfsr |= DFSR_VCATCH;
        cpu.stop();
    }
}

// --- return -----------------------------------------------------------------------------------

void System::deactivate(int number) {
    nvic.set_active(number, false);
    if (number != NMI) cpu.faultmask = 0;
    if (number >= FIRST_INTERRUPT && nvic.repend(number) && (scr & SCR_SEVONPEND)) event = true;
}

// From one handler to the next, the frame left where it is.
void System::chain(uint32_t exc_return) {
    const int64_t begin = cpu.cycles;
    cpu.cycles += TAIL_CHAIN_CYCLES;
    listener.catch_up();
    const uint32_t returns_to = cpu.r[15];
    take(exc_return);
    dwt.count_exception(cpu.cycles - begin);
    if (cpu.tracer && !lockup) cpu.tracer->exception_entry(cpu.ipsr, returns_to, cpu);
}

bool System::pop_frame(uint32_t exc_return, uint32_t (&words)[8]) {
    const uint32_t frame = exc_return & 4 ? cpu.process_sp() : cpu.main_sp();
    const bool privileged = exc_return == RETURN_TO_HANDLER || !(cpu.control & 1);
    for (uint32_t n = 0; n < 8; n++) {
        const Result result = cpu.load(frame + 4 * n, 4, words[n], privileged);
        if (result == Result::Done) continue;
        const bool violation = result == Result::Violation;
        cfsr |= violation ? MUNSTKERR : UNSTKERR;
        pend_synchronous(violation ? MEM_MANAGE : BUS_FAULT);
        return false;
    }
    return true;
}

void System::exception_return(uint32_t exc_return) {
    if (cpu.tracer) cpu.tracer->exception_return(exc_return, cpu);
    const int returning = cpu.ipsr;
    const bool was_active = returning < nvic.count() && nvic.active(returning);
    const bool others = nvic.active_count() > 1;
    const bool to_handler = exc_return == RETURN_TO_HANDLER;
    fault_pc = cpu.r[15];
    bool valid = was_active && (to_handler || exc_return == RETURN_TO_MAIN ||
                                exc_return == RETURN_TO_PROCESS);
    if (valid && !to_handler && others && !(ccr & CCR_NONBASETHRDENA)) valid = false;
    if (was_active) deactivate(returning);
    priority_changed();

    uint32_t frame[8];
    if (valid && !takeable()) {
        const int64_t begin = cpu.cycles;
        if (!pop_frame(exc_return, frame)) {
            if (!lockup) chain(exc_return);
            return;
        }
        cpu.cycles += UNSTACKING_CYCLES;
        listener.catch_up();
        valid = to_handler == ((frame[7] & 0x1FF) != 0);
        if (valid && !takeable()) {
            cpu.cycles += RESUME_CYCLES;
            dwt.count_exception(cpu.cycles - begin);
        }
    }
    if (!valid) {
        cfsr |= INVPC;
        pend_synchronous(USAGE_FAULT);
        if (!lockup) chain(exc_return);
        return;
    }
    if (takeable()) {
        chain(exc_return);
        return;
    }

    cpu.set_control((uint8_t)((cpu.control & 1) | (exc_return & 4 ? 2 : 0)));
    const uint32_t aligns = (ccr & CCR_STKALIGN) && (frame[7] & 0x200) ? 4 : 0;
    for (uint32_t n = 0; n < 4; n++) cpu.r[n] = frame[n];
    cpu.r[12] = frame[4];
    cpu.r[13] = (cpu.r[13] + 0x20) | aligns;
    cpu.r[14] = frame[5];
    cpu.r[15] = frame[6] & ~1u;
    cpu.set_xpsr(frame[7]);
    cpu.exclusive = false;
    event = true;
    priority_changed();
    if (!to_handler && !others && (scr & SCR_SLEEPONEXIT)) fall_asleep(Sleep::OnExit);
}

// --- sleep ------------------------------------------------------------------------------------

bool System::wakes() const {
    switch (sleeping) {
    case Sleep::Awake: return false;
    case Sleep::Wfe:
        if (event) return true;
        return takeable();
    default: {    // WFI: whatever would be taken if PRIMASK were clear, B1.5.19
        const int number = nvic.first_pending();
        return number && nvic.group(nvic.priority(number)) < boosted_priority(false);
    }
    }
}

void System::fall_asleep(Sleep how) {
    sleeping = how;
    asleep_since = cpu.cycles;
    cpu.attention();    // service() wakes it at once if there is a reason to
}

void System::wfi() { fall_asleep(Sleep::Wfi); }

void System::wfe() {
    if (event) {
        event = false;
        return;
    }
    fall_asleep(Sleep::Wfe);
}

void System::sev() {
    event = true;
    if (wakes()) cpu.attention();
}

void System::set_systick_reference(int64_t cycles, int64_t ticks) {
    if (systick.advance(cpu.cycles)) pend(SYSTICK);
    systick.set_reference(cycles, ticks, cpu.cycles);
    cpu.attention();
}

void System::set_debugger(bool attached, uint32_t catches) {
    debugger = attached;
    catch_mask = attached ? catches : 0;
}

}  // namespace armv7m
