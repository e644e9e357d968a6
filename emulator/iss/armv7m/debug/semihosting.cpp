// Semihosting: BKPT 0xAB calls the host, for printf and exit of programs built with newlib's
// rdimon. Operations and parameter blocks: "Semihosting for AArch32 and AArch64", Arm 100863. The
// console is the only file.

#include "armv7m/system/system.h"

#include "armv7m/core/cpu.h"

namespace armv7m {

namespace {

enum : uint32_t {
    SYS_OPEN = 0x01, SYS_CLOSE = 0x02, SYS_WRITEC = 0x03, SYS_WRITE0 = 0x04, SYS_WRITE = 0x05,
    SYS_READ = 0x06, SYS_READC = 0x07, SYS_ISERROR = 0x08, SYS_ISTTY = 0x09, SYS_SEEK = 0x0A,
    SYS_FLEN = 0x0C, SYS_CLOCK = 0x10, SYS_TIME = 0x11, SYS_ERRNO = 0x13, SYS_GET_CMDLINE = 0x15,
    SYS_HEAPINFO = 0x16, SYS_EXIT = 0x18, SYS_EXIT_EXTENDED = 0x20, SYS_ELAPSED = 0x30,
    SYS_TICKFREQ = 0x31,
};
constexpr uint32_t FAILED = ~0u, EXIT_BY_APPLICATION = 0x20026;
constexpr uint32_t STDIN = 1, STDOUT = 2, STDERR = 3;    // handles
constexpr uint32_t LONGEST = 4096;                       // characters per call

// The program's memory, read without side effects.
struct ProgramMemory {
    Cpu &cpu;

    uint32_t word(uint32_t address) const {
        uint32_t value = 0;
        cpu.peek(address, 4, value);
        return value;
    }
    bool byte(uint32_t address, uint8_t &value) const {
        uint32_t wide = 0;
        const bool good = cpu.peek(address, 1, wide);
        value = (uint8_t)wide;
        return good;
    }
    // Copies up to `length` bytes, with `to_zero` up to a zero byte; returns their number.
    int text(uint32_t address, uint32_t length, bool to_zero, uint8_t (&buffer)[LONGEST]) const {
        uint32_t count = 0;
        for (; count < length && count < LONGEST; count++)
            if (!byte(address + count, buffer[count]) || (to_zero && !buffer[count])) break;
        return (int)count;
    }
};

}  // namespace

void System::semihost() {
    const ProgramMemory memory{cpu};
    const uint32_t block = cpu.r[1];
    uint8_t buffer[LONGEST];
    uint32_t result = 0;
    switch (cpu.r[0]) {
    case SYS_OPEN: {
        // ":tt" is the console: opened for reading stdin, for writing stdout, for appending stderr.
        const bool console = memory.text(memory.word(block), 4, true, buffer) == 3 &&
                             buffer[0] == ':' && buffer[1] == 't' && buffer[2] == 't';
        const uint32_t mode = memory.word(block + 4);
        result = !console ? FAILED : mode < 4 ? STDIN : mode < 8 ? STDOUT : STDERR;
        break;
    }
    case SYS_CLOSE: case SYS_SEEK: case SYS_FLEN: break;
    case SYS_WRITEC:
        if (memory.byte(block, buffer[0])) listener.semihosting_write(STDOUT, buffer, 1);
        break;
    case SYS_WRITE0: {
        const int length = memory.text(block, LONGEST, true, buffer);
        listener.semihosting_write(STDOUT, buffer, length);
        break;
    }
    case SYS_WRITE: {
        const uint32_t length = memory.word(block + 8);
        const int written = memory.text(memory.word(block + 4), length, false, buffer);
        listener.semihosting_write((int)memory.word(block), buffer, written);
        result = length - (uint32_t)written;    // not written
        break;
    }
    case SYS_READ: {
        const uint32_t at = memory.word(block + 4), length = memory.word(block + 8);
        uint32_t count = 0;
        while (count < length && count < LONGEST) {
            const int character = listener.semihosting_read();
            if (character < 0 || !cpu.poke(at + count, 1, (uint32_t)character)) break;
            count++;
            if (character == '\n') break;
        }
        result = length - count;
        break;
    }
    case SYS_READC: result = (uint32_t)listener.semihosting_read(); break;
    case SYS_ISERROR: result = (int32_t)memory.word(block) < 0; break;
    case SYS_ISTTY: result = 1; break;
    case SYS_CLOCK: result = (uint32_t)(listener.time_ps() / 10'000'000'000); break;    // 1/100 s
    case SYS_TIME: result = (uint32_t)(listener.time_ps() / 1'000'000'000'000); break;
    case SYS_ERRNO: break;
    case SYS_GET_CMDLINE:
        cpu.poke(memory.word(block), 1, 0);
        cpu.poke(block + 4, 4, 0);
        break;
    case SYS_HEAPINFO:
        // All zero: the program uses the values of its linker script.
        for (uint32_t n = 0; n < 4; n++) cpu.poke(memory.word(block) + 4 * n, 4, 0);
        break;
    case SYS_EXIT:
        listener.semihosting_exit(block == EXIT_BY_APPLICATION ? 0 : 1);
        cpu.stop();
        break;
    case SYS_EXIT_EXTENDED:
        listener.semihosting_exit(memory.word(block) == EXIT_BY_APPLICATION ? memory.word(block + 4)
                                                                            : 1);
        cpu.stop();
        break;
    case SYS_ELAPSED: {
        const uint64_t microseconds = (uint64_t)listener.time_ps() / 1'000'000;
        cpu.poke(block, 4, (uint32_t)microseconds);
        cpu.poke(block + 4, 4, (uint32_t)(microseconds >> 32));
        break;
    }
    case SYS_TICKFREQ: result = 1'000'000; break;
    default:
        listener.unmodelled("semihosting operation other than console, clock and exit");
        result = FAILED;
    }
    cpu.r[0] = result;
}

}  // namespace armv7m
