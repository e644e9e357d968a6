// The loop that runs instructions: one label per operation, reached by computed goto.
//
// The state that every instruction needs is in local variables: `op`, and `now` for Cpu::cycles. It
// is written back (SYNC) before anything else is called. The handlers exist twice, for 16-bit and
// for 32-bit instructions, so that the address of the next operation is a sum with a constant.
//
// What few instructions need costs the others nothing:
//  - instructions in an IT block go through a second table of labels, which check the condition;
//  - an instruction whose fetch may cost something has the entry FETCH (Operation::entry);
//  - the checked loop calls a tracer, counts steps and checks the MPU between two instructions.

#include "armv7m/core/cpu.h"
#include "armv7m/decode/decode.h"
#include "armv7m/execute/cycles.h"
#include "armv7m/execute/fetch.h"
#include "armv7m/system/system.h"

#include <cstring>

namespace armv7m {

#define LIKELY(x) __builtin_expect(!!(x), 1)
#define UNLIKELY(x) __builtin_expect(!!(x), 0)

// Shift_C (A2.2.1): type 0 LSL, 1 LSR, 2 ASR, 3 ROR by 0 to 32; ROR by 0 is RRX.
static inline uint32_t shifted(uint32_t value, uint32_t type, uint32_t amount, uint8_t &carry) {
    switch (type) {
    case 0:
        if (amount == 0) return value;
        carry = (uint8_t)((uint64_t)value << amount >> 32 & 1);
        return (uint32_t)((uint64_t)value << amount);
    case 1:
        carry = (uint8_t)(value >> (amount - 1) & 1);
        return (uint32_t)((uint64_t)value >> amount);
    case 2:
        carry = (uint8_t)((int64_t)(int32_t)value >> (amount - 1) & 1);
        return (uint32_t)((int64_t)(int32_t)value >> amount);
    default: {
        const uint32_t old = carry;
        if (amount == 0) {
            carry = value & 1;
            return old << 31 | value >> 1;
        }
        amount &= 31;
        const uint32_t result = amount ? value >> amount | value << (32 - amount) : value;
        carry = (uint8_t)(result >> 31);
        return result;
    }
    }
}

// Shifts by a register: any amount from 0 to 255 (A7.7.68 and others).
static inline uint32_t shifted_by_register(uint32_t value, uint32_t type, uint32_t amount,
                                           uint8_t &carry) {
    amount &= 0xFF;
    if (amount == 0) return value;
    if (type == 3) return shifted(value, 3, amount & 31 ? amount & 31 : 32, carry);
    if (amount > 32) {
        const uint32_t sign = type == 2 ? (uint32_t)((int32_t)value >> 31) : 0;
        carry = sign & 1;
        return sign;
    }
    return shifted(value, type, amount, carry);
}

// A constant operand; if its carry is defined, that is bit 31.
static inline uint32_t constant_with_carry(const Operation &op, uint8_t &carry) {
    if (op.shift) carry = (uint8_t)(op.value >> 31);
    return op.value;
}

static inline uint32_t rotated(uint32_t value, uint32_t amount) {
    return amount ? value >> amount | value << (32 - amount) : value;
}

// Bit NZCV of word `number`: whether the condition holds (A7.3.1).
static constexpr struct Conditions {
    uint16_t holds[16] = {};
    constexpr Conditions() {
        for (unsigned flags = 0; flags < 16; flags++) {
            const bool n = flags & 8, z = flags & 4, c = flags & 2, v = flags & 1;
            const bool even[8] = {z, c, n, v, c && !z, n == v, n == v && !z, true};
            for (unsigned number = 0; number < 16; number++)
                if (number >= 14 || even[number >> 1] != (bool)(number & 1))
                    holds[number] = (uint16_t)(holds[number] | 1u << flags);
        }
    }
} CONDITIONS;

inline bool Cpu::condition(uint32_t number) const {
    const uint32_t flags = (uint32_t)n() << 3 | (uint32_t)z() << 2 | (uint32_t)carry << 1 | overflow;
    return CONDITIONS.holds[number] >> flags & 1;
}

// Reports the failure of `op` to System, with the IT state before it. False: `op` completes.
bool Cpu::abandon(const Operation *op, Fault kind, uint32_t address) {
    const uint8_t after = it;
    if (op == it_operation) it = it_before;
    attention_requested = true;
    limit = INT64_MIN;
    if (system->fault(kind, address)) return true;
    it = after;
    return false;
}

bool Cpu::abandon(const Operation *op, Result result, bool write) {
    switch (result) {
    case Result::Unaligned: return abandon(op, Fault::Unaligned, fault_address);
    case Result::Violation: return abandon(op, Fault::DataViolation, fault_address);
    default: return abandon(op, write ? Fault::StoreBus : Fault::LoadBus, fault_address);
    }
}

// Loads and stores beside the fast path: most are a peripheral's or external memory's.
__attribute__((noinline)) Result Cpu::load_data(uint32_t address, uint32_t size, uint32_t &value,
                                                bool as_privileged, uint64_t executed) {
    if (UNLIKELY(!pages[address >> 20].outside || address & (size - 1)))
        return load_slowly(address, size, value, as_privileged, executed);
    fault_address = address;
    return bus.read(address, size, value) ? Result::Done : Result::BusError;
}

__attribute__((noinline)) Result Cpu::store_data(uint32_t address, uint32_t size, uint32_t value,
                                                 bool as_privileged, uint64_t executed) {
    if (UNLIKELY(!pages[address >> 20].outside || address & (size - 1)))
        return store_slowly(address, size, value, as_privileged, executed);
    fault_address = address;
    return bus.write(address, size, value) ? Result::Done : Result::BusError;
}

// Counts a step that ended at `next`.
bool Cpu::stepped(uint32_t next) {
    if (steps_left == 0 || (next >= step_low && next < step_high) || --steps_left > 0) return false;
    exits |= ExitStep;
    limit = INT64_MIN;
    return true;
}

template <bool Checked> void Cpu::loop() {
#define ARMV7M_NARROW(name) &&narrow_##name,
#define ARMV7M_WIDE(name) &&wide_##name,
#define ARMV7M_NARROW_IN_IT(name) \
    C_##name <= LAST_MARKER ? &&narrow_##name : &&narrow_in_it,
#define ARMV7M_WIDE_IN_IT(name) &&wide_in_it,
    static const void *const handlers[] = {ARMV7M_CODES(ARMV7M_NARROW) ARMV7M_CODES(ARMV7M_WIDE)};
    static const void *const it_handlers[] = {ARMV7M_CODES(ARMV7M_NARROW_IN_IT)
                                              ARMV7M_CODES(ARMV7M_WIDE_IN_IT)};

    Operation *const ops = operations;
    Operation *op = ops + ((r[15] - code_base) >> 1);
    const uint32_t base = code_base, length = code_size;
    const Page *const map = pages.data();
    const void *const *table = it ? it_handlers : handlers;
    int64_t now = cycles;
    uint64_t count = 0;
    uint32_t target = 0;
    // The last branch and where it led, or the first operation and null: with them, `fetched`.
    const Operation *branch = nullptr, *arrival = op;
    // For the tracer's report at the end of the instruction.
    bool running = false;
    uint32_t traced_pc = 0;
    int64_t traced_since = 0;
    it_operation = nullptr;

#define PC_OF(operation) (base + (uint32_t)(((const char *)(operation) - (const char *)ops) >> 3))
#define PC PC_OF(op)
#define DISPATCH() \
    do { \
        if (Checked) goto between; \
        if (UNLIKELY(now >= limit)) goto leave; \
        goto *table[op->entry]; \
    } while (0)
#define NEXT(cost) \
    do { \
        now += (cost); \
        op += HALVES; \
        count++; \
        DISPATCH(); \
    } while (0)
// Continues at another address; `refill` as in cycles.h.
#define GO(address, refill) \
    do { \
        target = (address); \
        now += 1 + (refill); \
        count++; \
        branch = op; \
        if (UNLIKELY(target - base >= length)) { \
            arriving = (refill) < 3 && (target & 2) ? ArrivingOdd : Arriving; \
            goto far; \
        } \
        op = ops + ((target - base) >> 1); \
        ARRIVE(refill); \
    } while (0)
// Likewise, at a distance known to the decoder.
#define GO_DIRECT() \
    do { \
        now += 1 + REFILL_DIRECT; \
        count++; \
        branch = op; \
        const int64_t to = ((const char *)op - (const char *)ops) + 8 * (int64_t)(int32_t)op->value; \
        if (UNLIKELY((uint64_t)to >= 8 * (uint64_t)length)) { \
            target = PC + op->value; \
            arriving = target & 2 ? ArrivingOdd : Arriving; \
            goto far; \
        } \
        op = (Operation *)((char *)ops + to); \
        ARRIVE(REFILL_DIRECT); \
    } while (0)
#define ARRIVE(refill) \
    do { \
        arrival = op; \
        if (UNLIKELY(op->code == C_UNDECODED)) { \
            target = PC; \
            if (!decode_at(target, op)) goto far; \
        } \
        if ((refill) < 3) now += op->across; \
        now -= op->stall;    /* the refill hides it */ \
        DISPATCH(); \
    } while (0)
// Makes the state visible to callees.
#define SYNC() (r[15] = PC, cycles = now)
// Sets `fetched` to the last line of the operation that has begun, or that ended before `op`.
#define FETCHED(operation) \
    do { \
        if (!Checked && lines != nullptr) \
            fetched = (PC_OF(operation) + 2u * (operation)->halves - 2) >> lines->shift; \
    } while (0)
#define FETCHED_BEFORE() \
    do { \
        if (!Checked && lines != nullptr) { \
            if (op != arrival) fetched = (PC - 2) >> lines->shift; \
            else if (branch != nullptr) FETCHED(branch); \
        } \
    } while (0)
// An instruction ended: calls the tracer and counts a step.
#define REPORT(next) \
    do { \
        if (Checked && running) { \
            running = false; \
            if (tracer != nullptr) \
                tracer->instruction(traced_pc, (next), traced_since, now, *this); \
            stepped(next); \
        } \
    } while (0)
#define FAIL(kind) \
    do { \
        SYNC(); \
        abandon(op, kind, 0); \
        goto failed; \
    } while (0)

    // The first operation may not be decoded yet: the label UNDECODED decodes it.
    DISPATCH();

between:
    SYNC();
    REPORT(r[15]);
    if (UNLIKELY(now >= limit)) goto leave;
    if (op->code <= LAST_MARKER) goto *handlers[op->code];
    if (guarded && !may_fetch(r[15], op->halves)) {
        fetch_failed();
        goto failed;
    }
    if (lines != nullptr) {
        fetch(r[15], op->halves, now);
    }
    running = true, traced_pc = r[15], traced_since = now;
    goto *table[op->handler()];

narrow_FETCH: {
    bool stays = true;
    if (lines != nullptr) {
        FETCHED_BEFORE();
        stays = fetch(PC, op->halves, now);
    }
    if (stays) {
        op->entry = op->handler();
        // So is that of what follows in the same word.
        Operation *const next = op + op->halves;
        if (PC_OF(next) & 2 && next->entry == C_FETCH && next->halves == 1)
            next->entry = next->handler();
    }
    goto *table[op->handler()];
}
narrow_UNDECODED: {
    const uint32_t pc = PC;
    if (LIKELY(decode_at(pc, op))) DISPATCH();
    goto aside_here;
}
narrow_BREAK: {
    const uint32_t pc = PC;
    if (!breakpoint_at(pc) || resume_at == pc) {    // of an alias, or passed already
        resume_at = NOWHERE;
        goto aside_here;
    }
    exits |= ExitBreakpoint;
    goto leave;
}
narrow_REGION_END:
    FETCHED_BEFORE();
    target = PC;
    goto outside;
wide_UNDECODED: wide_BREAK: wide_REGION_END: wide_FETCH: __builtin_unreachable();

#define HANDLE(name) narrow_##name:
#define HALVES 1
#include "armv7m/execute/it.h"
#include "armv7m/execute/data.h"
#include "armv7m/execute/memory.h"
#include "armv7m/execute/control.h"
#undef HANDLE
#undef HALVES
#define HANDLE(name) wide_##name:
#define HALVES 2
#include "armv7m/execute/it.h"
#include "armv7m/execute/data.h"
#include "armv7m/execute/memory.h"
#include "armv7m/execute/control.h"

// `target` was loaded into the PC; everything but 1 + REFILL_LOADED is in `now`.
jump_loaded:
    if (UNLIKELY(target >= 0xF0000000u && handler_mode())) {
        now += 1;
        goto leave_exception;
    }
    thumb = target & 1;
    if (UNLIKELY(!thumb)) limit = INT64_MIN;
    GO(target & ~1u, REFILL_LOADED);

leave_exception:
    SYNC();
    count++;
    REPORT(target);
    FETCHED(op);
    system->exception_return(target);
    goto done;

aside_here:    // one instruction that cannot run in place
    SYNC();
    FETCHED_BEFORE();
    instructions += count;
    if (run_aside(r[15]))
        aside_ready = true;
    else
        fetch_failed();
    return;

far:
    FETCHED(branch);
outside:
    r[15] = target & ~1u, cycles = now;
    REPORT(r[15]);
    instructions += count;
    return;

watched:    // The instruction runs later, from here, with the same cycles.
    r[15] = PC, cycles = now - op->stall;
    if (op == it_operation) it = it_before;
failed:    // System or run() set r[15]
    FETCHED(op);
done:
    attention_requested = true;
    instructions += count;
    return;

leave:
    SYNC();
    FETCHED_BEFORE();
    instructions += count;
}

template void Cpu::loop<false>();
template void Cpu::loop<true>();

}  // namespace armv7m
