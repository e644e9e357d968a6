// Base of all peripherals: a register file that behaves as its table says.
#pragma once

#include "efm32gg/part/rate.h"
#include "registers.h"  // made of firmware_model/interface/efm32gg/

#include <vector>

namespace efm32gg {

class Part;

// A field's value out of a register's, and back; the mask says where it is.
constexpr uint32_t take(uint32_t value, uint32_t mask) { return (value & mask) / (mask & -mask); }
constexpr uint32_t give(uint32_t field, uint32_t mask) { return field * (mask & -mask) & mask; }
constexpr void put(uint32_t &word, uint32_t bits, bool on) {
    word = on ? word | bits : word & ~bits;
}

class Peripheral {
public:
    Peripheral(Part &part, const Instance &instance);
    virtual ~Peripheral() = default;
    Peripheral(const Peripheral &) = delete;

    // All registers to their reset values, and interrupts off. Derived classes call it first.
    virtual void reset();

    // Word accesses of the bus, with side effects. Offsets are multiples of 4, below the layout's
    // size. What is not overridden is the register file; IFS, IFC and IEN are done here.
    virtual uint32_t read(uint32_t offset);
    virtual void write(uint32_t offset, uint32_t value);

    // What a read would give, without side effects: for debuggers.
    virtual uint32_t peek(uint32_t offset) const;

    // The part's clocks are about to change (bring counters up to now()), and have changed
    // (schedule anew). Sleep, wake-up and enable bits come this way, too.
    virtual void clocks_changing() {}
    virtual void clocks_changed() {}

    // The energy mode is now `mode`, 0 to 3.
    virtual void energy_mode(int mode) { (void)mode; }

    // A pin's level changed (Gpio::listen asks for that); a reflex channel's did; the analog
    // inputs did.
    virtual void pin_changed(int port, int bit, bool level) { (void)port, (void)bit, (void)level; }
    virtual void prs_changed(int channel, bool level) { (void)channel, (void)level; }
    virtual void analog_changed() {}

    uint32_t &reg(uint32_t offset) { return file[offset / 4]; }
    uint32_t reg(uint32_t offset) const { return file[offset / 4]; }

    const Instance &instance;
    const Layout &layout;

protected:
    Part &part;

    // The register file's part of a write: writable bits change, the others stay.
    void store(uint32_t offset, uint32_t value);
    // Sets bits of IF, and the interrupt lines after it.
    void raise(uint32_t flags);
    // Interrupt lines follow IF and IEN; overridden where there is more than one line.
    virtual void update_interrupts();
    // The instance's line number `index` in the order of its table.
    void line(int index, bool level);

private:
    std::vector<uint32_t> file;
    std::vector<const Register *> described;
};

// A peripheral whose registers are declared, but that does nothing: it reads 0. The first access
// is reported.
class Unmodelled : public Peripheral {
public:
    using Peripheral::Peripheral;
    uint32_t read(uint32_t offset) override;
    void write(uint32_t offset, uint32_t value) override;
    uint32_t peek(uint32_t) const override { return 0; }
};

}  // namespace efm32gg
