// Pins and the FPGA, as these programs use them.
#include "processor.h"

#define RAM_RESULTS ((volatile uint32_t *)0x20010000)
#define CYCLES (*(volatile uint32_t *)0xE0001004)

static inline volatile uint32_t *port_of(unsigned pin) { return &GPIO->PA_CTRL + pin / 16 * 9; }
static inline void set(unsigned pin, unsigned level) {
    port_of(pin)[level ? 4 : 5] = 1u << pin % 16;
}
static inline unsigned get(unsigned pin) { return port_of(pin)[7] >> pin % 16 & 1; }

static inline void make(unsigned pin, unsigned mode) {
    volatile uint32_t *const modes = &port_of(pin)[1 + pin % 16 / 8];
    const unsigned shift = pin % 8 * 4;
    *modes = (*modes & ~(15u << shift)) | mode << shift;
}

static inline void start_board(void) {
    MSC->READCTRL = (MSC->READCTRL & ~MSC_READCTRL_MODE) | 2u << MSC_READCTRL_MODE_SHIFT;
    CMU->CTRL = (CMU->CTRL & ~CMU_CTRL_HFXOBUFCUR) | 3u << CMU_CTRL_HFXOBUFCUR_SHIFT;
    CMU->CTRL |= CMU_CTRL_HFLE;
    CMU->HFCORECLKDIV |= CMU_HFCORECLKDIV_HFCORECLKLEDIV;
    CMU->OSCENCMD = CMU_OSCENCMD_HFXOEN;
    while (!(CMU->STATUS & CMU_STATUS_HFXORDY)) {}
    CMU->CMD = 2u << CMU_CMD_HFCLKSEL_SHIFT;
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_GPIO;
    *(volatile uint32_t *)0xE000EDFC = 1u << 24;  // DEMCR.TRCENA
    CYCLES = 0;
    *(volatile uint32_t *)0xE0001000 |= 1;  // CYCCNTENA
    static const uint8_t outputs[] = {FPGA_ENABLE, FPGA_RNW, FPGA_BANK, FPGA_DCLK};
    for (unsigned i = 0; i < sizeof outputs; i++)
        make(outputs[i], 4);
    make(FPGA_ACK, 1);
    for (unsigned bit = 0; bit < 8; bit++)
        make(FPGA_DATA + bit, 1);
}

static inline uint8_t strobe(void) {
    volatile uint32_t *const clock = port_of(FPGA_DCLK);
    clock[4] = 1u << FPGA_DCLK % 16;
    const uint8_t byte = (uint8_t)(port_of(FPGA_DATA)[7] >> FPGA_DATA % 16);
    clock[5] = 1u << FPGA_DCLK % 16;
    return byte;
}
