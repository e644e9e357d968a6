/* SPDX-License-Identifier: BSD-2-Clause */
/* Frames on the UART: 1F 7F, the payload, 1F FF; a payload byte 1F is sent twice. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

#define LONGEST_PAYLOAD (LONGEST_TELECOMMAND + 1)
#define LONGEST_FRAME (2 * LONGEST_TELEMETRY + 4)

/* Result of a byte. */
enum frame_event { FRAME_NOTHING, FRAME_WHOLE, FRAME_INCOMPLETE, FRAME_PROTOCOL_ERROR };

/* All zero at rest. Of a payload that is too long the front is kept, one byte more than allowed. */
struct frame_decoder {
    bool inside, escaped;
    int length;
    uint8_t payload[LONGEST_PAYLOAD];
};

enum frame_event frame_feed(struct frame_decoder *decoder, uint8_t byte);

/* Drops an incomplete frame; returns whether there was one. */
bool frame_reset(struct frame_decoder *decoder);

bool frame_unfinished(const struct frame_decoder *decoder);

/* Writes the frame of a payload; returns its length, at most 2 * count + 4. */
int frame_encode(uint8_t *frame, const uint8_t *payload, int count);
