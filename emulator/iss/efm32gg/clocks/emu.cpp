// The backup supply. EFM32GG Reference Manual, 10.3.4; application note AN0041.
//
// When the main supply falls, the part goes to EM4 on the supply at BU_VIN: BURTC and the retention
// registers continue if EM4CONF.VREGEN is set, and all else is lost. When the main supply is back,
// the part resets. Supplies are analog inputs: a main supply that never was above the threshold
// does not fall. Not modelled: calibration of the thresholds, switches between the supplies, BU_VOUT.
#include "efm32gg/clocks/emu.h"

#include "efm32gg/pins/gpio.h"

namespace efm32gg {

using namespace emu;

namespace {

// Brown-out of the main supply: data sheet, 3.5, V_BODEXTTHR, typical; the same in both directions.
constexpr double MAIN_THRESHOLD = 1.85;
// Lowest backup supply: data sheet, 3.3, V_SUPPLY.
constexpr double BACKUP_MINIMUM = 1.8;
// Until BURDY, assumed: a period of ULFRCO.
constexpr int64_t BECOMES_READY = MILLISECOND;
constexpr int STATUS_PIN = 4 * 16 + 3;  // BU_STAT

}  // namespace

void Emu::reset() {
    // EM4CONF survives all but a power-on reset once it is locked (10.5.5).
    const uint32_t kept = reg(EM4CONF);
    Peripheral::reset();
    if (kept & EM4CONF_LOCKCONF && !(part.reset_cause & rmu::RSTCAUSE_PORST))
        reg(EM4CONF) = kept;
    em4_steps = 0;
    part.cancel(ready);
    on_backup = false;
    main_before = part.volts(analog::VDD);
}

void Emu::prepare_backup() {
    const bool wanted = reg(BUCTRL) & BUCTRL_EN && reg(ROUTE) & ROUTE_BUVINPEN;
    if (!wanted) {
        part.cancel(ready);
        reg(STATUS) &= ~STATUS_BURDY;
    } else if (!ready.pending() && !(reg(STATUS) & STATUS_BURDY)) {
        part.schedule_after(ready, BECOMES_READY);
    }
    part.gpio->function(STATUS_PIN, this, reg(BUCTRL) & BUCTRL_STATEN, false);
}

void Emu::on_ready(int64_t) {
    reg(STATUS) |= STATUS_BURDY;
    raise(IF_BURDY);
}

void Emu::sleep_in_em4() {
    if (!(reg(EM4CONF) & EM4CONF_VREGEN))
        part.backup_lost = true;
    part.enter_em4();
}

void Emu::analog_changed() {
    const double main = part.volts(analog::VDD), backup = part.volts(analog::BACKUP_SUPPLY);
    const bool fell = main_before >= MAIN_THRESHOLD && main < MAIN_THRESHOLD;
    main_before = main;
    if (on_backup) {
        if (backup < BACKUP_MINIMUM)
            part.backup_lost = true;
        if (main >= MAIN_THRESHOLD)
            part.request_reset(part.backup_lost ? rmu::RSTCAUSE_PORST : rmu::RSTCAUSE_BUMODERST);
    } else if (fell && reg(STATUS) & STATUS_BURDY && backup >= BACKUP_MINIMUM) {
        on_backup = true;
        if (reg(BUCTRL) & BUCTRL_STATEN)
            part.gpio->function(STATUS_PIN, this, true, true);
        sleep_in_em4();
    }
}

}  // namespace efm32gg
