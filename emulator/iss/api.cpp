// The C interface of a machine, called by machine.py. Nothing here throws; times are picoseconds.
//
// A machine is a core with a part around it. A bare machine has memories only, for tests of the
// core.

#include "api.h"

#include "armv7m/core/cpu.h"
#include "armv7m/system/system.h"
#include "efm32gg/analog/dac.h"
#include "efm32gg/memory/msc.h"
#include "efm32gg/part/part.h"
#include "efm32gg/pins/gpio.h"
#include "efm32gg/serial/i2c.h"
#include "fpga_link.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <new>

using armv7m::Cpu;
using armv7m::System;
using efm32gg::I2c;
using efm32gg::Part;

// Why a run ended; StopReason in outcome.py has the same order.
enum StopReason : int32_t {
    STOP_TIME,        // the requested time is reached
    STOP_OUTBOX,      // there are messages in the outbox
    STOP_ASLEEP,      // the core fell asleep
    STOP_AWAKE,       // the core woke
    STOP_BREAKPOINT,  // before the instruction at a breakpoint
    STOP_WATCHPOINT,  // before the instruction that makes the access
    STOP_STEPPED,     // after one instruction
    STOP_HALTED,      // BKPT with a debugger, at that instruction
    STOP_LOCKED_UP,   // the core is locked up until a reset
    STOP_FAULT,       // vector catch: at the first instruction of a handler
};

// The surroundings of a bare core: every access fails.
struct BareBus : armv7m::Bus, armv7m::SystemListener {
    bool read(uint32_t, uint32_t, uint32_t &) override { return false; }
    bool write(uint32_t, uint32_t, uint32_t) override { return false; }
};

struct IssMachine {
    // The core holds references to bus and listener, and the part's constructor uses the core: so
    // the part's storage is allocated first and constructed last.
    IssMachine(const efm32gg::Memories &memories, bool bare, int64_t hz)
        : hz(hz), bus(bare ? new BareBus : nullptr),
          part(bare ? nullptr : (Part *)::operator new(sizeof(Part))),
          cpu(bare ? static_cast<armv7m::Bus &>(*bus) : static_cast<armv7m::Bus &>(*part)),
          system(cpu, bare ? armv7m::SystemParameters{} : Part::system_parameters(),
                 bare ? static_cast<armv7m::SystemListener &>(*bus)
                      : static_cast<armv7m::SystemListener &>(*part)) {
        cpu.system = &system;
        if (part) {
            new (part) Part(cpu, memories);
            return;
        }
        armv7m::Region flash, ram;
        flash.size = memories.flash_size, flash.host = memories.flash, flash.writable = false;
        ram.base = Part::RAM, ram.size = memories.ram_size, ram.host = memories.ram;
        cpu.add_region(flash);
        cpu.add_region(ram);
    }
    ~IssMachine() {
        link.reset();
        if (part) {
            part->~Part();
            ::operator delete(part);
        }
    }

    int64_t now() const {
        return part ? part->now() : (int64_t)((__int128)cpu.cycles * efm32gg::SECOND / hz);
    }

    uint32_t run(int64_t until) {
        if (part) {
            part->run(until);
            return part->exits;
        }
        // The first cycle that begins at `until` or later.
        const __int128 cycle = ((__int128)until * hz + efm32gg::SECOND - 1) / efm32gg::SECOND;
        cpu.set_deadline((int64_t)std::min<__int128>(cycle, INT64_MAX));
        return cpu.run();
    }

    int64_t hz;
    std::unique_ptr<BareBus> bus;
    Part *part;
    Cpu cpu;
    System system;
    std::unique_ptr<FpgaLink> link;
    std::vector<armv7m::Watch> watches;
    bool was_asleep = false;
};

