// An instruction in an IT block (ARMv7-M ARM A7.3). Part of Cpu::loop.

HANDLE(in_it)
    it_operation = op;
    it_before = it;
    it = it & 7 ? (uint8_t)((it & 0xE0) | (it << 1 & 0x1F)) : 0;
    if (it == 0) table = handlers;
    if (condition(it_before >> 4) || op->code == C_BKPT)
        goto *handlers[op->in_it + (HALVES - 1) * CODE_COUNT];
    NEXT(1);
