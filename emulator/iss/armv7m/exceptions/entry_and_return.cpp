// Entry into exceptions and return from them: ARMv7-M Architecture Reference Manual B1.5.6 and
// B1.5.8. Cycles by the Cortex-M3 Technical Reference Manual, chapter 5.

#include "armv7m/system/system.h"

#include "armv7m/core/cpu.h"

namespace armv7m {

namespace {

// Entry: 12 cycles to the handler's first instruction; the vector is fetched in the second half. An
// exception of higher priority that arrives in the first half is taken instead (late arrival).
constexpr int64_t STACKING_CYCLES = 6, VECTOR_CYCLES = 6;
constexpr int64_t TAIL_CHAIN_CYCLES = 6;
// Return: 10 cycles. An exception that arrives while the frame is read is tail-chained.
constexpr int64_t UNSTACKING_CYCLES = 4, RESUME_CYCLES = 6;

constexpr uint32_t RETURN_TO_HANDLER = 0xFFFFFFF1u, RETURN_TO_MAIN = 0xFFFFFFF9u,
                   RETURN_TO_PROCESS = 0xFFFFFFFDu;

}  // namespace

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
    take(exc_return, begin, returns_to);
}

// PushStack(). Ends at an access that fails; its fault competes with the exception being entered.
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
    Result result = Result::Done;
    for (uint32_t n = 0; n < 8 && result == Result::Done; n++)
        result = cpu.store(frame + 4 * n, 4, words[n], privileged);
    return !stack_failed(result, MSTKERR, STKERR, true);
}

// Whether an access to the stack failed; then sets the status bit and pends the fault.
bool System::stack_failed(Result result, uint32_t violation, uint32_t bus_error, bool derived) {
    if (result == Result::Done) return false;
    const bool is_violation = result == Result::Violation;
    cfsr |= is_violation ? violation : bus_error;
    pend_synchronous(is_violation ? MEM_MANAGE : BUS_FAULT, derived);
    return true;
}

bool System::fetch_vector(int number, uint32_t &vector) {
    const uint32_t address = vtor + 4 * (uint32_t)number;
    const Result result = cpu.load(address, 4, vector);
    // The MPU does not protect vectors, B3.5.1.
    return result == Result::Done || (result == Result::Violation && cpu.peek(address, 4, vector));
}

// Takes the pending exception of the highest priority; its entry began at cycle `begin`.
void System::take(uint32_t exc_return, int64_t begin, uint32_t returns_to) {
    exception_taken(exc_return);
    dwt.count_exception(cpu.cycles - begin);
    if (cpu.tracer && !lockup) cpu.tracer->exception_entry(cpu.ipsr, returns_to, cpu);
}

void System::exception_taken(uint32_t exc_return) {
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
    // DEMCR.VC_*, C1.6.5, by exception; INTERR and the kinds of UsageFault are not distinguished.
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

// Tail-chaining: the next handler runs on the same frame.
void System::chain(uint32_t exc_return) {
    const int64_t begin = cpu.cycles;
    cpu.cycles += TAIL_CHAIN_CYCLES;
    listener.catch_up();
    take(exc_return, begin, cpu.r[15]);
}

bool System::pop_frame(uint32_t exc_return, uint32_t (&words)[8]) {
    const uint32_t frame = exc_return & 4 ? cpu.process_sp() : cpu.main_sp();
    const bool privileged = exc_return == RETURN_TO_HANDLER || !(cpu.control & 1);
    Result result = Result::Done;
    for (uint32_t n = 0; n < 8 && result == Result::Done; n++)
        result = cpu.load(frame + 4 * n, 4, words[n], privileged);
    return !stack_failed(result, MUNSTKERR, UNSTKERR, false);
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

}  // namespace armv7m
