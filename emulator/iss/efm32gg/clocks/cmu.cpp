#include "efm32gg/clocks/cmu.h"

#include <cstring>

namespace efm32gg {

using namespace cmu;

// Start-up times without the time-outs of CTRL: data sheet, 3.9, typical.
static constexpr int64_t RC_START = 600 * NANOSECOND, HFXO_START = 400 * MICROSECOND,
                         LFRCO_START = 150 * MICROSECOND, LFXO_START = 400 * MILLISECOND;
// OSCENCMD has enable and disable bits, STATUS enabled and ready bits in the order of Oscillators;
// these flags and select bits have their own.
static constexpr uint32_t READY_FLAGS[] = {IF_HFRCORDY, IF_HFXORDY, IF_AUXHFRCORDY, IF_LFRCORDY,
                                           IF_LFXORDY};
static constexpr uint32_t SELECTED[] = {STATUS_HFRCOSEL, STATUS_HFXOSEL, 0, STATUS_LFRCOSEL,
                                        STATUS_LFXOSEL};
static constexpr uint32_t SYNC_OFFSETS[] = {LFACLKEN0, LFAPRESC0, LFBCLKEN0, LFBPRESC0};
static constexpr uint32_t UNLOCK = 0x580E;

Cmu::Cmu(Part &part, const Instance &instance)
    : Peripheral(part, instance),
      synchronised{
          {part, {this, [](void *self, int64_t) { static_cast<Cmu *>(self)->on_synchronised(0); }}},
          {part, {this, [](void *self, int64_t) { static_cast<Cmu *>(self)->on_synchronised(1); }}}},
      calibrated(Event::of<&Cmu::on_calibrated>(this)) {
    for (int n = 0; n < OSCILLATORS; n++) {
        oscillators[n] = {this, n, false, false,
                          {&oscillators[n], [](void *owner, int64_t) {
                               auto &one = *static_cast<Oscillator *>(owner);
                               one.cmu->on_started(one.number);
                           }}};
    }
}

void Cmu::reset() {
    Peripheral::reset();
    for (Oscillator &one : oscillators) {
        part.cancel(one.started);
        one.enabled = one.ready = one.number == HFRCO;
    }
    for (Synchronizer &one : synchronised)
        one.clear();
    part.cancel(calibrated);
    selected = HFRCO;
    wanted = -1;
    sleeping = 0;
    unsynchronised = 0;
    std::memset(effective, 0, sizeof effective);
}

// -- registers --

uint32_t Cmu::status() const {
    uint32_t bits = SELECTED[selected];
    for (const Oscillator &one : oscillators)
        bits |= ((uint32_t)one.enabled | (uint32_t)one.ready << 1) << 2 * one.number;
    return bits | (calibrated.pending() ? (uint32_t)STATUS_CALBSY : 0) |
           (reg(STATUS) & (STATUS_USBCHFCLKSEL | STATUS_USBCLFXOSEL | STATUS_USBCLFRCOSEL));
}

uint32_t Cmu::peek(uint32_t offset) const {
    switch (offset) {
    case STATUS: return status();
    case SYNCBUSY: {
        uint32_t busy = 0;
        for (int n = 0; n < SYNCED; n++)
            busy |= unsynchronised >> n & 1 ? described(SYNC_OFFSETS[n])->busy : 0;
        return busy;
    }
    default: return Peripheral::peek(offset);
    }
}

bool Cmu::locked_register(uint32_t offset) const {
    return reg(LOCK) && offset < LOCK && !(offset >= IF && offset <= IEN) &&
           !(offset >= SYNCBUSY && offset < LFACLKEN0);
}

void Cmu::write(uint32_t offset, uint32_t value) {
    if (locked_register(offset)) return report_locked();
    switch (offset) {
    case CTRL: case HFCORECLKDIV: case HFPERCLKDIV: case HFRCOCTRL: case LFRCOCTRL:
    case AUXHFRCOCTRL: case LFCLKSEL: case HFCORECLKEN0: case HFPERCLKEN0: case PCNTCTRL:
        if (reg(offset) != value)
            part.change_clocks([&] { store(offset, value); });
        check_limits();
        break;
    case OSCENCMD: command_oscillators(value); break;
    case CMD:
        if (field(value, CMD_HFCLKSEL)) {
            static constexpr int ORDER[] = {-1, HFRCO, HFXO, LFRCO, LFXO, -1, -1, -1};
            select(ORDER[field(value, CMD_HFCLKSEL)]);
        }
        if (value & CMD_CALSTART)
            start_calibration();
        if (value & CMD_CALSTOP)
            part.cancel(calibrated);
        break;
    case LFACLKEN0: case LFAPRESC0: case LFBCLKEN0: case LFBPRESC0:
        store(offset, value);
        for (int n = 0; n < SYNCED; n++)
            if (SYNC_OFFSETS[n] == offset)
                unsynchronised |= 1u << n;
        synchronise();
        break;
    case FREEZE:
        store(offset, value);
        synchronise();
        break;
    case LOCK: lock(LOCK, value, UNLOCK); break;
    default:
        Peripheral::write(offset, value);
    }
}

// -- oscillators --

void Cmu::command_oscillators(uint32_t value) {
    for (int n = 0; n < OSCILLATORS; n++) {
        if (value >> 2 * n & 1) {
            if (!oscillators[n].enabled)
                switch_on(n);
        } else if (value >> (2 * n + 1) & 1) {
            if (n == selected) {
                part.log_once("CMU: the oscillator of HFCLK cannot be switched off");
                continue;
            }
            part.cancel(oscillators[n].started);
            part.change_clocks([&] { oscillators[n].enabled = oscillators[n].ready = false; });
        }
    }
}

void Cmu::switch_on(int number) {
    static constexpr int64_t HF_CYCLES[] = {8, 256, 1024, 16384},
                             LF_CYCLES[] = {8, 1024, 16384, 32768};
    int64_t time = RC_START;
    if (number == HFXO)
        time = HFXO_START + HF_CYCLES[field(reg(CTRL), CTRL_HFXOTIMEOUT)] * SECOND / HFXO_HERTZ;
    if (number == LFXO)
        time = LFXO_START + LF_CYCLES[field(reg(CTRL), CTRL_LFXOTIMEOUT)] * SECOND / LF_HERTZ;
    if (number == LFRCO)
        time = LFRCO_START;
    oscillators[number].enabled = true;
    part.schedule_after(oscillators[number].started, time);
}

void Cmu::on_started(int number) {
    part.change_clocks([&] {
        oscillators[number].ready = true;
        if (wanted == number) {
            selected = number;
            wanted = -1;
        }
    });
    raise(READY_FLAGS[number]);
    check_limits();
}

void Cmu::select(int number) {
    if (number < 0) return;
    const Oscillator &one = oscillators[number];
    if (!one.enabled) {
        part.log_once("CMU: HFCLKSEL selects an oscillator that is off: ignored");
    } else if (!one.ready) {
        // The core stops until the oscillator runs.
        wanted = number;
        part.stop_clock(one.started.time);
    } else {
        part.change_clocks([&] { selected = number; });
        check_limits();
    }
}

bool Cmu::low_frequency_on() const { return oscillators[LFRCO].enabled || oscillators[LFXO].enabled; }

void Cmu::wake() {
    if (sleeping >= 2) {
        for (const int number : {HFXO, AUXHFRCO}) {
            part.cancel(oscillators[number].started);
            oscillators[number].enabled = oscillators[number].ready = false;
        }
        oscillators[HFRCO].enabled = oscillators[HFRCO].ready = true;
        if (selected != LFRCO && selected != LFXO)
            selected = HFRCO;
    }
    sleeping = 0;
}

// -- synchronisation, calibration --

void Cmu::synchronise() {
    for (int domain = 0; domain < 2; domain++) {
        Synchronizer &one = synchronised[domain];
        if (reg(FREEZE) & FREEZE_REGFREEZE) {
            one.clear();
        } else if (unsynchronised >> 2 * domain & 3) {
            const Rate &clock = part.rate(domain ? Clock::LFB : Clock::LFA);
            one.follow(clock);
            one.start(clock);
        }
    }
}

void Cmu::on_synchronised(int domain) {
    synchronised[domain].clear();
    part.change_clocks([&] {
        for (int n = 2 * domain; n < 2 * domain + 2; n++)
            if (unsynchronised >> n & 1)
                effective[n] = reg(SYNC_OFFSETS[n]);
        unsynchronised &= ~(3u << 2 * domain);
    });
}

void Cmu::clocks_changed() { synchronise(); }

// Counts the periods of one clock during CALCNT + 1 periods of the other (11.3.3).
void Cmu::start_calibration() {
    static constexpr Clock UP[] = {Clock::HFXO, Clock::LFXO, Clock::HFRCO, Clock::LFRCO,
                                   Clock::AUXHFRCO},
                           DOWN[] = {Clock::HFCORE, Clock::HFXO, Clock::LFXO, Clock::HFRCO,
                                     Clock::LFRCO, Clock::AUXHFRCO};
    const uint32_t up = field(reg(CALCTRL), CALCTRL_UPSEL);
    const uint32_t down = field(reg(CALCTRL), CALCTRL_DOWNSEL);
    if (up > 4 || down > 5) return;
    calibration_top = reg(CALCNT);
    calibration_began = part.now();
    calibration_up = part.rate(UP[up]);
    const Rate &clock = part.rate(DOWN[down]);
    if (clock.runs())
        part.schedule_after(calibrated, clock.span((int64_t)calibration_top + 1));
}

void Cmu::on_calibrated(int64_t time) {
    const int64_t span = time - calibration_began;
    const int64_t count = calibration_up.runs()
        ? calibration_up.edges(calibration_up.origin + span) : 0;
    if (count > 0xFFFFF)
        raise(IF_CALOF);
    reg(CALCNT) = (uint32_t)(count & 0xFFFFF);
    raise(IF_CALRDY);
    if (reg(CALCTRL) & CALCTRL_CONT) {
        const uint32_t result = reg(CALCNT);
        reg(CALCNT) = calibration_top;
        start_calibration();
        reg(CALCNT) = result;
    }
}

}  // namespace efm32gg
