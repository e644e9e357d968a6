// Reset management unit: causes of resets. EFM32GG Reference Manual, chapter 9.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Rmu : public Peripheral {
public:
    using Peripheral::Peripheral;

    void reset() override {
        const uint32_t causes = reg(rmu::RSTCAUSE), control = reg(rmu::CTRL);
        Peripheral::reset();
        reg(rmu::RSTCAUSE) = causes;
        // Only a power-on reset clears the control register (9.3.2).
        if (!(part.reset_cause & rmu::RSTCAUSE_PORST))
            reg(rmu::CTRL) = control;
    }

    // Causes accumulate until they are cleared; power-on clears the others (table 9.1).
    void caused(uint32_t cause) {
        reg(rmu::RSTCAUSE) = cause & rmu::RSTCAUSE_PORST ? (uint32_t)rmu::RSTCAUSE_PORST
                                                         : reg(rmu::RSTCAUSE) | cause;
    }

    void write(uint32_t offset, uint32_t value) override {
        if (offset == rmu::CMD && value & rmu::CMD_RCCLR)
            reg(rmu::RSTCAUSE) &= BACKUP;
        Peripheral::write(offset, value);
        if (offset == rmu::CTRL && backup_domain_resets()) {
            part.reset_cause = 0;  // not a power-on reset
            part.peripheral_at(instance::BURTC.base)->reset();
        }
    }

    // Clears the causes that EMU_AUXCTRL.HRCCLR clears, and RCCLR does not.
    void clear_backup_causes() { reg(rmu::RSTCAUSE) &= ~BACKUP; }

    bool lockup_resets() const { return !(reg(rmu::CTRL) & rmu::CTRL_LOCKUPRDIS); }
    // Whether resets reach the backup domain.
    bool backup_domain_resets() const { return reg(rmu::CTRL) & rmu::CTRL_BURSTEN; }

private:
    static constexpr uint32_t BACKUP =
        rmu::RSTCAUSE_BUBODVDDDREG | rmu::RSTCAUSE_BUBODBUVIN | rmu::RSTCAUSE_BUBODUNREG |
        rmu::RSTCAUSE_BUBODREG | rmu::RSTCAUSE_BUMODERST;
};

}  // namespace efm32gg
