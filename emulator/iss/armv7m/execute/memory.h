// Loads and stores (ARMv7-M ARM A4.6, A4.7; cycles in cycles.h). Part of Cpu::loop.

// Start of a load: it waits for its address, and for a store that is still on the bus. A single
// store waits only until its data can follow that store's.
#define WAIT_FOR_BUS() \
    do { \
        now += op->stall; \
        if (now < bus_free) now = bus_free; \
    } while (0)
#define WAIT_FOR_STORE() \
    do { \
        now += op->stall; \
        if (now + 1 < bus_free) now = bus_free - 1; \
    } while (0)
#define LAST_LOAD_FEEDS(base_register, index_register) \
    ((base_register) == loaded || (index_register) == loaded)
#define NO_REGISTER 16u
#define NO_OVERLAP ((uint32_t)loaded)    // a load with write-back does not overlap a load before it
#define KEEP_SP(number, value) ((number) == 13 ? (value) & ~3u : (value))
#define LOAD_OR_FAIL(address, bytes, value, privilege) \
    do { \
        const Result result = \
            load_data((address), (bytes), (value), (privilege), instructions + count); \
        if (UNLIKELY(result != Result::Done)) { \
            if (result == Result::Watched) goto watched; \
            if (abandon(op, result, false)) goto failed; \
            (value) = 0;    /* an ignored bus fault: the value is UNKNOWN */ \
        } \
    } while (0)
#define STORE_OR_FAIL(address, bytes, value, privilege) \
    do { \
        const Result result = \
            store_data((address), (bytes), (value), (privilege), instructions + count); \
        if (UNLIKELY(result == Result::Watched)) goto watched; \
        if (UNLIKELY(result != Result::Done) && abandon(op, result, true)) goto failed; \
    } while (0)

// Reads `value` of `type` from `address`; afterwards `now` is the end of the load.
#define READ(type, address, index_register) \
    uint32_t value; \
    WAIT_FOR_BUS(); \
    { \
        constexpr uint32_t bytes = sizeof(type); \
        const Page &page = map[(address) >> 20]; \
        const uint32_t offset = (address) & 0xFFFFF; \
        const bool behind = now == load_end && !LAST_LOAD_FEEDS(op->n, index_register); \
        if (LIKELY(!(offset & (bytes - 1)) && offset < page.read_limit)) { \
            type content; \
            std::memcpy(&content, page.host + offset, bytes); \
            value = (uint32_t)content; \
            now += 2 - behind + page.read_wait; \
        } else { \
            r[15] = PC, cycles = now + 1 - behind; \
            uint32_t content;    /* `value` stays in a register */ \
            LOAD_OR_FAIL(address, bytes, content, privileged()); \
            value = (uint32_t)(type)content; \
            now = cycles + 1; \
        } \
        load_end = now; \
    }

// Writes the low bytes of `value`; `extra`: whether it takes one cycle more.
#define WRITE(type, address, value, extra) \
    WAIT_FOR_STORE(); \
    { \
        constexpr uint32_t bytes = sizeof(type); \
        const Page &page = map[(address) >> 20]; \
        const uint32_t offset = (address) & 0xFFFFF; \
        const uint32_t late = (extra); \
        if (LIKELY(!(offset & (bytes - 1)) && offset < page.write_limit)) { \
            const type content = (type)(value); \
            std::memcpy(page.host + offset, &content, bytes); \
            if (UNLIKELY(page.marks[offset >> 6])) written(page.host + offset, bytes); \
            bus_free = now + 2 + page.write_wait; \
        } else { \
            const int64_t data_phase = now + 1; \
            r[15] = PC, cycles = data_phase; \
            const Result result = \
                store_data((address), bytes, (value), privileged(), instructions + count); \
            if (UNLIKELY(result == Result::Watched)) goto watched; \
            bus_free = cycles + 1; \
            if (UNLIKELY(result != Result::Done) && abandon(op, result, true)) goto failed; \
            cycles = data_phase; \
        } \
        now += 1 + late; \
    }

#define LOAD_FORM(name, type, from, index_register, write_back) \
    HANDLE(name) { \
        const uint32_t address = (from); \
        READ(type, address, index_register) \
        write_back; \
        r[op->d] = value, loaded = op->d; \
        NEXT(0); \
    }
