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

    Nvic(int interrupts, int priority_bits)
        : exceptions(FIRST_INTERRUPT + interrupts),
          priority_mask(0xFFu << (8 - priority_bits) & 0xFF) {
        reset();
    }

    void reset() {
        enable = pend = act = {};
        for (int16_t &each : priorities) each = 0;
        priorities[RESET] = -3, priorities[NMI] = -2, priorities[HARD_FAULT] = -1;
        for (int number = NMI; number < FIRST_INTERRUPT; number++)
            enable.set(number, number <= HARD_FAULT || number == SVCALL || number >= PEND_SV);
        for (int number = FIRST_INTERRUPT; number < exceptions; number++)
            if (lines.has(number)) pend.set(number, true);    // the lines keep their levels
        set_grouping(0);    // finds first and active, too
    }

    int count() const { return exceptions; }    // exception numbers are below this
    bool enabled(int number) const { return enable.has(number); }
    bool pending(int number) const { return pend.has(number); }
    bool active(int number) const { return act.has(number); }
    int priority(int number) const { return priorities[number]; }
    bool line(int number) const { return lines.has(number); }

    void set_enabled(int number, bool value) {
        enable.set(number, value);
        find_first();
    }

    void set_pending(int number, bool value) {
        pend.set(number, value);
        if (!value) {
            if (number == first) find_first();
        } else if (enable.has(number) &&
                   (!first || priorities[number] < priorities[first] ||
                    (priorities[number] == priorities[first] && number < first))) {
            first = number;
        }
    }

    void set_active(int number, bool value) {
        act.set(number, value);
        find_active();
    }

    void set_priority(int number, uint32_t value) {
        if (number <= HARD_FAULT || number >= exceptions) return;
        priorities[number] = (int16_t)(value & priority_mask);
        find_first();
        find_active();
    }

    void set_grouping(uint32_t prigroup) {
        subpriority_mask = (int)((2u << prigroup) - 1);
        find_first();
        find_active();
    }

    // The level of an interrupt's line. A rising edge pends the interrupt; so does the end of its
    // handler while the line is high, and clearing its pending bit then. True if it was pended.
    bool set_line(int number, bool level) {
        if (lines.has(number) == level) return false;
        lines.set(number, level);
        if (level) set_pending(number, true);
        return level;
    }

    bool repend(int number) {
        if (!lines.has(number)) return false;
        set_pending(number, true);
        return true;
    }

    // The preempting part of a priority.
    int group(int priority) const { return priority < 0 ? priority : priority & ~subpriority_mask; }

    // Enabled pending exception of the highest priority, of equal ones the lowest number; 0: none.
    int first_pending() const { return first; }
    // Group priority of the most urgent active exception; THREAD_PRIORITY if none is active.
    int active_priority() const { return active_group; }

    int active_count() const {
        int count = 0;
        for (uint32_t word : act.word) count += __builtin_popcount(word);
        return count;
    }

    // Registers of the NVIC proper as words, by offset from 0xE000E100.
    uint32_t read(uint32_t offset) const {
        const uint32_t index = offset % 0x80 / 4;
        switch (offset / 0x80) {
        case 0: case 1: return interrupts(enable, index);    // ISER, ICER
        case 2: case 3: return interrupts(pend, index);      // ISPR, ICPR
        case 4: return interrupts(act, index);               // IABR
        }
        return offset >= 0x300 ? priority_word(FIRST_INTERRUPT + (int)(offset - 0x300)) : 0;
    }

    void write(uint32_t offset, uint32_t value) {
        const uint32_t bank = offset / 0x80, index = offset % 0x80 / 4;
        if (bank > 3) return;    // IABR is read-only; priorities come by write_priorities
        for (uint32_t left = value; left; left &= left - 1) {
            const int number = FIRST_INTERRUPT + (int)(32 * index) + __builtin_ctz(left);
            if (number >= exceptions) break;
            switch (bank) {
            case 0: enable.set(number, true); break;
            case 1: enable.set(number, false); break;
            case 2: pend.set(number, true); break;
            case 3: pend.set(number, lines.has(number) && !act.has(number)); break;
            }
        }
        find_first();
    }

    uint32_t priority_word(int first_number) const {
        uint32_t word = 0;
        for (int lane = 0; lane < 4; lane++) {
            const int number = first_number + lane;
            if (number > HARD_FAULT && number < exceptions)
                word |= (uint32_t)priorities[number] << 8 * lane;
        }
        return word;
    }

    void write_priorities(int first_number, uint32_t value, uint32_t lanes) {
        for (int lane = 0; lane < 4; lane++)
            if (lanes >> lane & 1) set_priority(first_number + lane, value >> 8 * lane & 0xFF);
    }

private:
    void find_first() { first = most_urgent(pend, enable); }

    // The member of two sets with the highest priority, of equal ones the lowest number; 0: none.
    int most_urgent(const ExceptionSet &a, const ExceptionSet &b) const {
        int found = 0;
        for (int index = 0; index < ExceptionSet::WORDS; index++)
            for (uint32_t left = a.word[index] & b.word[index]; left; left &= left - 1) {
                const int number = 32 * index + __builtin_ctz(left);
                if (!found || priorities[number] < priorities[found]) found = number;
            }
        return found;
    }

    void find_active() {
        const int number = most_urgent(act, act);
        active_group = number ? group(priorities[number]) : THREAD_PRIORITY;
    }

    // The bits of 32 interrupts in a set.
    uint32_t interrupts(const ExceptionSet &set, uint32_t index) const {
        // Interrupt 0 is exception 16: a register's 32 bits lie across two words.
        if (index >= ExceptionSet::WORDS) return 0;
        const uint32_t above = index + 1 < ExceptionSet::WORDS ? set.word[index + 1] : 0;
        return set.word[index] >> 16 | above << 16;
    }

    int exceptions;
    uint32_t priority_mask;           // implemented bits
    int subpriority_mask = 0;
    int first = 0, active_group = THREAD_PRIORITY;
    ExceptionSet enable, pend, act, lines;
    int16_t priorities[32 * ExceptionSet::WORDS] = {};
};

}  // namespace armv7m
