// Energy management unit: sleep modes, and the backup supply (emu.cpp). EFM32GG Reference Manual,
// chapter 10.
#pragma once

#include "efm32gg/clocks/cmu.h"
#include "efm32gg/clocks/rmu.h"

namespace efm32gg {

class Emu : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override;
    void analog_changed() override;

    void write(uint32_t offset, uint32_t value) override {
        if (offset == emu::LOCK) {
            lock(emu::LOCK, value, UNLOCK);
            return;
        }
        if (reg(emu::LOCK) && offset < emu::STATUS) return report_locked();
        if (offset == emu::EM4CONF && reg(emu::EM4CONF) & emu::EM4CONF_LOCKCONF) return;
        Peripheral::write(offset, value);
        if (offset == emu::CTRL)
            em4_written(field(value, emu::CTRL_EM4CTRL));
        if (offset == emu::AUXCTRL && value & emu::AUXCTRL_HRCCLR)
            part.rmu->clear_backup_causes();
        if (offset == emu::BUCTRL || offset == emu::ROUTE)
            prepare_backup();
        if (offset == emu::MEMCTRL && value & emu::MEMCTRL_POWERDOWN)
            part.log_once("EMU_MEMCTRL: RAM blocks are not powered down");
    }

    // The mode that WFI and WFE enter. `deep`: the core's SLEEPDEEP bit. Without a low-frequency
    // oscillator EM2 is EM3 (10.3.4).
    int sleeping_mode(bool deep) const {
        if (!deep || reg(emu::CTRL) & emu::CTRL_EM2BLOCK) return 1;
        return part.cmu->low_frequency_on() ? 2 : 3;
    }

    // Whether the part lives from the backup supply: as in EM4, until the main supply is back.
    bool in_backup() const { return on_backup; }
    // Whether the backup domain has power: in EM4 only if EM4CONF requests it (10.3.3).
    bool backup_powered() const {
        return part.mode < 4 || reg(emu::EM4CONF) & emu::EM4CONF_VREGEN;
    }

    // Wakes the part from EM4 by a reset.
    void wake_from_em4() {
        if (part.mode == 4 && !on_backup)
            part.request_reset(rmu::RSTCAUSE_EM4RST | rmu::RSTCAUSE_EM4WURST);
    }

private:
    static constexpr uint32_t UNLOCK = 0xADE8;
    // Writes of 2 and 3 to EM4CTRL in turn, 2 first and last (10.3.3).
    static constexpr int EM4_SEQUENCE = 9;
    int em4_steps = 0;
    bool on_backup = false;
    double main_before = 0;
    Event ready = Event::of<&Emu::on_ready>(this);

    void em4_written(uint32_t value) {
        const uint32_t expected = em4_steps % 2 ? 3 : 2;
        em4_steps = value == expected ? em4_steps + 1 : value == 2;
        if (em4_steps == EM4_SEQUENCE) {
            em4_steps = 0;
            sleep_in_em4();
        }
    }

    void sleep_in_em4();
    void prepare_backup();
    void on_ready(int64_t);
};

}  // namespace efm32gg
