/* The pins to the FPGA board (CubeStar thesis, table C.2), and its transfer.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef FPGA_H
#define FPGA_H

#include <stdbool.h>
#include <stdint.h>

/* All control pins low: the FPGA stands by. */
void fpga_start(void);

void fpga_enable(bool on);
void fpga_read_not_write(bool read);
void fpga_bank(bool bank);
bool fpga_acknowledges(void);

/* Strobes so many stored bytes out of the FPGA, which must be reading. */
void fpga_transfer(uint8_t *to, int count);

#endif
