"""Compiled programs that combine units and use their interrupts."""

from pathlib import Path

import pytest

from cubestack.emulator.iss.outcome import OutgoingKind
from tests.emulator.iss.cross_compiler import needs_compiler

from .bench import MS, US, Bench, compiled

RESULT = 0x2001_0000

I2C_MASTER = """
/* Write a register's number, read four bytes: one state a byte, in the interrupt. */
static volatile enum { ADDRESS_WRITE, NUMBER, ADDRESS_READ, DATA, STOPPED, FAILED } state;
static volatile uint8_t data[4];
static volatile uint32_t got;

void IRQ(void) {
    uint32_t pending = I2C0->IF & I2C0->IEN;
    if (pending & (I2C_IF_ARBLOST | I2C_IF_BUSERR | I2C_IF_NACK)) {
        state = FAILED;
        I2C0->IFC = pending;
        if (pending & I2C_IF_NACK)
            I2C0->CMD = I2C_CMD_STOP;
        return;
    }
    if (pending & I2C_IF_MSTOP) {
        I2C0->IFC = I2C_IFC_MSTOP;
        if (state != FAILED)
            state = STOPPED;
        I2C0->IEN = 0;
        return;
    }
    if (pending & I2C_IF_ACK) {
        I2C0->IFC = I2C_IFC_ACK;
        switch (state) {
        case ADDRESS_WRITE:
            I2C0->TXDATA = 0x75;
            state = NUMBER;
            break;
        case NUMBER:
            I2C0->CMD = I2C_CMD_START;
            I2C0->TXDATA = 0xD1;
            state = ADDRESS_READ;
            break;
        case ADDRESS_READ:
            state = DATA;
            break;
        default:
            break;
        }
    }
    if (pending & I2C_IF_RXDATAV) {
        data[got++] = (uint8_t)I2C0->RXDATA;
        if (got == 4) {
            I2C0->CMD = I2C_CMD_NACK;
            I2C0->CMD = I2C_CMD_STOP;
        } else {
            I2C0->CMD = I2C_CMD_ACK;
        }
    }
}

int main(void) {
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_I2C0 | CMU_HFPERCLKEN0_GPIO;
    GPIO->PD_MODEH = 8u << 24 | 8u << 28;
    I2C0->ROUTE = I2C_ROUTE_SDAPEN | I2C_ROUTE_SCLPEN | 3 << 8;
    I2C0->CLKDIV = 16;
    I2C0->CTRL = I2C_CTRL_EN;
    if (I2C0->STATE & I2C_STATE_BUSY)
        I2C0->CMD = I2C_CMD_ABORT;
    I2C0->IEN = I2C_IEN_ACK | I2C_IEN_NACK | I2C_IEN_MSTOP | I2C_IEN_RXDATAV | I2C_IEN_ARBLOST |
                I2C_IEN_BUSERR;
    *(volatile uint32_t *)0xE000E100 = 1u << 9;
    I2C0->TXDATA = 0xD0;
    I2C0->CMD = I2C_CMD_START;
    while (state != STOPPED && !(state == FAILED && !I2C0->IEN))
        __asm volatile("wfi");
    RESULT[0] = state;
    RESULT[1] = data[0] | data[1] << 8 | data[2] << 16 | (uint32_t)data[3] << 24;
    return 0;
}
"""


def run_i2c(bench: Bench, known: int) -> list[str]:
    """Answer as one device with address ``known``; what passed on the bus."""
    passed: list[str] = []
    following = iter((0x11, 0x22, 0x33, 0x44))
    machine = bench.machine
    for _ in range(2000):
        bench.run_for(10 * US)
        bench.items += machine.outbox()
        items, bench.items = bench.items, []
        for item in items:
            match item.kind:
                case OutgoingKind.I2C_START:
                    passed.append(f"S{item.value:02X}")
                    machine.i2c_answer(0, item.value >> 1 == known)
                case OutgoingKind.I2C_WRITE:
                    passed.append(f"W{item.value:02X}")
                    machine.i2c_answer(0, True)
                case OutgoingKind.I2C_READ:
                    passed.append(f"R{item.extra}")
                    machine.i2c_answer(0, True, next(following))
                case OutgoingKind.I2C_STOP:
                    passed.append("P")
    return passed[passed.index("SD0") :]


@needs_compiler
@pytest.mark.parametrize(
    ("known", "passed", "state"),
    [(0x68, "SD0 W75 SD1 R0 R1 R1 R1 P", 4), (0x10, "SD0 P", 5)],
    ids=["answered", "not answered"],
)
def test_i2c_master_by_interrupt(tmp_path: Path, known: int, passed: str, state: int) -> None:
    bench = Bench(image=compiled(I2C_MASTER, tmp_path))
    assert " ".join(run_i2c(bench, known)) == passed
    assert bench.machine.read(RESULT) == state
    assert bench.machine.read(RESULT + 4) == (0x4433_2211 if known == 0x68 else 0)


