#include "efm32gg/part/peripheral.h"

#include "efm32gg/part/part.h"

namespace efm32gg {

Peripheral::Peripheral(Part &part, const Instance &instance)
    : instance(instance), layout(*instance.layout), part(part), file(layout.size / 4),
      descriptions(layout.size / 4) {
    for (int n = 0; n < layout.count; n++)
        descriptions[layout.registers[n].offset / 4] = &layout.registers[n];
}

void Peripheral::reset() {
    for (int n = 0; n < layout.count; n++)
        reg(layout.registers[n].offset) = layout.registers[n].reset;
    for (int n = 0; n < 4; n++)
        line(n, false);
}

uint32_t Peripheral::peek(uint32_t offset) const {
    const Register *found = described(offset);
    return found ? reg(offset) & found->readable : 0;
}

void Peripheral::write(uint32_t offset, uint32_t value) {
    if (layout.if_ >= 0 && ((int32_t)offset == layout.ifs || (int32_t)offset == layout.ifc)) {
        set_bits(reg((uint32_t)layout.if_), value & described(offset)->writable,
                 (int32_t)offset == layout.ifs);
        update_interrupts();
        return;
    }
    store(offset, value);
    if ((int32_t)offset == layout.ien)
        update_interrupts();
}

Rate Peripheral::clock_now() const { return part.unit_rate(instance); }

void Peripheral::store(uint32_t offset, uint32_t value) {
    const Register *found = described(offset);
    if (!found) return;
    if (!found->modelled && (value & found->writable) != found->reset)
        part.log_once("%s.%s is kept, but does nothing", instance.name, found->name);
    reg(offset) = (reg(offset) & ~found->writable) | (value & found->writable);
}

uint32_t Peripheral::pending() const {
    if (layout.if_ < 0 || layout.ien < 0) return 0;
    return reg((uint32_t)layout.if_) & reg((uint32_t)layout.ien);
}

void Peripheral::raise(uint32_t flags) {
    reg((uint32_t)layout.if_) |= flags;
    update_interrupts();
}

void Peripheral::line(int index, bool level) {
    if (instance.lines[index] >= 0)
        part.irq(instance.lines[index], level);
}

void Peripheral::report_locked() const {
    part.log_once("%s is locked: a write to its registers is lost", instance.name);
}

}  // namespace efm32gg