static StopReason reason_of(IssMachine &machine, uint32_t exits) {
    const bool asleep = machine.system.sleep() != armv7m::Sleep::Awake;
    const bool changed = asleep != machine.was_asleep;
    machine.was_asleep = asleep;
    if (exits & armv7m::ExitBreakpoint) return STOP_BREAKPOINT;
    if (exits & armv7m::ExitWatchpoint) return STOP_WATCHPOINT;
    if (exits & armv7m::ExitStep) return STOP_STEPPED;
    const auto stopped_by = machine.system.stopped_by();
    machine.system.clear_debug_stop();
    if (stopped_by == System::DebugStop::Breakpoint) return STOP_HALTED;
    if (stopped_by == System::DebugStop::VectorCatch) return STOP_FAULT;
    if (exits & armv7m::ExitLockup) return STOP_LOCKED_UP;
    if (machine.part && machine.part->outbox.count) return STOP_OUTBOX;
    if (changed) return asleep ? STOP_ASLEEP : STOP_AWAKE;
    return STOP_TIME;
}

extern "C" {

// The caller owns the memories, which must outlive the machine; sizes in bytes, powers of two.
// `analog`: volts by channel. `bare`: no part, flash at 0, RAM at 0x20000000, a core clock of `hz`.
IssMachine *iss_new(uint8_t *flash, int64_t flash_bytes, uint8_t *ram, int64_t ram_bytes,
                    uint8_t *external, int64_t external_bytes, uint8_t *information,
                    const double *analog, int32_t bare, int64_t hz) {
    efm32gg::Memories memories{};
    memories.flash = flash, memories.flash_size = (uint32_t)flash_bytes;
    memories.ram = ram, memories.ram_size = (uint32_t)ram_bytes;
    memories.external = external, memories.external_size = (uint32_t)external_bytes;
    memories.information = information;
    memories.analog = analog;
    return new IssMachine(memories, bare != 0, hz);
}

void iss_delete(IssMachine *machine) { delete machine; }

void iss_reset(IssMachine *machine, int32_t cause) {
    if (machine->part) {
        machine->part->reset((uint32_t)cause);
        return;
    }
    machine->cpu.reset();
    machine->system.reset(cause & 1);
}

// Returns the StopReason, plus 256 if there are messages in the outbox; `reached` is the time.
int32_t iss_run(IssMachine *machine, int64_t until_ps, int64_t *reached) {
    const int32_t reason = reason_of(*machine, machine->run(until_ps));
    *reached = machine->now();
    return reason | (machine->part && machine->part->outbox.count ? 256 : 0);
}

// Runs one instruction, or more while the next one lies in [low, high).
int32_t iss_step(IssMachine *machine, int64_t until_ps, uint32_t low, uint32_t high,
                 int64_t *reached) {
    machine->cpu.steps(1, low, high);
    const int32_t reason = iss_run(machine, until_ps, reached);
    machine->cpu.steps(0);
    return reason;
}

int64_t iss_now(const IssMachine *machine) { return machine->now(); }
int64_t iss_cycles(const IssMachine *machine) { return machine->cpu.cycles; }
int64_t iss_instructions(const IssMachine *machine) { return (int64_t)machine->cpu.instructions; }

// NEVER (INT64_MAX) if there is none.
int64_t iss_next_event(const IssMachine *machine) {
    return machine->part ? machine->part->next_event() : efm32gg::NEVER;
}

// 0: awake, else 1 + energy mode.
int32_t iss_asleep(const IssMachine *machine) {
    // The core is awake when a register brings the part to EM4.
    if (machine->system.sleep() == armv7m::Sleep::Awake)
        return machine->part && machine->part->mode == 4 ? 5 : 0;
    return machine->part ? 1 + machine->part->mode : 1;
}

// Clock of the core now.
int64_t iss_hz(const IssMachine *machine) {
    return machine->part ? machine->part->hertz(efm32gg::Clock::HFCORE) : machine->hz;
}

// Moves up to `count` messages to `out`; returns their number.
int64_t iss_take(IssMachine *machine, efm32gg::Outgoing *out, int64_t count) {
    if (!machine->part) return 0;
    efm32gg::Outbox &box = machine->part->outbox;
    const int32_t taken = (int32_t)std::min<int64_t>(count, box.count);
    std::copy(box.items, box.items + taken, out);
    std::copy(box.items + taken, box.items + box.count, box.items);
    box.count -= taken;
    return taken;
}

uint32_t iss_register(const IssMachine *machine, int32_t number) {
    return machine->cpu.debug_register(number);
}

void iss_set_register(IssMachine *machine, int32_t number, uint32_t value) {
    machine->cpu.set_debug_register(number, value);
}

// As a debugger: without side effects. Returns the number of bytes read.
int64_t iss_peek(IssMachine *machine, uint32_t address, uint8_t *out, int64_t count) {
    if (machine->link)
        machine->link->show();
    for (int64_t n = 0; n < count; n++) {
        // Registers of peripherals can only be read as words.
        const uint32_t at = address + (uint32_t)n;
        uint32_t value;
        if (!machine->cpu.peek(at & ~3u, 4, value)) return n;
        out[n] = (uint8_t)(value >> 8 * (at & 3));
    }
    return count;
}

// As a debugger, into flash too. Returns the number of bytes written.
int64_t iss_poke(IssMachine *machine, uint32_t address, const uint8_t *data, int64_t count) {
    int64_t n = 0;
    while (n < count) {
        const uint32_t at = address + (uint32_t)n;
        const int size = at % 4 == 0 && count - n >= 4 ? 4 : 1;
        uint32_t value = 0;
        std::memcpy(&value, data + n, (size_t)size);
        if (!machine->cpu.poke(at, (uint32_t)size, value)) break;
        n += size;
    }
    return n;
}

// Bus accesses of 1, 2 or 4 bytes, with side effects; false: bus fault.
int32_t iss_load(IssMachine *machine, uint32_t address, int32_t bytes, uint32_t *value) {
    return machine->cpu.load(address, (uint32_t)bytes, *value) == armv7m::Result::Done;
}

int32_t iss_store(IssMachine *machine, uint32_t address, int32_t bytes, uint32_t value) {
    return machine->cpu.store(address, (uint32_t)bytes, value) == armv7m::Result::Done;
}

// Whether changes of the flash are logged from now on.
void iss_flash_log(IssMachine *machine, int32_t on) {
    if (machine->part)
        machine->part->msc->cells.logging = on != 0;
}

// Moves the oldest changes, up to `count`, to `out`; returns their number.
int64_t iss_flash_changes(IssMachine *machine, efm32gg::FlashChange *out, int64_t count) {
    if (!machine->part) return 0;
    auto &log = machine->part->msc->cells.log;
    const auto end = log.begin() + std::min<int64_t>(count, (int64_t)log.size());
    const int64_t taken = std::copy(log.begin(), end, out) - out;
    log.erase(log.begin(), end);
    return taken;
}

// The bits in `mask` of a word in flash keep their value for good.
void iss_flash_wear(IssMachine *machine, uint32_t address, uint32_t mask) {
    if (machine->part)
        machine->part->msc->cells.wear_out(address, mask);
}

void iss_invalidate(IssMachine *machine, uint32_t address, int64_t count) {
    machine->cpu.invalidate(address, (uint32_t)count);
}

// Level -1 releases the pin.
void iss_pin(IssMachine *machine, int32_t port, int32_t bit, int32_t level) {
    if (machine->part)
        machine->part->gpio->drive_from_outside(port, bit, level);
}

int32_t iss_pin_level(const IssMachine *machine, int32_t port, int32_t bit) {
    if (machine->link)
        machine->link->show();
    return machine->part ? machine->part->gpio->level(port, bit) : 0;
}

// Volts that the DAC drives at a pin; NaN if it does not.
double iss_pin_volts(const IssMachine *machine, int32_t port, int32_t bit) {
    return machine->part ? machine->part->dac->pin_volts(port * 16 + bit) : std::nan("");
}

void iss_uart_receive(IssMachine *machine, int32_t unit, uint32_t data, uint32_t flags) {
    if (machine->part)
        machine->part->uart_receive(unit, data, flags);
}

static I2c *i2c_of(IssMachine *machine, int32_t unit) {
    return machine->part ? machine->part->i2c_unit(unit) : nullptr;
}

// `what`: 0 start, 1 write, 2 read (`byte`: whether the last one was acknowledged), 3 stop, 4 poll.
// Returns what I2c's slave functions return; without a unit nothing is acknowledged.
int32_t iss_i2c_slave(IssMachine *machine, int32_t unit, int32_t what, int32_t byte) {
    I2c *slave = i2c_of(machine, unit);
    if (!slave) return what == 2 ? 0xFF : 0;
    switch (what) {
    case 0: return slave->slave_start((uint32_t)byte);
    case 1: return slave->slave_write((uint32_t)byte);
    case 2: return slave->slave_read(byte);
    case 3: return slave->slave_stop(), 0;
    default: return slave->slave_poll();
    }
}

void iss_i2c_answer(IssMachine *machine, int32_t unit, int32_t acknowledged, int32_t data) {
    if (I2c *master = i2c_of(machine, unit))
        master->answer(acknowledged, (uint32_t)data);
}

void iss_analog_changed(IssMachine *machine) {
    if (machine->part)
        machine->part->analog_changed();
}

void iss_breakpoint(IssMachine *machine, uint32_t address, int32_t on) {
    if (on)
        machine->cpu.set_breakpoint(address);
    else
        machine->cpu.clear_breakpoint(address);
}

void iss_watchpoint(IssMachine *machine, uint32_t address, uint32_t count, int32_t kind,
                    int32_t on) {
    const armv7m::Watch watch{address, count, (kind & 1) != 0, (kind & 2) != 0};
    auto &all = machine->watches;
    const auto found = std::find_if(all.begin(), all.end(), [&](const armv7m::Watch &other) {
        return other.address == watch.address && other.size == watch.size &&
               other.on_read == watch.on_read && other.on_write == watch.on_write;
    });
    if (on && found == all.end())
        all.push_back(watch);
    else if (!on && found != all.end())
        all.erase(found);
    machine->cpu.set_watches(all);
}

// The access that hit: pc, address, size, value, write.
void iss_watch_hit(const IssMachine *machine, uint32_t *hit) {
    const auto &found = machine->cpu.watch_hit;
    hit[0] = found.pc, hit[1] = found.address, hit[2] = found.size, hit[3] = found.value;
    hit[4] = found.write;
}

// Whether BKPT 0xAB is a semihosting call or an ordinary breakpoint.
void iss_semihosting(IssMachine *machine, int32_t on) { machine->system.set_semihosting(on); }

void iss_semihosting_answer(IssMachine *machine, uint32_t result) {
    if (machine->part)
        machine->part->answer_call(result);
}

// With a debugger attached BKPT stops, and so do the exceptions in `catches` (DEMCR.VC_*).
void iss_debugger(IssMachine *machine, int32_t attached, uint32_t catches) {
    machine->system.set_debugger(attached != 0, catches);
}

// The core executes nothing until a reset; time passes.
void iss_hang(IssMachine *machine) {
    if (machine->part)
        machine->part->hung = true;
}

// Called during a run: it ends after the running instruction.
void iss_stop(IssMachine *machine) { machine->cpu.stop(); }

void iss_fpga(IssMachine *machine, const FpgaDriver *driver, const FpgaWire *wires,
              int32_t count) {
    if (!machine->part) return;
    machine->link = std::make_unique<FpgaLink>(*machine->part, *driver, wires, count);
    machine->part->attached = machine->link.get();
}

void iss_fpga_running(IssMachine *machine, uint32_t running) {
    if (machine->link)
        machine->link->set_running(running);
}

}  // extern "C"

Cpu *iss_cpu(IssMachine *machine) { return &machine->cpu; }
System *iss_system(IssMachine *machine) { return &machine->system; }
