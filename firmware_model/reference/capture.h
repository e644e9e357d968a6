/* Image capture: discarding the first frame, FPGA store and transfer.
 *
 * CubeStar thesis, sections 5.3.1 and 5.3.6, appendix D. The picture lies at the beginning of the
 * processor's external RAM.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef CAPTURE_H
#define CAPTURE_H

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"
#include "drivers/external_ram.h"

#define PICTURE EXTERNAL_MEMORY
#define PICTURE_COLUMNS 1024
#define PICTURE_ROWS 512
#define PICTURE_BYTES (PICTURE_COLUMNS * PICTURE_ROWS)

/* Captures a picture; false, with a flag raised, when it failed. `meanwhile` runs while the FPGA
 * waits for the frame; NULL: nothing does. */
bool capture_image(bool (*meanwhile)(void));

/* The picture was made by other means; false: its supply was cut. */
bool capture_replaced(void);

#endif
