// The EFM32GG as a vendor's device header shows it: struct types for the peripherals.
//
// Written from the reference manual and not from the emulator's tables, so that programs that
// include it find registers at wrong addresses.
#ifndef DEVICE_H
#define DEVICE_H

#include <stdint.h>

#define __I volatile const
#define __O volatile
#define __IO volatile

typedef struct {
    __IO uint32_t CTRL, HFCORECLKDIV, HFPERCLKDIV, HFRCOCTRL, LFRCOCTRL, AUXHFRCOCTRL, CALCTRL, CALCNT;
    __O uint32_t OSCENCMD, CMD;
    __IO uint32_t LFCLKSEL;
    __I uint32_t STATUS, IF;
    __O uint32_t IFS, IFC;
    __IO uint32_t IEN, HFCORECLKEN0, HFPERCLKEN0;
    uint32_t RESERVED0[2];
    __I uint32_t SYNCBUSY;
    __IO uint32_t FREEZE, LFACLKEN0;
    uint32_t RESERVED1[1];
    __IO uint32_t LFBCLKEN0;
    uint32_t RESERVED2[1];
    __IO uint32_t LFAPRESC0;
    uint32_t RESERVED3[1];
    __IO uint32_t LFBPRESC0;
    uint32_t RESERVED4[1];
    __IO uint32_t PCNTCTRL, LCDCTRL, ROUTE, LOCK;
} CMU_TypeDef;

typedef struct {
    __IO uint32_t CTRL, MODEL, MODEH, DOUT;
    __O uint32_t DOUTSET, DOUTCLR, DOUTTGL;
    __I uint32_t DIN;
    __IO uint32_t PINLOCKN;
} GPIO_P_TypeDef;

typedef struct {
    GPIO_P_TypeDef P[6];
    uint32_t RESERVED0[10];
    __IO uint32_t EXTIPSELL, EXTIPSELH, EXTIRISE, EXTIFALL, IEN;
    __I uint32_t IF;
    __O uint32_t IFS, IFC;
    __IO uint32_t ROUTE, INSENSE, LOCK;
} GPIO_TypeDef;

typedef struct {
    __IO uint32_t CTRL, FRAME, TRIGCTRL, CMD;
    __I uint32_t STATUS;
    __IO uint32_t CLKDIV;
    __I uint32_t RXDATAX, RXDATA, RXDOUBLEX, RXDOUBLE, RXDATAXP, RXDOUBLEXP;
    __IO uint32_t TXDATAX, TXDATA, TXDOUBLEX, TXDOUBLE;
    __I uint32_t IF;
    __IO uint32_t IFS, IFC, IEN, IRCTRL, ROUTE, INPUT, I2SCTRL;
} USART_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD;
    __I uint32_t STATE, STATUS;
    __IO uint32_t CLKDIV, SADDR, SADDRMASK;
    __I uint32_t RXDATA, RXDATAP;
    __IO uint32_t TXDATA;
    __I uint32_t IF;
    __IO uint32_t IFS, IFC, IEN, ROUTE;
} I2C_TypeDef;

typedef struct {
    __IO uint32_t CTRL;
} DMA_CH_TypeDef;

typedef struct {
    __I uint32_t STATUS;
    __O uint32_t CONFIG;
    __IO uint32_t CTRLBASE;
    __I uint32_t ALTCTRLBASE, CHWAITSTATUS;
    __O uint32_t CHSWREQ;
    __IO uint32_t CHUSEBURSTS;
    __O uint32_t CHUSEBURSTC;
    __IO uint32_t CHREQMASKS;
    __O uint32_t CHREQMASKC;
    __IO uint32_t CHENS;
    __O uint32_t CHENC;
    __IO uint32_t CHALTS;
    __O uint32_t CHALTC;
    __IO uint32_t CHPRIS;
    __O uint32_t CHPRIC;
    uint32_t RESERVED0[3];
    __IO uint32_t ERRORC;
    uint32_t RESERVED1[880];
    __I uint32_t CHREQSTATUS;
    uint32_t RESERVED2[1];
    __I uint32_t CHSREQSTATUS;
    uint32_t RESERVED3[121];
    __I uint32_t IF;
    __IO uint32_t IFS, IFC, IEN, CTRL, RDS;
    uint32_t RESERVED4[2];
    __IO uint32_t LOOP0, LOOP1;
    uint32_t RESERVED5[14];
    __IO uint32_t RECT0;
    uint32_t RESERVED6[39];
    DMA_CH_TypeDef CH[12];
} DMA_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CNT, COMP0, COMP1;
    __I uint32_t IF;
    __IO uint32_t IFS, IFC, IEN, FREEZE;
    __I uint32_t SYNCBUSY;
} RTC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD;
    __I uint32_t STATUS, CNT;
    __IO uint32_t COMP0, COMP1, REP0, REP1;
    __I uint32_t IF;
    __IO uint32_t IFS, IFC, IEN, FREEZE;
    __I uint32_t SYNCBUSY;
    uint32_t RESERVED0[2];
    __IO uint32_t ROUTE;
} LETIMER_TypeDef;

