// Indices of the analog inputs: volts, and the temperature in degrees Celsius.
#pragma once

namespace efm32gg::analog {

enum Input {
    ADC0_CH0 = 0,     // to CH7: port D, bits 0 to 7
    TEMPERATURE = 8,
    VDD = 9,
    ACMP0_CH0 = 10,   // to CH7: port C, bits 0 to 7
    ACMP1_CH0 = 18,   // to CH7: port C, bits 8 to 15
    ADC0_REFERENCE = 26,  // at the pin for external references
    COUNT = 32,
};

}  // namespace efm32gg::analog