SAMPLER = """
/* TIMER0 triggers the ADC by the reflex system, the DMA collects, two halves in turn. */
static uint32_t descriptors[128] __attribute__((aligned(512)));
static volatile uint16_t samples[2][8];
static volatile uint32_t halves;

void IRQ(void) {
    if (!(DMA->IF & 1))
        return;
    DMA->IFC = 1;
    uint32_t sum = 0;
    for (int n = 0; n < 8; n++)
        sum += samples[halves & 1][n];
    RESULT[1 + halves] = sum;
    uint32_t *done = descriptors + (halves & 1 ? 64 : 0);
    done[2] = 3 | 7 << 4 | 1u << 24 | 3u << 26 | 1u << 28 | 1u << 30;
    halves++;
    if (halves == 4)
        TIMER0->CMD = TIMER_CMD_STOP;
    RESULT[0] = halves;
}

int main(void) {
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_TIMER0 | CMU_HFPERCLKEN0_ADC0 | CMU_HFPERCLKEN0_PRS;
    CMU->HFCORECLKEN0 = CMU_HFCORECLKEN0_DMA;
    for (int half = 0; half < 2; half++) {
        uint32_t *one = descriptors + 64 * half;
        one[0] = (uint32_t)&ADC0->SINGLEDATA;
        one[1] = (uint32_t)&samples[half][7];
        one[2] = 3 | 7 << 4 | 1u << 24 | 3u << 26 | 1u << 28 | 1u << 30;
    }
    DMA->CTRLBASE = (uint32_t)descriptors;
    DMA->CONFIG = DMA_CONFIG_EN;
    DMA->CH0_CTRL = 8 << 16;
    DMA->IEN = 1;
    DMA->CHENS = 1;
    *(volatile uint32_t *)0xE000E100 = 1;
    PRS->CH2_CTRL = 28u << 16 | 1; /* TIMER0 overflow */
    ADC0->CTRL = 13u << 16 | 1u << 8;
    ADC0->SINGLECTRL = 3u << 8 | 1u << 16 | ADC_SINGLECTRL_PRSEN | 2u << 28;
    TIMER0->TOP = 1399;
    TIMER0->CMD = TIMER_CMD_START;
    for (;;)
        __asm volatile("wfi");
}
"""


@needs_compiler
def test_timer_triggers_adc_and_dma(tmp_path: Path) -> None:
    bench = Bench(image=compiled(SAMPLER, tmp_path))
    bench.machine.analog[3] = 1.25
    bench.run_for(2 * MS)
    bench.machine.analog[3] = 2.0
    bench.run_for(3 * MS)
    assert bench.machine.read(RESULT) == 4
    sums = [bench.machine.read(RESULT + 4 + 4 * n) for n in range(4)]
    assert sums[0] == sums[1] == 8 * 2048
    assert sums[3] == 8 * int(2.0 / 2.5 * 4096)


CAPTURE = """
/* Width of pulses at PA0 by input capture, and an answer at each by a PWM at PA1. */
static volatile uint32_t rise, count;

void IRQ(void) {
    TIMER0->IFC = TIMER_IFC_CC0;
    while (TIMER0->STATUS & TIMER_STATUS_ICV0) {
        uint32_t at = TIMER0->CC0_CCV;
        if (count & 1)
            RESULT[1 + count / 2] = (at - rise) & 0xFFFF;
        else
            rise = at;
        count++;
    }
    RESULT[0] = count;
}

int main(void) {
    CMU->HFPERCLKEN0 = CMU_HFPERCLKEN0_TIMER0 | CMU_HFPERCLKEN0_GPIO;
    GPIO->PA_MODEL = 1;
    TIMER0->ROUTE = TIMER_ROUTE_CC0PEN;
    TIMER0->CC0_CTRL = 1 | 2u << 24;
    TIMER0->IEN = TIMER_IEN_CC0;
    TIMER0->CTRL = 1u << 24;
    TIMER0->CMD = TIMER_CMD_START;
    *(volatile uint32_t *)0xE000E100 = 1u << 2;
    for (;;)
        __asm volatile("wfi");
}
"""


@needs_compiler
def test_timer_measures_pulses(tmp_path: Path) -> None:
    bench = Bench(image=compiled(CAPTURE, tmp_path))
    bench.run_for(MS)
    widths = (100 * US, 37 * US, 2 * MS)
    for width in widths:
        bench.machine.pin(0, 0, 1)
        bench.run_for(width)
        bench.machine.pin(0, 0, 0)
        bench.run_for(50 * US)
    assert bench.machine.read(RESULT) == 6
    for n, width in enumerate(widths):
        measured = bench.machine.read(RESULT + 4 + 4 * n) or 0
        assert abs(measured - width * 7 // US) <= 2
