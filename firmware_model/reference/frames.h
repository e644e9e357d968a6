/* Frames on the UART: 1F 7F, the payload, 1F FF; a payload byte 1F is sent twice.
 *
 * SPDX-License-Identifier: BSD-2-Clause
 */
#ifndef FRAMES_H
#define FRAMES_H

#include <stdbool.h>
#include <stdint.h>

#include "cubestar_tables.h"

#define LONGEST_PAYLOAD (LONGEST_TELECOMMAND + 1)
#define LONGEST_FRAME (2 * LONGEST_TELEMETRY + 4)

/* What a byte brought about. */
enum frame_event { FRAME_NOTHING, FRAME_WHOLE, FRAME_INCOMPLETE, FRAME_PROTOCOL_ERROR };

/* Zero is its state at rest. A payload that is too long keeps its front, one byte too long. */
struct frame_decoder {
    bool inside, escaped;
    int length;
    uint8_t payload[LONGEST_PAYLOAD];
};

enum frame_event frame_feed(struct frame_decoder *decoder, uint8_t byte);

/* Forgets an unfinished frame; whether there was one. */
bool frame_reset(struct frame_decoder *decoder);

bool frame_unfinished(const struct frame_decoder *decoder);

/* Writes the frame that carries a payload; returns its length, 2 * count + 4 at most. */
int frame_encode(uint8_t *frame, const uint8_t *payload, int count);

#endif