typedef struct {
    __IO uint32_t CTRL, READCTRL, WRITECTRL, WRITECMD, ADDRB;
    uint32_t RESERVED0[1];
    __IO uint32_t WDATA;
    __I uint32_t STATUS;
    uint32_t RESERVED1[3];
    __I uint32_t IF;
    __IO uint32_t IFS, IFC, IEN, LOCK, CMD;
    __I uint32_t CACHEHITS, CACHEMISSES;
    uint32_t RESERVED2[1];
    __IO uint32_t TIMEBASE, MASSLOCK;
} MSC_TypeDef;

typedef struct {
    __IO uint32_t CTRL, CMD;
    __I uint32_t SYNCBUSY;
} WDOG_TypeDef;

typedef struct {
    __IO uint32_t CTRL;
    __I uint32_t RSTCAUSE;
    __O uint32_t CMD;
} RMU_TypeDef;

typedef struct {
    __IO uint32_t CTRL, LOAD, VAL;
    __I uint32_t CALIB;
} SysTick_Type;

typedef struct {
    __I uint32_t CPUID;
    __IO uint32_t ICSR, VTOR, AIRCR, SCR, CCR;
    __IO uint8_t SHP[12];
    __IO uint32_t SHCSR, CFSR, HFSR, DFSR, MMFAR, BFAR, AFSR;
} SCB_Type;

#define CMU ((CMU_TypeDef *)0x400C8000UL)
#define GPIO ((GPIO_TypeDef *)0x40006000UL)
#define UART0 ((USART_TypeDef *)0x4000E000UL)
#define I2C0 ((I2C_TypeDef *)0x4000A000UL)
#define DMA ((DMA_TypeDef *)0x400C2000UL)
#define RTC ((RTC_TypeDef *)0x40080000UL)
#define LETIMER0 ((LETIMER_TypeDef *)0x40082000UL)
#define MSC ((MSC_TypeDef *)0x400C0000UL)
#define WDOG ((WDOG_TypeDef *)0x40088000UL)
#define RMU ((RMU_TypeDef *)0x400CA000UL)
#define SysTick ((SysTick_Type *)0xE000E010UL)
#define SCB ((SCB_Type *)0xE000ED00UL)
#define NVIC_ISER ((__IO uint32_t *)0xE000E100UL)
enum { DMA_IRQn = 0, I2C0_IRQn = 9, UART0_RX_IRQn = 20, LETIMER0_IRQn = 26, RTC_IRQn = 30 };

static inline void NVIC_EnableIRQ(int irq) { NVIC_ISER[irq >> 5] = 1UL << (irq & 31); }
static inline void __WFI(void) { __asm volatile("wfi" ::: "memory"); }
static inline void __disable_irq(void) { __asm volatile("cpsid i" ::: "memory"); }

#define CMU_CTRL_HFLE (1UL << 30)
#define CMU_HFCORECLKDIV_LEDIV4 (1UL << 8)
#define CMU_OSCENCMD_HFXOEN (1UL << 2)
#define CMU_OSCENCMD_HFRCODIS (1UL << 1)
#define CMU_OSCENCMD_LFXOEN (1UL << 8)
#define CMU_CMD_HFCLKSEL_HFXO 2UL
#define CMU_STATUS_HFXORDY (1UL << 3)
#define CMU_STATUS_LFXORDY (1UL << 9)
#define CMU_STATUS_HFXOSEL (1UL << 11)
#define CMU_HFCORECLKEN0_DMA (1UL << 0)
#define CMU_HFCORECLKEN0_LE (1UL << 4)
#define CMU_HFPERCLKEN0_UART0 (1UL << 3)
#define CMU_HFPERCLKEN0_I2C0 (1UL << 11)
#define CMU_HFPERCLKEN0_GPIO (1UL << 13)
#define CMU_LFACLKEN0_RTC (1UL << 1)
#define CMU_LFACLKEN0_LETIMER0 (1UL << 2)

#define MSC_READCTRL_MODE_WS2 4UL
#define USART_CMD_RXEN (1UL << 0)
#define USART_CMD_TXEN (1UL << 2)
#define USART_STATUS_TXC (1UL << 5)
#define USART_STATUS_TXBL (1UL << 6)

// Of startup.c: 48 MHz from the crystal, UART0 at 115200 baud on PE0 and PE1.
void SystemInit(void);
void console_init(void);
void console_put(char c);
void console_write(const char *text);
void console_hex(uint32_t value);

#endif
