/* SPDX-License-Identifier: BSD-2-Clause */
/* What the device's library would define, which Debian's source of sdcc does not have: registers by
 * their addresses in the data sheet, generic pointers to EEPROM, which nothing here has, and the
 * start. */
__sfr __at(0xFE4) PREINC1;
__sfr __at(0xFE8) WREG;
__sfr __at(0xFE9) FSR0L;
__sfr __at(0xFEA) FSR0H;
__sfr __at(0xFEE) POSTINC0;
__sfr __at(0xFF3) PRODL;
__sfr __at(0xFF4) PRODH;
__sfr __at(0xFF5) TABLAT;
__sfr __at(0xFF6) TBLPTRL;
__sfr __at(0xFF7) TBLPTRH;
__sfr __at(0xFF8) TBLPTRU;

int errno;

#define NONE(name) void name(void) {}
NONE(__eeprom_gptrget1)
NONE(__eeprom_gptrget2)
NONE(__eeprom_gptrget3)
NONE(__eeprom_gptrget4)
NONE(__eeprom_gptrput1)
NONE(__eeprom_gptrput2)
NONE(__eeprom_gptrput3)
NONE(__eeprom_gptrput4)

void main(void);

/* Reset: the software stack's two pointers, then the program. */
void entry(void) __naked __interrupt 0 {
    __asm__("goto _begin");
}

void begin(void) __naked {
    __asm__("lfsr 1, 0xEFF");
    __asm__("lfsr 2, 0xEFF");
    __asm__("clrf _TBLPTRU");
    main();
}