#define BASE_IS(value) r[op->n] = KEEP_SP(op->n, value)
#define LOAD(name, type) \
    LOAD_FORM(name##_O, type, r[op->n] + op->value, NO_REGISTER, ) \
    LOAD_FORM(name##_M, type, r[op->n] + (r[op->m] << op->shift), op->m, ) \
    LOAD_FORM(name##_P, type, r[op->n] + op->value, NO_OVERLAP, BASE_IS(address)) \
    LOAD_FORM(name##_Q, type, r[op->n], NO_OVERLAP, BASE_IS(address + op->value)) \
    LOAD_FORM(name##_L, type, ((PC + 4) & ~3u) + op->value, NO_REGISTER, )

LOAD(LDR, uint32_t)
LOAD(LDRH, uint16_t)
LOAD(LDRB, uint8_t)
LOAD(LDRSH, int16_t)
LOAD(LDRSB, int8_t)

#define STORE_FORM(name, type, to, extra, write_back) \
    HANDLE(name) { \
        const uint32_t address = (to); \
        WRITE(type, address, r[op->d], extra) \
        write_back; \
        NEXT(0); \
    }
#define STORE(name, type) \
    STORE_FORM(name##_O, type, r[op->n] + op->value, 0, ) \
    STORE_FORM(name##_M, type, r[op->n] + (r[op->m] << op->shift), now != load_end, ) \
    STORE_FORM(name##_P, type, r[op->n] + op->value, now == load_end, BASE_IS(address)) \
    STORE_FORM(name##_Q, type, r[op->n], now == load_end, BASE_IS(address + op->value))

STORE(STR, uint32_t)
STORE(STRH, uint16_t)
STORE(STRB, uint8_t)

// Loads a word into SP or PC. In handler mode an EXC_RETURN value returns from the exception.
HANDLE(LDR_WIDE) {
    uint32_t address = op->a == 4 ? ((PC + 4) & ~3u) + op->value : r[op->n];
    if (op->a == 0 || op->a == 2) address += op->value;
    if (op->a == 1) address += r[op->m] << op->shift;
    READ(uint32_t, address, NO_REGISTER)
    if (op->a == 2) BASE_IS(address);
    if (op->a == 3) BASE_IS(address + op->value);
    if (op->d == 13) {
        r[13] = value & ~3u, loaded = 13;
        NEXT(0);
    }
    load_end = -1;
    target = value;
    now -= 1;    // which jump_loaded counts again
    goto jump_loaded;
}

HANDLE(LOAD_USER) {
    const uint32_t address = r[op->n] + op->value;
    uint32_t value;
    WAIT_FOR_BUS();
    r[15] = PC, cycles = now + 1;
    LOAD_OR_FAIL(address, op->a, value, false);
    if (op->m) value = op->a == 1 ? (uint32_t)(int8_t)value : (uint32_t)(int16_t)value;
    r[op->d] = value, loaded = op->d;
    now = load_end = cycles + 1;
    NEXT(0);
}
HANDLE(STORE_USER) {
    const uint32_t address = r[op->n] + op->value;
    WAIT_FOR_STORE();
    r[15] = PC, cycles = now + 1;
    const uint32_t content = op->a == 4 ? r[op->d] : r[op->d] & ((1u << 8 * op->a) - 1);
    const Result result = store_data(address, op->a, content, false, instructions + count);
    if (UNLIKELY(result == Result::Watched)) goto watched;
    bus_free = cycles + 1;
    if (UNLIKELY(result != Result::Done) && abandon(op, result, true)) goto failed;
    NEXT(1);
}

// A watchpoint at any word stops before the first access.
#define STOP_AT_WATCH(address, words, value, write) \
    for (uint32_t i = 0; i < (words) && !watches.empty(); i++) \
        if (stops_at_watch((address) + 4 * i, 4, (value), write, instructions + count)) \
            goto watched;

// LDM, POP: all registers are written at the end, so that a fault changes none. (The processor
// restarts an LDM that is interrupted; here the interrupt waits for its end.)
#define MULTIPLE() \
    uint32_t contents[16], list = op->list; \
    const uint32_t size = op->value, registers = size / 4; \
    const uint32_t address = op->a ? r[op->n] - size : r[op->n]; \
    const uint32_t end = op->a ? address : address + size; \
    const Page &page = map[address >> 20]; \
    const uint32_t offset = address & 0xFFFFF; \
    if (UNLIKELY(address & 3)) { \
        fault_address = address; \
        FAIL(Fault::Unaligned); \
    }
HANDLE(LDM) {
    MULTIPLE()
    WAIT_FOR_BUS();
    if (LIKELY((uint64_t)offset + size <= page.read_limit)) {
        now += 1 + (int64_t)registers * (1 + page.read_wait);
        if (op->m) BASE_IS(end);
        const uint8_t *from = page.host + offset;
        for (list &= 0x7FFF; list; list &= list - 1, from += 4)
            std::memcpy(&r[__builtin_ctz(list)], from, 4);
        if (op->list & 0x8000) {
            std::memcpy(&target, from, 4);
            now -= 1;
            goto jump_loaded;
        }
        NEXT(0);
    } else {
        r[15] = PC, cycles = now + 1;
        STOP_AT_WATCH(address, registers, 0, false)
        for (uint32_t i = 0; i < registers; i++) {
            LOAD_OR_FAIL(address + 4 * i, 4, contents[i], privileged());
            cycles++;
        }
        now = cycles;
    }
    if (op->m) BASE_IS(end);
    const uint32_t *next = contents;
    for (list &= 0x7FFF; list; list &= list - 1) r[__builtin_ctz(list)] = *next++;
    if (op->list & 0x8000) {
        target = *next;
        now -= 1;
        goto jump_loaded;
    }
    NEXT(0);
}
HANDLE(STM) {
    MULTIPLE()
    WAIT_FOR_BUS();
    if (LIKELY((uint64_t)offset + size <= page.write_limit)) {
        uint8_t *to = page.host + offset;
        for (; list; list &= list - 1, to += 4) std::memcpy(to, &r[__builtin_ctz(list)], 4);
        if (UNLIKELY(page.marks[offset >> 6] || page.marks[(offset + size - 1) >> 6]))
            written(page.host + offset, size);
        now += 1 + (int64_t)registers * (1 + page.write_wait);
    } else {
        uint32_t *next = contents;
        for (; list; list &= list - 1) *next++ = r[__builtin_ctz(list)];
        r[15] = PC, cycles = now + 1;
        STOP_AT_WATCH(address, registers, contents[i], true)
        for (uint32_t i = 0; i < registers; i++) {
            STORE_OR_FAIL(address + 4 * i, 4, contents[i], privileged());
            cycles++;
        }
        now = cycles;
    }
    if (op->m) BASE_IS(end);
    NEXT(0);
}

HANDLE(LDRD) {
    const uint32_t start = op->n == 15 ? (PC + 4) & ~3u : r[op->n];
    const uint32_t address = op->m == 2 ? start : start + op->value;
    if (UNLIKELY(address & 3)) FAIL(Fault::Unaligned);
    WAIT_FOR_BUS();
    uint32_t low, high;
    const Page &page = map[address >> 20];
    const uint32_t offset = address & 0xFFFFF;
    if (LIKELY((uint64_t)offset + 8 <= page.read_limit)) {
        std::memcpy(&low, page.host + offset, 4);
        std::memcpy(&high, page.host + offset + 4, 4);
        now += 3 + 2 * page.read_wait;
    } else {
        r[15] = PC, cycles = now + 1;
        STOP_AT_WATCH(address, 2, 0, false)
        LOAD_OR_FAIL(address, 4, low, privileged());
        cycles++;
        LOAD_OR_FAIL(address + 4, 4, high, privileged());
        now = cycles + 1;
    }
    if (op->m) BASE_IS(start + op->value);
    r[op->d] = low, r[op->a] = high;
    NEXT(0);
}
HANDLE(STRD) {
    const uint32_t start = r[op->n];
    const uint32_t address = op->m == 2 ? start : start + op->value;
    if (UNLIKELY(address & 3)) FAIL(Fault::Unaligned);
    WAIT_FOR_BUS();
    const Page &page = map[address >> 20];
    const uint32_t offset = address & 0xFFFFF;
    if (LIKELY((uint64_t)offset + 8 <= page.write_limit)) {
        std::memcpy(page.host + offset, &r[op->d], 4);
        std::memcpy(page.host + offset + 4, &r[op->a], 4);
        if (UNLIKELY(page.marks[offset >> 6] || page.marks[(offset + 7) >> 6]))
            written(page.host + offset, 8);
        now += 3 + 2 * page.write_wait;
    } else {
        r[15] = PC, cycles = now + 1;
        STOP_AT_WATCH(address, 2, r[i ? op->a : op->d], true)
        STORE_OR_FAIL(address, 4, r[op->d], privileged());
        cycles++;
        STORE_OR_FAIL(address + 4, 4, r[op->a], privileged());
        now = cycles + 1;
    }
    if (op->m) BASE_IS(start + op->value);
    NEXT(0);
}

// Exclusives. The monitor stores no address (TRM 2.3): any store exclusive after a load exclusive
// succeeds, unless CLREX or an exception came between.
HANDLE(LDREX) {
    const uint32_t address = r[op->n] + op->value, bytes = op->shift;
    uint32_t value;
    if (UNLIKELY(address & (bytes - 1))) FAIL(Fault::Unaligned);
    WAIT_FOR_BUS();
    const bool behind = now == load_end && op->n != loaded;
    r[15] = PC, cycles = now + 1 - behind;
    LOAD_OR_FAIL(address, bytes, value, privileged());
    exclusive = true;
    r[op->d] = value, loaded = op->d;
    now = load_end = cycles + 1;
    NEXT(0);
}
// d = data, m = result.
HANDLE(STREX) {
    const uint32_t address = r[op->n] + op->value, bytes = op->shift;
    if (UNLIKELY(address & (bytes - 1))) FAIL(Fault::Unaligned);
    WAIT_FOR_BUS();
    const bool behind = now == load_end && op->n != loaded && op->d != loaded;
    r[15] = PC, cycles = now + 1 - behind;
    if (exclusive) {
        const uint32_t content = bytes == 4 ? r[op->d] : r[op->d] & ((1u << 8 * bytes) - 1);
        STORE_OR_FAIL(address, bytes, content, privileged());
    }
    r[op->m] = !exclusive, loaded = op->m;
    exclusive = false;
    now = load_end = cycles + 1;
    NEXT(0);
}
HANDLE(CLREX) {
    exclusive = false;
    NEXT(1);
}
