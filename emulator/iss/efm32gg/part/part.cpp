#include "efm32gg/part/part.h"

#include "armv7m/core/cpu.h"
#include "efm32gg/clocks/cmu.h"
#include "efm32gg/clocks/rmu.h"
#include "efm32gg/memory/msc.h"

#include <algorithm>
#include <cstdarg>
#include <cstring>
#include <utility>

namespace efm32gg {

armv7m::SystemParameters Part::system_parameters() {
    armv7m::SystemParameters parameters;
    parameters.interrupts = 39;
    parameters.priority_bits = 3;
    return parameters;
}

Part::Part(armv7m::Cpu &cpu, const Memories &memories)
    : cpu(cpu), memories(memories), own_information(memories.information ? 0 : 3 * PAGE_BYTES, 0xFF),
      information(memories.information ? memories.information : own_information.data()) {
    for (int n = 0; n < instance::DEVINFO.layout->count; n++) {
        const Register &word = instance::DEVINFO.layout->registers[n];
        const uint32_t at = 2 * PAGE_BYTES + instance::DEVINFO.base - INFORMATION + word.offset;
        std::memcpy(information + at, &word.reset, 4);
    }
    add_units();
    armv7m::Region flash, ram;
    flash.size = memories.flash_size, flash.host = memories.flash, flash.writable = false;
    ram.size = memories.ram_size, ram.host = memories.ram, ram.base = RAM;
    cpu.add_region(flash);
    cpu.add_region(ram);
    ram.base = RAM_CODE;
    cpu.add_region(ram);
    reset(rmu::RSTCAUSE_PORST);
}

Part::~Part() = default;

void Part::place(Peripheral &unit) {
    if (unit.instance.base < PERIPHERALS) return;
    const uint32_t first = (unit.instance.base - PERIPHERALS) / SLOT;
    for (uint32_t n = 0; n < (unit.layout.size + SLOT - 1) / SLOT && first + n < SLOTS; n++)
        slots[first + n] = &unit;
}

// -- clocks -----------------------------------------------------------------------------------

void Part::clocks_set() {
    Rates wanted;
    cmu->rates(wanted, now());
    for (int n = 0; n < CLOCKS; n++)
        if (!rates[n].same_frequency(wanted[n]))
            rates[n] = wanted[n];
    const bool starting = standing && standing_until != NEVER;
    if (!starting && !cycle_time.same_frequency(rate(Clock::HFCORE)))
        rebase(now());
    set_bus_waits();
    msc->check_wait_states();
}

Rate Part::unit_rate(const Instance &instance) const { return cmu->unit_rate(instance); }
bool Part::enabled(const Instance &instance) const { return cmu->enabled(instance); }

// -- interrupts and resets ------------------------------------------------------------------------

void Part::irq(int number, bool level) { cpu.system->set_interrupt_line(number, level); }

void Part::request_reset(uint32_t cause) {
    wanted_reset |= cause;
    stop_wanted = true;
    cpu.stop();
}

void Part::reset(uint32_t cause) {
    wanted_reset |= cause;
    perform_reset();
}

// Time from a reset to the first instruction: data sheet, 3.6, t_RESET.
static constexpr int64_t START_UP = 163 * MICROSECOND;

void Part::perform_reset() {
    reset_cause = std::exchange(wanted_reset, 0);
    const uint32_t cold = rmu::RSTCAUSE_PORST | rmu::RSTCAUSE_BODUNREGRST |
                          rmu::RSTCAUSE_BODREGRST | rmu::RSTCAUSE_BUMODERST;
    const int64_t time = now();
    each([](Peripheral &one) { one.clocks_changing(); });
    asleep = locked = hung = calling = false;
    mode = 0;
    stalled_until = owed_cycles = 0;
    rmu->caused(reset_cause);
    each([](Peripheral &one) { one.reset(); });
    backup_lost = false;
    standing = false;
    standing_now = time;
    Rates wanted;
    cmu->rates(wanted, time);
    std::copy(std::begin(wanted), std::end(wanted), std::begin(rates));
    rebase(time);
    set_bus_waits();
    msc->check_wait_states();
    each([](Peripheral &one) { one.clocks_changed(); });
    cpu.reset();
    cpu.system->reset((reset_cause & cold) != 0);
    stop_clock(time + START_UP);
    Outgoing &message = send(Kind::RESET, 0, reset_cause);
    if (reset_cause & rmu::RSTCAUSE_WDOGRST)
        std::snprintf(message.text, sizeof message.text, "watchdog reset");
}

void Part::reset_requested() { request_reset(rmu::RSTCAUSE_SYSREQRST); }

void Part::locked_up() {
    if (rmu->lockup_resets())
        request_reset(rmu::RSTCAUSE_LOCKUPRST);
    else
        cpu.stop();
}

// -- outside ----------------------------------------------------------------------------------

Outgoing &Part::send(Kind kind, int unit, int64_t value, int64_t extra, bool stop) {
    if (stop) {
        stop_wanted = true;
        cpu.stop();
    }
    return outbox.add(kind, unit, value, extra, now());
}

void Part::log_once(const char *format, ...) {
    char text[sizeof Outgoing::text];
    va_list arguments;
    va_start(arguments, format);
    std::vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (logged.size() < 1000 && logged.insert(text).second)
        std::memcpy(send(Kind::LOG, 0, 0, 0, false).text, text, sizeof text);
}

void Part::analog_changed() {
    each([](Peripheral &one) { one.analog_changed(); });
}

void Part::itm(int port, uint32_t value, int bytes) {
    send(Kind::ITM, port, value, bytes, false);
    if (outbox.count > Outbox::CAPACITY / 2)
        stop_wanted = true, cpu.stop();
}

bool Part::semihosting(uint32_t operation, uint32_t parameter) {
    send(Kind::SEMIHOSTING, (int)operation, parameter);
    return calling = true;
}

void Part::answer_call(uint32_t result) {
    if (std::exchange(calling, false))
        cpu.r[0] = result;
}

}  // namespace efm32gg
