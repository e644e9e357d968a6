// External bus interface: banks, modes, timing. EFM32GG Reference Manual, chapter 14.
#pragma once

#include "efm32gg/part/part.h"

namespace efm32gg {

class Ebi : public Peripheral {
public:
    static constexpr uint32_t BASE = 0x80000000, CODE_BASE = 0x12000000;

    using Peripheral::Peripheral;

    void reset() override;
    uint32_t peek(uint32_t offset) const override;
    void write(uint32_t offset, uint32_t value) override;
    void clocks_changed() override { set_up(); }

    bool covers(uint32_t address) const {
        return (address >= BASE && address < BASE + 0x40000000) ||
               (address >= CODE_BASE && address < 0x20000000);
    }

    // Accesses 1, 2 or 4 bytes in one or more transactions. False is a bus fault.
    bool access(uint32_t address, int size, uint32_t &value, bool write, int64_t &wait);
    bool peek(uint32_t address, int size, uint32_t &value) const;

private:
    enum Mode : uint32_t { D8A8, D16A16ALE, D8A24ALE, D16 };

    // A bank as configured by the registers.
    struct Bank {
        bool enabled, connected, memory, buffered;
        int bytes;                             // per transaction
        int64_t read_cycles, write_cycles;     // per transaction
        uint32_t reach;                        // mask of the address lines that have pins
    };

    Bank banks[4] = {};
    int64_t busy_until = 0;    // cycle at which the write buffer is empty again

    void set_up();
    bool report(int bank);
    uint32_t memory_access(const Bank &bank, uint32_t offset, int size, uint32_t value, bool write);

    int bank_of(uint32_t address, uint32_t &offset) const;
    uint32_t bank_mode(int bank) const;
    uint32_t timing(uint32_t offset, int bank) const;
    int64_t cycles(int bank, bool write) const;
    uint32_t reach(int bank) const;
    bool pins_out(int bank) const;
};

}  // namespace efm32gg
