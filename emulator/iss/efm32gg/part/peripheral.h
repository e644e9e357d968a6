// Base of all peripherals: a register file that behaves as its register table specifies.
#pragma once

#include "efm32gg/part/time.h"
#include "registers.h"  // generated from firmware_model/interface/efm32gg/

#include <vector>

namespace efm32gg {

class Part;

// Reads, shifts into place and changes the field of a register that `mask` selects.
constexpr uint32_t field(uint32_t value, uint32_t mask) { return (value & mask) / (mask & -mask); }
constexpr uint32_t to_field(uint32_t field, uint32_t mask) { return field * (mask & -mask) & mask; }
constexpr void set_bits(uint32_t &word, uint32_t bits, bool on) {
    word = on ? word | bits : word & ~bits;
}

class Peripheral {
public:
    Peripheral(Part &part, const Instance &instance);
    virtual ~Peripheral() = default;
    Peripheral(const Peripheral &) = delete;

    // Sets all registers to their reset values and lowers the interrupt lines. Derived classes
    // call it first.
    virtual void reset();

    // Word accesses from the bus, with side effects. Offsets are multiples of 4 below the layout's
    // size. The base class reads and writes the register file and handles IFS, IFC and IEN.
    virtual uint32_t read(uint32_t offset) { return peek(offset); }
    virtual void write(uint32_t offset, uint32_t value);

    // The value that a read would return, without side effects: for debuggers.
    virtual uint32_t peek(uint32_t offset) const;

    // The part's clocks are about to change (update counters to now()), and have changed
    // (reschedule). Called for sleep, wake-up and enable bits, too.
    virtual void clocks_changing() {}
    virtual void clocks_changed() {}

    // A pin changed its level (see Gpio::listen), a PRS channel did, the analog inputs did.
    virtual void pin_changed(int port, int bit, bool level) { (void)port, (void)bit, (void)level; }
    virtual void prs_changed(int channel, bool level) { (void)channel, (void)level; }
    virtual void analog_changed() {}

    uint32_t &reg(uint32_t offset) { return file[offset / 4]; }
    uint32_t reg(uint32_t offset) const { return file[offset / 4]; }

    const Instance &instance;
    const Layout &layout;

protected:
    Part &part;

    // The clock of the unit now; stopped when the unit is not enabled.
    Rate clock_now() const;
    // Writes the register file: writable bits change, the others stay.
    void store(uint32_t offset, uint32_t value);
    const Register *described(uint32_t offset) const { return descriptions[offset / 4]; }
    // Interrupt flags that are set and enabled; 0 for layouts without them.
    uint32_t pending() const;
    // Sets bits of IF and updates the interrupt lines.
    void raise(uint32_t flags);
    // Overridden by units with more than one interrupt line.
    virtual void update_interrupts() { line(0, pending() != 0); }
    // Sets the instance's interrupt line number `index`, in the order of its table.
    void line(int index, bool level);
    // Sets LOCK, which reads 1 unless the key was written.
    void lock(uint32_t offset, uint32_t value, uint32_t key) {
        reg(offset) = (value & 0xFFFF) != key;
    }
    void report_locked() const;
    // Sets `bit` of STATUS by the command `on`, clears it by `off`, which has priority.
    static void command_bit(uint32_t &status, uint32_t bit, uint32_t command, uint32_t on,
                            uint32_t off) {
        if (command & (on | off))
            set_bits(status, bit, !(command & off));
    }

private:
    std::vector<uint32_t> file;
    std::vector<const Register *> descriptions;
};

}  // namespace efm32gg
