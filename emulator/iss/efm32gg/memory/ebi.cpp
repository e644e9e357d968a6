#include "efm32gg/memory/ebi.h"

#include "armv7m/core/cpu.h"

#include <algorithm>
#include <cstring>

namespace efm32gg {

using namespace ebi;

// Offset of a bank's registers from those of bank 0 (14.5).
static constexpr uint32_t BANK_REGISTERS[] = {0, 0x14, 0x24, 0x34};

void Ebi::reset() {
    Peripheral::reset();
    busy_until = 0;
    set_up();
}

uint32_t Ebi::peek(uint32_t offset) const {
    if (offset == STATUS)
        return part.cpu.cycles < busy_until ? (uint32_t)STATUS_AHBACT : 0;
    return Peripheral::peek(offset);
}

void Ebi::write(uint32_t offset, uint32_t value) {
    Peripheral::write(offset, value);
    set_up();
    const bool rd = offset == RDTIMING || offset == RDTIMING1 || offset == RDTIMING2 ||
                    offset == RDTIMING3;
    if (rd && value & (RDTIMING_PREFETCH | RDTIMING_PAGEMODE))
        part.log_once("EBI: prefetch and page mode are not modelled");
    if (offset == CTRL && value & (CTRL_ARDYEN | CTRL_ARDY1EN | CTRL_ARDY2EN | CTRL_ARDY3EN))
        part.log_once("EBI: ARDY is not modelled: the bus is always ready");
}

// Banks have 64 MB, with the alternative map 256 MB; in the code space 32 or 64 MB (14.3.8).
int Ebi::bank_of(uint32_t address, uint32_t &offset) const {
    if (address < BASE) {
        offset = address & 0x01FFFFFF;
        return address < 0x14000000 ? 0 : (int)((address - 0x10000000) >> 26);
    }
    const int shift = reg(CTRL) & CTRL_ALTMAP ? 28 : 26;
    offset = address & ((1u << shift) - 1);
    return (int)((address - BASE) >> shift);
}

uint32_t Ebi::bank_mode(int bank) const {
    const int own = reg(CTRL) & CTRL_ITS ? bank : 0;
    return reg(CTRL) >> 2 * own & 3;
}

uint32_t Ebi::timing(uint32_t offset, int bank) const {
    return reg(offset + (reg(CTRL) & CTRL_ITS ? BANK_REGISTERS[bank] : 0));
}

// Cycles of HFCORECLK per transaction (14.3.2): multiplexed modes latch the address first; a strobe
// and the address set-up take at least one cycle. Half-cycle options move edges only.
int64_t Ebi::cycles(int bank, bool write) const {
    const uint32_t address = timing(ADDRTIMING, bank), mode = bank_mode(bank);
    const uint32_t times = timing(write ? WRTIMING : RDTIMING, bank);
    int64_t count = field(times, RDTIMING_RDSETUP) + std::max(1u, field(times, RDTIMING_RDSTRB)) +
                    field(times, RDTIMING_RDHOLD);
    if (mode == D16A16ALE || mode == D8A24ALE)
        count += std::max(1u, field(address, ADDRTIMING_ADDRSETUP)) +
                 field(address, ADDRTIMING_ADDRHOLD);
    return count + !(reg(CTRL) >> 12 & 1u << bank);
}

uint32_t Ebi::reach(int bank) const {
    static constexpr uint32_t LINES[] = {8, 17, 24, 1};
    const uint32_t mode = bank_mode(bank), upper = field(reg(ROUTE), ROUTE_APEN);
    const uint32_t lines = std::max(LINES[mode], upper + (mode == D16 || mode == D16A16ALE));
    return (1u << std::min(lines, 28u)) - 1;
}

bool Ebi::pins_out(int bank) const {
    const uint32_t mode = bank_mode(bank);
    const uint32_t wanted = ROUTE_EBIPEN | ROUTE_CS0PEN << bank |
                            (mode == D16A16ALE || mode == D8A24ALE ? (uint32_t)ROUTE_ALEPEN : 0);
    return (reg(ROUTE) & wanted) == wanted;
}

void Ebi::set_up() {
    for (int n = 0; n < 4; n++) {
        const uint32_t mode = bank_mode(n);
        banks[n] = {part.enabled(instance) && reg(CTRL) & CTRL_BANK0EN << n, pins_out(n),
                    n == 0 && part.memories.external && part.memories.external_size,
                    !(timing(WRTIMING, n) & WRTIMING_WBUFDIS),
                    mode == D16 || mode == D16A16ALE ? 2 : 1, cycles(n, false), cycles(n, true),
                    reach(n)};
    }
}

bool Ebi::report(int bank) {
    part.log_once("EBI: access to bank %d, which is not enabled", bank);
    return false;
}

// An access to memory with a constant size, for speed: firmware reads whole images bytewise.
template <class Word> static uint32_t move(uint8_t *cell, uint32_t value, bool write) {
    Word word = (Word)value;
    if (write)
        std::memcpy(cell, &word, sizeof word);
    else
        std::memcpy(&word, cell, sizeof word);
    return word;
}

uint32_t Ebi::memory_access(const Bank &bank, uint32_t offset, int size, uint32_t value,
                            bool write) {
    const uint32_t limit = part.memories.external_size, at = offset & bank.reach;
    uint8_t *memory = part.memories.external;
    if (at + (uint32_t)size <= limit && at + (uint32_t)size - 1 <= bank.reach) {
        if (size == 1) return move<uint8_t>(memory + at, value, write);
        return size == 2 ? move<uint16_t>(memory + at, value, write)
                         : move<uint32_t>(memory + at, value, write);
    }
    for (int n = 0; n < size; n++) {
        uint8_t &cell = memory[((offset + (uint32_t)n) & bank.reach) % limit];
        if (write)
            cell = (uint8_t)(value >> 8 * n);
        else
            value |= (uint32_t)cell << 8 * n;
    }
    return value;
}

__attribute__((flatten)) bool Ebi::access(uint32_t address, int size, uint32_t &value, bool write,
                                          int64_t &wait) {
    uint32_t offset;
    const int number = bank_of(address, offset);
    if (number > 3 || !banks[number].enabled) return report(number);
    const Bank &bank = banks[number];
    const int64_t each = write ? bank.write_cycles : bank.read_cycles;
    const int64_t transactions = bank.bytes == 1 ? size : (size + 1) / 2;
    const int64_t now = part.cpu.cycles;
    const int64_t begin = std::max(now, busy_until), end = begin + each * transactions;
    const bool buffered = write && bank.buffered;
    wait += (buffered ? begin : end) - now;
    busy_until = buffered ? end : 0;
    if (bank.connected && bank.memory) {
        value = memory_access(bank, offset, size, value, write);
        return true;
    }
    if (!bank.connected)
        part.log_once("EBI: access to bank %d without its pins (ROUTE)", number);
    for (int n = 0; n < size; n++) {
        uint8_t byte = write ? (uint8_t)(value >> 8 * n) : 0xFF;
        if (bank.connected && part.attached) {
            const int64_t time = part.now() + part.rate(Clock::HFCORE)
                                                  .span(begin + each * (n / bank.bytes) - now);
            const uint32_t at = (offset + (uint32_t)n) & bank.reach;
            if (!part.attached->bus_access(number, at, byte, write, time))
                part.log_once("EBI: nothing answers on bank %d", number);
        }
        if (!write)
            value |= (uint32_t)byte << 8 * n;
    }
    return true;
}

bool Ebi::peek(uint32_t address, int size, uint32_t &value) const {
    uint32_t offset;
    if (!covers(address) || bank_of(address, offset) || !part.memories.external ||
        offset + (uint32_t)size > part.memories.external_size)
        return false;
    std::memcpy(&value, part.memories.external + offset, (size_t)size);
    return true;
}

}  // namespace efm32gg
