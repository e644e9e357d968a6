/* SPDX-License-Identifier: BSD-2-Clause */
/* Load switches, current monitors and comparators. EFM32GG Reference Manual, chapters 26 and 28.
 *
 * A monitor's voltage goes to an input of the ADC and to a comparator, whose other input is a
 * fraction of the supply, in steps of 1/63. The trip currents are assumed: a third above the
 * highest regular one for imager and FPGA, ten times it for the memory, which draws little. */
#include "supply.h"

#include "clock.h"
#include "core.h"
#include "efm32gg.h"
#include "gpio.h"
#include "pins.h"

#define ADC_REFERENCE_1V25 0u
#define ADC_REFERENCE_2V5 1u
#define ADC_INPUT_TEMPERATURE 8u
#define ADC_AFTER_16_CLOCKS 4u
#define ADC_PRESCALED_BY_4 3u
#define ADC_COUNTS_PER_VOLT (4096.0f / 2.5f)
#define TEMPERATURE_GRADIENT (-6.27f) /* counts per degree, at 1.25 V */

#define COMPARE_WITH_SUPPLY 10u
#define SUPPLY_STEPS 63.0f
#define MEMORY_TRIP_MA 30.0f
#define IMAGER_TRIP_MA 200.0f

static const struct {
    unsigned closed; /* pin */
    uint32_t input;
    float ma_per_volt;
} channels[CHANNELS] = {
    [CHANNEL_MEMORY] = {MEMORY_SWITCH, MEMORY_ADC_CHANNEL, MEMORY_MA_PER_VOLT},
    [CHANNEL_IMAGER] = {IMAGER_SWITCH, IMAGER_ADC_CHANNEL, IMAGER_MA_PER_VOLT},
};

static void compare(ACMP_Registers *comparator, uint32_t channel, float trip_volts)
{
    uint32_t level = (uint32_t)(SUPPLY_STEPS * trip_volts / SUPPLY_VOLTS + 0.5f);
    comparator->INPUTSEL = channel << ACMP_INPUTSEL_POSSEL_SHIFT |
                           COMPARE_WITH_SUPPLY << ACMP_INPUTSEL_NEGSEL_SHIFT |
                           level << ACMP_INPUTSEL_VDDLEVEL_SHIFT;
    comparator->CTRL |= ACMP_CTRL_EN | ACMP_CTRL_IRISE;
    while (!(comparator->STATUS & ACMP_STATUS_ACMPACT))
        ;
    comparator->IFC = ACMP_IFC_EDGE;
    comparator->IEN = ACMP_IEN_EDGE;
}

/* A current that is too high from the start causes no edge. */
static void look_at(ACMP_Registers *comparator, enum channel channel)
{
    if (comparator->STATUS & ACMP_STATUS_ACMPOUT)
        supply_overcurrent(channel);
}

void supply_start(unsigned open)
{
    for (int channel = 0; channel < CHANNELS; channel++)
        pin_set_up(channels[channel].closed, PIN_OUTPUT, !(open >> channel & 1));
    ADC0->CTRL = (CLOCK_HZ / 1000000u - 1) << ADC_CTRL_TIMEBASE_SHIFT |
                 ADC_PRESCALED_BY_4 << ADC_CTRL_PRESC_SHIFT;
    compare(MEMORY_COMPARATOR, MEMORY_COMPARATOR_CHANNEL, MEMORY_TRIP_MA / MEMORY_MA_PER_VOLT);
    compare(IMAGER_COMPARATOR, IMAGER_COMPARATOR_CHANNEL, IMAGER_TRIP_MA / IMAGER_MA_PER_VOLT);
    look_at(MEMORY_COMPARATOR, CHANNEL_MEMORY);
    look_at(IMAGER_COMPARATOR, CHANNEL_IMAGER);
    interrupt_enable(ACMP0_IRQ);
}

static void served(ACMP_Registers *comparator, enum channel channel)
{
    if (!(comparator->IF & ACMP_IF_EDGE))
        return;
    comparator->IFC = ACMP_IFC_EDGE;
    supply_overcurrent(channel);
}

/* Both comparators share the interrupt. */
void ACMP0_handler(void)
{
    served(MEMORY_COMPARATOR, CHANNEL_MEMORY);
    served(IMAGER_COMPARATOR, CHANNEL_IMAGER);
}

void supply_switch(enum channel channel, bool closed)
{
    pin_write(channels[channel].closed, closed);
}

/* Main program and interrupts both convert, so interrupts are off meanwhile. */
static uint32_t converted(uint32_t input, uint32_t reference)
{
    uint32_t masked = interrupts_off();
    ADC0->SINGLECTRL = input << ADC_SINGLECTRL_INPUTSEL_SHIFT |
                       reference << ADC_SINGLECTRL_REF_SHIFT |
                       ADC_AFTER_16_CLOCKS << ADC_SINGLECTRL_AT_SHIFT;
    ADC0->CMD = ADC_CMD_SINGLESTART;
    while (!(ADC0->STATUS & ADC_STATUS_SINGLEDV))
        ;
    uint32_t counts = ADC0->SINGLEDATA;
    interrupts_restore(masked);
    return counts;
}

float supply_current_ma(enum channel channel)
{
    uint32_t counts = converted(channels[channel].input, ADC_REFERENCE_2V5);
    return (float)counts / ADC_COUNTS_PER_VOLT * channels[channel].ma_per_volt;
}

float temperature_c(void)
{
    float at = (float)((DEVINFO->CAL & DEVINFO_CAL_TEMP) >> DEVINFO_CAL_TEMP_SHIFT);
    int32_t calibrated = (int32_t)((DEVINFO->ADC0CAL2 & DEVINFO_ADC0CAL2_TEMP1V25) >>
                                   DEVINFO_ADC0CAL2_TEMP1V25_SHIFT);
    int32_t counts = (int32_t)converted(ADC_INPUT_TEMPERATURE, ADC_REFERENCE_1V25);
    return at - (float)(calibrated - counts) / TEMPERATURE_GRADIENT;
}
