// Receives on UART0 by DMA in ping-pong mode; sends every full half back in upper case.
#include "device.h"

#define HALF 8

typedef struct {
    volatile void *source_end, *destination_end;
    volatile uint32_t control, user;
} Descriptor;

// Primary and alternate descriptors, 16 each; the base is aligned to their size.
static Descriptor descriptors[32] __attribute__((aligned(512)));
static uint8_t halves[2][HALF];
static volatile uint8_t full[2];

static uint32_t ping_pong(void) {
    // HALF bytes, one per request, from a fixed source to increasing addresses; cycle 3: ping-pong.
    return 0UL << 30 | 3UL << 26 | (HALF - 1) << 4 | 3;
}

void DMA_IRQHandler(void) {
    if (!(DMA->IF & 1))
        return;
    DMA->IFC = 1;
    for (int side = 0; side < 2; side++) {
        Descriptor *descriptor = &descriptors[side ? 16 : 0];
        if ((descriptor->control & 7) == 0 && !full[side]) {
            full[side] = 1;
            descriptor->control = ping_pong();
        }
    }
}

int main(void) {
    console_init();
    CMU->HFCORECLKEN0 |= CMU_HFCORECLKEN0_DMA;
    for (int side = 0; side < 2; side++) {
        Descriptor *descriptor = &descriptors[side ? 16 : 0];
        descriptor->source_end = (volatile void *)&UART0->RXDATA;
        descriptor->destination_end = &halves[side][HALF - 1];
        descriptor->control = ping_pong();
    }
    DMA->CTRLBASE = (uint32_t)descriptors;
    DMA->CONFIG = 1;
    DMA->CH[0].CTRL = 44UL << 16 | 0;  // UART0, RXDATAV
    DMA->CHREQMASKC = 1;
    DMA->CHUSEBURSTC = 1;
    DMA->CHALTC = 1;
    DMA->IFC = 1;
    DMA->IEN = 1;
    NVIC_EnableIRQ(DMA_IRQn);
    DMA->CHENS = 1;
    console_write("ready\n");
    for (int side = 0;; side ^= 1) {
        while (!full[side])
            __WFI();
        for (int i = 0; i < HALF; i++) {
            const char c = (char)halves[side][i];
            console_put(c >= 'a' && c <= 'z' ? (char)(c - 32) : c);
        }
        full[side] = 0;
    }
}
