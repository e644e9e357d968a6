#include "efm32gg/clocks/emu.h"

#include "efm32gg/clocks/cmu.h"
#include "efm32gg/clocks/rmu.h"

namespace efm32gg {

using namespace emu;

static constexpr uint32_t EMU_UNLOCK = 0xADE8;
// Writes of 2 and 3 to EM4CTRL in turn, 2 first and last (10.3.3).
static constexpr int EM4_SEQUENCE = 9;

void Emu::reset() {
    // EM4CONF survives all but a power-on reset once it is locked (10.5.5).
    const uint32_t kept = reg(EM4CONF);
    Peripheral::reset();
    if (kept & EM4CONF_LOCKCONF && !(part.reset_cause & rmu::RSTCAUSE_PORST))
        reg(EM4CONF) = kept;
    em4_steps = 0;
}

int Emu::sleeping_mode(bool deep) const {
    if (!deep || reg(CTRL) & CTRL_EM2BLOCK) return 1;
    return part.cmu->low_frequency_on() ? 2 : 3;
}

void Emu::write(uint32_t offset, uint32_t value) {
    if (offset == LOCK) {
        lock(LOCK, value, EMU_UNLOCK);
        return;
    }
    if (reg(LOCK) && offset < STATUS) return report_locked();
    if (offset == EM4CONF && reg(EM4CONF) & EM4CONF_LOCKCONF) return;
    Peripheral::write(offset, value);
    if (offset == CTRL)
        em4_written(field(value, CTRL_EM4CTRL));
    if (offset == AUXCTRL && value & AUXCTRL_HRCCLR)
        part.rmu->clear_backup_causes();
    if (offset == MEMCTRL && value & MEMCTRL_POWERDOWN)
        part.log_once("EMU_MEMCTRL: RAM blocks are not powered down");
}

void Emu::em4_written(uint32_t value) {
    const uint32_t expected = em4_steps % 2 ? 3 : 2;
    em4_steps = value == expected ? em4_steps + 1 : value == 2;
    if (em4_steps == EM4_SEQUENCE) {
        em4_steps = 0;
        part.enter_em4();
    }
}

void Emu::wake_from_em4() {
    if (part.mode == 4)
        part.request_reset(rmu::RSTCAUSE_EM4RST | rmu::RSTCAUSE_EM4WURST);
}

}  // namespace efm32gg
