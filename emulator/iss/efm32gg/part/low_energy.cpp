#include "efm32gg/part/low_energy.h"

namespace efm32gg {

LowEnergy::LowEnergy(Part &part, const Instance &instance, uint32_t freeze, uint32_t synchronizing,
                     uint32_t command)
    : Peripheral(part, instance), freeze(freeze), synchronizing(synchronizing), commands(command) {}

void LowEnergy::reset() {
    Peripheral::reset();
    part.cancel(arrived);
    late_count = 0;
}

void LowEnergy::write(uint32_t offset, uint32_t value) {
    const uint32_t bit = busy_bit(offset);
    if (!bit) {
        const bool was_frozen = reg(freeze) & 1;
        Peripheral::write(offset, value);
        if (offset == freeze && was_frozen && !(value & 1))
            start();
        return;
    }
    reg(synchronizing) |= bit;
    const bool at_once = immediate() && !(reg(freeze) & 1);
    int place = 0;
    while (place < late_count && late[place].offset != offset)
        place++;
    if (place == MOST)
        return;
    if (place == late_count)
        late[late_count++] = {offset, 0, false};
    // Of values the last one counts.
    const bool gathers = offset == commands && !late[place].applied;
    late[place] = {offset, gathers ? both(late[place].value, value) : value, at_once};
    if (at_once)
        apply(offset, value);
    start();
}

// Two to three clocks later.
void LowEnergy::start() {
    const Rate rate = synchronizer();
    if (late_count && !arrived.pending() && !(reg(freeze) & 1) && rate.runs())
        part.schedule(arrived, rate.time(rate.edges(part.now()) + 3));
}

void LowEnergy::on_arrived(int64_t) {
    const int count = late_count;
    Late done[MOST];
    for (int n = 0; n < count; n++)
        done[n] = late[n];
    late_count = 0;
    reg(synchronizing) = 0;
    for (int n = 0; n < count; n++)
        if (!done[n].applied)
            apply(done[n].offset, done[n].value);
}

void LowEnergy::clocks_changed() {
    part.cancel(arrived);
    start();
}

}  // namespace efm32gg
