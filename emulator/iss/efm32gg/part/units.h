// Adds units that no other unit accesses; units.cpp calls these functions.
#pragma once

namespace efm32gg {

class Part;
struct Instance;

void add_watchdog(Part &part);
// `source`: of DMA requests; `reflex`: of PRS signals; `signals`: of the TX pin (route::Signal), the
// RX pin's follows. The order of the calls is that of the unit numbers.
void add_usart(Part &part, const Instance &instance, int source, int reflex, int signals);
void add_leuart(Part &part, const Instance &instance, int source, int signals);
void add_low_energy_timers(Part &part);
void add_pulse_counters(Part &part);
void add_adc(Part &part);
void add_comparators(Part &part);

}  // namespace efm32gg
