// The loop that runs instructions: one label per operation, reached by computed goto.
//
// The state that every instruction needs is in local variables: `op`, and `now` for Cpu::cycles. It
// is written back (SYNC) before anything else is called. Instructions in an IT block go through a
// second table of labels, all of which lead to the code that checks the condition; so the others
// have no cost for IT. Mode 1 calls a tracer and counts steps, mode 2 charges fetches and checks
// the MPU.

#include "armv7m/core/cpu.h"
#include "armv7m/decode/decode.h"
#include "armv7m/execute/cycles.h"
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

bool Cpu::condition(uint32_t number) const {
    bool holds;
    switch (number >> 1) {
    case 0: holds = z(); break;
    case 1: holds = carry; break;
    case 2: holds = n(); break;
    case 3: holds = overflow; break;
    case 4: holds = carry && !z(); break;
    case 5: holds = n() == (bool)overflow; break;
    case 6: holds = n() == (bool)overflow && !z(); break;
    default: return true;
    }
    return holds != (bool)(number & 1);
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

// Counts a step that ended at `next`.
bool Cpu::stepped(uint32_t next) {
    if (steps_left == 0 || (next >= step_low && next < step_high) || --steps_left > 0) return false;
    exits |= ExitStep;
    limit = INT64_MIN;
    return true;
}

template <int Mode> void Cpu::loop() {
#define ARMV7M_LABEL(name) &&L_##name,
#define ARMV7M_IT(name) &&in_it,
    static const void *const handlers[] = {ARMV7M_CODES(ARMV7M_LABEL)};
    static const void *const it_handlers[] = {ARMV7M_CODES(ARMV7M_IT)};
#undef ARMV7M_LABEL
#undef ARMV7M_IT

    constexpr bool TRACED = Mode & 1, FETCHED = Mode & 2;
    Operation *const ops = operations;
    Operation *op = ops + ((r[15] - code_base) >> 1);
    const uint32_t base = code_base, length = code_size;
    const Page *const map = pages.data();
    const void *const *table = it ? it_handlers : handlers;
    int64_t now = cycles;
    uint64_t count = 0;
    uint32_t target = 0;
    // For the tracer's report at the end of the instruction.
    bool running = false;
    uint32_t traced_pc = 0;
    int64_t traced_since = 0;
    it_operation = nullptr;
    // If only the MPU checks fetches, every fetch misses.
    static constexpr uint32_t NO_TAG[1] = {NOWHERE};
    const uint32_t *const tags = lines ? lines->tags : NO_TAG;
    const uint32_t shift = lines ? lines->shift : 2, mask = lines ? lines->mask : 0;

#define PC (base + (uint32_t)(((char *)op - (char *)ops) >> 3))
#define HANDLE(name) L_##name:
#define DISPATCH() \
    do { \
        if (Mode != 0) goto between; \
        if (UNLIKELY(now >= limit)) goto leave; \
        goto *table[op->code]; \
    } while (0)
#define NEXT(cost) \
    do { \
        now += (cost); \
        op += op->halves; \
        count++; \
        DISPATCH(); \
    } while (0)
// Continues at another address; `refill` as in cycles.h.
#define GO(address, refill) \
    do { \
        target = (address); \
        now += 1 + (refill); \
        count++; \
        if (UNLIKELY(target - base >= length)) { \
            arriving = (refill) < 3 && (target & 2) ? ArrivingOdd : Arriving; \
            goto far; \
        } \
        op = ops + ((target - base) >> 1); \
        if (UNLIKELY(op->code == C_UNDECODED) && !decode_at(target & ~1u, op)) goto far; \
        if ((refill) < 3 && op->halves == 2 && (target & 2)) now++; \
        now -= op->stall;    /* the refill hides it */ \
        DISPATCH(); \
    } while (0)
// Makes the state visible to callees.
#define SYNC() (r[15] = PC, cycles = now)
// An instruction ended: calls the tracer and counts a step.
#define REPORT(next) \
    do { \
        if (TRACED && running) { \
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
    if (TRACED) {
        SYNC();
        REPORT(r[15]);
    }
    if (UNLIKELY(now >= limit)) goto leave;
    if (op->code > LAST_MARKER) {
        if (FETCHED) {
            const uint32_t pc = PC, first = pc >> shift;
            const uint32_t last = (pc + 2u * op->halves - 2) >> shift;
            const bool at_hand = (first == fetched || tags[first & mask] == first) &&
                                 (last == first || tags[last & mask] == last);
            if (UNLIKELY(!at_hand || guarded)) {
                SYNC();
                if (!fetch_cost(pc, op->halves)) {
                    fetch_failed();
                    goto failed;
                }
                now = cycles;
            } else {
                fetched = last;
            }
        }
        if (TRACED) running = true, traced_pc = PC, traced_since = now;
    }
    goto *table[op->code];

in_it:
    if (op->code <= LAST_MARKER) goto *handlers[op->code];
    it_operation = op;
    it_before = it;
    it = it & 7 ? (uint8_t)((it & 0xE0) | (it << 1 & 0x1F)) : 0;
    if (it == 0) table = handlers;
    if (condition(it_before >> 4) || op->code == C_BKPT) goto *handlers[op->in_it];
    NEXT(1);

    HANDLE(UNDECODED) {
        const uint32_t pc = PC;
        if (LIKELY(decode_at(pc, op))) DISPATCH();
        goto aside_here;
    }
    HANDLE(BREAK) {
        const uint32_t pc = PC;
        if (!breakpoint_at(pc) || resume_at == pc) {    // of an alias, or passed already
            resume_at = NOWHERE;
            goto aside_here;
        }
        exits |= ExitBreakpoint;
        goto leave;
    }
    HANDLE(REGION_END) {
        target = PC;
        goto far;
    }

#include "armv7m/execute/data.h"
#include "armv7m/execute/memory.h"
#include "armv7m/execute/control.h"

aside_here:    // one instruction that cannot run in place
    SYNC();
    instructions += count;
    if (run_aside(r[15]))
        aside_ready = true;
    else
        fetch_failed();
    return;

far:
    if (TRACED) {
        r[15] = target & ~1u, cycles = now;
        REPORT(r[15]);
    }
    r[15] = target & ~1u;
    cycles = now;
    instructions += count;
    return;

watched:    // The instruction runs later, from here, with the same cycles.
    r[15] = PC, cycles = now - op->stall;
    if (op == it_operation) it = it_before;
failed:    // System or run() set r[15]
    attention_requested = true;
    instructions += count;
    return;

leave:
    SYNC();
    instructions += count;
}

template void Cpu::loop<0>();
template void Cpu::loop<1>();
template void Cpu::loop<2>();
template void Cpu::loop<3>();

}  // namespace armv7m
