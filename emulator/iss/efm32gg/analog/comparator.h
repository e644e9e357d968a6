// An analog comparator (ACMP) as LESENSE uses it. EFM32GG Reference Manual, 25.3.3.
#pragma once

namespace efm32gg {

class SensorComparator {
public:
    virtual ~SensorComparator() = default;
    // Output for positive input `channel`, 0 to 7, or -1 for the selected one. `level` replaces
    // INPUTSEL.VDDLEVEL unless it is -1. `before`: the output before, for hysteresis.
    virtual bool sense(int channel, int level, bool before) const = 0;
};

}  // namespace efm32gg
