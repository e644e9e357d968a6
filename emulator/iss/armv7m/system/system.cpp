// The system around the core: reset, sleep and its events (ARMv7-M Architecture Reference Manual,
// B1.5.18 and B1.5.19), the debugger.

#include "armv7m/system/system.h"

#include "armv7m/core/cpu.h"

namespace armv7m {

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
    if (protected_before) cpu.regions_changed();
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
    cpu.attention();    // service() may wake it at once
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

void System::set_debugger(bool attached, uint32_t catches) {
    debugger = attached;
    catch_mask = attached ? catches : 0;
}

}  // namespace armv7m
