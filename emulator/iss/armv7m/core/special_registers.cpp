// Special registers (ARMv7-M ARM B5.1.1, B5.2): MRS, MSR, CPS.

#include "armv7m/core/cpu.h"
#include "armv7m/system/system.h"

namespace armv7m {

uint32_t Cpu::read_special(uint32_t number) const {
    if (number < 8) {    // combinations of APSR (bit 2 clear), IPSR (bit 0), EPSR (reads as 0)
        return (number & 4 ? 0 : apsr()) | (number & 1 ? ipsr : 0);
    }
    if (number != 20 && !privileged()) return 0;
    switch (number) {
    case 8: return main_sp();
    case 9: return process_sp();
    case 16: return primask;
    case 17: case 18: return basepri;
    case 19: return faultmask;
    case 20: return control;
    default: return 0;    // UNPREDICTABLE
    }
}

void Cpu::write_special(uint32_t number, uint32_t mask, uint32_t value) {
    if (number < 4) {    // bit 1 of the mask: the flags; IPSR and EPSR ignore writes
        if (mask & 2) set_apsr(value);
        return;
    }
    if (!privileged()) return;
    const uint8_t priority = (uint8_t)(value & 0xFF00u >> system->parameters.priority_bits);
    switch (number) {
    case 8: set_main_sp(value); break;
    case 9: set_process_sp(value); break;
    case 16: primask = value & 1; break;
    case 17: basepri = priority; break;
    case 18:
        if (priority != 0 && (priority < basepri || basepri == 0)) basepri = priority;
        break;
    case 19:
        // It can always be cleared, as by CPSIE; only NMI and HardFault cannot set it.
        if (!(value & 1) || system->execution_priority() > -1) faultmask = value & 1;
        break;
    case 20:    // SPSEL can only be changed in thread mode
        set_control(handler_mode() ? (uint8_t)((control & 2) | (value & 1)) : (uint8_t)value);
        break;
    default: break;
    }
    system->priority_changed();
}

void Cpu::change_masks(uint32_t value) {
    if (!privileged()) return;
    const uint8_t on = value >> 4 & 1;
    if (value & 2) primask = on;
    if (value & 1 && (!on || system->execution_priority() > -1)) faultmask = on;
    system->priority_changed();
}

}  // namespace armv7m
