// The part's time: cycles and picoseconds, events, sleep.
#include "armv7m/core/cpu.h"
#include "efm32gg/clocks/cmu.h"
#include "efm32gg/clocks/emu.h"
#include "efm32gg/part/part.h"

#include <algorithm>
#include <utility>

namespace efm32gg {

int64_t Part::now() const {
    return standing ? standing_now : cycle_time.time(cpu.cycles - base_cycle);
}

int64_t Part::next_event() const {
    int64_t next = events.next_time();
    if (standing && standing_until != NEVER)
        next = std::min(next, standing_until);
    if (!standing && cpu.system->next_cycle() != INT64_MAX)
        next = std::min(next, cycle_time.time(cpu.system->next_cycle() - base_cycle));
    return next;
}

int64_t Part::cycle_at(int64_t time) const {
    return time == NEVER ? INT64_MAX : base_cycle + cycle_time.edge_at_or_after(time);
}

void Part::schedule(Event &event, int64_t time) {
    events.add(event, std::max(time, now()));
    if (!standing && time != NEVER)
        cpu.lower_deadline(cycle_at(time));
}

// From `time` on, cycles are counted at the core's present clock.
void Part::rebase(int64_t time) {
    const Rate &clock = rate(Clock::HFCORE);
    base_cycle = cpu.cycles - std::exchange(owed_cycles, 0);
    standing_now = time;
    standing = !clock.runs();
    standing_until = NEVER;
    cycle_time = clock;
    cycle_time.origin = time;
    // The deadline was in cycles of the previous clock.
    cpu.set_deadline(cpu.cycles);
}

void Part::stop_clock(int64_t until) {
    standing_now = now();
    standing = true;
    standing_until = until;
    cpu.stop();
}

void Part::stall(int64_t until) {
    stalled_until = std::max(stalled_until, until);
    cpu.stop();
}

// Time passes without instructions.
void Part::advance(int64_t time) {
    if (standing) {
        standing_now = std::max(standing_now, std::min(time, standing_until));
        if (standing_now >= standing_until)
            rebase(standing_now);
    } else {
        cpu.cycles = std::max(cpu.cycles, cycle_at(time));
    }
}

void Part::perform_due(int64_t &steps) {
    while (!wanted_reset && events.next_time() <= now() && steps > 0) {
        events.perform();
        steps--;
    }
}

// Bounds of the work of one run, about a hundredth of a second of wall time: the caller may then
// handle an interrupt, and continues.
static constexpr int64_t MOST_INSTRUCTIONS = 1 << 19, MOST_STEPS = 1 << 14, MOST_CHANGES = 1 << 10;

int64_t Part::run(int64_t until) {
    exits = 0;
    stop_wanted = false;
    const uint64_t last_instruction = cpu.instructions + MOST_INSTRUCTIONS;
    cpu.most_changes = cpu.changes + MOST_CHANGES;
    const int64_t began = now();
    int64_t steps = MOST_STEPS;
    for (;;) {
        perform_due(steps);
        if (steps-- <= 0 || cpu.instructions >= last_instruction ||
            cpu.changes >= cpu.most_changes) {
            if (now() == began)
                log_once("events of the peripherals follow each other without time passing");
            exits |= armv7m::ExitDeadline;
            break;
        }
        if (wanted_reset) {
            perform_reset();
            exits |= ExitOutbox;
            break;
        }
        if (stop_wanted || now() >= until) {
            exits |= stop_wanted ? ExitOutbox : (uint32_t)armv7m::ExitDeadline;
            break;
        }
        if (calling) {
            exits |= ExitOutbox;
            break;
        }
        const int64_t next = std::min(until, events.next_time());
        if (hung) {
            if (next == NEVER) break;
            advance(next);
        } else if (asleep) {
            if (wait_for_wake(next)) break;
        } else if (standing) {
            if (std::min(next, standing_until) == NEVER) break;
            advance(std::min(next, standing_until));
        } else if (stalled_until > now()) {
            advance(std::min(next, stalled_until));
        } else {
            cpu.set_deadline(std::min(cycle_at(next), cpu.cycles + MOST_INSTRUCTIONS));
            const uint32_t ended = cpu.run();
            if (ended & armv7m::ExitLockup && std::exchange(locked, true) && next != NEVER) {
                advance(next);
                continue;
            }
            exits = ended & ~(uint32_t)(armv7m::ExitDeadline | armv7m::ExitStop |
                                        armv7m::ExitSleep);
            if (ended & armv7m::ExitSleep) {
                fall_asleep();
                exits |= ExitAsleep;
            }
            // Report a lock-up before the reset that it causes.
            if (exits && (!wanted_reset || exits & armv7m::ExitLockup)) break;
            if (cpu.system->stopped_by() != armv7m::System::DebugStop::None) break;
        }
    }
    return now();
}

void Part::fall_asleep() {
    mode = emu->sleeping_mode(cpu.system->deep_sleep());
    asleep = true;
    change_clocks([this] { cmu->sleep(mode); });
    send(Kind::SLEEP, 0, mode, 0, false);
}

// Time from EM2 or EM3 to the first instruction; data sheet, t_EM20.
static constexpr int64_t WAKE_UP = 2 * MICROSECOND;

// `before`: Cpu::cycles before System::service() woke it.
void Part::wake(int64_t before) {
    const int64_t time = now();
    const bool deep = mode > 1;
    asleep = false;
    mode = 0;
    change_clocks([this] { cmu->wake(); });
    if (deep) {
        owed_cycles = cpu.cycles - before;
        standing = true;
        standing_now = time;
        standing_until = time + WAKE_UP;
    }
    send(Kind::SLEEP, 0, 0, 0, false);
}

// Returns true when the run ends: the core woke, or nothing will ever happen.
bool Part::wait_for_wake(int64_t until) {
    if (mode < 4) {
        const int64_t before = cpu.cycles;
        cpu.system->service();
        if (cpu.system->sleep() == armv7m::Sleep::Awake) {
            wake(before);
            exits |= ExitAwake;
            return true;
        }
    }
    int64_t next = until;
    const int64_t tick = cpu.system->next_cycle();
    if (!standing && tick != INT64_MAX)
        next = std::min(next, cycle_time.time(tick - base_cycle));
    if (next == NEVER) return true;
    advance(next);
    return false;
}

void Part::enter_em4() {
    mode = 4;
    asleep = true;
    change_clocks([this] { cmu->sleep(4); });
    send(Kind::SLEEP, 0, 4, emu->in_backup());
}

}  // namespace efm32gg
