// Settings that survive a loss of power.
#pragma once

#include <stdint.h>

#define SETTINGS 4u

// Reads the settings from flash; all are 0 if there are none.
void settings_load(void);

uint32_t settings_get(unsigned number);

// Stores one setting; returns 0 if the flash is worn, and then the previous one still counts.
int settings_set(unsigned number, uint32_t value);
