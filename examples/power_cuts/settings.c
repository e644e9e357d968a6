// A store for four settings in two banks of flash, which a power cut may hit at any instant.
//
// A bank is one page: a sequence number, the values, and a check word over both. A save erases the
// bank that is not in use, writes it, the check word last, and reads it back. Until then the other
// bank keeps the previous values. The newest bank with a right check word counts.
//
// Built with -DFAULT=1 to 5, one of these rules is broken.
#include "settings.h"

#include "processor.h"

#ifndef FAULT
#define FAULT 0
#endif
#define NO_CHECKSUM (FAULT == 1)      // every bank with a sequence number counts
#define SEQUENCE_FIRST (FAULT == 2)   // it alone decides which bank counts
#define ERASED_TOO_EARLY (FAULT == 3) // the bank in use, before the other one is written
#define HALF_WORD_VALID (FAULT == 4)  // a check word with bits still to be programmed is right
#define UNSAFE_RECOVERY (FAULT == 5)  // repairs a broken bank through RAM

#define PAGE_BYTES 4096u
#define BANKS 2u
#define FIRST_BANK 0xF0000u
#define ERASED 0xFFFFFFFFu
#define CHECK_SEED 0x5E771465u

struct bank {
    uint32_t sequence, values[SETTINGS], check;
};

#define WORDS (sizeof(struct bank) / 4)

static struct bank current;
static unsigned in_use;

static const volatile struct bank *bank_at(unsigned number) {
    return (const volatile struct bank *)(FIRST_BANK + number * PAGE_BYTES);
}

static uint32_t check_of(const struct bank *bank) {
    const uint32_t *words = (const uint32_t *)bank;
    uint32_t crc = CHECK_SEED;
    for (unsigned i = 0; i < WORDS - 1; i++) {
        crc ^= words[i];
        for (int bit = 0; bit < 32; bit++)
            crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0);
    }
    return crc;
}

static struct bank copy_of(unsigned number) {
    struct bank copy;
    for (unsigned i = 0; i < WORDS; i++)
        ((uint32_t *)&copy)[i] = ((const volatile uint32_t *)bank_at(number))[i];
    return copy;
}

static int is_valid(const struct bank *bank) {
    const uint32_t right = check_of(bank);
    if (NO_CHECKSUM || SEQUENCE_FIRST)
        return bank->sequence != ERASED;
    if (HALF_WORD_VALID)
        return bank->sequence != ERASED && (bank->check & right) == right;
    return bank->check == right;
}

// Flash

static void run(uint32_t command) {
    MSC->WRITECMD = command;
    while (MSC->STATUS & MSC_STATUS_BUSY) {}
}

static void erase_bank(unsigned number) {
    MSC->WRITECTRL = MSC_WRITECTRL_WREN;
    MSC->ADDRB = (uint32_t)bank_at(number);
    MSC->WRITECMD = MSC_WRITECMD_LADDRIM;
    run(MSC_WRITECMD_ERASEPAGE);
    MSC->WRITECTRL = 0;
}

static void write_word(uint32_t address, uint32_t word) {
    MSC->WRITECTRL = MSC_WRITECTRL_WREN;
    MSC->ADDRB = address;
    MSC->WRITECMD = MSC_WRITECMD_LADDRIM;
    MSC->WDATA = word;
    run(MSC_WRITECMD_WRITEONCE);
    MSC->WRITECTRL = 0;
}

// Returns whether the bank now has these words.
static int write_bank(unsigned number, const struct bank *bank) {
    erase_bank(number);
    for (unsigned i = 0; i < WORDS; i++)
        write_word((uint32_t)bank_at(number) + 4 * i, ((const uint32_t *)bank)[i]);
    const struct bank written = copy_of(number);
    for (unsigned i = 0; i < WORDS; i++)
        if (((const uint32_t *)&written)[i] != ((const uint32_t *)bank)[i])
            return 0;
    return 1;
}

// Store

// Both banks from RAM: a cut in between loses everything.
static void repair(void) {
    for (unsigned number = 0; number < BANKS; number++)
        erase_bank(number);
    for (unsigned number = 0; number < BANKS; number++)
        write_bank(number, &current);
}

void settings_load(void) {
    int found = 0, broken = 0;
    for (unsigned number = 0; number < BANKS; number++) {
        const struct bank bank = copy_of(number);
        if (!is_valid(&bank)) {
            broken += bank.sequence != ERASED || bank.check != ERASED;
        } else if (!found || bank.sequence > current.sequence) {
            current = bank;
            in_use = number;
            found = 1;
        }
    }
    if (SEQUENCE_FIRST && found && current.check != check_of(&current)) {
        for (unsigned i = 0; i < SETTINGS; i++)
            current.values[i] = 0;
    }
    if (UNSAFE_RECOVERY && found && broken)
        repair();
}

uint32_t settings_get(unsigned number) { return current.values[number]; }

int settings_set(unsigned number, uint32_t value) {
    struct bank next = current;
    next.sequence++;
    next.values[number] = value;
    next.check = check_of(&next);
    const unsigned target = (in_use + 1) % BANKS;
    if (ERASED_TOO_EARLY)
        erase_bank(in_use);
    if (!write_bank(target, &next))
        return 0;
    current = next;
    in_use = target;
    return 1;
}
