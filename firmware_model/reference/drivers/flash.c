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

static const volatile uint32_t *words_of(enum flash_page page)
{
    return (const volatile uint32_t *)(FLASH_END - (page + 1u) * PAGE_BYTES);
}

static uint32_t check_of(uint32_t check, uint32_t word)
{
    return (check << 5 | check >> 27) ^ word;
}

bool flash_load(enum flash_page page, void *words, unsigned size)
{
    const volatile uint32_t *stored = words_of(page);
    uint32_t check = CHECK_SEED;
    for (unsigned i = 0; i < size / 4; i++)
        check = check_of(check, stored[i]);
    if (stored[size / 4] != check)
        return false;
    for (unsigned i = 0; i < size / 4; i++)
        ((uint32_t *)words)[i] = stored[i];
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

void flash_erase(enum flash_page page)
{
    begin();
    run_command((uint32_t)words_of(page), 0, MSC_WRITECMD_ERASEPAGE);
    end();
}

void flash_store(enum flash_page page, const void *words, unsigned size)
{
    uint32_t address = (uint32_t)words_of(page), check = CHECK_SEED;
    flash_erase(page);
    begin();
    for (unsigned i = 0; i < size / 4; i++) {
        uint32_t word = ((const uint32_t *)words)[i];
        check = check_of(check, word);
        run_command(address + 4 * i, word, MSC_WRITECMD_WRITEONCE);
    }
    run_command(address + size, check, MSC_WRITECMD_WRITEONCE);
    end();
}
