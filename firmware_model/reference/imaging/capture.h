/* SPDX-License-Identifier: BSD-2-Clause */
/* Image capture: discarding the first frame, FPGA store and transfer.
 *
 * CubeStar thesis, sections 5.3.1 and 5.3.6, appendix D. The image is at the beginning of the
 * processor's external RAM. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"
#include "drivers/memories.h"

#define PICTURE EXTERNAL_MEMORY
#define PICTURE_COLUMNS 1024
#define PICTURE_ROWS 512
#define PICTURE_BYTES (PICTURE_COLUMNS * PICTURE_ROWS)

/* Captures an image; raises a flag and returns false if it failed. `meanwhile` runs while the FPGA
 * waits for the frame, unless it is NULL. */
bool capture_image(bool (*meanwhile)(void));

/* The image was replaced by an upload or a test pattern; false: its supply was cut. */
bool capture_replaced(void);
