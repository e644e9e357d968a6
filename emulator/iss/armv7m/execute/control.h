// Branches, hints and system instructions (ARMv7-M ARM A4.3, A4.8 to A4.10). Part of Cpu::loop.

HANDLE(B) { GO_DIRECT(); }

#define BRANCH_IF(name, holds) \
    HANDLE(name) { \
        if (holds) GO_DIRECT(); \
        NEXT(1); \
    }
BRANCH_IF(B_EQ, (uint32_t)nz == 0)
BRANCH_IF(B_NE, (uint32_t)nz != 0)
BRANCH_IF(B_CS, carry)
BRANCH_IF(B_CC, !carry)
BRANCH_IF(B_MI, n())
BRANCH_IF(B_PL, !n())
BRANCH_IF(B_VS, overflow)
BRANCH_IF(B_VC, !overflow)
BRANCH_IF(B_HI, carry && (uint32_t)nz != 0)
BRANCH_IF(B_LS, !carry || (uint32_t)nz == 0)
BRANCH_IF(B_GE, n() == (bool)overflow)
BRANCH_IF(B_LT, n() != (bool)overflow)
BRANCH_IF(B_GT, n() == (bool)overflow && (uint32_t)nz != 0)
BRANCH_IF(B_LE, n() != (bool)overflow || (uint32_t)nz == 0)
BRANCH_IF(CBZ, r[op->n] == 0)
BRANCH_IF(CBNZ, r[op->n] != 0)

HANDLE(BL) {
    r[14] = (PC + 4) | 1;
    GO_DIRECT();
}
HANDLE(BLX) {
    const uint32_t to = r[op->m];
    r[14] = (PC + 2) | 1;
    thumb = to & 1;
    if (UNLIKELY(!thumb)) limit = INT64_MIN;    // run() raises the fault at the target
    GO(to & ~1u, REFILL_REGISTER);
}
HANDLE(BX) {
    const uint32_t pc = PC;
    r[15] = pc + 4;    // BX PC is allowed, and clears T
    const uint32_t to = r[op->m];
    if (UNLIKELY(to >= 0xF0000000u && handler_mode())) {
        target = to;
        now += 1;    // System charges the return
        goto leave_exception;
    }
    thumb = to & 1;
    if (UNLIKELY(!thumb)) limit = INT64_MIN;
    GO(to & ~1u, REFILL_REGISTER);
}
#define TABLE_BRANCH(name, type) \
    HANDLE(name) { \
        const uint32_t pc = PC, start = op->n == 15 ? pc + 4 : r[op->n]; \
        const uint32_t address = start + (uint32_t)sizeof(type) * r[op->m]; \
        READ(type, address, op->m) \
        load_end = -1; \
        GO(pc + 4 + 2 * value, REFILL_LOADED); \
    }
TABLE_BRANCH(TBB, uint8_t)
TABLE_BRANCH(TBH, uint16_t)
// Folded into a 16-bit instruction before it: no extra cycle (TRM 3.3.1).
HANDLE(IT) {
    const uint32_t pc = PC;
    it = (uint8_t)op->value;
    table = it_handlers;
    NEXT(op == aside ? !op->a : !folds(pc - base, op));
}
HANDLE(NOP) { NEXT(1); }
HANDLE(BARRIER) {
    WAIT_FOR_BUS();
    NEXT(1);
}
HANDLE(ISB) { NEXT(1 + REFILL_REGISTER); }
HANDLE(CPS) {
    SYNC();
    change_masks(op->value);
    NEXT(1);
}
HANDLE(MRS) {
    r[op->d] = read_special(op->value);
    NEXT(2);
}
HANDLE(MSR) {
    SYNC();
    write_special(op->value, op->a, r[op->n]);
    NEXT(2);
}

// Instructions that call System; r[15] is the next address.
#define HAND_OVER(call) \
    do { \
        now += 1; \
        count++; \
        r[15] = PC + 2u * HALVES, cycles = now; \
        REPORT(r[15]); \
        call; \
        goto failed; \
    } while (0)
HANDLE(WFI) { HAND_OVER(system->wfi()); }
HANDLE(WFE) { HAND_OVER(system->wfe()); }
HANDLE(SEV) {
    SYNC();
    system->sev();
    NEXT(1);
}
HANDLE(SVC) { HAND_OVER(system->svc()); }
HANDLE(BKPT) {
    SYNC();
    attention_requested = true;
    limit = INT64_MIN;
    if (system->bkpt(op->value)) NEXT(1);
    goto failed;
}
HANDLE(COPROCESSOR) { FAIL(Fault::NoCoprocessor); }
HANDLE(UNDEFINED) { FAIL(Fault::Undefined); }
