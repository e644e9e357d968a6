/* SPDX-License-Identifier: BSD-2-Clause */
/* The pins to the FPGA board (CubeStar thesis, table C.2), and its transfer. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

/* Sets all control pins low: the FPGA is in standby. */
void fpga_start(void);

void fpga_enable(bool on);
void fpga_read_not_write(bool read);
void fpga_bank(bool bank);
bool fpga_acknowledges(void);

/* Reads `count` stored bytes from the FPGA, which must be in its read state. */
void fpga_transfer(uint8_t *to, int count);
