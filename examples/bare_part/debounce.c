#include "debounce.h"

bool debounce(struct button *button, bool pin_pressed) {
    if (pin_pressed == button->pressed) {
        button->unstable = 0;
        return false;
    }
    if (++button->unstable < STABLE_MS)
        return false;
    button->pressed = pin_pressed;
    button->unstable = 0;
    return pin_pressed;
}
