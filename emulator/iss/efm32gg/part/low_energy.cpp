#include "efm32gg/part/low_energy.h"

#include <algorithm>
#include <utility>

namespace efm32gg {

void LowEnergy::reset() {
    Peripheral::reset();
    part.cancel(synchronized);
    count = 0;
}

void LowEnergy::write(uint32_t offset, uint32_t value) {
    const Register *written = described(offset);
    if (!written || !written->busy) {
        const bool was_frozen = frozen();
        Peripheral::write(offset, value);
        if ((int32_t)offset == layout.freeze && was_frozen && !(value & 1))
            start();
        return;
    }
    reg((uint32_t)layout.syncbusy) |= written->busy;
    const bool at_once = immediate() && !frozen();
    Write *place = waiting;
    while (place < waiting + count && place->offset != offset)
        place++;
    if (place == waiting + MOST) return;
    if (place == waiting + count) {
        *place = {offset, 0, false};
        count++;
    }
    // A newer value replaces the older one; commands are merged.
    const bool merges = (int32_t)offset == layout.cmd && !place->applied;
    *place = {offset, merges ? merge_commands(place->value, value) : value, at_once};
    if (at_once)
        apply(offset, value);
    start();
}

// A write takes two to three clocks.
void LowEnergy::start() {
    const Rate rate = synchronizer();
    if (count && !synchronized.pending() && !frozen() && rate.runs())
        part.schedule(synchronized, rate.time(rate.edges(part.now()) + 3));
}

void LowEnergy::on_synchronized(int64_t) {
    Write done[MOST];
    const int number = std::exchange(count, 0);
    std::copy(waiting, waiting + number, done);
    reg((uint32_t)layout.syncbusy) = 0;
    for (int n = 0; n < number; n++)
        if (!done[n].applied)
            apply(done[n].offset, done[n].value);
}

void LowEnergy::clocks_changed() {
    part.cancel(synchronized);
    start();
}

// -- counters --

int64_t LowEnergyCounter::ticks() const {
    return counts() && rate.runs() ? rate.edges(part.now()) - counted : 0;
}

void LowEnergyCounter::fold() {
    const int64_t passed = ticks();
    if (passed <= 0) return;
    counted += passed;
    pass(passed);
}

void LowEnergyCounter::plan() {
    part.cancel(due);
    if (!counts() || !rate.runs()) return;
    const int64_t next = next_effect();
    if (next != FAR)
        part.schedule(due, rate.time(counted + next));
}

void LowEnergyCounter::on_due(int64_t) {
    fold();
    plan();
}

void LowEnergyCounter::clear_count() {
    part.cancel(due);
    value = 0;
    rate = Rate();
    counted = 0;
}

void LowEnergyCounter::restart_clock() {
    rate = clock();
    counted = rate.edges(part.now());
}

void LowEnergyCounter::follow_clock() {
    const Rate wanted = clock();
    if (wanted.runs() != rate.runs() || wanted.origin != rate.origin ||
        !wanted.same_frequency(rate))
        restart_clock();
}

void LowEnergyCounter::clocks_changed() {
    LowEnergy::clocks_changed();
    follow_clock();
    plan();
}

uint32_t LowEnergyCounter::peek(uint32_t offset) const {
    return offset == count_register ? after(ticks()) : LowEnergy::peek(offset);
}

uint32_t LowEnergyCounter::read(uint32_t offset) {
    if (ticks()) {
        fold();
        plan();
    }
    return peek(offset);
}

}  // namespace efm32gg
