// A push button that bounces: a level counts once it is stable for STABLE_MS.
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define STABLE_MS 5u

struct button {
    bool pressed;      // the debounced state
    uint32_t unstable; // ms for which the pin has differed from it
};

// Call every millisecond with the pin's state; returns true once per press.
bool debounce(struct button *button, bool pin_pressed);
