// The private peripheral bus: system control space (ARMv7-M Architecture Reference Manual B3.2),
// ITM, DWT and FPB (C1). Values of the ID registers: Cortex-M3 Technical Reference
// Manual, chapter 4.

#include "armv7m/system/system.h"

#include "armv7m/core/cpu.h"

namespace armv7m {

namespace {

constexpr uint32_t ITM_BASE = 0xE0000000u, DWT_BASE = 0xE0001000u, FPB_BASE = 0xE0002000u,
                   SCS_BASE = 0xE000E000u, TPIU_BASE = 0xE0040000u, ETM_BASE = 0xE0041000u,
                   ROM_BASE = 0xE00FF000u;

// Offsets in the system control space.
enum : uint32_t {
    SCS_ICTR = 0x004, SCS_ACTLR = 0x008, SCS_SYSTICK = 0x010, SCS_NVIC = 0x100, SCS_IPR = 0x400,
    SCS_SCB = 0xD00, SCS_MPU = 0xD90, SCS_DHCSR = 0xDF0, SCS_DCRDR = 0xDF8, SCS_DEMCR = 0xDFC,
    SCS_STIR = 0xF00,
};

// Offsets from 0xE000ED00.
enum : uint32_t {
    SCB_CPUID = 0x00, SCB_ICSR = 0x04, SCB_VTOR = 0x08, SCB_AIRCR = 0x0C, SCB_SCR = 0x10,
    SCB_CCR = 0x14, SCB_SHPR = 0x18, SCB_SHCSR = 0x24, SCB_CFSR = 0x28, SCB_HFSR = 0x2C,
    SCB_DFSR = 0x30, SCB_MMFAR = 0x34, SCB_BFAR = 0x38, SCB_ID = 0x40, SCB_ID_END = 0x74,
};

// ID_PFR0 to ID_ISAR4.
constexpr uint32_t FEATURES[] = {
    0x00000030, 0x00000200, 0x00100000, 0x00000000, 0x00100030, 0x00000000, 0x01000000,
    0x00000000, 0x01101110, 0x02111000, 0x21112231, 0x01111110, 0x01310132,
};

// Bits of SHCSR by exception, B3.2.13; -1: none.
constexpr struct { int exception, active, pending, enable; } HANDLERS[] = {
    {MEM_MANAGE, 0, 13, 16}, {BUS_FAULT, 1, 14, 17}, {USAGE_FAULT, 3, 12, 18},
    {SVCALL, 7, 15, -1},     {DEBUG_MONITOR, 8, -1, -1}, {PEND_SV, 10, -1, -1}, {SYSTICK, 11, -1, -1},
};

constexpr bool within(uint32_t offset, uint32_t begin, uint32_t end) {
    return offset >= begin && offset < end;
}

}  // namespace

// --- accesses ---------------------------------------------------------------------------------

// Whether unprivileged code may access it: stimulus ports as TPR allows, STIR if CCR.USERSETMPEND.
bool System::user_may(uint32_t address, bool write) const {
    if (address < ITM_BASE + 0x80) return itm.user_may_write((address - ITM_BASE) / 4);
    return write && address == SCS_BASE + SCS_STIR && (ccr & CCR_USERSETMPEND);
}

bool System::read(uint32_t address, int size, uint32_t &value) {
    if (!cpu.privileged() && !user_may(address, false)) return false;
    uint32_t word = 0;
    if (!read_word(address & ~3u, false, word)) return false;
    word >>= 8 * (address & 3);
    value = size == 4 ? word : word & ((1u << 8 * size) - 1);
    return true;
}

bool System::write(uint32_t address, int size, uint32_t value) {
    if (!cpu.privileged() && !user_may(address, true)) return false;
    if (address < ITM_BASE + 0x80) {
        const uint32_t port = (address - ITM_BASE) / 4;
        if (itm.enabled(port)) {
            const uint32_t sent = size == 4 ? value : value & ((1u << 8 * size) - 1);
            listener.itm((int)port, sent, size);
        }
        return true;
    }
    const uint32_t shift = address & 3;
    const uint32_t lanes = (size == 4 ? 15u : (1u << size) - 1) << shift;
    return write_word(address & ~3u, value << 8 * shift, lanes);
}

uint32_t System::peek(uint32_t address) {
    uint32_t value = 0;
    read_word(address & ~3u, true, value);
    return value;
}

bool System::read_word(uint32_t address, bool look, uint32_t &value) {
    value = 0;
    if (address < DWT_BASE) {
        value = itm.read(address - ITM_BASE);
        return true;
    }
    if (address < FPB_BASE) {
        // PCSR is the one register there that belongs to the core.
        value = address == DWT_BASE + 0x1C ? cpu.r[15] : dwt.read(address - DWT_BASE, cpu.cycles);
        return true;
    }
    if (address < FPB_BASE + 0x1000) {
        const uint32_t offset = address - FPB_BASE;
        if (offset == 0) value = patch_control | 0x260;    // 6 code, 2 literal comparators
        else if (offset == 4) value = patch_remap | 1u << 29;
        else if (offset < 0x28) value = patch[(offset - 8) / 4];
        return true;
    }
    if (within(address, TPIU_BASE, ETM_BASE + 0x1000) || address >= ROM_BASE) {
        if (!look) listener.unmodelled("TPIU, ETM or ROM table");
        return true;
    }
    const uint32_t offset = address - SCS_BASE;
    if (address < SCS_BASE || offset >= 0x1000) return false;
    if (within(offset, SCS_SYSTICK, SCS_SYSTICK + 0x10)) {
        if (systick.advance(cpu.cycles)) pend(SYSTICK);
        value = look ? systick.peek(offset - SCS_SYSTICK, cpu.cycles)
                     : systick.read(offset - SCS_SYSTICK, cpu.cycles);
    } else if (within(offset, SCS_NVIC, SCS_SCB)) {
        value = nvic.read(offset - SCS_NVIC);
    } else if (within(offset, SCS_MPU, SCS_MPU + 0x2C)) {
        value = mpu.read(offset - SCS_MPU);
    } else if (within(offset, SCS_SCB, SCS_MPU)) {
        value = read_scb(offset - SCS_SCB);
    } else {
        switch (offset) {
        case SCS_ICTR: value = (uint32_t)(parameters.interrupts - 1) / 32; break;
        case SCS_ACTLR: value = actlr; break;
        case SCS_DHCSR:
            value = (debugger || semihosting ? 1u : 0u) | 1u << 16 | (sleeping != Sleep::Awake ? 1u << 18 : 0u) |
                    (lockup ? 1u << 19 : 0u) | 1u << 24;
            break;
        case SCS_DCRDR: value = dcrdr; break;
        case SCS_DEMCR:
            value = demcr | (nvic.enabled(DEBUG_MONITOR) ? DEMCR_MON_EN : 0u) |
                    (nvic.pending(DEBUG_MONITOR) ? 1u << 17 : 0u);
            break;
        }
    }
    return true;
}

bool System::write_word(uint32_t address, uint32_t value, uint32_t lanes) {
    const uint32_t offset = address - SCS_BASE;
    // Priorities and CFSR can be written in bytes, everything else only in words (B3.1.1).
    const bool in_bytes = within(offset, SCS_IPR, SCS_SCB) ||
                          within(offset, SCS_SCB + SCB_SHPR, SCS_SCB + SCB_SHCSR) ||
                          offset == SCS_SCB + SCB_CFSR;
    if (lanes != 15 && !in_bytes) {
        listener.unmodelled("byte or half-word written to a word register of the system");
        return address < FPB_BASE + 0x1000 || within(offset, 0, 0x1000);
    }
    if (address < DWT_BASE) {
        itm.write(address - ITM_BASE, value);
    } else if (address < FPB_BASE) {
        const uint32_t dwt_offset = address - DWT_BASE;
        if (dwt_offset >= 0x20 && dwt_offset % 16 == 8 && value & 15)
            listener.unmodelled("comparators of the DWT");
        dwt.write(dwt_offset, value, cpu.cycles);
    } else if (address < FPB_BASE + 0x1000) {
        const uint32_t patch_offset = address - FPB_BASE;
        if (patch_offset == 0 && value & 1) listener.unmodelled("flash patch (FPB)");
        if (patch_offset == 0 && (value & 2)) patch_control = value & 1;    // KEY
        else if (patch_offset == 4) patch_remap = value & 0x1FFFFFE0;
        else if (patch_offset >= 8 && patch_offset < 0x28) patch[(patch_offset - 8) / 4] = value;
    } else if (within(address, TPIU_BASE, ETM_BASE + 0x1000) || address >= ROM_BASE) {
        listener.unmodelled("TPIU, ETM or ROM table");
    } else if (address < SCS_BASE || offset >= 0x1000) {
        return false;
    } else if (within(offset, SCS_SYSTICK, SCS_SYSTICK + 0x10)) {
        if (systick.advance(cpu.cycles)) pend(SYSTICK);
        systick.write(offset - SCS_SYSTICK, value, cpu.cycles);
        cpu.attention();    // next_cycle() may have changed
    } else if (within(offset, SCS_IPR, SCS_SCB)) {
        nvic.write_priorities(FIRST_INTERRUPT + (int)(offset - SCS_IPR), value, lanes);
        priority_changed();
    } else if (within(offset, SCS_NVIC, SCS_IPR)) {
        const int before = nvic.first_pending();
        nvic.write(offset - SCS_NVIC, value);
        if (within(offset, SCS_NVIC + 0x100, SCS_NVIC + 0x180) && value && (scr & SCR_SEVONPEND))
            event = true;
        if (nvic.first_pending() != before) priority_changed();
    } else if (within(offset, SCS_MPU, SCS_MPU + 0x2C)) {
        if (mpu.write(offset - SCS_MPU, value)) cpu.regions_changed();
    } else if (within(offset, SCS_SCB, SCS_MPU)) {
        write_scb(offset - SCS_SCB, value, lanes);
    } else {
        switch (offset) {
        case SCS_ACTLR: actlr = value & 7; break;
        case SCS_DCRDR: dcrdr = value; break;
        case SCS_DEMCR: write_demcr(value); break;
        case SCS_STIR: pend_interrupt((int)(value & 0x1FF)); break;
        }
    }
    return true;
}

// --- system control block ---------------------------------------------------------------------

uint32_t System::read_scb(uint32_t offset) const {
    if (within(offset, SCB_ID, SCB_ID_END)) return FEATURES[(offset - SCB_ID) / 4];
    if (within(offset, SCB_SHPR, SCB_SHCSR))
        return nvic.priority_word(MEM_MANAGE + (int)(offset - SCB_SHPR));
    switch (offset) {
    case SCB_CPUID: return parameters.cpuid;
    case SCB_ICSR: return icsr();
    case SCB_VTOR: return vtor;
    case SCB_AIRCR: return 0xFA050000u | prigroup << 8;
    case SCB_SCR: return scr;
    case SCB_CCR: return ccr;
    case SCB_SHCSR: return shcsr();
    case SCB_CFSR: return cfsr;
    case SCB_HFSR: return hfsr;
    case SCB_DFSR: return dfsr;
    case SCB_MMFAR: return mmfar;
    case SCB_BFAR: return bfar;
    default: return 0;
    }
}

void System::write_scb(uint32_t offset, uint32_t value, uint32_t lanes) {
    if (within(offset, SCB_SHPR, SCB_SHCSR)) {
        const int first = MEM_MANAGE + (int)(offset - SCB_SHPR);
        constexpr int UNUSED[] = {7, 8, 9, 10, 13};
        for (int number : UNUSED)
            if (number >= first && number < first + 4) lanes &= ~(1u << (number - first));
        nvic.write_priorities(first, value, lanes);
        priority_changed();
        return;
    }
    switch (offset) {
    case SCB_ICSR: write_icsr(value); break;
    case SCB_VTOR: vtor = value & 0x3FFFFF80u; break;
    case SCB_AIRCR:
        if (value >> 16 != 0x05FA) break;
        prigroup = value >> 8 & 7;
        nvic.set_grouping(prigroup);
        priority_changed();
        if (value & 5) {    // SYSRESETREQ or VECTRESET
            cpu.stop();
            listener.reset_requested();
        }
        break;
    case SCB_SCR: scr = value & (SCR_SLEEPONEXIT | SCR_SLEEPDEEP | SCR_SEVONPEND); break;
    case SCB_CCR: ccr = value & 0x31B; break;
    case SCB_SHCSR: write_shcsr(value); break;
    case SCB_CFSR: {
        uint32_t mask = 0;
        for (int lane = 0; lane < 4; lane++) mask |= lanes >> lane & 1 ? 0xFFu << 8 * lane : 0;
        cfsr &= ~(value & mask);
        break;
    }
    case SCB_HFSR: hfsr &= ~value; break;
    case SCB_DFSR: dfsr &= ~value; break;
    case SCB_MMFAR: mmfar = value; break;
    case SCB_BFAR: bfar = value; break;
    }
}

uint32_t System::icsr() const {
    const int first = nvic.first_pending();
    bool interrupt_pending = false;
    for (int number = FIRST_INTERRUPT; number < nvic.count(); number++)
        interrupt_pending |= nvic.pending(number);
    const int others = nvic.active_count() - (cpu.ipsr && nvic.active(cpu.ipsr) ? 1 : 0);
    return cpu.ipsr | (others == 0 ? 1u << 11 : 0u) | (uint32_t)first << 12 |
           (interrupt_pending ? 1u << 22 : 0u) | (nvic.pending(SYSTICK) ? 1u << 26 : 0u) |
           (nvic.pending(PEND_SV) ? 1u << 28 : 0u) | (nvic.pending(NMI) ? 1u << 31 : 0u);
}

void System::write_icsr(uint32_t value) {
    if (value >> 27 & 1) nvic.set_pending(PEND_SV, false);
    if (value >> 25 & 1) nvic.set_pending(SYSTICK, false);
    if (value >> 31 & 1) pend(NMI);
    if (value >> 28 & 1) pend(PEND_SV);
    if (value >> 26 & 1) pend(SYSTICK);
}

uint32_t System::shcsr() const {
    uint32_t value = 0;
    for (const auto &one : HANDLERS) {
        value |= (uint32_t)nvic.active(one.exception) << one.active;
        if (one.pending >= 0) value |= (uint32_t)nvic.pending(one.exception) << one.pending;
        if (one.enable >= 0) value |= (uint32_t)nvic.enabled(one.exception) << one.enable;
    }
    return value;
}

void System::write_shcsr(uint32_t value) {
    for (const auto &one : HANDLERS) {
        nvic.set_active(one.exception, value >> one.active & 1);
        if (one.enable >= 0) nvic.set_enabled(one.exception, value >> one.enable & 1);
        if (one.pending >= 0) nvic.set_pending(one.exception, value >> one.pending & 1);
    }
    priority_changed();
}

void System::write_demcr(uint32_t value) {
    demcr = value & 0x010C07F1u;
    nvic.set_enabled(DEBUG_MONITOR, value & DEMCR_MON_EN);
    nvic.set_pending(DEBUG_MONITOR, value >> 17 & 1);
    dwt.set_trace_enabled(value & DEMCR_TRCENA, cpu.cycles);
    priority_changed();
}

}  // namespace armv7m
