// Enabled, pending and active exceptions and their priorities: exception numbers 1 to 15 (system)
// and from 16 on (external interrupts). ARMv7-M Architecture Reference Manual B1.5.4 (priorities),
// B3.4 (NVIC).

#pragma once

#include <cstdint>

namespace armv7m {

enum ExceptionNumber : int {
    RESET = 1, NMI = 2, HARD_FAULT = 3, MEM_MANAGE = 4, BUS_FAULT = 5, USAGE_FAULT = 6,
    SVCALL = 11, DEBUG_MONITOR = 12, PEND_SV = 14, SYSTICK = 15, FIRST_INTERRUPT = 16,
};

class ExceptionSet {
public:
    static constexpr int WORDS = 8;    // 256 exceptions

    bool has(int number) const { return word[number / 32] >> (number % 32) & 1; }
    void set(int number, bool member) {
        const uint32_t bit = 1u << number % 32;
        word[number / 32] = member ? word[number / 32] | bit : word[number / 32] & ~bit;
    }

    uint32_t word[WORDS] = {};
};

class Nvic {
public:
    static constexpr int THREAD_PRIORITY = 256;

    Nvic(int interrupts, int priority_bits);
    void reset();

    int count() const { return exceptions; }    // exception numbers are below this
    bool enabled(int number) const { return enable.has(number); }
    bool pending(int number) const { return pend.has(number); }
    bool active(int number) const { return act.has(number); }
    int priority(int number) const { return priorities[number]; }
    bool line(int number) const { return lines.has(number); }

    void set_enabled(int number, bool value);
    void set_pending(int number, bool value);
    void set_active(int number, bool value);
    void set_priority(int number, uint32_t value);
    void set_grouping(uint32_t prigroup);

    // The level of an interrupt's line. A rising edge pends the interrupt; so does the end of its
    // handler while the line is high, and clearing its pending bit then. True if it was pended.
    bool set_line(int number, bool level);
    bool repend(int number);

    // The preempting part of a priority.
    int group(int priority) const { return priority < 0 ? priority : priority & ~subpriority_mask; }

    // Enabled pending exception of the highest priority, of equal ones the lowest number; 0: none.
    int first_pending() const { return first; }
    // Group priority of the most urgent active exception; THREAD_PRIORITY if none is active.
    int active_priority() const { return active_group; }
    int active_count() const;

    // Registers of the NVIC proper as words, by offset from 0xE000E100.
    uint32_t read(uint32_t offset) const;
    void write(uint32_t offset, uint32_t value);
    uint32_t priority_word(int first_number) const;
    void write_priorities(int first_number, uint32_t value, uint32_t lanes);

private:
    void find_first() { first = most_urgent(pend, enable); }
    int most_urgent(const ExceptionSet &a, const ExceptionSet &b) const;
    void find_active();
    // The bits of 32 interrupts in a set.
    uint32_t interrupts(const ExceptionSet &set, uint32_t index) const;

    int exceptions;
    uint32_t priority_mask;           // implemented bits
    int subpriority_mask = 0;
    int first = 0, active_group = THREAD_PRIORITY;
    ExceptionSet enable, pend, act, lines;
    int16_t priorities[32 * ExceptionSet::WORDS] = {};
};

}  // namespace armv7m
