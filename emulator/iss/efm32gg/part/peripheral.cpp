#include "efm32gg/part/peripheral.h"

#include "efm32gg/part/part.h"

namespace efm32gg {

Peripheral::Peripheral(Part &part, const Instance &instance)
    : instance(instance), layout(*instance.layout), part(part), file(layout.size / 4),
      described(layout.size / 4) {
    for (int n = 0; n < layout.count; n++)
        described[layout.registers[n].offset / 4] = &layout.registers[n];
}

void Peripheral::reset() {
    for (int n = 0; n < layout.count; n++)
        reg(layout.registers[n].offset) = layout.registers[n].reset;
    for (int n = 0; n < 4; n++)
        line(n, false);
}

uint32_t Peripheral::read(uint32_t offset) { return Peripheral::peek(offset); }

uint32_t Peripheral::peek(uint32_t offset) const {
    const Register *found = described[offset / 4];
    return found ? file[offset / 4] & found->readable : 0;
}

void Peripheral::write(uint32_t offset, uint32_t value) {
    if (layout.if_ >= 0 && ((int32_t)offset == layout.ifs || (int32_t)offset == layout.ifc)) {
        const Register &written = *described[offset / 4];
        value &= written.writable;
        uint32_t &flags = reg((uint32_t)layout.if_);
        flags = (int32_t)offset == layout.ifs ? flags | value : flags & ~value;
        update_interrupts();
        return;
    }
    store(offset, value);
    if ((int32_t)offset == layout.ien)
        update_interrupts();
}

void Peripheral::store(uint32_t offset, uint32_t value) {
    const Register *found = described[offset / 4];
    if (!found)
        return;
    if (!found->modelled && (value & found->writable) != found->reset)
        part.log_once("%s.%s is kept, but does nothing", instance.name, found->name);
    uint32_t &kept = file[offset / 4];
    kept = (kept & ~found->writable) | (value & found->writable);
}

void Peripheral::raise(uint32_t flags) {
    reg((uint32_t)layout.if_) |= flags;
    update_interrupts();
}

void Peripheral::update_interrupts() {
    if (layout.if_ >= 0 && layout.ien >= 0)
        line(0, (reg((uint32_t)layout.if_) & reg((uint32_t)layout.ien)) != 0);
}

void Peripheral::line(int index, bool level) {
    if (instance.lines[index] >= 0)
        part.irq(instance.lines[index], level);
}

uint32_t Unmodelled::read(uint32_t) {
    part.log_once("%s is not modelled: it reads 0 and ignores writes", instance.name);
    return 0;
}

void Unmodelled::write(uint32_t offset, uint32_t) { read(offset); }

}  // namespace efm32gg
