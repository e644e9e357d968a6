// A core and its system with plain memory around them, for tests from Python: code at 0, RAM at
// 0x20000000, a log at 0x40001000, and interrupt lines at 0x40002000 that programs can set. Events
// at chosen cycles pull lines; all else is a bus error.

#include "armv7m/core/cpu.h"
#include "armv7m/system/system.h"

#include <algorithm>
#include <string>
#include <vector>

using namespace armv7m;

namespace {

constexpr uint32_t CODE_SIZE = 1 << 16, RAM_BASE = 0x20000000, RAM_SIZE = 1 << 16;
constexpr uint32_t LOG = 0x40001000, LINES = 0x40002000;

enum EventKind : int32_t { LineHigh, LineLow, Pulse, Nmi };

struct BenchEvent {
    int64_t cycle;
    int32_t kind, number;
};

struct LogEntry {
    int64_t cycle;
    uint32_t value, exception;
};

struct Bench : Bus, SystemListener {
    std::vector<uint8_t> code, ram;
    Cpu cpu;
    System system;
    std::vector<BenchEvent> events;    // the latest first
    std::vector<LogEntry> log;
    std::string text;
    int32_t resets = 0;

    explicit Bench(const SystemParameters &parameters)
        : code(CODE_SIZE), ram(RAM_SIZE), cpu(*this), system(cpu, parameters, *this) {
        cpu.system = &system;
        Region flash, memory;
        flash.base = 0, flash.size = CODE_SIZE, flash.host = code.data(), flash.writable = false;
        memory.base = RAM_BASE, memory.size = RAM_SIZE, memory.host = ram.data();
        cpu.add_region(flash), cpu.add_region(memory);
    }

    bool read(uint32_t, uint32_t, uint32_t &value) override {
        value = 0;
        return false;
    }

    bool write(uint32_t address, uint32_t, uint32_t value) override {
        if (address == LOG)
            log.push_back({cpu.cycles, value, cpu.ipsr});
        else if (address >= LINES && address < LINES + 4 * 240)
            system.set_interrupt_line((int)(address - LINES) / 4, value != 0);
        else
            return false;
        return true;
    }

    void fire() {
        while (!events.empty() && events.back().cycle <= cpu.cycles) {
            const BenchEvent event = events.back();
            events.pop_back();
            switch (event.kind) {
            case LineHigh: system.set_interrupt_line(event.number, true); break;
            case LineLow: system.set_interrupt_line(event.number, false); break;
            case Pulse: system.pend_interrupt(event.number); break;
            case Nmi: system.pend_nmi(); break;
            }
        }
    }

    int64_t next_event() const { return events.empty() ? INT64_MAX : events.back().cycle; }

    void catch_up() override { fire(); }
    void reset_requested() override { resets++; }
    void itm(int port, uint32_t value, int bytes) override {
        text += "<" + std::to_string(port) + ":" + std::to_string(value) + "/" +
                std::to_string(bytes) + ">";
    }

    uint32_t run(int64_t until) {
        for (;;) {
            fire();
            cpu.set_deadline(std::min(until, next_event()));
            const uint32_t exits = cpu.run();
            if (exits & ~(ExitDeadline | ExitSleep)) return exits;
            if ((exits & ExitSleep) && !system.wakes()) {
                const int64_t wake = std::min(system.next_cycle(), next_event());
                cpu.cycles = std::max(cpu.cycles, std::min(wake, until));
            }
            if (cpu.cycles >= until) return exits;
        }
    }
};

}  // namespace

extern "C" {

Bench *bench_new(int32_t interrupts, int32_t priority_bits, int64_t cycles, int64_t ticks) {
    SystemParameters parameters;
    parameters.interrupts = interrupts, parameters.priority_bits = priority_bits;
    parameters.trace_probe = false;
    parameters.reference_cycles = cycles, parameters.reference_ticks = ticks;
    return new Bench(parameters);
}

void bench_delete(Bench *bench) { delete bench; }

void bench_reset(Bench *bench, int32_t power_on) {
    bench->cpu.invalidate(0, CODE_SIZE);
    bench->cpu.invalidate(RAM_BASE, RAM_SIZE);
    bench->system.reset(power_on);
}

uint8_t *bench_code(Bench *bench) { return bench->code.data(); }
uint8_t *bench_ram(Bench *bench) { return bench->ram.data(); }
uint32_t bench_run(Bench *bench, int64_t until) { return bench->run(until); }

void bench_at(Bench *bench, int64_t cycle, int32_t kind, int32_t number) {
    bench->events.push_back({cycle, kind, number});
    std::stable_sort(bench->events.begin(), bench->events.end(),
                     [](const BenchEvent &a, const BenchEvent &b) { return a.cycle > b.cycle; });
}

uint32_t bench_get(Bench *bench, int32_t which) {
    switch (which) {
    case 23: return (uint32_t)bench->system.sleep();
    case 24: return bench->system.locked_up();
    case 25: return (uint32_t)bench->system.execution_priority();
    case 26: return (uint32_t)bench->resets;
    case 27: return (uint32_t)bench->system.stopped_by();
    default: return bench->cpu.debug_register(which);
    }
}

void bench_set(Bench *bench, int32_t which, uint32_t value) {
    bench->cpu.set_debug_register(which, value);
}

int64_t bench_cycles(Bench *bench) { return bench->cpu.cycles; }
void bench_set_cycles(Bench *bench, int64_t cycles) { bench->cpu.cycles = cycles; }
int64_t bench_next_cycle(Bench *bench) { return bench->system.next_cycle(); }
void bench_service(Bench *bench) { bench->system.service(); }
void bench_return(Bench *bench, uint32_t value) { bench->system.exception_return(value); }
void bench_line(Bench *bench, int32_t number, int32_t level) {
    bench->system.set_interrupt_line(number, level);
}
void bench_debugger(Bench *bench, int32_t attached, uint32_t catches) {
    bench->system.set_debugger(attached, catches);
}

int32_t bench_read(Bench *bench, uint32_t address, int32_t size, uint32_t *value) {
    return bench->system.read(address, size, *value);
}
int32_t bench_write(Bench *bench, uint32_t address, int32_t size, uint32_t value) {
    return bench->system.write(address, size, value);
}
uint32_t bench_peek(Bench *bench, uint32_t address) { return bench->system.peek(address); }

int32_t bench_log(Bench *bench, LogEntry *entries, int32_t most) {
    const int32_t count = std::min((int32_t)bench->log.size(), most);
    std::copy_n(bench->log.begin(), count, entries);
    return count;
}

const char *bench_text(Bench *bench) { return bench->text.c_str(); }

void bench_fault(Bench *bench, FaultRecord *record) { *record = bench->system.last_fault(); }

}  // extern "C"
