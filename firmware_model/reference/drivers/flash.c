/* SPDX-License-Identifier: BSD-2-Clause */
/* Flash pages, EFM32GG Reference Manual, chapter 7.
 *
 * They are in the upper half of the flash; the program runs from the lower one, which can be read
 * while the upper one is written. The routines that write are in RAM nevertheless, as the manual
 * requires for parts without that feature. */
#include "memories.h"

#include "core.h"
#include "efm32gg.h"
#include "reset.h"

#define FLASH_END 0x00100000u
#define PAGE_BYTES 4096u
#define UNLOCK 0x1B71u
#define CHECK_SEED 0x43425354u

#define IN_RAM __attribute__((section(".ram_code"), noinline, long_call))

/* A page has three banks: sequence number, words, check word over both. The bank with the latest
 * contents is never written, so they survive a cut of the power. The third one is for the case that
 * another one is worn. */
#define BANKS 3u

static const volatile uint32_t *bank_of(enum flash_page page, unsigned bank)
{
    return (const volatile uint32_t *)(FLASH_END - (BANKS * page + bank + 1u) * PAGE_BYTES);
}

static uint32_t check_of(uint32_t check, uint32_t word)
{
    return (check << 5 | check >> 27) ^ word;
}

static bool is_whole(const volatile uint32_t *bank, unsigned size)
{
    uint32_t check = CHECK_SEED;
    for (unsigned i = 0; i <= size / 4; i++)
        check = check_of(check, bank[i]);
    return bank[size / 4 + 1] == check;
}

/* The bank with the latest contents; BANKS if there are none. */
static unsigned latest_bank(enum flash_page page, unsigned size)
{
    unsigned latest = BANKS;
    for (unsigned bank = 0; bank < BANKS; bank++)
        if (is_whole(bank_of(page, bank), size) &&
            (latest == BANKS || (int32_t)(*bank_of(page, bank) - *bank_of(page, latest)) > 0))
            latest = bank;
    return latest;
}

bool flash_load(enum flash_page page, void *words, unsigned size)
{
    unsigned bank = latest_bank(page, size);
    if (bank == BANKS)
        return false;
    for (unsigned i = 0; i < size / 4; i++)
        ((uint32_t *)words)[i] = bank_of(page, bank)[i + 1];
    return true;
}

IN_RAM static void run_command(uint32_t address, uint32_t word, uint32_t command)
{
    MSC->ADDRB = address;
    MSC->WRITECMD = MSC_WRITECMD_LADDRIM;
    if (command == MSC_WRITECMD_WRITEONCE) {
        while (!(MSC->STATUS & MSC_STATUS_WDATAREADY))
            ;
        MSC->WDATA = word;
    }
    MSC->WRITECMD = command;
    while (MSC->STATUS & MSC_STATUS_BUSY)
        ;
}

static void begin(void)
{
    watchdog_feed();
    MSC->LOCK = UNLOCK;
    MSC->WRITECTRL = MSC_WRITECTRL_WREN | MSC_WRITECTRL_RWWEN;
}

static void end(void)
{
    MSC->WRITECTRL = 0;
    MSC->LOCK = 0;
}

static void erase_bank(enum flash_page page, unsigned bank)
{
    begin();
    run_command((uint32_t)bank_of(page, bank), 0, MSC_WRITECMD_ERASEPAGE);
    end();
}

/* The latest contents go last: a cut must not bring back older ones. */
void flash_erase(enum flash_page page, unsigned size)
{
    unsigned latest = latest_bank(page, size);
    for (unsigned bank = 0; bank < BANKS; bank++)
        if (bank != latest)
            erase_bank(page, bank);
    if (latest < BANKS)
        erase_bank(page, latest);
}

static void write_bank(enum flash_page page, unsigned bank, uint32_t sequence, const uint32_t *words,
                       unsigned size)
{
    uint32_t address = (uint32_t)bank_of(page, bank), check = check_of(CHECK_SEED, sequence);
    erase_bank(page, bank);
    begin();
    run_command(address, sequence, MSC_WRITECMD_WRITEONCE);
    for (unsigned i = 0; i < size / 4; i++) {
        check = check_of(check, words[i]);
        run_command(address + 4 * (i + 1), words[i], MSC_WRITECMD_WRITEONCE);
    }
    run_command(address + size + 4, check, MSC_WRITECMD_WRITEONCE);
    end();
}

void flash_store(enum flash_page page, const void *words, unsigned size)
{
    unsigned latest = latest_bank(page, size);
    uint32_t sequence = latest == BANKS ? 0 : *bank_of(page, latest) + 1u;
    for (unsigned bank = 0; bank < BANKS; bank++) {
        if (bank == latest)
            continue;
        write_bank(page, bank, sequence, words, size);
        if (is_whole(bank_of(page, bank), size) && *bank_of(page, bank) == sequence)
            break;
    }
}
